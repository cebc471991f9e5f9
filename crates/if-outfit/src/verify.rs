//! The proof: exact intersections of every layer with every layer below it, and sides by closed
//! fields and, of what does not meet, by sight.

use crate::distances;
use crate::findings::{Findings, LayerFindings, alone, new_pairs, own_of};
use crate::outfit::{Layer, Outfit, OutfitError};
use crate::phases::beside;
use crate::prepared_body::PreparedBody;
use crate::report::{OwnPairs, ResolveReport, Verification};
use crate::welded::Welded;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use if_mesh::seams::weld_all;
use if_mesh::solid::{ClosedLayer, Exposure};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;
use tracing::field::Empty;
use tracing::trace_span;

/// Checks an outfit without changing it: intersecting triangle pairs of all layers, vertices on the
/// wrong side of a layer below, every garment's intersections with itself, and least distances.
///
/// The side of a vertex comes from closed layers. If a garment does not meet one below it, vertices do not
/// count that are the only ones of their triangles inside of that, or lie in the open (`docs/concepts.md`,
/// *Sides*).
///
/// Seams count as closed, and vertices at the same position along them as one ([`if_mesh::seams`]).
/// Vertices of no triangle do not count.
///
/// # Errors
///
/// The outfit is invalid: see [`OutfitError`].
pub fn verify(outfit: &Outfit) -> Result<Verification, OutfitError> {
    outfit.check()?;
    let start = Instant::now();
    let mut found = verified(outfit);
    distances::measure_primitives(outfit, &mut found);
    found.seconds = start.elapsed().as_secs_f64();
    Ok(found)
}

/// [`verify`] of an outfit that was checked, or is the result of one that was, without distances of primitives.
pub(crate) fn verified(outfit: &Outfit) -> Verification {
    let start = Instant::now();
    let welded = Welded::new(outfit);
    let outfit = welded.as_ref().map_or(outfit, |w| &w.outfit);
    let (findings, closed) = verify_layers(outfit, None);
    let body = (closed[0].body_report(), body_own_pairs(outfit, &closed[0]));
    let mut found = Verification::new(outfit, body, &findings, 0.0);
    distances::measure(outfit, &closed, &mut found);
    found.seconds = start.elapsed().as_secs_f64();
    found
}

/// Corrects what `report` says of the result by the result itself: `found`, whose garments have the
/// triangles of `given`.
pub(crate) fn verify_result(report: &mut ResolveReport, given: &Outfit, found: &Outfit) {
    // Not checked as input is: a garment that came out small is a result, and no fault of a parameter.
    report.after = verified(found);
    let garments = given.garments.iter().zip(&found.garments);
    for (layer, (given, found)) in report.layers.iter_mut().zip(garments) {
        (layer.own_pairs, _) = compare_own_pairs(&given.mesh, &found.mesh);
    }
}

/// What is found in a checked outfit, for each garment, and its closed layers: the body, then all
/// garments but the outermost, which nothing lies over. A body that was `prepared` is not closed
/// again.
pub(crate) fn verify_layers(
    outfit: &Outfit,
    prepared: Option<&PreparedBody>,
) -> (Vec<Findings>, Vec<Arc<ClosedLayer>>) {
    let _phase = trace_span!("verification").entered();
    let body_mesh = &outfit.body.mesh;
    let covered = outfit.garments.split_last().map_or(&[][..], |(_, covered)| covered);
    let close_layers = || {
        let body = match prepared.filter(|prepared| prepared.is_of(body_mesh)) {
            Some(prepared) => Arc::clone(&prepared.closed),
            None => Arc::new(ClosedLayer::body(body_mesh)),
        };
        let close = |g: &Layer| Arc::new(ClosedLayer::garment(&g.mesh, &body, body_mesh));
        let garments: Vec<_> = covered.par_iter().map(close).collect();
        [Arc::clone(&body)].into_iter().chain(garments).collect::<Vec<_>>()
    };
    let own = |g: &Layer| {
        let tree = Bvh::new(&g.mesh);
        let own = own_of(&g.mesh, &tree);
        (tree, own)
    };
    // Own pairs need no layer to be closed.
    let all_own = || outfit.garments.par_iter().map(own).collect::<Vec<_>>();
    let names = ["closed layers", "own pairs"];
    let span =
        trace_span!("closed layers and own pairs", "closed layers" = Empty, "own pairs" = Empty);
    let (closed, own) = beside(&span, names, close_layers, all_own);
    let _phase = trace_span!("pairs and sides").entered();
    let layers: Vec<&ClosedLayer> = closed.iter().map(Arc::as_ref).collect();
    let garments = outfit.garments.par_iter().zip(own).enumerate();
    let findings = garments.map(|(k, (garment, (tree, own)))| {
        let over = |j: usize| verify_over(&garment.mesh, &tree, &layers, j);
        Findings { below: (0..=k).into_par_iter().map(over).collect(), own }
    });
    let findings = findings.collect();
    (findings, closed)
}

/// As [`verify_layers`], after the garments marked `changed` moved: `findings` and `closed` are from
/// before.
pub(crate) fn verify_changed(
    outfit: &Outfit,
    changed: &[bool],
    mut findings: Vec<Findings>,
    mut closed: Vec<Arc<ClosedLayer>>,
) -> (Vec<Findings>, Vec<Arc<ClosedLayer>>) {
    let _phase = trace_span!("verification").entered();
    let body = Arc::clone(&closed[0]);
    for (k, layer) in closed.iter_mut().skip(1).enumerate().filter(|(k, _)| changed[*k]) {
        let _phase = trace_span!("closed layers").entered();
        *layer = Arc::new(ClosedLayer::garment(&outfit.garments[k].mesh, &body, &outfit.body.mesh));
    }
    let layers: Vec<&ClosedLayer> = closed.iter().map(Arc::as_ref).collect();
    for (k, garment) in outfit.garments.iter().enumerate() {
        if changed[k] {
            findings[k] = verify_garment(&garment.mesh, &layers[..=k]);
        } else if changed[..k].contains(&true) {
            let tree = Bvh::new(&garment.mesh);
            for j in (0..k).filter(|j| changed[*j]) {
                findings[k].below[j + 1] = verify_over(&garment.mesh, &tree, &layers, j + 1);
            }
        }
    }
    (findings, closed)
}

