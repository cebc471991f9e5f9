//! Skinning weights for all points of canonical space.

use super::{Affine, whole};
use crate::skin_weights::SkinWeights;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_mesh::point_tree::PointTree;
use nalgebra::{Isometry3, Matrix3};
use rayon::prelude::*;

/// How [`WeightGrid`] is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightGridParams {
    /// Distance of neighbouring nodes, in metres.
    pub cell: Real,
    /// How far the grid goes beyond the body's box, along each axis, in metres.
    pub margin: Vector,
    /// How many of the body's vertices a node takes the mean of.
    pub neighbours: usize,
    /// Rounds of smoothing over the six neighbours.
    pub rounds: usize,
}

impl Default for WeightGridParams {
    /// The margins, neighbours and rounds of the lineage; nodes 2 cm apart.
    fn default() -> Self {
        Self { cell: 0.02, margin: Vector::new(0.15, 0.15, 0.20), neighbours: 30, rounds: 30 }
    }
}

/// Why there is no grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WeightGridError {
    /// Nothing to take weights from.
    #[error("a grid of weights needs vertices and joints; there are {vertices} and {joints}")]
    Empty {
        /// Vertices given.
        vertices: usize,
        /// Joints given.
        joints: usize,
    },
    /// Not one record for each vertex.
    #[error("{vertices} vertices with {weights} records of weights")]
    Count {
        /// Vertices given.
        vertices: usize,
        /// Records given.
        weights: usize,
    },
    /// A vertex hangs on a joint that is not there.
    #[error("vertex {vertex} hangs on joint {joint}, but there are only {joints}")]
    Joint {
        /// Which vertex.
        vertex: usize,
        /// The joint it names.
        joint: u16,
        /// How many there are.
        joints: usize,
    },
    /// A parameter is out of range.
    #[error("{name} = {value}: {needs}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: Real,
        /// What it has to be.
        needs: &'static str,
    },
}

/// Weights that a grid may have, nodes by joints: they take 2 GB, and smoothing as much again.
const MOST_WEIGHTS: Real = 500e6;
/// Nearer to a vertex than this, in metres, a node takes the weights as if it were so far away. A
/// thousand times less than a cell: ten times more or less changes weights by less than the
/// smoothing does.
const NEAREST: Real = 2e-5;

/// The body's skinning weights, spread into the space round it: at each node the inverse-distance
/// mean of the nearest vertices' weights, then smoothed, read trilinearly. Outside its box, the
/// value at the nearest point of the box.
///
/// # Source
///
/// The lineage of SelfRecon [Jiang et al. 2022]; the numbers are ours.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightGrid {
    min: Point,
    cell: Real,
    nodes: [usize; 3],
    joints: usize,
    /// `joints` numbers for each node, x fastest; each node's sum is 1.
    weights: Vec<f32>,
}

impl WeightGrid {
    /// Spreads the weights of a body's vertices (canonical, metres) over the grid.
    ///
    /// # Errors
    ///
    /// [`WeightGridError`].
    pub fn new(
        points: &[Point],
        skin: &SkinWeights,
        joints: usize,
        params: &WeightGridParams,
    ) -> Result<Self, WeightGridError> {
        let (vertices, weights) = (points.len(), skin.len());
        if vertices == 0 || joints == 0 {
            return Err(WeightGridError::Empty { vertices, joints });
        }
        if vertices != weights {
            return Err(WeightGridError::Count { vertices, weights });
        }
        if let Some((vertex, joint)) = skin.beyond(joints) {
            return Err(WeightGridError::Joint { vertex, joint, joints });
        }
        let parameter = |name, value, needs| Err(WeightGridError::Parameter { name, value, needs });
        if !(params.cell > 0.0 && params.cell.is_finite()) {
            return parameter("cell", params.cell, "a length above zero, in metres");
        }
        if let Some(margin) = params.margin.iter().copied().find(|m| !(m.is_finite() && *m >= 0.0))
        {
            return parameter("margin", margin, "a length of at least zero, in metres");
        }
        if params.neighbours == 0 {
            return parameter("neighbours", 0.0, "at least 1");
        }
        let body = Aabb::from_points(points);
        let min = body.min - params.margin;
        let size = (body.max - body.min) + 2.0 * params.margin;
        let counts = [0, 1, 2].map(|k| (size[k] / params.cell).ceil() + 1.0);
        let fits = counts.iter().product::<Real>() * joints as Real <= MOST_WEIGHTS; // false where points are no numbers
        if !fits {
            return parameter(
                "cell",
                params.cell,
                "longer: the grid would have more than 500 million weights, one for each node and joint",
            );
        }
        let nodes = counts.map(|n| (n as usize).max(2));
        let mut grid = Self { min, cell: params.cell, nodes, joints, weights: Vec::new() };
        grid.weights = grid.gathered(points, skin, params.neighbours);
        for _ in 0..params.rounds {
            grid.weights = grid.smoothed();
        }
        Ok(grid)
    }

