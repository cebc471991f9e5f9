//! Where the surface crosses the edges of the lattice.

use crate::marching::bricks::{Bricks, Lattice, STEP};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use rayon::prelude::*;

/// The lattice edges that the surface crosses, and so the vertices of the mesh.
pub(super) struct Crossings {
    /// For each node the axes (bits) along which the edge upwards is crossed.
    axes: Vec<u8>,
    /// For each node the vertices on edges of nodes before it.
    first: Vec<u32>,
    /// For each vertex its node, the node at the other end, both by position in [`Bricks::nodes`].
    ends: Vec<[u32; 2]>,
}

impl Crossings {
    /// Finds them in all bricks.
    pub(super) fn new(bricks: &Bricks) -> Self {
        let (nodes, values) = (&bricks.nodes, &bricks.values);
        let mut this = Self { axes: vec![0; nodes.len()], first: vec![0; nodes.len()], ends: Vec::new() };
        let mut upper = [0; 3];
        for n in 0..nodes.len() {
            this.first[n] = this.ends.len() as u32;
            for axis in 0..3 {
                let u = &mut upper[axis];
                while *u < nodes.len() && nodes[*u] < nodes[n] + STEP[axis] {
                    *u += 1;
                }
                if nodes.get(*u) == Some(&(nodes[n] + STEP[axis])) && (values[n] < 0.0) != (values[*u] < 0.0) {
                    this.axes[n] |= 1 << axis;
                    this.ends.push([n as u32, *u as u32]);
                }
            }
        }
        this
    }

    /// The vertex on the edge that goes up along `axis` from node `n`.
    pub(super) fn vertex(&self, n: u32, axis: u8) -> u32 {
        self.first[n as usize] + (self.axes[n as usize] & ((1 << axis) - 1)).count_ones()
    }

    /// The vertices' places: linear along the edge, a secant step, then `newton` steps along the gradient.
    pub(super) fn vertices<F: SignedDistance + ?Sized>(
        &self,
        field: &F,
        lattice: &Lattice,
        bricks: &Bricks,
        newton: usize,
        evaluations: &mut usize,
    ) -> Vec<Point> {
        let nodes: Vec<[Point; 2]> = self.ends.par_iter().map(|e| e.map(|n| lattice.node(bricks.nodes[n as usize]))).collect();
        let at = |e: &[Point; 2], t: Real| e[0] + (e[1] - e[0]) * t;
        let mut t: Vec<Real> =
            self.ends.par_iter().map(|e| crossing(bricks.values[e[0] as usize], bricks.values[e[1] as usize])).collect();
        let mut points: Vec<Point> = nodes.par_iter().zip(&t).map(|(e, t)| at(e, *t)).collect();
        // One secant step along the edge: it stays between the ends, and so folds nothing.
        let mut values = vec![0.0; points.len()];
        field.distances(&points, &mut values);
        for (v, e) in self.ends.iter().enumerate() {
            let ends = e.map(|n| bricks.values[n as usize]);
            let (low, high) = if (values[v] < 0.0) == (ends[0] < 0.0) {
                ((t[v], values[v]), (1.0, ends[1]))
            } else {
                ((0.0, ends[0]), (t[v], values[v]))
            };
            if !values[v].is_nan() {
                t[v] = (low.0 + (high.0 - low.0) * linear(low.1, high.1)).clamp(MARGIN, 1.0 - MARGIN);
            }
            points[v] = at(&nodes[v], t[v]);
        }
        *evaluations += points.len() * (1 + newton);
        let mut samples =
            vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; if newton > 0 { points.len() } else { 0 }];
        for _ in 0..newton {
            field.samples(&points, &mut samples);
            points.par_iter_mut().zip(&samples).for_each(|(p, s)| *p -= newton_step(s, 0.5 * lattice.cell));
        }
        points
    }
}

/// Vertices keep this part of a cell from the nodes of the lattice, so that triangles round a node that
/// lies on the surface keep an area. At ten times more, vertices lie off a surface that Newton does not reach by
/// a tenth of a cell; at ten times less, a cell of 1 cm has edges of 10 µm, which single precision keeps to 1 %.
const MARGIN: Real = 0.01;

/// Where the linear function with values `a` at 0 and `b` at 1 vanishes; 0.5 where it has no such place.
fn linear(a: Real, b: Real) -> Real {
    let t = a / (a - b);
    if t.is_finite() { t } else { 0.5 }
}

fn crossing(a: Real, b: Real) -> Real {
    linear(a, b).clamp(MARGIN, 1.0 - MARGIN)
}

/// The step φ ∇φ / |∇φ|² to the surface, at most `limit` long. Zero where the gradient is too small to
/// tell a direction.
pub(super) fn newton_step(s: &FieldSample, limit: Real) -> Vector {
    /// A distance has a gradient of length 1; below a tenth the linear model of the field means nothing.
    const FLAT: Real = 0.1;
    let g2 = s.gradient.norm_squared();
    if !(s.distance.is_finite() && g2 >= FLAT * FLAT && g2.is_finite()) {
        return Vector::zeros();
    }
    let step = s.gradient * (s.distance / g2);
    let length = step.norm();
    if length > limit { step * (limit / length) } else { step }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_its_zero_and_a_pair_without_one_the_middle() {
        assert_eq!(linear(-1.0, 3.0), 0.25);
        for (a, b) in [(0.0, 0.0), (-1.0, Real::INFINITY), (Real::NEG_INFINITY, Real::INFINITY)] {
            assert!((0.0..=0.5).contains(&crossing(a, b)), "{a} {b}");
        }
        assert_eq!((crossing(-1.0, 0.0), crossing(0.0, -1.0)), (1.0 - MARGIN, MARGIN));
    }

    #[test]
    fn a_newton_step_is_bounded_and_needs_a_slope() {
        let step = |distance, slope| newton_step(&FieldSample { distance, gradient: Vector::new(0.0, slope, 0.0) }, 0.5);
        assert_eq!(step(0.25, 2.0).y, 0.125);
        assert_eq!(step(-9.0, 1.0).y, -0.5);
        for (distance, slope) in [(1.0, 0.01), (Real::INFINITY, 1.0), (1.0, Real::NAN), (Real::NAN, 1.0)] {
            assert_eq!(step(distance, slope), Vector::zeros());
        }
    }
}
