//! Collision of a garment with a signed distance field: lines 6 to 10 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual, Stage, check_contact};
use crate::half_space::friction;
use if_core::edges::Edges;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;

/// How a sample inside is pushed out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Push {
    /// `p −= (φ − δ) ∇φ / |∇φ|²` where φ < δ, limited, weighted by the mask, with friction.
    #[default]
    Corrected,
    /// `p −= φ ∇φ` where φ < 0, as line 8 prints it.
    Literal,
}

/// Keeps samples of a garment at a distance from a field's inside.
///
/// A sample is a vertex, or a point between up to three vertices where edges are long:
///
/// ```text
/// C = φ(Σ bₖ pₖ) − δ ≥ 0       Δpₖ = −m C wₖ bₖ / (Σ wₖ bₖ²) ∇φ / |∇φ|²
/// ```
///
/// with the mask's weight m in [0, 1]: samples of weight 0 are left out (Appendix C).
///
/// A query is skipped where the constraint cannot be violated: if a sample has moved by less than
/// the field's [`free_radius`](SignedDistance::free_radius) at its last query, which is
/// (φ − δ) / L with the Lipschitz bound L, or if it is farther than δ from the field's bounds: the
/// surface is then farther than δ, whatever φ is (a field that is no distance may be below δ there).
/// [`Constraint::counters`] reports how often. A sample that was clear at the start of a visit is
/// not pushed in that visit, whether it was queried or not, even if pushes of its neighbours carry
/// it inside: so the result does not depend on what the bound skipped.
///
/// Where the gradient is zero or the field returns NaN, the sample is not moved, and is counted as
/// degenerate.
///
/// # Source
///
/// Algorithm 1, lines 6 to 10. Line 8 is exact only where |∇φ| = 1; beyond, it throws a vertex out by |∇φ|² − 1
/// times its depth: [`Push::Corrected`] divides. Friction after [Macklin et al. 2014], section 6.1.
#[derive(Clone)]
pub struct SdfCollision<'a> {
    field: &'a dyn SignedDistance,
    vertices: Vec<[u32; 3]>,
    weights: Vec<[Real; 3]>,
    clearances: Vec<Real>,
    masks: Vec<Real>,
    masked_out: u64,
    /// Position of each sample at its last query, and how far from there it is free.
    last_query: Vec<(Point, Real)>,
    anchors: Vec<Point>,
    pushed: Vec<(u32, Vector)>,
    queried: Vec<u32>,
    points: Vec<Point>,
    samples: Vec<FieldSample>,
    counters: Counters,
    /// How samples are pushed out.
    pub push: Push,
    /// Coulomb coefficient of friction: finite and at least 0.
    pub friction: Real,
    /// The largest push of a sample in one visit, in metres: positive, may be infinite.
    pub max_push: Real,
}

/// Why the input of a collision group is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CollisionError {
    /// Mask weights and clearances differ in number.
    #[error("{masks} mask weights but {clearances} clearances; give one of each for each vertex")]
    Count {
        /// Mask weights given.
        masks: usize,
        /// Clearances given.
        clearances: usize,
    },
    /// A weight of the mask or a clearance is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

fn check(masks: &[Real], clearances: &[Real]) -> Result<(), CollisionError> {
    if masks.len() != clearances.len() {
        return Err(CollisionError::Count { masks: masks.len(), clearances: clearances.len() });
    }
    for (vertex, (&m, &value)) in masks.iter().zip(clearances).enumerate() {
        ParameterError::check("mask", m, (0.0..=1.0).contains(&m), "0 to 1")
            .map_err(|e| e.at(vertex))?;
        let ok = value.is_finite() && value >= 0.0;
        ParameterError::check("clearance", value, ok, "finite and at least 0 (metres)")
            .map_err(|e| e.at(vertex))?;
    }
    Ok(())
}

