//! Bending constraints on pairs of triangles that share an edge, at rest where the mesh begins.

use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use if_xpbd::coloring::color;
use if_xpbd::constraint::{Constraint, Counters, Residual, check_compliance};
use serde::{Deserialize, Serialize};

/// Double area over the square of the longest edge below which a triangle has no area at rest:
/// angles and cotangents of what is a line but for rounding are noise, and change with the place of
/// the mesh. At a hundred times less cotangents carry 1e-4 of noise; at a hundred times more hinges
/// of needles are dropped that 32-bit coordinates still tell from lines.
const FLAT: Real = 1e-10;

/// What is measured at a hinge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum BendingModel {
    /// The dihedral angle. Tells a fold to one side from a fold to the other.
    Dihedral,
    /// The length of the hinge's mean-curvature vector, with cotangent weights of the rest state:
    /// five times cheaper, exact for isometric deformations, blind to the side of a fold.
    #[default]
    Isometric,
}

/// Bending constraints: one for each inner edge (x₀, x₁) with opposite corners x₂ and x₃.
///
/// With the edge's length L and the areas A₀ and A₁ of the two triangles, at rest, and with the
/// bending stiffness k = 1 / `compliance` in joules, the energy of a hinge is
///
/// ```text
/// Dihedral:   ½ k 3L²/(A₀+A₁) (θ − θ₀)²       C = θ − θ₀, in (−π, π]     β = (A₀+A₁) / (3 k L²)
/// Isometric:  ½ k 3/(A₀+A₁) (|c| − |c₀|)²     C = |c| − |c₀|             β = (A₀+A₁) / (3 k)
///             c = Σ Kᵢ xᵢ,  K = (cot₀₃+cot₀₄, cot₀₁+cot₀₂, −cot₀₁−cot₀₃, −cot₀₂−cot₀₄)
/// ```
///
/// |c| is L θ to first order, so that `k` means the same in both. θ is 0 for a flat hinge, and is
/// found with `atan2`; its gradient divides by areas only, so 0° and 180° are like other angles.
///
/// The angle bends the more, the farther it is turned at once: a visit moves no vertex farther than
/// the longest distance between two corners of its hinge at rest. Without that bound rigid hinges
/// that nothing holds together grow in every visit (to 1e57 of their size, in `tests/stability`);
/// hinges of cloth at work stay far below it.
///
/// Hinges whose present state has a triangle without area are left alone and counted; those whose
/// rest state has one, up to rounding, are left out. Edges with three or more triangles have no
/// hinge. An infinite compliance makes the group idle.
///
/// # Source
///
/// Dihedral: [Grinspun et al. 2003]; gradients from [Bridson et al. 2003]. Isometric: [Bergou et
/// al. 2006], with the length in place of the vector, so that curved rest states keep their shape
/// under rotation.
#[derive(Clone, Debug)]
pub struct Bending {
    vertices: Vec<[u32; 4]>,
    /// Cotangent weights K.
    cotangents: Vec<[Real; 4]>,
    /// θ₀ or |c₀|.
    rest: Vec<Real>,
    /// β of each hinge over `compliance`.
    scale: Vec<Real>,
    /// Square of the farthest that a visit may move a vertex.
    reach2: Vec<Real>,
    lambda: Vec<Real>,
    model: BendingModel,
    degenerate: u64,
    dropped: usize,
    /// 1/k in 1/J.
    compliance: Real,
}

