//! Teeth and notches of a rough boundary.

use super::boundary::{FEWEST, SmoothReport};
use super::guard::Guard;
use super::spread::neighbours;
use super::twins::{NONE, Twins, ends, loops, next, previous};
use super::work::Work;
use crate::validate::is_flat;
use if_core::aabb::Aabb;
use if_core::math::{Real, Vector, unit_or_zero};

/// A tooth is a triangle with two edges on the loop, of which the third has less than this share:
/// tips sharper than 128°.
const TOOTH: Real = 0.9;
/// A notch is filled where that shortens its two edges to less than this share: notches narrower
/// than 60°.
const NOTCH: Real = 0.5;

/// A notch is filled only where its lid turns by less than 60° from the surface beside it.
const FLAT_COSINE: Real = 0.5;
/// Rounds of trimming, at most.
const TRIMS: usize = 4;

/// Makes rough loops ready to be smoothed: the inner edge of a tooth is turned, so that its tip
/// stands on two triangles that can be pressed without getting flat; where that cannot be, the
/// tooth is cut off; narrow notches are filled. Returns the twins and loops of what is left, in the
/// same order.
pub(super) fn trim(
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
        for rim in
            rims.iter().zip(rough).filter(|(rim, rough)| **rough && rim.len() > FEWEST).map(|r| r.0)
        {
            let n = rim.len();
            for k in 0..n {
                let (g, h) = (rim[k], rim[(k + 1) % n]); // a → v → b
                let ([a, v], b) = (ends(&work.triangles, g), ends(&work.triangles, h)[1]);
                if [a, v, b].iter().any(|v| used[*v as usize]) {
                    continue;
                }
                let [pa, pv, pb] = [a, v, b].map(|v| work.points[v as usize]);
                let share = (pb - pa).norm()
                    / ((pv - pa).norm() + (pb - pv).norm()).max(Real::MIN_POSITIVE);
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
                    let both =
                        work.area_vector(g as usize / 3) + work.area_vector(inner as usize / 3);
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
                    if !joined && unit_or_zero(&lid).dot(&normal) > FLAT_COSINE {
                        added.push([b, v, a]);
                        [a, v, b].iter().for_each(|v| used[*v as usize] = true);
                    }
                }
            }
        }
        // Turns and lids that meet something, or have no area, are taken back, until none is left
        // that does.
        let base = work.triangles.len() as u32;
        work.triangles.extend(&added);
        let mut new: Vec<u32> = (base..work.triangles.len() as u32).collect();
        let corners = |t: [u32; 3]| Aabb::from_points(t.map(|v| &work.points[v as usize]));
        let mut places: Vec<(u32, Aabb)> =
            new.iter().map(|&t| (t, corners(work.triangles[t as usize]))).collect();
        for (ids, old) in &turns {
            let both = corners(old[0]).merged(&corners(old[1]));
            places.extend(ids.map(|t| (t, both)));
        }
        places.sort_unstable_by_key(|p| p.0);
        let guard = Guard::of_places(&work.points, &work.triangles, &places, &mut work.vicinity);
        loop {
            let mut suspects: Vec<u32> =
                turns.iter().flat_map(|t| t.0).chain(new.iter().copied()).collect();
            suspects.sort_unstable();
            let flat = suspects.iter().filter(|t| {
                is_flat(work.triangles[**t as usize].map(|v| &work.points[v as usize]))
            });
            let mut bad: Vec<u32> = flat.copied().collect();
            bad.extend(guard.meeting(&work.points, &work.triangles, &suspects).iter().flatten());
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
        let lids: Vec<[u32; 3]> = new.iter().map(|t| work.triangles[*t as usize]).collect();
        work.truncate(work.points.len(), base as usize);
        work.triangles.extend(&lids);
        report.turned += turns.len();
        report.teeth += gone.len();
        report.notches += lids.len();
        if turns.is_empty() && gone.is_empty() && lids.is_empty() {
            break;
        }
        // Each loop is found again by one of its vertices that stays.
        let mark: Vec<Vec<u32>> = rims
            .iter()
            .map(|rim| rim.iter().map(|&h| ends(&work.triangles, h)[0]).collect())
            .collect();
        let changed: Vec<u32> =
            turns.iter().flat_map(|t| t.0).chain(base..work.triangles.len() as u32).collect();
        twins.update(&work.triangles, &changed);
        if !gone.is_empty() {
            gone.sort_unstable();
            work.remove(&gone);
            twins = twins.without(&gone);
        }
        // Tips are of no triangle now; they stay until the caller compacts, so that vertices keep
        // their numbers.
        let mut owner = vec![usize::MAX; work.points.len()];
        mark.iter()
            .enumerate()
            .for_each(|(k, vertices)| vertices.iter().for_each(|v| owner[*v as usize] = k));
        let mut again = vec![Vec::new(); rims.len()];
        for rim in loops(&work.triangles, &twins) {
            let k = rim
                .iter()
                .map(|&h| owner[ends(&work.triangles, h)[0] as usize])
                .find(|k| *k != usize::MAX);
            if let Some(k) = k {
                again[k] = rim;
            }
        }
        rims = again;
    }
    (twins, rims)
}
