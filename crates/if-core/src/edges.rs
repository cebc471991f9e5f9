//! Unique edges, the triangles at edges and vertices, neighbours, and boundary loops.

use crate::mesh::TriMesh;
use crate::rows::Rows;
use crate::union_find::UnionFind;

/// No triangle: the second side of a boundary edge.
pub const NONE: u32 = u32::MAX;

/// The unique edges of a mesh, in order of first appearance, with the triangles that meet there.
#[derive(Clone, Debug, Default)]
pub struct Edges {
    /// The ends of each edge, smaller index first.
    pub vertices: Vec<[u32; 2]>,
    /// The first two triangles at each edge; [`NONE`] if there is no second one.
    pub triangles: Vec<[u32; 2]>,
    /// How many triangles meet at each edge: 1 on a boundary, 2 inside, more where non-manifold.
    pub valence: Vec<u32>,
    /// For each triangle the edges from its corner k to its corner k + 1.
    pub of_triangle: Vec<[u32; 3]>,
}

/// For each vertex the smallest vertex of its connected part. A vertex without a triangle is a part
/// of its own.
pub fn parts(mesh: &TriMesh) -> Vec<u32> {
    let edges = mesh.triangles().iter().flat_map(|t| [[t[0], t[1]], [t[0], t[2]]]);
    parts_by_edges(edges, mesh.vertices().len())
}

/// As [`parts`], for `edges` over `vertex_count` vertices.
///
/// # Panics
///
/// If an edge names a vertex that is not below `vertex_count`.
pub fn parts_by_edges(edges: impl IntoIterator<Item = [u32; 2]>, vertex_count: usize) -> Vec<u32> {
    let mut parts = UnionFind::new(vertex_count);
    edges.into_iter().for_each(|[a, b]| parts.join(a, b));
    parts.into_firsts()
}

/// Number of parts of a mesh ([`parts`]).
pub fn part_count(mesh: &TriMesh) -> usize {
    parts(mesh).into_iter().enumerate().filter(|(v, part)| *v == *part as usize).count()
}

impl Edges {
    /// Collects the edges of `mesh`, in linear time if few edges meet at a vertex.
    pub fn new(mesh: &TriMesh) -> Self {
        let triangles = mesh.triangles();
        let ends = |h: usize| {
            let (a, b) = (triangles[h / 3][h % 3], triangles[h / 3][(h + 1) % 3]);
            (a.min(b), a.max(b))
        };
        // Half-edges by their smaller end: where those of each vertex begin, and, when they are
        // filled in, where they end.
        let mut place = vec![0u32; mesh.vertices().len() + 1];
        (0..3 * triangles.len()).for_each(|h| place[ends(h).0 as usize + 1] += 1);
        (1..place.len()).for_each(|v| place[v] += place[v - 1]);
        let mut half = vec![(0u32, 0u32); 3 * triangles.len()];
        for h in 0..half.len() {
            let (a, b) = ends(h);
            half[place[a as usize] as usize] = (b, h as u32);
            place[a as usize] += 1;
        }
        // Sorted by the larger end, equal edges become neighbours. They are numbered by their first
        // half-edge, so that the order follows the triangles.
        let mut first_of = vec![NONE; half.len()];
        let mut start = 0;
        for end in &place[..mesh.vertices().len()] {
            let of_vertex = &mut half[start..*end as usize];
            of_vertex.sort_unstable();
            for edge in of_vertex.chunk_by(|a, b| a.0 == b.0) {
                edge.iter().for_each(|(_, h)| first_of[*h as usize] = edge[0].1);
            }
            start = *end as usize;
        }
        let mut edges = Self { of_triangle: vec![[NONE; 3]; triangles.len()], ..Self::default() };
        let mut number = vec![NONE; half.len()];
        for h in 0..half.len() {
            let (t, k) = (h / 3, h % 3);
            let first = first_of[h] as usize;
            if first == h {
                let (a, b) = (triangles[t][k], triangles[t][(k + 1) % 3]);
                number[h] = edges.vertices.len() as u32;
                edges.vertices.push([a.min(b), a.max(b)]);
                edges.triangles.push([t as u32, NONE]);
                edges.valence.push(1);
            } else {
                let e = number[first] as usize;
                if edges.valence[e] == 1 {
                    edges.triangles[e][1] = t as u32;
                }
                edges.valence[e] += 1;
            }
            edges.of_triangle[t][k] = number[first];
        }
        edges
    }

