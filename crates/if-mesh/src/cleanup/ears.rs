//! Ears and notches of a rough boundary.

use super::broad_phase::Bounded;
use super::edit_mesh::EditMesh;
use super::half_edges::{HalfEdges, NONE, boundary_loops, ends, next, one_ring_into, previous};
use super::intersection_query::IntersectionQuery;
use super::report::SmoothReport;
use crate::validate::is_flat;
use if_core::aabb::Aabb;
use if_core::math::{Real, Vector, unit_or_zero};

/// Loops of fewer edges are not smoothed, and not trimmed below that.
pub(super) const MIN_LOOP_EDGES: usize = 8;

/// An ear is a triangle with two edges on the loop. It is trimmed if its third edge is shorter than
/// this share of the two: tips sharper than 128°.
const EAR: Real = 0.9;
/// A notch is filled where that shortens its two edges to less than this share: notches narrower
/// than 60°.
const NOTCH: Real = 0.5;

/// A notch is filled only if the new triangle turns by less than 60° from the surface beside it.
const FLAT_COSINE: Real = 0.5;
/// Maximum number of rounds of trimming.
const ROUNDS: usize = 4;

/// Two triangles whose common edge was flipped, and what they were before.
struct Flip {
    triangles: [u32; 2],
    before: [[u32; 3]; 2],
}

/// Changes of one round, no two of which share a vertex.
#[derive(Default)]
struct Changes {
    flips: Vec<Flip>,
    removed: Vec<u32>,
    added: Vec<[u32; 3]>,
}

/// Prepares rough loops for smoothing: the inner edge of an ear is flipped, so that its tip belongs
/// to two triangles and can move inwards without flattening one; where that is impossible, the ear
/// is removed; narrow notches are filled. Returns the half-edges and loops afterwards, the loops in
/// the same order.
pub(super) fn trim(
    work: &mut EditMesh,
    mut half_edges: HalfEdges,
    mut loops: Vec<Vec<u32>>,
    rough: &[bool],
    report: &mut SmoothReport,
) -> (HalfEdges, Vec<Vec<u32>>) {
    for _ in 0..ROUNDS {
        let Changes { flips, mut removed, added } = propose(work, &half_edges, &loops, rough);
        let base = work.triangles.len() as u32;
        let (flips, added) = keep_valid(work, flips, added);
        report.ears_flipped += flips.len();
        report.ears_removed += removed.len();
        report.notches_filled += added.len();
        if flips.is_empty() && removed.is_empty() && added.is_empty() {
            break;
        }
        let vertices: Vec<Vec<u32>> = loops
            .iter()
            .map(|boundary| boundary.iter().map(|&h| ends(&work.triangles, h)[0]).collect())
            .collect();
        work.triangles.extend(&added);
        let end = work.triangles.len() as u32;
        let changed: Vec<u32> = flips.iter().flat_map(|f| f.triangles).chain(base..end).collect();
        half_edges.update(&work.triangles, &changed);
        if !removed.is_empty() {
            removed.sort_unstable();
            work.remove(&removed);
            half_edges = half_edges.without(&removed);
        }
        // The tips of removed ears stay until the caller compacts, so that vertices keep their
        // numbers.
        loops = match_loops(work, &half_edges, &vertices);
    }
    (half_edges, loops)
}

