//! φ for inference: folded, packed and fused.

use rayon::prelude::*;

use crate::encoding::PositionalEncoding;
use crate::error::NetworkError;
use crate::kernel::activation::{Dot, Scale, Softplus};
use crate::kernel::aligned::Aligned;
use crate::kernel::isa::Isa;
use crate::kernel::packed::{PackedLayer, PackedLayers};
use crate::kernel::pool::Pool;
use crate::kernel::product::Product;
use crate::kernel::{ROWS, TILE, stride};
use crate::mlp::{Layout, SdfConfig, check_parameters};
use crate::trainable::Sample32;

/// φ and ∇φ of a network with fixed weights, as fast as the machine multiplies.
///
/// Weight norm is folded in, the weights are packed for the instruction set at hand, and tiles of
/// points go through all the layers while they are in cache; the gradient is the adjoint pass over
/// the slopes that the forward pass left. Tiles run in parallel on rayon's ambient pool. A point's
/// result does not depend on the other points of the call, nor on the number of threads.
///
/// # Accuracy
///
/// See `docs/evidence/neural.md`: about 1e-6 in value and 1e-5 in gradient against the same network
/// in f64.
#[derive(Clone, Debug)]
pub struct FrozenMlp {
    pub(crate) shape: Shape,
    pub(crate) packed: PackedLayers,
    scratch: Pool<Scratch>,
}

/// The sizes that a tile needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) encoding: PositionalEncoding,
    pub(crate) hidden: usize,
    pub(crate) skip: Option<usize>,
    pub(crate) beta: f32,
    /// Floats of a row that holds any layer's input or output.
    pub(crate) stride: usize,
    outputs: usize,
}

impl Shape {
    pub(crate) fn new(config: &SdfConfig, layout: &Layout) -> Self {
        let encoding = config.encoding();
        let widest = layout.layers.iter().map(|layer| layer.rows).max().unwrap_or(0);
        Shape {
            encoding,
            hidden: config.layers,
            skip: config.skip,
            beta: config.beta,
            stride: stride(widest.max(encoding.width())),
            outputs: 1 + config.features,
        }
    }

    /// Copies the encoding behind the output of layer `skip − 1`, if that is `l`.
    pub(crate) fn join(&self, l: usize, rows: usize, encoded: &[f32], out: &mut [f32]) {
        if self.skip == Some(l + 1) {
            let width = self.encoding.width();
            for (out, e) in
                out.chunks_exact_mut(self.stride).zip(encoded.chunks_exact(stride(width)))
            {
                out[rows..rows + width].copy_from_slice(&e[..width]);
            }
        }
    }
}

/// Memory for one tile.
#[derive(Debug)]
struct Scratch {
    encoded: Aligned,
    /// Slopes of the encoding, and of each hidden layer's activation.
    encoded_slopes: Aligned,
    slopes: Vec<Aligned>,
    a: Aligned,
    b: Aligned,
}

impl Scratch {
    fn new(shape: &Shape) -> Self {
        let encoded = || Aligned::zeroed(TILE * stride(shape.encoding.width()));
        let wide = || Aligned::zeroed(TILE * shape.stride);
        Scratch {
            encoded: encoded(),
            encoded_slopes: encoded(),
            slopes: (0..shape.hidden).map(|_| wide()).collect(),
            a: wide(),
            b: wide(),
        }
    }
}

impl FrozenMlp {
    /// The network of `config` with the parameters `theta` ([`SdfConfig::layout`]), on the fastest
    /// instruction set of this machine.
    ///
    /// # Errors
    ///
    /// [`NetworkError`], for a shape that cannot be built, or a θ of another length or with a
    /// number that is not finite.
    pub fn new(config: &SdfConfig, theta: &[f32]) -> Result<Self, NetworkError> {
        FrozenMlp::with_isa(config, theta, Isa::best())
    }

