//! How to align, and why it cannot be done.

use if_core::math::Real;
use if_core::mesh::MeshError;
use serde::{Deserialize, Serialize};

/// How [`super::BodyMap`] carries points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlignParams {
    /// Sites that a point is carried by. Fewer make the field less smooth far from the body.
    pub neighbours: usize,
    /// Width of the kernel next to the body, in metres. Wider averages over a limb: what is tight
    /// goes inside.
    pub least_width: Real,
    /// Width of the kernel as a multiple of the distance to the body.
    pub growth: Real,
    /// Weight of a site that shares no joint with the point, against 1 of one that shares all.
    pub skin_floor: Real,
    /// A registration whose mean distance to the target is more than this share of the body's
    /// height is given up.
    pub poor: Real,
    /// A registration that turns over more than this share of the source's area is given up.
    pub turned: Real,
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
        }
    }
}

impl AlignParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`AlignError::Parameter`] with the first out of range.
    pub fn validate(&self) -> Result<(), AlignError> {
        let positive = |x: Real| x > 0.0 && x.is_finite();
        let checks = [
            ("neighbours", self.neighbours as Real, self.neighbours >= 4, "it must be at least 4"),
            (
                "least_width",
                self.least_width,
                positive(self.least_width),
                "it must be a positive number of metres",
            ),
            (
                "growth",
                self.growth,
                self.growth >= 0.0 && self.growth.is_finite(),
                "it must be a number, zero or more",
            ),
            (
                "skin_floor",
                self.skin_floor,
                positive(self.skin_floor),
                "it must be a number above zero",
            ),
            (
                "poor",
                self.poor,
                self.poor >= 0.0 && self.poor.is_finite(),
                "it must be a share, zero or more",
            ),
            (
                "turned",
                self.turned,
                self.turned >= 0.0 && self.turned.is_finite(),
                "it must be a share, zero or more",
            ),
        ];
        match checks.into_iter().find(|c| !c.2) {
            Some((name, value, _, help)) => Err(AlignError::Parameter { name, value, help }),
            None => Ok(()),
        }
    }
}

/// Why a garment is not aligned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum AlignError {
    /// A parameter is out of range.
    #[error("parameter `{name}` of the alignment is {value}; {help}")]
    Parameter { name: &'static str, value: Real, help: &'static str },
    /// A body that is a point or nothing.
    #[error("the {which} body is {height} m high; give a mesh of a person, in metres")]
    NoHeight { which: &'static str, height: Real },
    /// A body without triangles.
    #[error("the {which} body has no triangles; give a surface, not a cloud of points")]
    NoSurface { which: &'static str },
    /// Weights for another mesh.
    #[error("{records} records of skinning weights for {points} points; one each is needed")]
    SkinCount { points: usize, records: usize },
    /// A weight for a joint that the pose does not have.
    #[error("a vertex hangs on joint {joint}, but the pose has {joints} joints (0 is the first)")]
    Joint { joint: usize, joints: usize },
    /// The transforms of a vertex cancel one another.
    #[error(
        "the blended transform of vertex {vertex} has no inverse; correct its weights, or give another pose"
    )]
    Singular { vertex: usize },
    /// A position is no number.
    #[error("{0}")]
    Mesh(MeshError),
}
