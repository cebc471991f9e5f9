//! Near pairs of primitives, and the half-spaces that keep them apart.

use super::params::WalkParams;
use super::scene::Scene;
use super::tolerated::Tolerated;
use if_core::aabb::Aabb;
use if_core::closest::closest_on_triangle;
use if_core::math::{Point, Real, Vector};
use if_mesh::index::Bvh;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// One linear inequality: `n · Σ cᵢ xᵢ ≥ gap`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// A vertex and a triangle, or two edges; all four count as the name of the contact.
    pub(super) vertices: [u32; 4],
    /// Sum to zero.
    pub(super) coefficients: [Real; 4],
    /// Unit vector.
    pub(super) normal: Vector,
    pub(super) gap: Real,
}

impl Contact {
    pub(super) fn value(&self, x: &[Point]) -> Real {
        let at = |k: usize| self.normal.dot(&x[self.vertices[k] as usize].coords);
        (0..4).map(|k| self.coefficients[k] * at(k)).sum()
    }
}

/// Two primitives of four vertices in all.
#[derive(Clone, Copy, Debug)]
enum Primitives {
    VertexTriangle([u32; 4]),
    Edges([u32; 4]),
}

/// Distance and nearest points: `Σ cᵢ xᵢ` is the vector from the second to the first.
struct Nearest {
    vertices: [u32; 4],
    coefficients: [Real; 4],
    way: Vector,
}

impl Primitives {
    fn nearest(self, x: &[Point]) -> Nearest {
        match self {
            Self::VertexTriangle(vertices) => {
                let [p, a, b, c] = vertices.map(|v| x[v as usize]);
                let ([wa, wb, wc], _) = closest_on_triangle(&p, &a, &b, &c);
                let way = (p - a) - (b - a) * wb - (c - a) * wc;
                Nearest { vertices, coefficients: [1.0, -wa, -wb, -wc], way }
            }
            Self::Edges(vertices) => {
                let [a, b, c, d] = vertices.map(|v| x[v as usize]);
                let (s, t) = between_segments(&a, &b, &c, &d);
                let way = (a - c) + (b - a) * s - (d - c) * t;
                Nearest { vertices, coefficients: [1.0 - s, s, t - 1.0, -t], way }
            }
        }
    }

    /// The length of the shortest edge of the triangle, or of the two edges.
    fn least_edge(self, x: &[Point]) -> Real {
        let length = |a: u32, b: u32| (x[a as usize] - x[b as usize]).norm();
        match self {
            Self::VertexTriangle([_, a, b, c]) => length(a, b).min(length(b, c)).min(length(c, a)),
            Self::Edges([a, b, c, d]) => length(a, b).min(length(c, d)),
        }
    }
}

/// Places of the nearest points of the segments `ab` and `cd`, from 0 to 1.
fn between_segments(a: &Point, b: &Point, c: &Point, d: &Point) -> (Real, Real) {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let share = |x: Real| if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.5 };
    let s = share((uv * vw - vv * uw) / (uu * vv - uv * uv));
    let t = share((uv * s + vw) / vv);
    (share((uv * t - uw) / uu), t)
}

/// Gaps in metres to which the rest state is opened, wherever primitives lie in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opening {
    /// Of two layers.
    pub(super) layers: Real,
    /// Of a garment and itself, where its edges are longer; 0 for none.
    pub(super) own: Real,
}

/// What a search for contacts compares: the last clean state, and the state to go to.
pub(super) struct Search<'a> {
    pub(super) scene: &'a Scene,
    pub(super) params: &'a WalkParams,
    /// The state whose distances primitives keep a share of.
    pub(super) rest: &'a [Point],
    /// Gaps that are larger than those of a step, if the rest state is opened.
    pub(super) opening: Option<Opening>,
    /// The last clean state, and its tree.
    pub(super) clean: &'a [Point],
    pub(super) tree: &'a Bvh,
    /// From the target at the clean state to the next one.
    pub(super) turns: &'a [Matrix3<Real>],
    /// Where vertices go if nothing is in their way.
    pub(super) predicted: &'a [Point],
    /// Pairs of triangles that may intersect.
    pub(super) tolerated: &'a Tolerated,
    /// Triangles that the step concerns: of two others no contact is looked for.
    pub(super) concerned: &'a [bool],
}

/// Where a triangle is in the last clean state, and how it moves in the step.
#[derive(Clone, Copy)]
struct Moving {
    around: Aabb,
    /// Mean displacement of the corners, and the largest deviation of one from it.
    shift: Vector,
    spread: Real,
}

impl Moving {
    fn new(corners: &[Point; 3], predicted: [Point; 3]) -> Self {
        let moved = [0, 1, 2].map(|k: usize| predicted[k] - corners[k]);
        let shift = (moved[0] + moved[1] + moved[2]) / 3.0;
        let spread = moved.iter().map(|m| (m - shift).norm_squared()).fold(0.0, Real::max).sqrt();
        Self { around: Aabb::from_points(corners), shift, spread }
    }
}