impl Bending {
    /// Hinges of all inner edges of `mesh`, at rest as the mesh is, with `compliance` 1/k in 1/J (0
    /// is rigid, infinity makes the group idle).
    ///
    /// # Errors
    ///
    /// If the compliance is negative or NaN.
    pub fn of_mesh(
        mesh: &TriMesh,
        model: BendingModel,
        compliance: Real,
    ) -> Result<Self, ParameterError> {
        let edges = Edges::new(mesh);
        let mut hinges = Vec::new();
        for e in 0..edges.len() {
            if edges.valence[e] == 2 {
                let [a, b] = edges.vertices[e];
                let opposite = edges.triangles[e].map(|t| {
                    let corners = mesh.triangles()[t as usize];
                    corners.into_iter().find(|c| *c != a && *c != b).unwrap_or(a)
                });
                // A doubled triangle is no hinge.
                if opposite[0] != opposite[1] {
                    hinges.push([a, b, opposite[0], opposite[1]]);
                }
            }
        }
        Self::of_hinges(&hinges, mesh.vertices(), model, compliance)
    }

    /// The given hinges (edge ends, then opposite corners), at rest at `positions`.
    ///
    /// # Errors
    ///
    /// If the compliance is negative or NaN.
    ///
    /// # Panics
    ///
    /// If a hinge names a vertex without a position.
    pub fn of_hinges(
        hinges: &[[u32; 4]],
        positions: &[Point],
        model: BendingModel,
        compliance: Real,
    ) -> Result<Self, ParameterError> {
        check_compliance(compliance)?;
        let coloring = color(hinges, positions.len());
        let mut group = Self {
            vertices: Vec::new(),
            cotangents: Vec::new(),
            rest: Vec::new(),
            scale: Vec::new(),
            reach2: Vec::new(),
            lambda: Vec::new(),
            model,
            degenerate: 0,
            dropped: 0,
            compliance,
        };
        for k in coloring.order {
            let v = hinges[k as usize];
            let x = v.map(|i| positions[i as usize]);
            if !(has_area(&x[2], &x[0], &x[1]) && has_area(&x[3], &x[1], &x[0])) {
                group.dropped += 1;
                continue;
            }
            let areas = 0.5
                * (area_vector(&x[2], &x[0], &x[1]).norm()
                    + area_vector(&x[3], &x[1], &x[0]).norm());
            let (Some((angle, _)), Some(cotangents)) = (dihedral(&x), cotangents(&x)) else {
                group.dropped += 1;
                continue;
            };
            let length2 = (x[1] - x[0]).norm_squared();
            let (rest, scale) = match model {
                BendingModel::Dihedral => (angle, areas / (3.0 * length2)),
                BendingModel::Isometric => (curvature(&x, &cotangents).norm(), areas / 3.0),
            };
            group.vertices.push(v);
            group.cotangents.push(cotangents);
            group.rest.push(rest);
            group.scale.push(scale);
            let between = |i: usize, j: usize| (x[i] - x[j]).norm_squared();
            let longest =
                [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| between(i, j));
            group.reach2.push(longest.into_iter().fold(0.0, Real::max));
        }
        group.lambda = vec![0.0; group.vertices.len()];
        Ok(group)
    }

    /// Number of hinges.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Hinges left out because a triangle had no area at rest.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Bending energy at `positions`, in joules; 0 where the compliance is 0 or infinite.
    ///
    /// # Panics
    ///
    /// If a hinge's vertex has no position.
    pub fn energy(&self, positions: &[Point]) -> Real {
        if self.compliance == 0.0 || self.is_idle() {
            return 0.0;
        }
        (0..self.len())
            .filter_map(|k| {
                self.evaluate(k, positions)
                    .map(|(c, _)| 0.5 * c * c / (self.compliance * self.scale[k]))
            })
            .sum()
    }

    /// C and its four gradients.
    #[inline]
    fn evaluate(&self, k: usize, positions: &[Point]) -> Option<(Real, [Vector; 4])> {
        let x = self.vertices[k].map(|i| positions[i as usize]);
        match self.model {
            BendingModel::Dihedral => {
                let (angle, gradients) = dihedral(&x)?;
                let mut c = angle - self.rest[k];
                if c > std::f64::consts::PI {
                    c -= std::f64::consts::TAU;
                } else if c <= -std::f64::consts::PI {
                    c += std::f64::consts::TAU;
                }
                Some((c, gradients))
            }
            BendingModel::Isometric => {
                let v = curvature(&x, &self.cotangents[k]);
                let length = v.norm();
                if length > 0.0 {
                    let direction = v / length;
                    Some((length - self.rest[k], self.cotangents[k].map(|w| direction * w)))
                } else if self.rest[k] == 0.0 {
                    Some((0.0, [Vector::zeros(); 4]))
                } else {
                    None
                }
            }
        }
    }
}

