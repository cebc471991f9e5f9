//! Triangles over the loops of a surface.

use crate::cleanup::{Lid, Rim};
use if_core::edges::Edges;
use if_core::math::{Point, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use std::collections::BTreeMap;

/// What lies around the loops of a mesh.
pub(super) struct Surroundings<'a> {
    mesh: &'a TriMesh,
    neighbours: Rows<u32>,
    /// The triangle at each directed boundary edge.
    beyond: BTreeMap<[u32; 2], u32>,
}

impl<'a> Surroundings<'a> {
    pub(super) fn new(mesh: &'a TriMesh) -> Self {
        let edges = Edges::new(mesh);
        let mut beyond = BTreeMap::new();
        for (t, corners) in mesh.triangles().iter().enumerate() {
            for k in 0..3 {
                if edges.valence[edges.of_triangle[t][k] as usize] == 1 {
                    beyond.insert([corners[k], corners[(k + 1) % 3]], t as u32);
                }
            }
        }
        Self { mesh, neighbours: edges.neighbours(mesh.vertices().len()), beyond }
    }

    /// A triangle beyond one of the edges of a loop; triangle 0 if there is none.
    pub(super) fn triangle_beside(&self, vertices: &[u32]) -> u32 {
        let n = vertices.len();
        let beside = |k: usize| self.beyond.get(&[vertices[(k + 1) % n], vertices[k]]);
        (0..n).find_map(beside).copied().unwrap_or(0)
    }

    /// The loop through `vertices`, in the direction of the triangles that close it.
    pub(super) fn rim(&self, vertices: &[u32]) -> Rim {
        let n = vertices.len();
        let place = |v: u32| self.mesh.vertices()[v as usize];
        let outside = |k: usize| {
            let t = self.beyond.get(&[vertices[(k + 1) % n], vertices[k]]);
            t.map_or(Vector::zeros(), |t| {
                let [a, b, c] = self.mesh.corners(*t as usize);
                unit_or_zero(&area_vector(a, b, c))
            })
        };
        let around = |k: usize| {
            let on_loop = [vertices[(k + 1) % n], vertices[(k + n - 1) % n]];
            let near = self.neighbours.of(vertices[k] as usize).iter();
            near.filter(|v| !on_loop.contains(v)).map(|v| place(*v)).collect()
        };
        Rim {
            points: vertices.iter().map(|v| place(*v)).collect(),
            outside: (0..n).map(outside).collect(),
            around: (0..n).map(around).collect(),
        }
    }
}

/// A lid with one vertex in the middle: it exists for every loop.
pub(super) fn fan(points: &[Point]) -> Lid {
    let n = points.len() as u32;
    let middle = points.iter().map(|p| p.coords).sum::<Vector>() / f64::from(n.max(1));
    let mut vertices = points.to_vec();
    vertices.push(Point::from(middle));
    (vertices, (0..n).map(|k| [k, (k + 1) % n, n]).collect())
}

/// Appends the vertices inside a lid over the loop `rim`, and returns its triangles.
pub(super) fn add(vertices: &mut Vec<Point>, rim: &[u32], lid: &Lid) -> Vec<[u32; 3]> {
    let (boundary, base) = (rim.len() as u32, vertices.len() as u32);
    vertices.extend(&lid.0[rim.len()..]);
    let name = |v: u32| if v < boundary { rim[v as usize] } else { base + v - boundary };
    lid.1.iter().map(|t| t.map(name)).collect()
}
