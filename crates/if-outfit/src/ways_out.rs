//! Vertices whose nearest way out of the body leads back under their own garment take another one.
//!
//! A sleeve that lies beside its arm cuts through it. What lies beyond the arm's axis is nearest to the
//! skin on the far side: pushed out there it would come to lie between the arm and the rest of the
//! sleeve, and the arm would stick through the hole between. Near the axis neighbours would part.
//!
//! ```text
//! outwards ← away from the rest of the garment that vertices face, across the limb
//! seeds ← vertices inside the body, in a part that is thin there, whose nearest exit lies under the
//!     garment as given, or (if that was not enough) sideways of outwards
//! for each patch of seeds
//!     its way ← outwards, or the direction near that in which more exits do not lie under the garment
//! from these along edges, as long as any is found: vertices whose nearest exit leads against the way or
//!     sideways of it, and those that lie outside beyond the limb, under the garment
//! ```

use crate::repair::is_clear;
use crate::way::Way;
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_mesh::index::Bvh;
use if_mesh::solid::ClosedLayer;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Which vertices take another way out than the nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reroute {
    /// Those whose nearest way leads back.
    Back,
    /// Those whose nearest way leads back or sideways.
    Sideways,
}

impl Reroute {
    /// Cosine between a vertex's nearest way out and another direction under which it takes that.
    fn cosine(self) -> Real {
        match self {
            Self::Back => 0.0,
            Self::Sideways => 0.3,
        }
    }
}

/// Vertices less deep inside the body take the nearest way, in metres.
const DEEP: Real = 4e-3;
/// The longest way, in metres: limbs are thinner.
const LONGEST: Real = 0.06;
/// An exit is looked at this far beyond the skin, in metres.
const BEYOND: Real = 2e-3;
/// An exit at least this deep under the garment leads back under it, in metres: the sheets of a thick
/// garment lie nearer to one another.
const UNDER: Real = 5e-3;
/// A vertex outside is led through a limb that is at most this far away, in metres.
const NEAR: Real = 0.03;
/// What a patch faces lies between these distances from it, in metres: nearer there is the other
/// sheet of a cuff.
const FACED: [Real; 2] = [0.025, 0.15];
/// Cosine of the largest angle between a way and `outwards`.
const LEAST_OUTWARD: Real = 0.75;
/// Directions that are tried.
const DIRECTIONS: usize = 64;

/// A garment over layers below, as given.
pub(crate) struct Given<'a> {
    pub(crate) x: &'a [Point],
    /// Holds the garment.
    pub(crate) tree: &'a Bvh,
    /// The layers below, the body first.
    pub(crate) below: &'a [&'a ClosedLayer],
    pub(crate) neighbours: &'a Neighbours,
    pub(crate) reroute: Reroute,
}

