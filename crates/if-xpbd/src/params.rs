//! The solver's parameters, with the corrected and the literal preset.

use crate::collision::Push;
use crate::constraint::check_contact;
use if_core::math::Real;
use if_core::number_or_infinite;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// What line 18 adds to `C`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub enum LambdaForm {
    /// `C + β̃ λ`, as XPBD has it: any number of sweeps solves the same problem.
    #[default]
    Xpbd,
    /// `C + β λ`, as line 18 prints it: more sweeps make a softer spring harder.
    Printed,
    /// `C` alone, as position-based dynamics has it [Müller et al. 2007]: each visit removes the
    /// share `w / (w + β̃)` of the violation, w being the sum of the inverse masses. More sweeps
    /// make a softer spring harder.
    Pbd,
}

/// Where in a substep contacts are visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ContactOrder {
    /// Once, before the elastic sweeps, as lines 6 to 22 are printed: leaves vertices inside again.
    BeforeStretch,
    /// After each elastic sweep, hence also last.
    #[default]
    AfterStretch,
    /// Once before the first elastic sweep and after each.
    Both,
}

/// What line 3 starts from.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Motion {
    /// v := 0 in each substep: the garment settles, and pushes leave no speed behind.
    #[default]
    QuasiStatic,
    /// Velocities persist, and lose the fraction `1 − exp(−damping h)` in a substep; damping in
    /// 1/s.
    Dynamic {
        /// Damping rate, in 1/s; 0 as printed.
        damping: Real,
    },
}

/// Parameters of [`Solver`](crate::solver::Solver) and of
/// [`run_algorithm1`](crate::algorithm1::run_algorithm1).
///
/// `Default` is the corrected method. [`SolverParams::literal`], lines 1 to 26 as printed, exists
/// for comparisons with the paper: nothing else uses it.
///
/// `compliance`, `lambda_form`, `push`, `friction`, `clearance` and `max_push` are for the groups
/// that `run_algorithm1` makes. A `Solver` does not read them: each group has its own. Substeps, sweeps
/// and visits are at most 10,000 each, as a run can be cancelled only between steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SolverParams {
    /// Δt of line 1, in seconds.
    pub time_step: Real,
    /// numSubSteps of line 1.
    pub substeps: u32,
    /// Time steps for each garment.
    pub steps: u32,
    /// Visits of the elastic groups in a substep; 0 visits none, and the contacts as after a visit.
    pub sweeps: u32,
    /// Visits of the contact groups wherever [`contact_order`](Self::contact_order) has them: one
    /// more where contacts disturb each other.
    pub contact_visits: u32,
    /// Visits of the contact groups alone at the end of a substep, after the last sweep.
    pub final_contact_visits: u32,
    /// β of line 5 for the stretch group, in m/N.
    #[serde(with = "number_or_infinite")]
    pub compliance: Real,
    /// What line 18 adds to C.
    pub lambda_form: LambdaForm,
    /// How line 8 brings a vertex out of the field. [`Push::Literal`] ignores the clearance, mask
    /// weights between 0 and 1, and `max_push`.
    pub push: Push,
    /// Where contacts are visited in a substep.
    pub contact_order: ContactOrder,
    /// What line 3 starts from.
    pub motion: Motion,
    /// Acceleration of gravity, in m/s². Line 3 prints none. In a quasi-static run it is the
    /// displacement g h² of each substep.
    pub gravity: [Real; 3],
    /// A quasi-static run stops once no vertex moved farther than this in a step, in metres; with 0, or
    /// if it is dynamic, it makes all steps. With gravity, choose less than `substeps` times g h².
    pub stop_below: Real,
    /// Coulomb coefficient of friction of collisions.
    pub friction: Real,
    /// δ: distance kept from the field's zero set, in metres. Give collisions more where edges are
    /// long: L²κ/8 for edges of length L across a curvature κ.
    pub clearance: Real,
    /// The largest push of a vertex in one visit of a collision, in metres.
    #[serde(with = "number_or_infinite")]
    pub max_push: Real,
    /// Whether the speed that a push out of a penetration leaves is removed after line 24: of the
    /// vertices that a contact pushed in the substep, the speed along the push. Without effect in a
    /// quasi-static run, where velocities are zero.
    pub remove_depenetration_velocity: bool,
    /// Maximum number of times that a failed step is rolled back and tried with h/2.
    pub retries: u32,
    /// A step of a dynamic run fails if the kinetic energy grows by more than this factor (from at
    /// least that of 1 m/s) and beyond the energy of crossing the scene in Δt. Infinity allows every
    /// finite energy.
    #[serde(with = "number_or_infinite")]
    pub energy_jump: Real,
    /// A step fails if a vertex moves farther than this many times the size of the scene (at least
    /// 1 m): the diagonal of the particles' box, and what free flight covers in Δt. Infinity allows
    /// every finite motion. A quasi-static run has no other guard but the one for finite numbers.
    #[serde(with = "number_or_infinite")]
    pub displacement_jump: Real,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self {
            time_step: 0.01,
            substeps: 10,
            steps: 360,
            sweeps: 1,
            contact_visits: 1,
            final_contact_visits: 0,
            compliance: 1e-5,
            lambda_form: LambdaForm::Xpbd,
            push: Push::Corrected,
            contact_order: ContactOrder::AfterStretch,
            motion: Motion::QuasiStatic,
            gravity: [0.0; 3],
            stop_below: 1e-5,
            friction: 0.0,
            clearance: 1e-3,
            max_push: 0.01,
            remove_depenetration_velocity: true,
            retries: 3,
            energy_jump: 1e4,
            displacement_jump: 1e4,
        }
    }
}

