//! What the networks compute with: matrix products and activations over tiles of points.
//!
//! A tile is up to 96 points. Its arrays are row-major, a row per point; vectors run along the
//! features. A product broadcasts the entries of a row against packed weights, an outer product
//! broadcasts one side against the other: no array is ever transposed, and each result is summed
//! in an order that depends neither on the tile nor on the threads.

pub(crate) mod activation;
pub(crate) mod aligned;
pub(crate) mod isa;
pub(crate) mod packed;
pub(crate) mod pool;
pub(crate) mod product;
pub(crate) mod sums;

/// Most points of a tile. 96 rows of 256 features are 96 KiB: what a layer reads and writes stays
/// in the second-level cache, and each panel of weights, fetched from the third, serves 16 groups
/// of 6 points. With 48 the weights are fetched twice as often; with 192 the activations fall out.
pub(crate) const TILE: usize = 96;

/// Points (rows) are padded to a multiple of this: the taller side of every micro-tile divides it.
pub(crate) const ROWS: usize = 12;

/// Floats from one row to the next, for `features` of them: a multiple of the widest micro-tile
/// (64), plus a cache line so that rows of 256 or 512 do not all fall into the same cache sets.
pub(crate) const fn stride(features: usize) -> usize {
    features.next_multiple_of(64) + 16
}
