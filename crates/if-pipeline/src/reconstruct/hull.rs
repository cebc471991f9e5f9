//! The visual hull in canonical space: a baseline from masks and poses alone.

use super::distance_image::DistanceImage;
use super::error::ReconstructError;
use super::projection::{in_camera, pixels_per_metre};
use crate::capture::Capture;
use if_body::Skeleton;
use if_body::skinning::{Affine, WeightGrid};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_mesh::camera::Camera;

/// A bound on the slope of the hull's field: distances in images have slope 1, and posing stretches
/// space, most where weights change fast. Of 20,000 differences over 8 mm in each of the two sample
/// captures the largest slope is 2.2, and 99.9 % are below 1.6.
const SLOPE: Real = 3.0;
/// Step of the finite differences of its gradient, in metres: a seventh of a pixel of the sample
/// captures, so that a difference stays within one cell of the distance image's interpolation, and
/// far above its rounding to single precision.
const STEP: Real = 1e-3;

/// Canonical space carved by the masks: a point is inside if the pose of (nearly) every frame maps
/// it into the mask.
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
    /// Counts only: the images are megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("VisualHull");
        out.field("views", &self.views.len())
            .field("allowed", &self.allowed)
            .finish_non_exhaustive()
    }
}

impl<'a> VisualHull<'a> {
    /// Reads all masks of a capture. A point may lie outside `allowed` masks, because of noise.
    ///
    /// # Errors
    ///
    /// [`ReconstructError`].
    pub fn new(
        capture: &Capture,
        skeleton: &Skeleton,
        grid: &'a WeightGrid,
        allowed: usize,
    ) -> Result<Self, ReconstructError> {
        capture.check_skeleton(skeleton)?;
        if skeleton.len() != grid.joints() {
            return Err(ReconstructError::Joints { skeleton: skeleton.len(), grid: grid.joints() });
        }
        let camera = capture.camera().clone();
        let pixels_per_metre = pixels_per_metre(&camera);
        let mut views = Vec::with_capacity(capture.len());
        for frame in 0..capture.len() {
            let mask = capture.mask(frame)?;
            let image = DistanceImage::new(&mask, camera.width(), camera.height(), 0.0);
            let transforms = skeleton
                .transforms(capture.pose(frame))
                .map_err(|source| ReconstructError::Pose { frame, source })?;
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
                continue; // behind the camera
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
        // Visible in too few frames: outside, at the largest distance.
        if d == Real::NEG_INFINITY { self.grid.bounds().diagonal() } else { d }
    }

    /// Central differences.
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
