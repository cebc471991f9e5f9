//! Laplacian smoothing of the boundary.

use super::curve::{roughness, taubin_loop};
use super::manifold::resolve;
use super::rim::{LoopShape, length};
use super::safe_move::{Paths, move_safely};
use super::spread::{Spread, back, surface};
use super::trim::trim;
use super::twins::{Twins, ends, leaving, loops};
use super::watch::{Cancelled, Watch, unwatched};
use super::work::{Derived, Work};
use super::{CleanupError, Step, range};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use serde::Serialize;

/// Passes and rounds, at most, where clean-up takes them from a caller: a hundred times what
/// flattens a scan's noise, while the work still ends.
pub const MOST_PASSES: usize = 10_000;

/// How boundary loops are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothParams {
    /// Whether the loops are smoothed. Without, they stay as they are, and only the passes over the
    /// surface are made.
    pub boundary: bool,
    /// λ: the share of the way to the mean of its neighbours that a vertex goes.
    pub lambda: Real,
    /// μ: the share of the way back, below −λ, so that loops do not shrink.
    pub mu: Real,
    /// A loop is smooth, and left alone, where its mean turn from edge to edge (root of the mean
    /// square, in radians) is at most this much above that of the regular polygon of as many edges.
    pub roughness: Real,
    /// Passes (one step of λ, one of μ) over a loop in a round, at most.
    pub passes: usize,
    /// Rounds, at most: where vertices were held back and a loop is still rough, it is smoothed
    /// again from where it has come to.
    pub rounds: usize,
    /// Rings of vertices beside the loop that go with it, less and less; more where it moves far.
    pub rings: usize,
    /// Whether triangles with two edges on a rough loop, which smoothing would press flat, are
    /// first joined to those below them or cut off, and narrow notches filled.
    pub trim: bool,
    /// Passes of Laplacian smoothing (λ without μ) over all vertices that are not on a loop,
    /// against the noise of a scan: 0, as in the paper, leaves the surface as it is.
    pub surface_passes: usize,
}

