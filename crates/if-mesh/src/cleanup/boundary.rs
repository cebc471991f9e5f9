//! Laplacian smoothing of the boundary.

use super::guard::{meeting, meeting_among, near};
use super::holes::newton;
use super::manifold::resolve;
use super::rim::{LoopShape, length};
use super::twins::{NONE, Twins, ends, leaving, loops, next, previous};
use super::work::{Derived, Work};
use crate::validate::is_flat;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use serde::Serialize;

/// How boundary loops are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothParams {
    /// λ: the share of the way to the mean of its neighbours that a vertex goes.
    pub lambda: Real,
    /// μ: the share of the way back, below −λ, so that loops do not shrink.
    pub mu: Real,
    /// A loop is smooth, and left alone, where its mean turn from edge to edge (root of the mean square, in radians) is at most
    /// this much above that of the regular polygon of as many edges.
    pub roughness: Real,
    /// Passes (one step of λ, one of μ) over a loop, at most.
    pub passes: usize,
    /// Rings of vertices beside the loop that go with it, less and less; more where it moves far.
    pub rings: usize,
    /// Whether triangles with two edges on a rough loop, which smoothing would press flat, are first joined to those below them or
    /// cut off, and narrow notches filled.
    pub trim: bool,
    /// Passes of Laplacian smoothing (λ without μ) over all vertices that are not on a loop, against the noise of a scan: 0, as in
    /// the paper, leaves the surface as it is.
    pub surface_passes: usize,
}

impl Default for SmoothParams {
    fn default() -> Self {
        Self { lambda: 0.5, mu: -0.53, roughness: 0.2, passes: 50, rings: 3, trim: true, surface_passes: 0 }
    }
}

/// What became of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SmoothedLoop {
    /// The loop afterwards.
    pub rim: LoopShape,
    /// Its length before, in metres.
    pub length_before: Real,
    /// Its roughness before and after, in radians ([`SmoothParams::roughness`]).
    pub roughness: [Real; 2],
    /// Passes made.
    pub passes: usize,
}

/// What was smoothed.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct SmoothReport {
    /// The loops, those that were smooth already included.
    pub loops: Vec<SmoothedLoop>,
    /// Edges turned below triangles that stick out of rough loops.
    pub turned: usize,
    /// Triangles that stuck out of rough loops and were cut off, because that could not be done.
    pub teeth: usize,
    /// Triangles that fill notches of rough loops.
    pub notches: usize,
    /// Vertices that moved.
    pub moved: usize,
    /// The farthest move, in metres.
    pub farthest: Real,
    /// Vertices that went a part of their way or none, because a triangle would have turned over or met another one.
    pub held_back: usize,
}

/// Smooths all boundary loops of `mesh` that are rough: Taubin's filter along the loop, spread over some rings of
/// vertices, and brought back to the zero of `field` where there is one. No vertex moves so far that a triangle turns
/// over, loses its area, or meets another one that it did not meet before. A mesh that is not manifold is made so
/// first ([`super::manifold::make_manifold`]).
///
/// # Source
///
/// Supplement, Appendix B, Figure 2 (b); Taubin 1995.
pub fn smooth_boundary(mesh: &TriMesh, field: Option<&dyn SignedDistance>, params: &SmoothParams) -> (Derived, SmoothReport) {
    let mut work = Work::new(mesh);
    let (_, twins) = resolve(&mut work);
    let rims = loops(&work.triangles, &twins);
    let report = smooth(&mut work, &twins, &rims, field, params, false);
    (work.finish(), report)
}

/// Loops of fewer edges have no shape to be smoothed to.
const FEWEST: usize = 8;
/// Rounds of trimming, at most.
const TRIMS: usize = 4;

