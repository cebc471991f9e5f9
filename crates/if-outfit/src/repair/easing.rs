//! Easing: strained edges of a clean garment are relaxed in guarded rounds, each of which ends clean
//! again.
//!
//! Repairs end as soon as nothing intersects. Where they had to push a garment far, in an armpit
//! above all, single vertices are left drawn out, and ordinary rounds that would relax them make
//! triangles intersect on the way. A guarded round goes from one clean state to the next: of what
//! contacts and cloth propose, vertices of triangles that intersect are taken back, in part and then
//! wholly, until exact verification finds nothing; rounds that follow keep the planes that separate
//! those triangles.

use super::{OWN_SEPARATION, Repair, SEPARATION};
use crate::incremental_verification::Remaining;
use crate::progress::{GarmentProgress, REPAIR};
use crate::separating_plane::widest_gap;
use crate::workpiece::{Eased, SettleError, Workpiece};
use if_core::math::{Point, Real};
use if_mesh::index::Bvh;
use if_mesh::measure::{Strain, edge_strain, strain_of};
use if_xpbd::separation::Separations;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

/// Rounds without a state that is clearly better after which easing ends.
const IN_VAIN: usize = 6;
/// A state is clearly better with this share of the excess strain at most. With 0.98 the jacket of
/// o5, five layers, takes 33 rounds more to get from 60 to 59 %.
const BETTER: Real = 0.9;
/// Maximum motion of a vertex in a round, in metres.
const LEAP: Real = 4e-3;
/// The share of its motion that a vertex of an intersecting triangle keeps; the second time it
/// keeps none.
const SHARE: Real = 0.3;
/// Times that vertices are taken back in a round; then all are.
const TRIES: usize = 12;
/// Rounds over which triangles that intersected are held apart.
const KEPT: u32 = 10;

/// Relaxes the neighbourhoods of edges of the best state that are strained by more than
/// `ease_strain`. The result is clean if that state is; else nothing changes.
pub(crate) struct Easing;