impl SolverParams {
    /// Algorithm 1 as printed: Δt = 0.01 s, 10 substeps, 360 steps, β = 10⁻⁵, contacts once and
    /// before the stretch, `C + β λ`, `p − φ ∇φ`, no clearance, no limits, and velocities from the
    /// final `p`.
    pub fn literal() -> Self {
        Self {
            lambda_form: LambdaForm::Printed,
            push: Push::Literal,
            contact_order: ContactOrder::BeforeStretch,
            motion: Motion::Dynamic { damping: 0.0 },
            stop_below: 0.0,
            clearance: 0.0,
            max_push: Real::INFINITY,
            remove_depenetration_velocity: false,
            retries: 0,
            energy_jump: Real::INFINITY,
            displacement_jump: Real::INFINITY,
            ..Self::default()
        }
    }

    /// h of line 1, in seconds.
    pub fn substep(&self) -> Real {
        self.time_step / Real::from(self.substeps)
    }

    /// Checks every number.
    ///
    /// # Errors
    ///
    /// The first that is NaN or outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        let positive = |x: Real| x > 0.0 && x.is_finite();
        let not_negative = |x: Real| x >= 0.0 && x.is_finite();
        check(
            "time_step",
            self.time_step,
            positive(self.time_step),
            "positive and finite (seconds)",
        )?;
        for (name, n, least, range) in [
            ("substeps", self.substeps, 1, "from 1 to 10,000"),
            ("contact_visits", self.contact_visits, 1, "from 1 to 10,000"),
            ("sweeps", self.sweeps, 0, "at most 10,000"),
            ("final_contact_visits", self.final_contact_visits, 0, "at most 10,000"),
        ] {
            check(name, n.into(), (least..=10_000).contains(&n), range)?;
        }
        let h2 = self.substep() * self.substep();
        check(
            "time_step",
            self.time_step,
            positive(h2),
            "such that the square of a substep is a positive number",
        )?;
        check(
            "compliance",
            self.compliance,
            self.compliance >= 0.0,
            "at least 0 (m/N; infinity for no stretch constraint)",
        )?;
        for (axis, g) in self.gravity.into_iter().enumerate() {
            check("gravity", g, g.is_finite(), "finite (m/s²)").map_err(|e| e.at(axis))?;
        }
        check(
            "stop_below",
            self.stop_below,
            not_negative(self.stop_below),
            "finite and at least 0 (metres)",
        )?;
        check_contact(self.friction, self.max_push)?;
        check(
            "clearance",
            self.clearance,
            not_negative(self.clearance),
            "finite and at least 0 (metres)",
        )?;
        check("retries", self.retries.into(), self.retries <= 10, "at most 10 (each halves h)")?;
        check(
            "energy_jump",
            self.energy_jump,
            self.energy_jump > 1.0,
            "above 1 (infinity for no limit)",
        )?;
        let jump = self.displacement_jump;
        check("displacement_jump", jump, jump > 1.0, "above 1 (infinity for no limit)")?;
        if let Motion::Dynamic { damping } = self.motion {
            check("damping", damping, not_negative(damping), "finite and at least 0 (1/s)")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_presets_are_valid_and_have_the_papers_numbers() {
        for params in [SolverParams::default(), SolverParams::literal()] {
            params.validate().unwrap();
            assert_eq!(
                (params.time_step, params.substeps, params.steps, params.compliance),
                (0.01, 10, 360, 1e-5)
            );
            assert_eq!(params.substep(), 0.001);
            // Also those that are infinite.
            let text = serde_json::to_string(&params).unwrap();
            assert_eq!(serde_json::from_str::<SolverParams>(&text).unwrap(), params, "{text}");
        }
    }

    #[test]
    fn a_parameter_out_of_range_is_named() {
        type Spoil = fn(&mut SolverParams);
        let table: [(&str, Spoil); 19] = [
            ("time_step", |p| p.time_step = Real::NAN),
            ("time_step", |p| p.time_step = 0.0),
            ("time_step", |p| p.time_step = 1e-200),
            ("substeps", |p| p.substeps = 0),
            ("contact_visits", |p| p.contact_visits = 0),
            ("substeps", |p| p.substeps = u32::MAX),
            ("contact_visits", |p| p.contact_visits = 10_001),
            ("sweeps", |p| p.sweeps = 10_001),
            ("final_contact_visits", |p| p.final_contact_visits = 10_001),
            ("compliance", |p| p.compliance = -1.0),
            ("compliance", |p| p.compliance = Real::NAN),
            ("gravity[1]", |p| p.gravity[1] = Real::INFINITY),
            ("stop_below", |p| p.stop_below = Real::NAN),
            ("friction", |p| p.friction = -0.1),
            ("clearance", |p| p.clearance = Real::INFINITY),
            ("max_push", |p| p.max_push = 0.0),
            ("energy_jump", |p| p.energy_jump = 1.0),
            ("displacement_jump", |p| p.displacement_jump = Real::NAN),
            ("damping", |p| p.motion = Motion::Dynamic { damping: -1.0 }),
        ];
        for (expected, spoil) in table {
            let mut params = SolverParams::default();
            spoil(&mut params);
            assert_eq!(params.validate().unwrap_err().name, expected);
        }
        for fine in [0.0, 1e-12, 1e3, Real::INFINITY] {
            SolverParams { compliance: fine, ..Default::default() }.validate().unwrap();
        }
    }
}
