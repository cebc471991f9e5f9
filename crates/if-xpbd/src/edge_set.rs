//! Edges with rest lengths, checked once and laid out for sweeping, for stretch and strain limits.

use crate::coloring::color;
use if_core::edges::Edges;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use std::ops::Range;

/// Edges in the order of visiting, as a structure of arrays.
#[derive(Clone, Debug, Default)]
pub struct EdgeSet {
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    pub(crate) rest: Vec<Real>,
    /// Index of each edge in the list given.
    pub(crate) given: Vec<u32>,
    pub(crate) colors: Vec<Range<usize>>,
    vertex_count: usize,
}

/// Why edges and rest lengths are invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EdgeSetError {
    /// There is not one rest length for each edge.
    #[error("{edges} edges but {rests} rest lengths; give one for each edge")]
    Count {
        /// Edges given.
        edges: usize,
        /// Rest lengths given.
        rests: usize,
    },
    /// An end does not exist.
    #[error(
        "edge {edge} names vertex {vertex}, but there are only {vertices} vertices (0 is the first)"
    )]
    IndexOutOfRange {
        /// Index of the edge.
        edge: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// Both ends are one vertex.
    #[error("edge {edge} joins vertex {vertex} to itself; drop it")]
    SelfLoop {
        /// Index of the edge.
        edge: usize,
        /// The vertex.
        vertex: u32,
    },
    /// A rest length is negative, NaN or infinite.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

impl EdgeSet {
    /// Checks, colours and sorts `edges` with their `rests` (metres) over `vertex_count` vertices.
    ///
    /// # Errors
    ///
    /// The first fault found.
    pub fn new(
        edges: &[[u32; 2]],
        rests: &[Real],
        vertex_count: usize,
    ) -> Result<Self, EdgeSetError> {
        if edges.len() != rests.len() {
            return Err(EdgeSetError::Count { edges: edges.len(), rests: rests.len() });
        }
        for (edge, (&[a, b], &value)) in edges.iter().zip(rests).enumerate() {
            for vertex in [a, b] {
                if vertex as usize >= vertex_count {
                    return Err(EdgeSetError::IndexOutOfRange {
                        edge,
                        vertex,
                        vertices: vertex_count,
                    });
                }
            }
            if a == b {
                return Err(EdgeSetError::SelfLoop { edge, vertex: a });
            }
            let ok = value.is_finite() && value >= 0.0;
            ParameterError::check("rest_length", value, ok, "finite and at least 0 (metres)")
                .map_err(|e| e.at(edge))?;
        }
        let coloring = color(edges, vertex_count);
        let pick = |k: &u32| edges[*k as usize];
        Ok(Self {
            a: coloring.order.iter().map(|k| pick(k)[0]).collect(),
            b: coloring.order.iter().map(|k| pick(k)[1]).collect(),
            rest: coloring.order.iter().map(|k| rests[*k as usize]).collect(),
            colors: coloring.ranges().collect(),
            given: coloring.order,
            vertex_count,
        })
    }

    /// The edges of `mesh`, at rest where the mesh now is.
    pub fn of_mesh(mesh: &TriMesh) -> Self {
        let edges = Edges::new(mesh).vertices;
        let rests: Vec<Real> = edges.iter().map(|e| length(mesh.vertices(), e)).collect();
        Self::new(&edges, &rests, mesh.vertices().len())
            .expect("a checked mesh has sound edges of finite length")
    }

    /// The edges with a movable end (inverse mass not 0), in the same order of visiting. A sweep over
    /// them gives the same bits as a sweep over all edges. They count as given in the order in which
    /// they were given here.
    ///
    /// # Panics
    ///
    /// If there are fewer inverse masses than [`EdgeSet::vertex_count`].
    pub fn movable(&self, inverse_masses: &[Real]) -> Self {
        let mut part = Self { vertex_count: self.vertex_count, ..Self::default() };
        let can_move = |k: usize| {
            inverse_masses[self.a[k] as usize] != 0.0 || inverse_masses[self.b[k] as usize] != 0.0
        };
        for range in &self.colors {
            let start = part.len();
            for k in range.clone() {
                if can_move(k) {
                    part.a.push(self.a[k]);
                    part.b.push(self.b[k]);
                    part.rest.push(self.rest[k]);
                    part.given.push(self.given[k]);
                }
            }
            if part.len() > start {
                part.colors.push(start..part.len());
            }
        }
        part
    }

    /// Number of edges.
    pub fn len(&self) -> usize {
        self.a.len()
    }

    /// Whether there are no edges.
    pub fn is_empty(&self) -> bool {
        self.a.is_empty()
    }

    /// Number of particles that the edges index.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// The edges in the order in which a sweep visits them: ends, and rest length in metres.
    pub fn visited(&self) -> impl Iterator<Item = ([u32; 2], Real)> + '_ {
        (0..self.len()).map(|k| ([self.a[k], self.b[k]], self.rest[k]))
    }

    /// Relative elongations `|pᵢ − pⱼ|/ℓ − 1` in the order in which the edges were given; 0 where ℓ
    /// = 0.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than [`EdgeSet::vertex_count`].
    pub fn strains(&self, positions: &[Point]) -> Vec<Real> {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_unstable_by_key(|k| self.given[*k]);
        let strain = |k: usize| {
            let rest = self.rest[k];
            if rest > 0.0 { length(positions, &[self.a[k], self.b[k]]) / rest - 1.0 } else { 0.0 }
        };
        order.into_iter().map(strain).collect()
    }
}

