//! Cloth as one sheet: of triangles that repeat others, as on the back of a two-sided export, one counts,
//! and neighbours wind alike.
//!
//! Only then are its hems boundary edges, and the boundary's edges loops. Cloth with thickness is one sheet, too:
//! the side that faces away from the body.

use crate::body_surface::with_triangles;
use crate::index::Bvh;
use crate::orient::orient;
use crate::validate::repeats;
use if_core::closest::ClosestPoint;
use if_core::edges::{Edges, NONE, parts_by_edges};
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::VecDeque;

/// Cosine between a triangle's normal and the way to the body above which it is certain which of them it faces.
const CERTAIN: Real = 0.5;

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
        let turned = orient(&mut triangles, of_part.as_ref().unwrap_or(edges));
        if turned == 0 && !is_part {
            return given();
        }
        let mesh = with_triangles(mesh, triangles);
        let edges = of_part.filter(|_| turned == 0).unwrap_or_else(|| Edges::new(&mesh));
        Self { mesh: Cow::Owned(mesh), edges: Cow::Owned(edges), given: kept }
    }
}

/// The parts of a sheet that are connected by edges of two triangles.
struct Patches {
    /// For each triangle the first one of its patch.
    of: Vec<u32>,
    /// By first triangle: whether the patch has an edge of another number of triangles.
    has_edge: Vec<bool>,
}

impl Sheet<'_> {
    fn patches(&self) -> Patches {
        let edges = &self.edges;
        let inside = edges.triangles.iter().zip(&edges.valence).filter(|(_, n)| **n == 2);
        let of = parts_by_edges(inside.map(|(t, _)| *t), edges.of_triangle.len());
        let mut has_edge = vec![false; of.len()];
        for (of_triangle, patch) in edges.of_triangle.iter().zip(&of) {
            has_edge[*patch as usize] |=
                of_triangle.iter().any(|e| edges.valence[*e as usize] != 2);
        }
        Patches { of, has_edge }
    }

    /// By first triangle the volume of each patch that has no edge, six times.
    fn volumes(&self, Patches { of, has_edge }: &Patches) -> Vec<Real> {
        let mut volumes = vec![0.0; of.len()];
        for (t, patch) in of.iter().map(|patch| *patch as usize).enumerate() {
            if !has_edge[patch] {
                let [a, b, c] = self.mesh.corners(t);
                volumes[patch] += area_vector(a, b, c).dot(&a.coords);
            }
        }
        volumes
    }

    /// The cosine between the normal of triangle `t` and the way there from the nearest point of `body`, and
    /// twice its area.
    fn away(&self, t: usize, body: &Bvh) -> (Real, Real) {
        let [a, b, c] = self.mesh.corners(t);
        let (area, middle) = (area_vector(a, b, c), (a.coords + b.coords + c.coords) / 3.0);
        let nearest = body.closest(&Point::from(middle), Real::INFINITY);
        let way = nearest.map_or(Vector::zeros(), |n| unit_or_zero(&(middle - n.point.coords)));
        (unit_or_zero(&area).dot(&way), area.norm())
    }

    /// For each triangle of cloth with thickness, which has no edge, whether it is of the side that faces away
    /// from `body`; `false` for all others. `outwards` is how the winding of each patch leads out.
    ///
    /// What stands across, as the sides of pleats do, is of the side that the triangles next to it are of.
    fn outer(&self, patches: &Patches, outwards: &[Real], body: &Bvh) -> Vec<bool> {
        let Patches { of, has_edge } = patches;
        let certain = |t: usize| {
            let patch = of[t] as usize;
            if has_edge[patch] {
                return None;
            }
            let (away, _) = self.away(t, body);
            (away.abs() > CERTAIN).then(|| away * outwards[patch] > 0.0)
        };
        let mut outer: Vec<Option<bool>> = (0..of.len()).into_par_iter().map(certain).collect();
        let mut next: VecDeque<u32> =
            (0..of.len() as u32).filter(|t| outer[*t as usize].is_some()).collect();
        while let Some(t) = next.pop_front() {
            for e in self.edges.of_triangle[t as usize] {
                let [a, b] = self.edges.triangles[e as usize];
                let other = if a == t { b } else { a };
                if other != NONE && outer[other as usize].is_none() {
                    outer[other as usize] = outer[t as usize];
                    next.push_back(other);
                }
            }
        }
        outer.into_iter().map(|outer| outer == Some(true)).collect()
    }

    /// Where cloth with thickness turns round from the side that faces away from `body` to the one that
    /// faces it.
    pub(crate) fn rims(&self, body: &Bvh) -> Vec<Vec<u32>> {
        let patches = self.patches();
        if patches.of.iter().all(|patch| patches.has_edge[*patch as usize]) {
            return Vec::new();
        }
        let outer = self.outer(&patches, &self.volumes(&patches), body);
        let outer = self.mesh.triangles().iter().zip(outer).filter(|(_, outer)| *outer);
        let outer = with_triangles(&self.mesh, outer.map(|(t, _)| *t).collect());
        Edges::new(&outer).boundary_loops(&outer)
    }
}

/// The triangles of a garment as one sheet, wound away from `body`, each with its number in the garment;
/// `None` if they are the garment's own. Of cloth with thickness it is the side that faces away.
pub fn away_from(mesh: &TriMesh, body: &Bvh) -> Option<(Vec<[u32; 3]>, Vec<u32>)> {
    let edges = Edges::new(mesh);
    let sheet = Sheet::new(mesh, &edges);
    let patches = sheet.patches();
    let mut outwards = sheet.volumes(&patches);
    let Patches { of, has_edge } = &patches;
    let on_open = |t: &usize| has_edge[of[*t] as usize];
    let away: Vec<(usize, (Real, Real))> =
        (0..of.len()).into_par_iter().filter(on_open).map(|t| (t, sheet.away(t, body))).collect();
    away.into_iter().for_each(|(t, (away, area))| outwards[of[t] as usize] += away * area);
    let outer = sheet.outer(&patches, &outwards, body);
    let told = (0..of.len()).filter_map(|t| {
        let (patch, [a, b, c]) = (of[t] as usize, sheet.mesh.triangles()[t]);
        let corners = if outwards[patch] < 0.0 { [a, c, b] } else { [a, b, c] };
        (has_edge[patch] || outer[t]).then_some((corners, t as u32))
    });
    let (triangles, own): (Vec<[u32; 3]>, Vec<u32>) = told.unzip();
    if triangles == mesh.triangles() {
        return None;
    }
    let given = |t: u32| sheet.given.get(t as usize).copied().unwrap_or(t);
    Some((triangles, own.into_iter().map(given).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
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
        // Of what has no edge, wherever the winding leads, the side that faces away.
        let button = icosphere(0.01, 2);
        let moved = button.vertices().iter().map(|p| p + Vector::x() * 0.15).collect();
        let button = button.with_vertices(moved).unwrap();
        for turned in [false, true] {
            let (triangles, given) = away_from(&with(&button, |_| turned), &body).unwrap();
            assert!(given.len() > button.triangles().len() / 3 && triangles.len() == given.len());
            for t in triangles {
                let [a, b, c] = t.map(|v| &button.vertices()[v as usize]);
                assert!(unit_or_zero(&area_vector(a, b, c)).x > -CERTAIN);
            }
        }
    }
}
