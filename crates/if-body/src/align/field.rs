//! φ of a body in an aligned garment.

use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_mesh::baked::{BakeError, BakeParams, Baked, Redistance};
use if_mesh::solid::{ClosedLayer, ClothedField};

/// The signed distance of `body` in `garment`, baked and re-distanced.
///
/// Warping the field of the source body would give gradients J⁻ᵀ∇φ, which are not of unit length,
/// and the shape of the old body. Instead the field is computed from the aligned mesh and the
/// target body, both closed ([`ClosedLayer`]), and its values are replaced by distances to its zero
/// set.
///
/// # Errors
///
/// [`BakeError`]: parameters are out of range, the grid needs more memory than allowed,
/// or the monitor cancelled.
pub fn carried_field(
    body: &TriMesh,
    garment: &TriMesh,
    params: &BakeParams,
    monitor: &mut dyn Monitor,
) -> Result<Baked, BakeError> {
    let solid = ClosedLayer::body(body);
    let layer = ClosedLayer::garment(garment, &solid, body);
    let field = ClothedField::new(vec![&solid, &layer]);
    // Inside, the field is the larger depth of the two layers, which is not a distance.
    Baked::new(&field, &BakeParams { redistance: Redistance::Always, ..*params }, monitor)
}
