//! Clips a mesh along the zero line of a function.

use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;

/// Minimum distance of a cut from the ends of an edge, as a part of its length. Nearer cuts leave
/// triangles whose normals are lost to rounding; at ten times more, borders become visibly jagged.
const MARGIN: Real = 0.01;

/// Returns the part of a mesh where a function, given at the vertices and linear on triangles, is
/// negative.
///
/// Triangles that the zero line crosses are split there; neighbours share the new vertices. The
/// vertices that are kept come first, in their order, then the new ones by the edge they lie on.
/// Zero and NaN are outside. The new border passes each of its vertices once.
///
/// # Panics
///
/// If the length of `values` is not the number of vertices, or if a cut edge is longer than a number
/// can be, between coordinates such as ±1.7e308.
///
/// # Examples
///
/// ```
/// use if_core::shapes::meshes::icosphere;
/// let ball = icosphere(1.0, 3);
/// let heights: Vec<f64> = ball.vertices().iter().map(|p| p.y - 0.2).collect();
/// let bowl = if_mesh::marching::clip(&ball, &heights);
/// assert!(bowl.vertices().iter().all(|p| p.y < 0.21));
/// ```
pub fn clip(mesh: &TriMesh, values: &[Real]) -> TriMesh {
    assert_eq!(values.len(), mesh.vertices().len(), "one value for each vertex");
    let inside = |v: u32| values[v as usize] < 0.0;
    let mut pieces = Pieces { mesh, values, cuts: BTreeMap::new() };
    for t in mesh.triangles() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if inside(a) != inside(b) {
                pieces.cuts.insert([a.min(b), a.max(b)], 0);
            }
        }
    }
    let mut used = vec![false; values.len()];
    mesh.triangles().iter().flatten().for_each(|v| used[*v as usize] = inside(*v));
    let mut number = vec![u32::MAX; values.len()];
    let mut vertices = Vec::new();
    for (v, p) in mesh.vertices().iter().enumerate().filter(|(v, _)| used[*v]) {
        number[v] = vertices.len() as u32;
        vertices.push(*p);
    }
    let cuts: Vec<[u32; 2]> = pieces.cuts.keys().copied().collect();
    for [a, b] in cuts {
        pieces.cuts.insert([a, b], vertices.len() as u32);
        vertices.push(pieces.cut_point(a, b));
    }
    let mut triangles = Vec::new();
    for t in mesh.triangles() {
        // Rotated so that corner 0 is the one on the other side.
        let odd = |k: &usize| {
            inside(t[*k]) != inside(t[(k + 1) % 3]) && inside(t[*k]) != inside(t[(k + 2) % 3])
        };
        let Some(k) = (0..3).find(odd) else {
            if inside(t[0]) {
                triangles.push(t.map(|v| number[v as usize]));
            }
            continue;
        };
        let [a, b, c] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
        let (ab, ca) = (pieces.cut(a, b), pieces.cut(c, a));
        if inside(a) {
            triangles.push([number[a as usize], ab, ca]);
        } else {
            let (b, c) = (number[b as usize], number[c as usize]);
            let length =
                |i: u32, j: u32| (vertices[i as usize] - vertices[j as usize]).norm_squared();
            if length(ab, c) <= length(b, ca) {
                triangles.extend([[ab, b, c], [ab, c, ca]]);
            } else {
                triangles.extend([[ab, b, ca], [b, c, ca]]);
            }
        }
    }
    TriMesh::new(vertices, triangles)
        .expect("points between finite points are finite, and pieces have three corners")
}

struct Pieces<'a> {
    mesh: &'a TriMesh,
    values: &'a [Real],
    cuts: BTreeMap<[u32; 2], u32>,
}

impl Pieces<'_> {
    fn cut(&self, a: u32, b: u32) -> u32 {
        self.cuts[&[a.min(b), a.max(b)]]
    }

    fn cut_point(&self, a: u32, b: u32) -> Point {
        let (va, vb) = (self.values[a as usize], self.values[b as usize]);
        let t = va / (va - vb);
        let t = if t.is_finite() { t.clamp(MARGIN, 1.0 - MARGIN) } else { 0.5 };
        let (pa, pb) = (self.mesh.vertices()[a as usize], self.mesh.vertices()[b as usize]);
        pa + (pb - pa) * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::edges::{Edges, VertexTriangles};
    use if_core::random::SplitMix64;
    use if_core::shapes::meshes::icosphere;

    /// Every border vertex has two border edges and one fan of triangles.
    fn assert_manifold(mesh: &TriMesh) {
        let edges = Edges::new(mesh);
        assert!(edges.valence.iter().all(|v| *v <= 2));
        let mut ends = vec![0; mesh.vertices().len()];
        for (e, pair) in edges.vertices.iter().enumerate() {
            if edges.valence[e] == 1 {
                pair.iter().for_each(|v| ends[*v as usize] += 1);
            }
        }
        assert!(ends.iter().all(|n| *n == 0 || *n == 2));
        let fans = VertexTriangles::new(mesh);
        assert!((0..mesh.vertices().len()).all(|v| !fans.of(v).is_empty()));
    }

    #[test]
    fn a_ball_cut_at_a_height_is_a_bowl_with_one_border_at_that_height() {
        let ball = icosphere(1.0, 4);
        // One of the heights meets vertices exactly.
        for height in [-0.73, 0.0, 0.2, ball.vertices()[100].y] {
            let values: Vec<Real> = ball.vertices().iter().map(|p| p.y - height).collect();
            let bowl = clip(&ball, &values);
            assert_manifold(&bowl);
            let loops = Edges::new(&bowl).boundary_loops(&bowl);
            assert_eq!(loops.len(), 1, "height {height}");
            assert!(
                loops[0]
                    .iter()
                    .all(|v| (bowl.vertices()[*v as usize].y - height).abs() < 0.01 * 0.1)
            );
            // Zone of a sphere; the chords of 5120 triangles lose about 0.4 %.
            approx::assert_relative_eq!(
                bowl.area(),
                std::f64::consts::TAU * (1.0 + height),
                max_relative = 8e-3
            );
            assert!(
                bowl.face_normals()
                    .iter()
                    .enumerate()
                    .all(|(t, n)| n.dot(&bowl.corners(t)[0].coords) > 0.0)
            );
        }
    }

    #[test]
    fn any_signs_at_the_vertices_give_borders_that_pass_each_vertex_once() {
        let ball = icosphere(1.0, 3);
        let mut random = SplitMix64::new(9);
        for _ in 0..20 {
            let values: Vec<Real> =
                ball.vertices().iter().map(|_| random.below(16) as Real - 7.5).collect();
            assert_manifold(&clip(&ball, &values));
        }
    }

    #[test]
    fn a_mesh_that_is_all_inside_is_unchanged_and_one_all_outside_is_empty() {
        let ball = icosphere(1.0, 1);
        assert_eq!(clip(&ball, &vec![-1.0; 42]), ball);
        assert_eq!(clip(&ball, &vec![0.0; 42]), TriMesh::default());
        assert_eq!(clip(&ball, &vec![Real::NAN; 42]), TriMesh::default());
        assert_eq!(clip(&TriMesh::default(), &[]), TriMesh::default());
    }
}
