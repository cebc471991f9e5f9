//! What steps and runs report, and how they fail.

use crate::constraint::{Counters, Residual};
use if_core::math::Real;
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;

/// What a step did.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StepReport {
    /// Substeps of the attempt that succeeded.
    pub substeps: u32,
    /// Attempts that were rolled back.
    pub retries: u32,
    /// The farthest that a vertex moved in the step, in metres.
    pub moved: Real,
    /// Violation of the elastic groups at their last visit.
    pub elastic: Residual,
    /// Violation of the contact groups at their last visit.
    pub contact: Residual,
    /// Violation of the final groups at their visit.
    pub last: Residual,
    /// Kinetic energy at the end, in joules; in a quasi-static run that of the last substep's
    /// motion.
    pub kinetic_energy: Real,
    /// Groups that had nothing to do.
    pub idle_groups: usize,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// No vertex moved farther than [`stop_below`](crate::params::SolverParams::stop_below) in a
    /// step.
    Converged,
    /// All steps were made.
    Exhausted,
}

/// What a run did.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RunReport {
    /// Steps made.
    pub steps: u32,
    /// Substeps made, without those that were rolled back.
    pub substeps: u64,
    /// Attempts that were rolled back.
    pub retries: u32,
    /// Why it ended.
    pub stop: Stop,
    /// The last step; `None` if no step was made.
    pub last: Option<StepReport>,
    /// Work done and skipped by all groups.
    pub counters: Counters,
}

/// Why a step failed. The particles are then as they were before it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// The state was not finite before anything was done.
    #[error(
        "particles {vertices:?} are not finite before the step; give finite positions and velocities"
    )]
    Input {
        /// The first of them.
        vertices: Vec<u32>,
    },
    /// Slices of different lengths.
    #[error(
        "{positions} positions, {velocities} velocities and {inverse_masses} inverse masses; give one of each a particle"
    )]
    Count {
        /// Positions given.
        positions: usize,
        /// Velocities given.
        velocities: usize,
        /// Inverse masses given.
        inverse_masses: usize,
    },
    /// A number of a group is out of range.
    #[error("group {group} is invalid: {source}")]
    Group {
        /// Index of the group in the list given.
        group: usize,
        /// What is invalid in it.
        source: ParameterError,
    },
    /// The state stopped being finite, whatever the substep.
    #[error(
        "particles {vertices:?} are not finite after {substeps} substeps of {h} s; check the constraints on them, or allow more retries"
    )]
    NonFinite {
        /// The first of them.
        vertices: Vec<u32>,
        /// Substeps of the last attempt.
        substeps: u32,
        /// Their size, in seconds.
        h: Real,
    },
    /// The kinetic energy jumped, whatever the substep.
    #[error(
        "the kinetic energy jumps to {energy} J (allowed: {allowed} J) with substeps of {h} s; the fastest particles are {vertices:?}; soften the constraints on them, or raise energy_jump"
    )]
    EnergyJump {
        /// The fastest particles.
        vertices: Vec<u32>,
        /// Energy reached, in joules.
        energy: Real,
        /// Energy allowed, in joules.
        allowed: Real,
        /// Substep of the last attempt, in seconds.
        h: Real,
    },
    /// A vertex moved many times the size of the scene, whatever the substep.
    #[error(
        "particles {vertices:?} move up to {moved} m in a step (allowed: {allowed} m) with substeps of {h} s; check the constraints on them, or raise displacement_jump"
    )]
    DisplacementJump {
        /// The particles that moved farthest.
        vertices: Vec<u32>,
        /// How far the first of them moved, in metres.
        moved: Real,
        /// How far was allowed, in metres.
        allowed: Real,
        /// Substep of the last attempt, in seconds.
        h: Real,
    },
}

/// Why a run ended early.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// A step failed. The particles are as they were before it.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The monitor cancelled the run. The particles are as the last step left them.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
