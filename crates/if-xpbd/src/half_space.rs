//! Contacts of points on a moving surface with fixed half-spaces: the contacts of a garment with
//! the frozen layers below it.

use crate::constraint::{Constraint, Residual, Stage, check_contact};
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;

/// Contacts `n·(Σ bₖ pₖ − q) ≥ δ` of samples on up to three vertices with fixed half-spaces.
///
/// A violated contact, with deficit `d = δ − n·(Σ bₖ pₖ − q)`, is projected exactly:
///
/// ```text
/// Δpₖ = wₖ bₖ n d / Σ wₖ bₖ²
/// ```
///
/// Contacts are visited in the order of pushing. [`HalfSpaces::clear`] keeps the capacity, so that
/// detecting contacts in every round allocates nothing after the largest round.
///
/// # Source
///
/// Lines 6 to 10 of Algorithm 1 with the field replaced by its tangent plane; friction after
/// [Macklin et al. 2014], section 6.1.
#[derive(Clone, Debug)]
pub struct HalfSpaces {
    vertices: Vec<[u32; 3]>,
    weights: Vec<[Real; 3]>,
    normals: Vec<Vector>,
    /// n·q + δ.
    levels: Vec<Real>,
    /// Whether the contact pushed in this substep.
    pushed: Vec<bool>,
    /// Positions of the samples at the start of the substep; empty without friction.
    anchors: Vec<Point>,
    /// Coulomb coefficient of friction, without unit: finite and at least 0.
    pub friction: Real,
    /// The largest push of a sample in one visit, in metres: positive, may be infinite.
    pub max_push: Real,
    /// The largest motion of a vertex in one visit, as a multiple of the sample's push. A vertex of
    /// weight b that is the only free or light one moves by 1/b of the push. With infinity each
    /// sample reaches its gap at once, and a free corner far from its sample is thrown; from 4 on,
    /// middles of edges and of triangles still reach theirs at once. Positive.
    pub max_lever: Real,
    /// When the contacts are visited. Those of [`Stage::Elastic`] give way to those of
    /// [`Stage::Contact`], which come later in every sweep.
    pub stage: Stage,
}

impl Default for HalfSpaces {
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            weights: Vec::new(),
            normals: Vec::new(),
            levels: Vec::new(),
            pushed: Vec::new(),
            anchors: Vec::new(),
            friction: 0.0,
            max_push: Real::INFINITY,
            max_lever: Real::INFINITY,
            stage: Stage::Contact,
        }
    }
}

impl HalfSpaces {
    /// No contacts, no friction, unlimited pushes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Removes all contacts and keeps the memory.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.weights.clear();
        self.normals.clear();
        self.levels.clear();
        self.pushed.clear();
        self.anchors.clear();
    }

    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.levels.len()
    }

    /// Whether there are no contacts.
    pub fn is_empty(&self) -> bool {
        self.levels.is_empty()
    }

    /// Adds the contact of the point `Σ bₖ p[vertices[k]]` with the plane through `q` with unit
    /// normal `normal`, to be kept `gap` metres on its outer side.
    ///
    /// A sample on an edge or a vertex repeats one of its vertices with weight 0.
    #[inline]
    pub fn push(
        &mut self,
        vertices: [u32; 3],
        weights: [Real; 3],
        normal: Vector,
        q: &Point,
        gap: Real,
    ) {
        debug_assert!(weights.iter().all(|w| w.is_finite()) && gap.is_finite());
        self.vertices.push(vertices);
        self.weights.push(weights);
        self.normals.push(normal);
        self.levels.push(normal.dot(&q.coords) + gap);
        self.pushed.push(false);
    }

    /// The vertices of each contact's sample, in the order of pushing.
    pub fn vertices(&self) -> &[[u32; 3]] {
        &self.vertices
    }

    /// Adds the contact of one vertex.
    #[inline]
    pub fn push_vertex(&mut self, vertex: u32, normal: Vector, q: &Point, gap: Real) {
        self.push([vertex; 3], [1.0, 0.0, 0.0], normal, q, gap);
    }

    /// Signed distance of contact `k`'s sample over its gap, in metres: negative where violated.
    ///
    /// # Panics
    ///
    /// If `k` or one of the contact's vertices is out of range.
    #[inline]
    pub fn clearance(&self, k: usize, positions: &[Point]) -> Real {
        self.normals[k].dot(&sample(positions, &self.vertices[k], &self.weights[k]))
            - self.levels[k]
    }

    /// Visits all contacts once. See [`Constraint::project`], which does the same.
    ///
    /// Where all vertices of a contact are pinned, nothing moves. Friction acts only between
    /// [`Constraint::begin_substep`] and the next [`HalfSpaces::clear`].
    ///
    /// # Panics
    ///
    /// If a contact names a vertex beyond the slices.
    pub fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real]) -> Residual {
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        let rubs = self.friction > 0.0 && self.anchors.len() == self.len();
        for k in 0..self.levels.len() {
            let (v, b, n) = (self.vertices[k], self.weights[k], self.normals[k]);
            let x = sample(positions, &v, &b);
            let deficit = self.levels[k] - n.dot(&x);
            if deficit <= 0.0 {
                continue;
            }
            residual.active += 1;
            if deficit > residual.max {
                residual.max = deficit;
            }
            residual.sum_squares += deficit * deficit;
            let w = [
                inverse_masses[v[0] as usize],
                inverse_masses[v[1] as usize],
                inverse_masses[v[2] as usize],
            ];
            let sum = w[0] * b[0] * b[0] + w[1] * b[1] * b[1] + w[2] * b[2] * b[2];
            if sum <= 0.0 {
                continue;
            }
            let depth = deficit.min(self.max_push);
            let mut push = n * depth;
            if rubs {
                let slid = x - self.anchors[k].coords;
                push -= friction(&(slid - n * n.dot(&slid)), self.friction * depth);
            }
            if self.max_lever < Real::INFINITY {
                let lever = (0..3).map(|c| w[c] * b[c]).fold(0.0, Real::max) / sum;
                if lever > self.max_lever {
                    push *= self.max_lever / lever;
                }
            }
            for c in 0..3 {
                positions[v[c] as usize] += push * (w[c] * b[c] / sum);
            }
            self.pushed[k] = true;
        }
        residual
    }
}