    /// [`FrozenMlp::new`] on a given instruction set.
    ///
    /// # Errors
    ///
    /// As [`FrozenMlp::new`].
    #[doc(hidden)]
    pub fn with_isa(config: &SdfConfig, theta: &[f32], isa: Isa) -> Result<Self, NetworkError> {
        let layout = config.layout()?;
        check_parameters(theta, layout.parameters)?;
        let mut frozen = FrozenMlp {
            shape: Shape::new(config, &layout),
            packed: PackedLayers::new(isa, &layout, config.skip),
            scratch: Pool::default(),
        };
        frozen.refresh(&layout, theta);
        Ok(frozen)
    }

    pub(crate) fn refresh(&mut self, layout: &Layout, theta: &[f32]) {
        self.packed.refresh(layout, theta);
    }

    /// The instruction set in use.
    pub fn isa(&self) -> Isa {
        self.packed.isa
    }

    /// φ at `points`.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    pub fn values(&self, points: &[[f32; 3]], out: &mut [f32]) {
        assert_eq!(points.len(), out.len(), "one value per point");
        let tile = tile_of(points.len());
        points.par_chunks(tile).zip(out.par_chunks_mut(tile)).for_each(|(points, out)| {
            self.with_scratch(|scratch| {
                self.forward(points, scratch, false);
                self.last(scratch, |n, value| out[n] = value, points.len());
            });
        });
    }

    /// φ and ∇φ at `points`.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    pub fn samples(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        assert_eq!(points.len(), out.len(), "one sample per point");
        let tile = tile_of(points.len());
        points.par_chunks(tile).zip(out.par_chunks_mut(tile)).for_each(|(points, out)| {
            self.with_scratch(|scratch| {
                self.forward(points, scratch, true);
                self.last(scratch, |n, value| out[n].value = value, points.len());
                self.adjoint(scratch, out);
            });
        });
    }

    /// Count of outputs: φ and the features.
    pub fn outputs(&self) -> usize {
        self.shape.outputs
    }

    /// All outputs at `points`, point by point: φ, then the features.
    ///
    /// # Panics
    ///
    /// If `out` is not [`Self::outputs`] times as long as `points`.
    pub fn evaluate(&self, points: &[[f32; 3]], out: &mut [f32]) {
        let outputs = self.shape.outputs;
        assert_eq!(points.len() * outputs, out.len(), "all outputs of every point");
        let tile = tile_of(points.len());
        points.par_chunks(tile).zip(out.par_chunks_mut(tile * outputs)).for_each(
            |(points, out)| {
                self.with_scratch(|scratch| {
                    self.forward(points, scratch, false);
                    let last = &self.packed.layers[self.shape.hidden];
                    let (a, b) = (scratch.a.as_slice(), scratch.b.as_mut_slice());
                    self.product(last, a, self.shape.stride, b, points.len());
                    for (row, out) in b.chunks_exact(self.shape.stride).zip(out.chunks_mut(outputs))
                    {
                        out.copy_from_slice(&row[..outputs]);
                    }
                    // φ as `values` gives it, to the bit.
                    self.last(scratch, |n, value| out[n * outputs] = value, points.len());
                });
            },
        );
    }

    fn with_scratch(&self, work: impl FnOnce(&mut Scratch)) {
        self.scratch.with(|| Scratch::new(&self.shape), work);
    }

    /// `out = W x + b` for `n` points.
    pub(crate) fn product(
        &self,
        layer: &PackedLayer,
        x: &[f32],
        x_stride: usize,
        out: &mut [f32],
        n: usize,
    ) {
        self.packed.isa.run(Product {
            x,
            x_stride,
            panels: layer.forward.as_slice(),
            depth: layer.columns,
            bias: layer.bias.as_slice(),
            out,
            out_stride: self.shape.stride,
            points: n.next_multiple_of(ROWS),
        });
    }

    /// Leaves the last hidden layer's output in `scratch.a`, the encoding's slopes, and, if requested
    /// for, the slopes of the activations.
    fn forward(&self, points: &[[f32; 3]], scratch: &mut Scratch, slopes: bool) {
        let shape = &self.shape;
        let (encoded, encoded_slopes) =
            (scratch.encoded.as_mut_slice(), scratch.encoded_slopes.as_mut_slice());
        let row = stride(shape.encoding.width());
        for (n, &x) in points.iter().enumerate() {
            let at = n * row;
            shape.encoding.encode(x, &[], &mut encoded[at..], &mut encoded_slopes[at..]);
        }
        let encoded = scratch.encoded.as_slice();
        for l in 0..shape.hidden {
            let layer = &self.packed.layers[l];
            let (x, x_stride) = match l {
                0 => (encoded, row),
                _ => (scratch.a.as_slice(), shape.stride),
            };
            let out = scratch.b.as_mut_slice();
            self.product(layer, x, x_stride, out, points.len());
            self.packed.isa.run(Softplus {
                z: out,
                slopes: if slopes { scratch.slopes[l].as_mut_slice() } else { &mut [] },
                stride: shape.stride,
                features: layer.rows,
                points: points.len(),
                beta: shape.beta,
            });
            shape.join(l, layer.rows, encoded, out);
            std::mem::swap(&mut scratch.a, &mut scratch.b);
        }
    }

    /// φ from the last hidden layer's output.
    fn last(&self, scratch: &Scratch, mut put: impl FnMut(usize, f32), points: usize) {
        let last = &self.packed.layers[self.shape.hidden];
        let weight = &last.weight[..last.columns];
        for (n, a) in scratch.a.as_slice().chunks_exact(self.shape.stride).take(points).enumerate()
        {
            put(n, self.packed.isa.run(Dot { a, b: weight, start: last.bias.as_slice()[0] }));
        }
    }

    /// ∇φ from the slopes.
    fn adjoint(&self, scratch: &mut Scratch, out: &mut [Sample32]) {
        let (shape, isa) = (&self.shape, self.packed.isa);
        let points = out.len().next_multiple_of(ROWS);
        let last = &self.packed.layers[shape.hidden];
        let weight = &last.weight[..last.columns];
        let rows = scratch.slopes[shape.hidden - 1].as_mut_slice();
        for row in rows.chunks_exact_mut(shape.stride).take(points) {
            for (s, w) in row.iter_mut().zip(weight) {
                *s *= w;
            }
        }
        let row = stride(shape.encoding.width());
        for sample in out.iter_mut() {
            sample.gradient = [0.0; 3];
        }
        for l in (0..shape.hidden).rev() {
            let layer = &self.packed.layers[l];
            isa.run(Product {
                x: scratch.slopes[l].as_slice(),
                x_stride: shape.stride,
                panels: layer.backward.as_slice(),
                depth: layer.rows,
                bias: &[],
                out: scratch.a.as_mut_slice(),
                out_stride: shape.stride,
                points,
            });
            let q = scratch.a.as_slice();
            if l == 0 || shape.skip == Some(l) {
                let from = layer.columns - shape.encoding.width();
                for (n, sample) in out.iter_mut().enumerate() {
                    let q = &q[n * shape.stride + from..];
                    add_slopes(
                        &scratch.encoded_slopes.as_slice()[n * row..][..shape.encoding.width()],
                        q,
                        &mut sample.gradient,
                    );
                }
            }
            if l > 0 {
                let len = points * shape.stride;
                let before = &mut scratch.slopes[l - 1].as_mut_slice()[..len];
                isa.run(Scale { a: before, b: &q[..len] });
            }
        }
    }
}

/// `gradient[o % 3] += slopes[o]·q[o]`.
pub(crate) fn add_slopes(slopes: &[f32], q: &[f32], gradient: &mut [f32; 3]) {
    for (slopes, q) in slopes.chunks_exact(3).zip(q.chunks_exact(3)) {
        for axis in 0..3 {
            gradient[axis] += slopes[axis] * q[axis];
        }
    }
}

/// Points of a tile for a call of `points`: fewer than [`TILE`] where a thread would have none.
pub(crate) fn tile_of(points: usize) -> usize {
    let share = points.div_ceil(rayon::current_num_threads().max(1));
    share.next_multiple_of(ROWS).clamp(ROWS, TILE)
}