/// [`smooth_boundary`] in place, of the loops `rims`.
pub(super) fn smooth(
    work: &mut Work,
    twins: &Twins,
    rims: &[Vec<u32>],
    field: Option<&dyn SignedDistance>,
    params: &SmoothParams,
    single_precision: bool,
) -> SmoothReport {
    let mut report = SmoothReport::default();
    let line = |work: &Work, rim: &[u32]| -> Vec<u32> { rim.iter().map(|&h| ends(&work.triangles, h)[0]).collect() };
    let at = |work: &Work, line: &[u32]| -> Vec<Point> { line.iter().map(|v| work.points[*v as usize]).collect() };
    let before: Vec<(Real, Real, bool)> = rims
        .iter()
        .map(|rim| {
            let points = at(work, &line(work, rim));
            let rough = roughness(&points);
            (length(&points), rough, points.len() >= FEWEST && rough > params.roughness)
        })
        .collect();
    let any = before.iter().any(|b| b.2);
    if !any && params.surface_passes == 0 {
        report.loops = rims
            .iter()
            .zip(&before)
            .map(|(rim, b)| SmoothedLoop {
                rim: LoopShape::new(work, twins, rim),
                length_before: b.0,
                roughness: [b.1; 2],
                passes: 0,
            })
            .collect();
        return report;
    }
    // A vertex of each loop stays what it is through trimming: loops are found again by those vertices.
    let (mut twins, mut rims) = (twins.clone(), rims.to_vec());
    if params.trim && any {
        let rough: Vec<bool> = before.iter().map(|b| b.2).collect();
        (twins, rims) = trim(work, twins, rims, &rough, &mut report);
    }
    let mut target = work.points.clone();
    let mut passes = vec![0; rims.len()];
    let mut seeds = Vec::new();
    let mut fixed = vec![false; work.points.len()];
    twins.rim().for_each(|h| fixed[ends(&work.triangles, h)[0] as usize] = true);
    for (k, rim) in rims.iter().enumerate() {
        if !before[k].2 || rim.len() < FEWEST {
            continue;
        }
        let line = line(work, rim);
        let mut points = at(work, &line);
        while passes[k] < params.passes && roughness(&points) > params.roughness {
            taubin_loop(&mut points, params);
            passes[k] += 1;
        }
        line.iter().zip(&points).for_each(|(v, p)| target[*v as usize] = *p);
        seeds.extend(line);
    }
    let leaving = leaving(work.points.len(), &work.triangles, &twins);
    spread(work, &twins, &leaving, &mut target, &seeds, &fixed, params.rings);
    if params.surface_passes > 0 {
        surface(work, &twins, &leaving, &mut target, &fixed, params);
    }
    if let Some(field) = field {
        back(work, field, &mut target);
    }
    move_safely(work, &target, single_precision, &mut report);
    report.loops = rims
        .iter()
        .enumerate()
        .map(|(k, rim)| SmoothedLoop {
            rim: LoopShape::new(work, &twins, rim),
            length_before: before[k].0,
            roughness: [before[k].1, roughness(&at(work, &line(work, rim)))],
            passes: passes[k],
        })
        .collect();
    report
}

/// The mean turn from edge to edge above that of a regular polygon, as the root of
///
/// ```text
/// Σ |pᵢ₋₁ − 2pᵢ + pᵢ₊₁|² / Σ |pᵢ₊₁ − pᵢ|²
/// ```
///
/// less 2 sin(π/n), in radians; 0 for a loop without length.
fn roughness(points: &[Point]) -> Real {
    let n = points.len();
    let (mut turn, mut size) = (0.0, 0.0);
    for k in 0..n {
        let (a, b, c) = (points[(k + n - 1) % n], points[k], points[(k + 1) % n]);
        turn += ((a - b) + (c - b)).norm_squared();
        size += (c - b).norm_squared();
    }
    if size > 0.0 { ((turn / size).sqrt() - 2.0 * (std::f64::consts::PI / n as Real).sin()).max(0.0) } else { 0.0 }
}

/// One step of λ and one of μ along a closed line.
fn taubin_loop(points: &mut [Point], params: &SmoothParams) {
    let n = points.len();
    for factor in [params.lambda, params.mu] {
        let old = points.to_vec();
        for k in 0..n {
            let mean = nalgebra::center(&old[(k + n - 1) % n], &old[(k + 1) % n]);
            points[k] = old[k] + (mean - old[k]) * factor;
        }
    }
}

/// The moves of a loop are spread at least over so many times their mean: where triangles are small beside the teeth of a
/// loop, a few rings would be pressed together.
const DEPTH: Real = 3.0;
/// Rings, at most, if that is above what is asked for.
const MOST_RINGS: usize = 12;