impl Default for SmoothParams {
    fn default() -> Self {
        Self {
            boundary: true,
            lambda: 0.5,
            mu: -0.53,
            roughness: 0.2,
            passes: 50,
            rounds: 4,
            rings: 3,
            trim: true,
            surface_passes: 0,
        }
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
    /// Passes made, in all rounds.
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
    /// Vertices that went a part of their way or none in the last round, because a triangle would
    /// have turned over or met another one.
    pub held_back: usize,
}

impl SmoothParams {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// The first that does not.
    pub fn validate(&self) -> Result<(), CleanupError> {
        range("λ", self.lambda, 0.0, 1.0, "a number from 0 to 1")?;
        range("μ", self.mu, -1.1, 0.0, "a number from −1.1 to 0, a little below −λ")?;
        range("the roughness", self.roughness, 1e-3, 10.0, "an angle in radians, from 0.001")?;
        let most = MOST_PASSES as Real;
        range(
            "the number of passes over a loop",
            self.passes as Real,
            0.0,
            most,
            "at most 10,000",
        )?;
        range("the number of rounds", self.rounds as Real, 0.0, most, "at most 10,000")?;
        range("the number of rings", self.rings as Real, 0.0, most, "at most 10,000")?;
        range(
            "the number of passes over the surface",
            self.surface_passes as Real,
            0.0,
            most,
            "at most 10,000",
        )
    }
}

/// Smooths all boundary loops of `mesh` that are rough: Taubin's filter along the loop, spread over
/// some rings of vertices, and brought back to the zero of `field` where there is one. No vertex
/// moves so far that a triangle turns over, loses its area, or meets another one that it did not
/// meet before. A mesh that is not manifold is made so first ([`super::manifold::make_manifold`]).
///
/// # Source
///
/// Supplement, Appendix B, Figure 2 (b); Taubin 1995.
///
/// # Errors
///
/// Parameters out of range.
pub fn smooth_boundary(
    mesh: &TriMesh,
    field: Option<&dyn SignedDistance>,
    params: &SmoothParams,
) -> Result<(Derived, SmoothReport), CleanupError> {
    params.validate()?;
    let mut work = Work::new(mesh);
    let (_, twins) = resolve(&mut work);
    let rims = loops(&work.triangles, &twins);
    let report = unwatched(|watch| smooth(&mut work, &twins, &rims, field, params, false, watch));
    work.compact(); // tips of teeth that were cut off
    Ok((work.finish(), report))
}

/// Loops of fewer edges have no shape to be smoothed to.
pub(super) const FEWEST: usize = 8;
/// A further round is worth its while if the one before took at least this share of the loops'
/// roughness: of the clean extractions' loops the second round takes a third, the fourth a tenth.
const GAIN: Real = 0.05;

/// In further rounds, what goes on along a loop: so many vertices to either side of one that was
/// held back. The rest has got where it should.
const AGAIN: usize = 10;

/// [`smooth_boundary`] in place, of the loops `rims`. Vertices of no triangle may stay.
///
/// ```text
/// trim teeth and notches of rough loops
/// repeat
///     Taubin along each rough loop, after the first round beside what was held back → spread over rings → (first round) surface passes → back to φ = 0
///     move as far as nothing is turned over or met
/// until nothing was held back, no loop is rough, or no loop gets smoother
/// ```
pub(super) fn smooth(
    work: &mut Work,
    twins: &Twins,
    rims: &[Vec<u32>],
    field: Option<&dyn SignedDistance>,
    params: &SmoothParams,
    single_precision: bool,
    watch: &mut Watch<'_>,
) -> Result<SmoothReport, Cancelled> {
    let mut report = SmoothReport::default();
    let line = |work: &Work, rim: &[u32]| -> Vec<u32> {
        rim.iter().map(|&h| ends(&work.triangles, h)[0]).collect()
    };
    let at = |work: &Work, line: &[u32]| -> Vec<Point> {
        line.iter().map(|v| work.points[*v as usize]).collect()
    };
    let measure = |work: &Work, rim: &[u32]| {
        let points = at(work, &line(work, rim));
        (length(&points), roughness(&points))
    };
    let is_rough = |rim: &[u32], rough: Real| {
        params.boundary && rim.len() >= FEWEST && rough > params.roughness
    };
    let before: Vec<(Real, Real)> = rims.iter().map(|rim| measure(work, rim)).collect();
    let rough: Vec<bool> = rims.iter().zip(&before).map(|(rim, b)| is_rough(rim, b.1)).collect();
    // A vertex of each loop stays what it is through trimming: loops are found again by those
    // vertices.
    let (mut twins, mut rims) = (twins.clone(), rims.to_vec());
    if params.trim && rough.contains(&true) {
        (twins, rims) = trim(work, twins, rims, &rough, &mut report);
    }
    let start = work.points.clone();
    let mut fixed = vec![false; start.len()];
    twins.rim().for_each(|h| fixed[ends(&work.triangles, h)[0] as usize] = true);
    let leaving = leaving(start.len(), &work.triangles, &twins);
    let mut passes = vec![0; rims.len()];
    let mut still = Real::INFINITY;
    let mut held: Option<Vec<bool>> = None;
    let (mut old, mut target) = (start.clone(), start.clone());
    let mut carry = Spread::new(&twins, &leaving, &fixed);
    for round in 0..params.rounds {
        watch.at(Step::Boundary)?;
        let mut seeds = Vec::new();
        let mut sum = 0.0;
        for (k, rim) in rims.iter().enumerate().filter(|(k, _)| rough[*k]) {
            let line = line(work, rim);
            let mut points = at(work, &line);
            let now = roughness(&points);
            if !is_rough(rim, now) {
                continue;
            }
            sum += now;
            let goes_on = held.as_ref().map(|held| beside(&line, held));
            for _ in 0..params.passes {
                if roughness(&points) <= params.roughness {
                    break;
                }
                let before = goes_on.as_ref().map(|goes_on| (goes_on, points.clone()));
                taubin_loop(&mut points, params);
                if let Some((goes_on, before)) = before {
                    (0..points.len()).filter(|k| !goes_on[*k]).for_each(|k| points[k] = before[k]);
                }
                passes[k] += 1;
            }
            line.iter().zip(&points).for_each(|(v, p)| target[*v as usize] = *p);
            seeds.extend(
                line.iter()
                    .zip(&points)
                    .filter(|(v, p)| work.points[**v as usize] != **p)
                    .map(|(v, _)| *v),
            );
        }
        let surface_passes = if round == 0 { params.surface_passes } else { 0 };
        if (seeds.is_empty() && surface_passes == 0) || sum > (1.0 - GAIN) * still {
            break;
        }
        still = sum;
        let mut moving = carry.spread(work, &mut target, &seeds, params.rings);
        if surface_passes > 0 {
            surface(work, &twins, &leaving, &mut target, &fixed, params, watch)?;
            moving = (0..start.len() as u32).collect();
        }
        if let Some(field) = field {
            back(work, field, &mut target, &moving);
        }
        moving.retain(|v| old[*v as usize] != target[*v as usize]);
        moving.sort_unstable();
        let mut touched = Vec::new();
        moving.iter().for_each(|v| twins.around(leaving[*v as usize], |h| touched.push(h / 3)));
        touched.sort_unstable();
        touched.dedup();
        let paths =
            Paths { start: &start, old: &old, target: &target, moving: &moving, touched: &touched };
        let back = move_safely(work, &paths, single_precision, watch)?;
        for v in moving.iter().map(|v| *v as usize) {
            old[v] = work.points[v];
            target[v] = work.points[v];
        }
        report.held_back = back.iter().filter(|h| **h).count();
        if report.held_back == 0 {
            break;
        }
        held = Some(back);
    }
    for (p, q) in work.points.iter().zip(&start).filter(|(p, q)| p != q) {
        report.moved += 1;
        report.farthest = report.farthest.max((p - q).norm());
    }
    report.loops = rims
        .iter()
        .enumerate()
        .map(|(k, rim)| SmoothedLoop {
            rim: LoopShape::new(work, &twins, rim),
            length_before: before[k].0,
            roughness: [before[k].1, measure(work, rim).1],
            passes: passes[k],
        })
        .collect();
    Ok(report)
}

/// Which vertices of a loop lie within [`AGAIN`] vertices of one that was held back.
fn beside(line: &[u32], held: &[bool]) -> Vec<bool> {
    let n = line.len();
    let mut near = vec![false; n];
    for k in (0..n).filter(|k| held[line[*k] as usize]) {
        (0..=2 * AGAIN.min(n)).for_each(|j| near[(k + n + j - AGAIN.min(n)) % n] = true);
    }
    near
}