    /// Number of unique edges.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are no edges.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// For each edge by how many more triangles run along it from its smaller to its larger vertex than
    /// back: 0 where neighbours wind alike, and everywhere on a closed surface.
    ///
    /// # Panics
    ///
    /// If the edges are not those of `mesh`.
    pub fn balance(&self, mesh: &TriMesh) -> Vec<i32> {
        let mut balance = vec![0; self.len()];
        for (corners, of_triangle) in mesh.triangles().iter().zip(&self.of_triangle) {
            for k in 0..3 {
                let forward = corners[k] < corners[(k + 1) % 3];
                balance[of_triangle[k] as usize] += if forward { 1 } else { -1 };
            }
        }
        balance
    }

    /// For each of `vertex_count` vertices, whether a boundary edge ends there.
    pub fn boundary_vertices(&self, vertex_count: usize) -> Vec<bool> {
        let mut on = vec![false; vertex_count];
        for (e, &[a, b]) in self.vertices.iter().enumerate() {
            if self.valence[e] == 1 {
                on[a as usize] = true;
                on[b as usize] = true;
            }
        }
        on
    }

    /// For each of `vertex_count` vertices, the other ends of its edges, in the order of the edges.
    ///
    /// # Panics
    ///
    /// If an edge names a vertex that is not below `vertex_count`.
    pub fn neighbours(&self, vertex_count: usize) -> Rows<u32> {
        Rows::new(vertex_count, self.vertices.iter().flat_map(|&[a, b]| [(a, b), (b, a)]))
    }

    /// Boundary loops, each as its vertices in the direction of the triangles' winding, the loop of
    /// the smallest first half-edge first. No loop passes a vertex twice: loops that touch in one (a
    /// bow-tie) are closed there. A chain that cannot close (inconsistent winding) stays open.
    pub fn boundary_loops(&self, mesh: &TriMesh) -> Vec<Vec<u32>> {
        let mut next: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices().len()];
        let mut starts = Vec::new();
        for (t, tri) in mesh.triangles().iter().enumerate() {
            for k in 0..3 {
                if self.valence[self.of_triangle[t][k] as usize] == 1 {
                    next[tri[k] as usize].push(tri[(k + 1) % 3]);
                    starts.push(tri[k]);
                }
            }
        }
        for out in &mut next {
            out.reverse(); // popped from the end: first come, first walked
        }
        let mut loops = Vec::new();
        // Position of each vertex in the walk.
        let mut place = vec![NONE; next.len()];
        for start in starts {
            let mut walk = vec![start];
            place[start as usize] = 0;
            while let Some(to) = walk.last().and_then(|at| next[*at as usize].pop()) {
                let been = place[to as usize];
                if been == NONE {
                    place[to as usize] = walk.len() as u32;
                    walk.push(to);
                } else {
                    let closed = walk[been as usize..].to_vec();
                    walk.truncate(been as usize + 1);
                    closed[1..].iter().for_each(|v| place[*v as usize] = NONE);
                    loops.push(closed);
                }
            }
            walk.iter().for_each(|v| place[*v as usize] = NONE);
            if walk.len() > 1 {
                loops.push(walk);
            }
        }
        loops
    }
}

/// For each vertex, the triangles that use it.
#[derive(Clone, Debug, Default)]
pub struct VertexTriangles(Rows<u32>);

impl VertexTriangles {
    /// Collects the triangles at each vertex of `mesh`, in ascending order.
    pub fn new(mesh: &TriMesh) -> Self {
        let corners = mesh.triangles().iter().zip(0_u32..).flat_map(|(tri, t)| tri.map(|v| (v, t)));
        Self(Rows::new(mesh.vertices().len(), corners))
    }

