//! Parameters of the motion of single frames.

use if_core::math::Real;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Parameters of [`fit_motion`](crate::reconstruct::fit_motion).
///
/// The weights are those of the equations of the surface (docs/evidence/reconstruction.md), where
/// the silhouettes have weight 1 and bending 0.5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionParams {
    /// Number of frames before and after each frame that are evaluated with it.
    pub window: usize,
    /// Rounds of gathering evidence and solving.
    pub rounds: usize,
    /// Weight of the normals.
    pub normals: Real,
    /// Weight of the silhouettes.
    pub silhouettes: Real,
    /// Weight of the bending of a step.
    pub bending: Real,
    /// Weight of d = 0.
    pub stay: Real,
    /// Largest distance of a silhouette from the mask's border at which the border attracts it, in
    /// metres.
    pub reach: Real,
    /// Largest step of a vertex in a round, in metres.
    pub longest_step: Real,
}

impl Default for MotionParams {
    /// Tuned on rendered captures with motion of 0, 4 and 15 mm (docs/evidence/reconstruction.md,
    /// "Motion of single frames").
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
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        for (name, value) in [("normals", self.normals), ("silhouettes", self.silhouettes)] {
            check(name, value, value.is_finite() && value >= 0.0, "zero or positive")?;
        }
        for (name, value) in [
            ("bending", self.bending),
            ("stay", self.stay),
            ("reach", self.reach),
            ("longest_step", self.longest_step),
        ] {
            check(name, value, value.is_finite() && value > 0.0, "positive")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_errors() {
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
