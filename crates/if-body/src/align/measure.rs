//! Reports of alignments.

use super::{BodyMap, Method};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::{Displacement, Strain, displacement, strain};
use if_mesh::seams::weld_all;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Report of an alignment. Strain is relative to the garment on its own body: most of it is the
/// difference of the bodies, which a garment made for the other body would have, too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AlignReport {
    /// How the bodies were matched.
    pub method: Method,
    /// [`BodyMap::residual`], in metres.
    pub residual: Real,
    /// Displacement of the vertices.
    pub moved: Displacement,
    /// Strain of the edges.
    pub strain: Strain,
    /// Share of vertices inside the body: the source body before, the target body after.
    pub inside: [Real; 2],
    /// Triangle pairs of the garment that intersect at rest, on the source body. Seams are closed.
    pub own_pairs: usize,
}

/// Measures the garment before and after, each against its body.
///
/// # Panics
///
/// If the two garments have different numbers of vertices.
pub fn measure(
    map: &BodyMap,
    (before, own): (&TriMesh, &ClosedLayer),
    (after, other): (&TriMesh, &ClosedLayer),
) -> AlignReport {
    AlignReport {
        method: map.method(),
        residual: map.residual(),
        moved: displacement(before.vertices(), after.vertices()),
        strain: strain(before, after.vertices()),
        inside: [inside(before, own), inside(after, other)],
        own_pairs: own_pairs_sewn(before),
    }
}

/// Triangle pairs of a garment that intersect, as verification counts them.
fn own_pairs_sewn(garment: &TriMesh) -> usize {
    let sewn = weld_all(garment);
    let mesh = sewn.as_ref().map_or(garment, |sewn| &sewn.mesh);
    own_pairs(mesh, &Bvh::new(mesh)).len()
}

/// Share of a garment's vertices inside a body.
pub fn inside(garment: &TriMesh, body: &ClosedLayer) -> Real {
    let is_inside =
        |p: &&if_core::math::Point| body.sided(p, 0.0).is_some_and(|s| s.distance < 0.0);
    garment.vertices().par_iter().filter(is_inside).count() as Real
        / garment.vertices().len().max(1) as Real
}
