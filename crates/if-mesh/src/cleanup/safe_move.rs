//! Vertices moved as far as no triangle turns over, loses its area or adds an intersection.

use super::edit_mesh::EditMesh;
use super::intersection_query::{IntersectionQuery, pair_intersects};
use crate::validate::is_flat;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::monitor::{Cancelled, Monitor, Progress};
use rayon::prelude::*;

/// Halvings of a harmful move, before it is given up.
const HALVINGS: u8 = 5;
/// A triangle may turn by less than 60°.
const LEAST_COSINE: Real = 0.5;
/// Height over longest edge above which the normal of a triangle is meaningful, and may not turn
/// over.
const SLIVER: Real = 0.02;

/// Minimum number of triangles per task.
const TASK: usize = 1 << 11;

/// Start and target positions of a move.
pub(super) struct Paths<'a> {
    /// Positions of all vertices before the first move.
    pub(super) start: &'a [Point],
    /// Positions of all vertices now.
    pub(super) old: &'a [Point],
    pub(super) target: &'a [Point],
    /// Vertices whose target differs from `old`, ascending.
    pub(super) moving: &'a [u32],
    /// Their triangles, ascending.
    pub(super) touched: &'a [u32],
}

/// Moves vertices to their targets, or as far towards them as possible: no triangle loses its area,
/// turns over compared to the start, or intersects one that it did not intersect before. Returns
/// which vertices were held back.
///
/// ```text
/// moved ← all moving vertices; step of each ← 1
/// while moved is not empty
///     place them; suspects ← their triangles
///     bad ← suspects that turned over, or intersect something they did not intersect before
///     moved ← the vertices of bad; step of each ← half, after HALVINGS halvings 0
/// ```
pub(super) fn move_safely(
    work: &mut EditMesh,
    paths: &Paths<'_>,
    single_precision: bool,
    monitor: &mut dyn Monitor,
) -> Result<Vec<bool>, Cancelled> {
    let Paths { start, old, target, moving, touched } = *paths;
    let mut moves = vec![false; old.len()];
    moving.iter().for_each(|v| moves[*v as usize] = true);
    let query = IntersectionQuery::new(
        old,
        &work.triangles,
        touched,
        target,
        single_precision,
        &mut work.broad_phase,
    );
    let mut halved = vec![0u8; old.len()];
    let mut is_changed = moves.clone();
    let mut changed = moving.to_vec();
    let mut suspects = touched.to_vec();
    while !changed.is_empty() {
        monitor.report(&Progress::stage("boundary"))?;
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
            .filter(|t| is_harmed(work, start, **t))
            .copied()
            .collect();
        let pairs = query.pairs(&work.points, &work.triangles, &suspects);
        bad.extend(
            pairs.iter().filter(|pair| !pair_intersects(old, &work.triangles, **pair)).flatten(),
        );
        changed.iter().for_each(|v| is_changed[*v as usize] = false);
        changed = bad.iter().flat_map(|t| work.triangles[*t as usize]).collect();
        changed.retain(|v| moves[*v as usize] && halved[*v as usize] <= HALVINGS);
        changed.sort_unstable();
        changed.dedup();
        for &v in &changed {
            halved[v as usize] += 1;
            is_changed[v as usize] = true;
        }
        // Only triangles of vertices whose step changed can be bad in the next round.
        suspects = touched.to_vec();
        suspects.retain(|t| work.triangles[*t as usize].iter().any(|v| is_changed[*v as usize]));
    }
    Ok(halved.iter().map(|h| *h > 0).collect())
}

/// A filter before [`is_harmed`]: whether a triangle certainly has an area and a normal near
/// `twice`, by more than the rounding error. Most have; squares save roots and divisions.
fn certainly_fine(twice: &Vector, [a, b, c]: [&Point; 3]) -> bool {
    /// Above the square of the height over the longest edge up to which a triangle is flat.
    const HEIGHT: Real = 1e-20;
    /// Above the square of [`LEAST_COSINE`].
    const COSINE: Real = 0.26;
    let (u, v) = (b - a, c - a);
    let now = u.cross(&v);
    let (size, longest) =
        (now.norm_squared(), u.norm_squared().max(v.norm_squared()).max((c - b).norm_squared()));
    let along = now.dot(twice);
    // Numbers so small that squares lose digits are left to the full test.
    let fits = size > HEIGHT * (longest * longest)
        && along > 0.0
        && along * along > COSINE * (size * twice.norm_squared());
    fits && along > 1e-100 && along < 1e100
}

/// Whether triangle `t` turned over, or lost its area.
fn is_harmed(work: &EditMesh, start: &[Point], t: u32) -> bool {
    let corners = work.triangles[t as usize];
    let [a, b, c] = corners.map(|v| start[v as usize]);
    let twice = (b - a).cross(&(c - a));
    if certainly_fine(&twice, corners.map(|v| &work.points[v as usize])) {
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
