//! Untangling: intersections of a garment with itself are removed before it settles over others.
//!
//! ```text
//! for neighbourhoods of growing size
//!     find the contours along which sheets pass through one another            contours.rs
//!     for each group of contours whose neighbourhoods overlap                  patch.rs
//!         for the way apart that the contours suggest, then for others
//!             repeat: planes that separate the pairs along the way; cloth; verify exactly
//!             until no pair is left; then the cloth relaxes, held apart
//!         where pairs are left, the cloth round them is laid smooth                smooth.rs
//!         keep the result if the garment has no pair that it did not have, and fewer, and the
//!         cloth is neither moved nor strained much                                 cost.rs
//! after all garments have settled, once more for pairs that are left           settled.rs
//! ```
//!
//! The cloth's lengths at rest are those of the input, and only the neighbourhood of pairs moves.

mod contours;
mod cost;
mod kept;
mod patch;
mod settled;
mod smooth;

pub(crate) use kept::kept;
pub(crate) use settled::untangle_settled;

use crate::findings::new_pairs;
use crate::outfit::Layer;
use crate::params::ResolveParams;
use contours::{Contour, Way};
use if_core::edges::{Edges, VertexTriangles};
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use if_mesh::index::Bvh;
use if_mesh::intersections::{
    Fans, MovedTriangles, TrianglePair, own_pairs_after_motion, own_pairs_with,
};
use patch::{Outcome, Patch};
use std::collections::BTreeSet;

/// Neighbourhoods that are tried one after another, relative to `repair_influence`.
const REACHES: [Real; 3] = [1.0, 2.0, 3.0];
/// Maximum number of ways that are tried for a group of contours, beside one for each contour.
const TRIES: usize = 12;
/// Maximum work for a garment, in rounds times free vertices, and pairs held apart where these are far more: bounds
/// the time for garments that are tangled all over, a second or two. The garments of the test data take less than half
/// of it.
const WORK: usize = 300_000;
/// Maximum vertices of a garment times groups of contours that are tried: bounds the time for those with very
/// many, as of sequins. A garment of 10,000 vertices may have 10,000 groups.
const VISITS: usize = 100_000_000;
/// Other ways that are tried for each contour of a patch that is clean, but strained.
const OTHERS: usize = 3;
/// Largest share of a garment that counts as cut off by a contour.
const CUT_OFF: Real = 0.1;

/// A garment with fewer own pairs.
pub(crate) struct Untangled {
    /// As they are stored.
    pub(crate) positions: Vec<Point>,
    /// Own pairs that are left, sorted.
    pub(crate) pairs: Vec<[u32; 2]>,
    /// Rounds made.
    pub(crate) rounds: usize,
}