    fn gathered(&self, points: &[Point], skin: &SkinWeights, neighbours: usize) -> Vec<f32> {
        let tree = PointTree::new(points);
        let [nx, ny, nz] = self.nodes;
        let mut out = vec![0.0; nx * ny * nz * self.joints];
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

    /// Each node becomes the mean of its neighbours (fewer on the border), renormalised.
    fn smoothed(&self) -> Vec<f32> {
        let [nx, ny, nz] = self.nodes;
        let n = self.joints;
        let mut out = vec![0.0; self.weights.len()];
        out.par_chunks_mut(nx * n).enumerate().for_each(|(row, out)| {
            let (y, z) = (row % ny, row / ny);
            for (x, node) in out.chunks_exact_mut(n).enumerate() {
                let mut add = |x: usize, y: usize, z: usize| {
                    let from = &self.weights[((z * ny + y) * nx + x) * n..][..n];
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

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// The box it covers.
    pub fn bounds(&self) -> Aabb {
        let far = Vector::from(self.nodes.map(|n| (n - 1) as Real)) * self.cell;
        Aabb { min: self.min, max: self.min + far }
    }

    /// The eight nodes about `p`: for each its weight and where its numbers start; and the weight's
    /// slope along x, y, z, in 1/m.
    fn corners(&self, p: &Point) -> [(Real, Vector, usize); 8] {
        let mut low = [0usize; 3];
        let mut part = [0.0; 3];
        let mut slope = [1.0 / self.cell; 3];
        for k in 0..3 {
            let last = (self.nodes[k] - 1) as Real;
            let place = (p[k] - self.min[k]) / self.cell;
            if !(0.0..=last).contains(&place) {
                slope[k] = 0.0; // beyond the box nothing changes
            }
            let place = place.clamp(0.0, last);
            low[k] = (place as usize).min(self.nodes[k] - 2);
            part[k] = place - low[k] as Real;
        }
        let [nx, ny, _] = self.nodes;
        std::array::from_fn(|c| {
            let bit = [c & 1, c >> 1 & 1, c >> 2];
            let w: [Real; 3] =
                std::array::from_fn(|k| if bit[k] == 1 { part[k] } else { 1.0 - part[k] });
            let s: [Real; 3] =
                std::array::from_fn(|k| if bit[k] == 1 { slope[k] } else { -slope[k] });
            let at = ((low[2] + bit[2]) * ny + low[1] + bit[1]) * nx + low[0] + bit[0];
            (
                w[0] * w[1] * w[2],
                Vector::new(s[0] * w[1] * w[2], w[0] * s[1] * w[2], w[0] * w[1] * s[2]),
                at * self.joints,
            )
        })
    }

    /// The weights of all joints at a point of canonical space.
    ///
    /// # Panics
    ///
    /// If `out` has not one place for each joint.
    pub fn weights_at(&self, p: &Point, out: &mut [Real]) {
        assert_eq!(out.len(), self.joints, "one weight for each joint");
        out.fill(0.0);
        for (w, _, at) in self.corners(p) {
            out.iter_mut()
                .zip(&self.weights[at..at + self.joints])
                .for_each(|(o, x)| *o += w * Real::from(*x));
        }
    }

    /// The map of the point `p`: the joints' `transforms` blended with its weights.
    ///
    /// # Panics
    ///
    /// If there is not one transform for each joint.
    pub fn blend(&self, p: &Point, transforms: &[Isometry3<Real>]) -> Affine {
        assert_eq!(transforms.len(), self.joints, "one transform for each joint");
        let mut weights = vec![0.0; self.joints];
        self.weights_at(p, &mut weights);
        let mut sum = Affine::ZERO;
        for (w, t) in weights.iter().zip(transforms) {
            if *w != 0.0 {
                sum.add(*w, t);
            }
        }
        sum
    }

    /// Where `p` goes, and the Jacobian of that.
    ///
    /// ```text
    /// J = Σ wⱼ rotation(Sⱼ) + Σ (Sⱼ x) ∇wⱼᵀ
    /// ```
    ///
    /// # Panics
    ///
    /// If there is not one transform for each joint.
    pub fn pose_with_jacobian(
        &self,
        p: &Point,
        transforms: &[Isometry3<Real>],
    ) -> (Point, Matrix3<Real>) {
        assert_eq!(transforms.len(), self.joints, "one transform for each joint");
        let corners = self.corners(p);
        let (mut place, mut jacobian) = (Vector::zeros(), Matrix3::zeros());
        for (j, transform) in transforms.iter().enumerate() {
            let (mut w, mut slope) = (0.0, Vector::zeros());
            for (share, gradient, at) in &corners {
                let x = Real::from(self.weights[at + j]);
                w += share * x;
                slope += gradient * x;
            }
            if w == 0.0 && slope == Vector::zeros() {
                continue;
            }
            let joint = whole(transform);
            let to = joint.point(p).coords;
            place += to * w;
            jacobian += joint.linear * w + to * slope.transpose();
        }
        (Point::from(place), jacobian)
    }

    /// Where points of canonical space go.
    pub fn pose(&self, points: &[Point], transforms: &[Isometry3<Real>]) -> Vec<Point> {
        points.par_iter().with_min_len(256).map(|p| self.blend(p, transforms).point(p)).collect()
    }

    /// Weights for vertices at `points`: the four largest at each, renormalised.
    pub fn skin(&self, points: &[Point]) -> SkinWeights {
        let four = |p: &Point| {
            let mut all = vec![0.0; self.joints];
            self.weights_at(p, &mut all);
            let mut order: Vec<usize> = (0..self.joints).collect();
            order.sort_by(|a, b| all[*b].total_cmp(&all[*a]).then(a.cmp(b)));
            let (mut joints, mut weights) = ([0u16; 4], [0f32; 4]);
            let sum: Real = order.iter().take(4).map(|j| all[*j]).sum();
            for (slot, j) in order.iter().take(4).enumerate() {
                (joints[slot], weights[slot]) = (*j as u16, (all[*j] / sum) as f32);
            }
            (joints, weights)
        };
        let (joints, weights) = points.par_iter().with_min_len(256).map(four).unzip();
        SkinWeights::new(joints, weights, self.joints)
            .expect("the four largest weights are positive, and were divided by their sum")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skinning::inverse::tests::{elbow, elbow_body};

    #[test]
    fn weights_are_shares_and_far_from_a_joint_they_are_its_own() {
        let (points, skin) = elbow_body();
        let grid = WeightGrid::new(
            &points,
            &skin,
            2,
            &WeightGridParams { cell: 0.04, ..Default::default() },
        )
        .unwrap();
        let mut w = [0.0; 2];
        for p in
            [Point::new(-0.35, 0.0, 0.0), Point::new(-9.0, 0.1, 0.0), Point::new(-0.4, 0.2, -0.2)]
        {
            grid.weights_at(&p, &mut w);
            assert!((w[0] + w[1] - 1.0).abs() < 1e-6 && w[0] > 0.9, "{p}: {w:?}");
        }
        grid.weights_at(&Point::origin(), &mut w);
        assert!((w[0] - 0.5).abs() < 0.03, "{w:?}"); // the body is the same on both sides, but for the lattice
        let skinned = grid.skin(&[Point::new(-0.35, 0.0, 0.0)]);
        assert_eq!(skinned.joints()[0][0], 0);
    }

    #[test]
    fn the_jacobian_is_the_slope_of_the_map() {
        let (points, skin) = elbow_body();
        let grid = WeightGrid::new(
            &points,
            &skin,
            2,
            &WeightGridParams { cell: 0.04, ..Default::default() },
        )
        .unwrap();
        let transforms = elbow(1.1);
        // Off the planes of the lattice, where the slope jumps; and beyond the box.
        for p in [
            Point::new(0.013, 0.021, -0.017),
            Point::new(-0.21, -0.07, 0.05),
            Point::new(0.013, 3.0, 0.022),
        ] {
            let (place, jacobian) = grid.pose_with_jacobian(&p, &transforms);
            approx::assert_relative_eq!(
                place,
                grid.blend(&p, &transforms).point(&p),
                epsilon = 1e-12
            );
            let h = 1e-6;
            for k in 0..3 {
                let mut step = Vector::zeros();
                step[k] = h;
                let to = |q: Point| grid.blend(&q, &transforms).point(&q);
                let slope = (to(p + step) - to(p - step)) / (2.0 * h);
                approx::assert_relative_eq!(slope, jacobian.column(k).into_owned(), epsilon = 1e-7);
            }
        }
    }

    #[test]
    fn what_makes_no_grid_is_named() {
        let (points, skin) = elbow_body();
        let new =
            |p: &[Point], joints, params| WeightGrid::new(p, &skin, joints, &params).unwrap_err();
        let fine = WeightGridParams::default();
        assert!(matches!(new(&[], 2, fine), WeightGridError::Empty { vertices: 0, .. }));
        assert!(matches!(new(&points[1..], 2, fine), WeightGridError::Count { .. }));
        assert!(matches!(new(&points, 1, fine), WeightGridError::Joint { joint: 1, .. }));
        for cell in [0.0, -1.0, Real::NAN, 1e-4] {
            let error = new(&points, 2, WeightGridParams { cell, ..fine });
            assert!(matches!(error, WeightGridError::Parameter { name: "cell", .. }), "{error}");
        }
        let error = new(&points, 2, WeightGridParams { neighbours: 0, ..fine });
        assert!(matches!(error, WeightGridError::Parameter { name: "neighbours", .. }));
    }
}