/// Gives the vertices of `rings` rings round `seeds` the mean move of the ring before them, less and less of it.
fn spread(work: &Work, twins: &Twins, leaving: &[u32], target: &mut [Point], seeds: &[u32], fixed: &[bool], rings: usize) {
    let mut ring_of = vec![u32::MAX; work.points.len()];
    let (mut far, mut edge) = (0.0, 0.0);
    for &v in seeds {
        far += (target[v as usize] - work.points[v as usize]).norm();
        edge += work.edge_length_at(twins, leaving[v as usize]);
    }
    let rings = if edge > 0.0 { ((DEPTH * far / edge).ceil() as usize).clamp(rings, MOST_RINGS.max(rings)) } else { rings };
    seeds.iter().for_each(|v| ring_of[*v as usize] = 0);
    let mut whole: Vec<(u32, Vector)> = seeds.iter().map(|v| (*v, target[*v as usize] - work.points[*v as usize])).collect();
    let mut moves = vec![Vector::zeros(); work.points.len()];
    whole.iter().for_each(|(v, d)| moves[*v as usize] = *d);
    for ring in 1..=rings as u32 {
        let mut found: Vec<u32> = Vec::new();
        for (v, _) in &whole {
            for u in neighbours(work, twins, leaving[*v as usize]) {
                if ring_of[u as usize] == u32::MAX && !fixed[u as usize] {
                    ring_of[u as usize] = ring;
                    found.push(u);
                }
            }
        }
        found.sort_unstable();
        whole = found
            .iter()
            .map(|&v| {
                let near = neighbours(work, twins, leaving[v as usize]);
                let inner: Vec<Vector> =
                    near.iter().filter(|u| ring_of[**u as usize] == ring - 1).map(|u| moves[*u as usize]).collect();
                (v, inner.iter().sum::<Vector>() / inner.len().max(1) as Real)
            })
            .collect();
        let share = 1.0 - Real::from(ring) / (rings as Real + 1.0);
        for (v, d) in &whole {
            moves[*v as usize] = *d;
            target[*v as usize] = work.points[*v as usize] + d * share;
        }
    }
}

/// Laplacian smoothing of the vertices that are not `fixed`, from where `target` has them.
fn surface(work: &Work, twins: &Twins, leaving: &[u32], target: &mut [Point], fixed: &[bool], params: &SmoothParams) {
    for _ in 0..params.surface_passes {
        let old = target.to_vec();
        for v in (0..target.len()).filter(|v| !fixed[*v] && leaving[*v] != NONE) {
            let near = neighbours(work, twins, leaving[v]);
            let mean = near.iter().fold(Vector::zeros(), |s, u| s + old[*u as usize].coords) / near.len().max(1) as Real;
            target[v] = old[v] + (Point::from(mean) - old[v]) * params.lambda;
        }
    }
}

/// The vertices that an edge joins to the one that half-edge `h` leaves.
fn neighbours(work: &Work, twins: &Twins, h: u32) -> Vec<u32> {
    let mut near = Vec::with_capacity(8);
    if h != NONE {
        twins.around(h, |g| {
            near.push(ends(&work.triangles, g)[1]);
            if twins.of[previous(g) as usize] == NONE {
                near.push(ends(&work.triangles, previous(g))[0]);
            }
        });
    }
    near
}

/// Takes moved vertices back to φ = 0.
fn back(work: &Work, field: &dyn SignedDistance, target: &mut [Point]) {
    for (v, p) in target.iter_mut().enumerate() {
        let move_length = (*p - work.points[v]).norm();
        if move_length > 0.0
            && let Some(step) = newton(&field.sample(p), move_length)
        {
            *p += step;
        }
    }
}

/// Halvings of a move that does harm, before it is given up.
const HALVINGS: u8 = 5;
/// A triangle may turn by less than 60°.
const LEAST_COSINE: Real = 0.5;
/// Height over longest edge above which the normal of a triangle means something, and may not turn over.
const SLIVER: Real = 0.02;

