//! Seams whose sides nearly coincide, as rounding and merging of files leave them.

use super::{coincident_vertices, without_needles};
use if_core::edges::Edges;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::union_find::UnionFind;
use std::collections::HashMap;

/// Size of the cells of the search, in distances: few vertices have to be searched in more than one, and few
/// lie in one.
const CELL: Real = 4.0;

/// The seams of a mesh whose sides are near one another, and not at the same positions ([`near_seams`]).
#[derive(Clone, Debug, PartialEq)]
pub struct NearSeams {
    /// Number of boundary edges that lie near others.
    pub edges: usize,
    /// The ends of such edges that lie near an earlier vertex, with it.
    pub pairs: Vec<[u32; 2]>,
}

impl NearSeams {
    /// The largest distance of two vertices that belong together, in metres.
    pub fn widest(&self, positions: &[Point]) -> Real {
        let apart = |[v, at]: &[u32; 2]| positions[*v as usize] - positions[*at as usize];
        self.pairs.iter().map(|pair| apart(pair).norm()).fold(0.0, Real::max)
    }

    /// `positions` with those of vertices that belong together made equal.
    pub fn closed(&self, positions: &[Point]) -> Vec<Point> {
        let mut closed = positions.to_vec();
        for [v, at] in &self.pairs {
            closed[*v as usize] = positions[*at as usize];
        }
        closed
    }
}

/// Finds boundary edges both ends of which lie within `distance` metres of those of another one; `None` if
/// there is none but those at the same positions, which [`weld`](super::weld) closes. No two corners of a
/// triangle belong together. `edges` are those of the mesh.
pub fn near_seams(mesh: &TriMesh, edges: &Edges, distance: Real) -> Option<NearSeams> {
    let border: Vec<[u32; 2]> = (edges.vertices.iter().zip(&edges.valence))
        .filter(|(_, valence)| **valence == 1)
        .map(|(edge, _)| *edge)
        .collect();
    let first = groups(mesh, &border, distance)?;
    let key = |edge: &[u32; 2]| {
        let [a, b] = edge.map(|v| first[v as usize]);
        [a.min(b), a.max(b)]
    };
    let mut sorted = border;
    sorted.sort_unstable_by_key(|edge| (key(edge), *edge));
    let same = |v: &u32| {
        let at = first[*v as usize];
        at == *v || mesh.vertices()[at as usize] == mesh.vertices()[*v as usize]
    };
    let (mut count, mut ends) = (0, Vec::new());
    for run in sorted.chunk_by(|a, b| key(a) == key(b)).filter(|run| run.len() > 1) {
        if !run.as_flattened().iter().all(same) {
            count += run.len();
            ends.extend(run.as_flattened().iter().filter(|v| first[**v as usize] != **v));
        }
    }
    ends.sort_unstable();
    ends.dedup();
    let pairs = ends.iter().map(|v: &u32| [*v, first[*v as usize]]).collect();
    (count > 0).then_some(NearSeams { edges: count, pairs })
}

/// For each vertex the first of those of the border that lie within a distance of one another; `None` if
/// none does but those at the same position.
fn groups(mesh: &TriMesh, border: &[[u32; 2]], distance: Real) -> Option<Vec<u32>> {
    let x = mesh.vertices();
    let mut vertices = border.as_flattened().to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    let places: Vec<Point> = vertices.iter().map(|v| x[*v as usize]).collect();
    let exact = coincident_vertices(&places);
    let first = |k: u32| exact.as_ref().map_or(k, |first| first[k as usize]);
    let mut joined = UnionFind::new(x.len());
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let cell = |x: Real| (x / (CELL * distance)).floor() as i64;
    let mut is_any = false;
    for (k, v) in (0u32..).zip(&vertices) {
        if first(k) != k {
            joined.join(*v, vertices[first(k) as usize]);
            continue;
        }
        let p = x[*v as usize];
        let [low, high] = [-distance, distance].map(|by| [0, 1, 2].map(|k: usize| cell(p[k] + by)));
        for i in low[0]..=high[0] {
            for j in low[1]..=high[1] {
                for l in low[2]..=high[2] {
                    for u in cells.get(&[i, j, l]).into_iter().flatten() {
                        if (x[*u as usize] - p).norm_squared() <= distance * distance {
                            joined.join(*u, *v);
                            is_any = true;
                        }
                    }
                }
            }
        }
        cells.entry([0, 1, 2].map(|k: usize| cell(p[k]))).or_default().push(*v);
    }
    if !is_any {
        return None;
    }
    let separate: Vec<u32> = (0..x.len() as u32).collect();
    Some(without_needles(mesh, joined.into_firsts(), &separate))
}

