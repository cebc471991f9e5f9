//! Coarse outward directions of closed layers, on the scale of centimetres.
//!
//! The shortest exit from a pleat or an armpit is through its wall. A coarse garment over it needs
//! the direction out of the whole body instead: minus the gradient of the layers' occupancy,
//! blurred by three box filters along each axis, a good approximation of a Gaussian.

use crate::grid::GridSize;
use crate::solid::ClosedLayer;
use crate::voxels::Voxel;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use rayon::prelude::*;

/// Outward directions of a union of closed layers, over a box.
#[derive(Clone, Debug)]
pub struct Outward {
    origin: Point,
    cell: Real,
    size: GridSize,
    /// 0 outside, 1 inside, blurred.
    occupancy: Vec<f32>,
}

/// Half width of a box filter, in cells. Three passes of 2 have a standard deviation of 2.4 cells.
const RADIUS: usize = 2;
/// Maximum number of nodes; larger regions get larger cells.
const MAX_NODES: Real = 16_777_216.0;
/// Minimum gradient of a direction, per cell. It is 0.16 at a wide wall.
const FLAT: Real = 0.02;
/// The same where less than [`THIN`] is occupied: in fingers weaker ones lead to their tips or across the
/// next finger. With 0.05 gloves still slid by up to a centimetre.
const FLAT_IF_THIN: Real = 0.08;
/// Blurred occupancy under which a part is thin beside the blur. It is more than half inside a wide wall.
const THIN: Real = 0.6;

impl Outward {
    /// Directions out of `layers` in `region`, on cells of `cell` metres (more, for a huge region).
    /// There are no directions in a region that is empty or not finite.
    pub fn new(layers: &[&ClosedLayer], region: &Aabb, cell: Real) -> Self {
        let size = region.size();
        if !size.iter().all(|s| (0.0..Real::INFINITY).contains(s)) {
            return Self {
                origin: Point::origin(),
                cell,
                size: GridSize([0; 3]),
                occupancy: Vec::new(),
            };
        }
        let border = 2.0 + 3.0 * RADIUS as Real;
        let fits =
            |c: Real| (0..3).map(|k| size[k] / c + 2.0 * border).product::<Real>() <= MAX_NODES;
        let mut cell = cell;
        while !fits(cell) {
            cell *= 1.25;
        }
        let size = GridSize([0, 1, 2].map(|k| (size[k] / cell + 2.0 * border).ceil() as usize));
        let origin = region.min - Vector::repeat(border * cell);
        let [nx, ny, _] = size.0;
        let mut occupancy = vec![0.0f32; size.len()];
        occupancy.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slab)| {
            for (y, row) in slab.chunks_exact_mut(nx).enumerate() {
                let start = origin + Vector::new(0.0, y as Real, z as Real) * cell;
                for layer in layers {
                    let of_layer = layer.voxels().row(&start, cell, nx);
                    of_layer
                        .filter(|(_, v)| !matches!(v, Voxel::Outside | Voxel::Core))
                        .for_each(|(x, _)| row[x] = 1.0);
                }
            }
        });
        let mut this = Self { origin, cell, size, occupancy };
        for _ in 0..3 {
            this.blur();
        }
        this
    }

    /// One box filter along each axis. Rows, columns and stacks are summed whole rows at a time, from the
    /// lowest to the highest.
    fn blur(&mut self) {
        let [nx, ny, nz] = self.size.0;
        let plane = nx * ny;
        self.occupancy.par_chunks_mut(plane).for_each_init(
            Default::default,
            |(source, line): &mut (Vec<f32>, Vec<f32>), slab| {
                for row in slab.chunks_exact_mut(nx) {
                    blur_row(row, line);
                }
                source.clear();
                source.extend_from_slice(slab);
                for (y, row) in slab.chunks_exact_mut(nx).enumerate() {
                    mean_of_lines(row, source, nx, y, ny);
                }
            },
        );
        let source = self.occupancy.clone();
        self.occupancy
            .par_chunks_mut(plane)
            .enumerate()
            .for_each(|(z, slab)| mean_of_lines(slab, &source, plane, z, nz));
    }

    /// Unit outward direction at `p`; `None` far outside, deep inside and beyond the box, where the
    /// occupancy is constant, and in parts that are thin beside the blur, such as fingers.
    pub fn direction(&self, p: &Point) -> Option<Vector> {
        let rel = (p - self.origin) / self.cell;
        let base = [0, 1, 2].map(|k| rel[k].floor());
        if (0..3).any(|k| !(base[k] >= 0.0 && base[k] + 1.0 < self.size.0[k] as Real)) {
            return None;
        }
        let t = [0, 1, 2].map(|k| rel[k] - base[k]);
        let weight = |axis: usize, side: usize| if side == 0 { 1.0 - t[axis] } else { t[axis] };
        let at = |x: usize, y: usize, z: usize| {
            let [i, j, k] = base.map(|b| b as usize);
            let i = self.size.index([i + x, j + y, k + z]);
            Real::from(self.occupancy[i])
        };
        let mut g = Vector::zeros();
        for k in 0..3 {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            for a in 0..2 {
                for b in 0..2 {
                    let mut c = [[0usize; 3]; 2];
                    for (side, c) in c.iter_mut().enumerate() {
                        c[k] = side;
                        c[u] = a;
                        c[v] = b;
                    }
                    g[k] += weight(u, a)
                        * weight(v, b)
                        * (at(c[0][0], c[0][1], c[0][2]) - at(c[1][0], c[1][1], c[1][2]));
                }
            }
        }
        let steepness = g.norm();
        let is_thin = || {
            let corners = (0..8).map(|c| [c & 1, (c >> 1) & 1, c >> 2]);
            let occupied =
                corners.map(|[x, y, z]| weight(0, x) * weight(1, y) * weight(2, z) * at(x, y, z));
            occupied.sum::<Real>() < THIN
        };
        let is_clear = steepness > FLAT && (steepness > FLAT_IF_THIN || !is_thin());
        is_clear.then(|| unit_or_zero(&g))
    }
}

