//! Layer by layer, inner to outer: order, project, settle, verify exactly, repair, freeze.

use crate::outfit::{Outfit, OutfitError};
use crate::report::ResolveReport;
use if_core::math::Real;
use if_mesh::intersections::own_pairs;
use if_mesh::solid::ClosedLayer;
use std::time::Instant;
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
    outfit.check()?;
    let start = Instant::now();
    let before = crate::verify::verify(outfit)?;
    let mut result = outfit.clone();
    let mut report = ResolveReport { before, ..Default::default() };
    let body_mesh = &outfit.body.mesh;
    let mut below: Vec<(String, ClosedLayer)> = vec![(outfit.body.name.clone(), ClosedLayer::body(body_mesh))];
    for (index, garment) in outfit.garments.iter().enumerate() {
        let t = Instant::now();
        let inner: Vec<(&str, &ClosedLayer)> = below.iter().map(|(n, c)| (n.as_str(), c)).collect();
        let mut layer = { let tris: Vec<&[[u32; 3]]> = result.garments[..index].iter().map(|g| g.mesh.triangles()).collect(); crate::settle::settle(garment, &inner, &tris, params) };
        let mesh = garment.mesh.with_vertices(layer.1).expect("finite");
        layer.0.seconds = t.elapsed().as_secs_f64();
        let closed = ClosedLayer::garment(&mesh, &below[0].1, body_mesh);
        let found = crate::verify::against(garment, &mesh, closed.bvh(), &inner);
        report.after.pairs.extend(found.into_iter().map(|f| f.report));
        let own = own_pairs(&mesh, closed.bvh()).len();
        report.after.own_pairs.push(own);
        layer.0.own_pairs = [report.before.own_pairs[index], own];
        report.layers.push(layer.0);
        result.garments[index].mesh = mesh;
        below.push((garment.name.clone(), closed));
    }
    report.seconds = start.elapsed().as_secs_f64();
    let _ = watch;
    Ok(Resolved { outfit: result, report })
}