impl Search<'_> {
    /// The contacts of all near primitives that the step brings near one another, in an order that
    /// does not depend on the number of threads.
    pub(super) fn contacts(&self) -> Vec<Contact> {
        let at = |t: &[u32; 3], x: &[Point]| t.map(|v| x[v as usize]);
        let triangles = self.scene.mesh.triangles().par_iter().with_min_len(1024);
        let moving: Vec<Moving> =
            triangles.map(|t| Moving::new(&at(t, self.clean), at(t, self.predicted))).collect();
        let most = self.params.gap + self.params.margin;
        let is_concerned = |t: u32| self.concerned[t as usize];
        self.tree.own_pairs_within(most, is_concerned, |i, ti, j, tj, found| {
            let (pair, corners) = if i < j { ([i, j], [ti, tj]) } else { ([j, i], [tj, ti]) };
            if self.may_meet(pair, &moving) {
                self.of_pair(pair, corners, &moving, found);
            }
        })
    }

    /// Distance in the predicted state from which on there is no contact. Half of the margin: the
    /// solution moves vertices further.
    fn limit(&self) -> Real {
        self.params.gap + 0.5 * self.params.margin
    }

    /// Distance in the clean state from which on two triangles cannot come nearer than the limit.
    fn reach(&self, [a, b]: [&Moving; 2]) -> Real {
        let nearer = (a.shift - b.shift).norm() + a.spread + b.spread;
        (self.limit() + nearer).min(self.params.gap + self.params.margin)
    }

    /// Whether primitives that two triangles own may have a contact.
    fn may_meet(&self, [i, j]: [u32; 2], moving: &[Moving]) -> bool {
        if [i, j].map(|t| self.scene.owned[t as usize]) == [0, 0] {
            return false;
        }
        let t = [i, j].map(|t| self.scene.mesh.triangles()[t as usize]);
        // The boxes of neighbours overlap.
        let may_meet = if apart(&t) {
            let both = [i, j].map(|t| &moving[t as usize]);
            let squared = both[0].around.gap_squared(&both[1].around);
            // The reach is more than the limit: a root is drawn for few.
            squared < self.limit().powi(2) || squared < self.reach(both).powi(2)
        } else {
            self.folds(&t)
        };
        may_meet && !self.tolerated.permits([i, j])
    }

    /// Whether two triangles with a common corner fold: other corners of the two come nearer than at
    /// rest. Most of the near pairs of a mesh are such neighbours, and few of them fold.
    fn folds(&self, t: &[[u32; 3]; 2]) -> bool {
        let squared = |x: &[Point], a: u32, b: u32| (x[a as usize] - x[b as usize]).norm_squared();
        let others = |k: usize| t[k].into_iter().filter(move |v| !t[1 - k].contains(v));
        others(0).any(|a| {
            let nearer =
                |b| squared(self.predicted, a, b) < FOLDED * FOLDED * squared(self.rest, a, b);
            others(1).any(nearer)
        })
    }

    /// The contacts of the primitives that two triangles with these corners own.
    fn of_pair(
        &self,
        [i, j]: [u32; 2],
        corners: [&[Point; 3]; 2],
        moving: &[Moving],
        found: &mut Vec<Contact>,
    ) {
        let both = [i, j].map(|t| &moving[t as usize]);
        let reach = self.reach(both);
        let near = reach * reach;
        // Boxes reject most pairs with a few comparisons, where a distance takes a hundred
        // operations.
        let t = [i, j].map(|t| self.scene.mesh.triangles()[t as usize]);
        let mut bits = [i, j].map(|t| self.scene.owned[t as usize]);
        let mut edges = [[Aabb::EMPTY; 3]; 2];
        for side in 0..2 {
            let corners = corners[side];
            let other = &both[1 - side].around;
            for k in 0..3 {
                if bits[side] & (1 << k) != 0 && other.distance_squared(&corners[k]) >= near {
                    bits[side] &= !(1 << k);
                }
                if bits[side] & (8 << k) != 0 {
                    edges[side][k] = Aabb::from_points(&[corners[k], corners[(k + 1) % 3]]);
                    if other.gap_squared(&edges[side][k]) >= near {
                        bits[side] &= !(8 << k);
                    }
                }
            }
        }
        if bits == [0, 0] {
            return;
        }
        let bit = |side: usize, k: usize| bits[side] >> k & 1 == 1;
        let are_near = |k: usize, m: usize| edges[0][k].gap_squared(&edges[1][m]) < near;
        self.primitives(&t, bit, are_near, |primitives| {
            let nearest = primitives.nearest(self.clean);
            let squared = nearest.way.norm_squared();
            if squared < near && squared > 0.0 && !self.stays_apart(&nearest) {
                found.extend(self.contact(&nearest, primitives));
            }
        });
    }

    /// Whether the nearest points of two primitives are predicted to be farther apart than the limit,
    /// and not to have passed each other.
    fn stays_apart(&self, nearest: &Nearest) -> bool {
        let at = |k: usize| {
            self.predicted[nearest.vertices[k] as usize].coords * nearest.coefficients[k]
        };
        let now = at(0) + at(1) + at(2) + at(3);
        let (along, squared) = (now.dot(&nearest.way), now.norm_squared());
        let limit = self.limit() / ALONG;
        along > 0.0
            && squared > limit * limit
            && along * along > ALONG * ALONG * squared * nearest.way.norm_squared()
    }

    /// Calls `visit` with the owned pairs of primitives of two triangles that share no vertex; of
    /// edges, those for which `are_near` holds as well.
    fn primitives(
        &self,
        t: &[[u32; 3]; 2],
        owned: impl Fn(usize, usize) -> bool,
        are_near: impl Fn(usize, usize) -> bool,
        mut visit: impl FnMut(Primitives),
    ) {
        let apart = apart(t);
        for side in 0..2 {
            let [a, b, c] = t[1 - side];
            for k in (0..3).filter(|k| owned(side, *k)) {
                let p = t[side][k];
                if apart || ![a, b, c].contains(&p) {
                    visit(Primitives::VertexTriangle([p, a, b, c]));
                }
            }
        }
        for k in (0..3).filter(|k| owned(0, 3 + k)) {
            let e = [t[0][k], t[0][(k + 1) % 3]];
            for m in (0..3).filter(|m| owned(1, 3 + m) && are_near(k, *m)) {
                let f = [t[1][m], t[1][(m + 1) % 3]];
                if apart || !e.iter().any(|v| f.contains(v)) {
                    visit(Primitives::Edges([e[0], e[1], f[0], f[1]]));
                }
            }
        }
    }

    /// The half-space of two primitives; `None` if the step does not bring them near.
    fn contact(&self, nearest: &Nearest, primitives: Primitives) -> Option<Contact> {
        let mut contact = self.half_space(nearest);
        let value = contact.value(self.predicted);
        if value >= self.limit() {
            return None;
        }
        let (gap, rest) = self.gap(primitives);
        contact.gap = gap;
        // Neighbours in a mesh keep their distances without help.
        (value < gap + (0.5 * self.params.margin).min(0.5 * rest.max(gap))).then_some(contact)
    }

    /// The gap that two primitives keep, and their distance in the rest state.
    fn gap(&self, primitives: Primitives) -> (Real, Real) {
        let nearest = primitives.nearest(self.rest);
        let rest = nearest.way.norm();
        let gap = self.params.gap.min(self.params.share * rest);
        let opened = self.opening.map_or(0.0, |opening| self.opened(opening, primitives));
        (gap.max(opened), rest)
    }

    /// The gap to which two primitives open.
    fn opened(&self, Opening { layers, own }: Opening, primitives: Primitives) -> Real {
        let (Primitives::VertexTriangle([first, .., last]) | Primitives::Edges([first, .., last])) =
            primitives;
        let layer = self.scene.layer_of(first);
        if layer != self.scene.layer_of(last) {
            layers
        } else if layer > 0 && own > 0.0 && primitives.least_edge(self.rest) > LONG * own {
            own
        } else {
            0.0
        }
    }

    /// The half-space along the nearest points of the clean state, turned.
    fn half_space(&self, nearest: &Nearest) -> Contact {
        let Nearest { vertices, coefficients, way } = *nearest;
        let turn = |k: usize| self.turns[vertices[k] as usize] * (way * coefficients[k].abs());
        let normal = (turn(0) + turn(1) + turn(2) + turn(3)).try_normalize(0.0);
        Contact { vertices, coefficients, normal: normal.unwrap_or_else(Vector::x), gap: 0.0 }
    }

    /// Contacts that keep two triangles apart for certain, if they can be met: each corner of the
    /// one beyond each corner of the other along the line of their nearest points. Primitives of
    /// two triangles with a common corner are kept apart one by one.
    ///
    /// `times` counts how often this has not been enough; the gap grows with it.
    pub(super) fn separation(&self, [i, j]: [u32; 2], times: u32, found: &mut Vec<Contact>) {
        let t = [i, j].map(|t| self.scene.mesh.triangles()[t as usize]);
        let growth = GROWTH.powi(times.min(MOST_GROWTH) as i32);
        let mut all: Vec<(Nearest, Real)> = Vec::new();
        self.primitives(
            &t,
            |_, _| true,
            |_, _| true,
            |primitives| {
                all.push((primitives.nearest(self.clean), self.gap(primitives).0.max(LEAST_GAP)));
            },
        );
        if t[0].iter().any(|v| t[1].contains(v)) {
            for (nearest, gap) in all.iter().filter(|(n, _)| n.way != Vector::zeros()) {
                found.push(Contact { gap: gap * growth, ..self.half_space(nearest) });
            }
            return;
        }
        let least = all.iter().min_by(|a, b| a.0.way.norm().total_cmp(&b.0.way.norm()));
        let Some((nearest, gap)) = least.filter(|(n, _)| n.way != Vector::zeros()) else { return };
        let slab = self.half_space(nearest);
        // The way leads from the second primitives to the first.
        let first = if t[0].contains(&nearest.vertices[0]) { 0 } else { 1 };
        for a in t[first] {
            for b in t[1 - first] {
                found.push(Contact {
                    vertices: [a, b, a, b],
                    coefficients: [1.0, -1.0, 0.0, 0.0],
                    normal: slab.normal,
                    gap: 0.5 * gap * growth,
                });
            }
        }
    }
}

