//! Small meshes, sound and unsound, of any size and proportion.

use crate::cases::Random;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::{cloth, icosphere, torus, tube};

/// A mesh within about one metre of the origin, sound or with faults: needles, doubled, flipped and
/// coincident triangles, fans of a hundred, islands, lone vertices, or nothing at all.
pub fn any(r: &mut Random) -> TriMesh {
    match r.below(12) {
        0 => cloth(1.0, 1.0, 1 + r.below(6) as u32, 1 + r.below(6) as u32),
        1 => cloth(1.0, 0.3, 6, 3),
        2 => tube(0.4, 1.0, 5 + r.below(6) as u32, 1 + r.below(4) as u32, r.chance(0.5)),
        3 => icosphere(0.5, 1),
        4 => torus(0.5, 0.2, 6, 5),
        5 => soup(r, 20, 30),
        6 => fan(100),
        7 => spoiled(r, &cloth(1.0, 1.0, 4, 4)),
        8 => spoiled(r, &icosphere(0.5, 1)),
        9 => TriMesh::new(
            vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)],
            vec![[0, 1, 2]],
        )
        .unwrap(),
        10 => book(2 + r.below(4)),
        _ => {
            let n = r.below(3);
            TriMesh::new((0..n).map(|_| r.point(1.0)).collect(), vec![]).unwrap()
        }
    }
}

/// The same mesh with its vertices in another order.
pub fn renumbered(r: &mut Random, mesh: &TriMesh) -> TriMesh {
    let mut to: Vec<u32> = (0..mesh.vertices().len() as u32).collect();
    r.shuffle(&mut to);
    let mut vertices = mesh.vertices().to_vec();
    to.iter().zip(mesh.vertices()).for_each(|(to, p)| vertices[*to as usize] = *p);
    TriMesh::new(vertices, mesh.triangles().iter().map(|t| t.map(|v| to[v as usize])).collect())
        .unwrap()
}

/// Any triangles over any points; some points coincide.
pub fn soup(r: &mut Random, points: usize, triangles: usize) -> TriMesh {
    let mut vertices: Vec<Point> = (0..points).map(|_| r.point(1.0)).collect();
    for _ in 0..points / 5 {
        let (i, j) = (r.below(points), r.below(points));
        vertices[i] = vertices[j];
    }
    let triangle = |r: &mut Random| {
        let a = r.below(points);
        let b = (a + 1 + r.below(points - 1)) % points;
        let mut c = r.below(points);
        while c == a || c == b {
            c = (c + 1) % points;
        }
        [a as u32, b as u32, c as u32]
    };
    let triangles = (0..triangles).map(|_| triangle(r)).collect();
    TriMesh::new(vertices, triangles).unwrap()
}

/// A vertex with `n` triangles round it.
fn fan(n: u32) -> TriMesh {
    let rim = (0..n).map(|k| Real::from(k) / Real::from(n) * std::f64::consts::TAU);
    let vertices = std::iter::once(Point::origin())
        .chain(rim.map(|a| Point::new(0.5 * a.cos(), 0.5 * a.sin(), 0.0)));
    TriMesh::new(vertices.collect(), (1..n).map(|k| [0, k, k + 1]).collect()).unwrap()
}

/// `n` pages at one edge.
fn book(n: usize) -> TriMesh {
    let mut vertices = vec![Point::origin(), Point::new(1.0, 0.0, 0.0)];
    vertices.extend((0..n).map(|k| Point::new(0.5, (k as Real).cos(), (k as Real).sin())));
    TriMesh::new(vertices, (0..n as u32).map(|k| [0, 1, k + 2]).collect()).unwrap()
}

/// The mesh with some triangles flipped, doubled, taken away or squeezed to a line or a point.
pub fn spoiled(r: &mut Random, mesh: &TriMesh) -> TriMesh {
    let mut vertices = mesh.vertices().to_vec();
    let mut triangles = mesh.triangles().to_vec();
    for _ in 0..1 + r.below(6) {
        let t = r.below(triangles.len());
        let [a, b, c] = triangles[t].map(|v| v as usize);
        match r.below(6) {
            0 => triangles[t].swap(0, 1),
            1 => triangles.push(triangles[t]),
            2 if triangles.len() > 1 => drop(triangles.swap_remove(t)),
            3 => vertices[a] = vertices[b] + (vertices[c] - vertices[b]) * 0.5,
            4 => vertices[a] = vertices[b],
            _ => vertices[a] = vertices[b] + (vertices[a] - vertices[b]) * 1e-12,
        }
    }
    TriMesh::new(vertices, triangles).unwrap()
}

/// The mesh squeezed by `aspect` along one axis and scaled by `scale`, turned and moved.
pub fn placed(
    mesh: &TriMesh,
    r: &mut Random,
    scale: Real,
    aspect: Real,
    offset: Vector,
) -> TriMesh {
    let (turn, axis) = (r.rotation(), r.below(3));
    let place = |p: &Point| {
        let mut q = *p;
        q[axis] /= aspect;
        turn * Point::from(q.coords * scale) + offset
    };
    mesh.with_vertices(mesh.vertices().iter().map(place).collect()).unwrap()
}