/// Removes own pairs of `garment` with its vertices at `start`, which are rounded to its storage.
/// `None` if no state was found that has fewer pairs, none of them new, and that is `accepted`.
/// `costly` receives pairs that come apart only where the cloth is moved or strained
/// [too much](Patch::is_affordable); groups of pairs that it has are not tried.
///
/// # Errors
///
/// [`Cancelled`] from `report`, which receives the pairs of the garment before each round.
pub(crate) fn untangle(
    garment: &Layer,
    start: &[Point],
    params: &ResolveParams,
    costly: &mut BTreeSet<[u32; 2]>,
    accepted: &mut dyn FnMut(&[Point]) -> bool,
    report: &mut dyn FnMut(usize) -> Result<(), Cancelled>,
) -> Result<Option<Untangled>, Cancelled> {
    let rest = &garment.mesh;
    let edges = Edges::new(rest);
    let neighbours = Neighbours::new(&edges, rest.vertices());
    let mut surroundings = Surroundings::new(rest, &neighbours);
    let mut mesh = rest.with_vertices(start.to_vec()).expect("positions of a mesh");
    let (mut tree, fans) = (Bvh::new(&mesh), Fans::new(&mesh));
    let mut found = own_pairs_with(&mesh, &tree, &fans);
    let mut pairs = triangles_of(&found);
    let (given, mut rounds, mut work, mut visits) = (pairs.len(), 0, WORK, VISITS);
    let known = costly.clone();
    for reach in REACHES.map(|r| r * params.effort.repair_influence) {
        if pairs.is_empty() {
            break;
        }
        let contours = Contour::all(&mesh, &edges, &pairs);
        for sources in groups(&mesh, &contours, &mut surroundings, reach) {
            report(pairs.len())?;
            let Some(rest) = visits.checked_sub(mesh.vertices().len()) else { break };
            visits = rest;
            if !known.is_empty() && is_within(&mesh, &sources, &pairs, &known) {
                continue;
            }
            let near = surroundings.of(sources.iter().copied(), reach);
            let near = (&near[..], &surroundings.triangles, &tree);
            let patch = Patch::new(garment, mesh.vertices(), reach, near, params);
            let start = patch.positions(mesh.vertices());
            let poll = &mut || report(pairs.len());
            // One group that does not come apart leaves work for the others.
            let (share, mut left) = (work.div_ceil(2), work.div_ceil(2));
            let mut outcomes = vec![best_way(&patch, &start, &mut left, poll)?];
            work -= share - left;
            if !outcomes[0].pairs.is_empty() {
                outcomes.insert(0, patch.smoothed(outcomes[0].clone(), poll)?);
            }
            rounds += outcomes[0].rounds;
            // Laid smooth, or as far as the sheets came apart without.
            for outcome in outcomes {
                let mut x = mesh.vertices().to_vec();
                patch.write(&outcome.positions, &mut x);
                let next = mesh.with_vertices(x).expect("the solver keeps positions finite");
                tree.refit(next.vertices());
                let moved = mesh.vertices().iter().zip(next.vertices()).map(|(a, b)| a != b);
                let moved = MovedTriangles::new(&next, &moved.collect::<Vec<_>>());
                let found_next = own_pairs_after_motion(&next, &tree, &fans, &moved, &found);
                let left = triangles_of(&found_next);
                if left.len() < pairs.len() && new_pairs(&left, &pairs).is_empty() {
                    if !patch.is_affordable(&start, &outcome) {
                        costly.extend(new_pairs(&pairs, &left));
                    } else if accepted(next.vertices()) {
                        (mesh, pairs, found) = (next, left, found_next);
                        break;
                    }
                }
                tree.refit(mesh.vertices());
            }
        }
    }
    tracing::debug!(garment = garment.name, given, left = pairs.len(), rounds, work, "untangled");
    let positions = mesh.vertices().to_vec();
    Ok((pairs.len() < given).then_some(Untangled { positions, pairs, rounds }))
}

/// What lies round vertices of a garment, found without a look at all the others.
struct Surroundings<'a> {
    neighbours: &'a Neighbours,
    triangles: VertexTriangles,
    /// For [`Neighbours::within`].
    infinite: Vec<Real>,
}

impl<'a> Surroundings<'a> {
    fn new(mesh: &TriMesh, neighbours: &'a Neighbours) -> Self {
        let infinite = vec![Real::INFINITY; mesh.vertices().len()];
        Self { neighbours, triangles: VertexTriangles::new(mesh), infinite }
    }

    /// The vertices within `reach` metres of `sources` along edges, ascending, and how far they are.
    fn of(&mut self, sources: impl IntoIterator<Item = u32>, reach: Real) -> Vec<(u32, Real)> {
        self.neighbours.within(sources, reach, &mut self.infinite)
    }
}

/// The vertices of contours whose neighbourhoods overlap, group by group.
fn groups(
    mesh: &TriMesh,
    contours: &[Contour],
    surroundings: &mut Surroundings<'_>,
    reach: Real,
) -> Vec<BTreeSet<u32>> {
    // For each vertex the first contour near it; for each contour one that its group has, which leads on
    // to the last; and the sources of each group, by its last contour.
    let mut first_near: Vec<Option<usize>> = vec![None; mesh.vertices().len()];
    let mut last: Vec<usize> = (0..contours.len()).collect();
    let mut groups: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); contours.len()];
    for (k, contour) in contours.iter().enumerate() {
        let mut sources: BTreeSet<u32> =
            contour.vertices(mesh.triangles()).into_iter().flatten().collect();
        if (contour.cut_off.len() as Real) < CUT_OFF * mesh.vertices().len() as Real {
            sources.extend(&contour.cut_off);
        }
        for (v, _) in surroundings.of(sources.iter().copied(), reach) {
            let mut group = *first_near[v as usize].get_or_insert(k);
            while last[group] != group {
                last[group] = last[last[group]];
                group = last[group];
            }
            if group != k {
                last[group] = k;
                let mut other = std::mem::take(&mut groups[group]);
                if other.len() > sources.len() {
                    std::mem::swap(&mut other, &mut sources);
                }
                sources.extend(other);
            }
        }
        groups[k] = sources;
    }
    groups.retain(|sources| !sources.is_empty());
    groups
}

