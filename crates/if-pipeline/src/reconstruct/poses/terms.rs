//! What the images of a frame say about its pose.

use super::normal_image::NormalImage;
use super::params::PoseParams;
use super::twists::{Row, Twists, cross};
use crate::reconstruct::distance_image::DistanceImage;
use crate::reconstruct::figure::{Figure, RimPoint};
use crate::reconstruct::projection::pixels_per_metre;
use if_body::SkinWeights;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_mesh::camera::Camera;
use if_mesh::raster::NOTHING;
use nalgebra::{Isometry3, Matrix3, Point2, RowVector3, SMatrix, Vector1};

/// Largest depth behind the visible surface at which a vertex counts as visible, in metres: half the
/// thickness of a finger.
const BEHIND: Real = 0.005;
/// Least cosine between a vertex's normal and the line of sight. Closer to the silhouette a pixel
/// sees several places.
const FACING: Real = 0.2;
/// Residual of a normal at which its weight falls to a quarter: 30°.
const NORMAL_OUTLIER: Real = 0.5;
/// Residual of a silhouette, in metres, at which its weight falls to 0.7.
const SILHOUETTE_OUTLIER: Real = 0.02;

/// The images of a frame, for its pose.
pub(super) struct View<'a> {
    pub(super) outside: &'a DistanceImage,
    pub(super) normals: &'a NormalImage,
}

/// A surface to be posed.
pub(super) struct Subject<'a> {
    pub(super) skin: &'a SkinWeights,
    /// Vertices in canonical space.
    pub(super) points: &'a [Point],
}

/// Residuals of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Residuals {
    /// Weighted sum of squared silhouette distances, in square metres, and of weights.
    pub(super) silhouettes: (Real, Real),
    /// Weighted sum of squared differences of normals, and of weights.
    pub(super) normals: (Real, Real),
}

impl Residuals {
    pub(super) fn add(&mut self, other: &Self) {
        for (sum, one) in
            [(&mut self.silhouettes, other.silhouettes), (&mut self.normals, other.normals)]
        {
            *sum = (sum.0 + one.0, sum.1 + one.1);
        }
    }

    /// Root mean square distance of silhouettes, in metres; 0 without any.
    pub(super) fn silhouette(&self) -> Real {
        mean(self.silhouettes).sqrt()
    }

    /// Root mean square difference of normals; 0 without any.
    pub(super) fn normal(&self) -> Real {
        mean(self.normals).sqrt()
    }
}

fn mean((sum, weight): (Real, Real)) -> Real {
    if weight > 0.0 { sum / weight } else { 0.0 }
}

/// Adds the terms of silhouettes within `reach` metres, and of normals:
///
/// ```text
/// ½ w_rim ρ(r) / σ²   r = z/f · distance of π(p) from the mask's border
/// ½ cos θ ρ(r) / σ²   r = N(π(p)) − n(p)
/// ```
///
/// with ρ the weights of outliers, held fixed in a step.
pub(super) fn add_terms(
    twists: &mut Twists,
    figure: &Figure,
    view: &View,
    subject: &Subject,
    transforms: &[Isometry3<Real>],
    reach: Real,
    params: &PoseParams,
) -> Residuals {
    let mut residuals = Residuals::default();
    let scale = pixels_per_metre(figure.camera);
    for point in figure.rim(view.outside, reach) {
        let v = point.vertex;
        let outlier = 1.0 / (1.0 + (point.metres / SILHOUETTE_OUTLIER).powi(2)).sqrt();
        let weight = point.weight * outlier / params.silhouette_sigma.powi(2);
        let along = silhouette_slope(figure.camera, view.outside, &point, &figure.points[v], scale);
        let rows = silhouette_rows(subject, v, transforms, &along);
        twists.add(&rows, &Vector1::new(point.metres), weight);
        let sum = &mut residuals.silhouettes;
        *sum = (sum.0 + point.weight * point.metres.powi(2), sum.1 + point.weight);
    }
    for v in 0..subject.points.len() {
        let Some((pixel, normal, facing)) = visible(figure, v) else { continue };
        let Some((observed, slope)) = view.normals.at(pixel.x, pixel.y) else { continue };
        let residual = observed - normal;
        let outlier = (1.0 + residual.norm_squared() / NORMAL_OUTLIER.powi(2)).powi(-2);
        let weight = facing * outlier / params.normal_sigma.powi(2);
        let by_point = slope * pixel_slope(figure.camera, &figure.points[v]);
        let rows = normal_rows(subject, v, transforms, &by_point, &normal);
        twists.add(&rows, &residual, weight);
        let sum = &mut residuals.normals;
        *sum = (sum.0 + facing * outlier * residual.norm_squared(), sum.1 + facing * outlier);
    }
    residuals
}

