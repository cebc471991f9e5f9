//! Sources of the vertices of a changed mesh.

use if_core::math::Real;

/// What a vertex of a changed mesh was made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A vertex of the mesh before, or a copy of it.
    Vertex(u32),
    /// A new vertex: vertices of the mesh before with positive weights, the largest weight first.
    Blend(Vec<(u32, Real)>),
}

impl Source {
    /// The vertex of the largest weight.
    pub fn nearest(&self) -> u32 {
        match self {
            Self::Vertex(v) => *v,
            Self::Blend(parts) => parts.first().map_or(0, |p| p.0),
        }
    }

    /// The vertices with their weights.
    pub(crate) fn parts(&self) -> Vec<(u32, Real)> {
        match self {
            Self::Vertex(v) => vec![(*v, 1.0)],
            Self::Blend(parts) => parts.clone(),
        }
    }
}
