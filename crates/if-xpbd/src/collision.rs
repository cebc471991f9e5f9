//! Collision of a garment with a signed distance field: lines 6 to 10 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual, Stage};
use crate::half_space::friction;
use if_core::edges::Edges;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;

/// How a sample inside is brought out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
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
/// with the mask's weight m in [0, 1]: a sample of weight 0 is never looked at (Appendix C).
///
/// A sample that was at distance φ, and has since moved by less than (φ − δ) / L for the field's
/// Lipschitz bound L, cannot violate, and is not asked for again; nor is one outside the field's
/// bounds. [`Constraint::counters`] tells how often that was so.
///
/// Where the gradient is zero, or the field answers NaN, nothing moves, and it is counted.
///
/// # Source
///
/// Algorithm 1, lines 6 to 10. Line 8 is exact only where |∇φ| = 1, and diverges where |∇φ|² > 2:
/// [`Push::Corrected`] divides. Friction after [Macklin et al. 2014], section 6.1.
pub struct SdfCollision<'a> {
    field: &'a dyn SignedDistance,
    vertices: Vec<[u32; 3]>,
    weights: Vec<[Real; 3]>,
    clearances: Vec<Real>,
    masks: Vec<Real>,
    masked_out: u64,
    /// Where each sample stood when the field was last asked, and what it answered.
    seen: Vec<(Point, Real)>,
    anchors: Vec<Point>,
    pushed: Vec<(u32, Vector)>,
    asked: Vec<u32>,
    points: Vec<Point>,
    answers: Vec<FieldSample>,
    counters: Counters,
    /// How samples are brought out.
    pub push: Push,
    /// Coulomb coefficient of friction.
    pub friction: Real,
    /// The farthest that a sample may be pushed in one visit, in metres.
    pub max_push: Real,
}

/// Why a collision group cannot be made.
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
    /// A weight of the mask is not in [0, 1].
    #[error("vertex {vertex} has the mask weight {value}; it must be in [0, 1]")]
    Mask {
        /// Index of the vertex.
        vertex: usize,
        /// Its weight.
        value: Real,
    },
    /// A clearance is negative or not finite.
    #[error("vertex {vertex} has the clearance {value}; it must be finite and at least 0 (metres)")]
    Clearance {
        /// Index of the vertex.
        vertex: usize,
        /// Its clearance.
        value: Real,
    },
}

