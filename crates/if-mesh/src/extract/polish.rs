//! Vertices: from the linear guess on an edge onto the surface.

use crate::extract::budget::Budget;
use crate::extract::lattice::Lattice;
use crate::extract::surface::Edge;
use crate::marching::newton_step;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Cancelled;
use rayon::prelude::*;

/// Vertices keep this part of a cell from the nodes of the lattice, so that triangles round a node
/// that lies on the surface keep an area. At ten times more, vertices lie off a surface that Newton
/// does not reach by a tenth of a cell; at ten times less, a cell of 1 cm has edges of 10 µm, which
/// single precision keeps to 1 %.
pub(super) const MARGIN: Real = 0.01;

/// A Newton step is at most this part of a cell long: a vertex stays nearer to its edge than to the
/// next one.
const STEP: Real = 0.5;

/// Vertices, and the field at the positions from which the last Newton step started.
pub(super) struct Polished {
    pub(super) points: Vec<Point>,
    /// One for each vertex after a Newton step; empty without one.
    pub(super) samples: Vec<FieldSample>,
}

/// The zero on an edge of the linear function with the values at its ends.
pub(super) fn guess(lattice: &Lattice, edge: &Edge) -> Point {
    on_edge(lattice, edge, crossing(edge.values[0], edge.values[1]))
}

/// The place on an edge at the part `t` of its length.
pub(super) fn on_edge(lattice: &Lattice, edge: &Edge, t: Real) -> Point {
    let mut p = lattice.node(edge.node);
    p[usize::from(edge.axis)] += t * lattice.cell;
    p
}

/// Linear along the edge, one secant step along the edge (one evaluation), then `newton` steps
/// along the gradient (one sample each).
///
/// The secant step stays between the ends and on the side where the sign changes, so that it causes
/// no folds. It corrects the kink between two near sheets, where the gradient jumps and Newton's step
/// alone would diverge.
pub(super) fn polish(
    field: &dyn SignedDistance,
    lattice: &Lattice,
    edges: &[Edge],
    secant: bool,
    newton: usize,
    budget: &mut Budget,
) -> Result<Polished, Cancelled> {
    let mut points: Vec<Point> = edges.par_iter().map(|e| guess(lattice, e)).collect();
    if secant && !edges.is_empty() {
        let mut values = vec![0.0; points.len()];
        field.distances(&points, &mut values);
        points.par_iter_mut().zip(edges).zip(&values).for_each(|((p, edge), value)| {
            let t = crossing(edge.values[0], edge.values[1]);
            *p = on_edge(lattice, edge, secant_step(edge.values, t, *value));
        });
        budget.evaluated("polish", points.len())?;
    }
    let none = FieldSample { distance: 0.0, gradient: Vector::zeros() };
    let mut samples = vec![none; if newton > 0 { points.len() } else { 0 }];
    for _ in 0..if edges.is_empty() { 0 } else { newton } {
        field.samples(&points, &mut samples);
        points
            .par_iter_mut()
            .zip(&samples)
            .for_each(|(p, s)| *p -= newton_step(s, STEP * lattice.cell));
        budget.evaluated("polish", points.len())?;
    }
    Ok(Polished { points, samples })
}

/// The zero of the line between the value at `t` and the end of the other sign; `t` if the value is
/// NaN.
fn secant_step(ends: [Real; 2], t: Real, value: Real) -> Real {
    if value.is_nan() {
        return t;
    }
    let ends = if (value < 0.0) == (ends[0] < 0.0) {
        [(t, value), (1.0, ends[1])]
    } else {
        [(0.0, ends[0]), (t, value)]
    };
    secant(&ends).clamp(MARGIN, 1.0 - MARGIN)
}

/// The zero of the line between two places and their values.
pub(super) fn secant(&[low, high]: &[(Real, Real); 2]) -> Real {
    low.0 + (high.0 - low.0) * linear(low.1, high.1)
}

/// The zero of the linear function with values `a` at 0 and `b` at 1; 0.5 if it has none.
fn linear(a: Real, b: Real) -> Real {
    let t = a / (a - b);
    if t.is_finite() { t } else { 0.5 }
}

fn crossing(a: Real, b: Real) -> Real {
    linear(a, b).clamp(MARGIN, 1.0 - MARGIN)
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
    fn a_secant_step_stays_on_the_side_of_the_sign_change() {
        // −1 at 0, 1 at 1, and −0.5 in the middle: the zero is above it.
        approx::assert_relative_eq!(secant_step([-1.0, 1.0], 0.5, -0.5), 0.5 + 0.5 / 3.0);
        approx::assert_relative_eq!(secant_step([-1.0, 1.0], 0.5, 0.5), 1.0 / 3.0);
        assert_eq!(secant_step([-1.0, 1.0], 0.5, 0.0), 0.5);
        assert_eq!(secant_step([-1.0, 1.0], 0.5, Real::NAN), 0.5);
    }
}
