//! Collapses short edges.

use if_core::edges::{Edges, VertexTriangles};
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;

/// Maximum number of passes. A pass collapses edges with disjoint neighbourhoods, about a tenth of
/// the candidates if all edges are short.
const PASSES: usize = 16;
/// The smallest cosine between the normals of a triangle before and after: a turn of 45°, beyond
/// which a smooth surface gets folds.
const TURN: Real = 0.7;

/// Collapses edges shorter than `shortest` (metres) into their midpoint, or into the end that lies
/// on a border, the shortest first.
///
/// An edge stays if its collapse would change the topology, flip a triangle, or make an edge longer
/// than 3 `shortest`. Borders keep their loops; vertices that remain keep their order.
pub fn collapse(mesh: &TriMesh, shortest: Real) -> TriMesh {
    let mut mesh = mesh.clone();
    for _ in 0..PASSES {
        let (next, collapsed) = pass(&mesh, shortest);
        mesh = next;
        if collapsed == 0 {
            break;
        }
    }
    mesh
}

/// One pass: collapses edges that share no triangle fan.
fn pass(mesh: &TriMesh, shortest: Real) -> (TriMesh, usize) {
    let edges = Edges::new(mesh);
    let fans = VertexTriangles::new(mesh);
    let on_border = edges.boundary_vertices(mesh.vertices().len());
    let length = |e: usize| {
        let [a, b] = edges.vertices[e].map(|v| mesh.vertices()[v as usize]);
        (a - b).norm()
    };
    let mut short: Vec<(Real, usize)> =
        (0..edges.len()).map(|e| (length(e), e)).filter(|e| e.0 < shortest).collect();
    short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut positions = mesh.vertices().to_vec();
    let mut into: Vec<u32> = (0..positions.len() as u32).collect();
    let mut touched = vec![false; positions.len()];
    let mut collapsed = 0;
    for (_, e) in short {
        let [a, b] = edges.vertices[e];
        let target = match (on_border[a as usize], on_border[b as usize]) {
            (true, false) => positions[a as usize],
            (false, true) => positions[b as usize],
            _ => nalgebra::center(&positions[a as usize], &positions[b as usize]),
        };
        let mut ring: Vec<u32> = [a, b]
            .iter()
            .flat_map(|v| fans.of(*v as usize))
            .flat_map(|t| mesh.triangles()[*t as usize])
            .collect();
        ring.sort_unstable();
        ring.dedup();
        let free = !ring.iter().any(|v| touched[*v as usize]);
        if free
            && keeps_topology(mesh, &edges, &fans, &on_border, e)
            && keeps_shape(mesh, &fans, [a, b], &target, 3.0 * shortest)
        {
            positions[a as usize] = target;
            into[b as usize] = a;
            ring.iter().for_each(|v| touched[*v as usize] = true);
            collapsed += 1;
        }
    }
    let mut number = vec![u32::MAX; positions.len()];
    let mut kept = Vec::with_capacity(positions.len() - collapsed);
    for (v, p) in positions.iter().enumerate().filter(|(v, _)| into[*v] == *v as u32) {
        number[v] = kept.len() as u32;
        kept.push(*p);
    }
    let triangles = mesh
        .triangles()
        .iter()
        .map(|t| t.map(|v| number[into[v as usize] as usize]))
        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .collect();
    (
        TriMesh::new(kept, triangles)
            .expect("midpoints are finite, and collapsed triangles are dropped"),
        collapsed,
    )
}

/// The link condition: the common neighbours of the ends are the corners opposite of the edge, and
/// the edge is not a bridge between two borders. No triangle or tetrahedron disappears.
fn keeps_topology(
    mesh: &TriMesh,
    edges: &Edges,
    fans: &VertexTriangles,
    on_border: &[bool],
    e: usize,
) -> bool {
    let [a, b] = edges.vertices[e];
    if edges.valence[e] > 2
        || (edges.valence[e] == 2 && on_border[a as usize] && on_border[b as usize])
    {
        return false;
    }
    let neighbours = |v: u32| {
        let mut out: Vec<u32> = fans
            .of(v as usize)
            .iter()
            .flat_map(|t| mesh.triangles()[*t as usize])
            .filter(|n| *n != v)
            .collect();
        out.sort_unstable();
        out.dedup();
        out
    };
    let (of_a, of_b) = (neighbours(a), neighbours(b));
    let common = of_a.iter().filter(|v| of_b.binary_search(v).is_ok()).count();
    let has_room = |v: u32, n: usize| n > 3 || on_border[v as usize];
    common == edges.valence[e] as usize
        && has_room(a, of_a.len())
        && has_room(b, of_b.len())
        && loop_is_long(edges, fans, e)
}

