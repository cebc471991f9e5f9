//! Contacts between moving vertices and faces, and between moving edges: self-collision, and layers
//! that move together.

use crate::constraint::{Constraint, Counters, Residual, Stage};
use if_core::closest::{Feature, closest_on_triangle};
use if_core::math::{Point, Real, Vector, area_vector};

/// Sine of the angle below which two edges count as parallel and have no common normal. Ten times
/// more drops contacts of ordinary meshes; at ten times less the normal carries 1e-12 of noise.
const PARALLEL: Real = 1e-4;

/// The farthest that a visit moves a vertex, in times what the contact lacks. The corner of a
/// triangle moves a point of weight b by b: where only that corner is free, or light, it is moved
/// by 1/b of what is missing. Up to 4 the centroid of a triangle and the middle of an edge are
/// brought out at once; without a bound, a contact beside a pinned corner throws the free one
/// across the scene (220 times its size, in `tests/stability`). Such a contact takes some visits
/// more.
const LEVER: Real = 4.0;

/// Vertex–face and edge–edge contacts with a remembered side.
///
/// With the unit normal n of the triangle, or `n = unit((b − a) × (d − c))` of the edges (a, b) and
/// (c, d), both taken anew at each visit, the nearest points p and q, and the side s = ±1:
///
/// ```text
/// C = s n·(p − q) − gap ≥ 0        Δxₖ = wₖ gₖ s n max(0, −C) / Σ wₖ gₖ²
/// ```
///
/// where `gₖ` are the weights of p (counted positive) and of q (negative). They sum to zero, so
/// momentum stays; n does not need differentiating, since p − q is parallel to it where C is
/// stationary. A pair that starts apart keeps its side, however it moves in between; a pair
/// pushed with the side on which it should be is brought there.
///
/// A contact sleeps while the nearest points are nearer to a border of the triangle or to an end of
/// an edge than inside, and are farther apart sideways than the gap: what is there is for the
/// neighbouring contacts to hold.
///
/// # Source
///
/// Vertex–face and edge–edge tests of [Bridson et al. 2002]; position-based form of [Müller et al.
/// 2007], section 4.3, with the side remembered as in [Müller et al. 2015].
#[derive(Clone, Debug)]
pub struct PairContacts {
    /// Vertex and triangle, or edge and edge.
    vertices: Vec<[u32; 4]>,
    /// Side times one, and the gap in metres.
    sides: Vec<Real>,
    gaps: Vec<Real>,
    kinds: Vec<Kind>,
    /// What each contact did in this substep; as long as the others only between `begin_substep`
    /// and the next change.
    pushed: Vec<Pushed>,
    degenerate: u64,
    /// The farthest that the two sides may be pushed apart in one visit, in metres.
    pub max_push: Real,
}

impl Default for PairContacts {
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            sides: Vec::new(),
            gaps: Vec::new(),
            kinds: Vec::new(),
            pushed: Vec::new(),
            degenerate: 0,
            max_push: Real::INFINITY,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    VertexFace,
    EdgeEdge,
}

/// How a contact pushed its vertices apart.
#[derive(Clone, Copy, Debug)]
struct Pushed {
    /// s n; zero where it did not push.
    direction: Vector,
    /// gₖ, and wₖ gₖ / Σ wₖ gₖ².
    weights: [Real; 4],
    shares: [Real; 4],
}

impl Pushed {
    const NOT: Self =
        Self { direction: Vector::new(0.0, 0.0, 0.0), weights: [0.0; 4], shares: [0.0; 4] };
}

/// Normal, signed distance along it, weights of the four vertices, sideways distance.
struct Meeting {
    normal: Vector,
    distance: Real,
    weights: [Real; 4],
    sideways: Real,
}

impl PairContacts {
    /// No contacts.
    pub fn new() -> Self {
        Self::default()
    }

