//! Cloth as one sheet: of triangles that repeat others, as on the back of a two-sided export, one counts,
//! and neighbours wind alike.
//!
//! Only then are its hems boundary edges, and the boundary's edges loops.

use crate::body_surface::with_triangles;
use crate::index::Bvh;
use crate::orient::orient;
use crate::validate::repeats;
use if_core::closest::ClosestPoint;
use if_core::edges::{Edges, parts_by_edges};
use if_core::math::{Point, Real, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use std::borrow::Cow;

/// A garment as one sheet.
pub(crate) struct Sheet<'a> {
    pub(crate) mesh: Cow<'a, TriMesh>,
    pub(crate) edges: Cow<'a, Edges>,
    /// For each triangle its number in the garment; empty if the garment is a sheet itself.
    given: Vec<u32>,
}

impl<'a> Sheet<'a> {
    /// Of a garment, welded, with its edges.
    pub(crate) fn new(mesh: &'a TriMesh, edges: &'a Edges) -> Self {
        let given =
            || Self { mesh: Cow::Borrowed(mesh), edges: Cow::Borrowed(edges), given: Vec::new() };
        let balance = edges.balance(mesh);
        if edges.valence.iter().zip(&balance).all(|(n, b)| *n == 1 || *n == 2 && *b == 0) {
            return given();
        }
        let repeated = repeats(mesh.triangles());
        let all = 0..mesh.triangles().len() as u32;
        let kept: Vec<u32> = all.filter(|t| repeated.binary_search(t).is_err()).collect();
        let mut triangles: Vec<[u32; 3]> =
            kept.iter().map(|t| mesh.triangles()[*t as usize]).collect();
        let is_part = kept.len() < mesh.triangles().len();
        let of_part = is_part.then(|| Edges::new(&with_triangles(mesh, triangles.clone())));
        if orient(&mut triangles, of_part.as_ref().unwrap_or(edges)) == 0 && !is_part {
            return given();
        }
        let mesh = with_triangles(mesh, triangles);
        let edges = Edges::new(&mesh);
        Self { mesh: Cow::Owned(mesh), edges: Cow::Owned(edges), given: kept }
    }
}

/// The triangles of a garment as one sheet, wound away from `body`, each with its number in the garment;
/// `None` if they are the garment's own. What has no edge, such as cloth with thickness, is wound outwards.
pub fn away_from(mesh: &TriMesh, body: &Bvh) -> Option<(Vec<[u32; 3]>, Vec<u32>)> {
    let all = Edges::new(mesh);
    let Sheet { mesh: sheet, edges, given } = Sheet::new(mesh, &all);
    let inside = edges.triangles.iter().zip(&edges.valence).filter(|(_, n)| **n == 2);
    let patches = parts_by_edges(inside.map(|(t, _)| *t), sheet.triangles().len());
    let mut has_edge = vec![false; patches.len()];
    for (t, of_triangle) in edges.of_triangle.iter().enumerate() {
        let ends = of_triangle.iter().any(|e| edges.valence[*e as usize] != 2);
        has_edge[patches[t] as usize] |= ends;
    }
    // By how much each patch faces away from the body.
    let mut outwards = vec![0.0; patches.len()];
    for (t, patch) in patches.iter().enumerate() {
        let [a, b, c] = sheet.corners(t);
        let area = area_vector(a, b, c);
        outwards[*patch as usize] += match has_edge[*patch as usize] {
            true => {
                let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
                let nearest = body.closest(&middle, Real::INFINITY);
                nearest.map_or(0.0, |c| area.dot(&unit_or_zero(&(middle - c.point))))
            }
            false => area.dot(&a.coords),
        };
    }
    let is_turned = outwards.iter().any(|o| *o < 0.0);
    if given.is_empty() && !is_turned {
        return None;
    }
    let turned = |(t, [a, b, c]): (usize, &[u32; 3])| match outwards[patches[t] as usize] < 0.0 {
        true => [*a, *c, *b],
        false => [*a, *b, *c],
    };
    let triangles = sheet.triangles().iter().enumerate().map(turned).collect();
    let own = || (0..patches.len() as u32).collect();
    Some((triangles, if given.is_empty() { own() } else { given }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::{icosphere, tube};

    fn with(mesh: &TriMesh, turn: impl Fn(usize) -> bool) -> TriMesh {
        let turned = |(t, [a, b, c]): (usize, &[u32; 3])| match turn(t) {
            true => [*a, *c, *b],
            false => [*a, *b, *c],
        };
        with_triangles(mesh, mesh.triangles().iter().enumerate().map(turned).collect())
    }

    fn loops(mesh: &TriMesh) -> Vec<usize> {
        let edges = Edges::new(mesh);
        let sheet = Sheet::new(mesh, &edges);
        let mut lengths: Vec<usize> =
            sheet.edges.boundary_loops(&sheet.mesh).iter().map(Vec::len).collect();
        lengths.sort_unstable();
        lengths
    }

    #[test]
    fn a_tube_has_two_hems_however_it_is_wound_and_on_both_sides() {
        let shirt = tube(0.12, 0.6, 24, 12, false);
        let mixed = with(&shirt, |t| t % 3 == 0);
        let back = with(&shirt, |_| true);
        let both = [shirt.triangles(), back.triangles()].concat();
        let both = with_triangles(&shirt, both);
        for mesh in [&shirt, &mixed, &back, &both] {
            assert_eq!(loops(mesh), [24, 24]);
        }
        let edges = Edges::new(&shirt);
        assert!(matches!(Sheet::new(&shirt, &edges).mesh, Cow::Borrowed(_)));
    }

    #[test]
    fn garments_are_wound_away_from_the_body() {
        let torso = tube(0.1, 0.6, 48, 24, true);
        let body = Bvh::new(&torso);
        let shirt = tube(0.12, 0.6, 24, 12, false);
        assert!(away_from(&shirt, &body).is_none());
        let outwards = |triangles: &[[u32; 3]]| {
            triangles.iter().all(|t| {
                let [a, b, c] = t.map(|v| &shirt.vertices()[v as usize]);
                let normal = area_vector(a, b, c);
                normal.dot(&Vector::new(a.x + b.x + c.x, 0.0, a.z + b.z + c.z)) > 0.0
            })
        };
        let both = [shirt.triangles(), with(&shirt, |_| true).triangles()].concat();
        for mesh in
            [with(&shirt, |_| true), with(&shirt, |t| t % 3 > 0), with_triangles(&shirt, both)]
        {
            let (triangles, given) = away_from(&mesh, &body).unwrap();
            assert!(outwards(&triangles));
            assert_eq!(given, (0..shirt.triangles().len() as u32).collect::<Vec<_>>());
        }
        // What has no edge is wound outwards, wherever the body is.
        let button = icosphere(0.01, 1);
        let (triangles, _) = away_from(&with(&button, |_| true), &body).unwrap();
        assert!(with_triangles(&button, triangles).signed_volume() > 0.0);
        assert!(away_from(&button, &body).is_none());
    }
}
