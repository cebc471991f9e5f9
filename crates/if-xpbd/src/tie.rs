//! Ties between the sheets of a fold: a vertex keeps its offset from a triangle.

use crate::constraint::{Constraint, Residual};
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;

/// Vertices that move with a triangle, like the layers of a hem, a cuff or a lapel.
///
/// A vertex v near the point q = Σ bᵢ xᵢ of a triangle keeps its offset o from it as a vector of
/// the world: both have the same displacement. A visit removes the share k ∈ [0, 1] of the
/// violation:
///
/// ```text
/// C = x_v − Σ bᵢ xᵢ − o        Δx_v = −k w_v C / S,   Δxᵢ = k wᵢ bᵢ C / S,   S = w_v + Σ wᵢ bᵢ²
/// ```
///
/// The constraint is linear, so it is stable for triangles of any shape, and keeps momentum. It
/// resists rotation: it is meant for corrections that are small against the garment. (Offsets in
/// the triangle's own frame follow rotations, but frames of slivers spin: measured on a suit jacket,
/// edge strain rms 12 % instead of 1 %.)
///
/// # Source
///
/// Ours. Contacts cannot hold such sheets: they are closer together than a correction moves them.
#[derive(Clone, Debug, Default)]
pub struct Ties {
    vertices: Vec<[u32; 4]>,
    barycentric: Vec<[Real; 3]>,
    offsets: Vec<Vector>,
    shares: Vec<Real>,
}

/// Why a tie is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TieError {
    /// The vertex or a corner of the triangle does not exist.
    #[error(
        "tie {tie} names vertex {vertex}, but there are only {vertices} positions (0 is the first)"
    )]
    IndexOutOfRange {
        /// Index of the tie.
        tie: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of positions.
        vertices: usize,
    },
    /// The share is out of range, or a barycentric coordinate is not finite.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

impl Ties {
    /// No ties.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of ties.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are no ties.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// The ties with at least one movable particle (inverse mass not 0).
    ///
    /// # Panics
    ///
    /// If there are fewer inverse masses than particles named.
    pub fn movable(&self, inverse_masses: &[Real]) -> Self {
        let mut part = Self::new();
        for (k, vertices) in self.vertices.iter().enumerate() {
            if vertices.iter().any(|v| inverse_masses[*v as usize] != 0.0) {
                part.vertices.push(*vertices);
                part.barycentric.push(self.barycentric[k]);
                part.offsets.push(self.offsets[k]);
                part.shares.push(self.shares[k]);
            }
        }
        part
    }

    /// Ties `vertex` to the point `barycentric` of `triangle` with `share` k, at rest at
    /// `positions`.
    ///
    /// # Errors
    ///
    /// A vertex beyond `positions`, a share outside [0, 1], or a barycentric coordinate that is not
    /// finite. Nothing is added then.
    pub fn push(
        &mut self,
        vertex: u32,
        triangle: [u32; 3],
        barycentric: [Real; 3],
        share: Real,
        positions: &[Point],
    ) -> Result<(), TieError> {
        let (tie, [a, b, c], vertices) = (self.len(), triangle, positions.len());
        if let Some(vertex) = [vertex, a, b, c].into_iter().find(|v| *v as usize >= vertices) {
            return Err(TieError::IndexOutOfRange { tie, vertex, vertices });
        }
        ParameterError::check_share("share", share).map_err(|e| e.at(tie))?;
        for x in barycentric {
            ParameterError::check("barycentric", x, x.is_finite(), "finite")
                .map_err(|e| e.at(tie))?;
        }
        let corners = triangle.map(|v| positions[v as usize]);
        let offset = positions[vertex as usize].coords - blend(&corners, barycentric);
        self.vertices.push([vertex, triangle[0], triangle[1], triangle[2]]);
        self.barycentric.push(barycentric);
        self.offsets.push(offset);
        self.shares.push(share);
        Ok(())
    }
}