impl<'a> SdfCollision<'a> {
    /// Collision of each vertex with `field`, with a weight of the mask in [0, 1] and a clearance δ
    /// in metres for each.
    ///
    /// # Errors
    ///
    /// The first weight or clearance that is not allowed.
    pub fn new(field: &'a dyn SignedDistance, masks: &[Real], clearances: &[Real]) -> Result<Self, CollisionError> {
        if masks.len() != clearances.len() {
            return Err(CollisionError::Count { masks: masks.len(), clearances: clearances.len() });
        }
        for (vertex, (&m, &value)) in masks.iter().zip(clearances).enumerate() {
            if !(0.0..=1.0).contains(&m) {
                return Err(CollisionError::Mask { vertex, value: m });
            }
            if !(value.is_finite() && value >= 0.0) {
                return Err(CollisionError::Clearance { vertex, value });
            }
        }
        let mut group = Self {
            field,
            vertices: Vec::new(),
            weights: Vec::new(),
            clearances: Vec::new(),
            masks: Vec::new(),
            masked_out: 0,
            seen: Vec::new(),
            anchors: Vec::new(),
            pushed: Vec::new(),
            asked: Vec::new(),
            points: Vec::new(),
            answers: Vec::new(),
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
    /// # Panics
    ///
    /// If `masks` or `clearances` are shorter than the mesh's vertices.
    pub fn add_between(&mut self, mesh: &TriMesh, longer_than: Real, masks: &[Real], clearances: &[Real]) {
        let edges = Edges::new(mesh);
        let long: Vec<bool> = edges.vertices.iter().map(|&[a, b]| {
            (mesh.vertices()[a as usize] - mesh.vertices()[b as usize]).norm() > longer_than
        }).collect();
        for (e, &[a, b]) in edges.vertices.iter().enumerate() {
            if long[e] {
                let mean = |x: &[Real]| 0.5 * (x[a as usize] + x[b as usize]);
                self.add([a, b, b], [0.5, 0.5, 0.0], mean(masks), mean(clearances));
            }
        }
        const THIRD: Real = 1.0 / 3.0;
        for (t, &corners) in mesh.triangles().iter().enumerate() {
            if edges.of_triangle[t].iter().any(|e| long[*e as usize]) {
                let mean = |x: &[Real]| corners.iter().map(|c| x[*c as usize]).sum::<Real>() * THIRD;
                self.add(corners, [THIRD; 3], mean(masks), mean(clearances));
            }
        }
    }

    fn add(&mut self, vertices: [u32; 3], weights: [Real; 3], mask: Real, clearance: Real) {
        if mask > 0.0 {
            self.vertices.push(vertices);
            self.weights.push(weights);
            self.masks.push(mask);
            self.clearances.push(clearance);
            self.seen.push((Point::origin(), Real::NEG_INFINITY));
        } else {
            self.masked_out += 1;
        }
    }

    /// Number of samples inside the mask.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Asks the field at all samples that may be too near, into `asked`, `points` and `answers`.
    fn ask(&mut self, positions: &[Point]) {
        let (bounds, lipschitz) = (self.field.bounds(), self.field.lipschitz());
        self.asked.clear();
        self.points.clear();
        self.counters.skipped_by_mask += self.masked_out;
        for k in 0..self.vertices.len() {
            let x = sample(positions, &self.vertices[k], &self.weights[k]);
            let delta = self.clearances[k];
            // Outside its bounds the field is positive; a distance field is over δ beyond δ from them.
            if bounds.is_some_and(|b| b.distance_squared(&x) > delta * delta) {
                self.counters.skipped_by_mask += 1;
                continue;
            }
            let (at, distance) = self.seen[k];
            // False where either is NaN.
            if distance - delta > lipschitz * (x - at).norm() {
                self.counters.skipped_by_bound += 1;
                continue;
            }
            self.asked.push(k as u32);
            self.points.push(x);
        }
        self.counters.queries += self.asked.len() as u64;
        self.answers.resize(self.points.len(), FieldSample { distance: 0.0, gradient: Vector::zeros() });
        self.field.samples(&self.points, &mut self.answers);
    }
}

#[inline]
fn sample(positions: &[Point], v: &[u32; 3], b: &[Real; 3]) -> Point {
    if b[0] == 1.0 {
        return positions[v[0] as usize];
    }
    Point::from(positions[v[0] as usize].coords * b[0] + positions[v[1] as usize].coords * b[1] + positions[v[2] as usize].coords * b[2])
}

impl Constraint for SdfCollision<'_> {
    fn begin_substep(&mut self, previous: &[Point], _positions: &[Point], _inverse_masses: &[Real], _h: Real) {
        self.pushed.clear();
        self.anchors.clear();
        if self.friction > 0.0 {
            let anchors = self.vertices.iter().zip(&self.weights).map(|(v, b)| sample(previous, v, b));
            self.anchors.extend(anchors);
        }
    }

    /// # Panics
    ///
    /// If a sample's vertex is beyond the slices.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        self.ask(positions);
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        for (q, &k) in self.asked.iter().enumerate() {
            let k = k as usize;
            let FieldSample { distance, gradient } = self.answers[q];
            let slope2 = gradient.norm_squared();
            if !(distance.is_finite() && slope2.is_finite()) {
                self.counters.degenerate += 1;
                continue;
            }
            self.seen[k] = (self.points[q], distance);
            let (v, b) = (self.vertices[k], self.weights[k]);
            // Samples share vertices: where this one has been moved by now, to first order.
            let x = sample(positions, &v, &b);
            let delta = if self.push == Push::Literal { 0.0 } else { self.clearances[k] };
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
                push -= friction(&(slid - normal * normal.dot(&slid)), self.friction * normal.dot(&push));
            }
            for c in 0..3 {
                positions[v[c] as usize] += push * (w[c] * b[c] / sum);
            }
            self.pushed.push((k as u32, normal));
        }
        residual
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
        self.seen.fill((Point::origin(), Real::NEG_INFINITY));
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}
