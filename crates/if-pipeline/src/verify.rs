//! The proof: exact intersections of every layer with every layer below it, and sides by closed fields.

use crate::outfit::{Layer, Outfit, OutfitError};
use crate::report::{PairCount, PairReport, Verification};
use if_core::intersect::Contact;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{TrianglePair, own_pairs, pairs};
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
        verification.pairs.extend(found.into_iter().map(|f| f.report));
        verification.own_pairs.push(own_pairs(&garment.mesh, closed.bvh()).len());
        below.push((garment, closed));
    }
    verification.seconds = start.elapsed().as_secs_f64();
    Ok(verification)
}

/// One layer against one below it: the counts, and the triangle pairs behind them.
pub(crate) struct Found {
    pub(crate) report: PairReport,
    /// (triangle of the inner layer, triangle of the outer layer).
    pub(crate) pairs: Vec<TrianglePair>,
    /// Vertices of the outer layer on the wrong side.
    pub(crate) inside: Vec<u32>,
}

/// `outer`, with the positions of `mesh`, against the layers `below`.
pub(crate) fn against(outer: &Layer, mesh: &TriMesh, tree: &Bvh, below: &[(&str, &ClosedLayer)]) -> Vec<Found> {
    below
        .iter()
        .map(|(name, inner)| {
            let found = pairs(inner.bvh(), tree);
            let count = |contact| found.iter().filter(|p| p.contact == contact).count();
            let depths: Vec<(u32, Real)> = mesh
                .vertices()
                .par_iter()
                .enumerate()
                .filter_map(|(v, p)| inner.sided(p, 0.0).filter(|s| s.distance < 0.0).map(|s| (v as u32, -s.distance)))
                .collect();
            let report = PairReport {
                inner: (*name).to_owned(),
                outer: outer.name.clone(),
                pairs: PairCount {
                    crossing: count(Contact::Crossing),
                    touching: count(Contact::Touching),
                    coplanar: count(Contact::Coplanar),
                },
                vertices_inside: depths.len(),
                vertices: mesh.vertices().len(),
                deepest: depths.iter().map(|d| d.1).fold(0.0, Real::max),
            };
            Found { report, pairs: found, inside: depths.into_iter().map(|d| d.0).collect() }
        })
        .collect()
}
