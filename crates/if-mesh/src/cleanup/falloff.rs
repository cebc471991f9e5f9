//! Moves of a boundary, carried into the surface with a falloff.

use super::edit_mesh::EditMesh;
use super::half_edges::{HalfEdges, NONE, one_ring_into};
use if_core::math::{Point, Real, Vector};

/// Depth of the falloff over the mean move of the loop, at least: where triangles are small beside
/// the teeth of a loop, a few rings would be pressed together.
const DEPTH: Real = 3.0;
/// Maximum number of rings, unless the caller's is larger.
const MAX_RINGS: usize = 12;

/// Carries moves into the surface. Its buffers serve all rounds.
pub(super) struct Falloff<'a> {
    half_edges: &'a HalfEdges,
    /// For each vertex an outgoing half-edge.
    outgoing: &'a [u32],
    /// Vertices that move only as seeds.
    fixed: &'a [bool],
    /// Ring of each vertex: 0 for seeds, [`NONE`] beyond the last ring.
    ring_of: Vec<u32>,
    moves: Vec<Vector>,
}

impl<'a> Falloff<'a> {
    pub(super) fn new(half_edges: &'a HalfEdges, outgoing: &'a [u32], fixed: &'a [bool]) -> Self {
        let vertices = outgoing.len();
        Self {
            half_edges,
            outgoing,
            fixed,
            ring_of: vec![NONE; vertices],
            moves: vec![Vector::zeros(); vertices],
        }
    }

    /// Gives the vertices of at least `rings` rings around `seeds` the mean move of the ring before
    /// them, with a linear falloff. Returns all vertices that move, seeds first.
    pub(super) fn apply(
        &mut self,
        work: &EditMesh,
        target: &mut [Point],
        seeds: &[u32],
        rings: usize,
    ) -> Vec<u32> {
        let (half_edges, outgoing, fixed) = (self.half_edges, self.outgoing, self.fixed);
        let (mut far, mut edge) = (0.0, 0.0);
        for &v in seeds {
            far += (target[v as usize] - work.points[v as usize]).norm();
            edge += work.edge_length_at(half_edges, outgoing[v as usize]);
        }
        let rings = if edge > 0.0 {
            ((DEPTH * far / edge).ceil() as usize).clamp(rings, MAX_RINGS.max(rings))
        } else {
            rings
        };
        for &v in seeds {
            self.ring_of[v as usize] = 0;
            self.moves[v as usize] = target[v as usize] - work.points[v as usize];
        }
        let mut all = seeds.to_vec();
        let mut last = 0;
        let mut near = Vec::new(); // one-ring of a vertex
        for ring in 1..=rings as u32 {
            let mut found: Vec<u32> = Vec::new();
            for v in &all[last..] {
                one_ring_into(&work.triangles, half_edges, outgoing[*v as usize], &mut near);
                for &u in &near {
                    if self.ring_of[u as usize] == NONE && !fixed[u as usize] {
                        self.ring_of[u as usize] = ring;
                        found.push(u);
                    }
                }
            }
            found.sort_unstable();
            let share = 1.0 - Real::from(ring) / (rings as Real + 1.0);
            for &v in &found {
                one_ring_into(&work.triangles, half_edges, outgoing[v as usize], &mut near);
                near.retain(|u| self.ring_of[*u as usize] == ring - 1);
                let sum = near.iter().map(|u| self.moves[*u as usize]).sum::<Vector>();
                let d = sum / near.len().max(1) as Real;
                self.moves[v as usize] = d;
                target[v as usize] = work.points[v as usize] + d * share;
            }
            last = all.len();
            all.extend(found);
        }
        all.iter().for_each(|v| self.ring_of[*v as usize] = NONE);
        all
    }
}
