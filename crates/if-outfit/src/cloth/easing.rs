//! The last step of a garment that is clean but drawn out in places: guarded rounds, each of which
//! ends clean again.
//!
//! Repairs end as soon as nothing meets. Where they had to push a garment far, in an armpit above
//! all, single vertices are left drawn out, and ordinary rounds that would relax them make
//! triangles meet on the way. A guarded round goes from one clean state to the next: of what
//! contacts and cloth propose, vertices of triangles that meet are taken back, in part and then
//! wholly, until exact verification finds nothing; rounds that follow keep the planes that part
//! those triangles.

use super::{Cloth, PART, PART_OWN};
use crate::inspector::{Inspector, State};
use crate::separating_plane::widest_gap;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use if_mesh::index::Bvh;
use if_mesh::measure::{Strain, edge_strain, strain_of};
use if_xpbd::separation::Separations;
use std::collections::{BTreeMap, BTreeSet};

/// Rounds without a state that is clearly better after which it is given up.
const IN_VAIN: usize = 6;
/// A state is clearly better with this share of the excess strain at most. With 0.98 the jacket of
/// o5, five layers, takes 33 rounds more to get from 60 to 59 %.
const BETTER: Real = 0.9;
/// The most that a vertex moves in a round, in metres.
const LEAP: Real = 4e-3;
/// What a vertex of a triangle that meets another keeps of its motion; the second time it keeps
/// none.
const SHARE: Real = 0.3;
/// Times that vertices are taken back in a round; then all are.
const TRIES: usize = 12;
/// Rounds over which triangles that met are held apart.
const KEPT: u32 = 10;

/// Where a garment was eased to.
pub(crate) struct Eased {
    pub(crate) positions: Vec<Point>,
    pub(crate) rounds: usize,
    /// Largest edge strain before and after, as a share.
    pub(crate) strain: [Real; 2],
}

/// What met in the last rounds, and for how many more it is held apart.
#[derive(Default)]
struct Met {
    /// Layer below, its triangle, triangle.
    layers: BTreeMap<(usize, u32, u32), u32>,
    own: BTreeMap<[u32; 2], u32>,
}

