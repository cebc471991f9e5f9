//! The proof: exact intersections of every layer with every layer below it, and sides by closed
//! fields.

use crate::outfit::{Layer, Outfit, OutfitError};
use crate::report::{PairCount, PairReport, Verification};
use crate::welded::Sewn;
use if_core::intersect::Contact;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Checks an outfit without changing it: intersecting triangle pairs of all layers, vertices on the
/// wrong side of a layer below, and every garment's intersections with itself.
///
/// Seams count as closed, vertices that stand in one place along them as one ([`if_mesh::seams`]),
/// vertices of no triangle as none.
///
/// # Errors
///
/// The outfit is not usable: see [`OutfitError`].
pub fn verify(outfit: &Outfit) -> Result<Verification, OutfitError> {
    outfit.check()?;
    let sewn = Sewn::new(outfit, true);
    Ok(verify_layers(sewn.as_ref().map_or(outfit, |s| &s.outfit)).0)
}

/// The verification of a checked outfit, and its closed layers: the body, then all garments but the
/// outermost, which nothing lies over.
pub(crate) fn verify_layers(outfit: &Outfit) -> (Verification, Vec<Arc<ClosedLayer>>) {
    let start = Instant::now();
    let body_mesh = &outfit.body.mesh;
    let body = Arc::new(ClosedLayer::body(body_mesh));
    let covered = outfit.garments.split_last().map_or(&[][..], |(_, covered)| covered);
    let close = |g: &Layer| Arc::new(ClosedLayer::garment(&g.mesh, &body, body_mesh));
    let garments: Vec<_> = covered.par_iter().map(close).collect();
    let closed: Vec<_> = [body].into_iter().chain(garments).collect();
    let layers: Vec<(&str, &ClosedLayer)> =
        outfit.layers().map(|l| l.name.as_str()).zip(closed.iter().map(Arc::as_ref)).collect();
    let mut verification = Verification::default();
    for (k, garment) in outfit.garments.iter().enumerate() {
        let tree = Bvh::new(&garment.mesh);
        verification.pairs.extend(against(garment, &garment.mesh, &tree, &layers[..=k]));
        verification.own_pairs.push(own_pairs(&garment.mesh, &tree).len());
    }
    verification.seconds = start.elapsed().as_secs_f64();
    (verification, closed)
}

/// `outer`, with the positions of `mesh`, against the layers `below`.
pub(crate) fn against(
    outer: &Layer,
    mesh: &TriMesh,
    tree: &Bvh,
    below: &[(&str, &ClosedLayer)],
) -> Vec<PairReport> {
    let used = mesh.used_vertices();
    below
        .iter()
        .map(|(name, inner)| {
            let found = pairs(inner.bvh(), tree);
            let count = |contact| found.iter().filter(|p| p.contact == contact).count();
            let depths: Vec<Real> = mesh
                .vertices()
                .par_iter()
                .zip(&used)
                .filter(|(_, used)| **used)
                .filter_map(|(p, _)| {
                    inner.sided(p, 0.0).filter(|s| s.distance < 0.0).map(|s| -s.distance)
                })
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
