//! What the solver asks of a group of constraints, and what a group answers.

use if_core::math::{Point, Real, Vector};

/// When in a substep a group is visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Stage {
    /// Lines 16 to 22: stretch, bending, attachments, strain limits. Visited `sweeps` times.
    Elastic,
    /// Lines 6 to 15: collision, air, contacts. Where they stand is
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
    /// The largest violation, in the unit of the constraint (metres, radians for bending).
    pub max: Real,
    /// Sum of the squared violations. NaN where one of them was NaN, so that none passes silently.
    pub sum_squares: Real,
    /// Constraints visited.
    pub count: usize,
    /// Of these, the ones that were violated: they move what can be moved.
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

    /// Both together.
    #[inline]
    pub fn merged(self, other: Self) -> Self {
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

/// Work done and work skipped by a group since it was made, or since its last `reset`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Field or nearest-point queries made.
    pub queries: u64,
    /// Queries that a bound on the motion made unnecessary.
    pub skipped_by_bound: u64,
    /// Queries that a mask or a bounding box made unnecessary.
    pub skipped_by_mask: u64,
    /// Elements left alone because they were degenerate: no gradient, no area, coincident ends, or
    /// a field that answered NaN.
    pub degenerate: u64,
}

impl Counters {
    /// Both together.
    pub fn merged(self, other: Self) -> Self {
        Self {
            queries: self.queries + other.queries,
            skipped_by_bound: self.skipped_by_bound + other.skipped_by_bound,
            skipped_by_mask: self.skipped_by_mask + other.skipped_by_mask,
            degenerate: self.degenerate + other.degenerate,
        }
    }
}

/// A number of a group with which no constraint can be solved.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GroupError {
    /// A compliance below zero, or none.
    #[error(
        "the compliance of the {group} constraints is {value} m/N; give one that is not negative (infinity makes them idle)"
    )]
    Compliance {
        /// Which group: "stretch", "bending".
        group: &'static str,
        /// The compliance.
        value: Real,
    },
    /// The same of one constraint.
    #[error(
        "the compliance of {group} constraint {index} is {value} m/N; give one that is not negative (infinity makes it idle)"
    )]
    CompliancePer {
        /// Which group: "attachment".
        group: &'static str,
        /// The constraint, in the order in which they were given.
        index: usize,
        /// Its compliance.
        value: Real,
    },
}

impl GroupError {
    /// Whether `compliance` can be one of `group`: 0, positive or infinite.
    ///
    /// # Errors
    ///
    /// [`GroupError::Compliance`].
    pub fn of_compliance(group: &'static str, compliance: Real) -> Result<(), Self> {
        if compliance >= 0.0 {
            Ok(())
        } else {
            Err(GroupError::Compliance { group, value: compliance })
        }
    }
}

/// One *group* of constraints: dynamic dispatch once per group and sweep, static per element.
///
/// All slices have one entry per particle. An inverse mass of zero pins its particle.
pub trait Constraint {
    /// Starts a substep of `h` seconds: line 4 (λ ← 0), and whatever the group remembers of
    /// `previous`, the positions at the start of the substep. `positions` are the predicted ones.
    fn begin_substep(
        &mut self,
        previous: &[Point],
        positions: &[Point],
        inverse_masses: &[Real],
        h: Real,
    );

    /// Visits every constraint of the group once, in an order that is always the same.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], h: Real) -> Residual;

    /// Where in the substep the group belongs.
    fn stage(&self) -> Stage {
        Stage::Elastic
    }

    /// Takes out of `velocities` what only comes from pushing particles out of a penetration:
    /// groups of contacts do, elastic ones leave them. Called after line 24 where
    /// [`remove_depenetration_velocity`](crate::params::SolverParams::remove_depenetration_velocity)
    /// is set.
    fn correct_velocities(&self, _velocities: &mut [Vector]) {}

    /// Forgets everything remembered about positions: they are about to jump (roll-back, teleport).
    fn reset(&mut self) {}

    /// Whether the numbers it was given make sense. The solver asks before each step.
    ///
    /// # Errors
    ///
    /// [`GroupError`], for what can be set to a number with which no constraint can be solved.
    fn check(&self) -> Result<(), GroupError> {
        Ok(())
    }

    /// Whether there is nothing to do: the solver skips such a group, and says so.
    fn is_idle(&self) -> bool {
        false
    }

    /// Work done and skipped.
    fn counters(&self) -> Counters {
        Counters::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
