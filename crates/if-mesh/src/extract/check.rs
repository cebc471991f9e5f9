//! The distance of a mesh from the surface, and sheets that are too near for the lattice.

use crate::extract::budget::Budget;
use crate::extract::lattice::Lattice;
use crate::extract::params::ExtractParams;
use crate::extract::report::{ErrorEstimate, Warning};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use if_core::random::SplitMix64;

/// Maximum cosine between the normals of two sheets that face one another, or away from one another.
/// On one smooth sheet two crossings of a lattice line within two cells have nearly the same normal
/// where the line grazes it.
const FACING: Real = -0.5;

/// Sheets that face one another nearer than two cells.
pub(super) struct NearSheets {
    /// Pairs of vertices.
    pairs: usize,
    /// Smallest distance of a pair, in metres.
    gap: Real,
}

impl NearSheets {
    pub(super) fn warning(&self) -> Option<Warning> {
        (self.pairs > 0).then_some(Warning::NearSheets { pairs: self.pairs, gap: self.gap })
    }
}

/// Sheets nearer than two cells, found by `pairs` of vertices on lattice lines and the field's
/// gradient at all vertices. None are found without gradients.
pub(super) fn near_sheets(
    mesh: &TriMesh,
    samples: &[FieldSample],
    pairs: &[[u32; 2]],
    lattice: &Lattice,
) -> NearSheets {
    let mut near = NearSheets { pairs: 0, gap: Real::INFINITY };
    for [a, b] in pairs.iter().map(|p| p.map(|v| v as usize)) {
        let (Some(at), Some(bt)) = (samples.get(a), samples.get(b)) else { continue };
        let gap = (mesh.vertices()[a] - mesh.vertices()[b]).norm();
        if gap < 2.0 * lattice.cell
            && unit_or_zero(&at.gradient).dot(&unit_or_zero(&bt.gradient)) < FACING
        {
            near.pairs += 1;
            near.gap = near.gap.min(gap);
        }
    }
    near
}

/// Measures the error at vertices and triangle centres chosen by the seed.
pub(super) fn error_estimate(
    field: &dyn SignedDistance,
    mesh: &TriMesh,
    params: &ExtractParams,
    budget: &mut Budget,
) -> Result<ErrorEstimate, Cancelled> {
    if mesh.triangles().is_empty() || params.check == 0 {
        return Ok(ErrorEstimate::default());
    }
    let mut random = SplitMix64::new(params.seed);
    // Stratified: one from each of equal parts.
    let mut choose = |n: usize| -> Vec<usize> {
        let count = params.check.min(n);
        (0..count)
            .map(|k| {
                ((((k as Real) + random.unit()) / count as Real * n as Real) as usize).min(n - 1)
            })
            .collect()
    };
    let mut points: Vec<Point> =
        choose(mesh.vertices().len()).into_iter().map(|v| mesh.vertices()[v]).collect();
    let vertices = points.len();
    points.extend(
        choose(mesh.triangles().len())
            .into_iter()
            .map(|t| barycentric_point(mesh.corners(t), [1.0 / 3.0; 3])),
    );
    let mut samples = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
    field.samples(&points, &mut samples);
    budget.evaluated("check", points.len())?;
    let (vertex_max, vertex_rms) = summary(&samples[..vertices]);
    let (center_max, center_rms) = summary(&samples[vertices..]);
    Ok(ErrorEstimate { vertex_max, vertex_rms, center_max, center_rms, checked: vertices })
}

/// Largest and root mean square of the distances |φ| / |∇φ|.
fn summary(samples: &[FieldSample]) -> (Real, Real) {
    /// Below this slope the field is no distance, and its value is used as it is.
    const FLAT: Real = 0.1;
    let distance = |s: &FieldSample| s.distance.abs() / s.gradient.norm().max(FLAT);
    let (most, squares) = samples
        .iter()
        .map(distance)
        .fold((0.0, 0.0), |(m, q): (Real, Real), d| (m.max(d), q + d * d));
    (most, (squares / samples.len().max(1) as Real).sqrt())
}
