//! Struts: where no frame sees it, as behind what an open coat leaves free, the surface tangles, and comes out
//! as a lattice that hangs at the cloth.

use if_core::edges::{Edges, part_count, parts_by_edges};
use if_core::math::{Real, area_vector};
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;

/// Area of an unseen patch for each tunnel through it up to which it is a lattice, in square metres: 7 cm
/// squared. Cloth that was not seen has a tunnel now and then.
const LATTICE: Real = 0.005;
/// Patches that are looked at, the largest ones.
const PATCHES: usize = 32;

/// The genus of a mesh, the sum of its parts: its Euler characteristic is 2 · parts − 2 · genus − boundary
/// loops.
pub(super) fn tunnels(mesh: &TriMesh) -> usize {
    let unused = mesh.used_vertices().iter().filter(|used| !**used).count();
    let (parts, vertices) = (part_count(mesh) - unused, mesh.vertices().len() - unused);
    let edges = Edges::new(mesh);
    let loops = edges.boundary_loops(mesh).len();
    let twice = (2 * parts + edges.vertices.len())
        .saturating_sub(vertices + mesh.triangles().len() + loops);
    twice / 2
}

/// The piece of a garment without the patches between unseen vertices that are lattices; `None` if none is.
pub(super) fn removed(piece: &TriMesh, seen: &[bool]) -> Option<TriMesh> {
    let mut left = tunnels(piece);
    if left == 0 {
        return None;
    }
    let triangles = piece.triangles();
    let is_unseen = |t: &[u32; 3]| t.iter().all(|v| !seen[*v as usize]);
    let edges =
        triangles.iter().filter(|t| is_unseen(t)).flat_map(|[a, b, c]| [[*a, *b], [*a, *c]]);
    let part = parts_by_edges(edges, piece.vertices().len());
    let mut patches: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, t) in triangles.iter().enumerate().filter(|(_, t)| is_unseen(t)) {
        patches.entry(part[t[0] as usize]).or_default().push(k);
    }
    let mut patches: Vec<Vec<usize>> = patches.into_values().collect();
    patches.sort_by_key(|patch| std::cmp::Reverse(patch.len()));
    let mut kept = vec![true; triangles.len()];
    let of = |kept: &[bool]| {
        let rest = triangles.iter().zip(kept).filter(|(_, kept)| **kept).map(|(t, _)| *t);
        TriMesh::new(piece.vertices().to_vec(), rest.collect()).expect("a part of a mesh")
    };
    for patch in patches.iter().take(PATCHES) {
        let area: Real = patch.iter().map(|k| area(piece, *k)).sum();
        if area > LATTICE * left as Real {
            continue; // however many tunnels lead through it
        }
        patch.iter().for_each(|k| kept[*k] = false);
        let fewer = left.saturating_sub(tunnels(&of(&kept)));
        if fewer > 0 && area <= LATTICE * fewer as Real {
            left -= fewer;
        } else {
            patch.iter().for_each(|k| kept[*k] = true);
        }
    }
    kept.contains(&false).then(|| of(&kept))
}

fn area(mesh: &TriMesh, triangle: usize) -> Real {
    let [a, b, c] = mesh.corners(triangle);
    0.5 * area_vector(a, b, c).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::{Point, Vector};
    use if_core::shapes::meshes::{icosphere, tube};

    #[test]
    fn tunnels_are_counted_beside_openings() {
        assert_eq!(tunnels(&icosphere(1.0, 2)), 0);
        let sleeve = tube(0.1, 0.4, 12, 5, false);
        assert_eq!((tunnels(&sleeve), part_count(&sleeve)), (0, 1));
        // Its ends meet: a ring, and beside it the sleeve.
        let last = sleeve.vertices().len() as u32 - 12;
        let joined = |v: u32| if v < last { v } else { v - last };
        let ring = sleeve.triangles().iter().map(|t| t.map(joined));
        let beside = sleeve.triangles().iter().map(|t| t.map(|v| v + last));
        let vertices = [&sleeve.vertices()[..last as usize], sleeve.vertices()].concat();
        let both = TriMesh::new(vertices, ring.chain(beside).collect()).unwrap();
        assert_eq!((tunnels(&both), part_count(&both)), (1, 2));
    }

    /// A square sheet of cells of 1 cm with two of them missing, and a tube from one hole to the other below it.
    fn handle(n: u32) -> (TriMesh, u32) {
        let at = |i: u32, j: u32| j * (n + 1) + i;
        let grid = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let place =
            |(i, j): (u32, u32)| Point::new(0.01 * Real::from(i), 0.0, 0.01 * Real::from(j));
        let mut vertices: Vec<Point> = grid.map(place).collect();
        let holes = [(1, 1), (n - 2, 1)];
        let cells = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
        let quad = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        let corners = |(i, j): (u32, u32)| [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        let cells = cells.filter(|cell| !holes.contains(cell));
        let mut triangles: Vec<[u32; 3]> = cells.flat_map(|cell| quad(corners(cell))).collect();
        let seen = vertices.len() as u32;
        // Below each hole a ring, and between the rings a tube.
        let rings = holes.map(|hole| {
            let first = vertices.len() as u32;
            let below = corners(hole).map(|v| vertices[v as usize] - Vector::y() * 0.01);
            vertices.extend(below);
            (corners(hole), [0, 1, 2, 3].map(|k| first + k))
        });
        let mut join = |a: [u32; 4], b: [u32; 4]| {
            (0..4)
                .for_each(|k| triangles.extend(quad([a[(k + 1) % 4], a[k], b[k], b[(k + 1) % 4]])));
        };
        join(rings[0].0, rings[0].1);
        join(rings[1].1, rings[1].0);
        // Mirrored, as the one looks down and the other up.
        let mirrored = [3, 2, 1, 0].map(|k: usize| rings[1].1[k]);
        join(rings[0].1, mirrored);
        (TriMesh::new(vertices, triangles).unwrap(), seen)
    }

    #[test]
    fn unseen_lattices_are_removed_and_wide_unseen_cloth_is_not() {
        let (mesh, first) = handle(6);
        assert_eq!(tunnels(&mesh), 1);
        let seen: Vec<bool> = (0..mesh.vertices().len() as u32).map(|v| v < first).collect();
        let rest = removed(&mesh, &seen).expect("a handle");
        assert_eq!(tunnels(&rest), 0);
        assert!(rest.triangles().len() < mesh.triangles().len());
        assert_eq!(removed(&mesh, &vec![true; seen.len()]), None, "frames see it");
        assert_eq!(removed(&rest, &seen), None, "no tunnel");
        // Twenty times as large it is cloth.
        let large = mesh.with_vertices(mesh.vertices().iter().map(|p| p * 20.0).collect()).unwrap();
        assert_eq!(removed(&large, &seen), None);
    }
}
