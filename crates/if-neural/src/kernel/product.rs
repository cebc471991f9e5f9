//! Products of a tile of points with packed weights, and outer products of two tiles.

use pulp::{Simd, WithSimd};

use super::isa::fma;

/// How many entries of a row are multiplied before the sum goes to memory: 128 × 64 weights are two
/// thirds of a first-level cache. Twice of it is a little faster where a core is ours alone, and
/// slower where its other hardware thread is at work.
const DEPTH: usize = 128;

/// Entries of a row from one test of the loop's counter to the next.
const UNROLL: usize = 4;

/// Calls a kernel made for the lanes of a vector: with the vectors of its micro-tile along the
/// features, its rows, and what else it takes. As many sums as registers hold: 24 of 32 with
/// AVX-512, 12 of 16 with AVX2. Four vectors of 6 rows need 10 loads for 24 multiplications and few
/// addresses, two of 12 rows 14 loads and many: what else a core has to decode decides where two
/// hardware threads share it.
macro_rules! by_lanes {
    ($S:ident, $name:ident, ($($arg:expr),*), $($a:literal)*, $($b:literal)*, $($c:literal)*) => {
        match $S::F32_LANES {
            16 => $name::<$S, $($a),*>($($arg),*),
            8 => $name::<$S, $($b),*>($($arg),*),
            _ => $name::<$S, $($c),*>($($arg),*),
        }
    };
}

/// The width of a packed panel on an instruction set: the features that a micro-tile sums.
pub(crate) struct PanelWidth;

impl WithSimd for PanelWidth {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> usize {
        match S::F32_LANES {
            16 => 64,
            lanes => 2 * lanes,
        }
    }
}

/// The features that panels of `width` have room for: where half a panel is enough for the last
/// features, the last panel is half as wide.
pub(crate) const fn panelled(width: usize, outputs: usize) -> usize {
    outputs.next_multiple_of(width / 2)
}

/// `out[n][j] = bias[j] + Σ_k x[n][k]·w[k][j]` for all points n and all j of the panels.
pub(crate) struct Product<'a> {
    /// The left side, row by row.
    pub(crate) x: &'a [f32],
    pub(crate) x_stride: usize,
    /// Weights: panel after panel, each `depth` rows of a panel's width, the last one perhaps of
    /// half.
    pub(crate) panels: &'a [f32],
    /// Entries of a row of x that are multiplied.
    pub(crate) depth: usize,
    /// What the sums start from, as wide as the panels together; empty for zero.
    pub(crate) bias: &'a [f32],
    pub(crate) out: &'a mut [f32],
    pub(crate) out_stride: usize,
    /// Rows, a multiple of [`super::ROWS`].
    pub(crate) points: usize,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        by_lanes!(S, product, (simd, self), 4 2 6, 2 1 6, 2 1 4);
    }
}

/// V vectors for the panels, H, half of them, for the rest.
#[inline(always)]
fn product<S: Simd, const V: usize, const H: usize, const P: usize>(simd: S, mut on: Product<'_>) {
    let (width, half) = (V * S::F32_LANES, H * S::F32_LANES);
    let mut panels = on.panels.chunks_exact(on.depth * width);
    let mut j = 0;
    for panel in &mut panels {
        product_of_panel::<S, V, P>(simd, &mut on, panel, j);
        j += width;
    }
    for panel in panels.remainder().chunks_exact(on.depth * half) {
        product_of_panel::<S, H, P>(simd, &mut on, panel, j);
        j += half;
    }
}

/// The features from `j` on, as many as the panel has.
#[inline(always)]
fn product_of_panel<S: Simd, const V: usize, const P: usize>(
    simd: S,
    on: &mut Product<'_>,
    panel: &[f32],
    j: usize,
) {
    let width = V * S::F32_LANES;
    let Product { x, x_stride, depth, bias, ref mut out, out_stride, points, .. } = *on;
    let (panel, _) = S::as_simd_f32s(panel);
    let (panel, _) = panel.as_chunks::<V>();
    let mut from = 0;
    while from < depth {
        let to = (from + DEPTH).min(depth);
        let block = &panel[from..to];
        let mut start = [simd.splat_f32s(0.0); V];
        if from == 0 && !bias.is_empty() {
            let (bias, _) = S::as_simd_f32s(&bias[j..j + width]);
            start.copy_from_slice(bias);
        }
        let mut n = 0;
        while n < points {
            let mut rows: [&[f32]; P] = [&[]; P];
            for p in 0..P {
                rows[p] = &x[(n + p) * x_stride + from..][..block.len()];
            }
            let sums = sum_of_products::<S, V, P>(simd, block, rows);
            for p in 0..P {
                let at = (n + p) * out_stride + j;
                let (out, _) = S::as_mut_simd_f32s(&mut out[at..at + width]);
                for v in 0..V {
                    let before = if from == 0 { start[v] } else { out[v] };
                    out[v] = simd.add_f32s(before, sums[p][v]);
                }
            }
            n += P;
        }
        from = to;
    }
}

#[inline(always)]
fn sum_of_products<S: Simd, const V: usize, const P: usize>(
    simd: S,
    block: &[[S::f32s; V]],
    rows: [&[f32]; P],
) -> [[S::f32s; V]; P] {
    let mut sums = [[simd.splat_f32s(0.0); V]; P];
    let (blocks, rest) = block.as_chunks::<UNROLL>();
    let heads = rows.map(|row| row.as_chunks::<UNROLL>().0);
    for p in 0..P {
        assert!(heads[p].len() == blocks.len());
    }
    for k in 0..blocks.len() {
        for u in 0..UNROLL {
            let w = blocks[k][u];
            for p in 0..P {
                let x = simd.splat_f32s(heads[p][k][u]);
                for v in 0..V {
                    sums[p][v] = fma(simd, x, w[v], sums[p][v]);
                }
            }
        }
    }
    let done = UNROLL * blocks.len();
    for (k, w) in rest.iter().enumerate() {
        for p in 0..P {
            let x = simd.splat_f32s(rows[p][done + k]);
            for v in 0..V {
                sums[p][v] = fma(simd, x, w[v], sums[p][v]);
            }
        }
    }
    sums
}

