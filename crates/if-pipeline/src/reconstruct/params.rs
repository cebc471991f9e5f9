//! How the surface is found.

use if_core::math::Real;
use serde::{Deserialize, Serialize};

/// How a surface is fitted to masks and normals. The defaults were chosen on the two sample
/// captures of the project's data (`docs/reconstruction.md`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceParams {
    /// Rounds of looking and solving.
    pub rounds: usize,
    /// Weight of the normals.
    pub normals: Real,
    /// Weight of the silhouettes.
    pub silhouettes: Real,
    /// Weight of a step's bending.
    pub bending: Real,
    /// Normals nearer than this to the border of the mask are not used, in pixels.
    pub normal_margin: Real,
    /// Standard deviation of the Gaussian that smooths the distance from the mask's border, in
    /// pixels.
    pub border_blur: Real,
    /// A silhouette that lies farther than this from the mask's border is not pulled there, in
    /// metres. Halved each round.
    pub reach: Real,
    /// What `reach` does not fall below, in metres.
    pub least_reach: Real,
    /// Longest step of a vertex in a round, in metres.
    pub longest_step: Real,
    /// Share of the way to the middle of its neighbours that a vertex slides along the surface
    /// after each round.
    pub slide: Real,
    /// A frame whose mask and posed template share less than this part of their union is skipped.
    pub least_overlap: Real,
    /// Pixels of the person farther than this from the posed template, in metres, belong to loose
    /// clothes.
    pub loose: Real,
    /// Where less than this share of the masks' pixels is such, the surface starts from the
    /// template as it is. 1 for always.
    pub least_loose: Real,
    /// Side of the voxels in which the inside of loose clothes is found, and of the cells of the
    /// surface that starts there, in metres.
    pub loose_cell: Real,
    /// Rounds, where the surface starts from the union with loose clothes.
    pub loose_rounds: usize,
    /// Weight of the silhouettes there. Of folds they only show the ridges, and the mesh is finer
    /// than the template.
    pub loose_silhouettes: Real,
    /// Bytes that the images of all frames may take: they are kept from the first round to the
    /// last. More is an error before any is read. Changes no result, so that a checkpoint holds for
    /// any.
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
            least_loose: 0.001,
            loose_cell: 0.01,
            loose_rounds: 6,
            loose_silhouettes: 0.3,
            memory: 8 << 30,
        }
    }
}

/// A parameter that is out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}: {needs}")]
#[non_exhaustive]
pub struct ParamError {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: Real,
    /// What it has to be.
    pub needs: &'static str,
}

impl SurfaceParams {
    /// Those for a surface that starts from the union with loose clothes.
    pub(super) fn in_loose_clothes(&self) -> Self {
        Self { rounds: self.loose_rounds, silhouettes: self.loose_silhouettes, ..self.clone() }
    }

    /// Whether all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn validate(&self) -> Result<(), ParamError> {
        let at_least_zero = [
            ("normals", self.normals),
            ("silhouettes", self.silhouettes),
            ("loose_silhouettes", self.loose_silhouettes),
            ("normal_margin", self.normal_margin),
            ("border_blur", self.border_blur),
        ];
        for (name, value) in at_least_zero {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ParamError { name, value, needs: "a number of at least zero" });
            }
        }
        for (name, value) in [
            ("bending", self.bending),
            ("reach", self.reach),
            ("least_reach", self.least_reach),
            ("longest_step", self.longest_step),
            ("loose", self.loose),
            ("loose_cell", self.loose_cell),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ParamError { name, value, needs: "a number above zero" });
            }
        }
        for (name, value) in [
            ("slide", self.slide),
            ("least_overlap", self.least_overlap),
            ("least_loose", self.least_loose),
        ] {
            if !(0.0..=1.0).contains(&value) {
                return Err(ParamError { name, value, needs: "a number from 0 to 1" });
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
        assert_eq!(SurfaceParams::default().validate(), Ok(()));
        let nan = SurfaceParams { silhouettes: Real::NAN, ..Default::default() };
        assert_eq!(nan.validate().unwrap_err().name, "silhouettes");
        let zero = SurfaceParams { bending: 0.0, ..Default::default() };
        assert_eq!(zero.validate().unwrap_err().name, "bending");
        let large = SurfaceParams { slide: 1.5, ..Default::default() };
        assert_eq!(large.validate().unwrap_err().name, "slide");
    }
}
