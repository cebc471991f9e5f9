//! How far along the surface every vertex is from a set of vertices.

use crate::edges::Edges;
use crate::math::{Point, Real};
use crate::rows::Rows;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// The edges of a mesh as neighbours of each vertex, with their lengths.
#[derive(Clone, Debug)]
pub struct Neighbours(Rows<(u32, Real)>);

/// Parts of a mesh, each of the vertices that are nearest to one of some seeds along edges.
#[derive(Clone, Debug)]
pub struct Cells {
    /// The vertices that the parts are around.
    pub seeds: Vec<u32>,
    /// For each vertex the number of its seed.
    pub of: Vec<u32>,
}

impl Neighbours {
    /// Those of `edges` with vertices at `x`.
    ///
    /// # Panics
    ///
    /// If an edge names a vertex that `x` has not.
    pub fn new(edges: &Edges, x: &[Point]) -> Self {
        let both = edges.vertices.iter().flat_map(|&[a, b]| {
            let length = (x[a as usize] - x[b as usize]).norm();
            [(a, (b, length)), (b, (a, length))]
        });
        Self(Rows::new(x.len(), both))
    }

    /// The neighbours of vertex `v`, and how far along the edge they are, in metres.
    pub fn of(&self, v: u32) -> &[(u32, Real)] {
        self.0.of(v as usize)
    }

    /// Length of the shortest path along edges from any of `sources` to every vertex, in metres;
    /// infinite where it is longer than `limit`.
    pub fn distances(&self, sources: impl IntoIterator<Item = u32>, limit: Real) -> Vec<Real> {
        let mut distance = vec![Real::INFINITY; self.0.len()];
        self.spread(sources, limit, &mut distance, |_, _| {});
        distance
    }

    /// The vertices within `limit` metres of `sources` along edges, in ascending order, with their distances. `infinite`
    /// has an infinite number for each vertex, before and after: what is far away costs nothing.
    pub fn within(
        &self,
        sources: impl IntoIterator<Item = u32>,
        limit: Real,
        infinite: &mut [Real],
    ) -> Vec<(u32, Real)> {
        let sources: Vec<u32> = sources.into_iter().collect();
        let mut reached = sources.clone();
        self.spread(sources, limit, infinite, |_, v| reached.push(v));
        reached.sort_unstable();
        reached.dedup();
        let take = |v: u32| (v, std::mem::replace(&mut infinite[v as usize], Real::INFINITY));
        reached.into_iter().map(take).collect()
    }

    /// For every vertex the source that is nearest along edges, and how far it is, in metres: infinite
    /// where that is farther than `limit`.
    pub fn nearest(&self, sources: impl IntoIterator<Item = u32>, limit: Real) -> Vec<(Real, u32)> {
        let mut distance = vec![Real::INFINITY; self.0.len()];
        let mut source: Vec<u32> = (0..self.0.len() as u32).collect();
        let pass = |from: u32, to: u32| source[to as usize] = source[from as usize];
        self.spread(sources, limit, &mut distance, pass);
        distance.into_iter().zip(source).collect()
    }

    /// Shortens distances by paths from `sources`, no longer than `limit`, and tells over which
    /// vertex each vertex was reached, perhaps several times: the last time counts.
    fn spread(
        &self,
        sources: impl IntoIterator<Item = u32>,
        limit: Real,
        distance: &mut [Real],
        mut reached: impl FnMut(u32, u32),
    ) {
        let mut queue = BinaryHeap::new();
        for v in sources {
            distance[v as usize] = 0.0;
            queue.push(Entry(0.0, v));
        }
        while let Some(Entry(d, v)) = queue.pop() {
            if d > distance[v as usize] {
                continue;
            }
            for &(u, length) in self.of(v) {
                let far = d + length;
                if far <= limit && far < distance[u as usize] {
                    distance[u as usize] = far;
                    reached(v, u);
                    queue.push(Entry(far, u));
                }
            }
        }
    }

    /// Cells round seeds: of the vertices in this `order`, those that are farther than `radius` metres
    /// along edges from all seeds before them. `order` has every vertex.
    pub fn cells(&self, order: impl IntoIterator<Item = u32>, radius: Real) -> Cells {
        let mut distance = vec![Real::INFINITY; self.0.len()];
        let mut cells = Cells { seeds: Vec::new(), of: vec![0; self.0.len()] };
        for seed in order {
            if distance[seed as usize].is_finite() {
                continue;
            }
            let cell = cells.seeds.len() as u32;
            cells.seeds.push(seed);
            cells.of[seed as usize] = cell;
            let join = |_, u: u32| cells.of[u as usize] = cell;
            self.spread([seed], radius, &mut distance, join);
        }
        cells
    }

    /// The vertex in the middle of the shortest path along edges; `None` if there is no path.
    pub fn middle_of_path(&self, from: u32, to: u32) -> Option<u32> {
        let mut reached = vec![(Real::INFINITY, from); self.0.len()];
        let mut queue = BinaryHeap::from([Entry(0.0, from)]);
        reached[from as usize].0 = 0.0;
        while let Some(Entry(d, v)) = queue.pop() {
            if v == to {
                break;
            }
            if d > reached[v as usize].0 {
                continue;
            }
            for &(u, length) in self.of(v) {
                if d + length < reached[u as usize].0 {
                    reached[u as usize] = (d + length, v);
                    queue.push(Entry(d + length, u));
                }
            }
        }
        let length = reached[to as usize].0;
        let mut middle = to;
        while length.is_finite() && reached[middle as usize].0 > 0.5 * length {
            middle = reached[middle as usize].1;
        }
        length.is_finite().then_some(middle)
    }
}

/// The nearest first; among equally near ones, the smaller index.
#[derive(PartialEq)]
struct Entry(Real, u32);

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    #[test]
    fn distances_run_along_edges_and_stop_at_the_limit() {
        let x: Vec<Point> =
            (0..6).map(|k| Point::new(f64::from(k / 2), f64::from(k % 2), 0.0)).collect();
        let t = vec![[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]];
        let mesh = TriMesh::new(x.clone(), t).unwrap();
        let near = Neighbours::new(&Edges::new(&mesh), &x);
        let d = near.distances([0], 1.9);
        assert_eq!(&d[..4], &[0.0, 1.0, 1.0, Real::INFINITY]);
        assert_eq!(near.distances([0, 5], 10.0)[5], 0.0);
        let sources: Vec<u32> = near.nearest([0, 5], 1.9).iter().map(|(_, s)| *s).collect();
        assert_eq!(sources, [0, 0, 0, 5, 5, 5]);
        assert_eq!(near.nearest([0], 1.0)[4], (Real::INFINITY, 4));
        assert!(near.distances([], 10.0).iter().all(|d| d.is_infinite()));
        let mut infinite = [Real::INFINITY; 6];
        for (sources, limit) in
            [(vec![0], 1.9), (vec![5, 0], 0.5), (vec![3, 3], 9.0), (vec![], 1.0)]
        {
            let all = near.distances(sources.iter().copied(), limit);
            let far = (0..).zip(all).filter(|(_, d)| d.is_finite());
            assert_eq!(near.within(sources, limit, &mut infinite), far.collect::<Vec<_>>());
            assert!(infinite.iter().all(|d| d.is_infinite()));
        }
        assert_eq!((near.middle_of_path(0, 4), near.middle_of_path(3, 3)), (Some(2), Some(3)));
        let apart = Neighbours::new(&Edges::new(&mesh), &[x, vec![Point::origin()]].concat());
        assert_eq!(apart.middle_of_path(0, 6), None);
    }
}
