//! Parameters and errors of alignment.

use crate::skin_weights::SkinError;
use if_core::math::Real;
use if_core::mesh::MeshError;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Parameters of [`BodyMap`](crate::BodyMap).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlignParams {
    /// Number of nearest sites that move a point, at most 1,000. Fewer make the field less smooth far
    /// from the body.
    pub neighbours: usize,
    /// Width of the kernel at the body, in metres. A larger width averages over a limb, so that
    /// tight garments end up inside the body.
    pub least_width: Real,
    /// Width of the kernel as a multiple of the distance to the body.
    pub growth: Real,
    /// Weight of a site that shares no joint with the point, relative to 1 for equal weights.
    pub skin_floor: Real,
    /// Largest mean distance of a registration from the target, as a share of the body's height.
    /// Beyond, a similarity is used instead.
    pub poor: Real,
    /// Largest share of the source's area that a registration may flip. Beyond, a similarity is
    /// used instead.
    pub turned: Real,
    /// Length over which the map's stretch is evened out at the body, in metres. A larger one lets tight
    /// garments keep their own size, and end up inside a larger body.
    pub hold: Real,
    /// Distance from the body at which that length is twice as large, in metres; it grows with the square.
    pub near: Real,
}

impl Default for AlignParams {
    fn default() -> Self {
        Self {
            neighbours: 160,
            least_width: 0.015,
            growth: 1.0,
            skin_floor: 0.1,
            poor: 0.004,
            turned: 0.02,
            hold: 0.01,
            near: 0.02,
        }
    }
}

impl AlignParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let positive = |x: Real| x > 0.0 && x.is_finite();
        let non_negative = |x: Real| x >= 0.0 && x.is_finite();
        let Self { neighbours, least_width, growth, skin_floor, poor, turned, hold, near } = *self;
        let check = ParameterError::check;
        let some = (4..=1000).contains(&neighbours);
        check("neighbours", neighbours as Real, some, "from 4 to 1,000")?;
        check("least_width", least_width, positive(least_width), "positive (m)")?;
        check("growth", growth, non_negative(growth), "zero or positive")?;
        check("skin_floor", skin_floor, positive(skin_floor), "positive")?;
        check("poor", poor, non_negative(poor), "zero or positive")?;
        check("turned", turned, non_negative(turned), "zero or positive")?;
        check("hold", hold, positive(hold), "positive (m)")?;
        check("near", near, positive(near), "positive (m)")
    }
}

/// A garment cannot be aligned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum AlignError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A body has no height.
    #[error("the {which} body is {height} m high; give a mesh of a person, in metres")]
    NoHeight { which: &'static str, height: Real },
    /// A body has no triangles.
    #[error("the {which} body has no triangles; give a surface, not a point cloud")]
    NoSurface { which: &'static str },
    /// Skinning weights do not match a mesh or a pose.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// A position is not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_neighbours_has_bounds() {
        for (neighbours, valid) in [(3, false), (4, true), (1000, true), (usize::MAX, false)] {
            let params = AlignParams { neighbours, ..Default::default() };
            assert_eq!(params.validate().is_ok(), valid, "{neighbours}");
        }
    }
}
