//! The evidence of all frames for the current surface: observed normals and silhouettes.

use super::figure::Figure;
use super::observe::Observation;
use super::report::Pixels;
use if_body::SkinWeights;
use if_core::edges::Edges;
use if_core::math::{Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::raster::NOTHING;
use rayon::prelude::*;

// "Mean" below is the mean distance to and from the truth (2.0 to 2.4 mm) of the surfaces fitted to
// the two sample captures of `docs/evidence/reconstruction.md`, all else being as it is.

/// Least cosine between an observed normal and the surface's for both to be of one point. From 0.1 to
/// 0.4 the mean changes by less than 0.03 mm.
const SAME_PLACE: Real = 0.2;
/// Least cosine between an observed normal and the line of sight in the area that a pixel sees: bounds what
/// noise does to pixels seen from the side. With 0.35 the mean changes by less than 0.02 mm.
const LEAST_VIEW: Real = 0.2;
/// Least share by which a silhouette must follow its vertex to say something of it.
const FOLLOWS: Real = 0.2;
/// Frames evaluated in parallel: bounds the memory of their evidence, 40 bytes for each pixel of the
/// person. The result does not depend on it.
const TOGETHER: usize = 16;

/// The evidence of all frames.
pub(super) struct Evidence {
    /// For each triangle the weighted sum of its observed normals in canonical space, and the sum of
    /// the weights.
    pub(super) normals: Vec<(Vector, Real)>,
    /// For each vertex the weighted sum of the offsets along its normal to the masks' borders, in
    /// metres, and the sum of the weights.
    pub(super) rim: Vec<(Real, Real)>,
    /// Counts of pixels.
    pub(super) pixels: Pixels,
    /// For each frame the overlap (intersection over union) of its mask and the figure.
    pub(super) overlap: Vec<Real>,
    /// How far observed normals agree with those of the surface.
    pub(super) axes: NormalAxes,
}

/// Sums over pixels, for each axis of the camera, of the products of observed normals with those of the
/// surface, and of their squares.
#[derive(Clone, Copy, Default)]
pub(super) struct NormalAxes {
    products: Vector,
    squares: [Vector; 2],
}

impl NormalAxes {
    fn add(&mut self, n: &Vector, surface: &Vector) {
        self.products += n.component_mul(surface);
        self.squares[0] += n.component_mul(n);
        self.squares[1] += surface.component_mul(surface);
    }

    fn plus(&mut self, other: &Self) {
        self.products += other.products;
        (0..2).for_each(|k| self.squares[k] += other.squares[k]);
    }

    /// The correlation on each axis: 1 where both are equal, -1 where one is the mirror image of the other,
    /// and 0 where nothing was seen.
    pub(super) fn correlations(&self) -> [Real; 3] {
        let of = |k: usize| {
            let norm = (self.squares[0][k] * self.squares[1][k]).sqrt();
            if norm > 0.0 { self.products[k] / norm } else { 0.0 }
        };
        [of(0), of(1), of(2)]
    }
}

/// The evidence of one frame.
struct Glance {
    normals: Vec<(u32, Vector, Real)>,
    rim: Vec<(u32, Real, Real)>,
    pixels: Pixels,
    overlap: Real,
    axes: NormalAxes,
}

/// Collects the evidence of all frames for the canonical surface `mesh`; silhouettes farther than
/// `reach` metres from the mask's border are ignored.
pub(super) fn gather(
    mesh: &TriMesh,
    edges: &Edges,
    skin: &SkinWeights,
    camera: &Camera,
    frames: &[Observation],
    reach: Real,
) -> Evidence {
    let vertex_normals = mesh.vertex_normals();
    let face_normals = mesh.face_normals();
    let mut all = Evidence {
        normals: vec![(Vector::zeros(), 0.0); mesh.triangles().len()],
        rim: vec![(0.0, 0.0); mesh.vertices().len()],
        pixels: Pixels::default(),
        overlap: Vec::with_capacity(frames.len()),
        axes: NormalAxes::default(),
    };
    for group in frames.chunks(TOGETHER) {
        let glances: Vec<Glance> = group
            .par_iter()
            .map(|frame| {
                let figure = Figure::new(mesh, edges, skin, camera, &frame.transforms);
                glance(&figure, frame, &vertex_normals, &face_normals, reach)
            })
            .collect();
        // Sums are in the order of the frames: the same bits on any number of threads.
        for glance in glances {
            for (t, n, w) in glance.normals {
                let sum = &mut all.normals[t as usize];
                *sum = (sum.0 + n * w, sum.1 + w);
            }
            for (v, way, w) in glance.rim {
                let sum = &mut all.rim[v as usize];
                *sum = (sum.0 + way * w, sum.1 + w);
            }
            let (sum, one) = (&mut all.pixels, glance.pixels);
            sum.person += one.person;
            sum.no_normal += one.no_normal;
            sum.off_surface += one.off_surface;
            sum.contradicting += one.contradicting;
            sum.used += one.used;
            all.overlap.push(glance.overlap);
            all.axes.plus(&glance.axes);
        }
    }
    all
}

/// The evidence of one frame for a surface.
fn glance(
    figure: &Figure,
    frame: &Observation,
    vertex_normals: &[Vector],
    face_normals: &[Vector],
    reach: Real,
) -> Glance {
    let rim = figure.rim(&frame.outside, reach).into_iter().filter_map(|r| {
        // The square of f s + metres.
        let f = figure.follows(r.vertex, &vertex_normals[r.vertex]);
        (f > FOLLOWS).then(|| (r.vertex as u32, -r.metres / f, r.weight * f * f))
    });
    let (rim, pixels, axes) = (rim.collect(), Pixels::default(), NormalAxes::default());
    let mut glance = Glance { normals: Vec::new(), rim, pixels, overlap: 0.0, axes };
    collect_normals(figure, frame, face_normals, &mut glance);
    glance
}

/// Collects observed normals, and the overlap of mask and figure.
///
/// Pixels are of equal area in the image, and count by that of what they see: 1 / (n · sight) of it. Then the
/// sum of normals over a triangle is the area vector of the cloth there, folded as it may be, which has the
/// direction of the triangle. Counted equally, or more if they face the camera, normals of folds flatten it.
fn collect_normals(
    figure: &Figure,
    frame: &Observation,
    face_normals: &[Vector],
    glance: &mut Glance,
) {
    let width = figure.camera.width();
    let (mut both, mut either) = (0usize, 0usize);
    let pixels = &mut glance.pixels;
    for (i, &t) in figure.seen.triangle.iter().enumerate() {
        let person = frame.outside.pixel(i) < 0.0;
        let drawn = t != NOTHING;
        both += usize::from(person && drawn);
        either += usize::from(person || drawn);
        pixels.person += usize::from(person);
        let n = frame.normals[i];
        if n == [0.0; 3] {
            pixels.no_normal += usize::from(person);
            continue;
        }
        if !drawn {
            pixels.off_surface += usize::from(person);
            continue;
        }
        let n = Vector::new(n[0].into(), n[1].into(), n[2].into());
        let n = figure.camera.rotation() * n;
        let canonical = figure.carried_back(t, &face_normals[t as usize], &n);
        let agreement = canonical.dot(&face_normals[t as usize]) - SAME_PLACE;
        let center = nalgebra::Point2::new((i % width) as Real + 0.5, (i / width) as Real + 0.5);
        let sight = unit_or_zero(&figure.camera.pixel_direction(&center));
        let face = figure.face_normal(t);
        glance.axes.add(&n, &face);
        let facing = -face.dot(&sight);
        if agreement <= 0.0 || facing <= 0.0 || n.dot(&sight) >= 0.0 {
            pixels.contradicting += usize::from(person);
            continue;
        }
        pixels.used += usize::from(person);
        let area = facing / (-n.dot(&sight)).max(LEAST_VIEW);
        glance.normals.push((t, canonical * area, facing * facing * agreement));
    }
    glance.overlap = if either == 0 { 0.0 } else { both as Real / either as Real };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::observe::prepared;
    use crate::reconstruct::params::SurfaceParams;
    use if_core::math::Point;
    use nalgebra::{Isometry3, Rotation3};

    #[test]
    fn folds_that_are_seen_from_the_side_do_not_turn_their_cloth() {
        // A sheet, turned by 50° from the camera, in folds of 25° to both sides. Of equal length, they fill
        // the image by their cosines.
        let turned =
            |degrees: Real| Rotation3::from_axis_angle(&Vector::y_axis(), degrees.to_radians());
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let points = corners.iter().map(|(x, y)| turned(50.0) * Point::new(*x, *y, 0.0)).collect();
        let sheet = TriMesh::new(points, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let skin = SkinWeights::new(vec![[0; 4]; 4], vec![[1.0, 0.0, 0.0, 0.0]; 4], 1).unwrap();
        let (size, eye) = (128, Point::new(0.0, 0.0, 40.0));
        let camera =
            Camera::looking_at((size, size), &eye, &Point::origin(), &Vector::y(), 0.08).unwrap();
        let [steep, level] = [75.0, 25.0].map(|a: Real| a.to_radians().cos());
        let folded = |i: usize| {
            let steep = (i as Real * 0.618_033_988_7).fract() < steep / (steep + level);
            let n = camera.rotation() * (turned(if steep { 75.0 } else { 25.0 }) * Vector::z());
            [n.x as f32, n.y as f32, n.z as f32]
        };
        let normals: Vec<[f32; 3]> = (0..size * size).map(folded).collect();
        let mask: Vec<bool> = (0..size * size).map(|i| (10..118).contains(&(i % size))).collect();
        let params = SurfaceParams::default();
        let still = vec![Isometry3::identity()];
        let frame = prepared(&camera, 0, still, &mask, normals.clone(), &params);
        let edges = Edges::new(&sheet);
        let seen = gather(&sheet, &edges, &skin, &camera, &[frame], 0.1);
        let angle =
            |n: &Vector| unit_or_zero(n).dot(&(turned(50.0) * Vector::z())).acos().to_degrees();
        for (sum, weight) in &seen.normals {
            assert!(*weight > 100.0 && angle(sum) < 1.0, "{weight}: {}", angle(sum));
        }
        let counted = normals.iter().fold(Vector::zeros(), |sum, n| {
            sum + camera.rotation().transpose() * Vector::from(n.map(Real::from))
        });
        assert!(angle(&counted) > 10.0, "counted equally: {}", angle(&counted));
    }
}