    /// Drops all contacts and keeps the memory.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.sides.clear();
        self.gaps.clear();
        self.kinds.clear();
        self.pushed.clear();
    }

    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Keeps `vertex` at `gap` metres from `triangle`, on the side its normal points to (`side` =
    /// +1) or on the other (−1).
    #[inline]
    pub fn push_vertex_face(&mut self, vertex: u32, triangle: [u32; 3], side: Real, gap: Real) {
        self.push([vertex, triangle[0], triangle[1], triangle[2]], side, gap, Kind::VertexFace);
    }

    /// Keeps the edge `first` at `gap` metres from the edge `second`, on the side to which
    /// `(b − a) × (d − c)` points (`side` = +1) or on the other (−1).
    #[inline]
    pub fn push_edge_edge(&mut self, first: [u32; 2], second: [u32; 2], side: Real, gap: Real) {
        self.push([first[0], first[1], second[0], second[1]], side, gap, Kind::EdgeEdge);
    }

    #[inline]
    fn push(&mut self, vertices: [u32; 4], side: Real, gap: Real, kind: Kind) {
        self.vertices.push(vertices);
        self.sides.push(side.signum());
        self.gaps.push(gap);
        self.kinds.push(kind);
    }

    /// Visits all contacts once, in the order of pushing.
    ///
    /// # Panics
    ///
    /// If a contact names a vertex beyond the slices.
    pub fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real]) -> Residual {
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        let remembers = self.pushed.len() == self.len();
        for k in 0..self.vertices.len() {
            let v = self.vertices[k];
            let x = v.map(|i| positions[i as usize]);
            let Some(m) = meet(self.kinds[k], &x) else {
                self.degenerate += 1;
                continue;
            };
            let (side, gap) = (self.sides[k], self.gaps[k]);
            let deficit = gap - side * m.distance;
            if deficit <= 0.0 || m.sideways > gap {
                continue;
            }
            residual.active += 1;
            if deficit > residual.max {
                residual.max = deficit;
            }
            residual.sum_squares += deficit * deficit;
            let w = v.map(|i| inverse_masses[i as usize]);
            let sum: Real = (0..4).map(|c| w[c] * m.weights[c] * m.weights[c]).sum();
            if sum > 0.0 {
                let lever = (0..4).map(|c| w[c] * m.weights[c].abs()).fold(0.0, Real::max) / sum;
                let held = if lever > LEVER { LEVER / lever } else { 1.0 };
                let push = m.normal * (side * held * deficit.min(self.max_push) / sum);
                for c in 0..4 {
                    positions[v[c] as usize] += push * (w[c] * m.weights[c]);
                }
                if remembers {
                    let shares = [0, 1, 2, 3].map(|c| w[c] * m.weights[c] / sum);
                    self.pushed[k] =
                        Pushed { direction: m.normal * side, weights: m.weights, shares };
                }
            }
        }
        residual
    }
}

/// The side (+1 or −1) of the plane of triangle (a, b, c) on which `p` lies; `None` where the
/// triangle has no area or `p` lies in its plane.
pub fn side_of_face(p: &Point, a: &Point, b: &Point, c: &Point) -> Option<Real> {
    side(meet(Kind::VertexFace, &[*p, *a, *b, *c])?.distance)
}

/// The side (+1 or −1) of the edge (c, d) on which the edge (a, b) lies, along `(b − a) × (d − c)`;
/// `None` where they are parallel or meet.
pub fn side_of_edge(a: &Point, b: &Point, c: &Point, d: &Point) -> Option<Real> {
    side(meet(Kind::EdgeEdge, &[*a, *b, *c, *d])?.distance)
}

fn side(distance: Real) -> Option<Real> {
    (distance != 0.0 && distance.is_finite()).then(|| distance.signum())
}

#[inline]
fn meet(kind: Kind, x: &[Point; 4]) -> Option<Meeting> {
    match kind {
        Kind::VertexFace => meet_face(x),
        Kind::EdgeEdge => meet_edge(x),
    }
}

#[inline]
fn meet_face(x: &[Point; 4]) -> Option<Meeting> {
    let area = area_vector(&x[1], &x[2], &x[3]);
    let size = area.norm();
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let normal = area / size;
    let (b, feature) = closest_on_triangle(&x[0], &x[1], &x[2], &x[3]);
    let to = x[0] - Point::from(x[1].coords * b[0] + x[2].coords * b[1] + x[3].coords * b[2]);
    let distance = normal.dot(&to);
    let sideways = if feature == Feature::Face { 0.0 } else { (to - normal * distance).norm() };
    Some(Meeting { normal, distance, weights: [1.0, -b[0], -b[1], -b[2]], sideways })
}

#[inline]
fn meet_edge(x: &[Point; 4]) -> Option<Meeting> {
    let (u, v, r) = (x[1] - x[0], x[3] - x[2], x[0] - x[2]);
    let cross = u.cross(&v);
    let (uu, vv, uv) = (u.norm_squared(), v.norm_squared(), u.dot(&v));
    let size2 = cross.norm_squared();
    if !(size2 > PARALLEL * PARALLEL * uu * vv && size2.is_finite()) {
        return None;
    }
    // Nearest points of the two lines, then of the segments (Ericson 2005, 5.1.9).
    let (ur, vr) = (u.dot(&r), v.dot(&r));
    let mut s = ((uv * vr - ur * vv) / size2).clamp(0.0, 1.0);
    let mut t = (uv * s + vr) / vv;
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = ((uv * t - ur) / uu).clamp(0.0, 1.0);
    }
    let normal = cross / size2.sqrt();
    let to = r + u * s - v * t;
    let distance = normal.dot(&to);
    let sideways = (to - normal * distance).norm();
    Some(Meeting { normal, distance, weights: [1.0 - s, s, t - 1.0, -t], sideways })
}

