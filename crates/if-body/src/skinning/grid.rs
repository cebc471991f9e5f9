//! Skinning weights at all points of canonical space.

mod spread;

use super::Affine;
use crate::skin_weights::{SkinError, SkinWeights};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;
use if_mesh::grid::GridSize;
use nalgebra::Isometry3;
use rayon::prelude::*;

/// Parameters of [`WeightGrid::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightGridParams {
    /// Distance between neighbouring nodes, in metres.
    pub cell: Real,
    /// Margin around the body's bounding box along each axis, in metres.
    pub margin: Vector,
    /// Number of nearest vertices whose weights are averaged at a node.
    pub neighbours: usize,
    /// Rounds of smoothing over the six neighbours.
    pub rounds: usize,
}

impl Default for WeightGridParams {
    /// The margins, neighbours and rounds of SelfRecon; nodes 2 cm apart.
    fn default() -> Self {
        Self { cell: 0.02, margin: Vector::new(0.15, 0.15, 0.20), neighbours: 30, rounds: 30 }
    }
}

impl WeightGridParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        check("cell", self.cell, self.cell > 0.0 && self.cell.is_finite(), "positive (m)")?;
        for margin in self.margin.iter().copied() {
            check("margin", margin, margin.is_finite() && margin >= 0.0, "zero or positive (m)")?;
        }
        let (near, rounds) = (self.neighbours, self.rounds);
        check("neighbours", near as Real, (1..=1000).contains(&near), "from 1 to 1,000")?;
        check("rounds", rounds as Real, rounds <= 1000, "at most 1,000")
    }
}

/// Largest number of weights, nodes times joints: 2 GB, and smoothing needs as much again.
const MOST_WEIGHTS: Real = 500e6;
/// A body's skinning weights, extended into the space around it.
///
/// A node holds the inverse-distance mean of the nearest vertices' weights, smoothed over its
/// neighbours. Between nodes weights are trilinear; outside the box they are those at the nearest
/// point of the box.
///
/// # Source
///
/// SelfRecon [Jiang et al. 2022] and its predecessors; the numbers are ours.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightGrid {
    min: Point,
    cell: Real,
    nodes: GridSize,
    joints: usize,
    /// `joints` numbers for each node, x fastest; each node's sum is 1.
    weights: Vec<f32>,
}

impl WeightGrid {
    /// Extends the weights of a body's vertices (canonical space, metres).
    ///
    /// # Errors
    ///
    /// [`SkinError`]: no vertices or joints, weights of another mesh or skeleton, or parameters out
    /// of range.
    pub fn new(
        points: &[Point],
        skin: &SkinWeights,
        joints: usize,
        params: &WeightGridParams,
    ) -> Result<Self, SkinError> {
        let vertices = points.len();
        if vertices == 0 || joints == 0 {
            return Err(SkinError::Empty { vertices, joints });
        }
        skin.check(vertices, joints)?;
        params.validate()?;
        let body = Aabb::from_points(points);
        let min = body.min - params.margin;
        let size = (body.max - body.min) + 2.0 * params.margin;
        let counts = [0, 1, 2].map(|k| (size[k] / params.cell).ceil() + 1.0);
        // False for positions that are not finite, too.
        let fits = counts.iter().product::<Real>() * joints as Real <= MOST_WEIGHTS;
        let range = "larger: the grid would have more than 500 million weights, one for each node and joint";
        ParameterError::check("cell", params.cell, fits, range)?;
        let nodes = GridSize(counts.map(|n| (n as usize).max(2)));
        let mut grid = Self { min, cell: params.cell, nodes, joints, weights: Vec::new() };
        grid.weights = grid.gathered(points, skin, params.neighbours);
        for _ in 0..params.rounds {
            grid.weights = grid.smoothed();
        }
        Ok(grid)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Its bounding box.
    pub fn bounds(&self) -> Aabb {
        let far = Vector::from(self.nodes.0.map(|n| (n - 1) as Real)) * self.cell;
        Aabb { min: self.min, max: self.min + far }
    }

    /// The eight nodes around `p`: for each its trilinear weight, and the index of its first number.
    fn corners(&self, p: &Point) -> [(Real, usize); 8] {
        let place = [0, 1, 2].map(|k| (p[k] - self.min[k]) / self.cell);
        let (low, part) = self.nodes.cell_at(place);
        std::array::from_fn(|c| {
            let bit = [c & 1, c >> 1 & 1, c >> 2];
            let w: [Real; 3] =
                std::array::from_fn(|k| if bit[k] == 1 { part[k] } else { 1.0 - part[k] });
            let at = self.nodes.index([0, 1, 2].map(|k| low[k] + bit[k]));
            (w[0] * w[1] * w[2], at * self.joints)
        })
    }

    /// The weights of all joints at a point of canonical space.
    ///
    /// # Panics
    ///
    /// If `out` does not have one element for each joint.
    pub fn weights_at(&self, p: &Point, out: &mut [Real]) {
        assert_eq!(out.len(), self.joints, "one weight for each joint");
        out.fill(0.0);
        for (w, at) in self.corners(p) {
            out.iter_mut()
                .zip(&self.weights[at..at + self.joints])
                .for_each(|(o, x)| *o += w * Real::from(*x));
        }
    }

    /// The map at the point `p`: the joints' `transforms`, blended by the weights there.
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

    /// The posed points of points in canonical space.
    pub fn pose(&self, points: &[Point], transforms: &[Isometry3<Real>]) -> Vec<Point> {
        points.par_iter().with_min_len(256).map(|p| self.blend(p, transforms).point(p)).collect()
    }

    /// Weights for vertices at `points`: the four largest at each, normalised.
    ///
    /// # Panics
    ///
    /// If a coordinate is NaN.
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
        SkinWeights::new(joints, weights, self.joints).expect(
            "points are no NaN: the four largest weights are positive and divided by their sum",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skinning::elbow::elbow_body;

    #[test]
    fn weights_sum_to_one_and_near_a_bone_they_are_its_own() {
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
        // The body is symmetric, the lattice is not.
        assert!((w[0] - 0.5).abs() < 0.03, "{w:?}");
        let skinned = grid.skin(&[Point::new(-0.35, 0.0, 0.0)]);
        assert_eq!(skinned.joints()[0][0], 0);
    }

    #[test]
    fn invalid_input_is_an_error() {
        let (points, skin) = elbow_body();
        let new =
            |p: &[Point], joints, params| WeightGrid::new(p, &skin, joints, &params).unwrap_err();
        let fine = WeightGridParams::default();
        assert!(matches!(new(&[], 2, fine), SkinError::Empty { vertices: 0, .. }));
        assert!(matches!(new(&points[1..], 2, fine), SkinError::Count { .. }));
        assert!(matches!(new(&points, 1, fine), SkinError::Joint { joint: 1, .. }));
        for cell in [0.0, -1.0, Real::NAN, 1e-4] {
            let error = new(&points, 2, WeightGridParams { cell, ..fine });
            assert!(matches!(&error, SkinError::Parameter(e) if e.name == "cell"), "{error}");
        }
        for neighbours in [0, 1001, usize::MAX] {
            let error = new(&points, 2, WeightGridParams { neighbours, ..fine });
            assert!(matches!(error, SkinError::Parameter(e) if e.name == "neighbours"));
        }
        let error = new(&points, 2, WeightGridParams { rounds: usize::MAX, ..fine });
        assert!(matches!(error, SkinError::Parameter(e) if e.name == "rounds"));
    }
}
