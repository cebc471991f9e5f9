//! The proof: exact intersections of every layer with every layer below it, and sides by closed fields.

use crate::outfit::{Layer, Outfit, OutfitError};
use crate::report::{PairCount, PairReport, Verification};
use if_core::intersect::Contact;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use std::time::Instant;

/// Checks an outfit without changing it: intersecting triangle pairs of all layers, vertices on the
/// wrong side of a layer below, and every garment's intersections with itself.
///
/// # Errors
///
/// The outfit is not usable: see [`OutfitError`].
pub fn verify(outfit: &Outfit) -> Result<Verification, OutfitError> {
    outfit.check()?;
    let body = ClosedLayer::body(&outfit.body.mesh);
    let mut below = vec![(&outfit.body, body)];
    let mut verification = Verification::default();
    let start = Instant::now();
    for garment in &outfit.garments {
        let closed = ClosedLayer::garment(&garment.mesh, &below[0].1, &outfit.body.mesh);
        let inner: Vec<(&str, &ClosedLayer)> = below.iter().map(|(l, c)| (l.name.as_str(), c)).collect();
        let found = against(garment, &garment.mesh, closed.bvh(), &inner);
        verification.pairs.extend(found);
        verification.own_pairs.push(own_pairs(&garment.mesh, closed.bvh()).len());
        below.push((garment, closed));
    }
    verification.seconds = start.elapsed().as_secs_f64();
    Ok(verification)
}

/// `outer`, with the positions of `mesh`, against the layers `below`.
pub(crate) fn against(outer: &Layer, mesh: &TriMesh, tree: &Bvh, below: &[(&str, &ClosedLayer)]) -> Vec<PairReport> {
    below
        .iter()
        .map(|(name, inner)| {
            let found = pairs(inner.bvh(), tree);
            let count = |contact| found.iter().filter(|p| p.contact == contact).count();
            let depths: Vec<Real> = mesh
                .vertices()
                .par_iter()
                .filter_map(|p| inner.sided(p, 0.0).filter(|s| s.distance < 0.0).map(|s| -s.distance))
                .collect();
            PairReport {
                inner: (*name).to_owned(),
                outer: outer.name.clone(),
                pairs: PairCount {
                    crossing: count(Contact::Crossing),
                    touching: count(Contact::Touching),
                    coplanar: count(Contact::Coplanar),
                },
                vertices_inside: depths.len(),
                vertices: mesh.vertices().len(),
                deepest: depths.iter().copied().fold(0.0, Real::max),
            }
        })
        .collect()
}