    /// The triangles that use vertex `v`.
    #[inline]
    pub fn of(&self, v: usize) -> &[u32] {
        self.0.of(v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;

    fn grid(n: u32) -> TriMesh {
        let mut v = Vec::new();
        let mut t = Vec::new();
        for y in 0..=n {
            for x in 0..=n {
                v.push(Point::new(x.into(), y.into(), 0.0));
            }
        }
        for y in 0..n {
            for x in 0..n {
                let a = y * (n + 1) + x;
                t.push([a, a + 1, a + n + 2]);
                t.push([a, a + n + 2, a + n + 1]);
            }
        }
        TriMesh::new(v, t).unwrap()
    }

    #[test]
    fn parts_are_identified_by_their_smallest_vertices() {
        let one = grid(2);
        let n = one.vertices().len() as u32;
        let vertices = one
            .vertices()
            .iter()
            .chain(one.vertices())
            .chain(&one.vertices()[..1])
            .copied()
            .collect();
        let shifted = one.triangles().iter().map(|t| t.map(|v| v + n));
        // The second part comes first, and the last vertex has no triangle.
        let both = TriMesh::new(vertices, shifted.chain(one.triangles().iter().copied()).collect())
            .unwrap();
        let expected: Vec<u32> = (0..2 * n).map(|v| v / n * n).chain([2 * n]).collect();
        assert_eq!((parts(&both), part_count(&both), part_count(&one)), (expected, 3, 1));
    }

    #[test]
    fn a_grid_has_the_edges_of_euler_and_one_loop() {
        let mesh = grid(4);
        let edges = Edges::new(&mesh);
        assert_eq!(mesh.vertices().len() + mesh.triangles().len(), edges.len() + 1);
        let loops = edges.boundary_loops(&mesh);
        assert_eq!(loops.len(), 1);
        assert_eq!(loops[0].len(), 16);
        assert_eq!(&loops[0][..3], &[0, 1, 2]);
        assert_eq!(edges.boundary_vertices(25).iter().filter(|b| **b).count(), 16);
    }

    #[test]
    fn two_triangles_that_touch_in_a_vertex_have_two_loops() {
        let v = (0..5).map(|k| Point::new(f64::from(k), f64::from(k * k), 0.0)).collect();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [2, 3, 4]]).unwrap();
        let loops = Edges::new(&mesh).boundary_loops(&mesh);
        assert_eq!(loops, vec![vec![0, 1, 2], vec![2, 3, 4]]);
    }

    #[test]
    fn loops_that_touch_are_closed_apart_in_any_order_of_the_triangles() {
        let v: Vec<Point> =
            (0..6).map(|k| Point::new(f64::from(k), f64::from(k * k), 0.0)).collect();
        let triangles = [[0, 1, 2], [3, 5, 4], [0, 2, 3]];
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mesh = TriMesh::new(v.clone(), order.map(|t| triangles[t]).to_vec()).unwrap();
            let mut loops = Edges::new(&mesh).boundary_loops(&mesh);
            for l in &mut loops {
                let least = (0..l.len()).min_by_key(|k| l[*k]).unwrap();
                l.rotate_left(least);
            }
            loops.sort();
            assert_eq!(loops, vec![vec![0, 1, 2, 3], vec![3, 5, 4]], "{order:?}");
        }
    }

    #[test]
    fn a_fin_is_counted_as_non_manifold() {
        let v = (0..5).map(|k| Point::new(f64::from(k), 0.0, 0.0)).collect();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]).unwrap();
        let edges = Edges::new(&mesh);
        assert_eq!(edges.valence[edges.of_triangle[0][0] as usize], 3);
        assert_eq!(VertexTriangles::new(&mesh).of(1), &[0, 1, 2]);
        assert_eq!(VertexTriangles::new(&mesh).of(4), &[2]);
    }
}
