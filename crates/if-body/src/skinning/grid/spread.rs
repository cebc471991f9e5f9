//! The weights of the nodes: means of the nearest vertices, then smoothed.

use super::WeightGrid;
use crate::skin_weights::SkinWeights;
use if_core::math::{Point, Real, Vector};
use if_mesh::point_tree::PointTree;
use rayon::prelude::*;

/// Least distance of a node from a vertex, in metres, which bounds the inverse distance. A
/// thousandth of a cell: ten times more or less changes weights by less than the smoothing does.
const NEAREST: Real = 2e-5;

impl WeightGrid {
    /// The inverse-distance mean of the weights of the nearest vertices, at each node.
    pub(super) fn gathered(
        &self,
        points: &[Point],
        skin: &SkinWeights,
        neighbours: usize,
    ) -> Vec<f32> {
        let tree = PointTree::new(points);
        let [nx, ny, _] = self.nodes.0;
        let mut out = vec![0.0; self.nodes.len() * self.joints];
        out.par_chunks_mut(nx * self.joints).enumerate().for_each(|(row, out)| {
            let mut found = Vec::with_capacity(neighbours + 1);
            let mut sum = vec![0.0; self.joints];
            for (i, node) in out.chunks_exact_mut(self.joints).enumerate() {
                let p = self.min
                    + Vector::new(i as Real, (row % ny) as Real, (row / ny) as Real) * self.cell;
                tree.nearest(&p, neighbours, &mut found);
                sum.fill(0.0);
                let mut total = 0.0;
                for (squared, v) in &found {
                    let near = 1.0 / squared.sqrt().max(NEAREST);
                    total += near;
                    let v = *v as usize;
                    for (j, w) in skin.joints()[v].iter().zip(&skin.weights()[v]) {
                        sum[usize::from(*j)] += near * Real::from(*w);
                    }
                }
                node.iter_mut().zip(&sum).for_each(|(o, s)| *o = (s / total) as f32);
            }
        });
        out
    }

    /// One round of smoothing: each node becomes the mean of its neighbours (fewer on the border),
    /// normalised.
    pub(super) fn smoothed(&self) -> Vec<f32> {
        let [nx, ny, nz] = self.nodes.0;
        let n = self.joints;
        let mut out = vec![0.0; self.weights.len()];
        out.par_chunks_mut(nx * n).enumerate().for_each(|(row, out)| {
            let (y, z) = (row % ny, row / ny);
            for (x, node) in out.chunks_exact_mut(n).enumerate() {
                let mut add = |x: usize, y: usize, z: usize| {
                    let from = &self.weights[self.nodes.index([x, y, z]) * n..][..n];
                    node.iter_mut().zip(from).for_each(|(o, w)| *o += w);
                };
                if x > 0 {
                    add(x - 1, y, z);
                }
                if x + 1 < nx {
                    add(x + 1, y, z);
                }
                if y > 0 {
                    add(x, y - 1, z);
                }
                if y + 1 < ny {
                    add(x, y + 1, z);
                }
                if z > 0 {
                    add(x, y, z - 1);
                }
                if z + 1 < nz {
                    add(x, y, z + 1);
                }
                let sum: f32 = node.iter().sum();
                node.iter_mut().for_each(|o| *o /= sum);
            }
        });
        out
    }
}
