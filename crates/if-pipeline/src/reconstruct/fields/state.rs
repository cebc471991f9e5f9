//! The state of the training between two rounds.

use super::nets::Nets;
use super::report::FieldsReport;
use if_core::math::Point;
use if_neural::adam::Adam;
use if_neural::network::Network;

/// The state between two rounds, as a checkpoint holds it.
#[derive(Debug)]
pub(super) struct State {
    /// Steps done.
    pub(super) step: u64,
    pub(super) nets: Nets,
    /// φ before the first step.
    pub(super) start: Network,
    pub(super) phi_adam: Adam,
    pub(super) deformation_adam: Adam,
    /// Vertices of the start's mesh, which follow φ.
    pub(super) vertices: Vec<Point>,
    pub(super) report: FieldsReport,
}