impl Given<'_> {
    /// The other ways out; `None` if no vertex may need one, whatever is rerouted. `inside` are the
    /// vertices inside layers below, ascending; `close` closes the garment, which few outfits need.
    pub(crate) fn ways_out(
        &self,
        inside: &[u32],
        close: impl FnOnce() -> ClosedLayer,
    ) -> Option<Vec<Way>> {
        let doubtful: Vec<u32> =
            inside.par_iter().copied().filter(|v| self.is_doubtful(*v)).collect();
        if doubtful.is_empty() {
            return None;
        }
        let own = &close();
        let directions = directions();
        let leads_under =
            |v: &u32| self.nearest_exits(self.at(*v)).any(|(exit, _)| is_under(own, &exit, UNDER));
        let leads_sideways =
            |v: &u32| self.is_against(self.at(*v), &self.outwards(&[*v], &directions));
        let leads_back =
            |v: &u32| leads_under(v) || (self.reroute == Reroute::Sideways && leads_sideways(v));
        let seeds: Vec<u32> = doubtful.into_par_iter().filter(leads_back).collect();
        let patches = self.patches(&seeds);
        let mut ways: Vec<Way> =
            patches.iter().flat_map(|patch| self.ways_of(patch, &directions, own)).collect();
        self.spread(&mut ways, inside, own);
        Some(ways)
    }

    fn at(&self, v: u32) -> &Point {
        &self.x[v as usize]
    }

    /// Whether a vertex inside lies in a thin part of the body, and its nearest exit faces the garment.
    fn is_doubtful(&self, v: u32) -> bool {
        let p = self.at(v);
        let hits = |tree: &Bvh, from: &Point, way: Vector| {
            tree.first_hit(from, &(from + way), |_| true).is_some()
        };
        let deep = self.below[0].sided(p, 0.0).filter(|s| s.distance < -DEEP);
        deep.is_some_and(|s| hits(self.below[0].bvh(), p, -s.normal * LONGEST))
            && self.nearest_exits(p).any(|(exit, normal)| hits(self.tree, &exit, normal * FACED[1]))
    }

    /// The `seeds` in patches: those together that are connected by edges, or by two edges and a vertex
    /// between.
    fn patches(&self, seeds: &[u32]) -> Vec<Vec<u32>> {
        let mut open = vec![false; self.x.len()];
        seeds.iter().for_each(|v| open[*v as usize] = true);
        let mut fresh = vec![true; self.x.len()];
        let mut patches = Vec::new();
        for v in seeds {
            if !std::mem::take(&mut open[*v as usize]) {
                continue;
            }
            let mut patch = vec![*v];
            let mut next = 0;
            while next < patch.len() {
                for (between, _) in self.neighbours.of(patch[next]) {
                    // Once looked around at, a vertex has no open seed beside it.
                    if std::mem::take(&mut fresh[*between as usize]) {
                        let around = self.neighbours.of(*between).iter().map(|(w, _)| *w);
                        let both = std::iter::once(*between).chain(around);
                        patch.extend(both.filter(|w| std::mem::take(&mut open[*w as usize])));
                    }
                }
                next += 1;
            }
            patches.push(patch);
        }
        patches
    }

    /// The ways of a patch, all in one direction: that in which most of it has one, and of those the one
    /// nearest to outwards. None if most of it has none.
    fn ways_of(&self, patch: &[u32], directions: &[Vector], own: &ClosedLayer) -> Vec<Way> {
        let outwards = self.outwards(patch, directions);
        let near = directions.par_iter().filter(|d| outwards.dot(d) > LEAST_OUTWARD);
        let ways = |direction: &Vector| -> (usize, Real, Vec<Way>) {
            let ways: Vec<Way> = patch
                .iter()
                .filter(|v| self.is_against(self.at(**v), direction))
                .filter_map(|v| self.way_along(*v, direction, own))
                .collect();
            (patch.len() - ways.len(), -outwards.dot(direction), ways)
        };
        let all: Vec<_> = near.chain([outwards].par_iter()).map(ways).collect();
        let best = all.into_iter().min_by(|a, b| (a.0.cmp(&b.0)).then(a.1.total_cmp(&b.1)));
        best.filter(|(without, ..)| 2 * without <= patch.len()).map_or(Vec::new(), |b| b.2)
    }

    /// The direction from the rest of the garment, as far as the `patch` faces it, to the patch; without
    /// its part along the limb.
    fn outwards(&self, patch: &[u32], directions: &[Vector]) -> Vector {
        let skin = self.below[0].bvh();
        let [nearest, farthest] = FACED;
        let of_vertex = |v: &u32| {
            let p = self.at(*v);
            let mut limb = Matrix3::zeros();
            let mut facing = Vector::zeros();
            for d in directions {
                let end = p + d * farthest;
                let skin = skin.first_hit(p, &end, |_| true).map_or(1.0, |hit| hit.parameter);
                limb += d * d.transpose() * skin.powi(2);
                if self.tree.first_hit(&(p + d * nearest), &end, |_| true).is_some() {
                    facing += d;
                }
            }
            (limb, facing)
        };
        let parts: Vec<(Matrix3<Real>, Vector)> = patch.par_iter().map(of_vertex).collect();
        let limb = parts.iter().map(|part| part.0).sum::<Matrix3<Real>>().symmetric_eigen();
        // Along the limb the skin is farthest.
        let axis = limb.eigenvectors.column(limb.eigenvalues.imax()).into_owned();
        let facing = parts.iter().map(|part| part.1).sum::<Vector>();
        unit_or_zero(&(axis * axis.dot(&facing) - facing))
    }

    /// Adds the ways of vertices beside those that have one.
    fn spread(&self, ways: &mut Vec<Way>, inside: &[u32], own: &ClosedLayer) {
        let mut has_way = vec![false; self.x.len()];
        ways.iter().for_each(|way| has_way[way.vertex as usize] = true);
        let mut next = 0;
        while next < ways.len() {
            let Way { vertex, direction, .. } = ways[next];
            next += 1;
            for (v, _) in self.neighbours.of(vertex) {
                let p = self.at(*v);
                let enters = |layer: &&ClosedLayer| {
                    layer.bvh().first_hit(p, &(p + direction * NEAR), |_| true).is_some()
                };
                let goes_along = || match inside.binary_search(v) {
                    Ok(_) => self.is_against(p, &direction),
                    Err(_) => {
                        self.below.iter().any(enters)
                            && is_under(own, &(p - direction * UNDER), 0.5 * UNDER)
                    }
                };
                if !has_way[*v as usize]
                    && goes_along()
                    && let Some(way) = self.way_along(*v, &direction, own)
                {
                    has_way[*v as usize] = true;
                    ways.push(way);
                }
            }
        }
    }

    /// The points just beyond the nearest exits from the layers that `p` is inside of, and the normals
    /// there.
    fn nearest_exits(&self, p: &Point) -> impl Iterator<Item = (Point, Vector)> {
        let sided = self.below.iter().filter_map(|layer| layer.sided(p, 0.0));
        sided.filter(|s| s.distance < 0.0).map(|s| (s.point + s.normal * BEYOND, s.normal))
    }

    /// Whether a nearest way out from `p` leads against `direction`, or sideways of it if that counts.
    fn is_against(&self, p: &Point, direction: &Vector) -> bool {
        self.nearest_exits(p).any(|(_, normal)| normal.dot(direction) < self.reroute.cosine())
    }

    /// The way of vertex `v` along `direction` to the first point that is neither in a layer nor under
    /// the garment; `None` if there is none, or it lies under the garment.
    fn way_along(&self, v: u32, direction: &Vector, own: &ClosedLayer) -> Option<Way> {
        let p = self.at(v);
        let end = p + direction * LONGEST;
        let mut length = 0.0;
        loop {
            let from = p + direction * length;
            let hits = self.below.iter().filter_map(|l| l.bvh().first_hit(&from, &end, |_| true));
            let hit = hits.map(|hit| hit.parameter).min_by(Real::total_cmp)?;
            length += hit * (LONGEST - length) + BEYOND;
            if length >= LONGEST {
                return None;
            }
            let point = p + direction * length;
            if is_clear(&point, self.below, 0.0) {
                let way = Way { vertex: v, direction: *direction, point };
                return (!is_under(own, &point, 0.0)).then_some(way);
            }
        }
    }
}

