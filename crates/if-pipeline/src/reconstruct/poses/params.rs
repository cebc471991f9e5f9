//! Parameters of the refinement of poses.

use crate::capture::PoseSigma;
use if_core::math::Real;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Errors in degrees and metres to which smaller ones are raised: a hundredth of a pixel at the end
/// of an arm. Zero has no finite weight.
const LEAST: (Real, Real) = (0.01, 1e-4);

/// Parameters of [`refine_poses`](super::refine_poses). The defaults were chosen on rendered captures
/// with noisy poses (`docs/evidence/reconstruction.md`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseParams {
    /// How far the given poses are off.
    pub sigma: PoseSigma,
    /// Standard deviation of a constant turn of the camera about each axis, in degrees: its
    /// orientation is refined, too, where masks show an error beyond that of the roots' positions,
    /// and its focal length where it is off by more than 1.5 %. 0 for an exact camera. [`reconstruct`](super::super::reconstruct) uses what the capture states.
    pub camera_degrees: Real,
    /// Rounds of fitting the surface, and then the poses.
    pub rounds: usize,
    /// Gauss–Newton steps of the poses in a round.
    pub steps: usize,
    /// Largest distance of a silhouette from the mask's border at which the border attracts it, in
    /// metres. Halved in each round.
    pub reach: Real,
    /// Lower bound of `reach`, in metres.
    pub least_reach: Real,
    /// Standard deviation of a silhouette vertex, in metres: more than the noise of one, since
    /// neighbours err together.
    pub silhouette_sigma: Real,
    /// Standard deviation of an observed normal, as a length of difference of unit vectors; more
    /// than the noise of one.
    pub normal_sigma: Real,
    /// Standard deviation of the normals' Gaussian filter, in pixels.
    pub normal_blur: Real,
    /// Lower bound of a joint's angular acceleration: root of the mean square change of its rotation
    /// from one frame to the next, in degrees. What the poses show beyond their noise is added.
    pub acceleration_degrees: Real,
    /// The same for the root's position along each axis, in metres.
    pub acceleration: Real,
    /// Share of the label votes of a vertex for skin from which it lies on the template.
    pub skin: Real,
}

impl Default for PoseParams {
    fn default() -> Self {
        Self {
            sigma: PoseSigma::default(),
            camera_degrees: 1.0,
            rounds: 6,
            steps: 2,
            reach: 0.15,
            least_reach: 0.03,
            silhouette_sigma: 0.02,
            normal_sigma: 1.4,
            normal_blur: 1.5,
            acceleration_degrees: 0.3,
            acceleration: 0.0023,
            skin: 0.7,
        }
    }
}

impl PoseParams {
    /// The defaults for poses with a stated error.
    pub fn of(sigma: PoseSigma) -> Self {
        Self { sigma, ..Self::default() }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        self.sigma.validate().map_err(|e| e.within("sigma"))?;
        for (name, value) in [
            ("reach", self.reach),
            ("least_reach", self.least_reach),
            ("silhouette_sigma", self.silhouette_sigma),
            ("normal_sigma", self.normal_sigma),
            ("acceleration_degrees", self.acceleration_degrees),
            ("acceleration", self.acceleration),
        ] {
            ParameterError::check_positive(name, value)?;
        }
        let camera = self.camera_degrees;
        check("camera_degrees", camera, (0.0..=30.0).contains(&camera), "from 0 to 30 (degrees)")?;
        let blur = self.normal_blur;
        check("normal_blur", blur, (0.0..=20.0).contains(&blur), "from 0 to 20 (pixels)")?;
        check("skin", self.skin, (0.0..=1.0).contains(&self.skin), "from 0 to 1")
    }

    /// Standard deviations of a joint's rotation about each axis, in radians, and of the root's
    /// position along each, in metres; at least [`LEAST`].
    pub(super) fn axis_sigmas(&self) -> (Real, Real) {
        let PoseSigma { degrees, translation } = self.sigma;
        (degrees.max(LEAST.0).to_radians() / Real::sqrt(3.0), translation.max(LEAST.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_errors() {
        assert_eq!(PoseParams::default().validate(), Ok(()));
        for (params, name) in [
            (PoseParams::of(PoseSigma { degrees: -1.0, translation: 0.0 }), "sigma.degrees"),
            (
                PoseParams::of(PoseSigma { degrees: 1.0, translation: Real::NAN }),
                "sigma.translation",
            ),
            (PoseParams { normal_sigma: 0.0, ..Default::default() }, "normal_sigma"),
            (PoseParams { normal_blur: -1.0, ..Default::default() }, "normal_blur"),
            (PoseParams { skin: 1.5, ..Default::default() }, "skin"),
        ] {
            assert_eq!(params.validate().unwrap_err().name, name);
        }
    }
}