fn length(positions: &[Point], e: &[u32; 2]) -> Real {
    // Halved and doubled, so that two ends 1e308 apart do not give an infinite length.
    let half = positions[e[0] as usize].coords * 0.5 - positions[e[1] as usize].coords * 0.5;
    let length = 2.0 * half.norm();
    if length.is_finite() {
        return length;
    }
    // Scaled, so that squares do not overflow; at most the largest number.
    let most = half.amax();
    (2.0 * most * (half / most).norm()).min(Real::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_edge() {
        use EdgeSetError::*;
        assert!(matches!(EdgeSet::new(&[[0, 1]], &[], 2), Err(Count { edges: 1, rests: 0 })));
        assert!(matches!(
            EdgeSet::new(&[[0, 2]], &[1.0], 2),
            Err(IndexOutOfRange { edge: 0, vertex: 2, vertices: 2 })
        ));
        assert!(matches!(
            EdgeSet::new(&[[0, 1], [1, 1]], &[1.0; 2], 2),
            Err(SelfLoop { edge: 1, vertex: 1 })
        ));
        for bad in [-1.0, Real::NAN, Real::INFINITY] {
            let error = EdgeSet::new(&[[0, 1]], &[bad], 2).unwrap_err();
            assert!(matches!(error, Parameter(e) if e.name == "rest_length[0]"));
        }
        assert!(EdgeSet::new(&[], &[], 0).unwrap().is_empty());
    }

    #[test]
    fn edges_have_finite_lengths_however_far_their_ends_are() {
        for far in [1e-200, 1.0, 1e155, 1e308] {
            let x = vec![
                Point::new(-far, 0.0, 0.0),
                Point::new(far, 0.0, 0.0),
                Point::new(0.0, 0.0, 0.0),
            ];
            let edges = EdgeSet::of_mesh(&TriMesh::new(x, vec![[0, 1, 2]]).unwrap());
            let longest = edges.rest.iter().copied().fold(0.0, Real::max);
            assert!(
                longest.is_finite() && (far < 1e-100 || longest >= 1.9 * far.min(8e307)),
                "{far}: {longest}"
            );
        }
    }

    #[test]
    fn sweeps_over_movable_edges_give_the_bits_of_sweeps_over_all() {
        use crate::constraint::Constraint;
        use crate::strain_limit::StrainLimit;
        use crate::stretch::Stretch;
        let mesh = if_core::shapes::meshes::cloth(0.3, 0.2, 13, 9);
        let start: Vec<Point> = mesh
            .vertices()
            .iter()
            .enumerate()
            .map(|(k, p)| Point::new(1.2 * p.x, 0.8 * p.y, 0.01 * (k as Real).sin()))
            .collect();
        let all = EdgeSet::of_mesh(&mesh);
        for free in [0, 1, 17, 60, start.len()] {
            let w: Vec<Real> = (0..start.len())
                .map(|k| Real::from(u8::from(k * 7 % start.len() < free)))
                .collect();
            let part = all.movable(&w);
            assert!(part.len() <= all.len() && part.is_empty() == (free == 0));
            let run = |edges: &EdgeSet| {
                let mut x = start.clone();
                let mut stretch = Stretch::new(edges.clone(), 0.3).unwrap();
                let mut limit = StrainLimit::new(edges.clone(), 0.9, 1.1).unwrap();
                for _ in 0..5 {
                    stretch.begin_substep(&start, &x, &w, 1.0);
                    stretch.project(&mut x, &w, 1.0);
                    limit.project(&mut x, &w, 1.0);
                }
                x
            };
            assert_eq!(run(&part), run(&all));
            assert_eq!(free == 0, run(&all) == start);
        }
    }

    #[test]
    fn strains_come_in_the_order_of_the_edges_given() {
        let p = vec![Point::origin(), Point::new(2.0, 0.0, 0.0), Point::new(2.0, 3.0, 0.0)];
        let set = EdgeSet::new(&[[1, 2], [0, 1], [0, 2]], &[2.0, 2.0, 0.0], 3).unwrap();
        assert_eq!(set.strains(&p), vec![0.5, 0.0, 0.0]);
        assert_eq!(set.colors.len(), 3);
        // A part has those of its edges, in their order.
        let mesh = if_core::shapes::meshes::cloth(0.3, 0.2, 13, 9);
        let all = EdgeSet::of_mesh(&mesh);
        let bent: Vec<Point> = mesh
            .vertices()
            .iter()
            .enumerate()
            .map(|(k, p)| Point::new(p.x, p.y, 0.01 * (k as Real).sin()))
            .collect();
        let w: Vec<Real> = (0..bent.len()).map(|k| Real::from(u8::from(k % 3 == 0))).collect();
        let edges = if_core::edges::Edges::new(&mesh).vertices;
        let of_all = all.strains(&bent).into_iter().zip(edges);
        let expected: Vec<Real> = of_all
            .filter(|(_, e)| e.iter().any(|v| w[*v as usize] > 0.0))
            .map(|(strain, _)| strain)
            .collect();
        assert_eq!(all.movable(&w).strains(&bent), expected);
    }
}
