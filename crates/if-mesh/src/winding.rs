//! Generalised winding numbers: inside or outside for meshes that are open or self-intersecting.

use crate::index::{Branch, Bvh};
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Winding numbers of points with respect to a mesh.
///
/// ```text
/// w(q) = 1 / 4π · Σ solid angle of triangle t seen from q
/// ```
///
/// 1 inside a closed surface, 0 outside, and in between near the openings of an open one, where ½
/// is the natural threshold. Far groups of triangles are evaluated as one dipole and its first two
/// moments.
///
/// # Source
///
/// Jacobson, Kavan and Sorkine-Hornung 2013; the tree of Barill et al. 2018, *Fast winding numbers
/// for soups and clouds*, with moments of the second order. Solid angles by van Oosterom and
/// Strackee 1983.
///
/// # Accuracy
///
/// Within 0.005 of the sum over all triangles with the default `beta`, on surfaces with one and
/// with two sheets.
///
/// # Examples
///
/// ```
/// use if_core::{math::Point, shapes::meshes};
/// let ball = if_mesh::winding::Winding::new(&meshes::icosphere(1.0, 3));
/// assert!((ball.at(&Point::new(0.1, 0.2, 0.3)) - 1.0).abs() < 0.01);
/// assert!(ball.at(&Point::new(2.0, 0.0, 0.0)).abs() < 0.01);
/// ```
#[derive(Clone, Debug)]
pub struct Winding {
    tree: Bvh,
    /// One for each node of the tree.
    moments: Vec<Moments>,
    /// A group is evaluated as one if it is farther away than this many of its radii.
    beta: Real,
}

/// Multipole moments of a group of triangles.
#[derive(Clone, Copy, Debug)]
struct Moments {
    /// Middle, weighted by area.
    center: Point,
    area: Real,
    /// All triangles lie within this distance of the middle.
    radius: Real,
    /// Sum of area vectors.
    dipole: Vector,
    /// Sum of offsets from the middle times area vectors: row i, column k is ∫ xᵢ nₖ.
    first: Matrix3<Real>,
    /// For each axis k the matrix ∫ x xᵀ nₖ.
    second: [Matrix3<Real>; 3],
}

/// Distance in radii below which groups are opened by default. At twice as much the error is some
/// twenty times smaller.
const BETA: Real = 2.0;

impl Winding {
    /// Prepares a mesh, in O(n log n).
    pub fn new(mesh: &TriMesh) -> Self {
        Self::prepared(mesh, BETA)
    }

    /// The same with another ratio of distance to radius from which on groups are evaluated as one:
    /// larger is slower and more exact; infinity sums over all triangles.
    fn prepared(mesh: &TriMesh, beta: Real) -> Self {
        let tree = Bvh::new(mesh);
        let none = Moments {
            center: Point::origin(),
            area: 0.0,
            radius: 0.0,
            dipole: Vector::zeros(),
            first: Matrix3::zeros(),
            second: [Matrix3::zeros(); 3],
        };
        let mut moments = vec![none; tree.node_count()];
        // Children follow their parents, so that they are computed first.
        for n in (0..moments.len()).rev() {
            moments[n] = match tree.branch(n as u32) {
                Branch::Leaf(corners) => Moments::of(corners),
                Branch::Inner(left, right) => moments[left as usize].with(&moments[right as usize]),
            };
        }
        Self { tree, moments, beta }
    }

    /// The winding number of `p`. 0 for an empty mesh; on the surface it lies between those of its
    /// sides.
    pub fn at(&self, p: &Point) -> Real {
        let mut sum = 0.0;
        let mut stack = vec![0u32];
        if self.moments.is_empty() {
            return 0.0;
        }
        while let Some(n) = stack.pop() {
            let m = &self.moments[n as usize];
            let r = m.center - p;
            let limit = self.beta * m.radius;
            if r.norm_squared() > limit * limit {
                sum += m.seen(&r);
                continue;
            }
            match self.tree.branch(n) {
                Branch::Inner(left, right) => stack.extend([right, left]),
                Branch::Leaf(corners) => {
                    sum += corners.iter().map(|c| solid_angle(p, c)).sum::<Real>()
                }
            }
        }
        sum / (4.0 * PI)
    }

    /// The winding numbers of many points.
    pub fn of(&self, points: &[Point]) -> Vec<Real> {
        points.par_iter().map(|p| self.at(p)).collect()
    }
}

impl Moments {
    fn of(corners: &[[Point; 3]]) -> Self {
        let (mut area, mut sum, mut dipole) = (0.0, Vector::zeros(), Vector::zeros());
        let parts = corners.iter().map(|[a, b, c]| {
            let vector = area_vector(a, b, c) * 0.5;
            (vector, vector.norm(), (a.coords + b.coords + c.coords) / 3.0)
        });
        for (vector, weight, middle) in parts.clone() {
            area += weight;
            sum += middle * weight;
            dipole += vector;
        }
        // Without area all triangles count alike: they only matter for the radius.
        let center = if area > 0.0 {
            sum / area
        } else {
            parts.clone().map(|p| p.2).sum::<Vector>() / corners.len().max(1) as Real
        };
        let mut first = Matrix3::zeros();
        let mut second = [Matrix3::zeros(); 3];
        for ((vector, _, middle), triangle) in parts.zip(corners) {
            let offset = middle - center;
            first += offset * vector.transpose();
            // The second moment of a triangle about its middle is that of its corners over twelve.
            let spread: Matrix3<Real> = triangle
                .iter()
                .map(|p| (p.coords - middle) * (p.coords - middle).transpose())
                .sum();
            let about = offset * offset.transpose() + spread / 12.0;
            (0..3).for_each(|k| second[k] += about * vector[k]);
        }
        let center = Point::from(center);
        let radius = corners.iter().flatten().map(|p| (p - center).norm()).fold(0.0, Real::max);
        Self { center, area, radius, dipole, first, second }
    }

