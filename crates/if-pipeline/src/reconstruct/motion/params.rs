//! Parameters of the motion of single frames.

use crate::reconstruct::params::ParamError;
use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// How the motion of single frames is solved.
///
/// The weights are those of the equations of the surface (docs/reconstruction.md), where that of
/// the silhouettes is 1 and that of bending 0.5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionParams {
    /// Frames before and after each that are looked at with it.
    pub window: usize,
    /// Rounds of looking and solving.
    pub rounds: usize,
    /// Weight of the normals.
    pub normals: Real,
    /// Weight of the silhouettes.
    pub silhouettes: Real,
    /// Weight of a step's bending.
    pub bending: Real,
    /// Weight of staying at d = 0.
    pub stay: Real,
    /// A silhouette that lies farther than this from the mask's border is not pulled there, in
    /// metres.
    pub reach: Real,
    /// Longest step of a vertex in a round, in metres.
    pub longest_step: Real,
}

impl Default for MotionParams {
    /// Tuned on rendered captures with motion of 0, 4 and 15 mm (docs/reconstruction.md, "Motion of
    /// single frames").
    fn default() -> Self {
        Self {
            window: 1,
            rounds: 1,
            normals: 1.0,
            silhouettes: 1.0,
            bending: 15.0,
            stay: 0.01,
            reach: 0.03,
            longest_step: 0.03,
        }
    }
}

impl MotionParams {
    /// Whether all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn validate(&self) -> Result<(), ParamError> {
        for (name, value) in [("normals", self.normals), ("silhouettes", self.silhouettes)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ParamError { name, value, needs: "a number of at least zero" });
            }
        }
        let above_zero = [
            ("bending", self.bending),
            ("stay", self.stay),
            ("reach", self.reach),
            ("longest_step", self.longest_step),
        ];
        for (name, value) in above_zero {
            if !(value.is_finite() && value > 0.0) {
                return Err(ParamError { name, value, needs: "a number above zero" });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_out_of_range_is_named() {
        let usual = MotionParams::default();
        assert_eq!(usual.validate(), Ok(()));
        for (bad, name) in [
            (MotionParams { normals: -1.0, ..usual.clone() }, "normals"),
            (MotionParams { stay: 0.0, ..usual.clone() }, "stay"),
            (MotionParams { reach: Real::NAN, ..usual.clone() }, "reach"),
        ] {
            assert_eq!(bad.validate().unwrap_err().name, name);
        }
    }
}
