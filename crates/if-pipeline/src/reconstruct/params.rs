//! Parameters of the surface.

use if_core::math::Real;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Parameters of [`fit_surface`](super::fit_surface). The defaults were chosen on the two sample
/// captures of the project's data (`docs/evidence/reconstruction.md`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceParams {
    /// Rounds of gathering evidence and solving.
    pub rounds: usize,
    /// Weight of the normals.
    pub normals: Real,
    /// Weight of the silhouettes.
    pub silhouettes: Real,
    /// Weight of the bending of a step.
    pub bending: Real,
    /// Distance from the border of the mask within which normals are ignored, in pixels.
    pub normal_margin: Real,
    /// Standard deviation of the Gaussian filter of the distance to the mask's border, in pixels.
    pub border_blur: Real,
    /// Largest distance of a silhouette from the mask's border at which the border attracts it, in
    /// metres. Halved in each round.
    pub reach: Real,
    /// Lower bound of `reach`, in metres.
    pub least_reach: Real,
    /// Largest step of a vertex in a round, in metres.
    pub longest_step: Real,
    /// Tangential smoothing after each round: the share of the way to the mean of its neighbours
    /// that a vertex moves along the surface.
    pub slide: Real,
    /// Least overlap (intersection over union) of mask and posed template; other frames are skipped.
    pub least_overlap: Real,
    /// Distance from the posed template, in metres, beyond which pixels of the person belong to
    /// loose clothes; between two parts of it, such as legs, four fifths of that.
    pub loose: Real,
    /// Least share of such pixels for a start from the union with loose clothes; below, the surface
    /// starts from the template. 1 for always.
    pub least_loose: Real,
    /// Size of the voxels that fill loose clothes, and of the cells of the surface extracted from
    /// them, in metres.
    pub loose_cell: Real,
    /// Rounds, if the surface starts from the union with loose clothes.
    pub loose_rounds: usize,
    /// Weight of the silhouettes in that case. They show only the ridges of folds, and the mesh is
    /// finer than the template.
    pub loose_silhouettes: Real,
    /// Memory limit for the images of all frames, in bytes; they stay in memory for all rounds. It
    /// does not change results, so checkpoints are valid for any limit.
    pub memory: u64,
}

impl Default for SurfaceParams {
    fn default() -> Self {
        Self {
            rounds: 4,
            normals: 1.0,
            silhouettes: 1.0,
            bending: 0.5,
            normal_margin: 1.5,
            border_blur: 1.0,
            reach: 0.15,
            least_reach: 0.02,
            longest_step: 0.03,
            slide: 0.3,
            least_overlap: 0.3,
            loose: 0.05,
            least_loose: 0.0003,
            loose_cell: 0.01,
            loose_rounds: 6,
            loose_silhouettes: 0.3,
            memory: 8 << 30,
        }
    }
}

impl SurfaceParams {
    /// The parameters for a surface that starts from the union with loose clothes.
    pub(super) fn in_loose_clothes(&self) -> Self {
        Self { rounds: self.loose_rounds, silhouettes: self.loose_silhouettes, ..self.clone() }
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
            ("loose_silhouettes", self.loose_silhouettes),
            ("normal_margin", self.normal_margin),
            ("border_blur", self.border_blur),
        ] {
            check(name, value, value.is_finite() && value >= 0.0, "zero or positive")?;
        }
        for (name, value) in [
            ("bending", self.bending),
            ("reach", self.reach),
            ("least_reach", self.least_reach),
            ("longest_step", self.longest_step),
            ("loose", self.loose),
            ("loose_cell", self.loose_cell),
        ] {
            check(name, value, value.is_finite() && value > 0.0, "positive")?;
        }
        for (name, value) in [
            ("slide", self.slide),
            ("least_overlap", self.least_overlap),
            ("least_loose", self.least_loose),
        ] {
            check(name, value, (0.0..=1.0).contains(&value), "from 0 to 1")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_errors() {
        assert_eq!(SurfaceParams::default().validate(), Ok(()));
        let nan = SurfaceParams { silhouettes: Real::NAN, ..Default::default() };
        assert_eq!(nan.validate().unwrap_err().name, "silhouettes");
        let zero = SurfaceParams { bending: 0.0, ..Default::default() };
        assert_eq!(zero.validate().unwrap_err().name, "bending");
        let large = SurfaceParams { slide: 1.5, ..Default::default() };
        assert_eq!(large.validate().unwrap_err().name, "slide");
    }
}