    fn with(&self, other: &Self) -> Self {
        let area = self.area + other.area;
        let t = if area > 0.0 { other.area / area } else { 0.5 };
        let center = self.center + (other.center - self.center) * t;
        let [a, b] = [self, other].map(|m| m.about(&center));
        let reach = |m: &Self| (m.center - center).norm() + m.radius;
        Self {
            center,
            area,
            radius: reach(self).max(reach(other)),
            dipole: self.dipole + other.dipole,
            first: a.0 + b.0,
            second: [0, 1, 2].map(|k| a.1[k] + b.1[k]),
        }
    }

    /// The first and second moments about another middle.
    fn about(&self, center: &Point) -> (Matrix3<Real>, [Matrix3<Real>; 3]) {
        let d = self.center - center;
        let second = [0, 1, 2].map(|k| {
            let mixed = d * self.first.column(k).transpose();
            self.second[k] + mixed + mixed.transpose() + d * d.transpose() * self.dipole[k]
        });
        (self.first + d * self.dipole.transpose(), second)
    }

    /// The solid angle from a place at −`r` from the middle: Taylor's series of Σ n · (r + x) / |r
    /// + x|³ in the offsets x, to the second order.
    fn seen(&self, r: &Vector) -> Real {
        let r2 = r.norm_squared();
        let zeroth = self.dipole.dot(r);
        let first = self.first.trace() - 3.0 * r.dot(&(self.first * r)) / r2;
        let (mut traces, mut mixed, mut cubic) = (0.0, 0.0, 0.0);
        for (k, m) in self.second.iter().enumerate() {
            traces += m.trace() * r[k];
            mixed += m.row(k).transpose().dot(r);
            cubic += r.dot(&(m * r)) * r[k];
        }
        let second = (7.5 * cubic / r2 - 1.5 * (traces + 2.0 * mixed)) / r2;
        (zeroth + first + second) / (r2 * r2.sqrt())
    }
}

/// The solid angle of a triangle seen from `p`: positive from behind. 0 where `p` lies on it.
fn solid_angle(p: &Point, corners: &[Point; 3]) -> Real {
    let [a, b, c] = corners.map(|q| q - p);
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let volume = a.dot(&b.cross(&c));
    let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    if volume == 0.0 { 0.0 } else { 2.0 * volume.atan2(below) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marching::clip;
    use if_core::shapes::meshes;

    fn random_points(n: usize, scale: Real) -> Vec<Point> {
        let mut random = if_core::random::SplitMix64::new(5);
        (0..n).map(|_| Point::from([0; 3].map(|_| (2.0 * random.unit() - 1.0) * scale))).collect()
    }

    #[test]
    fn a_closed_ball_has_one_inside_and_zero_outside() {
        let ball = meshes::icosphere(1.0, 4);
        let (fast, exact) = (Winding::new(&ball), Winding::prepared(&ball, Real::INFINITY));
        for p in random_points(300, 1.6) {
            let distance = p.coords.norm();
            let w = exact.at(&p);
            if (distance - 1.0).abs() > 0.01 {
                approx::assert_relative_eq!(
                    w,
                    if distance < 1.0 { 1.0 } else { 0.0 },
                    epsilon = 1e-12
                );
            }
            assert!((fast.at(&p) - w).abs() < 0.005, "{p}: {} for {w}", fast.at(&p));
        }
    }

    #[test]
    fn an_open_bowl_has_its_solid_angle_and_two_sheets_add_up() {
        let ball = meshes::icosphere(1.0, 4);
        let heights: Vec<Real> = ball.vertices().iter().map(|p| p.y).collect();
        let bowl = clip(&ball, &heights);
        let exact = Winding::prepared(&bowl, Real::INFINITY);
        // Seen from the middle a half sphere fills half of all directions. Cuts keep a hundredth of
        // an edge from vertices.
        approx::assert_relative_eq!(exact.at(&Point::origin()), 0.5, epsilon = 1e-3);
        let fast = Winding::new(&bowl);
        for p in random_points(300, 1.5) {
            assert!((fast.at(&p) - exact.at(&p)).abs() < 0.005, "{p}");
        }
        let inner = meshes::icosphere(0.5, 3);
        let n = ball.vertices().len() as u32;
        let vertices = [ball.vertices(), inner.vertices()].concat();
        let triangles = ball
            .triangles()
            .iter()
            .copied()
            .chain(inner.triangles().iter().map(|t| t.map(|v| v + n)))
            .collect();
        let both = Winding::new(&TriMesh::new(vertices, triangles).unwrap());
        for (x, w) in [(0.1, 2.0), (0.7, 1.0), (1.3, 0.0)] {
            approx::assert_relative_eq!(both.at(&Point::new(x, 0.01, 0.02)), w, epsilon = 0.005);
        }
    }

    #[test]
    fn degenerate_input_is_finite() {
        let point = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        for mesh in [TriMesh::default(), point, meshes::cloth(1.0, 1.0, 2, 2)] {
            let winding = Winding::new(&mesh);
            for p in [
                Point::origin(),
                Point::new(0.25, 0.0, 0.25),
                Point::new(1e-300, 0.0, 0.0),
                Point::new(1e9, 0.0, 0.0),
            ] {
                assert!(winding.at(&p).abs() <= 0.5 + 1e-12, "{p}: {}", winding.at(&p));
            }
        }
    }
}
