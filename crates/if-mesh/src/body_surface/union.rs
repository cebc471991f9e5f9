//! Where a body intersects itself: which triangles lie inside, and where pseudo-normals err.

use crate::index::Bvh;
use crate::intersections::own_pairs;
use crate::winding::Winding;
use if_core::aabb::Aabb;
use if_core::edges::{Edges, NONE, parts_by_edges};
use if_core::math::{Point, Real, area_vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// What is hidden, and what is not sure.
pub(super) struct Union {
    /// For each triangle whether both of its sides are inside.
    pub(super) hidden: Vec<bool>,
    /// For each triangle of the skin whether the pseudo-normals there may err.
    pub(super) unsure: Vec<bool>,
    pub(super) own_pairs: usize,
}

/// Winding number from which on a point is inside.
pub(super) const INSIDE: Real = 0.5;
/// Distance from a triangle at which its sides are evaluated, as a share of the longest side of the
/// body: 2 µm for a person.
const BESIDE: Real = 1e-6;

impl Union {
    /// Of a closed surface, `skin` of whose triangles come first, then the caps of openings.
    /// `boxes` are those of its parts. `None` if no part can lie in another one, and none
    /// intersects itself.
    pub(super) fn new(
        closed: &TriMesh,
        skin: &TriMesh,
        edges: &Edges,
        winding: &Winding,
        boxes: &[Aabb],
    ) -> Option<Self> {
        let pairs = own_pairs(closed, &Bvh::new(closed));
        let mut unsure = irregular(skin, edges);
        let overlap = |k: usize| boxes[..k].iter().any(|other| other.overlaps(&boxes[k]));
        let is_needed = !pairs.is_empty()
            || unsure.iter().any(|unsure| *unsure)
            || (1..boxes.len()).any(overlap);
        if !is_needed {
            return None;
        }
        let (n, mut own_pairs) = (skin.triangles().len(), 0);
        let mut crossed = vec![false; closed.triangles().len()];
        crossed[n..].fill(true);
        for pair in &pairs {
            own_pairs += usize::from((pair.a.max(pair.b) as usize) < n);
            [pair.a, pair.b].iter().for_each(|t| crossed[*t as usize] = true);
        }
        for (t, unsure) in unsure.iter_mut().enumerate() {
            *unsure |= crossed[t];
            crossed[t] = *unsure;
        }
        let sides = all_sides(closed, edges, &crossed, winding);
        let hidden: Vec<bool> = sides.iter().map(|(hidden, _)| *hidden).collect();
        for (t, unsure) in unsure.iter_mut().enumerate() {
            *unsure |= hidden[t] || sides[t].1;
        }
        Some(Self { hidden, unsure: skin.with_neighbours(&unsure), own_pairs })
    }
}

/// [`sides`] of all triangles. They are the same for triangles that are connected without passing
/// one that is `crossed`; `edges` are those of the skin.
fn all_sides(
    closed: &TriMesh,
    edges: &Edges,
    crossed: &[bool],
    winding: &Winding,
) -> Vec<(bool, bool)> {
    let joined = edges
        .triangles
        .iter()
        .filter(|[a, b]| *b != NONE && !crossed[*a as usize] && !crossed[*b as usize]);
    let first = parts_by_edges(joined.copied(), closed.triangles().len());
    let beside = BESIDE * closed.surface_aabb().size().max();
    let of_first: Vec<(bool, bool)> = (0..first.len())
        .into_par_iter()
        .map(|t| match first[t] as usize == t {
            true => sides(closed.corners(t), winding, beside),
            false => (false, false),
        })
        .collect();
    first.iter().map(|t| of_first[*t as usize]).collect()
}

/// Whether a triangle is hidden, and whether its front is inside while its back is not.
fn sides(corners: [&Point; 3], winding: &Winding, beside: Real) -> (bool, bool) {
    let normal = unit_or_zero(&area_vector(corners[0], corners[1], corners[2])) * beside;
    // The middle, and near the corners: a triangle may lie inside in part.
    let near = |k: usize| std::array::from_fn(|j| if j == k { 0.9 } else { 0.05 });
    let places = [[1.0 / 3.0; 3], near(0), near(1), near(2)];
    let (mut hidden, mut inverted) = (true, false);
    for weights in places {
        let p = barycentric_point(corners, weights);
        let is_inside = |p: Point| winding.at(&p) >= INSIDE;
        match (is_inside(p + normal), is_inside(p - normal)) {
            (true, true) => {}
            (false, true) => return (false, inverted),
            (front, _) => (hidden, inverted) = (false, inverted || front),
        }
    }
    (hidden, inverted)
}

/// Triangles at edges of more than two, or along which neighbours wind against each other.
fn irregular(mesh: &TriMesh, edges: &Edges) -> Vec<bool> {
    let balance = edges.balance(mesh);
    let is_irregular = |e: &u32| match edges.valence[*e as usize] {
        1 => false,
        2 => balance[*e as usize] != 0,
        _ => true,
    };
    edges.of_triangle.iter().map(|e| e.iter().any(is_irregular)).collect()
}
