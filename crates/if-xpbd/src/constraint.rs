//! The trait of a group of constraints, and what a group reports.

use if_core::math::{Point, Real, Vector};
use if_core::parameter::ParameterError;

/// When in a substep a group is visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Stage {
    /// Lines 16 to 22: stretch, bending, attachments, strain limits. Visited `sweeps` times.
    Elastic,
    /// Lines 6 to 15: collision, air, contacts, in the order of
    /// [`SolverParams::contact_order`](crate::params::SolverParams::contact_order).
    Contact,
    /// After all sweeps and contacts, once: what must hold exactly at the end of the substep.
    Final,
}

/// How far a group was from being satisfied when it was visited, before its corrections.
///
/// For a compliant constraint the violation is `|C + β̃ λ|`; for an inequality it is `max(0, −C)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// The largest violation, in the unit of the constraint: metres for those of this crate.
    pub max: Real,
    /// Sum of the squared violations. NaN if one of them is NaN.
    pub sum_squares: Real,
    /// Constraints visited.
    pub count: usize,
    /// Number among them of violated inequalities, or of equalities with a direction to move in.
    pub active: usize,
}

impl Residual {
    /// Adds one violation.
    #[inline]
    pub fn add(&mut self, violation: Real) {
        let v = violation.abs();
        if v > self.max {
            self.max = v;
        }
        self.sum_squares += v * v;
        self.count += 1;
        self.active += usize::from(v > 0.0);
    }

    /// The residual of two groups together.
    #[inline]
    pub(crate) fn merged(self, other: Self) -> Self {
        Self {
            max: if other.max > self.max { other.max } else { self.max },
            sum_squares: self.sum_squares + other.sum_squares,
            count: self.count + other.count,
            active: self.active + other.active,
        }
    }

    /// Root of the mean squared violation; zero for an empty group.
    pub fn rms(&self) -> Real {
        if self.count == 0 { 0.0 } else { (self.sum_squares / self.count as Real).sqrt() }
    }
}

/// Work done and work skipped by a group since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Field or nearest-point queries made.
    pub queries: u64,
    /// Queries that a bound on the motion made unnecessary.
    pub skipped_by_bound: u64,
    /// Queries that a mask or a bounding box made unnecessary.
    pub skipped_by_mask: u64,
    /// Elements skipped because they were degenerate: no gradient, no area, coincident ends, or a
    /// NaN from the field.
    pub degenerate: u64,
}

impl Counters {
    /// The counts of two groups together.
    pub(crate) fn merged(self, other: Self) -> Self {
        Self {
            queries: self.queries + other.queries,
            skipped_by_bound: self.skipped_by_bound + other.skipped_by_bound,
            skipped_by_mask: self.skipped_by_mask + other.skipped_by_mask,
            degenerate: self.degenerate + other.degenerate,
        }
    }
}

/// Checks a compliance: 0 (rigid), positive, or infinite (the group is idle).
///
/// # Errors
///
/// If it is negative or NaN.
pub fn check_compliance(value: Real) -> Result<(), ParameterError> {
    ParameterError::check(
        "compliance",
        value,
        value >= 0.0,
        "at least 0 (m/N; infinity makes the constraint idle)",
    )
}

/// Checks the numbers of a contact group: friction and the largest push of a visit, in metres.
pub(crate) fn check_contact(friction: Real, max_push: Real) -> Result<(), ParameterError> {
    let rubs = friction >= 0.0 && friction.is_finite();
    ParameterError::check("friction", friction, rubs, "finite and at least 0")?;
    let range = "positive (metres; infinity for no limit)";
    ParameterError::check("max_push", max_push, max_push > 0.0, range)
}

/// One *group* of constraints: dynamic dispatch once per group and sweep, static per element.
///
/// All slices have one entry per particle. An inverse mass of zero pins its particle.
pub trait Constraint {
    /// Starts a substep of `h` seconds: line 4 (λ ← 0). `previous` are the positions at the start of
    /// the substep, `positions` the predicted ones.
    fn begin_substep(
        &mut self,
        previous: &[Point],
        positions: &[Point],
        inverse_masses: &[Real],
        h: Real,
    );

    /// Visits every constraint of the group once, in an order that is always the same.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual;

    /// Checks the numbers that callers may set between steps. The solver calls it before each step.
    ///
    /// # Errors
    ///
    /// The first that is NaN or outside its range.
    fn validate(&self) -> Result<(), ParameterError> {
        Ok(())
    }

    /// When in a substep the group is visited.
    fn stage(&self) -> Stage {
        Stage::Elastic
    }

    /// Removes from `velocities` what comes from pushing particles out of a penetration. Groups of
    /// contacts implement it. Called after line 24 if
    /// [`remove_depenetration_velocity`](crate::params::SolverParams::remove_depenetration_velocity)
    /// is set.
    fn correct_velocities(&self, _velocities: &mut [Vector]) {}

    /// Discards all state that depends on positions, which are about to jump (roll-back, teleport).
    fn reset(&mut self) {}

    /// Whether the group has nothing to do. The solver skips idle groups and reports their number.
    fn is_idle(&self) -> bool {
        false
    }

    /// Counts of work done and skipped.
    fn counters(&self) -> Counters {
        Counters::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_negative_or_nan_compliance_is_out_of_range() {
        for value in [-1e-9, Real::NAN, Real::NEG_INFINITY] {
            assert_eq!(check_compliance(value).unwrap_err().name, "compliance");
        }
        for value in [0.0, 1e-300, Real::INFINITY] {
            check_compliance(value).unwrap();
        }
    }

    #[test]
    fn a_residual_keeps_the_largest_and_does_not_lose_a_nan() {
        let mut r = Residual::default();
        r.add(-3.0);
        r.add(4.0);
        r.add(0.0);
        assert_eq!((r.max, r.sum_squares, r.count, r.active), (4.0, 25.0, 3, 2));
        let both = r.merged(r);
        assert_eq!((both.max, both.sum_squares, both.count), (4.0, 50.0, 6));
        r.add(Real::NAN);
        assert!(r.sum_squares.is_nan() && r.rms().is_nan());
        assert_eq!(Residual::default().rms(), 0.0);
    }
}