impl Constraint for PairContacts {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.pushed.clear();
        self.pushed.resize(self.vertices.len(), Pushed::NOT);
    }

    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        PairContacts::project(self, positions, inverse_masses)
    }

    fn stage(&self) -> Stage {
        Stage::Contact
    }

    /// Takes from the speed at which the two sides part, of each contact that pushed, in the order
    /// of pushing: momentum stays.
    fn correct_velocities(&self, velocities: &mut [Vector]) {
        for (v, pushed) in self.vertices.iter().zip(&self.pushed) {
            let along =
                |c: usize| pushed.weights[c] * velocities[v[c] as usize].dot(&pushed.direction);
            let parting: Real = (0..4).map(along).sum();
            if parting > 0.0 {
                (0..4).for_each(|c| {
                    velocities[v[c] as usize] -= pushed.direction * (parting * pushed.shares[c])
                });
            }
        }
    }

    fn reset(&mut self) {
        self.pushed.clear();
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }

    fn counters(&self) -> Counters {
        Counters { degenerate: self.degenerate, ..Counters::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn vertex_over_face(height: Real) -> Vec<Point> {
        vec![
            Point::new(0.3, 0.2, height),
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
        ]
    }

    fn crossing_edges(height: Real) -> Vec<Point> {
        vec![
            Point::new(-0.4, 0.1, height),
            Point::new(0.8, 0.1, height),
            Point::new(0.1, -0.3, 0.0),
            Point::new(0.1, 0.9, 0.0),
        ]
    }

    fn face(side: Real, gap: Real) -> PairContacts {
        let mut group = PairContacts::new();
        group.push_vertex_face(0, [1, 2, 3], side, gap);
        group
    }

    fn edge(side: Real, gap: Real) -> PairContacts {
        let mut group = PairContacts::new();
        group.push_edge_edge([0, 1], [2, 3], side, gap);
        group
    }

    #[test]
    fn a_pair_is_brought_to_its_gap_on_its_own_side() {
        for w in [[1.0; 4], [1.0, 0.0, 2.0, 0.5], [0.0, 1.0, 1.0, 1e-6]] {
            for side in [1.0, -1.0] {
                for height in [0.0, 0.005, -0.005, -0.03 * side] {
                    let mut p = vertex_over_face(height);
                    let r = face(side, 0.01).project(&mut p, &w);
                    assert_eq!(r.active, 1);
                    // One visit is exact to first order: pushes turn the triangle a little.
                    let after = meet_face(&[p[0], p[1], p[2], p[3]]).unwrap().distance;
                    assert_relative_eq!(side * after, 0.01, epsilon = 2e-3);
                    let mut p = crossing_edges(height);
                    // (b − a) × (d − c) points up here.
                    edge(side, 0.01).project(&mut p, &w);
                    let after = meet_edge(&[p[0], p[1], p[2], p[3]]).unwrap().distance;
                    assert_relative_eq!(side * after, 0.01, epsilon = 2e-3);
                }
            }
        }
    }

    #[test]
    fn a_contact_beside_pinned_corners_does_not_throw_the_free_one() {
        // The free corner has the weight 1e-3 at the contact: a thousand times the deficit would
        // bring it out at once.
        let mut p = vec![
            Point::new(1e-3, 1e-3, -0.01),
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
        ];
        let mut group = face(1.0, 0.01);
        let (w, mut last) = ([0.0, 0.0, 1.0, 0.0], Real::INFINITY);
        for _ in 0..1000 {
            let before = p[2];
            let r = group.project(&mut p, &w);
            assert!((p[2] - before).norm() <= LEVER * r.max + 1e-12);
            assert!(r.max <= last);
            last = r.max;
        }
        assert!(last < 0.02, "{last}");
    }

    #[test]
    fn sides_are_read_from_the_positions() {
        let p = vertex_over_face(0.2);
        assert_eq!(side_of_face(&p[0], &p[1], &p[2], &p[3]), Some(1.0));
        assert_eq!(side_of_face(&p[0], &p[1], &p[3], &p[2]), Some(-1.0));
        let p = crossing_edges(-0.1);
        assert_eq!(side_of_edge(&p[0], &p[1], &p[2], &p[3]), Some(-1.0));
        assert_eq!(side_of_edge(&p[0], &p[1], &p[0], &p[1]), None);
        assert_eq!(side_of_face(&p[0], &p[1], &p[1], &p[1]), None);
    }

    #[test]
    fn momentum_and_angular_momentum_stay() {
        let w = [1.0, 0.5, 2.0, 4.0];
        for (mut group, before) in
            [(face(1.0, 0.1), vertex_over_face(-0.05)), (edge(-1.0, 0.1), crossing_edges(0.02))]
        {
            let mut p = before.clone();
            group.project(&mut p, &w);
            let (mut linear, mut angular) = (Vector::zeros(), Vector::zeros());
            for i in 0..4 {
                let impulse = (p[i] - before[i]) / w[i];
                linear += impulse;
                angular += before[i].coords.cross(&impulse);
            }
            assert!(p != before && linear.norm() < 1e-15 && angular.norm() < 1e-15);
        }
    }

    #[test]
    fn the_weights_are_the_gradient_of_the_distance() {
        let step = 1e-6;
        let tilted = vec![
            Point::new(0.3, 0.2, 0.4),
            Point::origin(),
            Point::new(1.0, 0.1, 0.2),
            Point::new(0.1, 1.0, -0.3),
        ];
        let mut edges = crossing_edges(0.3);
        edges[1].z += 0.2;
        for (kind, p) in [(Kind::VertexFace, tilted), (Kind::EdgeEdge, edges)] {
            let x = [p[0], p[1], p[2], p[3]];
            let m = meet(kind, &x).unwrap();
            for v in 0..4 {
                for axis in 0..3 {
                    let at = |s: Real| {
                        let mut y = x;
                        y[v][axis] += s;
                        meet(kind, &y).unwrap().distance
                    };
                    let difference = (at(step) - at(-step)) / (2.0 * step);
                    assert_relative_eq!(m.normal[axis] * m.weights[v], difference, epsilon = 1e-8);
                }
            }
        }
    }

    #[test]
    fn a_push_leaves_no_parting_speed_and_momentum_stays() {
        for (mut group, mut p) in
            [(face(1.0, 0.1), vertex_over_face(-0.05)), (edge(-1.0, 0.1), crossing_edges(0.02))]
        {
            for w in [[1.0, 0.5, 2.0, 4.0], [0.0, 1.0, 1.0, 3.0]] {
                let before = p.clone();
                group.begin_substep(&before, &before, &w, 0.01);
                group.project(&mut p, &w);
                // As line 24 has it, and a slide.
                let slide = Vector::new(0.3, 0.2, 0.0);
                let mut v: Vec<Vector> = (0..4)
                    .map(|c| {
                        if w[c] > 0.0 { (p[c] - before[c]) / 0.01 + slide } else { Vector::zeros() }
                    })
                    .collect();
                let momentum = |v: &[Vector]| {
                    (0..4).filter(|c| w[*c] > 0.0).map(|c| v[c] / w[c]).sum::<Vector>()
                };
                let (first, pushed) = (momentum(&v), group.pushed[0]);
                let parting = |v: &[Vector]| {
                    (0..4).map(|c| pushed.weights[c] * v[c].dot(&pushed.direction)).sum::<Real>()
                };
                assert!(parting(&v) > 1.0);
                group.correct_velocities(&mut v);
                assert_relative_eq!(parting(&v), 0.0, epsilon = 1e-12);
                if w[0] > 0.0 {
                    assert_relative_eq!(momentum(&v), first, epsilon = 1e-12);
                }
                assert!(w[0] > 0.0 || v[0] == Vector::zeros(), "what is pinned stays");
                p = before;
            }
        }
    }

    #[test]
    fn contacts_far_to_the_side_sleep() {
        let mut p = vertex_over_face(-0.1);
        p[0].x = 3.0;
        assert_eq!(face(1.0, 0.01).project(&mut p, &[1.0; 4]).active, 0);
        let mut p = crossing_edges(-0.1);
        p[2].x += 3.0;
        p[3].x += 3.0;
        assert_eq!(edge(1.0, 0.01).project(&mut p, &[1.0; 4]).active, 0);
    }

    #[test]
    fn degenerate_pairs_are_left_alone() {
        let o = Point::origin();
        let line = Point::new(1.0, 0.0, 0.0);
        for x in [
            [o; 4],
            [line, o, o, line],
            [o, line, o, line],
            [o, line, o, Point::new(2.0, 1e-9, 0.0)],
        ] {
            let mut p = x.to_vec();
            for mut group in [face(1.0, 0.1), edge(1.0, 0.1)] {
                group.project(&mut p, &[1.0; 4]);
                group.project(&mut p, &[0.0; 4]);
            }
            assert!(p.iter().all(|x| x.iter().all(|c| c.is_finite())));
        }
    }
}