impl Constraint for Ties {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
    }

    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        for k in 0..self.vertices.len() {
            let [v, a, b, c] = self.vertices[k].map(|i| i as usize);
            let corners = [positions[a], positions[b], positions[c]];
            let bary = self.barycentric[k];
            let off = positions[v].coords - blend(&corners, bary) - self.offsets[k];
            let size2 = off.norm_squared();
            residual.active += 1;
            residual.sum_squares += size2;
            residual.max = residual.max.max(size2.sqrt());
            let w = [inverse_masses[v], inverse_masses[a], inverse_masses[b], inverse_masses[c]];
            let sum = w[0]
                + w[1] * bary[0] * bary[0]
                + w[2] * bary[1] * bary[1]
                + w[3] * bary[2] * bary[2];
            if sum > 0.0 {
                let step = off * (self.shares[k] / sum);
                positions[v] -= step * w[0];
                positions[a] += step * (w[1] * bary[0]);
                positions[b] += step * (w[2] * bary[1]);
                positions[c] += step * (w[3] * bary[2]);
            }
        }
        residual
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }
}

fn blend(c: &[Point; 3], b: [Real; 3]) -> Vector {
    c[0].coords * b[0] + c[1].coords * b[1] + c[2].coords * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folded() -> Vec<Point> {
        vec![
            Point::new(0.3, 0.3, 0.002),
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
        ]
    }

    #[test]
    fn an_invalid_tie_is_refused_and_named() {
        let (x, mut ties) = (folded(), Ties::new());
        ties.push(0, [1, 2, 3], [0.4, 0.3, 0.3], 1.0, &x).unwrap();
        for share in [5.0, -0.1, Real::NAN] {
            let error = ties.push(0, [1, 2, 3], [0.4, 0.3, 0.3], share, &x).unwrap_err();
            assert!(matches!(error, TieError::Parameter(e) if e.name == "share[1]"), "{share}");
        }
        let error = ties.push(0, [1, 2, 3], [0.5, Real::NAN, 0.5], 1.0, &x).unwrap_err();
        assert!(matches!(error, TieError::Parameter(e) if e.name == "barycentric[1]"));
        for (vertex, triangle) in [(4, [1, 2, 3]), (0, [1, 4, 3])] {
            assert_eq!(
                ties.push(vertex, triangle, [0.4, 0.3, 0.3], 1.0, &x).unwrap_err(),
                TieError::IndexOutOfRange { tie: 1, vertex: 4, vertices: 4 }
            );
        }
        assert_eq!(ties.len(), 1);
    }

    #[test]
    fn a_tied_vertex_is_at_rest_after_a_translation() {
        let x = folded();
        let mut ties = Ties::new();
        ties.push(0, [1, 2, 3], [0.4, 0.3, 0.3], 1.0, &x).unwrap();
        let mut moved: Vec<Point> = x.iter().map(|p| p + Vector::new(5.0, -2.0, 1.0)).collect();
        assert!(ties.project(&mut moved, &[1.0; 4], 1.0).max < 1e-14);
    }

    #[test]
    fn a_vertex_pushed_through_returns_to_its_side_and_momentum_is_kept() {
        let x = folded();
        let mut ties = Ties::new();
        ties.push(0, [1, 2, 3], [0.4, 0.3, 0.3], 0.5, &x).unwrap();
        let mut y = x.clone();
        y[0].z = -0.01;
        let before: Vector = y.iter().map(|p| p.coords).sum();
        for _ in 0..40 {
            ties.project(&mut y, &[1.0; 4], 1.0);
        }
        let after: Vector = y.iter().map(|p| p.coords).sum();
        approx::assert_relative_eq!(before, after, epsilon = 1e-15);
        let n = (y[2] - y[1]).cross(&(y[3] - y[1]));
        assert!(n.dot(&(y[0] - y[1])) > 0.0);
    }

    #[test]
    fn a_triangle_without_area_works_like_any_other() {
        let mut x = vec![Point::origin(); 4];
        let mut ties = Ties::new();
        ties.push(0, [1, 2, 3], [1.0, 0.0, 0.0], 1.0, &x).unwrap();
        x[0].x = 1.0;
        ties.project(&mut x, &[1.0, 0.0, 0.0, 0.0], 1.0);
        assert_eq!(x[0], Point::origin());
    }
}
