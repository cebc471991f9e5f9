//! The least distances of an outfit: of every two layers, and of every garment to itself.

use crate::outfit::Outfit;
use crate::report::Verification;
use if_mesh::index::Bvh;
use if_mesh::least_distance::{least_distance, least_own_distance};
use rayon::prelude::*;

/// Adds the least distances of `outfit` to what was found in it.
pub(crate) fn measure(outfit: &Outfit, found: &mut Verification) {
    let layers: Vec<_> = outfit.layers().collect();
    let trees: Vec<Bvh> = layers.par_iter().map(|layer| Bvh::new(&layer.mesh)).collect();
    // The order of `Verification::pairs`.
    let below = (1..trees.len()).flat_map(|outer| (0..outer).map(move |inner| [inner, outer]));
    for ([inner, outer], pair) in below.zip(&mut found.pairs) {
        pair.least_distance = least_distance(&trees[inner], &trees[outer]);
    }
    found.own_least_distances = trees.iter().skip(1).map(least_own_distance).collect();
}