fn has_area(a: &Point, b: &Point, c: &Point) -> bool {
    let longest2 = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    area_vector(a, b, c).norm() > FLAT * longest2
}

/// Dihedral angle of the hinge (x₀, x₁ | x₂, x₃) in (−π, π], 0 when flat, with its gradients;
/// `None` where the edge has no length or a triangle no area.
fn dihedral(x: &[Point; 4]) -> Option<(Real, [Vector; 4])> {
    let e = x[1] - x[0];
    let length = e.norm();
    let n0 = area_vector(&x[2], &x[0], &x[1]);
    let n1 = area_vector(&x[3], &x[1], &x[0]);
    let (s0, s1) = (n0.norm_squared(), n1.norm_squared());
    if !(length > 0.0 && s0 > 0.0 && s1 > 0.0) {
        return None;
    }
    let angle = (n0.cross(&n1).dot(&e) / length).atan2(n0.dot(&n1));
    let (m0, m1) = (n0 / s0, n1 / s1);
    let along = |p: &Point, q: &Point| (p - q).dot(&e) / length;
    Some((
        angle,
        [
            -(m0 * along(&x[2], &x[1]) + m1 * along(&x[3], &x[1])),
            m0 * along(&x[2], &x[0]) + m1 * along(&x[3], &x[0]),
            m0 * -length,
            m1 * -length,
        ],
    ))
}

/// Weights K of Bergou's mean-curvature vector; `None` where a triangle has no area.
fn cotangents(x: &[Point; 4]) -> Option<[Real; 4]> {
    let cot = |u: Vector, v: Vector| {
        let sine = u.cross(&v).norm();
        (sine > 0.0).then(|| u.dot(&v) / sine).filter(|c| c.is_finite())
    };
    let e = x[1] - x[0];
    let c01 = cot(e, x[2] - x[0])?;
    let c02 = cot(e, x[3] - x[0])?;
    let c03 = cot(-e, x[2] - x[1])?;
    let c04 = cot(-e, x[3] - x[1])?;
    Some([c03 + c04, c01 + c02, -c01 - c03, -c02 - c04])
}

/// `Σ Kᵢ xᵢ`, from differences, so that a translation does not cost digits.
#[inline]
fn curvature(x: &[Point; 4], k: &[Real; 4]) -> Vector {
    (x[1] - x[0]) * k[1] + (x[2] - x[0]) * k[2] + (x[3] - x[0]) * k[3]
}

