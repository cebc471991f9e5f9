//! Neighbourhoods of what remains are drawn as a whole out of what they are caught in.
//!
//! In an armpit the ways out of a wider garment below lead to the front and to the back. Contacts
//! lead neighbours out both ways, and no local step takes the edges between them across. What has
//! to move is the neighbourhood: its displacements are smoothed, and it is translated along a common
//! direction, less towards its border. Directions, sizes and distances are tried in turn, and judged
//! by exact verification.

use crate::workpiece::Workpiece;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_mesh::outward::Outward;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// What remains is one cluster if it is within this distance along the surface, in metres.
const CLUSTER: Real = 0.03;
/// Of more clusters none is lifted: the garment lies elsewhere, and its shape is not the reason.
const MAX_CLUSTERS: usize = 6;
/// Neighbourhoods whose own shape stays: their size, in metres from the cluster along the surface,
/// and how often their displacements are averaged.
const GENTLE: [(Real, usize); 4] = [(0.02, 2), (0.03, 6), (0.05, 6), (0.08, 20)];
/// Neighbourhoods of which only the border's shape stays.
const SMOOTH: [(Real, usize); 2] = [(0.06, 120), (0.11, 120)];
/// Distances of translation, as shares of the size. A larger one strains the neighbourhood by more
/// than 100 %.
const SHARES: [Real; 7] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.55, 0.7];
/// Maximum number of lifts, one after the other.
const LIFTS: usize = 12;
/// A vertex that is less than this inside a layer, in metres, is led straight out.
const SHALLOW: Real = 0.01;
/// Cells of the grid of outward directions, relative to those that contacts use: an armpit and both
/// of its walls are in the blur of one cell.
const COARSER: Real = 3.0;

/// Lifts the clusters of what the last verification found, as long as less remains after it; those
/// that are left then go into smooth shapes, from which other repairs go on. Returns whether something
/// moved. The garment, and its verification, are then there.
pub(super) fn lift(work: &mut Workpiece<'_>) -> bool {
    let scene = work.scene;
    let region = scene.garment.mesh.surface_aabb();
    let cell = COARSER * scene.params.effort.outward_cell;
    let coarse = Outward::new(scene.below, &region.inflated(0.1), cell);
    let mut has_moved = false;
    for _ in 0..LIFTS {
        let clusters = clusters(work);
        if clusters.is_empty() || clusters.len() > MAX_CLUSTERS {
            break;
        }
        let mut helps = false;
        for cluster in &clusters {
            let most = work.remaining.count();
            if lift_cluster(work, cluster, &coarse, &GENTLE, most) {
                helps = true;
                // A clean state counts, whatever comes of it.
                work.rank(0.0);
            }
        }
        has_moved |= helps;
        if !helps {
            for cluster in &clusters {
                has_moved |= lift_cluster(work, cluster, &coarse, &SMOOTH, usize::MAX);
            }
            break;
        }
    }
    has_moved
}

/// The vertices of what remains, in connected parts.
fn clusters(work: &Workpiece<'_>) -> Vec<BTreeSet<u32>> {
    let mut left = work.remaining_vertices();
    let mut clusters = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut cluster = BTreeSet::from([first]);
        loop {
            let near = work.cloth.neighbours.distances(cluster.iter().copied(), CLUSTER);
            let (more, rest): (BTreeSet<u32>, BTreeSet<u32>) =
                left.iter().partition(|v| near[**v as usize].is_finite());
            left = rest;
            if more.is_empty() {
                break;
            }
            cluster.extend(more);
        }
        clusters.push(cluster);
    }
    clusters
}