/// Pixel position, posed normal and cosine to the line of sight of a visible vertex.
fn visible(figure: &Figure, v: usize) -> Option<(Point2<Real>, Vector, Real)> {
    let p = &figure.points[v];
    if p.z <= 0.0 {
        return None;
    }
    let pixel = figure.camera.to_pixel(p);
    let (width, height) = (figure.camera.width(), figure.camera.height());
    if !(0.0..width as Real).contains(&pixel.x) || !(0.0..height as Real).contains(&pixel.y) {
        return None;
    }
    let at = pixel.y as usize * width + pixel.x as usize;
    if figure.seen.triangle[at] == NOTHING || p.z > Real::from(figure.seen.depth[at]) + BEHIND {
        return None;
    }
    let facing = -figure.normals[v].dot(&unit_or_zero(&p.coords));
    let normal = figure.camera.rotation().transpose() * figure.normals[v];
    (facing > FACING).then_some((pixel, normal, facing))
}

/// The derivative of the pixel position by a point of the world, for the point in the camera's frame.
fn pixel_slope(camera: &Camera, p: &Point) -> SMatrix<Real, 2, 3> {
    let k = camera.intrinsics();
    let (x, y) = (p.x / p.z, p.y / p.z);
    let by_camera = SMatrix::<Real, 2, 3>::new(
        k[(0, 0)],
        k[(0, 1)],
        -(k[(0, 0)] * x + k[(0, 1)] * y),
        0.0,
        k[(1, 1)],
        -k[(1, 1)] * y,
    ) / p.z;
    by_camera * camera.rotation()
}

/// The derivative of a silhouette's distance in metres by the point of the world, for the point in
/// the camera's frame.
pub(super) fn silhouette_slope(
    camera: &Camera,
    outside: &DistanceImage,
    point: &RimPoint,
    p: &Point,
    scale: Real,
) -> RowVector3<Real> {
    let [du, dv] = outside.slope(point.pixel.x, point.pixel.y);
    let across = nalgebra::RowVector2::new(du, dv) * pixel_slope(camera, p) * (p.z / scale);
    across + camera.rotation().row(2) * (point.metres / p.z)
}

/// The joints of a vertex with their weights and rigidly posed points.
fn influences<'a>(
    subject: &'a Subject,
    v: usize,
    transforms: &'a [Isometry3<Real>],
) -> impl Iterator<Item = (usize, Real, Point)> + 'a {
    let shares = subject.skin.joints()[v].iter().zip(&subject.skin.weights()[v]);
    shares.filter(|(_, w)| **w > 0.0).map(move |(j, w)| {
        let j = usize::from(*j);
        (j, Real::from(*w), transforms[j] * subject.points[v])
    })
}

fn silhouette_rows(
    subject: &Subject,
    v: usize,
    transforms: &[Isometry3<Real>],
    along: &RowVector3<Real>,
) -> Vec<Row<1>> {
    influences(subject, v, transforms)
        .map(|(j, w, p)| {
            let a = along.transpose();
            let turn = p.coords.cross(&a);
            (j, SMatrix::<Real, 1, 6>::new(turn.x, turn.y, turn.z, a.x, a.y, a.z) * w)
        })
        .collect()
}

