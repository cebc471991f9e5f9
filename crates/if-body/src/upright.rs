//! Orientation: y points up in all bodies of this project.

use crate::skeleton::Skeleton;
use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;

/// Smallest height of a body along y, as a share of its largest extent. Rest poses with arms spread
/// are at most as wide as 1.1 times their height; a body that lies down is at most 0.3 high.
const LEAST_HEIGHT: Real = 0.75;
/// Smallest cosine between +y and the direction from the root joint to the head. 45° allow people
/// who lean or sit.
const LEAST_COSINE: Real = std::f64::consts::FRAC_1_SQRT_2;

/// A body does not stand upright along y.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[error(
    "the body stands along {up}, not along +y ({reason}); rotate it so that y points up and the person faces +z"
)]
pub struct NotUpright {
    /// The axis along which it stands, such as `+z`.
    pub up: &'static str,
    /// What shows that.
    pub reason: String,
}

/// Checks that a body in its rest pose stands along +y: by the direction from its root joint to its
/// head, if the skeleton has a joint with `head` in its name, else by the extents of its mesh.
///
/// # Errors
///
/// [`NotUpright`], with the axis along which the body stands. A mesh alone does not distinguish
/// both ends of an axis, nor spread arms from height: such bodies pass.
pub fn check_upright(mesh: &TriMesh, skeleton: Option<&Skeleton>) -> Result<(), NotUpright> {
    if let Some(up) = skeleton.and_then(to_head) {
        if up.y >= LEAST_COSINE * up.norm() {
            return Ok(());
        }
        let reason = format!(
            "from the root joint to the head it is {:.2}, {:.2}, {:.2} m along x, y, z",
            up.x, up.y, up.z
        );
        return Err(NotUpright { up: signed_axis(&up), reason });
    }
    let aabb = mesh.surface_aabb();
    if aabb.is_empty() || aabb.size().y >= LEAST_HEIGHT * aabb.size().max() {
        return Ok(());
    }
    let size = aabb.size();
    let reason = format!("it extends {:.2}, {:.2}, {:.2} m along x, y, z", size.x, size.y, size.z);
    Err(NotUpright { up: ["x", "y", "z"][size.imax()], reason })
}

/// The direction from the first root to the head; `None` if no joint is named as a head, or they
/// coincide.
fn to_head(skeleton: &Skeleton) -> Option<Vector> {
    let is_head = |name: &str| name.to_ascii_lowercase().contains("head");
    let head = skeleton.joints().iter().find(|j| is_head(&j.name))?;
    let root = skeleton.joints().first()?;
    Some(head.head - root.head).filter(|up| up.norm() > 0.0)
}

fn signed_axis(v: &Vector) -> &'static str {
    let axis = v.iamax();
    if v[axis] < 0.0 { ["-x", "-y", "-z"][axis] } else { ["+x", "+y", "+z"][axis] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mannequin::{MannequinParams, body, rig};
    use crate::skeleton::Joint;
    use if_core::math::Point;

    const COARSE: MannequinParams = MannequinParams { resolution: 0.7, overlap: 0.0 };

    fn turned(to: impl Fn(&Point) -> Point) -> (TriMesh, Skeleton) {
        let mesh = body(&COARSE);
        let mesh = mesh.with_vertices(mesh.vertices().iter().map(&to).collect()).unwrap();
        let joint = |j: &Joint| Joint { head: to(&j.head), tail: to(&j.tail), ..j.clone() };
        (mesh, Skeleton::new(rig::skeleton().joints().iter().map(joint).collect()).unwrap())
    }

    #[test]
    fn bodies_that_do_not_stand_along_y_are_errors_that_name_the_axis() {
        let (mesh, skeleton) = turned(|p| *p);
        assert_eq!(check_upright(&mesh, Some(&skeleton)), Ok(()));
        assert_eq!(check_upright(&mesh, None), Ok(()));
        let (mesh, skeleton) = turned(|p| Point::new(p.x, -p.z, p.y));
        assert_eq!(check_upright(&mesh, Some(&skeleton)).unwrap_err().up, "+z");
        let error = check_upright(&mesh, None).unwrap_err();
        assert!(error.up == "z" && error.to_string().contains("y points up"), "{error}");
        let (mesh, skeleton) = turned(|p| Point::new(p.x, -p.y, -p.z));
        assert_eq!(check_upright(&mesh, Some(&skeleton)).unwrap_err().up, "-y");
        assert_eq!(check_upright(&mesh, None), Ok(()), "its extents are the same");
        assert_eq!(check_upright(&TriMesh::default(), None), Ok(()));
    }

    #[test]
    fn a_body_with_arms_spread_wider_than_it_is_high_is_upright() {
        let (mesh, _) = turned(|p| Point::new(1.6 * p.x, p.y, p.z));
        assert!(mesh.aabb().size().x > mesh.aabb().size().y);
        assert_eq!(check_upright(&mesh, None), Ok(()));
    }
}