/// Whether `p` lies deeper than `depth` under a garment.
fn is_under(garment: &ClosedLayer, p: &Point, depth: Real) -> bool {
    garment.sided(p, 0.0).is_some_and(|s| s.distance < -depth)
}

/// Unit vectors, evenly spread over the sphere by the golden angle.
fn directions() -> Vec<Vector> {
    let golden = std::f64::consts::PI * (3.0 - Real::sqrt(5.0));
    let direction = |k: usize| {
        let y = 1.0 - (2 * k + 1) as Real / DIRECTIONS as Real;
        let (sin, cos) = (golden * k as Real).sin_cos();
        let r = (1.0 - y * y).sqrt();
        Vector::new(r * cos, y, r * sin)
    };
    (0..DIRECTIONS).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::{Layer, Outfit};
    use crate::params::ResolveParams;
    use crate::resolve::{Resolved, resolve};
    use if_core::edges::Edges;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::tube;

    fn moved(mesh: &TriMesh, by: Vector) -> TriMesh {
        mesh.with_vertices(mesh.vertices().iter().map(|p| p + by).collect()).unwrap()
    }

    /// An arm of 5 cm about the y axis, and a sleeve of 7 cm whose axis is moved along x.
    fn scene(x: Real) -> Outfit {
        on_arm(0.4, x)
    }

    /// The same on an arm of this length, on rings 12.5 mm apart.
    fn on_arm(length: Real, x: Real) -> Outfit {
        let arm = tube(0.025, length, 48, (length / 0.0125).round() as u32, true);
        let arm = moved(&arm, Vector::new(0.0, -0.5 * length, 0.0));
        let sleeve = moved(&tube(0.035, 0.1, 32, 8, false), Vector::new(x, -0.05, 0.0));
        Outfit { body: Layer::new("arm", arm), garments: vec![Layer::new("sleeve", sleeve)] }
    }

    fn ways(outfit: &Outfit, reroute: Reroute) -> Vec<Way> {
        let (arm, sleeve) = (&outfit.body.mesh, &outfit.garments[0].mesh);
        let body = ClosedLayer::body(arm);
        let x = sleeve.vertices();
        let is_in = |v: &u32| body.sided(&x[*v as usize], 0.0).is_some_and(|s| s.distance < 0.0);
        let inside: Vec<u32> = (0..x.len() as u32).filter(is_in).collect();
        let neighbours = &Neighbours::new(&Edges::new(sleeve), x);
        let given = Given { x, tree: &Bvh::new(sleeve), below: &[&body], neighbours, reroute };
        let close = || ClosedLayer::garment(sleeve, &body, arm);
        given.ways_out(&inside, close).unwrap_or_default()
    }

    fn resolved(outfit: &Outfit) -> Resolved {
        resolve(outfit, &ResolveParams::default(), &mut Silent).unwrap()
    }

    #[test]
    fn a_sleeve_that_cuts_through_its_arm_is_led_round_it() {
        // Its near side, at x = 5 mm, is nearer to the skin at x = 25 mm than to that on the other side.
        let outfit = scene(0.04);
        let ways = ways(&outfit, Reroute::Back);
        assert!(!ways.is_empty());
        for way in &ways {
            assert!(way.direction.x < -0.9, "{way:?}");
            let p = outfit.garments[0].mesh.vertices()[way.vertex as usize];
            assert!(way.left(&p) > 0.0 && way.point.x < 0.0, "{way:?}");
        }
        let resolved = resolved(&outfit);
        assert!(resolved.report.is_proven());
        let layer = &resolved.report.layers[0];
        assert!(layer.strategies.ways_out >= ways.len());
        // The arm is in the sleeve, not beside it.
        let x = resolved.outfit.garments[0].mesh.vertices();
        assert!(x.iter().any(|p| p.x < -0.025) && x.iter().any(|p| p.x > 0.025));
    }

    #[test]
    fn a_sleeve_that_is_nearest_to_its_own_side_takes_the_nearest_way() {
        let outfit = scene(0.02);
        assert_eq!(ways(&outfit, Reroute::Back), []);
        assert_eq!(resolved(&outfit).report.layers[0].strategies.ways_out, 0);
    }

    #[test]
    fn what_would_part_at_the_axis_is_led_to_one_side_if_the_nearest_ways_do_not_end_clean() {
        // Its near side lies on the axis.
        let outfit = on_arm(0.6, 0.035);
        assert_eq!(ways(&outfit, Reroute::Back), []);
        let sideways = ways(&outfit, Reroute::Sideways);
        assert!(sideways.len() > 30 && sideways.iter().all(|way| way.direction.x < -0.9));
        // Along the nearest ways it takes 35 rounds.
        let mut params = ResolveParams::default();
        params.effort.rounds = 20;
        let resolved = resolve(&outfit, &params, &mut Silent).unwrap();
        assert!(resolved.report.is_proven());
        let layer = &resolved.report.layers[0];
        assert_eq!(layer.strategies.ways_out, sideways.len());
        assert!(layer.rounds > 40, "both times count: {}", layer.rounds);
    }

    #[test]
    fn directions_are_unit_vectors_on_all_sides() {
        let directions = directions();
        assert!(directions.iter().all(|d| (d.norm() - 1.0).abs() < 1e-12));
        assert!(directions.iter().sum::<Vector>().norm() < 1.0);
    }
}
