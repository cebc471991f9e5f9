//! The paper's method: a garment is settled by Algorithm 1 over the masked field of what lies below.
//!
//! ```text
//! φ   ← union of the layers below, baked round the garment
//! φₘ  ← φ masked by the boxes of the garments below (Appendix C); of the body alone, unmasked
//! x   ← Algorithm 1: collision with φₘ, air over the next garment below, stretch
//! ```
//!
//! Vertices that φ ends outside are no proof for triangles, and outside the mask nothing binds: what
//! is left is found by exact verification, and repaired as with the other method.

use crate::outfit::Layer;
use crate::progress::{ALGORITHM_1, GarmentProgress};
use crate::workpiece::SettleError;
use if_core::masked::{BoxesMask, Mask, Masked};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_mesh::baked::{BakeError, Baked};
use if_mesh::solid::{ClosedLayer, ClothedField};
use if_xpbd::air::AirParams;
use if_xpbd::algorithm1::{Algorithm1Error, Below, run_algorithm1};
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::params::SolverParams;
use if_xpbd::report::RunError;

/// Cells of the baked field, in metres; larger for garments longer than 4 m.
const CELL: Real = 5e-3;
/// Cells along the longest side of a garment, at most.
const MOST_CELLS: Real = 800.0;
/// How far beyond the garment's box the field is baked, in metres: no vertex is pushed further.
const AROUND: Real = 0.03;

/// The positions of `garment` settled on the layers `below`, the body first, at least `clearance`
/// metres from them where the mask binds.
///
/// # Source
///
/// Supplement, Algorithm 1 and Appendix C.
///
/// # Errors
///
/// [`SettleError::Cancelled`] and [`SettleError::Step`].
pub(crate) fn settled(
    garment: &Layer,
    below: &[&ClosedLayer],
    clearance: Real,
    progress: &mut GarmentProgress<'_>,
) -> Result<Vec<Point>, SettleError> {
    let _phase = tracing::trace_span!("algorithm 1").entered();
    progress.report(ALGORITHM_1, 0, None)?;
    let mesh = &garment.mesh;
    let field = baked(mesh, below, progress.monitor)?;
    let Some((next, _)) = below[1..].split_last() else {
        let mask = vec![1.0; mesh.vertices().len()];
        return run(mesh, &Below { field: &field, mask: &mask, air: None }, clearance, progress);
    };
    let boxes = BoxesMask::new(below[1..].iter().map(|layer| layer.bvh().aabb()));
    let boxes = boxes.expect("positions are finite");
    let weights: Vec<Real> = mesh.vertices().iter().map(|p| boxes.weight(p).0).collect();
    let surface = next.to_mesh();
    let inner = InnerSurface::new(&surface, next.bvh());
    let air = AirParams { min_gap: clearance, ..AirParams::default() };
    let masked = Masked { field, mask: boxes };
    let below = Below { field: &masked, mask: &weights, air: Some((&inner, air)) };
    run(mesh, &below, clearance, progress)
}

/// The union of `below` round the garment.
fn baked(
    garment: &TriMesh,
    below: &[&ClosedLayer],
    monitor: &mut dyn Monitor,
) -> Result<Baked, SettleError> {
    let region = garment.surface_aabb().inflated(AROUND);
    let cell = CELL.max(region.size().max() / MOST_CELLS);
    match ClothedField::new(below.to_vec()).baked(&region, cell, monitor) {
        Ok(field) => Ok(field),
        Err(BakeError::Cancelled(cancelled)) => Err(SettleError::Cancelled(cancelled)),
        Err(error) => unreachable!("a finite field in a bounded region: {error}"),
    }
}

fn run(
    garment: &TriMesh,
    below: &Below<'_>,
    clearance: Real,
    progress: &mut GarmentProgress<'_>,
) -> Result<Vec<Point>, SettleError> {
    let params = SolverParams { clearance, ..SolverParams::default() };
    match run_algorithm1(garment, below, &params, progress.monitor) {
        Ok((positions, _)) => Ok(positions),
        Err(Algorithm1Error::Run(RunError::Cancelled(cancelled))) => {
            Err(SettleError::Cancelled(cancelled))
        }
        Err(Algorithm1Error::Run(RunError::Step(error))) => Err(SettleError::Step(error)),
        Err(error) => unreachable!("checked parameters and positions: {error}"),
    }
}
