//! No two triangles meet: where those of near sheets would, vertices go back to their edges of the lattice.

use crate::extract::budget::Budget;
use crate::extract::lattice::Lattice;
use crate::extract::polish::{on_edge, secant};
use crate::extract::surface::Edge;
use crate::index::Bvh;
use crate::intersections::own_pairs;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use std::collections::BTreeSet;

/// Evaluations of the field for a vertex that goes back to its edge, every second one in the middle of what is
/// left of it: one of 1 cm is known to 10 nm.
const EVALUATIONS: usize = 40;

/// Such vertices keep this part of a cell from the nodes of the lattice.
const MARGIN: Real = 1e-6;

/// `mesh`, with vertices of triangles that meet moved back to their place in `earlier` (if not empty), and then
/// to where the surface crosses their edge, until no triangles meet; returns how many vertices were. Where all
/// lie on their edges triangles lie in their cells, and those of one cell do not meet (`cases.rs`).
/// Terminates, as a vertex goes back twice at most.
pub(super) fn apart(
    mut mesh: TriMesh,
    earlier: &[Point],
    (lattice, edges): (&Lattice, &[Edge]),
    field: &dyn SignedDistance,
    budget: &mut Budget,
) -> Result<(TriMesh, usize), Cancelled> {
    let places = 1 + usize::from(!earlier.is_empty());
    let mut left = vec![places; mesh.vertices().len()];
    loop {
        let found = own_pairs(&mesh, &Bvh::new(&mesh));
        let corners = found.iter().flat_map(|p| [p.a, p.b].map(|t| mesh.triangles()[t as usize]));
        let meeting: BTreeSet<usize> =
            corners.flatten().map(|v| v as usize).filter(|v| left[*v] > 0).collect();
        if meeting.is_empty() {
            return Ok((mesh, left.iter().filter(|left| **left < places).count()));
        }
        let mut vertices = mesh.vertices().to_vec();
        meeting.iter().for_each(|v| left[*v] -= 1);
        let (to_edges, to_earlier): (Vec<usize>, Vec<usize>) =
            meeting.into_iter().partition(|v| left[*v] == 0);
        to_earlier.iter().for_each(|v| vertices[*v] = earlier[*v]);
        let crossings = crossings(lattice, edges, &to_edges, field, budget)?;
        to_edges.iter().zip(crossings).for_each(|(v, p)| vertices[*v] = p);
        mesh = mesh.with_vertices(vertices).expect("positions of meshes, or on edges");
    }
}

/// Where the surface crosses the edges of these vertices.
fn crossings(
    lattice: &Lattice,
    edges: &[Edge],
    vertices: &[usize],
    field: &dyn SignedDistance,
    budget: &mut Budget,
) -> Result<Vec<Point>, Cancelled> {
    // Ends with values of both signs, along the edge.
    let mut ends: Vec<[(Real, Real); 2]> =
        vertices.iter().map(|v| [(0.0, edges[*v].values[0]), (1.0, edges[*v].values[1])]).collect();
    let place =
        |(v, t): (&usize, Real)| on_edge(lattice, &edges[*v], t.clamp(MARGIN, 1.0 - MARGIN));
    let mut values = vec![0.0; vertices.len()];
    for round in 0..if vertices.is_empty() { 0 } else { EVALUATIONS } {
        let at = |ends: &[(Real, Real); 2]| match round % 2 {
            0 => secant(ends),
            _ => 0.5 * (ends[0].0 + ends[1].0),
        };
        let tried: Vec<Real> = ends.iter().map(at).collect();
        let points: Vec<Point> = vertices.iter().zip(tried.iter().copied()).map(place).collect();
        field.distances(&points, &mut values);
        budget.evaluated("apart", points.len())?;
        for ((ends, t), value) in ends.iter_mut().zip(&tried).zip(&values) {
            let end = usize::from((*value < 0.0) != (ends[0].1 < 0.0));
            if !value.is_nan() {
                ends[end] = (*t, *value);
            }
        }
    }
    Ok(vertices.iter().zip(ends.iter().map(secant)).map(place).collect())
}
