//! The paper's method: a garment is settled by Algorithm 1 over the masked field of what lies below.
//!
//! ```text
//! φ   ← union of the layers below, baked round the garment; a layer that comes with a field of its
//!       own has that instead, masked by its box
//! φₘ  ← φ masked by the boxes of the garments below (Appendix C); of the body alone, unmasked
//! x   ← Algorithm 1: collision with φₘ, air over the next garment below, stretch
//! ```
//!
//! Vertices that φ ends outside are no proof for triangles, and outside the mask nothing binds: what
//! is left is found by exact verification, and repaired as with the other method.

use crate::layer_fields::{FieldOfGarment, Nearest};
use crate::outfit::Layer;
use crate::params::ResolveParams;
use crate::progress::{ALGORITHM_1, GarmentProgress};
use crate::report::{Algorithm1Report, LayerField};
use crate::workpiece::SettleError;
use if_core::masked::{BoxMask, BoxesMask, Mask, Masked};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_mesh::baked::{BakeError, Baked};
use if_mesh::solid::{ClosedLayer, ClothedField};
use if_xpbd::algorithm1::{Algorithm1Error, Below, run_algorithm1};
use if_xpbd::constraint::Counters;
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::report::RunError;

/// Cells of the baked field, in metres; larger where the garment's box has more than 1 m³.
const CELL: Real = 5e-3;
/// Cells in the garment's box, at most. They take less than half of the memory that baking may use.
const MOST_CELLS: Real = 8e6;
/// By how much cells grow where they take too much memory.
const COARSER: Real = 1.25;
/// How far beyond the garment's box the field is baked, in metres: no vertex is pushed further.
const AROUND: Real = 0.03;

/// The positions of `garment` settled on the layers `below`, the body first, at least the
/// clearance from them where the mask binds. `fields` has those of garments, inner to outer, if they
/// come with any.
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
    fields: &[FieldOfGarment<'_>],
    params: &ResolveParams,
    progress: &mut GarmentProgress<'_>,
) -> Result<(Vec<Point>, Algorithm1Report), SettleError> {
    let _phase = tracing::trace_span!("algorithm 1").entered();
    progress.report(ALGORITHM_1, 0, None)?;
    let mesh = &garment.mesh;
    let field_of = |k: usize| k.checked_sub(1).and_then(|k| fields.get(k).copied().flatten());
    let (mut of_mesh, mut of_fields, mut read) = (Vec::new(), Vec::new(), Vec::new());
    for (k, layer) in below.iter().enumerate() {
        read.push(if field_of(k).is_some() { LayerField::Given } else { LayerField::Mesh });
        match field_of(k) {
            None => of_mesh.push(*layer),
            Some(field) => {
                let mask = BoxMask::new(layer.bvh().aabb()).expect("positions are finite");
                of_fields.push(Masked { field, mask });
            }
        }
    }
    let field = baked(mesh, &of_mesh, progress.monitor)?;
    let Some((next, _)) = below[1..].split_last() else {
        let mask = vec![1.0; mesh.vertices().len()];
        let below = Below { field: &field, mask: &mask, air: None };
        return run(mesh, &below, read, params, progress);
    };
    let field = Nearest { meshes: field, fields: of_fields };
    let boxes = BoxesMask::new(below[1..].iter().map(|layer| layer.bvh().aabb()));
    let boxes = boxes.expect("positions are finite");
    let weights: Vec<Real> = mesh.vertices().iter().map(|p| Real::from(boxes.binds(p))).collect();
    let surface = next.to_mesh();
    let inner = InnerSurface::new(&surface, next.bvh());
    let air = params.paper.air(params.goal.clearance).map(|air| (&inner, air));
    let masked = Masked { field, mask: boxes };
    let below = Below { field: &masked, mask: &weights, air };
    run(mesh, &below, read, params, progress)
}

/// The union of `below` round the garment.
fn baked(
    garment: &TriMesh,
    below: &[&ClosedLayer],
    monitor: &mut dyn Monitor,
) -> Result<Baked, SettleError> {
    let region = garment.surface_aabb().inflated(AROUND);
    let mut cell = CELL.max((region.size().product() / MOST_CELLS).cbrt());
    let field = ClothedField::new(below.to_vec());
    loop {
        match field.baked(&region, cell, monitor) {
            Ok(field) => return Ok(field),
            // Of a wide flat cloth most cells lie beside its box.
            Err(BakeError::TooLarge { .. }) => cell *= COARSER,
            Err(BakeError::Cancelled(cancelled)) => return Err(SettleError::Cancelled(cancelled)),
            Err(error) => unreachable!("a finite field in a bounded region: {error}"),
        }
    }
}

fn run(
    garment: &TriMesh,
    below: &Below<'_>,
    read: Vec<LayerField>,
    params: &ResolveParams,
    progress: &mut GarmentProgress<'_>,
) -> Result<(Vec<Point>, Algorithm1Report), SettleError> {
    let params = params.paper.solver(params.goal.clearance);
    match run_algorithm1(garment, below, &params, progress.monitor) {
        Ok((positions, report)) => {
            let Counters { queries, skipped_by_bound, skipped_by_mask, .. } = report.counters;
            let steps = report.steps;
            let below = read;
            let report =
                Algorithm1Report { below, steps, queries, skipped_by_bound, skipped_by_mask };
            Ok((positions, report))
        }
        Err(Algorithm1Error::Run(RunError::Cancelled(cancelled))) => {
            Err(SettleError::Cancelled(cancelled))
        }
        Err(Algorithm1Error::Run(RunError::Step(error))) => Err(SettleError::Step(error)),
        Err(error) => unreachable!("checked parameters and positions: {error}"),
    }
}
