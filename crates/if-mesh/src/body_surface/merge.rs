//! Vertices at one place become one, and repeated triangles are dropped.

use crate::seams::coincident_vertices;
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use std::collections::{BTreeMap, BTreeSet};

/// Distance up to which vertices at boundary edges are one, as a share of the longest side of the
/// body: 16 µm for a person. Files of five decimal digits round by 5 µm; ten times more would join
/// lips and eyelids of dense meshes.
const AT_ONE_PLACE: Real = 1e-5;

/// A mesh with vertices merged.
pub(super) struct Merged {
    /// Vertices as given; merged ones are not used.
    pub(super) mesh: TriMesh,
    /// For each triangle its number in the given mesh.
    pub(super) given: Vec<u32>,
    /// For each vertex the first one at its place.
    pub(super) first: Vec<u32>,
    pub(super) merged_vertices: usize,
    pub(super) repeated_triangles: usize,
}

impl Merged {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let n = mesh.vertices().len();
        let exact = coincident_vertices(mesh.vertices()).unwrap_or_else(|| (0..n as u32).collect());
        // Repeated triangles first: what they hide may be a boundary.
        let mut seen = BTreeSet::new();
        let mut given = Vec::new();
        for (t, corners) in mesh.triangles().iter().enumerate() {
            let mut places = corners.map(|v| exact[v as usize]);
            places.sort_unstable();
            let is_line = places[0] == places[1] || places[1] == places[2];
            if !is_line && seen.insert(places) {
                given.push(t as u32);
            }
        }
        let kept = given.iter().map(|t| mesh.triangles()[*t as usize]).collect();
        let kept = with_triangles(mesh, kept);
        let first = join_boundary(&kept, &exact);
        let mut triangles = Vec::with_capacity(given.len());
        given.retain(|t| {
            let corners = mesh.triangles()[*t as usize].map(|v| first[v as usize]);
            let [a, b, c] = corners;
            let is_kept = a != b && b != c && c != a;
            triangles.extend(is_kept.then_some(corners));
            is_kept
        });
        let used = mesh.used_vertices();
        Self {
            repeated_triangles: mesh.triangles().len() - given.len(),
            merged_vertices: (0..n).filter(|v| used[*v] && first[*v] as usize != *v).count(),
            mesh: with_triangles(mesh, triangles),
            given,
            first,
        }
    }
}

/// The vertices of `mesh` with other triangles, whose corners are distinct.
pub(crate) fn with_triangles(mesh: &TriMesh, triangles: Vec<[u32; 3]>) -> TriMesh {
    TriMesh::new(mesh.vertices().to_vec(), triangles).expect("corners of a mesh, all distinct")
}

/// For each vertex the first boundary vertex at its place; itself away from boundaries.
fn join_boundary(mesh: &TriMesh, exact: &[u32]) -> Vec<u32> {
    let edges = Edges::new(mesh);
    let mut on_boundary = vec![false; mesh.vertices().len()];
    for (e, ends) in edges.vertices.iter().enumerate() {
        if edges.valence[e] != 2 {
            ends.iter().for_each(|v| on_boundary[*v as usize] = true);
        }
    }
    let mut first: Vec<u32> = (0..mesh.vertices().len() as u32).collect();
    let cell = AT_ONE_PLACE * mesh.surface_aabb().size().max();
    if cell.is_nan() || cell <= 0.0 {
        return first;
    }
    // Coordinates beyond the range of i64 saturate: such vertices are no part of a body.
    let place = |v: u32| mesh.vertices()[v as usize].coords.map(|x| (x / cell).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    for v in (0..first.len() as u32).filter(|v| on_boundary[*v as usize]) {
        let twin = exact[v as usize];
        if twin != v && on_boundary[twin as usize] {
            first[v as usize] = first[twin as usize];
            continue;
        }
        let at = place(v);
        let near = (0..27).find_map(|k| {
            let step = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
            let beside = [0, 1, 2].map(|axis| at[axis].saturating_add(step[axis]));
            let other = *cells.get(&beside)?;
            let distance = mesh.vertices()[other as usize] - mesh.vertices()[v as usize];
            (distance.norm() <= cell).then_some(other)
        });
        match near {
            Some(other) => first[v as usize] = other,
            None => {
                cells.entry(at.into()).or_insert(v);
            }
        }
    }
    first
}
