//! Derivatives by the weights, summed over groups of points.

use rayon::prelude::*;

use super::aligned::Aligned;
use super::packed::PackedLayers;
use super::{ROWS, stride};
use crate::mlp::Layout;

/// Least tiles of a group, whose sums are kept apart: at 256 wide, zeroing and adding up a group's
/// 2 MiB of sums takes 3 % of the time of its 768 points, and 6 % with half as many.
const TILES: usize = 8;

/// Most groups, and so most threads of a step. Their sums are the memory that a step takes:
/// 16 × 8 MiB at 512 wide.
const GROUPS: usize = 16;

/// Points of a group for a call of `points` in tiles of `tile`: by their number alone.
pub(crate) fn group_of(points: usize, tile: usize) -> usize {
    points.div_ceil(GROUPS).next_multiple_of(tile).max(TILES * tile)
}

/// The sums of one group: ∂L/∂W and ∂L/∂b of each layer, and L.
#[derive(Debug)]
pub(crate) struct Sums {
    /// Per layer row by row, [`stride`] floats apart.
    pub(crate) weights: Vec<Aligned>,
    pub(crate) biases: Vec<Vec<f32>>,
    pub(crate) loss: f64,
    last_rows: usize,
}

impl Sums {
    /// Zeros for `layers`; of the last one only `last_rows` rows are summed.
    pub(crate) fn new(layers: &PackedLayers, last_rows: usize) -> Self {
        let last = layers.layers.len() - 1;
        Sums {
            weights: (layers.layers.iter().enumerate())
                .map(|(l, layer)| {
                    let rows = if l == last { last_rows } else { layer.rows };
                    Aligned::zeroed(rows.next_multiple_of(ROWS) * stride(layer.columns))
                })
                .collect(),
            biases: layers.layers.iter().map(|layer| vec![0.0; layer.rows]).collect(),
            loss: 0.0,
            last_rows,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.weights.iter_mut().for_each(|sum| sum.as_mut_slice().fill(0.0));
        self.biases.iter_mut().for_each(|sum| sum.fill(0.0));
        self.loss = 0.0;
    }

    /// Writes the derivatives by θ over the head of `gradient`; returns L.
    pub(crate) fn unfold(
        &self,
        layers: &PackedLayers,
        layout: &Layout,
        theta: &[f32],
        gradient: &mut [f32],
    ) -> f64 {
        // Each layer of the gradient is a slice of its own.
        let mut slices = Vec::with_capacity(layout.layers.len());
        let mut tail = gradient;
        for at in &layout.layers {
            let end = at.gain.as_ref().map_or(at.bias.end, |gain| gain.end);
            let (head, rest) = tail.split_at_mut(end - at.weight.start);
            slices.push(head);
            tail = rest;
        }
        let last = layout.layers.len() - 1;
        slices.par_iter_mut().enumerate().for_each(|(l, out)| {
            let (at, layer) = (&layout.layers[l], &layers.layers[l]);
            let rows = if l == last { self.last_rows } else { layer.rows };
            let sum = self.weights[l].as_slice();
            layer.unfold(at, theta, rows, sum, stride(layer.columns), &self.biases[l], out);
        });
        self.loss
    }
}

/// Adds the sums of all groups to those of the first, in order.
pub(crate) fn add_up(sums: &mut [Sums]) {
    let Some((first, rest)) = sums.split_first_mut() else { return };
    for sums in rest.iter() {
        first.loss += sums.loss;
        for (sum, other) in first.biases.iter_mut().zip(&sums.biases) {
            sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
        }
    }
    // 4096 floats: a chunk of the first group's sums stays in the first-level cache.
    const CHUNK: usize = 4096;
    for (l, sum) in first.weights.iter_mut().enumerate() {
        sum.as_mut_slice().par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sum)| {
            for other in rest.iter() {
                let other = &other.weights[l].as_slice()[chunk * CHUNK..];
                sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
            }
        });
    }
}
