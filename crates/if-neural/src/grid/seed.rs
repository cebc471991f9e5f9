//! The first values of a grid: level by level what the coarser levels miss of a target.

use super::GridField;
use crate::trainable::{Sample32, TrainableField};

/// Finer levels are seeded this many cells to each side of the surface: the splines of a point on
/// it reach 1.5, and training samples lie up to about 2 cells off.
const REACH: f32 = 4.0;
/// Nodes of a brick, along each side.
const BRICK: usize = 8;
/// Points of one call.
const BATCH: usize = 1 << 15;
/// Levels with more nodes along a side are not seeded: the residual takes 4 bytes a node.
pub(super) const LARGEST: usize = 512;

impl GridField {
    /// Sets the linear path of the `levels` coarsest levels to a target given by its values: the
    /// coarsest level everywhere, finer ones near the surface. The rest of the grid is left as it
    /// is.
    ///
    /// Values at the nodes are turned into spline coefficients by `c = r − Δ²r / 8` along each
    /// axis, which reproduces quadratics. Where rows share entries, the mean is taken.
    pub fn seed(&mut self, levels: usize, mut target: impl FnMut(&[[f32; 3]], &mut [f32])) {
        let features = self.config.features as usize;
        for l in 0..levels.min(self.levels.len()) {
            let level = self.levels[l];
            if level.side > LARGEST {
                return;
            }
            let mut residual = vec![f32::NAN; level.side.pow(3)];
            let nodes =
                if l == 0 { (0..level.side.pow(3)).collect() } else { self.near_surface(l) };
            let mut values = [vec![0.0; BATCH], vec![0.0; BATCH]];
            for nodes in nodes.chunks(BATCH) {
                let points: Vec<[f32; 3]> =
                    nodes.iter().map(|n| level.node(level.split(*n))).collect();
                let [wanted, got] = &mut values;
                target(&points, &mut wanted[..points.len()]);
                if l > 0 {
                    self.values(&points, &mut got[..points.len()]);
                }
                for (k, n) in nodes.iter().enumerate() {
                    residual[*n] = wanted[k] - if l == 0 { 0.0 } else { got[k] };
                }
            }
            let mut sums = vec![(0.0f32, 0u32); level.entries];
            for n in &nodes {
                let [i, j, k] = level.split(*n);
                let at = &mut sums[level.row(j, k) + i];
                *at = (at.0 + sharpened(&residual, level.side, *n), at.1 + 1);
            }
            for (e, (sum, count)) in sums.iter().enumerate() {
                if *count > 0 {
                    self.params[level.offset + e * features] = sum / *count as f32 * level.inverse;
                }
            }
        }
    }

    fn values(&self, points: &[[f32; 3]], out: &mut [f32]) {
        let mut samples = vec![Sample32::default(); points.len()];
        self.samples32(points, &mut samples);
        out.iter_mut().zip(&samples).for_each(|(o, s)| *o = s.value);
    }

    /// Nodes of level `l` within reach of the surface as the grid has it now, in order.
    fn near_surface(&self, l: usize) -> Vec<usize> {
        let level = self.levels[l];
        let bricks = level.side.div_ceil(BRICK);
        let middle = |b: [usize; 3]| {
            b.map(|x| (x * BRICK) as f32 + 0.5 * (BRICK as f32 - 1.0))
                .map(|i| (i - 1.0) * level.cell - 1.0)
        };
        let split = |b: usize| [b % bricks, b / bricks % bricks, b / bricks / bricks];
        let middles: Vec<[f32; 3]> = (0..bricks.pow(3)).map(|b| middle(split(b))).collect();
        let mut values = vec![0.0; middles.len()];
        self.values(&middles, &mut values);
        // Half a diagonal, and a tenth for a field that is not quite a distance.
        let reach = 1.1 * level.cell * (REACH + 0.5 * BRICK as f32 * 3.0f32.sqrt());
        let mut nodes = Vec::new();
        for (b, _) in values.iter().enumerate().filter(|(_, v)| v.abs() <= reach) {
            let first = split(b).map(|x| x * BRICK);
            for n in 0..BRICK.pow(3) {
                let at = [
                    first[0] + n % BRICK,
                    first[1] + n / BRICK % BRICK,
                    first[2] + n / BRICK / BRICK,
                ];
                if at.iter().all(|i| *i < level.side) {
                    nodes.push((at[2] * level.side + at[1]) * level.side + at[0]);
                }
            }
        }
        let points: Vec<[f32; 3]> = nodes.iter().map(|n| level.node(level.split(*n))).collect();
        let mut values = vec![0.0; points.len()];
        self.values(&points, &mut values);
        let mut near: Vec<usize> = nodes
            .iter()
            .zip(&values)
            .filter(|(_, v)| v.abs() <= 1.1 * REACH * level.cell)
            .map(|(n, _)| *n)
            .collect();
        near.sort_unstable();
        near
    }
}

impl super::level::Level {
    fn split(&self, n: usize) -> [usize; 3] {
        [n % self.side, n / self.side % self.side, n / self.side / self.side]
    }
}

/// The spline coefficient at a node; along an axis where a neighbour has no value the value is
/// kept.
fn sharpened(values: &[f32], side: usize, n: usize) -> f32 {
    let here = values[n];
    let mut out = here;
    for stride in [1, side, side * side] {
        let place = n / stride % side;
        if place > 0 && place + 1 < side {
            let bend = values[n - stride] - 2.0 * here + values[n + stride];
            if bend.is_finite() {
                out -= bend / 8.0;
            }
        }
    }
    out
}
