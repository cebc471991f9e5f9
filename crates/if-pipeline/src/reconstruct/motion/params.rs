//! Parameters of the motion of single frames.

use super::joint::Prior;
use crate::reconstruct::refine::{STAY, Weights};
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
    /// Rounds of gathering evidence and solving.
    pub rounds: usize,
    /// Weight of the normals.
    pub normals: Real,
    /// Weight of the silhouettes.
    pub silhouettes: Real,
    /// Weight of the bending of the mean of d over the frames, in a step.
    pub mean_bending: Real,
    /// Weight of the bending of d about its mean.
    pub bending: Real,
    /// Weight of d staying at its mean.
    pub stay: Real,
    /// Weight of the change of d's change from frame to frame.
    pub acceleration: Real,
    /// Root mean square of d, in metres, from which on `stay` and `acceleration` fall by its square
    /// in the next round: they are for noise, and clothes may move more.
    pub still: Real,
    /// Least share of them that is left.
    pub loosest: Real,
    /// Largest distance of a silhouette from the mask's border at which the border attracts it, in
    /// metres.
    pub reach: Real,
    /// Largest step of a vertex in a round, in metres.
    pub longest_step: Real,
}

impl Default for MotionParams {
    /// Tuned on rendered captures with motion of 0 and 15 mm, judged on others (docs/evidence/reconstruction.md,
    /// "Motion of single frames").
    fn default() -> Self {
        Self {
            rounds: 3,
            normals: 1.0,
            silhouettes: 3.0,
            mean_bending: 5.0,
            bending: 8.0,
            stay: 0.01,
            acceleration: 0.1,
            still: 0.001,
            loosest: 0.05,
            reach: 0.03,
            longest_step: 0.03,
        }
    }
}

impl MotionParams {
    /// The weights of the evidence.
    pub(super) fn weights(&self) -> Weights {
        let Self { normals, silhouettes, bending, longest_step, .. } = *self;
        Weights { normals, silhouettes, bending, longest_step }
    }

    /// The prior in time, for motion of which a root mean square was found so far.
    pub(super) fn prior(&self, found: Real) -> Prior {
        let Self { mean_bending, bending, stay, acceleration, still, loosest, .. } = *self;
        let share = if found > still { (still / found).powi(2).max(loosest) } else { 1.0 };
        let (stay, acceleration) = (share * stay, share * acceleration);
        Prior { mean_stay: STAY, mean_bending, stay, bending, acceleration }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        for (name, value) in [
            ("normals", self.normals),
            ("silhouettes", self.silhouettes),
            ("acceleration", self.acceleration),
        ] {
            check(name, value, value.is_finite() && value >= 0.0, "zero or positive")?;
        }
        for (name, value) in [
            ("mean_bending", self.mean_bending),
            ("bending", self.bending),
            ("stay", self.stay),
            ("still", self.still),
            ("reach", self.reach),
            ("longest_step", self.longest_step),
        ] {
            check(name, value, value.is_finite() && value > 0.0, "positive")?;
        }
        let share = self.loosest > 0.0 && self.loosest <= 1.0;
        check("loosest", self.loosest, share, "above 0, at most 1")?;
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
            (MotionParams { loosest: 2.0, ..usual.clone() }, "loosest"),
            (MotionParams { reach: Real::NAN, ..usual.clone() }, "reach"),
        ] {
            assert_eq!(bad.validate().unwrap_err().name, name);
        }
    }
}
