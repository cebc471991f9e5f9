//! The least distances of an outfit: of every two layers, and of every garment to itself.

use crate::outfit::Outfit;
use crate::report::Verification;
use if_core::math::Real;
use if_mesh::index::Bvh;
use if_mesh::least_distance::{least_distance, least_own_distance};
use if_mesh::primitive_distance::least_primitive_distance;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use std::sync::Arc;
use tracing::trace_span;

/// Adds the least distances of `outfit` to what was found in it. `closed` are its closed layers, all
/// but the outermost.
pub(crate) fn measure(outfit: &Outfit, closed: &[Arc<ClosedLayer>], found: &mut Verification) {
    let _phase = trace_span!("least distances").entered();
    with_trees(outfit, closed, |trees| {
        let pairs = below(trees.len());
        let between = || {
            let distance =
                |[inner, outer]: &[usize; 2]| least_distance(trees[*inner], trees[*outer]);
            pairs.par_iter().map(distance).collect::<Vec<_>>()
        };
        let own = || trees.par_iter().skip(1).map(|tree| least_own_distance(tree)).collect();
        let (between, own) = rayon::join(between, own);
        found.pairs.iter_mut().zip(between).for_each(|(pair, least)| pair.least_distance = least);
        found.own_least_distances = own;
    });
}

/// Adds the least distances of primitives of each garment of `outfit`, in which `found` was measured.
pub(crate) fn measure_primitives(outfit: &Outfit, found: &mut Verification) {
    let _phase = trace_span!("least distances of primitives").entered();
    let garments = outfit.garments.par_iter().zip(&found.own_least_distances);
    let least =
        garments.map(|(garment, own)| least_primitive_distance(&garment.mesh, own.as_ref()));
    found.own_primitive_distances = least.collect();
}

/// For every two layers of `outfit`, how much less than `distance` metres they are apart. `closed` are
/// its closed layers, all but the outermost.
pub(crate) fn lacking(outfit: &Outfit, closed: &[Arc<ClosedLayer>], distance: Real) -> Vec<Real> {
    with_trees(outfit, closed, |trees| {
        let lacks = |[inner, outer]: &[usize; 2]| {
            let least = least_distance(trees[*inner], trees[*outer]);
            least.map_or(0.0, |least| (distance - least.distance).max(0.0))
        };
        below(trees.len()).par_iter().map(lacks).collect()
    })
}

/// The trees of all layers, the body first.
fn with_trees<T>(
    outfit: &Outfit,
    closed: &[Arc<ClosedLayer>],
    then: impl FnOnce(&[&Bvh]) -> T,
) -> T {
    let outermost = outfit.garments.last().map(|garment| Bvh::new(&garment.mesh));
    let closed = closed.iter().map(|layer| layer.bvh());
    then(&closed.chain(outermost.as_ref()).collect::<Vec<_>>())
}

/// Every two of so many layers, in the order of `Verification::pairs`.
fn below(layers: usize) -> Vec<[usize; 2]> {
    (1..layers).flat_map(|outer| (0..outer).map(move |inner| [inner, outer])).collect()
}
