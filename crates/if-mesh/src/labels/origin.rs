//! Origins of the vertices of cut pieces.

use if_core::math::Real;

/// Origin of a vertex of a piece: barycentric coordinates in vertices of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// Vertices of the mesh. If fewer are needed, the first one fills the remaining places.
    pub vertices: [u32; 3],
    /// Their weights: not negative, of sum 1, zero in unused places.
    pub weights: [Real; 3],
}

impl Origin {
    pub(super) fn vertex(v: u32) -> Self {
        Self { vertices: [v; 3], weights: [1.0, 0.0, 0.0] }
    }

    /// The vertex of the mesh, if this is one.
    pub fn source(&self) -> Option<u32> {
        (self.weights[0] == 1.0).then_some(self.vertices[0])
    }

    /// The edge of the mesh that this vertex lies on, if it does: the smaller vertex first, and the
    /// share of the way from there.
    pub fn edge(&self) -> Option<([u32; 2], Real)> {
        let [_, s, other] = self.weights;
        (s > 0.0 && other == 0.0).then_some(([self.vertices[0], self.vertices[1]], s))
    }

    /// Interpolates a number of the mesh's vertices.
    #[inline]
    pub fn value(&self, of: impl Fn(u32) -> Real) -> Real {
        self.vertices
            .iter()
            .zip(self.weights)
            .filter(|(_, w)| *w > 0.0)
            .map(|(v, w)| w * of(*v))
            .sum()
    }

    /// The vertices with positive weights, the largest weight first, of equals the smaller index: for
    /// attributes that cannot be interpolated.
    pub fn parts(&self) -> Vec<(u32, Real)> {
        let mut parts: Vec<(u32, Real)> =
            self.vertices.into_iter().zip(self.weights).filter(|(_, w)| *w > 0.0).collect();
        parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        parts
    }
}
