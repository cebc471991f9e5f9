//! The training step of φ: a loss on value and gradient, differentiated by all parameters.
//!
//! Per tile, with a layer's input a, W its folded weights, s = σ′, and `joined` the skip:
//!
//! ```text
//! forward   z = W a + b         a' = σ(z), s = σ′(z)
//! adjoint   q = Wᵀ p            p' = q ⊙ s             ∇φ = slopes of the encoding · q
//! loss      v = ∂L/∂φ, g = ∂L/∂∇φ
//! tangent   m = W t             t' = m ⊙ s,  c = m ⊙ q ⊙ σ″(z)        t of the encoding = slopes · g
//! reverse   r = Wᵀ δ            δ' = r ⊙ s + c         δ of the last layer = v
//! sums      ∂L/∂W = Σ δ aᵀ + p tᵀ      ∂L/∂b = Σ δ
//! ```
//!
//! The tangent pass is the reverse of the adjoint: a pass in the direction g; what it leaves at the
//! slopes is taken up by the reverse pass. Six products per layer where the value alone takes one.

use rayon::prelude::*;

use crate::frozen::{FrozenMlp, Shape, add_slopes};
use crate::kernel::activation::{Curve, Dot, Multiply, ScaleAdd, Softplus};
use crate::kernel::aligned::Aligned;
use crate::kernel::pool::Pool;
use crate::kernel::product::{Outer, Pair, Product};
use crate::kernel::sums::{Sums, add_up, group_of};
use crate::kernel::{ROWS, TILE, stride};
use crate::mlp::Layout;
use crate::trainable::{PointLoss, Sample32};

/// Memory of the training step, kept from call to call.
#[derive(Clone, Debug, Default)]
pub(crate) struct StepMemory {
    tiles: Pool<Tile>,
    sums: Pool<Vec<Sums>>,
}

/// What the passes over one tile leave behind, per layer.
#[derive(Debug)]
struct Tile {
    encoded: Aligned,
    encoded_slopes: Aligned,
    /// t of the encoding.
    encoded_tangent: Aligned,
    layers: Vec<TileLayer>,
    /// ∂L/∂(output) on its way back, twice.
    delta: Aligned,
    other: Aligned,
    samples: Vec<Sample32>,
    losses: Vec<PointLoss>,
}

/// Arrays of one hidden layer.
#[derive(Debug)]
struct TileLayer {
    /// The layer's output, joined: the next layer's input.
    output: Aligned,
    slopes: Aligned,
    /// ∂φ/∂(output); after the tangent pass, c.
    q: Aligned,
    /// ∂φ/∂z.
    p: Aligned,
    /// The tangent of `output`.
    tangent: Aligned,
}

impl Tile {
    fn new(shape: &Shape) -> Self {
        let encoded = || Aligned::zeroed(TILE * stride(shape.encoding.width()));
        let wide = || Aligned::zeroed(TILE * shape.stride);
        Tile {
            encoded: encoded(),
            encoded_slopes: encoded(),
            encoded_tangent: encoded(),
            layers: (0..shape.hidden)
                .map(|_| TileLayer {
                    output: wide(),
                    slopes: wide(),
                    q: wide(),
                    p: wide(),
                    tangent: wide(),
                })
                .collect(),
            delta: wide(),
            other: wide(),
            samples: vec![Sample32::default(); TILE],
            losses: vec![PointLoss::default(); TILE],
        }
    }
}

/// One step: see [`crate::trainable::TrainableField::loss_gradient`].
///
/// The points are cut into groups by their number alone, each group is summed tile by tile, and
/// the groups are added up in order: the same bits for any number of threads.
pub(crate) fn loss_gradient(
    mlp: &FrozenMlp,
    memory: &StepMemory,
    layout: &Layout,
    theta: &[f32],
    points: &[[f32; 3]],
    loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
    gradient: &mut [f32],
) -> f64 {
    let group = group_of(points.len(), TILE);
    let count = points.len().div_ceil(group).max(1);
    memory.sums.with(Vec::new, |sums| {
        // Only the first row of the last layer is the distance's.
        sums.resize_with(count.max(sums.len()), || Sums::new(&mlp.packed, 1));
        let sums = &mut sums[..count];
        sums.par_iter_mut().enumerate().for_each(|(g, sums)| {
            sums.clear();
            let first = g * group;
            let last = (first + group).min(points.len());
            memory.tiles.with(
                || Tile::new(&mlp.shape),
                |tile| {
                    for start in (first..last).step_by(TILE) {
                        let points = &points[start..(start + TILE).min(last)];
                        tile.add(mlp, points, |n, sample| loss(start + n, sample), sums);
                    }
                },
            );
        });
        add_up(sums);
        sums[0].unfold(&mlp.packed, layout, theta, gradient)
    })
}