/// The part of the tangential slide that friction removes: all of it up to a length of
/// `bound = μ d`, and `bound` beyond.
#[inline]
pub(crate) fn friction(slide: &Vector, bound: Real) -> Vector {
    let length = slide.norm();
    if length <= bound { *slide } else { slide * (bound / length) }
}

#[inline]
fn sample(positions: &[Point], v: &[u32; 3], b: &[Real; 3]) -> Vector {
    positions[v[0] as usize].coords * b[0]
        + positions[v[1] as usize].coords * b[1]
        + positions[v[2] as usize].coords * b[2]
}

impl Constraint for HalfSpaces {
    fn begin_substep(
        &mut self,
        previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.pushed.fill(false);
        self.anchors.clear();
        if self.friction > 0.0 {
            let anchors = self
                .vertices
                .iter()
                .zip(&self.weights)
                .map(|(v, b)| Point::from(sample(previous, v, b)));
            self.anchors.extend(anchors);
        }
    }

    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        HalfSpaces::project(self, positions, inverse_masses)
    }

    fn validate(&self) -> Result<(), ParameterError> {
        check_contact(self.friction, self.max_push)?;
        let range = "positive (infinity for no limit)";
        ParameterError::check("max_lever", self.max_lever, self.max_lever > 0.0, range)
    }

    fn stage(&self) -> Stage {
        self.stage
    }

    fn correct_velocities(&self, velocities: &mut [Vector]) {
        for k in 0..self.len() {
            if self.pushed[k] {
                for c in 0..3 {
                    if self.weights[k][c] > 0.0 {
                        let v = &mut velocities[self.vertices[k][c] as usize];
                        let outwards = v.dot(&self.normals[k]);
                        if outwards > 0.0 {
                            *v -= self.normals[k] * outwards;
                        }
                    }
                }
            }
        }
    }

    fn reset(&mut self) {
        self.pushed.fill(false);
        self.anchors.clear();
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::SolverParams;
    use crate::particles::Particles;
    use crate::solver::Solver;
    use approx::assert_relative_eq;

    fn triangle() -> Vec<Point> {
        vec![Point::new(0.0, 0.0, -0.3), Point::new(1.0, 0.0, -0.1), Point::new(0.0, 1.0, 0.2)]
    }

    #[test]
    fn a_violated_sample_lands_exactly_on_its_gap() {
        for w in [[1.0, 1.0, 1.0], [1.0, 0.0, 3.0], [1e-6, 1e6, 1.0]] {
            let mut p = triangle();
            let mut contacts = HalfSpaces::new();
            let n = Vector::new(0.6, 0.0, 0.8);
            contacts.push([0, 1, 2], [0.5, 0.3, 0.2], n, &Point::new(0.1, 0.2, 0.3), 0.01);
            assert!(contacts.clearance(0, &p) < 0.0);
            let before = p.clone();
            let r = contacts.project(&mut p, &w);
            assert_eq!((r.count, r.active), (1, 1));
            assert_relative_eq!(contacts.clearance(0, &p), 0.0, epsilon = 1e-14);
            // The push follows w b, along n only.
            for k in 0..3 {
                let d = p[k] - before[k];
                assert_relative_eq!(d - n * n.dot(&d), Vector::zeros(), epsilon = 1e-12);
                assert!(w[k] > 0.0 || d == Vector::zeros());
            }
        }
    }

    #[test]
    fn a_satisfied_contact_and_a_pinned_one_move_nothing() {
        let mut p = triangle();
        let before = p.clone();
        let mut contacts = HalfSpaces::new();
        contacts.push_vertex(2, Vector::z(), &Point::origin(), 0.1);
        contacts.push_vertex(0, Vector::z(), &Point::origin(), 0.1);
        let r = contacts.project(&mut p, &[0.0, 1.0, 1.0]);
        assert_eq!(r.active, 1);
        assert_relative_eq!(r.max, 0.4, epsilon = 1e-15);
        assert_eq!(p, before);
        contacts.clear();
        assert!(contacts.is_empty() && contacts.project(&mut p, &[1.0; 3]) == Residual::default());
    }

    #[test]
    fn a_push_is_limited_and_leaves_no_speed() {
        let mut p = triangle();
        let mut contacts = HalfSpaces { max_push: 0.05, ..HalfSpaces::new() };
        contacts.push_vertex(0, Vector::z(), &Point::origin(), 0.0);
        contacts.begin_substep(&p.clone(), &p.clone(), &[1.0; 3], 0.01);
        contacts.project(&mut p, &[1.0; 3]);
        assert_relative_eq!(p[0].z, -0.25, epsilon = 1e-15);
        let mut v = vec![Vector::new(1.0, 0.0, 5.0); 3];
        contacts.correct_velocities(&mut v);
        assert_eq!(v[0], Vector::new(1.0, 0.0, 0.0));
        assert_eq!(v[1].z, 5.0);
    }

    #[test]
    fn a_lever_that_is_bounded_throws_no_vertex_and_gets_there_in_the_end() {
        let mut p = vec![
            Point::new(0.0, 0.0, -0.1),
            Point::new(1.0, 0.0, -0.1),
            Point::new(0.0, 1.0, -0.1),
        ];
        let mut contacts = HalfSpaces { max_lever: 4.0, ..HalfSpaces::new() };
        contacts.push([0, 1, 2], [0.49, 0.01, 0.5], Vector::z(), &Point::origin(), 0.0);
        let (w, start) = ([0.0, 1.0, 0.0], p.clone());
        let mut visits = 0;
        while contacts.clearance(0, &p) < -1e-9 {
            let (before, lacks) = (p[1], -contacts.clearance(0, &p));
            contacts.project(&mut p, &w);
            visits += 1;
            assert!((p[1] - before).norm() <= 4.0 * lacks + 1e-12 && visits < 1000);
        }
        // Each takes 4 % of what is missing: ln(1e8) / 0.04 visits and some. At once, it is thrown
        // by ten metres in the first.
        assert!(visits > 400 && (p[0], p[2]) == (start[0], start[2]));
    }

    #[test]
    fn the_solver_refuses_limits_out_of_range() {
        let push = "positive (metres; infinity for no limit)";
        for (name, bad, range, set) in [
            ("max_push", -1e-3, push, (|h, x| h.max_push = x) as fn(&mut HalfSpaces, Real)),
            ("max_push", 0.0, push, |h, x| h.max_push = x),
            ("friction", -0.1, "finite and at least 0", |h, x| h.friction = x),
            ("friction", Real::INFINITY, "finite and at least 0", |h, x| h.friction = x),
            ("max_lever", 0.0, "positive (infinity for no limit)", |h, x| h.max_lever = x),
        ] {
            let mut contacts = HalfSpaces::new();
            contacts.validate().unwrap();
            set(&mut contacts, Real::NAN);
            assert_eq!(contacts.validate().unwrap_err().name, name);
            set(&mut contacts, bad);
            let mut particles = Particles::uniform(triangle(), 1.0).unwrap();
            let error = Solver::new(SolverParams::default())
                .unwrap()
                .step(&mut particles, &mut [&mut HalfSpaces::new(), &mut contacts])
                .unwrap_err();
            let expected = format!("parameter `{name}` is {bad}; it must be {range}");
            assert_eq!(error.to_string(), format!("group 1 is invalid: {expected}"));
        }
    }

    #[test]
    fn friction_removes_at_most_mu_times_the_depth() {
        for (mu, expected) in [(0.0, 0.5), (0.5, 0.4), (10.0, 0.0)] {
            let start = vec![Point::origin()];
            let mut p = vec![Point::new(0.5, 0.0, -0.2)];
            let mut contacts = HalfSpaces { friction: mu, ..HalfSpaces::new() };
            contacts.push_vertex(0, Vector::z(), &Point::origin(), 0.0);
            contacts.begin_substep(&start, &p.clone(), &[1.0], 0.01);
            contacts.project(&mut p, &[1.0]);
            assert_relative_eq!(p[0], Point::new(expected, 0.0, 0.0), epsilon = 1e-15);
        }
    }
}
