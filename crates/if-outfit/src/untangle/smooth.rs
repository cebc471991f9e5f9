//! Folds that no way takes apart: the cloth round them is laid smooth.
//!
//! Where cloth meets itself within a few edges, as at a crotch made for other legs, it has more
//! surface than room: neither sheet has a side on which it would lie apart. There each vertex goes
//! towards the mean of its neighbours, weighted by 1 / length at rest so that lengths along a line
//! keep their proportions, with the cloth around fixed. Of regions of several sizes and
//! of few to many steps the one counts that leaves the fewest pairs, then the least strain; not one
//! that lays two vertices on each other, or shrinks what moves to next to nothing, as it does what no
//! fixed cloth holds.

use super::patch::{Outcome, Patch};
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::monitor::Cancelled;
use if_mesh::index::Bvh;

/// Rings of vertices round the corners of intersecting triangles that move.
const RINGS: [usize; 4] = [1, 2, 4, 8];
/// Steps after which pairs are counted. With 400 a region of eight rings is a membrane.
const STEPS: [usize; 6] = [4, 10, 25, 60, 150, 400];
/// Lengths at rest, in metres, that shorter ones count as.
const SHORTEST: Real = 1e-5;
/// Share of its area at rest that what moves keeps at least: cloth that lies in four layers may be laid flat.
const LEAST_AREA: Real = 0.25;

impl Patch<'_> {
    /// The best state of `from`, as it is or with the cloth round its pairs laid smooth.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] by `poll`.
    pub(super) fn smoothed(
        &self,
        from: Outcome,
        poll: &mut dyn FnMut() -> Result<(), Cancelled>,
    ) -> Result<Outcome, Cancelled> {
        let neighbours = self.edges.neighbours(from.positions.len());
        let on_border = self.edges.boundary_vertices(from.positions.len());
        // A border stays one: its vertices look along it.
        let counts = |v: u32, n: u32| !on_border[v as usize] || on_border[n as usize];
        let rest = self.mesh.vertices();
        let weighted = |v: u32| -> Vec<(u32, Real)> {
            let around = neighbours.of(v as usize).iter().filter(|n| counts(v, **n));
            let weight = |n: u32| 1.0 / (rest[n as usize] - rest[v as usize]).norm().max(SHORTEST);
            around.map(|n| (*n, weight(*n))).collect()
        };
        let corners = |pair: &[u32; 2]| pair.map(|t| self.mesh.triangles()[t as usize]);
        let met = from.pairs.iter().flat_map(corners).flatten();
        let mut moves = vec![false; from.positions.len()];
        met.for_each(|v| moves[v as usize] = true);
        let mut tree = Bvh::new(&self.at(&from.positions));
        let (start, rounds) = (from.positions.clone(), from.rounds);
        let apart = places(&start);
        let (mut best, mut grown) = (from, 0);
        for rings in RINGS {
            while grown < rings {
                let before = moves.clone();
                let near = (0..moves.len()).filter(|v| before[*v]);
                near.flat_map(|v| neighbours.of(v)).for_each(|n| moves[*n as usize] = true);
                grown += 1;
            }
            let free = (0..moves.len() as u32).filter(|v| moves[*v as usize] && self.is_free(*v));
            let free: Vec<(u32, Vec<(u32, Real)>)> = free.map(|v| (v, weighted(v))).collect();
            let of_free = |t: &&[u32; 3]| t.iter().any(|v| moves[*v as usize] && self.is_free(*v));
            let moving: Vec<[u32; 3]> =
                self.mesh.triangles().iter().filter(of_free).copied().collect();
            let least_area = LEAST_AREA * area(&moving, rest);
            let (mut x, mut done) = (start.clone(), 0);
            for steps in STEPS {
                poll()?;
                for _ in done..steps {
                    for (v, around) in free.iter().filter(|(_, around)| !around.is_empty()) {
                        let (mut sum, mut whole) = (Vector::zeros(), 0.0);
                        for (n, weight) in around {
                            sum += x[*n as usize].coords * *weight;
                            whole += weight;
                        }
                        x[*v as usize] = Point::from(sum / whole);
                    }
                }
                done = steps;
                let now = self.stored_outcome(&x, &mut tree, rounds);
                // What shrinks to a point or a line meets nothing, but is no cloth any more, and
                // further steps do not bring it back.
                if places(&now.positions) < apart || area(&moving, &now.positions) < least_area {
                    break;
                }
                let is_clean = now.pairs.is_empty();
                if now.rank() < best.rank() {
                    best = now;
                }
                if is_clean {
                    break;
                }
            }
        }
        Ok(best)
    }
}

/// The area of some triangles.
fn area(triangles: &[[u32; 3]], x: &[Point]) -> Real {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| x[v as usize]);
        area_vector(&a, &b, &c).norm()
    };
    triangles.iter().map(of).sum()
}

/// The number of different positions.
fn places(x: &[Point]) -> usize {
    let bits = |p: &Point| [0, 1, 2].map(|k| (p[k] + 0.0).to_bits());
    let mut all: Vec<[u64; 3]> = x.iter().map(bits).collect();
    all.sort_unstable();
    all.dedup();
    all.len()
}