/// Whether those of `pairs` at the vertices `sources` are all among `known`.
fn is_within(
    mesh: &TriMesh,
    sources: &BTreeSet<u32>,
    pairs: &[[u32; 2]],
    known: &BTreeSet<[u32; 2]>,
) -> bool {
    let corners = |pair: &[u32; 2]| pair.map(|t| mesh.triangles()[t as usize]);
    let is_at = |pair: &&[u32; 2]| corners(pair).iter().flatten().any(|v| sources.contains(v));
    pairs.iter().filter(is_at).all(|pair| known.contains(pair))
}

/// Tries ways apart for the contours of `patch` until no pair is left or `work` is used up, and
/// returns the best outcome.
fn best_way(
    patch: &Patch<'_>,
    start: &[Point],
    work: &mut usize,
    poll: &mut dyn FnMut() -> Result<(), Cancelled>,
) -> Result<Outcome, Cancelled> {
    let all: Vec<Vec<Way>> = patch.contours.iter().map(Contour::ways).collect();
    let mut chosen = vec![0; all.len()];
    let mut next = vec![1; all.len()];
    let ways = |chosen: &[usize]| -> Vec<Way> {
        all.iter().zip(chosen).map(|(ways, k)| ways[*k]).collect()
    };
    if *work == 0 {
        return Ok(patch.as_given(start));
    }
    let mut best = patch.separate(start, &ways(&chosen), *work, poll)?;
    let mut rounds = best.rounds;
    let pay = |work: &mut usize, outcome: &Outcome| {
        *work = work.saturating_sub(outcome.rounds * patch.free_count() + outcome.excess);
        *work > 0
    };
    let mut may_go_on = pay(work, &best);
    for _ in 0..TRIES + all.len() {
        let left = patch.remaining(&best.pairs);
        let open = (0..all.len()).filter(|k| left[*k] > 0 && next[*k] < all[*k].len());
        let worst = open.max_by_key(|k| (left[*k], usize::MAX - next[*k]));
        // A clean patch that is strained may be less so if a contour is left another way.
        let is_strained = best.pairs.is_empty() && best.largest > patch.tolerable_strain();
        let other = (0..all.len()).filter(|k| is_strained && next[*k] <= OTHERS);
        let Some(k) = worst.or(other.min_by_key(|k| next[*k])).filter(|_| may_go_on) else {
            break;
        };
        let mut other = chosen.clone();
        other[k] = next[k];
        next[k] += 1;
        let outcome = patch.separate(start, &ways(&other), *work, poll)?;
        rounds += outcome.rounds;
        may_go_on = pay(work, &outcome);
        if outcome.rank() < best.rank() {
            (best, chosen) = (outcome, other);
        }
    }
    Ok(Outcome { rounds, ..best })
}