/// Moves the garment to the best of the states that are tried for `cluster`, if fewer pairs and
/// vertices than `most` remain there. Returns whether it did.
fn lift_cluster(
    work: &mut Workpiece<'_>,
    cluster: &BTreeSet<u32>,
    coarse: &Outward,
    sizes: &[(Real, usize)],
    most: usize,
) -> bool {
    let start = work.cloth.x.clone();
    let mut best: Option<(usize, Vec<Point>)> = None;
    'tried: for &(radius, smoothings) in sizes {
        let patch = Patch::new(work, cluster, radius, smoothings);
        let ways = patch.ways(work, cluster, coarse);
        let tried = ways.iter().flat_map(|way| SHARES.map(|share| way * (share * radius)));
        for by in std::iter::once(Vector::zeros()).chain(tried) {
            let x = patch.translated(work, &by);
            work.cloth.x.copy_from_slice(&x);
            let (_, remaining) = work.verified(work.cloth.stored());
            work.cloth.x.copy_from_slice(&start);
            if remaining.count() < best.as_ref().map_or(most, |best| best.0) {
                best = Some((remaining.count(), x));
            }
            if remaining.is_clean() {
                break 'tried;
            }
        }
    }
    if let Some((count, x)) = &best {
        tracing::debug!(
            garment = work.scene.garment.name,
            vertices = cluster.len(),
            before = work.remaining.count(),
            count,
            "lifted"
        );
        work.go_to(x);
        (0..x.len()).filter(|v| x[*v] != start[*v]).for_each(|v| work.contacts.reset(v));
        work.counts.patch_lifts += 1;
    }
    work.verify();
    best.is_some()
}

/// A neighbourhood, with its displacements smoothed.
struct Patch {
    /// Its vertices, the share of a translation that each takes, and where they are at first.
    vertices: Vec<(u32, Real, Point)>,
}

impl Patch {
    /// What is nearer to the `cluster` than `radius`; displacements are averaged `smoothings` times.
    fn new(work: &Workpiece<'_>, cluster: &BTreeSet<u32>, radius: Real, smoothings: usize) -> Self {
        let (x, rest) = (&work.cloth.x, work.scene.garment.mesh.vertices());
        let neighbours = &work.cloth.neighbours;
        let far = neighbours.distances(cluster.iter().copied(), radius);
        let is_near = |v: &u32| far[*v as usize].is_finite();
        let chosen: Vec<u32> = (0..x.len() as u32).filter(is_near).collect();
        let mut moved: Vec<Vector> = x.iter().zip(rest).map(|(a, b)| a - b).collect();
        for _ in 0..smoothings {
            for &v in &chosen {
                let around = neighbours.of(v);
                if !around.is_empty() {
                    let sum: Vector = around.iter().map(|(u, _)| moved[*u as usize]).sum();
                    moved[v as usize] = sum / around.len() as Real;
                }
            }
        }
        let weight = |v: u32| {
            let near = 1.0 - far[v as usize] / radius;
            near * near * (3.0 - 2.0 * near)
        };
        let at = |v: u32| rest[v as usize] + moved[v as usize];
        Self { vertices: chosen.into_iter().map(|v| (v, weight(v), at(v))).collect() }
    }

