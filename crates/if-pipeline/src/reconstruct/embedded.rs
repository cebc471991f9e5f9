//! Moves of vertices that leave a mesh without intersections.

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;

/// Times that a vertex goes half of the way back before it goes all of it.
const TURNS: usize = 4;

/// The mesh with its vertices at `x`. Where triangles meet, the vertices that moved there and those
/// around go half of the way back, in the end all of it: an embedded mesh stays one.
pub(super) fn moved(mesh: &TriMesh, neighbours: &Rows<u32>, mut x: Vec<Point>) -> TriMesh {
    let start = mesh.vertices();
    let mut turns = vec![0; x.len()];
    loop {
        let moved = mesh.with_vertices(x.clone()).expect("the moved positions are finite");
        let pairs = own_pairs(&moved, &Bvh::new(&moved));
        let moving = |v: &u32| x[*v as usize] != start[*v as usize];
        let corners = pairs.iter().flat_map(|p| [p.a, p.b]);
        let corners = corners.flat_map(|t| mesh.triangles()[t as usize]);
        let met: Vec<u32> = corners.filter(moving).collect();
        if met.is_empty() {
            return moved;
        }
        let mut back: Vec<u32> =
            met.iter().flat_map(|v| neighbours.of(*v as usize)).copied().collect();
        back.extend(met);
        back.sort_unstable();
        back.dedup();
        for v in back.into_iter().map(|v| v as usize) {
            turns[v] += 1;
            x[v] = if turns[v] < TURNS { nalgebra::center(&x[v], &start[v]) } else { start[v] };
        }
    }
}
