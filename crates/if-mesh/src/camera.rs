//! A pinhole camera.

use if_core::math::{Point, Real, Vector};
use nalgebra::{Matrix3, Point2, UnitQuaternion};

/// A pinhole camera in the convention of OpenCV: in its own frame x points right, y down and z into
/// the scene.
///
/// ```text
/// x_cam = R x_world + t        u = fx x/z + s y/z + cx,   v = fy y/z + cy
/// ```
///
/// `u` and `v` are in pixels; the centre of the pixel in column i and row j is (i + ½, j + ½).
///
/// # Examples
///
/// ```
/// use if_core::math::{Point, Vector};
/// use if_mesh::camera::Camera;
/// use nalgebra::Matrix3;
/// let k = Matrix3::new(100.0, 0.0, 32.0, 0.0, 100.0, 24.0, 0.0, 0.0, 1.0);
/// let camera = Camera::new(64, 48, k, Matrix3::identity(), Vector::zeros())?;
/// let pixel = camera.project(&Point::new(0.1, 0.0, 2.0)).expect("in front of the camera");
/// assert_eq!((pixel.x, pixel.y), (37.0, 24.0));
/// # Ok::<(), if_mesh::camera::CameraError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    width: usize,
    height: usize,
    intrinsics: Matrix3<Real>,
    rotation: Matrix3<Real>,
    translation: Vector,
}

/// Why a camera is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The size of the picture is out of range.
    #[error("the picture is {width} × {height} pixels; each side must be from 1 to {MAX_SIDE}")]
    Size {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// An entry is NaN or infinite.
    #[error("entry {row}, {column} of {matrix} is {value}; all entries must be finite")]
    NonFinite {
        /// `K`, `R` or `t`.
        matrix: &'static str,
        /// Its row, from 0.
        row: usize,
        /// Its column, from 0.
        column: usize,
        /// The entry.
        value: Real,
    },
    /// K does not have the form of an intrinsic matrix.
    #[error(
        "K must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with positive fx and fy; entry {row}, {column} is {value}; \
         divide K by its last entry, and mirror the pictures where a focal length is negative"
    )]
    Intrinsics {
        /// Row of the first invalid entry, from 0.
        row: usize,
        /// Its column.
        column: usize,
        /// The entry.
        value: Real,
    },
    /// The angle of view is out of range.
    #[error(
        "the angle between the upper and the lower edge is {angle} rad; it must lie between 0 and π (a person's whole height: 0.5)"
    )]
    Angle {
        /// The angle, in radians.
        angle: Real,
    },
    /// The view has no direction, or no upper edge.
    #[error(
        "a view from {eye:?} to {target:?} with {up:?} up spans no frame; choose an up direction across the view, and a target away from the eye"
    )]
    View {
        /// Position of the camera.
        eye: Point,
        /// Where it looks.
        target: Point,
        /// The direction up.
        up: Vector,
    },
    /// R is not a rotation.
    #[error(
        "R is no rotation: R Rᵀ differs from the identity by {error:.2e} (at most {ORTHOGONAL:e}) and its determinant is {determinant:.6}"
    )]
    Rotation {
        /// Largest entry of R Rᵀ − 1.
        error: Real,
        /// 1 for a rotation, −1 for a mirror.
        determinant: Real,
    },
}

/// Maximum difference of R Rᵀ from the identity. Files have four to six decimals: ten times less
/// rejects them, ten times more accepts a scale of 0.5 %, which is 1 cm on a person.
const ORTHOGONAL: Real = 1e-3;
/// Longest side of a picture in pixels: sums of pixels fit 32 bits.
const MAX_SIDE: usize = 1 << 15;