/// Whether two triangles have no corner in common.
fn apart(t: &[[u32; 3]; 2]) -> bool {
    // All nine comparisons, without a branch that may be mispredicted.
    let is_one = |v: u32| t[1].iter().fold(false, |is, w| is | (v == *w));
    !t[0].iter().fold(false, |any, v| any | is_one(*v))
}

/// Share of their distance at rest below which corners of neighbours count as folded. A contact acts
/// at half of the distance; with 0.9 as many more are found, and none of them acts.
const FOLDED: Real = 0.75;
/// Cosine of the angle by which the way between two primitives may turn in a step for the distance
/// alone to decide: 37 degrees, where steps turn by six.
const ALONG: Real = 0.8;
/// Shortest edge, in gaps, of a garment that opens to itself: neighbours on shorter ones are nearer
/// than the gap as they are made.
const LONG: Real = 20.0;
/// Growth of the gap of triangles that intersected, for each time that it has not been enough.
const GROWTH: Real = 1.5;
/// Times that it grows: to five times. Larger gaps push whole limbs away.
const MOST_GROWTH: u32 = 4;
/// Least gap of triangles that were found to intersect, in metres: rounding to single precision at
/// 2 m takes 0.2 µm. Ten times less is lost to it.
const LEAST_GAP: Real = 5e-6;