#[cfg(test)]
mod tests {
    use super::super::{weld, weld_all};
    use super::*;
    use if_core::math::Vector;
    use if_core::random::SplitMix64;
    use if_core::shapes::meshes::tube;

    fn near_seams(mesh: &TriMesh, distance: Real) -> Option<NearSeams> {
        super::near_seams(mesh, &Edges::new(mesh), distance)
    }

    /// A tube whose triangles in the upper half have vertices of their own, each off by up to `noise`.
    fn halves(noise: Real) -> TriMesh {
        let whole = tube(0.1, 0.4, 24, 8, false);
        let n = whole.vertices().len() as u32;
        let is_upper = |t: &[u32; 3]| t.iter().all(|v| whole.vertices()[*v as usize].y > 0.199);
        let moved = |t: &[u32; 3]| if is_upper(t) { t.map(|v| v + n) } else { *t };
        let mut random = SplitMix64::new(4);
        let mut off = |p: &Point| p + Vector::from([0; 3].map(|_| noise * (random.unit() - 0.5)));
        let upper = whole.vertices().iter().map(&mut off);
        let vertices = whole.vertices().iter().copied().chain(upper).collect();
        TriMesh::new(vertices, whole.triangles().iter().map(moved).collect()).unwrap()
    }

    #[test]
    fn sides_that_differ_by_rounding_are_found_and_closed() {
        let mesh = halves(1e-6);
        assert_eq!(weld(&mesh).map_or(0, |welded| welded.edges), 0);
        let found = near_seams(&mesh, 1e-5).unwrap();
        assert_eq!((found.edges, found.pairs.len()), (48, 24));
        let widest = found.widest(mesh.vertices());
        assert!(widest > 2e-7 && widest < 2e-6, "{widest}");
        let closed = mesh.with_vertices(found.closed(mesh.vertices())).unwrap();
        assert_eq!(weld(&closed).unwrap().edges, 24);
        assert_eq!(near_seams(&closed, 1e-5), None);
        assert_eq!(near_seams(&mesh, 1e-8), None);
    }

    #[test]
    fn seams_at_the_same_positions_and_hems_that_only_touch_are_left() {
        assert_eq!(near_seams(&halves(0.0), 1e-5), None);
        assert_eq!(near_seams(&tube(0.1, 0.4, 24, 8, false), 1e-5), None);
        // Two triangles whose corners meet in one vertex.
        let at = |x: Real, y: Real| Point::new(x, y, 0.0);
        let v = vec![
            at(0.0, 0.0),
            at(1.0, 0.0),
            at(0.0, 1.0),
            at(1e-6, 0.0),
            at(-1.0, 0.0),
            at(0.0, -1.0),
        ];
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        assert_eq!(near_seams(&mesh, 1e-5), None);
    }

    #[test]
    fn corners_of_a_triangle_stay_apart() {
        // An edge of the triangle at the seam is shorter than the distance.
        let at = |x: Real, y: Real| Point::new(x, y, 0.0);
        let v = vec![
            at(0.0, 0.0),
            at(1e-6, 0.0),
            at(0.0, 1.0),
            at(0.0, -1.0),
            at(0.0, 1e-6),
            at(1e-6, 1e-6),
        ];
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 5, 4]]).unwrap();
        assert_eq!(near_seams(&mesh, 1e-5), None);
        assert_eq!(weld_all(&mesh), None);
    }
}