impl Camera {
    /// A camera of `width` × `height` pixels with intrinsics K (pixels), rotation R and translation
    /// t (metres).
    ///
    /// # Errors
    ///
    /// The first of size, K, R and t that is invalid.
    pub fn new(
        width: usize,
        height: usize,
        intrinsics: Matrix3<Real>,
        rotation: Matrix3<Real>,
        translation: Vector,
    ) -> Result<Self, CameraError> {
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
            return Err(CameraError::Size { width, height });
        }
        let rows = |m: &Matrix3<Real>, matrix, columns| {
            let all = (0..3).flat_map(|row| (0..columns).map(move |column| (row, column)));
            let mut bad = all.filter(|&(row, column)| !m[(row, column)].is_finite());
            bad.next().map(|(row, column)| CameraError::NonFinite {
                matrix,
                row,
                column,
                value: m[(row, column)],
            })
        };
        let t = Matrix3::from_columns(&[translation, translation, translation]);
        if let Some(error) =
            rows(&intrinsics, "K", 3).or(rows(&rotation, "R", 3)).or(rows(&t, "t", 1))
        {
            return Err(error);
        }
        let k = &intrinsics;
        let fits = [
            ((0, 0), k[(0, 0)] > 0.0),
            ((1, 1), k[(1, 1)] > 0.0),
            ((1, 0), k[(1, 0)] == 0.0),
            ((2, 0), k[(2, 0)] == 0.0),
            ((2, 1), k[(2, 1)] == 0.0),
            ((2, 2), k[(2, 2)] == 1.0),
        ];
        if let Some(&((row, column), _)) = fits.iter().find(|(_, fits)| !fits) {
            return Err(CameraError::Intrinsics { row, column, value: k[(row, column)] });
        }
        let error = (rotation * rotation.transpose() - Matrix3::identity()).amax();
        let determinant = rotation.determinant();
        if error > ORTHOGONAL || determinant < 0.0 {
            return Err(CameraError::Rotation { error, determinant });
        }
        Ok(Self { width, height, intrinsics, rotation, translation })
    }

    /// A camera at `eye` that looks at `target`, the top of the picture towards `up`, with square
    /// pixels and the principal point in the middle. `vertical_angle` is that between the upper and
    /// the lower edge, in radians: above 0 and below π.
    ///
    /// # Errors
    ///
    /// A size or an angle out of range, or directions that span no frame.
    pub fn looking_at(
        (width, height): (usize, usize),
        eye: &Point,
        target: &Point,
        up: &Vector,
        vertical_angle: Real,
    ) -> Result<Self, CameraError> {
        if !(vertical_angle > 0.0 && vertical_angle < std::f64::consts::PI) {
            return Err(CameraError::Angle { angle: vertical_angle });
        }
        let forward = if_core::math::unit_or_zero(&(target - eye));
        let right = if_core::math::unit_or_zero(&forward.cross(up));
        if right == Vector::zeros() {
            return Err(CameraError::View { eye: *eye, target: *target, up: *up });
        }
        let rotation = Matrix3::from_rows(&[
            right.transpose(),
            forward.cross(&right).transpose(),
            forward.transpose(),
        ]);
        let focal = 0.5 * height as Real / (0.5 * vertical_angle).tan();
        let k = Matrix3::new(
            focal,
            0.0,
            0.5 * width as Real,
            0.0,
            focal,
            0.5 * height as Real,
            0.0,
            0.0,
            1.0,
        );
        Self::new(width, height, k, rotation, -(rotation * eye.coords))
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// K, in pixels.
    pub fn intrinsics(&self) -> &Matrix3<Real> {
        &self.intrinsics
    }

    /// R: the axes of the camera, in the world, are its rows.
    pub fn rotation(&self) -> &Matrix3<Real> {
        &self.rotation
    }

    /// t, in metres.
    pub fn translation(&self) -> &Vector {
        &self.translation
    }

    /// Position of the camera in the world: −Rᵀ t.
    pub fn center(&self) -> Point {
        Point::from(-(self.rotation.transpose() * self.translation))
    }

    /// The camera turned about its centre, by a rotation in its own frame.
    pub fn turned(&self, turn: &UnitQuaternion<Real>) -> Self {
        let turn = turn.to_rotation_matrix();
        let (rotation, translation) = (turn * self.rotation, turn * self.translation);
        Self { rotation, translation, ..self.clone() }
    }

    /// The camera with focal lengths `by` times as long.
    ///
    /// # Errors
    ///
    /// They are then not positive and finite.
    pub fn zoomed(&self, by: Real) -> Result<Self, CameraError> {
        let mut intrinsics = self.intrinsics;
        for k in 0..2 {
            intrinsics[(k, k)] *= by;
        }
        Self::new(self.width, self.height, intrinsics, self.rotation, self.translation)
    }

    /// A point of the world in the camera's frame.
    #[inline]
    pub fn to_camera(&self, p: &Point) -> Point {
        Point::from(self.rotation * p.coords + self.translation)
    }

    /// The pixel position of a point in the camera's frame with positive z; infinite or NaN where z
    /// is zero.
    #[inline]
    pub fn to_pixel(&self, p: &Point) -> Point2<Real> {
        let k = &self.intrinsics;
        let (x, y) = (p.x / p.z, p.y / p.z);
        Point2::new(k[(0, 0)] * x + k[(0, 1)] * y + k[(0, 2)], k[(1, 1)] * y + k[(1, 2)])
    }

    /// The pixel position of a point of the world; `None` if it is not in front of the camera.
    #[inline]
    pub fn project(&self, p: &Point) -> Option<Point2<Real>> {
        let q = self.to_camera(p);
        (q.z > 0.0).then(|| self.to_pixel(&q))
    }

    /// The direction, in the camera's frame and with z = 1, of a pixel position: times a depth it is
    /// the point at that depth.
    #[inline]
    pub fn pixel_direction(&self, pixel: &Point2<Real>) -> Vector {
        let k = &self.intrinsics;
        let y = (pixel.y - k[(1, 2)]) / k[(1, 1)];
        Vector::new((pixel.x - k[(0, 2)] - k[(0, 1)] * y) / k[(0, 0)], y, 1.0)
    }

    /// The ray from the camera through a pixel position, in the world: its start, and the direction
    /// along which the depth grows by one metre for each unit. Not of unit length.
    #[inline]
    pub fn ray(&self, pixel: &Point2<Real>) -> (Point, Vector) {
        (self.center(), self.rotation.transpose() * self.pixel_direction(pixel))
    }

    /// The same view with `factor` times the pixels along each side, for coarse copies of pictures.
    /// Sides are rounded up.
    ///
    /// # Errors
    ///
    /// A factor that is not positive and finite, or sides out of range.
    pub fn scaled(&self, factor: Real) -> Result<Self, CameraError> {
        let side = |n: usize| (n as Real * factor).ceil() as usize;
        let mut k = self.intrinsics * factor;
        k[(2, 2)] = 1.0;
        Self::new(side(self.width), side(self.height), k, self.rotation, self.translation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn k() -> Matrix3<Real> {
        Matrix3::new(400.0, 1.5, 130.0, 0.0, 410.0, 120.0, 0.0, 0.0, 1.0)
    }

    #[test]
    fn a_ray_through_a_projection_meets_the_point_again() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.8, 2.9).into_inner();
        let camera = Camera::new(256, 240, k(), turn, Vector::new(0.1, -0.7, 3.0)).unwrap();
        for p in [Point::origin(), Point::new(0.4, 1.1, -0.2), Point::new(-0.3, 0.2, 0.5)] {
            let pixel = camera.project(&p).unwrap();
            let (from, direction) = camera.ray(&pixel);
            let z = camera.to_camera(&p).z;
            approx::assert_relative_eq!(from + direction * z, p, epsilon = 1e-13);
        }
        assert!(
            camera.project(&(camera.center() - camera.rotation().row(2).transpose())).is_none()
        );
    }

    #[test]
    fn a_camera_before_the_front_sees_the_left_hand_on_its_right_side() {
        let camera = Camera::looking_at(
            (200, 100),
            &Point::new(0.0, 1.0, 3.0),
            &Point::new(0.0, 1.0, 0.0),
            &Vector::y(),
            0.5,
        );
        let camera = camera.unwrap();
        let hand = camera.project(&Point::new(0.3, 1.2, 0.0)).unwrap();
        assert!(hand.x > 100.0 && hand.y < 50.0, "{hand}");
        approx::assert_relative_eq!(camera.center(), Point::new(0.0, 1.0, 3.0), epsilon = 1e-14);
        // The upper edge lies at half the angle.
        let edge = camera.project(&Point::new(0.0, 1.0 + 3.0 * (0.25f64).tan(), 0.0)).unwrap();
        assert!(edge.y.abs() < 1e-10, "{edge}");
    }

    #[test]
    fn a_scaled_camera_sees_the_same_at_scaled_pixels() {
        let camera =
            Camera::new(255, 240, k(), Matrix3::identity(), Vector::new(0.0, 0.0, 2.0)).unwrap();
        let half = camera.scaled(0.5).unwrap();
        assert_eq!((half.width(), half.height()), (128, 120));
        let p = Point::new(0.2, -0.1, 0.3);
        let (a, b) = (camera.project(&p).unwrap(), half.project(&p).unwrap());
        approx::assert_relative_eq!(a.coords * 0.5, b.coords, epsilon = 1e-12);
        for factor in [0.0, -1.0, Real::NAN, Real::INFINITY] {
            assert!(camera.scaled(factor).is_err(), "{factor}");
            assert!(camera.zoomed(factor).is_err(), "{factor}");
        }
        assert_eq!(camera.zoomed(1.0), Ok(camera.clone()));
        assert_eq!(camera.zoomed(2.0).unwrap().intrinsics()[(1, 1)], 820.0);
    }

    #[test]
    fn numbers_that_make_no_camera_are_named() {
        let make = |w, k, r, t: Vector| Camera::new(w, 10, k, r, t);
        let (id, zero) = (Matrix3::identity(), Vector::zeros());
        assert_eq!(make(0, k(), id, zero), Err(CameraError::Size { width: 0, height: 10 }));
        let mut bad = k();
        bad[(1, 1)] = -3.0;
        assert_eq!(
            make(9, bad, id, zero),
            Err(CameraError::Intrinsics { row: 1, column: 1, value: -3.0 })
        );
        let nan = Vector::new(0.0, Real::NAN, 0.0);
        assert!(matches!(
            make(9, k(), id, nan),
            Err(CameraError::NonFinite { matrix: "t", row: 1, column: 0, .. })
        ));
        let mirror = Matrix3::from_diagonal(&Vector::new(1.0, 1.0, -1.0));
        assert!(matches!(make(9, k(), mirror, zero), Err(CameraError::Rotation { .. })));
        assert!(matches!(make(9, k(), id * 1.01, zero), Err(CameraError::Rotation { .. })));
        let up = Vector::z();
        let flat =
            Camera::looking_at((8, 8), &Point::origin(), &Point::new(0.0, 0.0, 1.0), &up, 0.5);
        assert!(matches!(flat, Err(CameraError::View { .. })), "{flat:?}");
        let at_eye =
            Camera::looking_at((8, 8), &Point::origin(), &Point::origin(), &Vector::y(), 0.5);
        assert!(matches!(at_eye, Err(CameraError::View { .. })), "{at_eye:?}");
        let seen = |angle| {
            Camera::looking_at(
                (8, 8),
                &Point::origin(),
                &Point::new(0.0, 0.0, 1.0),
                &Vector::y(),
                angle,
            )
        };
        for angle in [0.0, -0.5, std::f64::consts::PI, 3.5, 6.5, 40.0, Real::NAN, Real::INFINITY] {
            assert!(matches!(seen(angle), Err(CameraError::Angle { .. })), "{angle}");
        }
        assert!(seen(1e-3).is_ok() && seen(3.1).is_ok());
    }
}