/// Whether the border at the edge has more than three edges: one of three would close.
fn loop_is_long(edges: &Edges, fans: &VertexTriangles, e: usize) -> bool {
    if edges.valence[e] == 2 {
        return true;
    }
    let [a, b] = edges.vertices[e];
    let ends = |v: u32, not: u32| {
        fans.of(v as usize)
            .iter()
            .flat_map(|t| edges.of_triangle[*t as usize])
            .filter(|e| edges.valence[*e as usize] == 1 && edges.vertices[*e as usize].contains(&v))
            .flat_map(|e| edges.vertices[e as usize])
            .find(|w| *w != v && *w != not)
    };
    ends(a, b) != ends(b, a)
}

fn keeps_shape(
    mesh: &TriMesh,
    fans: &VertexTriangles,
    ends: [u32; 2],
    target: &Point,
    longest: Real,
) -> bool {
    ends.iter().flat_map(|v| fans.of(*v as usize)).all(|t| {
        let t = mesh.triangles()[*t as usize];
        if ends.iter().all(|v| t.contains(v)) {
            return true;
        }
        let old = t.map(|v| mesh.vertices()[v as usize]);
        let new = t.map(|v| if ends.contains(&v) { *target } else { mesh.vertices()[v as usize] });
        let normal = |p: &[Point; 3]| -> Vector { area_vector(&p[0], &p[1], &p[2]) };
        let (before, after) = (normal(&old), normal(&new));
        before.dot(&after) >= TURN * before.norm() * after.norm()
            && after.norm() > 0.0
            && (0..3).all(|k| (new[k] - new[(k + 1) % 3]).norm() <= longest)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::{cloth, icosphere, tube};

    fn lengths(mesh: &TriMesh) -> Vec<Real> {
        let edges = Edges::new(mesh);
        edges
            .vertices
            .iter()
            .map(|e| (mesh.vertices()[e[0] as usize] - mesh.vertices()[e[1] as usize]).norm())
            .collect()
    }

    #[test]
    fn short_edges_of_a_ball_are_collapsed_and_it_keeps_its_shape() {
        let ball = icosphere(1.0, 4);
        let coarse = collapse(&ball, 0.12);
        let edges = Edges::new(&coarse);
        assert!(coarse.triangles().len() < ball.triangles().len() / 2);
        assert!(edges.valence.iter().all(|v| *v == 2));
        assert_eq!(coarse.vertices().len() + coarse.triangles().len(), edges.len() + 2);
        assert!(lengths(&coarse).iter().all(|l| *l <= 0.36));
        assert!(coarse.signed_volume() > 0.95 * ball.signed_volume());
    }

    #[test]
    fn borders_keep_their_place_and_number() {
        let pipe = tube(0.5, 2.0, 64, 40, false);
        let coarse = collapse(&pipe, 0.08);
        assert!(coarse.triangles().len() < pipe.triangles().len() * 2 / 3);
        let loops = Edges::new(&coarse).boundary_loops(&coarse);
        assert_eq!(loops.len(), 2);
        for border in &loops {
            let height = coarse.vertices()[border[0] as usize].y;
            assert!(border.iter().all(|v| coarse.vertices()[*v as usize].y == height));
        }
    }

    #[test]
    fn edges_that_cannot_be_collapsed_stay() {
        for mesh in [
            cloth(1.0, 1.0, 1, 1),
            icosphere(1.0, 0),
            TriMesh::default(),
            tube(1.0, 1.0, 3, 1, false),
        ] {
            let same = collapse(&mesh, 100.0);
            let edges = Edges::new(&same);
            let before = Edges::new(&mesh);
            assert_eq!(edges.boundary_loops(&same).len(), before.boundary_loops(&mesh).len());
            assert_eq!(
                same.vertices().len() + same.triangles().len() + before.len(),
                mesh.vertices().len() + mesh.triangles().len() + edges.len()
            );
        }
        assert_eq!(collapse(&icosphere(1.0, 2), 0.01), icosphere(1.0, 2));
    }
}