/// Moves vertices to `target`, or as far that way as does no harm.
fn move_safely(work: &mut Work, target: &[Point], single_precision: bool, report: &mut SmoothReport) {
    let old = work.points.clone();
    let moves = |v: u32| target[v as usize] != old[v as usize];
    let touched: Vec<u32> =
        (0..work.triangles.len() as u32).filter(|t| work.triangles[*t as usize].iter().any(|v| moves(*v))).collect();
    let farthest = (0..old.len()).map(|v| (target[v] - old[v]).norm()).fold(0.0, Real::max);
    // What moves stays within `farthest` of where it was: what is near is looked for once.
    let near = near(&old, &work.triangles, &touched, farthest);
    let before = meeting_among(&old, &work.triangles, &touched, &near);
    let mut halved = vec![0u8; old.len()];
    let mut changed: Vec<u32> = (0..old.len() as u32).filter(|v| moves(*v)).collect();
    let mut suspects = touched.clone();
    while !changed.is_empty() {
        for &v in &changed {
            let k = v as usize;
            let moved = old[k] + (target[k] - old[k]) * 0.5f64.powi(i32::from(halved[k]));
            work.points[k] = match halved[k] {
                0 if !single_precision => target[k],
                h if h > HALVINGS => old[k],
                _ if single_precision => moved.map(|x| Real::from(x as f32)),
                _ => moved,
            };
        }
        // Only triangles of vertices that went elsewhere than in the round before can do new harm.
        let mut bad: Vec<u32> = suspects.iter().filter(|t| harms(work, &old, **t)).copied().collect();
        let after = meeting_among(&work.points, &work.triangles, &suspects, &near);
        bad.extend(after.iter().filter(|pair| before.binary_search(pair).is_err()).flatten());
        changed = bad.iter().flat_map(|t| work.triangles[*t as usize]).filter(|v| moves(*v)).collect();
        changed.retain(|v| halved[*v as usize] <= HALVINGS);
        changed.sort_unstable();
        changed.dedup();
        changed.iter().for_each(|v| halved[*v as usize] += 1);
        let is_changed = |v: &u32| changed.binary_search(v).is_ok();
        suspects = touched.iter().filter(|t| work.triangles[**t as usize].iter().any(is_changed)).copied().collect();
    }
    for v in 0..old.len() {
        let far = (work.points[v] - old[v]).norm();
        report.moved += usize::from(far > 0.0);
        report.farthest = report.farthest.max(far);
        report.held_back += usize::from(halved[v] > 0);
    }
}

/// Whether triangle `t` turned over, or lost its area.
fn harms(work: &Work, old: &[Point], t: u32) -> bool {
    let corners = work.triangles[t as usize];
    if is_flat(corners.map(|v| &work.points[v as usize])) {
        return true;
    }
    let [a, b, c] = corners.map(|v| old[v as usize]);
    let twice = (b - a).cross(&(c - a));
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    if twice.norm() < SLIVER * longest {
        return false;
    }
    unit_or_zero(&twice).dot(&unit_or_zero(&work.area_vector(t as usize))) < LEAST_COSINE
}

/// A tooth is a triangle with two edges on the loop, of which the third has less than this share: tips sharper than 128°.
const TOOTH: Real = 0.9;
/// A notch is filled where that shortens its two edges to less than this share: notches narrower than 60°.
const NOTCH: Real = 0.5;