/// What is found of a garment with this mesh over the layers `below`, the body first.
pub(crate) fn verify_garment(mesh: &TriMesh, below: &[&ClosedLayer]) -> Findings {
    let _phase = trace_span!("pairs and sides").entered();
    let tree = Bvh::new(mesh);
    let over = |j: usize| verify_over(mesh, &tree, below, j);
    let over_all = || (0..below.len()).into_par_iter().map(over).collect();
    let (below, own) = rayon::join(over_all, || own_of(mesh, &tree));
    Findings { below, own }
}

/// What is found of a garment with this mesh, which `tree` holds, over layer `j` of `layers`, the body
/// first.
fn verify_over(mesh: &TriMesh, tree: &Bvh, layers: &[&ClosedLayer], j: usize) -> LayerFindings {
    let (layer, body) = (layers[j], layers[0]);
    let used = mesh.used_vertices();
    let depth = |v: usize| {
        let sided = layer.sided(&mesh.vertices()[v], 0.0).filter(|s| s.distance < 0.0);
        sided.map(|sided| (v, -sided.distance))
    };
    let of_used = (0..used.len()).into_par_iter().filter(|v| used[*v]);
    let mut inside: Vec<(usize, Real)> = of_used.filter_map(depth).collect();
    let pairs = pairs(layer.bvh(), tree);
    if pairs.is_empty() {
        let vertices: Vec<usize> = inside.iter().map(|(v, _)| *v).collect();
        let alone = alone(mesh.triangles(), &vertices);
        inside.retain(|(v, _)| !alone.contains(v));
    }
    if pairs.is_empty() && j > 0 && !inside.is_empty() {
        let exposure = Exposure::new(&layer.to_mesh(), layer.bvh(), body);
        let is_under = |(v, _): &(usize, Real)| !exposure.is_exposed(&mesh.vertices()[*v]);
        inside = inside.into_par_iter().filter(is_under).collect();
    }
    let deepest = inside.iter().map(|(_, depth)| *depth).fold(0.0, Real::max);
    LayerFindings { pairs, inside: inside.len(), deepest }
}

/// The own pairs of a garment with the vertices of `given` and of `now`, and those that are new.
/// Seams count as closed, as in [`verify`].
pub(crate) fn compare_own_pairs(given: &TriMesh, now: &TriMesh) -> (OwnPairs, Vec<[u32; 2]>) {
    let find = |mesh: &TriMesh| {
        let welded = weld_all(mesh);
        let mesh = welded.as_ref().map_or(mesh, |welded| &welded.mesh);
        own_of(mesh, &Bvh::new(mesh))
    };
    let (given, now) = (find(given), find(now));
    let new = new_pairs(&now, &given);
    (OwnPairs::new(given.len(), now.len(), new.len()), new)
}

/// The number of intersecting triangle pairs of the body, which `closed` is, with itself.
pub(crate) fn body_own_pairs(outfit: &Outfit, closed: &ClosedLayer) -> usize {
    let _phase = trace_span!("own pairs of the body").entered();
    own_of(&outfit.body.mesh, closed.bvh()).len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::{icosphere, tube};

    /// A ball of 0.3 m, and three bands about it with 10 mm between; those that are `aside` meet the
    /// others, and the body, on one side.
    fn outfit(aside: [bool; 3]) -> Outfit {
        let band = |(k, name): (usize, &str)| {
            let by = Vector::new(if aside[k] { 0.015 } else { 0.0 }, -0.05, 0.0);
            let tube = tube(0.31 + 0.01 * k as Real, 0.1, 40, 4, false);
            let moved = tube.vertices().iter().map(|p| p + by).collect();
            Layer::new(name, tube.with_vertices(moved).unwrap())
        };
        let garments = ["shirt", "jacket", "coat"].into_iter().enumerate().map(band).collect();
        Outfit::new(Layer::new("body", icosphere(0.3, 3)), garments).unwrap()
    }

    #[test]
    fn after_garments_moved_the_findings_are_those_of_a_new_verification() {
        let all = [[false; 3], [true, false, false], [false, true, false]];
        let found = all.map(|aside| verify_layers(&outfit(aside), None));
        assert!(found[0].0.iter().all(Findings::is_clean));
        // One that meets others, back again, and another one meanwhile.
        for [before, after] in [[0, 1], [1, 0], [1, 2]] {
            let changed = [0, 1, 2].map(|k: usize| all[before][k] != all[after][k]);
            let (given, closed) = found[before].clone();
            let (now, _) = verify_changed(&outfit(all[after]), &changed, given, closed);
            let text = |findings: &[Findings]| format!("{findings:?}");
            assert_eq!(text(&now), text(&found[after].0), "{before} to {after}");
        }
        // The shirt meets the body and the jacket over it, the jacket shirt and coat.
        let pairs = |k: usize| -> Vec<Vec<bool>> {
            let meet = |of: &LayerFindings| !of.pairs.is_empty();
            found[k].0.iter().map(|garment| garment.below.iter().map(meet).collect()).collect()
        };
        assert_eq!(pairs(1), [vec![true], vec![false, true], vec![false; 3]]);
        assert_eq!(pairs(2), [vec![false], vec![false, true], vec![false, false, true]]);
    }
}
