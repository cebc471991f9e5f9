//! A bound on |∇φ| over the whole cube, by interval arithmetic instead of samples.

use super::GridField;
use rayon::prelude::*;

/// Values are rounded to f32 a few hundred times on the way to a gradient.
const ROUNDING: f64 = 1e-4;

impl GridField {
    /// A number that |∇φ| exceeds nowhere in the cube: a certificate, where sampling only guesses.
    ///
    /// Along an axis the slope of a quadratic spline is a mean of the differences of neighbouring
    /// nodes, and σ′ lies between 0 and 1. So in each of `blocks`³ boxes every component of ∇φ lies
    /// in an interval that the nodes around the box give; the bound is the longest vector of all
    /// those intervals. More blocks bring it nearer to the truth.
    ///
    /// # Accuracy
    ///
    /// With 64 blocks on a fitted body about 1.5 to 3 times the steepest gradient there is: the
    /// levels' extremes are added as if they met in one point.
    ///
    /// # Panics
    ///
    /// If `blocks` is zero.
    pub fn certified_slope(&self, blocks: usize) -> f64 {
        assert!(blocks > 0, "at least one block");
        let head = self.head_slopes();
        let square = |z: usize| {
            let mut most = 0.0f64;
            for y in 0..blocks {
                for x in 0..blocks {
                    most = most.max(self.steepest_in([x, y, z], blocks, &head));
                }
            }
            most
        };
        (0..blocks).into_par_iter().map(square).reduce(|| 0.0, f64::max).sqrt() * (1.0 + ROUNDING)
    }

    /// What the hidden layer may add to ∂φ/∂f, least and most.
    fn head_slopes(&self) -> Vec<[f64; 2]> {
        let (d, h) = (self.head.linear.len(), self.head.hidden);
        let params = &self.params[self.tables()..];
        let v = &params[h * (d + 1)..][..h];
        let mut slopes = vec![[0.0f64; 2]; d];
        for (row, v) in params[..h * d].chunks_exact(d.max(1)).zip(v) {
            for (slope, w) in slopes.iter_mut().zip(row) {
                let product = f64::from(*w) * f64::from(*v);
                slope[0] += product.min(0.0);
                slope[1] += product.max(0.0);
            }
        }
        slopes
    }

    /// The square of the longest gradient that a block may hold.
    fn steepest_in(&self, block: [usize; 3], blocks: usize, head: &[[f64; 2]]) -> f64 {
        let features = self.config.features as usize;
        let mut component = [[0.0f64; 2]; 3];
        for (l, level) in self.levels.iter().enumerate() {
            // Nodes that some point of the block reads, also if its place is rounded: half a cell
            // is left on each side.
            let first = block.map(|b| b * level.cells / blocks);
            let last = block.map(|b| ((b + 1) * level.cells).div_ceil(blocks) + 2);
            for f in 0..features {
                let value = |i: usize, j: usize, k: usize| {
                    f64::from(self.params[level.offset + (level.row(j, k) + i) * features + f])
                };
                let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
                for k in first[2]..=last[2] {
                    for j in first[1]..=last[1] {
                        for i in first[0]..=last[0] {
                            let here = value(i, j, k);
                            let mut see = |axis: usize, next: f64| {
                                range[axis][0] = range[axis][0].min(next - here);
                                range[axis][1] = range[axis][1].max(next - here);
                            };
                            if i < last[0] {
                                see(0, value(i + 1, j, k));
                            }
                            if j < last[1] {
                                see(1, value(i, j + 1, k));
                            }
                            if k < last[2] {
                                see(2, value(i, j, k + 1));
                            }
                        }
                    }
                }
                let d = l * features + f;
                let q = head[d].map(|s| s + f64::from(self.head.linear[d]));
                for (axis, c) in component.iter_mut().enumerate() {
                    let products = [0, 1, 2, 3]
                        .map(|s| q[s & 1] * range[axis][s >> 1] * f64::from(level.inverse));
                    c[0] += products.iter().copied().fold(f64::INFINITY, f64::min);
                    c[1] += products.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                }
            }
        }
        component.iter().map(|c| c[0].abs().max(c[1].abs()).powi(2)).sum()
    }
}
