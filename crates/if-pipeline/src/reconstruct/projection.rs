//! From canonical space into the camera.

use if_body::skinning::Affine;
use if_core::math::Real;
use if_mesh::camera::Camera;
use nalgebra::Isometry3;

/// Maps the transform of a joint to one into the camera's frame.
pub(super) fn in_camera(camera: &Camera) -> impl Fn(&Isometry3<Real>) -> Affine + '_ {
    |t| Affine {
        linear: camera.rotation() * t.rotation.to_rotation_matrix().into_inner(),
        offset: camera.rotation() * t.translation.vector + camera.translation(),
    }
}

/// Pixels per metre at a depth of one metre.
pub(super) fn pixels_per_metre(camera: &Camera) -> Real {
    let k = camera.intrinsics();
    0.5 * (k[(0, 0)] + k[(1, 1)])
}
