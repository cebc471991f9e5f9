//! What a tile of points goes through in the deformation network.
//!
//! A tile holds 24 points as 4 blocks of 24 rows: the values, and their derivatives by x, y and z,
//! which go through the same products and, where a ReLU is shut, are zeroed together. So the
//! reverse pass of a loss on d and ∂d/∂x is that of a plain network over 96 rows.

use super::{OffsetLoss, OffsetSample};
use crate::encoding::PositionalEncoding;
use crate::kernel::activation::Relu;
use crate::kernel::aligned::Aligned;
use crate::kernel::packed::PackedLayers;
use crate::kernel::product::{Outer, Pair, Product};
use crate::kernel::sums::Sums;
use crate::kernel::{ROWS, TILE, stride};
use crate::mlp::Layout;

/// Points of a tile with derivatives.
pub(super) const BLOCK: usize = TILE / 4;

/// The network as the tiles see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Net<'a> {
    pub(super) packed: &'a PackedLayers,
    pub(super) encoding: PositionalEncoding,
    pub(super) band_weights: &'a [f32],
    /// One row per frame.
    pub(super) embeddings: &'a [f32],
    pub(super) embedding: usize,
}

/// Memory for one tile.
#[derive(Debug)]
pub(super) struct Tile {
    /// The inputs of each layer, and the last one's output: 96 rows each.
    rows: Vec<Aligned>,
    strides: Vec<usize>,
    delta: Aligned,
    other: Aligned,
    features: Vec<f32>,
    slopes: Vec<f32>,
}

impl Tile {
    pub(super) fn new(layout: &Layout, encoding: PositionalEncoding) -> Self {
        let inputs = layout.layers.iter().map(|at| at.columns);
        let widths: Vec<usize> = inputs.chain(layout.layers.last().map(|at| at.rows)).collect();
        let strides: Vec<usize> = widths.iter().map(|&width| stride(width)).collect();
        let widest = strides.iter().copied().max().unwrap_or(0);
        Tile {
            rows: strides.iter().map(|stride| Aligned::zeroed(TILE * stride)).collect(),
            strides,
            delta: Aligned::zeroed(TILE * widest),
            other: Aligned::zeroed(TILE * widest),
            features: vec![0.0; encoding.width()],
            slopes: vec![0.0; encoding.width()],
        }
    }

    /// d at up to [`TILE`] points.
    pub(super) fn offsets(
        &mut self,
        net: &Net<'_>,
        points: &[[f32; 3]],
        frames: &[u32],
        out: &mut [[f32; 3]],
    ) {
        self.encode(net, points, frames, TILE);
        self.forward(net, points.len(), TILE);
        let last = self.strides.len() - 1;
        for (row, out) in self.rows[last].as_slice().chunks_exact(self.strides[last]).zip(out) {
            out.copy_from_slice(&row[..3]);
        }
    }

    /// d and its Jacobian at up to [`BLOCK`] points.
    pub(super) fn samples(
        &mut self,
        net: &Net<'_>,
        points: &[[f32; 3]],
        frames: &[u32],
        out: &mut [OffsetSample],
    ) {
        self.encode(net, points, frames, BLOCK);
        self.forward(net, points.len(), BLOCK);
        for (n, out) in out.iter_mut().enumerate() {
            *out = self.sample(n);
        }
    }

    fn sample(&self, n: usize) -> OffsetSample {
        let last = self.strides.len() - 1;
        let (rows, stride) = (self.rows[last].as_slice(), self.strides[last]);
        let at = |block: usize, i: usize| rows[(block * BLOCK + n) * stride + i];
        OffsetSample {
            offset: std::array::from_fn(|i| at(0, i)),
            jacobian: std::array::from_fn(|i| std::array::from_fn(|j| at(1 + j, i))),
        }
    }

    /// The input rows; with blocks shorter than the tile also their derivatives.
    fn encode(&mut self, net: &Net<'_>, points: &[[f32; 3]], frames: &[u32], block: usize) {
        let (rows, stride) = (self.rows[0].as_mut_slice(), self.strides[0]);
        let width = net.encoding.width();
        for (n, (&x, &frame)) in points.iter().zip(frames).enumerate() {
            net.encoding.encode(x, net.band_weights, &mut self.features, &mut self.slopes);
            let row = &mut rows[n * stride..][..width + net.embedding];
            row[..width].copy_from_slice(&self.features);
            let at = frame as usize * net.embedding;
            row[width..].copy_from_slice(&net.embeddings[at..at + net.embedding]);
            if block < TILE {
                for axis in 0..3 {
                    let row = &mut rows[((1 + axis) * block + n) * stride..][..width];
                    for (o, (out, slope)) in row.iter_mut().zip(&self.slopes).enumerate() {
                        *out = if o % 3 == axis { *slope } else { 0.0 };
                    }
                }
            }
        }
        // What a call of `offsets` left in the derivatives' embedding columns.
        if block < TILE {
            for row in rows[block * stride..].chunks_exact_mut(stride) {
                row[width..].fill(0.0);
            }
        }
    }

