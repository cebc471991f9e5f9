//! The visual hull in canonical space: the simplest thing that masks and poses give. A baseline.

use super::distance_image::DistanceImage;
use crate::capture::{Capture, CaptureError};
use if_body::skinning::{Affine, WeightGrid};
use if_body::{PoseError, Skeleton};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_mesh::camera::Camera;
use nalgebra::Isometry3;

/// A bound on the slope of the hull's field: distances in pictures have slope 1, and posing
/// stretches space, most where weights change fast. Of 20,000 differences over 8 mm in each of the
/// two sample captures the steepest is 2.2, 99.9 % are below 1.6.
const SLOPE: Real = 3.0;
/// Step of the differences that give its gradient, in metres: a seventh of a pixel of the sample
/// captures, so that a difference stays within one patch of the distance image's interpolation, and
/// far above the rounding of its single precision.
const STEP: Real = 1e-3;

/// Why there is no hull.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HullError {
    /// The capture is at fault.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the skeleton.
    #[error("frame {frame}: {source}")]
    Pose {
        /// Its place in the capture.
        frame: usize,
        /// What is wrong with it.
        source: PoseError,
    },
    /// Poses of other joints than the grid's.
    #[error("the skeleton has {skeleton} joints, the grid of weights {grid}")]
    Joints {
        /// Joints of the skeleton.
        skeleton: usize,
        /// Joints of the grid.
        grid: usize,
    },
}

/// Canonical space carved by the masks: a point is inside where the pose of (nearly) every frame
/// takes it into the mask.
///
/// ```text
/// h(x) = the (allowed + 1)-th largest, over the frames i, of  z/f · D_i(project(pose_i(x)))
/// ```
///
/// with D the distance from the mask's border in pixels, positive outside. Clothes that hang, as
/// skirts, follow the nearest part of the body.
pub struct VisualHull<'a> {
    grid: &'a WeightGrid,
    camera: Camera,
    pixels_per_metre: Real,
    views: Vec<(Vec<Affine>, DistanceImage)>,
    allowed: usize,
}

impl std::fmt::Debug for VisualHull<'_> {
    /// Numbers only: the pictures are megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("VisualHull");
        out.field("views", &self.views.len())
            .field("allowed", &self.allowed)
            .finish_non_exhaustive()
    }
}

impl<'a> VisualHull<'a> {
    /// Reads all masks of a capture. A point may lie outside of `allowed` masks: noise.
    ///
    /// # Errors
    ///
    /// [`HullError`].
    pub fn new(
        capture: &Capture,
        skeleton: &Skeleton,
        grid: &'a WeightGrid,
        allowed: usize,
    ) -> Result<Self, HullError> {
        capture.check_skeleton(skeleton)?;
        if skeleton.len() != grid.joints() {
            return Err(HullError::Joints { skeleton: skeleton.len(), grid: grid.joints() });
        }
        let camera = capture.camera().clone();
        let k = camera.intrinsics();
        let pixels_per_metre = 0.5 * (k[(0, 0)] + k[(1, 1)]);
        let mut views = Vec::with_capacity(capture.len());
        for frame in 0..capture.len() {
            let mask = capture.mask(frame)?;
            let image = DistanceImage::new(&mask, camera.width(), camera.height(), 0.0);
            let transforms = skeleton
                .transforms(capture.pose(frame))
                .map_err(|source| HullError::Pose { frame, source })?;
            views.push((transforms.iter().map(in_camera(&camera)).collect(), image));
        }
        Ok(Self {
            grid,
            camera,
            pixels_per_metre,
            allowed: allowed.min(views.len().saturating_sub(1)),
            views,
        })
    }
}

/// A joint's transform, straight into the camera's frame.
pub(super) fn in_camera(camera: &Camera) -> impl Fn(&Isometry3<Real>) -> Affine + '_ {
    |t| Affine {
        linear: camera.rotation() * t.rotation.to_rotation_matrix().into_inner(),
        offset: camera.rotation() * t.translation.vector + camera.translation(),
    }
}

impl SignedDistance for VisualHull<'_> {
    fn distance(&self, p: &Point) -> Real {
        let mut weights = vec![0.0; self.grid.joints()];
        self.grid.weights_at(p, &mut weights);
        let carried: Vec<(usize, Real)> =
            weights.iter().copied().enumerate().filter(|(_, w)| *w > 0.0).collect();
        // The largest, in descending order.
        let mut most = vec![Real::NEG_INFINITY; self.allowed + 1];
        for (maps, image) in &self.views {
            let mut q = Vector::zeros();
            for (j, w) in &carried {
                q += (maps[*j].linear * p.coords + maps[*j].offset) * *w;
            }
            if q.z <= 0.0 {
                continue; // not before the camera: this frame says nothing
            }
            let pixel = self.camera.to_pixel(&Point::from(q));
            let mut d = image.at(pixel.x, pixel.y) * q.z / self.pixels_per_metre;
            for m in &mut most {
                if d > *m {
                    std::mem::swap(m, &mut d);
                }
            }
        }
        let d = most[self.allowed];
        // Seen in too few frames: outside, as far away as anything.
        if d == Real::NEG_INFINITY { self.grid.bounds().diagonal() } else { d }
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let slope = |k: usize| {
            let mut step = Vector::zeros();
            step[k] = STEP;
            (self.distance(&(p + step)) - self.distance(&(p - step))) / (2.0 * STEP)
        };
        FieldSample {
            distance: self.distance(p),
            gradient: Vector::new(slope(0), slope(1), slope(2)),
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(self.grid.bounds())
    }

    fn lipschitz(&self) -> Real {
        SLOPE
    }
}