impl Met {
    fn add(&mut self, state: &State) {
        self.layers.extend(state.pairs.iter().map(|(j, p)| ((*j, p.a, p.b), KEPT)));
        self.own.extend(state.fresh.iter().map(|p| (*p, KEPT)));
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

impl Cloth<'_> {
    /// Eases the neighbourhoods of edges that changed their length by more than `drawn_strain`.
    /// `from` are clean positions, and so are those returned; `None` where no edge is drawn so far,
    /// or nothing better was found. `report` receives the round.
    pub(crate) fn ease(
        &mut self,
        from: &[Point],
        inspector: &mut Inspector<'_>,
        report: &mut dyn FnMut(usize) -> Result<(), Cancelled>,
    ) -> Result<Option<Eased>, Cancelled> {
        let start = self.strain_at(from);
        if start.max <= self.params.drawn_strain || self.params.ease_rounds == 0 {
            return Ok(None);
        }
        let mut clean = from.to_vec();
        let mut tree = Bvh::new(&self.mesh_at(&clean));
        self.gaps.fill(self.params.clearance);
        self.go_to(&clean);
        let (mut met, mut best, mut largest) = (Met::default(), None, start.max);
        let (mut least, mut vain, mut rounds) = (self.excess(from), 0, 0);
        while rounds < self.params.ease_rounds && vain < IN_VAIN {
            let drawn: BTreeSet<u32> =
                self.strained(self.params.drawn_strain).into_iter().collect();
            if drawn.is_empty() {
                break;
            }
            report(rounds)?;
            rounds += 1;
            vain += 1;
            self.hold_far_from(&drawn, self.params.repair_influence);
            self.keep_apart(&met, &clean);
            met.age();
            // A clean garment stays as it is where a step fails.
            if let Err(error) = self.round(&tree) {
                tracing::warn!(garment = self.garment.name, %error, "easing ends early");
                break;
            }
            let Some(to) = self.guarded(&clean, inspector, &mut tree, &mut met) else { break };
            clean = to;
            self.go_to(&clean);
            let (now, excess) = (self.strain_at(&clean), self.excess(&clean));
            tracing::debug!(
                garment = self.garment.name,
                round = rounds,
                largest = now.max,
                rms = now.rms,
                ends = drawn.len(),
                "eased"
            );
            if excess < least && now.rms <= start.rms && now.max <= start.max {
                vain = if excess < BETTER * least { 0 } else { vain };
                (least, largest, best) = (excess, now.max, Some(clean.clone()));
            }
        }
        let strain = [start.max, largest];
        Ok(best.map(|positions| Eased { positions, rounds, strain }))
    }

    /// As much of the way from the positions `clean` to those proposed as exact verification finds
    /// clean, ready to be stored; what met on the way is added to `met`. `None` if `clean` is not.
    fn guarded(
        &mut self,
        clean: &[Point],
        inspector: &mut Inspector<'_>,
        tree: &mut Bvh,
        met: &mut Met,
    ) -> Option<Vec<Point>> {
        let triangles = self.garment.mesh.triangles();
        let mut moved: Vec<usize> = (0..clean.len()).filter(|v| self.x[*v] != clean[*v]).collect();
        let mut way: Vec<_> = self
            .x
            .iter()
            .zip(clean)
            .map(|(x, c)| (x - c) * (LEAP / (x - c).norm().max(LEAP)))
            .collect();
        moved.iter().for_each(|v| self.x[*v] = clean[*v] + way[*v]);
        let mut taken_back = vec![false; clean.len()];
        for tries in 0.. {
            let mesh = self.mesh_at(&self.stored());
            tree.refit(mesh.vertices());
            let state = inspector.inspect(&mesh, tree);
            if state.is_clean() {
                return Some(mesh.vertices().to_vec());
            }
            if moved.is_empty() {
                return None;
            }
            met.add(&state);
            let trouble = state.trouble(triangles);
            let guilty = |v: &usize| trouble.contains(&(*v as u32));
            // Where none of what met can go back further, or not soon enough, all do.
            let all = tries >= TRIES || !moved.iter().any(guilty);
            for v in moved.iter().copied().filter(|v| all || guilty(v)) {
                way[v] *= if taken_back[v] || all { 0.0 } else { SHARE };
                taken_back[v] = true;
                self.x[v] = clean[v] + way[v];
            }
            moved.retain(|v| self.x[*v] != clean[*v]);
        }
        None
    }

    /// Holds what `met` apart on the sides where it lies at the positions `clean`.
    fn keep_apart(&mut self, met: &Met, clean: &[Point]) {
        let triangles = self.garment.mesh.triangles();
        self.parting.clear();
        for &(j, a, b) in met.layers.keys() {
            let corners = triangles[b as usize];
            let at = corners.map(|v| clean[v as usize]);
            if let Some((normal, level, gap)) = widest_gap(&at, &self.below[j].corners(a)) {
                let point = Point::from(normal * (level + gap.min(PART)));
                self.parting.extend(corners.map(|v| (v, normal, point)));
            }
        }
        self.own = Separations::new();
        for [a, b] in met.own.keys() {
            self.own.push(triangles[*a as usize], triangles[*b as usize], PART_OWN, clean);
        }
    }

    /// Sum of the squares of the strains beyond `drawn_strain` at the positions `x`.
    fn excess(&self, x: &[Point]) -> Real {
        let rest = self.garment.mesh.vertices();
        let length = |x: &[Point], [a, b]: [u32; 2]| (x[a as usize] - x[b as usize]).norm();
        let strain = |e: &[u32; 2]| edge_strain(length(rest, *e), length(x, *e));
        self.edges
            .vertices
            .iter()
            .map(|e| (strain(e) - self.params.drawn_strain).max(0.0).powi(2))
            .sum()
    }

    fn strain_at(&self, x: &[Point]) -> Strain {
        strain_of(&self.edges.vertices, self.garment.mesh.vertices(), x)
    }

    fn mesh_at(&self, x: &[Point]) -> TriMesh {
        self.garment.mesh.with_vertices(x.to_vec()).expect("the solver keeps positions finite")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::resolve::ResolveParams;
    use crate::upper_layers::Ceilings;
    use if_core::shapes::meshes::{icosphere, tube};
    use if_mesh::outward::Outward;
    use if_mesh::solid::ClosedLayer;

    /// A ball of 0.3 m, and a band of `radius` round it, on edges of 2 cm.
    fn with_band<T>(
        radius: Real,
        then: impl FnOnce(&Layer, &[&ClosedLayer], &mut Cloth, &mut Inspector) -> T,
    ) -> T {
        let tube = tube(radius, 0.2, 96, 10, false);
        let band = tube
            .with_vertices(
                tube.vertices().iter().map(|p| Point::new(p.x, p.y - 0.1, p.z)).collect(),
            )
            .unwrap();
        let (garment, ball) = (Layer::new("band", band), ClosedLayer::body(&icosphere(0.3, 4)));
        let (below, params, tree) = ([&ball], ResolveParams::default(), Bvh::new(&garment.mesh));
        let outward =
            Outward::new(&below, &garment.mesh.aabb().inflated(0.05), params.outward_cell);
        let mut cloth = Cloth::new(&garment, &tree, &below, Ceilings::default(), &outward, &params);
        cloth.ever_free.fill(true);
        let mut inspector = Inspector::new(&garment.mesh, &tree, &below).0;
        then(&garment, &below, &mut cloth, &mut inspector)
    }

    fn is_clean(garment: &Layer, below: &[&ClosedLayer], x: &[Point]) -> bool {
        let mesh = garment.mesh.with_vertices(x.to_vec()).unwrap();
        Inspector::new(&mesh, &Bvh::new(&mesh), below).1.is_clean()
    }

    #[test]
    fn a_vertex_drawn_out_comes_back_and_what_is_far_from_it_stays() {
        with_band(0.302, |garment, below, cloth, inspector| {
            let rest = garment.mesh.vertices();
            let v = (0..rest.len())
                .max_by(|a, b| {
                    (rest[*a].z - rest[*a].y.abs()).total_cmp(&(rest[*b].z - rest[*b].y.abs()))
                })
                .unwrap();
            let mut from = rest.to_vec();
            from[v] += (rest[v] - Point::origin()) * 0.25;
            let eased = cloth.ease(&from, inspector, &mut |_| Ok(())).unwrap().expect("eased");
            assert!(
                eased.strain[0] > 2.0 && eased.strain[1] < 0.5 && eased.rounds > 3,
                "{:?} {}",
                eased.strain,
                eased.rounds
            );
            assert_eq!(cloth.strain_at(&eased.positions).max, eased.strain[1]);
            assert!(is_clean(garment, below, &eased.positions));
            let far = (0..rest.len()).filter(|u| (rest[*u] - rest[v]).norm() > 0.2);
            assert!(far.map(|u| assert_eq!(eased.positions[u], rest[u])).count() > 500);
            // Then there is nothing to do.
            let again = cloth.ease(&eased.positions, inspector, &mut |_| panic!("a round"));
            assert!(matches!(again, Ok(None)));
        });
    }

    #[test]
    fn of_a_proposal_that_meets_the_body_the_rest_is_taken() {
        with_band(0.301, |garment, below, cloth, inspector| {
            let rest = garment.mesh.vertices();
            // Half of the band is drawn in, by 3 mm: there is room for that at the hems only.
            for (x, p) in cloth.x.iter_mut().zip(rest) {
                *x = Point::new(p.x * 0.99, p.y, p.z * if p.z > 0.0 { 0.99 } else { 1.01 });
            }
            let proposed = cloth.x.clone();
            let (mut tree, mut met) = (Bvh::new(&garment.mesh), Met::default());
            assert!(!is_clean(garment, below, &proposed));
            let to = cloth.guarded(rest, inspector, &mut tree, &mut met).unwrap();
            assert!(is_clean(garment, below, &to));
            let gone = |v: usize| (to[v] - rest[v]).norm() / (proposed[v] - rest[v]).norm();
            let (wholly, not) = (0..to.len()).fold((0, 0), |(w, n), v| {
                (w + usize::from(gone(v) > 0.999), n + usize::from(gone(v) < 0.001))
            });
            assert!(wholly > 200 && not > 50, "{wholly} {not}");
            // What met is held where it lies.
            assert!(!met.layers.is_empty());
            cloth.keep_apart(&met, &to);
            assert!(cloth.parting.len() > 30);
            assert!(
                cloth
                    .parting
                    .iter()
                    .all(|(v, n, point)| n.dot(&(to[*v as usize] - point)) > -1e-12)
            );
        });
    }

    #[test]
    fn what_is_not_clean_is_not_eased() {
        with_band(0.25, |garment, _, cloth, inspector| {
            let from: Vec<Point> =
                garment.mesh.vertices().iter().map(|p| p + (p - Point::origin()) * 0.02).collect();
            cloth.x.copy_from_slice(&from);
            let (mut tree, mut met) = (Bvh::new(&garment.mesh), Met::default());
            assert!(cloth.guarded(&from, inspector, &mut tree, &mut met).is_none());
        });
    }
}
