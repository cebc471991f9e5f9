//! How far an extraction is.

use crate::extract::ExtractError;
use serde::Serialize;
use std::ops::ControlFlow;

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Stage {
    /// Boxes are sorted out.
    Refine {
        /// Side of the boxes, in cells: 1 is the last level.
        step: u32,
    },
    /// Vertices are carried onto the surface.
    Polish,
    /// Vertices are moved along the surface.
    Relax,
    /// The result is measured.
    Check,
}

/// Where an extraction stands, told after each batch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Progress {
    /// What was just done.
    pub stage: Stage,
    /// Side of the cells, in metres: with a requested accuracy there are several attempts.
    pub cell: f64,
    /// Points at which the field was evaluated so far, in all attempts.
    pub evaluations: usize,
}

/// Counts, tells, hears whether to go on, and knows how much memory there is.
pub(super) struct Watch<'a> {
    pub(super) evaluations: usize,
    pub(super) cell: f64,
    /// Bytes that may be held at once.
    pub(super) memory: usize,
    pub(super) tell: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

impl Watch<'_> {
    pub(super) fn evaluated(&mut self, stage: Stage, points: usize) -> Result<(), ExtractError> {
        self.evaluations += points;
        match (self.tell)(&Progress { stage, cell: self.cell, evaluations: self.evaluations }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => {
                Err(ExtractError::Cancelled { evaluations: self.evaluations })
            }
        }
    }
}