/// One pair of tiles whose outer products are summed: `d[n][i]·a[n][j]`.
#[derive(Clone, Copy)]
pub(crate) struct Pair<'a> {
    pub(crate) d: &'a [f32],
    pub(crate) d_stride: usize,
    pub(crate) a: &'a [f32],
    pub(crate) a_stride: usize,
}

/// `sum[i][j] += Σ_n Σ_pairs d[n][i]·a[n][j]`, i below `rows`, j below `columns`, both rounded up
/// to the micro-tile: `sum` and the tiles have room for multiples of 12 and 64.
pub(crate) struct Outer<'a, 'b> {
    pub(crate) pairs: &'b [Pair<'a>],
    pub(crate) points: usize,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) sum: &'a mut [f32],
    pub(crate) sum_stride: usize,
}

impl WithSimd for Outer<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        by_lanes!(S, outer, (simd, self), 4 6, 2 6, 2 4);
    }
}

#[inline(always)]
fn outer<S: Simd, const V: usize, const R: usize>(simd: S, on: Outer<'_, '_>) {
    let width = V * S::F32_LANES;
    let Outer { pairs, points, rows, columns, sum, sum_stride } = on;
    let mut j = 0;
    while j < columns {
        let mut i = 0;
        while i < rows {
            let mut sums = [[simd.splat_f32s(0.0); V]; R];
            for pair in pairs {
                let d = pair.d.chunks_exact(pair.d_stride);
                let a = pair.a.chunks_exact(pair.a_stride);
                for (d, a) in d.zip(a).take(points) {
                    let d = &d[i..i + R];
                    let (a, _) = S::as_simd_f32s(&a[j..j + width]);
                    let (a, _) = a.as_chunks::<V>();
                    for r in 0..R {
                        let d = simd.splat_f32s(d[r]);
                        for v in 0..V {
                            sums[r][v] = fma(simd, d, a[0][v], sums[r][v]);
                        }
                    }
                }
            }
            for r in 0..R {
                let at = (i + r) * sum_stride + j;
                let (out, _) = S::as_mut_simd_f32s(&mut sum[at..at + width]);
                for v in 0..V {
                    out[v] = simd.add_f32s(out[v], sums[r][v]);
                }
            }
            i += R;
        }
        j += width;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::init::Normal;
    use crate::kernel::{ROWS, isa::Isa, packed::pack, stride};

    fn random(len: usize, seed: u64) -> Vec<f32> {
        let mut normal = Normal::seeded(seed);
        (0..len).map(|_| normal.next() as f32).collect()
    }

    #[test]
    fn products_are_those_of_plain_loops_on_every_instruction_set() {
        for isa in Isa::all() {
            for (rows, columns, points) in [(1, 1, 12), (39, 217, 24), (70, 600, 12)] {
                let (weight, bias) = (random(rows * columns, 1), random(rows, 2));
                let points = usize::next_multiple_of(points, ROWS);
                let x = random(points * stride(columns), 3);
                let panels = pack(isa, rows, columns, |i, k| weight[i * columns + k]);
                let mut padded = bias.clone();
                padded.resize(stride(rows), 0.0);
                let mut out = vec![f32::NAN; points * stride(rows)];
                isa.run(Product {
                    x: &x,
                    x_stride: stride(columns),
                    panels: panels.as_slice(),
                    depth: columns,
                    bias: &padded,
                    out: &mut out,
                    out_stride: stride(rows),
                    points,
                });
                for n in 0..points {
                    for i in 0..rows {
                        let exact: f64 = f64::from(bias[i])
                            + (0..columns)
                                .map(|k| {
                                    f64::from(x[n * stride(columns) + k])
                                        * f64::from(weight[i * columns + k])
                                })
                                .sum::<f64>();
                        let got = f64::from(out[n * stride(rows) + i]);
                        // 600 terms of size 1: √600 roundings of 6e-8 of a sum of about 25.
                        assert!((got - exact).abs() < 1e-4, "{}: {got} {exact}", isa.name());
                    }
                }
            }
        }
    }

    #[test]
    fn outer_products_are_those_of_plain_loops_on_every_instruction_set() {
        for isa in Isa::all() {
            for (rows, columns, points) in [(1, 1, 12), (257, 39, 24), (13, 70, 36)] {
                let d = random(points * stride(rows), 1);
                let a = random(points * stride(columns), 2);
                let mut sum = vec![1.0; rows.next_multiple_of(ROWS) * stride(columns)];
                let pair = Pair { d: &d, d_stride: stride(rows), a: &a, a_stride: stride(columns) };
                let pairs = [pair, pair];
                let (sum_stride, sum) = (stride(columns), &mut sum);
                isa.run(Outer { pairs: &pairs, points, rows, columns, sum, sum_stride });
                for i in 0..rows {
                    for j in 0..columns {
                        let exact: f64 = (0..points)
                            .map(|n| {
                                2.0 * f64::from(d[n * stride(rows) + i])
                                    * f64::from(a[n * stride(columns) + j])
                            })
                            .sum::<f64>()
                            + 1.0;
                        let got = f64::from(sum[i * sum_stride + j]);
                        assert!((got - exact).abs() < 3e-5, "{}: {got} {exact}", isa.name());
                    }
                }
            }
        }
    }
}