/// `by_point` is the derivative of the observed normal by the point of the world.
fn normal_rows(
    subject: &Subject,
    v: usize,
    transforms: &[Isometry3<Real>],
    by_point: &Matrix3<Real>,
    normal: &Vector,
) -> Vec<Row<3>> {
    influences(subject, v, transforms)
        .map(|(j, w, p)| {
            let mut row = SMatrix::<Real, 3, 6>::zeros();
            let turn = cross(normal) - by_point * cross(&p.coords);
            row.fixed_view_mut::<3, 3>(0, 0).copy_from(&(turn * w));
            row.fixed_view_mut::<3, 3>(0, 3).copy_from(&(by_point * w));
            (j, row)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::poses::twists::tests::{bent, disturbed};
    use if_body::Pose;
    use if_body::skinning::{blends, pose_points};

    const SIZE: usize = 64;

    fn camera() -> Camera {
        let (eye, target) = (Point::new(0.3, 1.2, 2.5), Point::new(0.2, 1.3, 0.0));
        Camera::looking_at((SIZE, SIZE), &eye, &target, &Vector::y(), 0.9).unwrap()
    }

    /// Derivatives by all unknowns of ½ |r|², by differences and by the equations.
    fn compared<const R: usize>(
        rows: &[Row<R>],
        residual: impl Fn(&[Isometry3<Real>]) -> nalgebra::SVector<Real, R>,
    ) {
        let (skeleton, pose) = bent();
        let at = |pose: &Pose| residual(&skeleton.transforms(pose).unwrap());
        let mut twists = Twists::new(skeleton.len());
        twists.add(rows, &at(&pose), 1.0);
        let (_, g) = twists.into_pose(&skeleton, &skeleton.frames(&pose).unwrap());
        let h = 1e-5;
        for k in 0..g.len() {
            let [up, down] = [h, -h].map(|h| 0.5 * at(&disturbed(&pose, k, h)).norm_squared());
            let expected = (up - down) / (2.0 * h);
            // Images are in single precision: their differences round at 1e-7 of a pixel.
            assert!((g[k] - expected).abs() < 1e-5 * g.amax() + 1e-9, "{k}: {} {expected}", g[k]);
        }
        assert!(g.amax() > 1e-4, "the terms see the pose");
    }

    #[test]
    fn slopes_of_silhouettes_and_normals_match_differences() {
        let camera = camera();
        let (skeleton, pose) = bent();
        let transforms = skeleton.transforms(&pose).unwrap();
        let points = [Point::new(0.45, 1.38, 0.12)];
        let normals = [unit_or_zero(&Vector::new(0.2, 0.3, 0.9))];
        let position = |skin: &SkinWeights, t: &[Isometry3<Real>]| {
            camera.to_camera(&pose_points(&points, &blends(skin, t))[0])
        };

        // A mask with a straight border, whose distance is linear.
        let skin = SkinWeights::new(vec![[0, 1, 2, 3]], vec![[0.2, 0.3, 0.4, 0.1]], skeleton.len())
            .unwrap();
        let subject = Subject { skin: &skin, points: &points };
        let p = position(&skin, &transforms);
        let pixel = camera.to_pixel(&p);
        let border = pixel.x as usize + 3;
        let mask: Vec<bool> = (0..SIZE * SIZE).map(|i| i % SIZE < border).collect();
        let outside = DistanceImage::new(&mask, SIZE, SIZE, 0.0);
        let scale = pixels_per_metre(&camera);
        let metres = |q: &Point| {
            let pixel = camera.to_pixel(q);
            outside.at(pixel.x, pixel.y) * q.z / scale
        };
        let point = RimPoint { vertex: 0, pixel, own: 0.0, metres: metres(&p), weight: 1.0 };
        let along = silhouette_slope(&camera, &outside, &point, &p, scale);
        compared(&silhouette_rows(&subject, 0, &transforms, &along), |t| {
            Vector1::new(metres(&position(&skin, t)))
        });

        // Normals that vary; the vertex follows one joint, where its normal turns exactly.
        let skin =
            SkinWeights::new(vec![[2; 4]], vec![[1.0, 0.0, 0.0, 0.0]], skeleton.len()).unwrap();
        let subject = Subject { skin: &skin, points: &points };
        let image: Vec<[f32; 3]> = (0..SIZE * SIZE)
            .map(|i| [0.01 * (i % SIZE) as f32, 0.02 * (i / SIZE) as f32, 0.7])
            .collect();
        let image = NormalImage::new(&image, SIZE, SIZE, 0.0);
        let residual = |t: &[Isometry3<Real>]| {
            let pixel = camera.to_pixel(&position(&skin, t));
            let normal = blends(&skin, t)[0].normal(&normals[0]);
            image.at(pixel.x, pixel.y).unwrap().0 - normal
        };
        let p = position(&skin, &transforms);
        let pixel = camera.to_pixel(&p);
        let slope = image.at(pixel.x, pixel.y).unwrap().1 * pixel_slope(&camera, &p);
        let normal = blends(&skin, &transforms)[0].normal(&normals[0]);
        compared(&normal_rows(&subject, 0, &transforms, &slope, &normal), residual);
    }
}