/// Flips edges of ears in place, and collects ears to remove and triangles to add.
fn propose(
    work: &mut EditMesh,
    half_edges: &HalfEdges,
    loops: &[Vec<u32>],
    rough: &[bool],
) -> Changes {
    let mut used = vec![false; work.points.len()];
    let mut changes = Changes::default();
    let mut ring = Vec::new();
    let trimmed = loops.iter().zip(rough).filter(|(l, rough)| **rough && l.len() > MIN_LOOP_EDGES);
    for boundary in trimmed.map(|(l, _)| l) {
        let n = boundary.len();
        for k in 0..n {
            // Two edges of the loop in a row: a → v → b.
            let (g, h) = (boundary[k], boundary[(k + 1) % n]);
            let ([a, v], b) = (ends(&work.triangles, g), ends(&work.triangles, h)[1]);
            if [a, v, b].iter().any(|v| used[*v as usize]) {
                continue;
            }
            let [pa, pv, pb] = [a, v, b].map(|v| work.points[v as usize]);
            let share =
                (pb - pa).norm() / ((pv - pa).norm() + (pb - pv).norm()).max(Real::MIN_POSITIVE);
            if g / 3 == h / 3 {
                // Both edges belong to one triangle: an ear. w is the corner across its inner edge.
                let inner = half_edges.twin[next(h) as usize];
                if share >= EAR || inner == NONE {
                    continue;
                }
                let w = ends(&work.triangles, previous(inner))[0];
                if used[w as usize] {
                    continue;
                }
                let pw = work.points[w as usize];
                let both = work.area_vector(g as usize / 3) + work.area_vector(inner as usize / 3);
                let fits = |n: Vector| n.dot(&both) > 0.0;
                if fits((pv - pa).cross(&(pw - pa))) && fits((pb - pv).cross(&(pw - pv))) {
                    let [t, u] = [g / 3, inner / 3];
                    let before = [t, u].map(|t| work.triangles[t as usize]);
                    changes.flips.push(Flip { triangles: [t, u], before });
                    work.triangles[t as usize] = [a, v, w];
                    work.triangles[u as usize] = [v, b, w];
                } else {
                    changes.removed.push(g / 3);
                }
                [a, v, b, w].iter().for_each(|v| used[*v as usize] = true);
            } else if share < NOTCH {
                let filling = (pv - pb).cross(&(pa - pb));
                let normal = work.normal_at(half_edges, h);
                one_ring_into(&work.triangles, half_edges, g, &mut ring);
                if !ring.contains(&b) && unit_or_zero(&filling).dot(&normal) > FLAT_COSINE {
                    changes.added.push([b, v, a]);
                    [a, v, b].iter().for_each(|v| used[*v as usize] = true);
                }
            }
        }
    }
    changes
}

/// Reverts flips and drops new triangles that intersect something or have no area, until none does.
/// Returns those that stay; the new triangles are not in the mesh afterwards.
fn keep_valid(
    work: &mut EditMesh,
    mut flips: Vec<Flip>,
    added: Vec<[u32; 3]>,
) -> (Vec<Flip>, Vec<[u32; 3]>) {
    let base = work.triangles.len() as u32;
    work.triangles.extend(&added);
    let mut new: Vec<u32> = (base..work.triangles.len() as u32).collect();
    let corners = |t: [u32; 3]| Aabb::from_points(t.map(|v| &work.points[v as usize]));
    let mut bounded: Vec<Bounded> =
        new.iter().map(|&t| (t, corners(work.triangles[t as usize]))).collect();
    for flip in &flips {
        let both = corners(flip.before[0]).merged(&corners(flip.before[1]));
        bounded.extend(flip.triangles.map(|t| (t, both)));
    }
    bounded.sort_unstable_by_key(|b| b.0);
    let query = IntersectionQuery::with_bounds(
        &work.points,
        &work.triangles,
        &bounded,
        &mut work.broad_phase,
    );
    loop {
        let mut changed: Vec<u32> =
            flips.iter().flat_map(|f| f.triangles).chain(new.iter().copied()).collect();
        changed.sort_unstable();
        let flat = changed
            .iter()
            .filter(|t| is_flat(work.triangles[**t as usize].map(|v| &work.points[v as usize])));
        let mut bad: Vec<u32> = flat.copied().collect();
        bad.extend(query.pairs(&work.points, &work.triangles, &changed).iter().flatten());
        bad.sort_unstable();
        let is_bad = |t: &u32| bad.binary_search(t).is_ok();
        let before = (flips.len(), new.len());
        flips.retain(|flip| {
            let revert = flip.triangles.iter().any(is_bad);
            if revert {
                for (t, old) in flip.triangles.iter().zip(&flip.before) {
                    work.triangles[*t as usize] = *old;
                }
            }
            !revert
        });
        new.retain(|t| !is_bad(t));
        if (flips.len(), new.len()) == before {
            break;
        }
    }
    let added = new.iter().map(|t| work.triangles[*t as usize]).collect();
    work.truncate(work.points.len(), base as usize);
    (flips, added)
}

/// The loops of the changed mesh, each at the place of the old loop that one of its vertices
/// belonged to; empty for an old loop that is gone.
fn match_loops(
    work: &EditMesh,
    half_edges: &HalfEdges,
    old_vertices: &[Vec<u32>],
) -> Vec<Vec<u32>> {
    let mut owner = vec![usize::MAX; work.points.len()];
    for (k, vertices) in old_vertices.iter().enumerate() {
        vertices.iter().for_each(|v| owner[*v as usize] = k);
    }
    let mut matched = vec![Vec::new(); old_vertices.len()];
    for boundary in boundary_loops(&work.triangles, half_edges) {
        let k = boundary
            .iter()
            .map(|&h| owner[ends(&work.triangles, h)[0] as usize])
            .find(|k| *k != usize::MAX);
        if let Some(k) = k {
            matched[k] = boundary;
        }
    }
    matched
}
