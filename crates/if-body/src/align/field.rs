//! φ of the clothed body in the space that the garments share.

use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::baked::{BakeError, BakeParams, Baked, Redistance};
use if_mesh::solid::{ClosedLayer, ClothedField};

/// The field of `body` in `garment`, baked and re-distanced.
///
/// A field that is carried to another body by a warp has gradients J⁻ᵀ∇φ, which are no longer of
/// unit length, and it is the field of the old body in the garment, not of the new one. So the
/// field is made anew, of the aligned mesh and the target's body, both closed ([`ClosedLayer`]),
/// and its values are replaced by distances to its zero set.
///
/// # Errors
///
/// [`BakeError`]: parameters out of range, or more memory than allowed.
pub fn carried_field(
    body: &TriMesh,
    garment: &TriMesh,
    params: &BakeParams,
) -> Result<Baked, BakeError> {
    let solid = ClosedLayer::body(body);
    let layer = ClosedLayer::garment(garment, &solid, body);
    let field = ClothedField::new(vec![&solid, &layer]);
    // Its inside is the larger depth in one layer, which is no distance.
    Baked::new(&field, &BakeParams { redistance: Redistance::Always, ..*params }, &mut Silent)
}