impl<'a> SdfCollision<'a> {
    /// Collision of each vertex with `field`, with a weight of the mask in [0, 1] and a clearance δ
    /// in metres for each.
    ///
    /// # Errors
    ///
    /// The first invalid weight or clearance.
    pub fn new(
        field: &'a dyn SignedDistance,
        masks: &[Real],
        clearances: &[Real],
    ) -> Result<Self, CollisionError> {
        check(masks, clearances)?;
        let mut group = Self {
            field,
            vertices: Vec::new(),
            weights: Vec::new(),
            clearances: Vec::new(),
            masks: Vec::new(),
            masked_out: 0,
            last_query: Vec::new(),
            anchors: Vec::new(),
            pushed: Vec::new(),
            queried: Vec::new(),
            points: Vec::new(),
            samples: Vec::new(),
            counters: Counters::default(),
            push: Push::Corrected,
            friction: 0.0,
            max_push: Real::INFINITY,
        };
        for v in 0..masks.len() {
            group.add([v as u32; 3], [1.0, 0.0, 0.0], masks[v], clearances[v]);
        }
        Ok(group)
    }

    /// Adds the midpoints of edges longer than `longer_than` metres, and the centroids of the
    /// triangles that have one, with the mean weight and clearance of their corners.
    ///
    /// # Errors
    ///
    /// As [`SdfCollision::new`]: then nothing is added.
    ///
    /// # Panics
    ///
    /// If `masks` or `clearances` are shorter than the mesh's vertices.
    pub fn add_between(
        &mut self,
        mesh: &TriMesh,
        longer_than: Real,
        masks: &[Real],
        clearances: &[Real],
    ) -> Result<(), CollisionError> {
        check(masks, clearances)?;
        let edges = Edges::new(mesh);
        let long: Vec<bool> = edges
            .vertices
            .iter()
            .map(|&[a, b]| {
                (mesh.vertices()[a as usize] - mesh.vertices()[b as usize]).norm() > longer_than
            })
            .collect();
        for (e, &[a, b]) in edges.vertices.iter().enumerate() {
            if long[e] {
                let mean = |x: &[Real]| 0.5 * (x[a as usize] + x[b as usize]);
                self.add([a, b, b], [0.5, 0.5, 0.0], mean(masks), mean(clearances));
            }
        }
        const THIRD: Real = 1.0 / 3.0;
        for (t, &corners) in mesh.triangles().iter().enumerate() {
            if edges.of_triangle[t].iter().any(|e| long[*e as usize]) {
                let mean =
                    |x: &[Real]| corners.iter().map(|c| x[*c as usize]).sum::<Real>() * THIRD;
                self.add(corners, [THIRD; 3], mean(masks), mean(clearances));
            }
        }
        Ok(())
    }

    fn add(&mut self, vertices: [u32; 3], weights: [Real; 3], mask: Real, clearance: Real) {
        if mask > 0.0 {
            self.vertices.push(vertices);
            self.weights.push(weights);
            self.masks.push(mask);
            self.clearances.push(clearance);
            self.last_query.push((Point::origin(), Real::NEG_INFINITY));
        } else {
            self.masked_out += 1;
        }
    }

    /// Number of samples inside the mask.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Queries the field at all samples that may violate, into `queried`, `points` and `samples`.
    fn query(&mut self, positions: &[Point]) {
        let bounds = self.field.bounds();
        self.queried.clear();
        self.points.clear();
        self.counters.skipped_by_mask += self.masked_out;
        for k in 0..self.vertices.len() {
            let x = sample(positions, &self.vertices[k], &self.weights[k]);
            let delta = self.clearances[k];
            // The surface is within its bounds, so farther than δ.
            if bounds.is_some_and(|b| b.distance_squared(&x) > delta * delta) {
                self.counters.skipped_by_mask += 1;
                continue;
            }
            let (at, radius) = self.last_query[k];
            // False if either is NaN.
            if radius > (x - at).norm() {
                self.counters.skipped_by_bound += 1;
                continue;
            }
            // The guards find such a position at the end of the step; fields need finite points.
            if !x.iter().all(|c| c.is_finite()) {
                self.counters.degenerate += 1;
                continue;
            }
            self.queried.push(k as u32);
            self.points.push(x);
        }
        self.counters.queries += self.queried.len() as u64;
        self.samples
            .resize(self.points.len(), FieldSample { distance: 0.0, gradient: Vector::zeros() });
        self.field.samples(&self.points, &mut self.samples);
    }
}