impl Repair for Easing {
    fn apply(
        &mut self,
        work: &mut Workpiece<'_>,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<ControlFlow<()>, SettleError> {
        if let Some(best) = work.best.take() {
            let eased = if best.is_clean() { ease(work, &best.positions, progress)? } else { None };
            work.best = Some(match eased {
                Some(positions) => best.moved_to(positions),
                None => best,
            });
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// What intersected in the last rounds, and for how many more it is held apart.
#[derive(Default)]
struct Intersected {
    /// Layer below, its triangle, triangle.
    layers: BTreeMap<(usize, u32, u32), u32>,
    own: BTreeMap<[u32; 2], u32>,
}

impl Intersected {
    fn add(&mut self, remaining: &Remaining) {
        self.layers.extend(remaining.pairs.iter().map(|(j, p)| ((*j, p.a, p.b), KEPT)));
        self.own.extend(remaining.new_own.iter().map(|p| (*p, KEPT)));
    }

    fn age(&mut self) {
        let older = |rounds: &mut u32| {
            *rounds -= 1;
            *rounds > 0
        };
        self.layers.retain(|_, rounds| older(rounds));
        self.own.retain(|_, rounds| older(rounds));
    }
}

/// Eases from the clean positions `from`. Returns positions that are clean and better, or `None` if
/// no edge is strained so far or nothing better was found.
fn ease(
    work: &mut Workpiece<'_>,
    from: &[Point],
    progress: &mut GarmentProgress<'_>,
) -> Result<Option<Vec<Point>>, SettleError> {
    let effort = &work.scene.params.effort;
    let start = strain_at(work, from);
    if start.max <= effort.ease_strain || effort.ease_rounds == 0 {
        return Ok(None);
    }
    let mut clean = from.to_vec();
    work.tree = Bvh::new(&work.mesh_at(clean.clone()));
    work.contacts.reset_gaps();
    work.go_to(&clean);
    let (mut met, mut best, mut largest) = (Intersected::default(), None, start.max);
    let (mut least, mut vain, mut rounds) = (excess(work, from), 0, 0);
    while rounds < effort.ease_rounds && vain < IN_VAIN {
        let strained: BTreeSet<u32> = work.cloth.strained(effort.ease_strain).into_iter().collect();
        if strained.is_empty() {
            break;
        }
        progress.report(REPAIR, work.round + rounds, Some(0))?;
        rounds += 1;
        vain += 1;
        work.cloth.hold_far_from(&strained, effort.repair_influence);
        keep_apart(work, &met, &clean);
        met.age();
        // A clean garment stays as it is where a step fails.
        if let Err(error) = work.cloth.round(&mut work.contacts, &work.tree) {
            tracing::warn!(garment = work.scene.garment.name, %error, "easing ends early");
            break;
        }
        let Some(to) = guarded(work, &clean, &mut met) else { break };
        clean = to;
        work.go_to(&clean);
        let (now, rest) = (strain_at(work, &clean), excess(work, &clean));
        tracing::debug!(
            garment = work.scene.garment.name,
            round = rounds,
            largest = now.max,
            rms = now.rms,
            ends = strained.len(),
            "eased"
        );
        if rest < least && now.rms <= start.rms && now.max <= start.max {
            vain = if rest < BETTER * least { 0 } else { vain };
            (least, largest, best) = (rest, now.max, Some(clean.clone()));
        }
    }
    if best.is_some() {
        work.eased = Eased { rounds, strain: [start.max, largest] };
        work.counts.easing_rounds += rounds;
    }
    Ok(best)
}

/// As much of the way from the positions `clean` to those proposed as exact verification finds
/// clean, ready to be stored. What intersected on the way is added to `met`. `None` if `clean` is
/// not clean.
fn guarded(work: &mut Workpiece<'_>, clean: &[Point], met: &mut Intersected) -> Option<Vec<Point>> {
    let triangles = work.scene.garment.mesh.triangles();
    let x = &mut work.cloth.x;
    let mut moved: Vec<usize> = (0..clean.len()).filter(|v| x[*v] != clean[*v]).collect();
    let mut way: Vec<_> =
        x.iter().zip(clean).map(|(x, c)| (x - c) * (LEAP / (x - c).norm().max(LEAP))).collect();
    moved.iter().for_each(|v| x[*v] = clean[*v] + way[*v]);
    let mut taken_back = vec![false; clean.len()];
    for tries in 0.. {
        let (mesh, remaining) = work.verified(work.cloth.stored());
        if remaining.is_clean() {
            return Some(mesh.vertices().to_vec());
        }
        if moved.is_empty() {
            return None;
        }
        met.add(&remaining);
        let vertices = remaining.vertices(triangles);
        let intersects = |v: &usize| vertices.contains(&(*v as u32));
        // If none of these vertices can go back further, or not soon enough, all do.
        let all = tries >= TRIES || !moved.iter().any(intersects);
        for v in moved.iter().copied().filter(|v| all || intersects(v)) {
            way[v] *= if taken_back[v] || all { 0.0 } else { SHARE };
            taken_back[v] = true;
            work.cloth.x[v] = clean[v] + way[v];
        }
        moved.retain(|v| work.cloth.x[*v] != clean[*v]);
    }
    None
}

/// Holds what `met` apart on the sides where it lies at the positions `clean`.
fn keep_apart(work: &mut Workpiece<'_>, met: &Intersected, clean: &[Point]) {
    let triangles = work.scene.garment.mesh.triangles();
    let contacts = &mut work.contacts;
    contacts.separating.clear();
    for &(j, a, b) in met.layers.keys() {
        let corners = triangles[b as usize];
        let at = corners.map(|v| clean[v as usize]);
        if let Some((normal, level, gap)) = widest_gap(&at, &work.scene.below[j].corners(a)) {
            let point = Point::from(normal * (level + gap.min(SEPARATION)));
            contacts.separating.extend(corners.map(|v| (v, normal, point)));
        }
    }
    contacts.self_separations = Separations::new();
    for [a, b] in met.own.keys() {
        let [a, b] = [a, b].map(|t| triangles[*t as usize]);
        contacts.self_separations.push(a, b, OWN_SEPARATION, clean);
    }
}

/// Sum of the squares of the strains beyond `ease_strain` at the positions `x`.
fn excess(work: &Workpiece<'_>, x: &[Point]) -> Real {
    let rest = work.scene.garment.mesh.vertices();
    let length = |x: &[Point], [a, b]: [u32; 2]| (x[a as usize] - x[b as usize]).norm();
    let strain = |e: &[u32; 2]| edge_strain(length(rest, *e), length(x, *e));
    let beyond = |e| (strain(e) - work.scene.params.effort.ease_strain).max(0.0);
    work.cloth.edges.vertices.iter().map(|e| beyond(e).powi(2)).sum()
}

fn strain_at(work: &Workpiece<'_>, x: &[Point]) -> Strain {
    strain_of(&work.cloth.edges.vertices, work.scene.garment.mesh.vertices(), x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::incremental_verification::IncrementalVerification;
    use crate::progress::GarmentProgress;
    use crate::repair::tests::{unchanged, with_band};
    use if_core::monitor::{Cancelled, Monitor, Progress, Silent};

    struct Forbidden;

    impl Monitor for Forbidden {
        fn report(&mut self, _: &Progress<'_>) -> Result<(), Cancelled> {
            panic!("a round")
        }
    }

    fn eased(
        work: &mut Workpiece<'_>,
        from: &[Point],
        monitor: &mut dyn Monitor,
    ) -> Option<Vec<Point>> {
        let mut progress = GarmentProgress { monitor, name: "band", index: 0, count: 1 };
        ease(work, from, &mut progress).unwrap_or_else(|_| panic!("not cancelled"))
    }

    fn is_clean(work: &Workpiece<'_>, x: &[Point]) -> bool {
        let mesh = work.mesh_at(x.to_vec());
        let verified = IncrementalVerification::new(&mesh, &Bvh::new(&mesh), work.scene.below);
        verified.1.is_clean()
    }

    #[test]
    fn a_vertex_drawn_out_comes_back_and_what_is_far_from_it_stays() {
        with_band(0.302, unchanged, |work| {
            work.cloth.ever_free.fill(true);
            let rest = work.scene.garment.mesh.vertices();
            let height = |v: usize| rest[v].z - rest[v].y.abs();
            let v = (0..rest.len()).max_by(|a, b| height(*a).total_cmp(&height(*b))).unwrap();
            let mut from = rest.to_vec();
            from[v] += (rest[v] - Point::origin()) * 0.25;
            let to = eased(work, &from, &mut Silent).expect("eased");
            let Eased { rounds, strain } = work.eased;
            assert!(strain[0] > 2.0 && strain[1] < 0.5 && rounds > 3, "{strain:?} {rounds}");
            assert_eq!(work.counts.easing_rounds, rounds);
            assert_eq!(strain_at(work, &to).max, strain[1]);
            assert!(is_clean(work, &to));
            let far = (0..rest.len()).filter(|u| (rest[*u] - rest[v]).norm() > 0.2);
            assert!(far.map(|u| assert_eq!(to[u], rest[u])).count() > 500);
            // Then there is nothing to do.
            assert!(eased(work, &to, &mut Forbidden).is_none());
        });
    }

    #[test]
    fn of_a_proposal_that_meets_the_body_the_rest_is_taken() {
        with_band(0.301, unchanged, |work| {
            let rest = work.scene.garment.mesh.vertices();
            // Half of the band is drawn in, by 3 mm: there is room for that at the hems only.
            for (x, p) in work.cloth.x.iter_mut().zip(rest) {
                *x = Point::new(p.x * 0.99, p.y, p.z * if p.z > 0.0 { 0.99 } else { 1.01 });
            }
            let proposed = work.cloth.x.clone();
            let mut met = Intersected::default();
            assert!(!is_clean(work, &proposed));
            let to = guarded(work, rest, &mut met).unwrap();
            assert!(is_clean(work, &to));
            let gone = |v: usize| (to[v] - rest[v]).norm() / (proposed[v] - rest[v]).norm();
            let (wholly, not) = (0..to.len()).fold((0, 0), |(w, n), v| {
                (w + usize::from(gone(v) > 0.999), n + usize::from(gone(v) < 0.001))
            });
            assert!(wholly > 200 && not > 50, "{wholly} {not}");
            // What intersected is held where it lies.
            assert!(!met.layers.is_empty());
            keep_apart(work, &met, &to);
            let planes = &work.contacts.separating;
            assert!(planes.len() > 30);
            let height = |(v, n, point): &(u32, _, Point)| {
                let n: &if_core::math::Vector = n;
                n.dot(&(to[*v as usize] - point))
            };
            assert!(planes.iter().all(|plane| height(plane) > -1e-12));
        });
    }

    #[test]
    fn what_is_not_clean_is_not_eased() {
        with_band(0.25, unchanged, |work| {
            let input = work.scene.garment.mesh.vertices();
            let from: Vec<Point> = input.iter().map(|p| p + (p - Point::origin()) * 0.02).collect();
            work.cloth.x.copy_from_slice(&from);
            assert!(guarded(work, &from, &mut Intersected::default()).is_none());
        });
    }
}
