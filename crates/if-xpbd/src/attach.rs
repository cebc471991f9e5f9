//! Soft attachments of particles to target positions.

use crate::constraint::{Constraint, GroupError, Residual};
use crate::params::LambdaForm;
use if_core::math::{Point, Real, Vector};

/// Attachments `C(p) = p − t`, one vector constraint for each attached particle.
///
/// ```text
/// Δλ = −(C + β̃ λ) / (w + β̃)      λ += Δλ      Δp = w Δλ
/// ```
///
/// It is linear, so that one visit of a particle that nothing else holds solves implicit Euler's
/// step exactly. A compliance of 0 moves the particle onto its target; to hold it there against
/// everything else, give it the inverse mass 0 instead. An infinite compliance does nothing.
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

    /// Attaches particle `vertex` to `target` with `compliance` β in m/N, 0 or more (a step refuses
    /// another).
    pub fn push(&mut self, vertex: u32, target: Point, compliance: Real) {
        self.vertices.push(vertex);
        self.targets.push(target);
        self.compliances.push(compliance);
        self.lambda.push(Vector::zeros());
    }

    /// Drops all attachments and keeps the memory.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.targets.clear();
        self.compliances.clear();
        self.lambda.clear();
    }

    /// The attachments of particles that can move, whose inverse mass is not 0.
    ///
    /// # Panics
    ///
    /// If there are fewer inverse masses than particles named.
    pub fn movable(&self, inverse_masses: &[Real]) -> Self {
        let mut part = Self { form: self.form, ..Self::default() };
        for (k, v) in
            self.vertices.iter().enumerate().filter(|(_, v)| inverse_masses[**v as usize] != 0.0)
        {
            part.push(*v, self.targets[k], self.compliances[k]);
        }
        part
    }

    /// Number of attachments.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// The targets, in the order of pushing, to be moved by the caller.
    pub fn targets_mut(&mut self) -> &mut [Point] {
        &mut self.targets
    }

    /// The compliances β in m/N, in the order of pushing.
    pub fn compliances_mut(&mut self) -> &mut [Real] {
        &mut self.compliances
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

    fn check(&self) -> Result<(), GroupError> {
        match self
            .compliances
            .iter()
            .position(|c| GroupError::of_compliance("attachment", *c).is_err())
        {
            Some(index) => Err(GroupError::CompliancePer {
                group: "attachment",
                index,
                value: self.compliances[index],
            }),
            None => Ok(()),
        }
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
        group.push(0, Point::new(1.0, 2.0, 3.0), compliance);
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
}