#[inline]
fn sample(positions: &[Point], v: &[u32; 3], b: &[Real; 3]) -> Point {
    if b[0] == 1.0 {
        return positions[v[0] as usize];
    }
    Point::from(
        positions[v[0] as usize].coords * b[0]
            + positions[v[1] as usize].coords * b[1]
            + positions[v[2] as usize].coords * b[2],
    )
}

impl std::fmt::Debug for SdfCollision<'_> {
    /// Numbers only: a field has no `Debug`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SdfCollision")
            .field("samples", &self.len())
            .field("push", &self.push)
            .field("friction", &self.friction)
            .field("max_push", &self.max_push)
            .finish_non_exhaustive()
    }
}

impl Constraint for SdfCollision<'_> {
    fn begin_substep(
        &mut self,
        previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.pushed.clear();
        self.anchors.clear();
        if self.friction > 0.0 {
            let anchors =
                self.vertices.iter().zip(&self.weights).map(|(v, b)| sample(previous, v, b));
            self.anchors.extend(anchors);
        }
    }

    /// # Panics
    ///
    /// If a sample's vertex is beyond the slices.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        self.query(positions);
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        for (q, &k) in self.queried.iter().enumerate() {
            let k = k as usize;
            let FieldSample { distance, gradient } = self.samples[q];
            let slope2 = gradient.norm_squared();
            let at = self.points[q];
            let radius = self.field.free_radius(&at, distance, self.clearances[k]);
            if distance == Real::INFINITY {
                self.last_query[k] = (at, radius);
                continue; // beyond the mask of a masked field
            }
            if !(distance.is_finite() && slope2.is_finite()) {
                self.counters.degenerate += 1;
                continue;
            }
            self.last_query[k] = (at, radius);
            let (v, b) = (self.vertices[k], self.weights[k]);
            let delta = if self.push == Push::Literal { 0.0 } else { self.clearances[k] };
            if distance >= delta {
                continue;
            }
            // Samples share vertices: where this one has been moved by now, to first order.
            let x = sample(positions, &v, &b);
            let deficit = delta - (distance + gradient.dot(&(x - self.points[q])));
            if deficit <= 0.0 {
                continue;
            }
            residual.active += 1;
            residual.max = residual.max.max(deficit);
            residual.sum_squares += deficit * deficit;
            let w = v.map(|i| inverse_masses[i as usize]);
            let sum: Real = (0..3).map(|c| w[c] * b[c] * b[c]).sum();
            if slope2 <= 0.0 {
                self.counters.degenerate += 1;
                continue;
            }
            if sum <= 0.0 {
                continue;
            }
            let slope = slope2.sqrt();
            let normal = gradient / slope;
            let mut push = match self.push {
                Push::Literal => gradient * deficit,
                Push::Corrected => normal * (self.masks[k] * (deficit / slope).min(self.max_push)),
            };
            if self.friction > 0.0 && self.anchors.len() == self.len() {
                let slid = x - self.anchors[k];
                push -= friction(
                    &(slid - normal * normal.dot(&slid)),
                    self.friction * normal.dot(&push),
                );
            }
            for c in 0..3 {
                positions[v[c] as usize] += push * (w[c] * b[c] / sum);
            }
            self.pushed.push((k as u32, normal));
        }
        residual
    }

    fn validate(&self) -> Result<(), ParameterError> {
        check_contact(self.friction, self.max_push)
    }

    fn stage(&self) -> Stage {
        Stage::Contact
    }

    fn correct_velocities(&self, velocities: &mut [Vector]) {
        for (k, normal) in &self.pushed {
            let (v, b) = (self.vertices[*k as usize], self.weights[*k as usize]);
            for c in 0..3 {
                if b[c] > 0.0 {
                    let velocity = &mut velocities[v[c] as usize];
                    let outwards = velocity.dot(normal);
                    if outwards > 0.0 {
                        *velocity -= normal * outwards;
                    }
                }
            }
        }
    }

    fn reset(&mut self) {
        self.pushed.clear();
        self.anchors.clear();
        self.last_query.fill((Point::origin(), Real::NEG_INFINITY));
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::SolverParams;
    use crate::particles::Particles;
    use crate::report::{RunError, StepError};
    use crate::solver::Solver;
    use approx::assert_relative_eq;
    use if_core::monitor::Silent;
    use if_core::shapes::ScaledGradient;
    use if_core::shapes::meshes::cloth;
    use if_core::shapes::{Cuboid, Plane, Sphere};

    const BALL: Sphere = Sphere { center: Point::new(0.0, 0.0, 0.0), radius: 1.0 };

    fn visit(
        field: &dyn SignedDistance,
        at: Point,
        clearance: Real,
        set: impl Fn(&mut SdfCollision<'_>),
    ) -> (Point, Residual) {
        let mut group = SdfCollision::new(field, &[1.0], &[clearance]).unwrap();
        set(&mut group);
        let mut p = vec![at];
        group.begin_substep(&p.clone(), &p.clone(), &[1.0], 1e-3);
        let r = group.project(&mut p, &[1.0], 1e-3);
        (p[0], r)
    }

    #[test]
    fn one_visit_brings_a_vertex_to_its_clearance() {
        let cube = Cuboid { center: Point::origin(), half: Vector::repeat(1.0) };
        for (field, from, to) in [
            (&BALL as &dyn SignedDistance, Point::new(0.6, 0.0, 0.0), Point::new(1.01, 0.0, 0.0)),
            (&BALL, Point::new(0.0, -1.005, 0.0), Point::new(0.0, -1.01, 0.0)),
            (&BALL, Point::new(0.0, 1.5, 0.0), Point::new(0.0, 1.5, 0.0)),
            (&cube, Point::new(0.9, 0.1, -0.2), Point::new(1.01, 0.1, -0.2)),
        ] {
            let (p, _) = visit(field, from, 0.01, |_| ());
            assert_relative_eq!(p, to, epsilon = 1e-15);
        }
    }

    #[test]
    fn a_gradient_that_is_not_of_unit_length_is_divided_out() {
        let plane = Plane { point: Point::origin(), normal: Vector::z() };
        for scale in [0.1, 0.7, 1.3, 3.0] {
            let field = ScaledGradient { field: plane, factor: scale };
            let (p, _) = visit(&field, Point::new(0.0, 0.0, -0.2), 0.0, |_| ());
            assert_relative_eq!(p.z, 0.0, epsilon = 1e-15);
            // Line 8 as printed lands at z (1 − s²), and runs away from s² > 2 on.
            let (p, _) = visit(&field, Point::new(0.0, 0.0, -0.2), 0.0, |g| g.push = Push::Literal);
            assert_relative_eq!(p.z, -0.2 * (1.0 - scale * scale), epsilon = 1e-15);
        }
    }

    #[test]
    fn pushes_are_limited_and_weighted_by_the_mask() {
        let (p, r) = visit(&BALL, Point::new(0.5, 0.0, 0.0), 0.0, |g| g.max_push = 0.02);
        assert_relative_eq!(p.x, 0.52, epsilon = 1e-15);
        assert_eq!((r.max, r.active), (0.5, 1));
        let mut group = SdfCollision::new(&BALL, &[0.5, 0.0, 1.0], &[0.0; 3]).unwrap();
        let mut p = vec![Point::new(0.5, 0.0, 0.0); 3];
        group.project(&mut p, &[1.0, 1.0, 0.0], 1e-3);
        assert_relative_eq!(p[0].x, 0.75, epsilon = 1e-15);
        assert_eq!((p[1].x, p[2].x), (0.5, 0.5));
        assert_eq!(
            (group.len(), group.counters().queries, group.counters().skipped_by_mask),
            (2, 2, 1)
        );
    }

    #[test]
    fn samples_between_the_vertices_of_long_edges_come_out_too() {
        // A square whose corners touch the ball and whose middle is inside.
        let mesh = cloth(1.2, 1.2, 1, 1);
        let sunk: Vec<Point> =
            mesh.vertices().iter().map(|p| Point::new(p.x - 0.6, p.y - 0.6, 0.7)).collect();
        let mesh = mesh.with_vertices(sunk).unwrap();
        let (masks, clearances) = ([1.0; 4], [0.0; 4]);
        let mut group = SdfCollision::new(&BALL, &masks, &clearances).unwrap();
        group.add_between(&mesh, 10.0, &masks, &clearances).unwrap();
        assert_eq!(group.len(), 4);
        group.add_between(&mesh, 0.1, &masks, &clearances).unwrap();
        assert_eq!(group.len(), 4 + 5 + 2);
        let mut p = mesh.vertices().to_vec();
        for _ in 0..60 {
            group.project(&mut p, &[1.0; 4], 1e-3);
        }
        for (v, b) in group.vertices.iter().zip(&group.weights) {
            assert!(BALL.distance(&sample(&p, v, b)) > -1e-6);
        }
        let heavy = group.add_between(&mesh, 0.1, &[1.0, 5.0, 1.0, 1.0], &clearances);
        assert!(matches!(heavy, Err(CollisionError::Parameter(e)) if e.name == "mask[1]"));
        let nowhere = group.add_between(&mesh, 0.1, &masks, &[0.0, 0.0, Real::NAN, 0.0]);
        assert!(matches!(nowhere, Err(CollisionError::Parameter(e)) if e.name == "clearance[2]"));
        assert_eq!(group.len(), 4 + 5 + 2);
    }

    #[test]
    fn samples_that_share_vertices_push_none_of_them_twice() {
        // A square 1 cm below a plane. Once its vertices are out, so are the middles of its edges and
        // triangles, whose distances are from before.
        let plane = Plane { point: Point::origin(), normal: Vector::z() };
        let mesh = cloth(0.2, 0.2, 1, 1);
        let (masks, clearances) = ([1.0; 4], [0.002; 4]);
        let mut group = SdfCollision::new(&plane, &masks, &clearances).unwrap();
        group.add_between(&mesh, 0.1, &masks, &clearances).unwrap();
        let mut p: Vec<Point> =
            mesh.vertices().iter().map(|p| Point::new(p.x, p.y, -0.01)).collect();
        group.project(&mut p, &[1.0; 4], 1e-3);
        for p in &p {
            assert_relative_eq!(p.z, 0.002, epsilon = 1e-15);
        }
    }

    #[test]
    fn vertices_that_cannot_have_come_near_are_not_queried() {
        let mut group = SdfCollision::new(&BALL, &[1.0; 2], &[0.01; 2]).unwrap();
        let mut p = vec![Point::new(0.0, 0.6006, 0.8008), Point::new(0.9, 0.9, 0.9)];
        for _ in 0..10 {
            group.project(&mut p, &[1.0; 2], 1e-3);
            p[1].x -= 0.01;
        }
        // The first stays at its clearance and is queried each time, the second only at first.
        let c = group.counters();
        assert_eq!(c.queries + c.skipped_by_bound, 20);
        assert!(c.skipped_by_bound >= 9, "{c:?}");
        group.reset();
        group.project(&mut p, &[1.0; 2], 1e-3);
        assert_eq!(group.counters().queries, c.queries + 2);
    }

    #[test]
    fn skipping_changes_no_bit() {
        let mesh = cloth(1.5, 1.5, 12, 12);
        let ones = vec![1.0; mesh.vertices().len()];
        let clearances = vec![0.01; ones.len()];
        let run = |forget: bool| {
            let mut group = SdfCollision::new(&BALL, &ones, &clearances).unwrap();
            let mut p: Vec<Point> =
                mesh.vertices().iter().map(|p| Point::new(p.x - 0.7, p.y - 0.8, 1.3)).collect();
            for _ in 0..40 {
                p.iter_mut().for_each(|p| p.z -= 0.01);
                if forget {
                    group.reset();
                }
                group.project(&mut p, &ones, 1e-3);
            }
            p
        };
        assert_eq!(run(false), run(true));
    }

    /// A field without bounds and without a Lipschitz bound, so that every sample is queried.
    struct Endless(Sphere);
    impl SignedDistance for Endless {
        fn distance(&self, p: &Point) -> Real {
            self.0.distance(p)
        }
        fn sample(&self, p: &Point) -> FieldSample {
            self.0.sample(p)
        }
        fn bounds(&self) -> Option<if_core::aabb::Aabb> {
            None
        }
        fn lipschitz(&self) -> Real {
            Real::INFINITY
        }
    }

    #[test]
    fn skipping_changes_no_bit_where_samples_share_vertices() {
        // Excessive friction drags neighbours about: samples that were clear are carried inside
        // within one visit.
        let mesh = cloth(3.0, 3.0, 5, 5);
        let ones = vec![1.0; mesh.vertices().len()];
        let clearances = vec![0.01; ones.len()];
        let run = |field: &dyn SignedDistance| {
            let mut group = SdfCollision::new(field, &ones, &clearances).unwrap();
            group.add_between(&mesh, 0.1, &ones, &clearances).unwrap();
            group.friction = 10.0;
            let mut p: Vec<Point> =
                mesh.vertices().iter().map(|p| Point::new(p.x - 1.4, p.y - 1.6, 0.9)).collect();
            for _ in 0..10 {
                let before = p.clone();
                p.iter_mut().for_each(|p| *p += Vector::new(0.3, 0.1, -0.2));
                group.begin_substep(&before, &p, &ones, 1e-3);
                for _ in 0..3 {
                    group.project(&mut p, &ones, 1e-3);
                }
            }
            (p, group.counters().queries)
        };
        let ((with, queried), (without, all)) = (run(&BALL), run(&Endless(BALL)));
        assert_eq!(with, without);
        assert!(queried < all, "{queried} of {all}");
    }

    /// A field that is NaN on one side and has no gradient on the other.
    struct Broken;
    impl SignedDistance for Broken {
        fn distance(&self, p: &Point) -> Real {
            self.sample(p).distance
        }
        fn sample(&self, p: &Point) -> FieldSample {
            let distance = if p.x > 0.0 { Real::NAN } else { -1.0 };
            FieldSample { distance, gradient: Vector::zeros() }
        }
        fn bounds(&self) -> Option<if_core::aabb::Aabb> {
            None
        }
        fn lipschitz(&self) -> Real {
            1.0
        }
    }

    #[test]
    fn a_broken_field_moves_nothing_and_is_counted() {
        let mut group = SdfCollision::new(&Broken, &[1.0; 2], &[0.0; 2]).unwrap();
        let start = vec![Point::new(1.0, 0.0, 0.0), Point::new(-1.0, 0.0, 0.0)];
        let mut p = start.clone();
        group.project(&mut p, &[1.0; 2], 1e-3);
        assert_eq!(p, start);
        assert_eq!(group.counters().degenerate, 2);
    }

    #[test]
    fn the_solver_refuses_a_negative_push() {
        let mut group = SdfCollision::new(&BALL, &[1.0], &[0.0]).unwrap();
        let mut particles = Particles::uniform(vec![Point::new(0.5, 0.0, 0.0)], 1.0).unwrap();
        let start = particles.clone();
        group.max_push = -1e-3;
        let mut solver = Solver::new(SolverParams::default()).unwrap();
        let error = solver.run(&mut particles, &mut [&mut group], &mut Silent).unwrap_err();
        assert!(
            matches!(&error, RunError::Step(StepError::Group { group: 0, source })
                if source.name == "max_push"),
            "{error}"
        );
        assert_eq!(particles, start);
    }

    #[test]
    fn invalid_weights_and_clearances_are_refused() {
        assert!(matches!(SdfCollision::new(&BALL, &[1.0], &[]), Err(CollisionError::Count { .. })));
        for bad in [-0.1, 1.1, Real::NAN] {
            assert!(matches!(
                SdfCollision::new(&BALL, &[bad], &[0.0]),
                Err(CollisionError::Parameter(e)) if e.name == "mask[0]"
            ));
        }
        for bad in [-0.1, Real::INFINITY, Real::NAN] {
            assert!(matches!(
                SdfCollision::new(&BALL, &[1.0], &[bad]),
                Err(CollisionError::Parameter(e)) if e.name == "clearance[0]"
            ));
        }
    }
}