/// Makes rough loops ready to be smoothed: the inner edge of a tooth is turned, so that its tip stands on two triangles that can be
/// pressed without getting flat; where that cannot be, the tooth is cut off; narrow notches are filled. Returns the twins and loops of what is left, in the same order.
fn trim(
    work: &mut Work,
    mut twins: Twins,
    mut rims: Vec<Vec<u32>>,
    rough: &[bool],
    report: &mut SmoothReport,
) -> (Twins, Vec<Vec<u32>>) {
    for _ in 0..TRIMS {
        let mut used = vec![false; work.points.len()];
        let mut gone = Vec::new();
        let mut added = Vec::new();
        let mut turns: Vec<([u32; 2], [[u32; 3]; 2])> = Vec::new();
        for rim in rims.iter().zip(rough).filter(|(rim, rough)| **rough && rim.len() > FEWEST).map(|r| r.0) {
            let n = rim.len();
            for k in 0..n {
                let (g, h) = (rim[k], rim[(k + 1) % n]); // a → v → b
                let ([a, v], b) = (ends(&work.triangles, g), ends(&work.triangles, h)[1]);
                if [a, v, b].iter().any(|v| used[*v as usize]) {
                    continue;
                }
                let [pa, pv, pb] = [a, v, b].map(|v| work.points[v as usize]);
                let share = (pb - pa).norm() / ((pv - pa).norm() + (pb - pv).norm()).max(Real::MIN_POSITIVE);
                if g / 3 == h / 3 {
                    let inner = twins.of[next(h) as usize];
                    if share >= TOOTH || inner == NONE {
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
                        turns.push(([t, u], [t, u].map(|t| work.triangles[t as usize])));
                        work.triangles[t as usize] = [a, v, w];
                        work.triangles[u as usize] = [v, b, w];
                    } else {
                        gone.push(g / 3);
                    }
                    [a, v, b, w].iter().for_each(|v| used[*v as usize] = true);
                } else if share < NOTCH {
                    let lid = (pv - pb).cross(&(pa - pb));
                    let normal = work.normal_at(&twins, h);
                    let joined = neighbours(work, &twins, g).contains(&b);
                    if !joined && unit_or_zero(&lid).dot(&normal) > LEAST_COSINE {
                        added.push([b, v, a]);
                        [a, v, b].iter().for_each(|v| used[*v as usize] = true);
                    }
                }
            }
        }
        // Turns and lids that meet something, or have no area, are taken back, until none is left that does.
        let base = work.triangles.len() as u32;
        work.triangles.extend(&added);
        let mut new: Vec<u32> = (base..work.triangles.len() as u32).collect();
        loop {
            let mut suspects: Vec<u32> = turns.iter().flat_map(|t| t.0).chain(new.iter().copied()).collect();
            suspects.sort_unstable();
            let flat = suspects.iter().filter(|t| is_flat(work.triangles[**t as usize].map(|v| &work.points[v as usize])));
            let mut bad: Vec<u32> = flat.copied().collect();
            bad.extend(meeting(&work.points, &work.triangles, &suspects).iter().flatten());
            bad.sort_unstable();
            let is_bad = |t: &u32| bad.binary_search(t).is_ok();
            let before = (turns.len(), new.len());
            turns.retain(|(ids, old)| {
                let back = ids.iter().any(is_bad);
                if back {
                    ids.iter().zip(old).for_each(|(t, old)| work.triangles[*t as usize] = *old);
                }
                !back
            });
            // A lid that is taken back is no suspect any more, and dropped below.
            new.retain(|t| !is_bad(t));
            if (turns.len(), new.len()) == before {
                break;
            }
        }
        let meets: Vec<u32> = (base..work.triangles.len() as u32).filter(|t| new.binary_search(t).is_err()).collect();
        report.turned += turns.len();
        report.teeth += gone.len();
        report.notches += new.len();
        if turns.is_empty() && gone.is_empty() && new.is_empty() {
            work.triangles.truncate(base as usize);
            break;
        }
        // Each loop is found again by one of its vertices that stays.
        let mark: Vec<Vec<u32>> = rims.iter().map(|rim| rim.iter().map(|&h| ends(&work.triangles, h)[0]).collect()).collect();
        gone.sort_unstable();
        let mut k = 0..;
        work.triangles.retain(|_| k.next().is_some_and(|k| gone.binary_search(&k).is_err() && meets.binary_search(&k).is_err()));
        // Tips are of no triangle now; they stay until the caller compacts, so that vertices keep their numbers.
        twins = Twins::new(work.points.len(), &work.triangles);
        let mut owner = vec![usize::MAX; work.points.len()];
        mark.iter().enumerate().for_each(|(k, vertices)| vertices.iter().for_each(|v| owner[*v as usize] = k));
        let mut again = vec![Vec::new(); rims.len()];
        for rim in loops(&work.triangles, &twins) {
            let k = rim.iter().map(|&h| owner[ends(&work.triangles, h)[0] as usize]).find(|k| *k != usize::MAX);
            if let Some(k) = k {
                again[k] = rim;
            }
        }
        rims = again;
    }
    (twins, rims)
}
