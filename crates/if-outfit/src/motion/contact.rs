//! Near pairs of primitives, and the half-spaces that keep them apart.

use super::params::WalkParams;
use super::scene::Scene;
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

/// What a search for contacts compares: the last clean state, and the state to go to.
pub(super) struct Search<'a> {
    pub(super) scene: &'a Scene,
    pub(super) params: &'a WalkParams,
    /// The state whose distances primitives keep a share of.
    pub(super) rest: &'a [Point],
    /// Least gap of two layers, in metres, wherever they lie in the rest state.
    pub(super) opening: Real,
    /// The last clean state, and its tree.
    pub(super) clean: &'a [Point],
    pub(super) tree: &'a Bvh,
    /// From the target at the clean state to the next one.
    pub(super) turns: &'a [Matrix3<Real>],
    /// Where vertices go if nothing is in their way.
    pub(super) predicted: &'a [Point],
    /// Pairs of triangles that may intersect, sorted.
    pub(super) tolerated: &'a [[u32; 2]],
}

impl Search<'_> {
    /// The contacts of all near primitives that the step brings near one another, in an order that
    /// does not depend on the number of threads.
    pub(super) fn contacts(&self) -> Vec<Contact> {
        let reach = self.params.gap + self.params.margin;
        let pairs = self.tree.own_pairs_within(reach, |i, _, j, _| Some([i.min(j), i.max(j)]));
        let parts: Vec<Vec<Contact>> = pairs
            .par_chunks(4096)
            .map(|pairs| {
                let mut found = Vec::new();
                for pair in pairs {
                    self.of_pair(*pair, reach, &mut found);
                }
                found
            })
            .collect();
        parts.concat()
    }

    /// The contacts of the primitives that two triangles own.
    fn of_pair(&self, [i, j]: [u32; 2], reach: Real, found: &mut Vec<Contact>) {
        let owned = [i, j].map(|t| self.scene.owned[t as usize]);
        if owned == [0, 0] || self.tolerated.binary_search(&[i, j]).is_ok() {
            return;
        }
        let t = [i, j].map(|t| self.scene.mesh.triangles()[t as usize]);
        // Boxes reject most pairs with six comparisons, where a distance takes a hundred operations.
        let corners = t.map(|t| t.map(|v| self.clean[v as usize]));
        let around = corners.map(|c| Aabb::from_points(&c).inflated(reach));
        let mut bits = owned;
        let mut edges = [[Aabb::EMPTY; 3]; 2];
        for side in 0..2 {
            for k in 0..3 {
                let [p, q] = [corners[side][k], corners[side][(k + 1) % 3]];
                edges[side][k] = Aabb::from_points(&[p, q]);
                if !around[1 - side].overlaps(&Aabb::from_points(&[p])) {
                    bits[side] &= !(1 << k);
                }
                if !around[1 - side].overlaps(&edges[side][k]) {
                    bits[side] &= !(8 << k);
                }
            }
        }
        if bits == [0, 0] {
            return;
        }
        let bit = |side: usize, k: usize| bits[side] >> k & 1 == 1;
        let are_near = |k: usize, m: usize| edges[0][k].inflated(reach).overlaps(&edges[1][m]);
        self.primitives(&t, bit, are_near, |primitives| {
            let nearest = primitives.nearest(self.clean);
            let squared = nearest.way.norm_squared();
            if squared < reach * reach && squared > 0.0 {
                found.extend(self.contact(&nearest, primitives));
            }
        });
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
        let shared = |a: &[u32], b: &[u32]| a.iter().any(|v| b.contains(v));
        let apart = !shared(&t[0], &t[1]);
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
                if apart || !shared(&e, &f) {
                    visit(Primitives::Edges([e[0], e[1], f[0], f[1]]));
                }
            }
        }
    }

    /// The half-space of two primitives; `None` if the step does not bring them near.
    fn contact(&self, nearest: &Nearest, primitives: Primitives) -> Option<Contact> {
        let mut contact = self.half_space(nearest);
        let value = contact.value(self.predicted);
        // Half of the margin: the solution moves vertices further.
        if value >= self.params.gap + 0.5 * self.params.margin {
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
        let [a, .., b] = nearest.vertices;
        let opens = self.opening > gap && self.scene.layer_of(a) != self.scene.layer_of(b);
        (if opens { self.opening } else { gap }, rest)
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

/// Growth of the gap of triangles that intersected, for each time that it has not been enough.
const GROWTH: Real = 1.5;
/// Times that it grows: to five times. Larger gaps push whole limbs away.
const MOST_GROWTH: u32 = 4;
/// Least gap of triangles that were found to intersect, in metres: rounding to single precision at
/// 2 m takes 0.2 µm. Ten times less is lost to it.
const LEAST_GAP: Real = 5e-6;