/// The triangles of pairs.
fn triangles_of(pairs: &[TrianglePair]) -> Vec<[u32; 2]> {
    pairs.iter().map(|p| [p.a, p.b]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_mesh::intersections::own_pairs;
    use if_mesh::measure::displacement;

    /// A square sheet of 0.2 m with `n` cells a side, at the heights `z`.
    fn sheet(n: u32, z: impl Fn(f64, f64) -> f64) -> TriMesh {
        let at = |k: u32| 0.2 * f64::from(k) / f64::from(n) - 0.1;
        let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let vertices = vertices.map(|(i, j)| Point::new(at(i), at(j), z(at(i), at(j)))).collect();
        let cells = (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i));
        let triangles = cells.flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
        TriMesh::new(vertices, triangles.collect()).unwrap()
    }

    fn moved_by(mesh: &TriMesh, [x, y]: [f64; 2]) -> TriMesh {
        let moved = mesh.vertices().iter().map(|p| Point::new(p.x + x, p.y + y, p.z));
        mesh.with_vertices(moved.collect()).unwrap()
    }

    fn joined(a: &TriMesh, b: &TriMesh) -> Layer {
        let n = a.vertices().len() as u32;
        let more = b.triangles().iter().map(|t| t.map(|v| v + n));
        let triangles = a.triangles().iter().copied().chain(more).collect();
        let vertices = [a.vertices(), b.vertices()].concat();
        Layer::new("shirt", TriMesh::new(vertices, triangles).unwrap())
    }

    fn pairs_of(mesh: &TriMesh) -> Vec<[u32; 2]> {
        triangles_of(&own_pairs(mesh, &Bvh::new(mesh)))
    }

    /// Untangles `layer`, in which something must intersect, and returns what is left.
    fn untangled(layer: &Layer) -> Untangled {
        assert!(!pairs_of(&layer.mesh).is_empty());
        let params = ResolveParams::default();
        let start = layer.mesh.vertices();
        let mut costly = BTreeSet::new();
        let found = untangle(layer, start, &params, &mut costly, &mut |_| true, &mut |_| Ok(()));
        let found = found.unwrap().unwrap();
        let mesh = layer.mesh.with_vertices(found.positions.clone()).unwrap();
        assert_eq!(found.pairs, pairs_of(&mesh));
        found
    }

    #[test]
    fn a_bump_that_pokes_through_a_sheet_goes_back_and_what_is_far_stays() {
        let bump = |x: f64, y: f64| 0.012 * (-(x * x + y * y) / 5e-4).exp() - 0.004;
        let (flat, poking) = (sheet(24, |_, _| 0.0), sheet(23, bump));
        let layer = joined(&flat, &poking);
        let edges = Edges::new(&layer.mesh);
        let contours = Contour::all(&layer.mesh, &edges, &pairs_of(&layer.mesh));
        // The bump is cut off, below the sheet is its place; and so is the disc of the sheet.
        assert_eq!(contours.len(), 1);
        assert!(contours[0].cut_off.len() > 4 && contours[0].ways()[0].iter().all(|w| *w != 0));
        let found = untangled(&layer);
        assert!(found.pairs.is_empty() && found.rounds > 0);
        let moved = displacement(layer.mesh.vertices(), &found.positions);
        assert!(moved.max > 3e-3 && moved.max < 12e-3, "{moved:?}");
        let far = |p: &&Point| p.coords.xy().norm() > 0.09;
        let both = layer.mesh.vertices().iter().zip(&found.positions).filter(|(p, _)| far(p));
        assert!(both.map(|(p, q)| assert_eq!(p, q)).count() > 150);
        // The bump ends below the sheet again.
        let n = flat.vertices().len();
        let top = |x: &[Point]| x.iter().map(|p| p.z).fold(Real::NEG_INFINITY, Real::max);
        assert!(top(&found.positions[n..]) < top(&found.positions[..n]));
    }

    #[test]
    fn a_spike_that_could_only_be_crushed_stays_and_what_costs_little_goes() {
        let cone = |x: f64, y: f64, top: f64| (top - 4.0 * x.hypot(y)).max(0.0) - 0.004;
        // The tip of the one lies 75 mm above the sheet, that of the other 6 mm.
        let spikes = |x: f64, y: f64| cone(x - 0.05, y, 0.08).max(cone(x + 0.05, y + 0.05, 0.01));
        let layer = joined(&sheet(24, |_, _| 0.0), &sheet(40, spikes));
        let given = pairs_of(&layer.mesh);
        let (params, mut costly) = (ResolveParams::default(), BTreeSet::new());
        let start = layer.mesh.vertices();
        let found =
            untangle(&layer, start, &params, &mut costly, &mut |_| true, &mut |_| Ok(())).unwrap();
        let found = found.unwrap();
        assert!(found.pairs.len() > 20 && found.pairs.len() < given.len(), "{}", found.pairs.len());
        assert!(found.pairs.iter().all(|pair| costly.contains(pair) && given.contains(pair)));
        let moved = displacement(start, &found.positions).max;
        assert!(moved > 4e-3 && moved < 15e-3, "{moved}");
        let strain = if_mesh::measure::strain(&layer.mesh, &found.positions);
        assert!(strain.max < 1.0, "{strain:?}");
        // The high one is as it was.
        let both = start.iter().zip(&found.positions);
        assert!(both.filter(|(p, _)| p.x > 0.02).all(|(p, q)| p == q));
        // It goes where cloth may be strained twice as much.
        let mut params = params;
        params.effort.untangle_strain *= 2.0;
        let mut costly = BTreeSet::new();
        let found =
            untangle(&layer, start, &params, &mut costly, &mut |_| true, &mut |_| Ok(())).unwrap();
        assert!(found.unwrap().pairs.is_empty() && costly.is_empty());
    }

    #[test]
    fn a_contour_that_cuts_nothing_off_leaves_another_way() {
        // The contour runs from the border of a sheet to that of the other.
        let hanging = |x: f64, _: f64| 0.15 * (x + 0.055);
        let low = sheet(14, |_, _| 0.0);
        let high = moved_by(&sheet(13, hanging), [0.11, 0.08]);
        let layer = joined(&low, &high);
        let edges = Edges::new(&layer.mesh);
        let contours = Contour::all(&layer.mesh, &edges, &pairs_of(&layer.mesh));
        assert!(contours.len() == 1 && contours[0].cut_off.is_empty(), "{contours:?}");
        assert!(untangled(&layer).pairs.is_empty());
    }

    #[test]
    fn a_fold_that_passes_through_itself_opens() {
        // The legs of a fold cross near its turn, like an α.
        let alpha = |p: &Point| {
            let (u, v) = (p.x / 0.1, p.y / 0.1);
            let tight = (1.0 - v * v).max(0.0);
            let x = 0.05 * (u * u * u - (0.35 * tight - 0.12) * u);
            Point::new(x, p.y, 0.06 * u * u)
        };
        let flat = sheet(20, |_, _| 0.0);
        let fold = flat.with_vertices(flat.vertices().iter().map(alpha).collect()).unwrap();
        let layer = Layer::new("strip", fold);
        assert!(untangled(&layer).pairs.is_empty());
    }

    #[test]
    fn cloth_with_no_side_to_lie_apart_is_laid_smooth() {
        // The middle of a sheet is turned about, as where there was too little room for it.
        let flat = sheet(24, |x, y| 0.3 * x * y);
        let turned = |p: &Point| {
            let r = p.coords.xy().norm();
            let scale = if r < 0.03 { -0.4 } else { 1.0 };
            Point::new(scale * p.x, scale * p.y, p.z)
        };
        let folded = flat.with_vertices(flat.vertices().iter().map(turned).collect()).unwrap();
        let layer = Layer::new("shorts", folded);
        let mesh = &layer.mesh;
        let (edges, tree) = (Edges::new(mesh), Bvh::new(mesh));
        let sources: BTreeSet<u32> =
            pairs_of(mesh).iter().flatten().flat_map(|t| mesh.triangles()[*t as usize]).collect();
        let (start, params) = (mesh.vertices(), ResolveParams::default());
        let near = Neighbours::new(&edges, start);
        let mut around = Surroundings::new(mesh, &near);
        let near = around.of(sources, 0.05);
        let near = (&near[..], &around.triangles, &tree);
        let patch = Patch::new(&layer, start, 0.05, near, &params);
        let mut work = WORK;
        let apart = best_way(&patch, &patch.positions(start), &mut work, &mut || Ok(())).unwrap();
        assert!(!apart.pairs.is_empty(), "no way takes it apart");
        assert!(patch.smoothed(apart, &mut || Ok(())).unwrap().pairs.is_empty());
        let found = untangled(&layer);
        assert!(found.pairs.is_empty());
        let far = start.iter().zip(&found.positions).filter(|(p, _)| p.coords.xy().norm() > 0.09);
        assert!(far.map(|(p, q)| assert_eq!(p, q)).count() > 100);
    }

    #[test]
    fn scraps_that_cross_do_not_shrink_to_points() {
        // Each vertex is on a border: with both others it goes to one place.
        let at = [[0., 0., 0.], [0.02, 0., 0.], [0., 0.02, 0.], [0.005, 0.005, -0.01]];
        let more = [[0.006, 0.004, 0.01], [0.02, 0.02, 0.01]];
        let vertices = at.into_iter().chain(more).map(|[x, y, z]| Point::new(x, y, z)).collect();
        let layer =
            Layer::new("scraps", TriMesh::new(vertices, vec![[0, 1, 2], [3, 4, 5]]).unwrap());
        let mesh = &layer.mesh;
        let (edges, tree) = (Edges::new(mesh), Bvh::new(mesh));
        let sources = 0..6;
        let (start, params) = (mesh.vertices(), ResolveParams::default());
        let near = Neighbours::new(&edges, start);
        let mut around = Surroundings::new(mesh, &near);
        let near = around.of(sources, 0.05);
        let near = (&near[..], &around.triangles, &tree);
        let patch = Patch::new(&layer, start, 0.05, near, &params);
        let given = patch.as_given(&patch.positions(start));
        assert!(!given.pairs.is_empty());
        let found = patch.smoothed(given, &mut || Ok(())).unwrap();
        // No cloth holds them: they are kept as they are rather than shrunk.
        let area = |x: &[Point]| mesh.with_vertices(x.to_vec()).unwrap().area();
        assert!(area(&found.positions) > 0.25 * area(start));
        for k in 0..6 {
            assert!(!found.positions[..k].contains(&found.positions[k]), "{:?}", found.positions);
        }
    }

    #[test]
    fn a_state_that_is_not_accepted_is_not_returned() {
        let layer = joined(&sheet(10, |_, _| 0.0), &sheet(9, |x, _| 0.1 * x - 0.007));
        let params = ResolveParams::default();
        let start = layer.mesh.vertices();
        let mut asked = 0;
        let mut refused = |_: &[Point]| {
            asked += 1;
            false
        };
        let found =
            untangle(&layer, start, &params, &mut BTreeSet::new(), &mut refused, &mut |_| Ok(()));
        assert!(found.unwrap().is_none() && asked > 0);
        assert!(untangled(&layer).pairs.is_empty());
    }

    #[test]
    fn what_is_tangled_all_over_is_given_up_soon() {
        // A ball with its vertices in any order: each triangle meets a hundred others.
        let ball = if_core::shapes::meshes::icosphere(0.1, 2);
        let n = ball.vertices().len();
        let mixed = (0..n).map(|v| ball.vertices()[v * 61 % n]).collect();
        let layer = Layer::new("soup", ball.with_vertices(mixed).unwrap());
        assert!(pairs_of(&layer.mesh).len() > 10_000, "{}", pairs_of(&layer.mesh).len());
        let (params, mut reports) = (ResolveParams::default(), 0);
        let mut count = |_: usize| {
            reports += 1;
            Ok(())
        };
        let start = layer.mesh.vertices();
        untangle(&layer, start, &params, &mut BTreeSet::new(), &mut |_| true, &mut count).unwrap();
        assert!(reports < 60, "{reports} rounds");
    }

    #[test]
    fn it_can_be_cancelled_in_each_round() {
        let layer = joined(&sheet(10, |_, _| 0.0), &sheet(9, |x, _| 0.1 * x - 0.007));
        let params = ResolveParams::default();
        let start = layer.mesh.vertices();
        for last in [1, 3] {
            let mut reports = 0;
            let mut cancel = |pairs: usize| {
                assert!(pairs > 0);
                reports += 1;
                if reports == last { Err(Cancelled) } else { Ok(()) }
            };
            let found =
                untangle(&layer, start, &params, &mut BTreeSet::new(), &mut |_| true, &mut cancel);
            assert!(found.is_err() && reports == last);
        }
    }
}
