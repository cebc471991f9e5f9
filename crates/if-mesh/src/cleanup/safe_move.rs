//! Vertices moved as far as that does no harm.

use super::Step;
use super::guard::Guard;
use super::watch::{Cancelled, Watch};
use super::work::Work;
use crate::validate::is_flat;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use rayon::prelude::*;

/// Halvings of a move that does harm, before it is given up.
const HALVINGS: u8 = 5;
/// A triangle may turn by less than 60°.
const LEAST_COSINE: Real = 0.5;
/// Height over longest edge above which the normal of a triangle means something, and may not turn
/// over.
const SLIVER: Real = 0.02;

/// Triangles for a task, at least.
const TASK: usize = 1 << 11;

/// Where vertices are to go.
pub(super) struct Paths<'a> {
    /// Where all vertices were before the first move.
    pub(super) start: &'a [Point],
    /// Where all vertices are.
    pub(super) old: &'a [Point],
    pub(super) target: &'a [Point],
    /// Those whose target is elsewhere, ascending.
    pub(super) moving: &'a [u32],
    /// Their triangles, ascending.
    pub(super) touched: &'a [u32],
}

/// Moves vertices to their targets, or as far that way as does no harm: no triangle loses its area,
/// turns over against how it lay at the start, or meets one that it did not meet before. Says which
/// vertices were held back.
///
/// ```text
/// moved ← all vertices that are to move; share of each ← 1
/// while moved is not empty
///     place them; suspects ← their triangles
///     bad ← suspects that turned over, or meet something that they did not meet before
///     moved ← the vertices of bad; share of each ← half, after HALVINGS halvings 0
/// ```
pub(super) fn move_safely(
    work: &mut Work,
    paths: &Paths<'_>,
    single_precision: bool,
    watch: &mut Watch<'_>,
) -> Result<Vec<bool>, Cancelled> {
    let Paths { start, old, target, moving, touched } = *paths;
    let mut moves = vec![false; old.len()];
    moving.iter().for_each(|v| moves[*v as usize] = true);
    let guard = Guard::new(old, &work.triangles, touched, target, &mut work.vicinity);
    let mut halved = vec![0u8; old.len()];
    let mut is_changed = moves.clone();
    let mut changed = moving.to_vec();
    let mut suspects = touched.to_vec();
    while !changed.is_empty() {
        watch.at(Step::Boundary)?;
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
        let mut bad: Vec<u32> = suspects
            .par_iter()
            .with_min_len(TASK)
            .filter(|t| harms(work, start, **t))
            .copied()
            .collect();
        let meets = guard.meeting(&work.points, &work.triangles, &suspects);
        bad.extend(meets.iter().filter(|pair| !Guard::met(old, &work.triangles, **pair)).flatten());
        changed.iter().for_each(|v| is_changed[*v as usize] = false);
        changed = bad.iter().flat_map(|t| work.triangles[*t as usize]).collect();
        changed.retain(|v| moves[*v as usize] && halved[*v as usize] <= HALVINGS);
        changed.sort_unstable();
        changed.dedup();
        for &v in &changed {
            halved[v as usize] += 1;
            is_changed[v as usize] = true;
        }
        // Only triangles of vertices that went elsewhere than in the round before can do new harm.
        suspects = touched.to_vec();
        suspects.retain(|t| work.triangles[*t as usize].iter().any(|v| is_changed[*v as usize]));
    }
    Ok(halved.iter().map(|h| *h > 0).collect())
}

/// Whether a triangle has an area and lies nearly as `twice` says, by more than rounding can feign:
/// most do, and squares save roots and divisions.
fn surely_fine(twice: &Vector, [a, b, c]: [&Point; 3]) -> bool {
    /// Above the square of the height over the longest edge up to which a triangle is flat.
    const HEIGHT: Real = 1e-20;
    /// Above the square of [`LEAST_COSINE`].
    const COSINE: Real = 0.26;
    let (u, v) = (b - a, c - a);
    let now = u.cross(&v);
    let (size, longest) =
        (now.norm_squared(), u.norm_squared().max(v.norm_squared()).max((c - b).norm_squared()));
    let along = now.dot(twice);
    // Numbers so small that squares lose digits take a closer look.
    let fits = size > HEIGHT * (longest * longest)
        && along > 0.0
        && along * along > COSINE * (size * twice.norm_squared());
    fits && along > 1e-100 && along < 1e100
}

/// Whether triangle `t` turned over, or lost its area.
fn harms(work: &Work, start: &[Point], t: u32) -> bool {
    let corners = work.triangles[t as usize];
    let [a, b, c] = corners.map(|v| start[v as usize]);
    let twice = (b - a).cross(&(c - a));
    if surely_fine(&twice, corners.map(|v| &work.points[v as usize])) {
        return false;
    }
    if is_flat(corners.map(|v| &work.points[v as usize])) {
        return true;
    }
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    if twice.norm() < SLIVER * longest {
        return false;
    }
    unit_or_zero(&twice).dot(&unit_or_zero(&work.area_vector(t as usize))) < LEAST_COSINE
}