    /// Unit directions that may lead out: the mean way out of the triangles below that the cluster
    /// intersects, the mean normal of the cluster itself, the mean of the two, and the direction of the
    /// `coarse` grid. Of two walls that face each other, what they have in common is left in a mean.
    fn ways(&self, work: &Workpiece<'_>, cluster: &BTreeSet<u32>, coarse: &Outward) -> Vec<Vector> {
        let scene = work.scene;
        let triangles = scene.garment.mesh.triangles();
        let is_met = |t: &[u32; 3]| t.iter().any(|v| cluster.contains(v));
        let pairs = work.remaining.pairs.iter().filter(|(_, p)| is_met(&triangles[p.b as usize]));
        let way_out = |(layer, pair): &(usize, if_mesh::intersections::TrianglePair)| {
            let layer = scene.below[*layer];
            let sum: Vector = layer.corners(pair.a).iter().map(|p| p.coords).sum();
            layer.sided(&Point::from(sum / 3.0), Real::INFINITY).map(|s| s.normal)
        };
        let below: Vector = pairs.filter_map(way_out).sum();
        let mut at = work.cloth.x.clone();
        self.vertices.iter().for_each(|(v, _, p)| at[*v as usize] = *p);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| &at[v as usize]);
            area_vector(a, b, c)
        };
        let own: Vector = triangles.iter().filter(|t| is_met(t)).map(area).sum();
        let sum: Vector = cluster.iter().map(|v| at[*v as usize].coords).sum();
        let middle = Point::from(sum / cluster.len().max(1) as Real);
        let [below, own] = [below, own].map(|way| unit_or_zero(&way));
        let ways = [below, own, unit_or_zero(&(below + own))];
        let ways = ways.into_iter().chain(coarse.direction(&middle));
        ways.filter(|way| *way != Vector::zeros()).collect()
    }

    /// The garment with the neighbourhood translated by `by`, and what is then a little inside a
    /// layer led out.
    fn translated(&self, work: &Workpiece<'_>, by: &Vector) -> Vec<Point> {
        let scene = work.scene;
        let clearance = scene.params.goal.clearance;
        let led_out = |p: Point, layer: &&if_mesh::solid::ClosedLayer| {
            let side = layer.sided(&p, clearance);
            match side.filter(|s| s.distance < clearance && s.distance > -SHALLOW) {
                Some(s) => p + s.normal * (clearance - s.distance),
                None => p,
            }
        };
        let to: Vec<Point> = self
            .vertices
            .par_iter()
            .with_min_len(64)
            .map(|(_, weight, at)| scene.below.iter().rev().fold(at + by * *weight, led_out))
            .collect();
        let mut x = work.cloth.x.clone();
        self.vertices.iter().zip(to).for_each(|((v, _, _), p)| x[*v as usize] = p);
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::tests::{unchanged, with_band};

    /// Pushes the vertices near each of some vertices of the band into the ball, by 2 cm.
    fn dented(work: &mut Workpiece<'_>, centres: &[usize]) {
        let rest = work.scene.garment.mesh.vertices();
        let mut to = rest.to_vec();
        for centre in centres.iter().map(|v| rest[*v]) {
            for p in to.iter_mut().filter(|p| (**p - centre).norm() < 0.03) {
                *p = Point::from(p.coords * (1.0 - 0.02 / p.coords.norm()));
            }
        }
        work.cloth.ever_free.fill(true);
        work.go_to(&to);
        work.verify();
    }

    /// The vertex of the band that is farthest along z, or against it.
    fn farthest(work: &Workpiece<'_>, sign: Real) -> usize {
        let rest = work.scene.garment.mesh.vertices();
        let height = |v: &usize| sign * rest[*v].z - rest[*v].y.abs();
        (0..rest.len()).max_by(|a, b| height(a).total_cmp(&height(b))).unwrap()
    }

    #[test]
    fn dents_are_lifted_out_one_by_one_and_what_is_far_from_them_stays() {
        with_band(0.305, unchanged, |work| {
            let centres = [1.0, -1.0].map(|sign| farthest(work, sign));
            dented(work, &centres);
            assert!(work.remaining.inside.len() > 10 && !work.remaining.pairs.is_empty());
            assert_eq!(clusters(work).len(), 2);
            assert!(lift(work));
            assert!(work.remaining.is_clean() && work.best.as_ref().unwrap().is_clean());
            assert_eq!(work.counts.patch_lifts, 2);
            let rest = work.scene.garment.mesh.vertices();
            let far = |v: &usize| centres.iter().all(|c| (rest[*v] - rest[*c]).norm() > 0.15);
            let stayed = (0..rest.len()).filter(far).map(|v| work.cloth.x[v] == rest[v]);
            assert!(stayed.clone().count() > 300 && stayed.clone().all(|same| same));
            // Nothing is left to lift.
            assert!(!lift(work));
        });
    }

    #[test]
    fn the_mean_way_out_of_opposite_walls_is_what_they_have_in_common() {
        with_band(0.305, unchanged, |work| {
            let centre = farthest(work, 1.0);
            dented(work, &[centre]);
            let cluster = clusters(work).remove(0);
            let coarse = Outward::new(work.scene.below, &work.scene.garment.mesh.aabb(), 0.02);
            let patch = Patch::new(work, &cluster, 0.05, 6);
            let ways = patch.ways(work, &cluster, &coarse);
            assert!(ways.len() >= 3);
            assert!(ways.iter().all(|way| way.z > 0.9), "{ways:?}");
        });
    }
}