#[cfg(test)]
mod tests {
    use super::super::tests::{arm, bent};
    use super::super::turn::turns;
    use super::super::{WalkParams, Walker};
    use super::*;
    use if_core::monitor::Silent;

    #[test]
    fn a_search_finds_the_contacts_of_a_search_of_all_pairs() {
        let mut walker = Walker::new(&arm(), WalkParams::default()).unwrap();
        let rest = walker.rest().to_vec();
        walker.walk(18, &|t| bent(&rest, t * 1.8), &mut Silent).unwrap();
        let target = bent(&rest, 1.9);
        let turns = turns(&walker.scene, &walker.target, &target);
        let predicted = walker.predicted(&target, &turns);
        let search = Search {
            scene: &walker.scene,
            params: &walker.params,
            rest: &walker.rest,
            opening: None,
            clean: &walker.clean.x,
            tree: &walker.clean.tree,
            turns: &turns,
            predicted: &predicted,
            tolerated: &walker.tolerated,
            concerned: &vec![true; walker.scene.mesh.triangles().len()],
        };
        let found = search.contacts();
        let has = |c: &Contact| found.iter().any(|f| f.vertices == c.vertices);
        let reach = walker.params.gap + walker.params.margin;
        let triangles = walker.scene.mesh.triangles();
        let (mut far, mut acting) = (0, 0);
        for i in 0..triangles.len() {
            for j in i + 1..triangles.len() {
                let t = [triangles[i], triangles[j]];
                let is_owned =
                    |side: usize, k: usize| walker.scene.owned[[i, j][side]] >> k & 1 == 1;
                search.primitives(
                    &t,
                    is_owned,
                    |_, _| true,
                    |primitives| {
                        let nearest = primitives.nearest(search.clean);
                        if nearest.way.norm() >= reach {
                            return;
                        }
                        let Some(contact) = search.contact(&nearest, primitives) else { return };
                        // Neighbours that do not fold are left out, and none of them pushes.
                        if apart(&t) {
                            assert!(has(&contact), "{i} {j} {contact:?}");
                            far += 1;
                        } else if contact.value(&predicted) < contact.gap {
                            assert!(has(&contact), "{i} {j} {contact:?}");
                            acting += 1;
                        }
                    },
                );
            }
        }
        assert!(far > 500 && acting > 0, "{far} {acting}");
        assert!(found.len() < 2 * far, "{} {far}", found.len());
    }
}
