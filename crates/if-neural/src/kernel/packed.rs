//! Weights in the order in which the products read them.

use rayon::prelude::*;

use super::aligned::Aligned;
use super::isa::Isa;
use super::product::{PanelWidth, panelled};
use super::stride;
use crate::init::norm;
use crate::mlp::{LayerLayout, Layout};

/// [`fill`] into memory of its own.
#[cfg(test)]
pub(crate) fn pack(
    isa: Isa,
    outputs: usize,
    depth: usize,
    at: impl Fn(usize, usize) -> f32,
) -> Aligned {
    let width = isa.run(PanelWidth);
    let mut panels = Aligned::zeroed(panelled(width, outputs) * depth);
    fill(panels.as_mut_slice(), width, outputs, depth, at);
    panels
}

/// Weights `at(j, k)` for `outputs` j and a depth of k as panels: outputs in groups of a panel's
/// `width` (the last perhaps of half; what is behind the last output stays as it is, zero), in each
/// group k by k.
fn fill(
    panels: &mut [f32],
    width: usize,
    outputs: usize,
    depth: usize,
    at: impl Fn(usize, usize) -> f32,
) {
    let mut first = 0;
    for panel in panels.chunks_mut(depth * width) {
        let width = panel.len() / depth;
        let count = width.min(outputs - first);
        for (k, row) in panel.chunks_exact_mut(width).enumerate() {
            for (j, value) in row[..count].iter_mut().enumerate() {
                *value = at(first + j, k);
            }
        }
        first += width;
    }
}

/// One linear layer with its weights folded and packed for both directions.
#[derive(Clone, Debug)]
pub(crate) struct PackedLayer {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    /// What W is multiplied by beside: 1/√2 where the input is joined with the encoding.
    pub(crate) scale: f32,
    /// |v| of each row, with weight norm.
    pub(crate) norms: Vec<f64>,
    /// W row by row, scaled.
    pub(crate) weight: Vec<f32>,
    /// For x ↦ W x.
    pub(crate) forward: Aligned,
    /// For p ↦ Wᵀ p.
    pub(crate) backward: Aligned,
    /// b, as wide as the panels.
    pub(crate) bias: Aligned,
}

/// The layers of a network, folded and packed for one instruction set.
#[derive(Clone, Debug)]
pub(crate) struct PackedLayers {
    pub(crate) isa: Isa,
    pub(crate) layers: Vec<PackedLayer>,
}

impl PackedLayers {
    /// Memory for the layers of `layout`; `joined` is the layer whose input is scaled by 1/√2.
    pub(crate) fn new(isa: Isa, layout: &Layout, joined: Option<usize>) -> Self {
        let width = isa.run(PanelWidth);
        let panels =
            |outputs: usize, depth: usize| Aligned::zeroed(panelled(width, outputs) * depth);
        let layers = (layout.layers.iter().enumerate())
            .map(|(l, at)| PackedLayer {
                rows: at.rows,
                columns: at.columns,
                scale: if joined == Some(l) { std::f32::consts::FRAC_1_SQRT_2 } else { 1.0 },
                norms: vec![0.0; if at.gain.is_some() { at.rows } else { 0 }],
                weight: vec![0.0; at.rows * at.columns],
                forward: panels(at.rows, at.columns),
                backward: panels(at.columns, at.rows),
                bias: Aligned::zeroed(stride(at.rows)),
            })
            .collect();
        PackedLayers { isa, layers }
    }

    /// Folds and packs θ.
    pub(crate) fn refresh(&mut self, layout: &Layout, theta: &[f32]) {
        let width = self.isa.run(PanelWidth);
        self.layers
            .par_iter_mut()
            .zip(&layout.layers)
            .for_each(|(layer, at)| layer.refresh(at, theta, width));
    }
}

impl PackedLayer {
    fn refresh(&mut self, at: &LayerLayout, theta: &[f32], width: usize) {
        let (rows, columns) = (self.rows, self.columns);
        let v = &theta[at.weight.clone()];
        for row in 0..rows {
            let span = row * columns..(row + 1) * columns;
            let v = &v[span.clone()];
            let mut scale = f64::from(self.scale);
            if let Some(gain) = &at.gain {
                self.norms[row] = norm(v);
                // A row of zeros has no direction: it stays zero, whatever its gain.
                let norm = self.norms[row];
                scale *= if norm > 0.0 { f64::from(theta[gain.start + row]) / norm } else { 0.0 };
            }
            for (w, &v) in self.weight[span].iter_mut().zip(v) {
                *w = (scale * f64::from(v)) as f32;
            }
        }
        let weight = &self.weight;
        let (forward, backward) = (self.forward.as_mut_slice(), self.backward.as_mut_slice());
        fill(forward, width, rows, columns, |j, k| weight[j * columns + k]);
        fill(backward, width, columns, rows, |j, k| weight[k * columns + j]);
        self.bias.as_mut_slice()[..rows].copy_from_slice(&theta[at.bias.clone()]);
    }

    /// From the derivative by the folded, scaled W (its first `rows` rows, of `sum_stride` floats;
    /// the others are zero) and b to that by θ.
    pub(crate) fn unfold(
        &self,
        at: &LayerLayout,
        theta: &[f32],
        rows: usize,
        sum: &[f32],
        sum_stride: usize,
        bias: &[f32],
        out: &mut [f32],
    ) {
        // `out` begins where the layer does.
        let base = at.weight.start;
        let columns = self.columns;
        out[at.bias.start - base..at.bias.end - base].copy_from_slice(&bias[..self.rows]);
        out[rows * columns..self.rows * columns].fill(0.0);
        if let Some(gain) = &at.gain {
            out[gain.start - base + rows..gain.end - base].fill(0.0);
        }
        for row in 0..rows {
            let dw = &sum[row * sum_stride..][..columns];
            let span = row * columns..(row + 1) * columns;
            let Some(gain) = &at.gain else {
                for (out, d) in out[span].iter_mut().zip(dw) {
                    *out = self.scale * d;
                }
                continue;
            };
            let v = &theta[at.weight.clone()][span.clone()];
            let norm = self.norms[row];
            if norm == 0.0 {
                out[span].fill(0.0);
                out[gain.start - base + row] = 0.0;
                continue;
            }
            let dot: f64 = v.iter().zip(dw).map(|(v, d)| f64::from(*v) * f64::from(*d)).sum();
            let along = f64::from(self.scale) * dot / norm;
            out[gain.start - base + row] = along as f32;
            let scale = f64::from(theta[gain.start + row]) / norm;
            let (by_d, by_v) =
                ((scale * f64::from(self.scale)) as f32, (scale * along / norm) as f32);
            for ((out, v), d) in out[span].iter_mut().zip(v).zip(dw) {
                *out = by_d * d - by_v * v;
            }
        }
    }
}
