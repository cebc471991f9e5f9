//! Soft attachments of particles to target positions.

use crate::constraint::{Constraint, Residual, check_compliance};
use crate::params::LambdaForm;
use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;

/// Attachments `C(p) = p − t`, one vector constraint for each attached particle.
///
/// ```text
/// Δλ = −(C + β̃ λ) / (w + β̃)      λ += Δλ      Δp = w Δλ
/// ```
///
/// The constraint is linear: one visit of a particle without other constraints solves implicit
/// Euler's step exactly. A compliance of 0 moves the particle onto its target; to hold it there
/// against all other constraints, give it the inverse mass 0. An infinite compliance has no effect.
///
/// # Source
///
/// XPBD [Macklin et al. 2016], equations 17 and 18, for a constraint with values in ℝ³.
#[derive(Clone, Debug, Default)]
pub struct Attachments {
    vertices: Vec<u32>,
    targets: Vec<Point>,
    compliances: Vec<Real>,
    lambda: Vec<Vector>,
    /// What is added to C.
    pub form: LambdaForm,
}

impl Attachments {
    /// No attachments.
    pub fn new() -> Self {
        Self::default()
    }

    /// Attaches particle `vertex` to `target` with `compliance` β in m/N.
    ///
    /// # Errors
    ///
    /// If the compliance is negative or NaN. Nothing is added then.
    pub fn push(
        &mut self,
        vertex: u32,
        target: Point,
        compliance: Real,
    ) -> Result<(), ParameterError> {
        check_compliance(compliance).map_err(|e| e.at(self.len()))?;
        self.push_checked(vertex, target, compliance);
        Ok(())
    }

    fn push_checked(&mut self, vertex: u32, target: Point, compliance: Real) {
        self.vertices.push(vertex);
        self.targets.push(target);
        self.compliances.push(compliance);
        self.lambda.push(Vector::zeros());
    }

    /// The attachments of movable particles (inverse mass not 0).
    ///
    /// # Panics
    ///
    /// If there are fewer inverse masses than particles named.
    pub fn movable(&self, inverse_masses: &[Real]) -> Self {
        let mut part = Self { form: self.form, ..Self::default() };
        for (k, v) in
            self.vertices.iter().enumerate().filter(|(_, v)| inverse_masses[**v as usize] != 0.0)
        {
            part.push_checked(*v, self.targets[k], self.compliances[k]);
        }
        part
    }

    /// Number of attachments.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are no attachments.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// The compliances β, in m/N, in the order of pushing.
    pub fn compliances(&self) -> &[Real] {
        &self.compliances
    }

    /// Sets the compliance β, in m/N, of the attachment that was pushed as number `index` (from 0).
    ///
    /// # Errors
    ///
    /// If the compliance is negative or NaN. The old one is kept then.
    ///
    /// # Panics
    ///
    /// If there is no such attachment.
    pub fn set_compliance(&mut self, index: usize, compliance: Real) -> Result<(), ParameterError> {
        check_compliance(compliance).map_err(|e| e.at(index))?;
        self.compliances[index] = compliance;
        Ok(())
    }
}

impl Constraint for Attachments {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        _positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.lambda.fill(Vector::zeros());
    }

    /// # Panics
    ///
    /// If an attached vertex is beyond the slices.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual {
        let mut residual = Residual::default();
        for k in 0..self.len() {
            let v = self.vertices[k] as usize;
            let softness = self.compliances[k] / (h * h);
            let w = inverse_masses[v];
            if softness == Real::INFINITY || w + softness <= 0.0 {
                continue;
            }
            let scale = match self.form {
                LambdaForm::Xpbd => softness,
                LambdaForm::Printed => self.compliances[k],
                LambdaForm::Pbd => 0.0,
            };
            let c = positions[v] - self.targets[k] + self.lambda[k] * scale;
            residual.add(c.norm());
            let delta = c * (-1.0 / (w + softness));
            self.lambda[k] += delta;
            positions[v] += delta * w;
        }
        residual
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn visit(compliance: Real, w: Real, visits: u32) -> Point {
        let mut group = Attachments::new();
        group.push(0, Point::new(1.0, 2.0, 3.0), compliance).unwrap();
        let mut p = vec![Point::origin()];
        group.begin_substep(&p.clone(), &p.clone(), &[w], 0.1);
        for _ in 0..visits {
            group.project(&mut p, &[w], 0.1);
        }
        p[0]
    }

    #[test]
    fn an_attachment_gives_the_implicit_step_however_often_it_is_visited() {
        // (w⁻¹/h²)(p − 0) + (p − t)/β = 0 → p = t w / (w + β/h²).
        for visits in [1, 2, 50] {
            assert_relative_eq!(
                visit(0.02, 2.0, visits),
                Point::new(0.5, 1.0, 1.5),
                epsilon = 1e-14
            );
        }
    }

    #[test]
    fn the_ends_of_the_range_are_rigid_and_absent() {
        assert_eq!(visit(0.0, 1.0, 1), Point::new(1.0, 2.0, 3.0));
        assert_eq!(visit(Real::INFINITY, 1.0, 1), Point::origin());
        for compliance in [0.0, 1.0, Real::INFINITY] {
            assert_eq!(visit(compliance, 0.0, 3), Point::origin());
        }
    }

    #[test]
    fn an_invalid_compliance_is_refused_with_its_index_and_changes_nothing() {
        let mut group = Attachments::new();
        group.push(0, Point::origin(), 1.0).unwrap();
        for value in [-1e-9, Real::NAN, Real::NEG_INFINITY] {
            let error = group.push(1, Point::origin(), value).unwrap_err();
            assert_eq!(error.name, "compliance[1]");
            assert_eq!(group.set_compliance(0, value).unwrap_err().name, "compliance[0]");
        }
        assert_eq!((group.len(), group.compliances[0]), (1, 1.0));
        group.set_compliance(0, Real::INFINITY).unwrap();
    }

    #[test]
    fn without_multipliers_each_visit_takes_the_same_share() {
        // w / (w + β/h²) = 2/3 of what is left.
        let mut group = Attachments::new();
        group.form = LambdaForm::Pbd;
        group.push(0, Point::origin(), 0.01).unwrap();
        let mut p = vec![Point::new(1.0, 0.0, 0.0)];
        for visits in 1..5 {
            group.project(&mut p, &[2.0], 0.1);
            assert_relative_eq!(p[0].x, (1.0 / 3.0_f64).powi(visits), epsilon = 1e-15);
        }
    }
}