impl Tile {
    /// Adds the share of `points` (at most [`TILE`]) to `sums`.
    fn add(
        &mut self,
        mlp: &FrozenMlp,
        points: &[[f32; 3]],
        loss: impl Fn(usize, Sample32) -> PointLoss,
        sums: &mut Sums,
    ) {
        self.forward(mlp, points);
        self.adjoint(mlp, points.len());
        for n in 0..points.len() {
            self.losses[n] = loss(n, self.samples[n]);
            sums.loss += self.losses[n].loss;
        }
        self.tangent(mlp, points.len());
        self.reverse(mlp, points.len(), sums);
    }

    fn forward(&mut self, mlp: &FrozenMlp, points: &[[f32; 3]]) {
        let shape = &mlp.shape;
        let row = stride(shape.encoding.width());
        let (encoded, slopes) = (self.encoded.as_mut_slice(), self.encoded_slopes.as_mut_slice());
        for (n, &x) in points.iter().enumerate() {
            shape.encoding.encode(x, &[], &mut encoded[n * row..], &mut slopes[n * row..]);
        }
        for l in 0..shape.hidden {
            let layer = &mlp.packed.layers[l];
            let (before, this) = self.layers.split_at_mut(l);
            let (x, x_stride) = match before.last() {
                None => (self.encoded.as_slice(), row),
                Some(before) => (before.output.as_slice(), shape.stride),
            };
            let this = &mut this[0];
            let out = this.output.as_mut_slice();
            mlp.product(layer, x, x_stride, out, points.len());
            mlp.packed.isa.run(Softplus {
                z: out,
                slopes: this.slopes.as_mut_slice(),
                stride: shape.stride,
                features: layer.rows,
                points: points.len(),
                beta: shape.beta,
            });
            shape.join(l, layer.rows, self.encoded.as_slice(), out);
        }
    }

    /// p and q of each layer, φ and ∇φ.
    fn adjoint(&mut self, mlp: &FrozenMlp, points: usize) {
        let (shape, isa) = (&mlp.shape, mlp.packed.isa);
        let len = points.next_multiple_of(ROWS) * shape.stride;
        let last = &mlp.packed.layers[shape.hidden];
        let weight = &last.weight[..last.columns];
        let top = &mut self.layers[shape.hidden - 1];
        let outputs = top.output.as_slice().chunks_exact(shape.stride);
        let q = top.q.as_mut_slice().chunks_exact_mut(shape.stride);
        for ((a, q), sample) in outputs.zip(q).zip(&mut self.samples).take(points) {
            sample.value = isa.run(Dot { a, b: weight, start: last.bias.as_slice()[0] });
            sample.gradient = [0.0; 3];
            q[..weight.len()].copy_from_slice(weight);
        }
        let row = stride(shape.encoding.width());
        for l in (0..shape.hidden).rev() {
            let layer = &mlp.packed.layers[l];
            let (before, this) = self.layers.split_at_mut(l);
            let this = &mut this[0];
            isa.run(Multiply {
                a: &this.q.as_slice()[..len],
                b: &this.slopes.as_slice()[..len],
                out: &mut this.p.as_mut_slice()[..len],
            });
            let q = match before.last_mut() {
                None => self.other.as_mut_slice(),
                Some(before) => before.q.as_mut_slice(),
            };
            back(mlp, l, this.p.as_slice(), q, points);
            if l == 0 || shape.skip == Some(l) {
                let from = layer.columns - shape.encoding.width();
                for (n, sample) in self.samples.iter_mut().take(points).enumerate() {
                    let slopes = &self.encoded_slopes.as_slice()[n * row..];
                    add_slopes(
                        &slopes[..shape.encoding.width()],
                        &q[n * shape.stride + from..],
                        &mut sample.gradient,
                    );
                }
            }
        }
    }

