//! Evaluation of a grid in blocks of points: values, and derivatives by all parameters.

use super::GridField;
use super::head::{LANES, Lanes, Tile, ZERO};
use super::level::Level;
use crate::trainable::{PointLoss, Sample32};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Points of one task.
const BLOCK: usize = 256;

/// Computes φ and ∇φ of one block.
struct Read<'a, const F: usize> {
    grid: &'a GridField,
    points: &'a [[f32; 3]],
    out: &'a mut [Sample32],
}

impl<const F: usize> WithSimd for Read<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let head = &self.grid.head;
        let mut tile = Tile::new(head);
        for (points, out) in self.points.chunks(LANES).zip(self.out.chunks_mut(LANES)) {
            self.grid.read_tile::<S, F>(points, &mut tile);
            let (value, gradient) =
                head.forward::<S>(&self.grid.params[self.grid.tables()..], &mut tile);
            for (lane, o) in out.iter_mut().enumerate() {
                *o = Sample32 {
                    value: value[lane],
                    gradient: [gradient[0][lane], gradient[1][lane], gradient[2][lane]],
                };
            }
        }
    }
}

/// Computes the loss of one block and its derivatives by the head and by the features.
struct Reverse<'a, const F: usize> {
    grid: &'a GridField,
    points: &'a [[f32; 3]],
    /// Index of the first point.
    first: usize,
    loss: &'a (dyn Fn(usize, Sample32) -> PointLoss + Sync),
    /// For each level and point of the block: derivatives by the value and the gradient of the F
    /// features.
    adjoint: &'a mut [[[f32; F]; 4]],
}

impl<const F: usize> WithSimd for Reverse<'_, F> {
    type Output = (f64, Vec<f32>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> (f64, Vec<f32>) {
        let (head, levels) = (&self.grid.head, self.grid.levels.len());
        let params = &self.grid.params[self.grid.tables()..];
        let mut tile = Tile::new(head);
        let mut sums = vec![ZERO; head.len()];
        let mut total = 0.0;
        let n = self.points.len();
        for (t, points) in self.points.chunks(LANES).enumerate() {
            self.grid.read_tile::<S, F>(points, &mut tile);
            let (value, gradient) = head.forward::<S>(params, &mut tile);
            // Lanes without a point have no loss.
            let (mut d_value, mut d_gradient) = (ZERO, [ZERO; 3]);
            for lane in 0..points.len() {
                let sample = Sample32 {
                    value: value[lane],
                    gradient: [gradient[0][lane], gradient[1][lane], gradient[2][lane]],
                };
                let l = (self.loss)(self.first + t * LANES + lane, sample);
                total += l.loss;
                d_value[lane] = l.d_value;
                (0..3).for_each(|k| d_gradient[k][lane] = l.d_gradient[k]);
            }
            head.reverse::<S>(params, &mut tile, &d_value, &d_gradient, &mut sums);
            for level in 0..levels {
                for lane in 0..points.len() {
                    let to = &mut self.adjoint[level * n + t * LANES + lane];
                    for f in 0..F {
                        let d = level * F + f;
                        to[0][f] = tile.adjoint[d][lane];
                        (0..3).for_each(|k| to[1 + k][f] = tile.q[d][lane] * d_gradient[k][lane]);
                    }
                }
            }
        }
        (total, sums.iter().map(|lanes: &Lanes| lanes.iter().sum()).collect())
    }
}

/// Adds the derivatives by the features of one level to those by its nodes.
struct Scatter<'a, const F: usize> {
    level: &'a Level,
    points: &'a [[f32; 3]],
    adjoint: &'a [[[f32; F]; 4]],
    table: &'a mut [f32],
}

impl<const F: usize> WithSimd for Scatter<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (p, a) in self.points.iter().zip(self.adjoint) {
            self.level.scatter::<S, F>(self.table, p, a);
        }
    }
}

impl GridField {
    pub(super) fn samples_of<const F: usize>(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        let arch = pulp::Arch::new();
        let one = |(points, out): (&[[f32; 3]], &mut [Sample32])| {
            arch.dispatch(Read::<F> { grid: self, points, out })
        };
        if points.len() <= BLOCK {
            return points.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).for_each(one);
        }
        points.par_chunks(BLOCK).zip(out.par_chunks_mut(BLOCK)).for_each(one);
    }

    pub(super) fn loss_gradient_of<const F: usize>(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        let arch = pulp::Arch::new();
        let levels = self.levels.len();
        let mut adjoint = vec![[[0.0f32; F]; 4]; levels * points.len()];
        let parts: Vec<(f64, Vec<f32>)> = points
            .par_chunks(BLOCK)
            .zip(adjoint.par_chunks_mut(BLOCK * levels))
            .enumerate()
            .map(|(b, (points, adjoint))| {
                arch.dispatch(Reverse::<F> { grid: self, points, first: b * BLOCK, loss, adjoint })
            })
            .collect();
        let (mut tables, head) = gradient.split_at_mut(self.tables());
        head.fill(0.0);
        let mut total = 0.0;
        for (loss, part) in &parts {
            total += loss;
            head.iter_mut().zip(part).for_each(|(h, p)| *h += p);
        }
        // One task a level, so that every node is summed in the order of the points.
        let mut tasks = Vec::with_capacity(levels);
        for (l, level) in self.levels.iter().enumerate() {
            let (table, rest) = tables.split_at_mut(level.entries * F);
            tables = rest;
            tasks.push((l, level, table));
        }
        tasks.into_par_iter().rev().for_each(|(l, level, table)| {
            table.fill(0.0);
            for (points, adjoint) in points.chunks(BLOCK).zip(adjoint.chunks(BLOCK * levels)) {
                let adjoint = &adjoint[l * points.len()..][..points.len()];
                arch.dispatch(Scatter::<F> { level, points, adjoint, table: &mut *table });
            }
        });
        total
    }

    /// Reads all features of up to [`LANES`] points; lanes beyond hold the last of them.
    #[inline(always)]
    fn read_tile<S: Simd, const F: usize>(&self, points: &[[f32; 3]], tile: &mut Tile) {
        for (l, level) in self.levels.iter().enumerate() {
            let table = &self.params[level.offset..][..level.entries * F];
            for lane in 0..LANES {
                let (value, gradient) =
                    level.read::<S, F>(table, &points[lane.min(points.len() - 1)]);
                for f in 0..F {
                    tile.f[l * F + f][lane] = value[f];
                    for k in 0..3 {
                        tile.jacobian[l * F + f][k][lane] = gradient[k][f];
                    }
                }
            }
        }
    }
}