    fn forward(&mut self, net: &Net<'_>, points: usize, block: usize) {
        let (last, isa) = (net.packed.layers.len() - 1, net.packed.isa);
        let padded = points.next_multiple_of(ROWS);
        for (l, layer) in net.packed.layers.iter().enumerate() {
            let (before, after) = self.rows.split_at_mut(l + 1);
            let (x, out) = (before[l].as_slice(), after[0].as_mut_slice());
            let (x_stride, out_stride) = (self.strides[l], self.strides[l + 1]);
            for b in 0..TILE / block {
                isa.run(Product {
                    x: &x[b * block * x_stride..],
                    x_stride,
                    panels: layer.forward.as_slice(),
                    depth: layer.columns,
                    bias: if b == 0 { layer.bias.as_slice() } else { &[] },
                    out: &mut out[b * block * out_stride..],
                    out_stride,
                    points: padded,
                });
            }
            if l < last {
                isa.run(Relu { z: &[], rows: out, stride: out_stride, block, points });
            }
        }
    }

    /// Adds the share of up to [`BLOCK`] points to `sums`; writes each point's derivative by its
    /// frame's embedding to `embeddings`.
    pub(super) fn add(
        &mut self,
        net: &Net<'_>,
        points: &[[f32; 3]],
        frames: &[u32],
        loss: impl Fn(usize, OffsetSample) -> OffsetLoss,
        sums: &mut Sums,
        embeddings: &mut [f32],
    ) {
        self.encode(net, points, frames, BLOCK);
        self.forward(net, points.len(), BLOCK);
        let (last, isa) = (net.packed.layers.len() - 1, net.packed.isa);
        let top = self.strides[last + 1];
        for n in 0..points.len() {
            let at = loss(n, self.sample(n));
            sums.loss += at.loss;
            let delta = self.delta.as_mut_slice();
            delta[n * top..][..3].copy_from_slice(&at.d_offset);
            for j in 0..3 {
                let row = &mut delta[((1 + j) * BLOCK + n) * top..][..3];
                for i in 0..3 {
                    row[i] = at.d_jacobian[i][j];
                }
            }
        }
        let padded = points.len().next_multiple_of(ROWS);
        for (l, layer) in net.packed.layers.iter().enumerate().rev() {
            let (d_stride, a_stride) = (self.strides[l + 1], self.strides[l]);
            let (delta, a) = (self.delta.as_slice(), self.rows[l].as_slice());
            for row in delta.chunks_exact(d_stride).take(points.len()) {
                sums.biases[l].iter_mut().zip(row).for_each(|(sum, d)| *sum += d);
            }
            let pairs: [Pair<'_>; 4] = std::array::from_fn(|b| Pair {
                d: &delta[b * BLOCK * d_stride..],
                d_stride,
                a: &a[b * BLOCK * a_stride..],
                a_stride,
            });
            isa.run(Outer {
                pairs: &pairs,
                points: points.len(),
                rows: layer.rows,
                columns: layer.columns,
                sum: sums.weights[l].as_mut_slice(),
                sum_stride: stride(layer.columns),
            });
            let blocks = if l == 0 { 1 } else { 4 };
            for b in 0..blocks {
                isa.run(Product {
                    x: &delta[b * BLOCK * d_stride..],
                    x_stride: d_stride,
                    panels: layer.backward.as_slice(),
                    depth: layer.rows,
                    bias: &[],
                    out: &mut self.other.as_mut_slice()[b * BLOCK * a_stride..],
                    out_stride: a_stride,
                    points: padded,
                });
            }
            if l > 0 {
                let rows = &mut self.other.as_mut_slice()[..TILE * a_stride];
                let (z, points) = (a, points.len());
                isa.run(Relu { z, rows, stride: a_stride, block: BLOCK, points });
            }
            std::mem::swap(&mut self.delta, &mut self.other);
        }
        let width = net.encoding.width();
        let rows = self.delta.as_slice().chunks_exact(self.strides[0]);
        for (row, out) in rows.zip(embeddings.chunks_exact_mut(net.embedding.max(1))) {
            out.copy_from_slice(&row[width..width + net.embedding]);
        }
    }
}