impl Constraint for Bending {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.lambda.fill(0.0);
    }

    /// # Panics
    ///
    /// If a hinge's vertex is beyond the slices.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual {
        let mut residual = Residual::default();
        if self.is_idle() {
            return residual;
        }
        for k in 0..self.len() {
            let Some((c, gradients)) = self.evaluate(k, positions) else {
                self.degenerate += 1;
                continue;
            };
            let v = self.vertices[k];
            let w = v.map(|i| inverse_masses[i as usize]);
            let softness = self.compliance * self.scale[k] / (h * h);
            let slopes2 = gradients.map(|g| g.norm_squared());
            let movable: Real = (0..4).map(|i| w[i] * slopes2[i]).sum();
            let violation = c + softness * self.lambda[k];
            residual.add(violation);
            let a = movable + softness;
            if !(movable > 0.0 && a.is_finite()) {
                continue;
            }
            let mut delta = -violation / a;
            let farthest2 =
                (0..4).map(|i| w[i] * w[i] * slopes2[i]).fold(0.0, Real::max) * (delta * delta);
            if farthest2 > self.reach2[k] {
                delta *= (self.reach2[k] / farthest2).sqrt();
            }
            self.lambda[k] += delta;
            for i in 0..4 {
                positions[v[i] as usize] += gradients[i] * (w[i] * delta);
            }
        }
        residual
    }

    fn is_idle(&self) -> bool {
        self.is_empty() || self.compliance == Real::INFINITY
    }

    fn counters(&self) -> Counters {
        Counters { degenerate: self.degenerate, ..Counters::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const HINGE: [[u32; 4]; 1] = [[0, 1, 2, 3]];

    /// A hinge about the y axis, opened by `angle` from flat.
    fn bent(angle: Real) -> Vec<Point> {
        let (s, c) = angle.sin_cos();
        vec![
            Point::origin(),
            Point::new(0.0, 1.0, 0.0),
            Point::new(-0.8, 0.4, 0.0),
            Point::new(0.9 * c, 0.7, 0.9 * s),
        ]
    }

    #[test]
    fn gradients_are_those_of_central_differences() {
        for model in [BendingModel::Dihedral, BendingModel::Isometric] {
            for angle in [-3.0, -1.2, 0.3, 1.57, 2.8] {
                let group = Bending::of_hinges(&HINGE, &bent(0.5), model, 1.0).unwrap();
                let p = bent(angle);
                let (_, gradients) = group.evaluate(0, &p).unwrap();
                let step = 1e-6;
                for v in 0..4 {
                    for axis in 0..3 {
                        let at = |s: Real| {
                            let mut q = p.clone();
                            q[v][axis] += s;
                            group.evaluate(0, &q).unwrap().0
                        };
                        let difference = (at(step) - at(-step)) / (2.0 * step);
                        // Error of central differences: third derivative · step²/6 + 1e-16/step.
                        assert_relative_eq!(gradients[v][axis], difference, epsilon = 1e-8);
                    }
                }
            }
        }
    }

    #[test]
    fn both_models_have_the_same_energy_for_a_slight_fold() {
        let energy = |model, angle| {
            Bending::of_hinges(&HINGE, &bent(0.0), model, 0.1).unwrap().energy(&bent(angle))
        };
        let (a, b) = (energy(BendingModel::Dihedral, 0.01), energy(BendingModel::Isometric, 0.01));
        // They differ in the fourth power of the angle.
        assert_relative_eq!(a, b, max_relative = 1e-4);
        assert!(a > 0.0);
    }

    #[test]
    fn a_hinge_returns_to_its_rest_angle_also_from_zero_and_a_half_turn() {
        let pi = std::f64::consts::PI;
        for (rest, start) in
            [(0.0, 1.0), (1.0, 0.0), (pi, pi - 0.5), (0.4, pi), (-pi + 0.1, pi - 0.1), (0.2, -0.3)]
        {
            let mut group =
                Bending::of_hinges(&HINGE, &bent(rest), BendingModel::Dihedral, 0.0).unwrap();
            let rest = dihedral(&bent(rest).try_into().unwrap()).unwrap().0;
            let mut p = bent(start);
            for _ in 0..200 {
                group.begin_substep(&[], &[], &[], 1.0);
                group.project(&mut p, &[1.0; 4], 1.0);
            }
            let (angle, _) = dihedral(&p.try_into().unwrap()).unwrap();
            let off = (angle - rest).rem_euclid(2.0 * pi);
            assert!(off.min(2.0 * pi - off) < 1e-9, "{start} → {angle}, not {rest}");
        }
    }

    #[test]
    fn rigid_hinges_that_nothing_holds_together_do_not_grow() {
        // A crumpled ball of rigid hinges without any stretch: each visit turns by radians, far
        // from where angles are linear, and overshoots in proportion to the size of the hinge.
        // Unbounded, this grows beyond 1e6.
        let mesh = if_core::shapes::meshes::icosphere(0.5, 1);
        let mut group = Bending::of_mesh(&mesh, BendingModel::Dihedral, 0.0).unwrap();
        let noise = |k: usize, s: Real| 0.5 * (s * (k + 1) as Real).sin();
        let n = mesh.vertices().len();
        let crumple = |(k, p): (usize, &Point)| {
            p + Vector::new(noise(k, 12.9), noise(k, 78.2), noise(k, 37.7))
        };
        let mut p: Vec<Point> = mesh.vertices().iter().enumerate().map(crumple).collect();
        for _ in 0..100 {
            group.begin_substep(&[], &[], &[], 0.01);
            group.project(&mut p, &vec![1.0; n], 0.01);
            let farthest = p.iter().map(|x| x.coords.norm()).fold(0.0, Real::max);
            assert!(farthest < 20.0, "{farthest}");
        }
    }

    #[test]
    fn a_rigid_motion_bends_nothing() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        for model in [BendingModel::Dihedral, BendingModel::Isometric] {
            let mut group = Bending::of_hinges(&HINGE, &bent(0.7), model, 1e-3).unwrap();
            let mut p: Vec<Point> =
                bent(0.7).iter().map(|x| turn * x + Vector::new(1e3, -1e3, 1e3)).collect();
            let r = group.project(&mut p, &[1.0; 4], 0.01);
            // Coordinates of 1e3 carry 1e-13.
            assert!(r.max < 1e-11, "{}", r.max);
        }
    }

    #[test]
    fn momentum_and_angular_momentum_stay() {
        for model in [BendingModel::Dihedral, BendingModel::Isometric] {
            let mut group = Bending::of_hinges(&HINGE, &bent(0.7), model, 1e-3).unwrap();
            let (w, before) = ([1.0, 0.5, 2.0, 4.0], bent(2.0));
            let mut p = before.clone();
            group.project(&mut p, &w, 0.1);
            let (mut linear, mut angular) = (Vector::zeros(), Vector::zeros());
            for i in 0..4 {
                let impulse = (p[i] - before[i]) / w[i];
                linear += impulse;
                angular += before[i].coords.cross(&impulse);
            }
            assert!(linear.norm() < 1e-14 && angular.norm() < 1e-14, "{linear} {angular}");
        }
    }

    #[test]
    fn degenerate_hinges_are_left_alone() {
        let flat = vec![
            Point::origin(),
            Point::new(0.0, 1.0, 0.0),
            Point::new(0.0, 2.0, 0.0),
            Point::new(1.0, 0.0, 0.0),
        ];
        for model in [BendingModel::Dihedral, BendingModel::Isometric] {
            assert_eq!(Bending::of_hinges(&HINGE, &flat, model, 1.0).unwrap().dropped(), 1);
            assert_eq!(
                Bending::of_hinges(&HINGE, &[Point::origin(); 4], model, 1.0).unwrap().len(),
                0
            );
            // A line but for rounding, wherever it stands; a needle of a millionth is none.
            for (height, dropped) in [(1e-16, 1), (1e-11, 1), (1e-6, 0)] {
                let mut needle = bent(0.5);
                needle[2] = Point::new(-height, 0.4, 0.0);
                assert_eq!(
                    Bending::of_hinges(&HINGE, &needle, model, 1.0).unwrap().dropped(),
                    dropped,
                    "{height}"
                );
            }
            for compliance in [0.0, 1e-12, 1e3, Real::INFINITY] {
                let mut group = Bending::of_hinges(&HINGE, &bent(0.5), model, compliance).unwrap();
                for start in [flat.clone(), vec![Point::origin(); 4], bent(0.0)] {
                    let mut p = start.clone();
                    group.begin_substep(&[], &[], &[], 1e-3);
                    group.project(&mut p, &[1.0; 4], 1e-3);
                    assert!(p.iter().all(|x| x.iter().all(|c| c.is_finite())));
                    let mut pinned = start.clone();
                    group.project(&mut pinned, &[0.0; 4], 1e-3);
                    assert_eq!(pinned, start);
                }
            }
        }
    }
}