    /// The tangent of each layer's output, and c in q's place.
    fn tangent(&mut self, mlp: &FrozenMlp, points: usize) {
        let shape = &mlp.shape;
        let len = points.next_multiple_of(ROWS) * shape.stride;
        let width = shape.encoding.width();
        let row = stride(width);
        let tangents = self.encoded_tangent.as_mut_slice().chunks_exact_mut(row);
        let slopes = self.encoded_slopes.as_slice().chunks_exact(row);
        for ((t, s), at) in tangents.zip(slopes).zip(&self.losses).take(points) {
            for (t, s) in t[..width].chunks_exact_mut(3).zip(s.chunks_exact(3)) {
                for axis in 0..3 {
                    t[axis] = s[axis] * at.d_gradient[axis];
                }
            }
        }
        for l in 0..shape.hidden {
            let layer = &mlp.packed.layers[l];
            let (before, this) = self.layers.split_at_mut(l);
            let (x, x_stride) = match before.last() {
                None => (self.encoded_tangent.as_slice(), row),
                Some(before) => (before.tangent.as_slice(), shape.stride),
            };
            let this = &mut this[0];
            mlp.packed.isa.run(Product {
                x,
                x_stride,
                panels: layer.forward.as_slice(),
                depth: layer.columns,
                bias: &[],
                out: this.tangent.as_mut_slice(),
                out_stride: shape.stride,
                points: points.next_multiple_of(ROWS),
            });
            mlp.packed.isa.run(Curve {
                moved: &mut this.tangent.as_mut_slice()[..len],
                q: &mut this.q.as_mut_slice()[..len],
                s: &this.slopes.as_slice()[..len],
                beta: shape.beta,
            });
            let (encoded, out) = (self.encoded_tangent.as_slice(), this.tangent.as_mut_slice());
            shape.join(l, layer.rows, encoded, out);
        }
    }

    fn reverse(&mut self, mlp: &FrozenMlp, points: usize, sums: &mut Sums) {
        let (shape, isa) = (&mlp.shape, mlp.packed.isa);
        let len = points.next_multiple_of(ROWS) * shape.stride;
        let row = stride(shape.encoding.width());
        // The last layer: its row of the distance alone, δ = v and p = 1.
        let last = &mlp.packed.layers[shape.hidden];
        let weight = &last.weight[..last.columns];
        let top = &self.layers[shape.hidden - 1];
        let sum = &mut sums.weights[shape.hidden].as_mut_slice()[..last.columns];
        for n in 0..points {
            let at = n * shape.stride..n * shape.stride + last.columns;
            let (a, t) = (&top.output.as_slice()[at.clone()], &top.tangent.as_slice()[at.clone()]);
            let v = self.losses[n].d_value;
            sums.biases[shape.hidden][0] += v;
            let delta = &mut self.delta.as_mut_slice()[at];
            for k in 0..last.columns {
                sum[k] += v * a[k] + t[k];
                delta[k] = v * weight[k];
            }
        }
        for l in (0..shape.hidden).rev() {
            let layer = &mlp.packed.layers[l];
            let this = &self.layers[l];
            isa.run(ScaleAdd {
                a: &mut self.delta.as_mut_slice()[..len],
                s: &this.slopes.as_slice()[..len],
                c: &this.q.as_slice()[..len],
            });
            let bias = &mut sums.biases[l];
            for delta in self.delta.as_slice().chunks_exact(shape.stride).take(points) {
                bias.iter_mut().zip(delta).for_each(|(sum, delta)| *sum += delta);
            }
            let (a, t, a_stride) = match l {
                0 => (self.encoded.as_slice(), self.encoded_tangent.as_slice(), row),
                _ => {
                    let before = &self.layers[l - 1];
                    (before.output.as_slice(), before.tangent.as_slice(), shape.stride)
                }
            };
            let d_stride = shape.stride;
            isa.run(Outer {
                pairs: &[
                    Pair { d: self.delta.as_slice(), d_stride, a, a_stride },
                    Pair { d: this.p.as_slice(), d_stride, a: t, a_stride },
                ],
                points,
                rows: layer.rows,
                columns: layer.columns,
                sum: sums.weights[l].as_mut_slice(),
                sum_stride: stride(layer.columns),
            });
            if l > 0 {
                back(mlp, l, self.delta.as_slice(), self.other.as_mut_slice(), points);
                std::mem::swap(&mut self.delta, &mut self.other);
            }
        }
    }
}

/// `out = Wᵀ p` of layer `l`.
fn back(mlp: &FrozenMlp, l: usize, p: &[f32], out: &mut [f32], points: usize) {
    let layer = &mlp.packed.layers[l];
    mlp.packed.isa.run(Product {
        x: p,
        x_stride: mlp.shape.stride,
        panels: layer.backward.as_slice(),
        depth: layer.rows,
        bias: &[],
        out,
        out_stride: mlp.shape.stride,
        points: points.next_multiple_of(ROWS),
    });
}