/// Weight of one value in the mean of a window.
const SHARE: f32 = 1.0 / (2 * RADIUS + 1) as f32;

/// Writes to `out` the mean of the lines around the `k`-th of the `n` lines of `source`, each
/// `length` long.
fn mean_of_lines(out: &mut [f32], source: &[f32], length: usize, k: usize, n: usize) {
    let (from, to) = (k.saturating_sub(RADIUS), (k + RADIUS).min(n - 1));
    out.copy_from_slice(&source[from * length..(from + 1) * length]);
    for other in from + 1..=to {
        out.iter_mut()
            .zip(&source[other * length..(other + 1) * length])
            .for_each(|(a, b)| *a += b);
    }
    out.iter_mut().for_each(|a| *a *= SHARE);
}

/// Replaces each value of the row by the mean of its window; `line` is working memory.
fn blur_row(row: &mut [f32], line: &mut Vec<f32>) {
    line.clear();
    line.extend([0.0; RADIUS]);
    line.extend_from_slice(row);
    line.extend([0.0; RADIUS]);
    row.copy_from_slice(&line[..row.len()]);
    for shift in 1..=2 * RADIUS {
        row.iter_mut().zip(&line[shift..]).for_each(|(a, b)| *a += b);
    }
    row.iter_mut().for_each(|a| *a *= SHARE);
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::{cuboid, tube};

    const CELL: Real = 9e-3;

    fn outward(meshes: &[TriMesh]) -> Outward {
        let layers: Vec<ClosedLayer> = meshes.iter().map(ClosedLayer::body).collect();
        let region = meshes.iter().map(TriMesh::aabb).reduce(|a, b| a.merged(&b)).unwrap();
        Outward::new(&layers.iter().collect::<Vec<_>>(), &region.inflated(0.05), CELL)
    }

    #[test]
    fn the_way_out_of_a_wide_wall_is_its_normal_to_some_depth() {
        let outward = outward(&[cuboid(Vector::new(0.15, 0.2, 0.15))]);
        for depth in [-0.02, 0.0, 0.02, 0.035] {
            let out = outward.direction(&Point::new(0.15 - depth, 0.0, 0.0)).unwrap();
            assert!(out.x > 0.999, "{depth}: {out:?}");
        }
        for x in [0.0, 0.25, 1.0] {
            assert_eq!(outward.direction(&Point::new(x, 0.0, 0.0)), None, "{x}");
        }
    }

    #[test]
    fn fingers_have_no_way_out_along_or_across_them() {
        let finger = tube(8e-3, 0.12, 16, 30, true);
        let fingers = [-0.03, -0.01, 0.01, 0.03].map(|x| {
            let aside = finger.vertices().iter().map(|p| p + Vector::x() * x);
            finger.with_vertices(aside.collect()).unwrap()
        });
        let outward = outward(&fingers);
        for (x, z) in [(0.004, 0.0), (0.008, 4e-3), (0.012, 6e-3)] {
            for y in [0.06, 0.08, 0.1] {
                let out = outward.direction(&Point::new(x, y, z));
                assert_eq!(out, None, "{x} {y} {z}");
            }
        }
    }
}
