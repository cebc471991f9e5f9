//! The evidence of all frames for the current surface: observed normals and silhouettes.

use super::observe::Observation;
use super::projection::pixels_per_metre;
use super::report::Pixels;
use if_body::SkinWeights;
use if_body::skinning::{Affine, blends, pose_points};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use rayon::prelude::*;

// "Mean" below is the mean distance to and from the truth (2.0 to 2.4 mm) of the surfaces fitted to
// the two sample captures of `docs/evidence/reconstruction.md`, all else being as it is.

/// Least cosine between an observed normal and the surface's for both to be of one point. From 0.1 to
/// 0.4 the mean changes by less than 0.03 mm.
const SAME_PLACE: Real = 0.2;
/// Radius in pixels within which a silhouette vertex must have pixels of both the figure and its
/// surroundings. Below the pixel's diagonal vertices are missed; larger radii include vertices off
/// the silhouette: at 4 the mean rises by 0.8 mm. At 1.5 trousers, sweater and suit are 0.1 mm
/// better, a dress with an error of 11 mm is 0.2 to 0.3 mm worse.
const BESIDE: Real = 2.0;
/// Least cosine between a rim vertex's normal and the direction to the mask's border for both to be
/// of one border. From 0.25 to 0.75 the mean changes by less than 0.04 mm; 1 leaves no silhouette.
const SAME_BORDER: Real = 0.5;
/// Cosine between normal and line of sight at which the weight of a rim vertex becomes zero. From
/// 0.25 to 1 the mean changes by less than 0.02 mm.
const ROUND_THE_CORNER: Real = 0.5;
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
}

/// The evidence of one frame.
struct Glance {
    normals: Vec<(u32, Vector, Real)>,
    rim: Vec<(u32, Real, Real)>,
    pixels: Pixels,
    overlap: Real,
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
    };
    for group in frames.chunks(TOGETHER) {
        let glances: Vec<Glance> = group
            .par_iter()
            .map(|frame| {
                Figure::new(mesh, edges, skin, camera, frame).glance(
                    frame,
                    &vertex_normals,
                    &face_normals,
                    reach,
                )
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
        }
    }
    all
}

/// The surface, posed and rasterised in a frame.
struct Figure<'a> {
    mesh: &'a TriMesh,
    edges: &'a Edges,
    camera: &'a Camera,
    maps: Vec<Affine>,
    /// Vertices in the camera's frame.
    points: Vec<Point>,
    seen: Vec<u32>,
}

impl<'a> Figure<'a> {
    fn new(
        mesh: &'a TriMesh,
        edges: &'a Edges,
        skin: &SkinWeights,
        camera: &'a Camera,
        frame: &Observation,
    ) -> Self {
        let maps = blends(skin, &frame.transforms);
        let world = pose_points(mesh.vertices(), &maps);
        let mut buffer = IdBuffer::default();
        Rasteriser::default().rasterise(
            mesh,
            &world,
            camera,
            &RasterParams::default(),
            &mut buffer,
        );
        let points = world.iter().map(|p| camera.to_camera(p)).collect();
        Self { mesh, edges, camera, maps, points, seen: buffer.triangle }
    }

    fn glance(
        &self,
        frame: &Observation,
        vertex_normals: &[Vector],
        face_normals: &[Vector],
        reach: Real,
    ) -> Glance {
        let mut glance = Glance {
            normals: Vec::new(),
            rim: Vec::new(),
            pixels: Pixels::default(),
            overlap: 0.0,
        };
        self.collect_normals(frame, face_normals, &mut glance);
        self.collect_rim(frame, vertex_normals, reach, &mut glance);
        glance
    }

    /// Collects observed normals, and the overlap of mask and figure.
    fn collect_normals(&self, frame: &Observation, face_normals: &[Vector], glance: &mut Glance) {
        let width = self.camera.width();
        let (mut both, mut either) = (0usize, 0usize);
        let pixels = &mut glance.pixels;
        for (i, &t) in self.seen.iter().enumerate() {
            let person = frame.outside.pixel(i) < 0.0;
            let figure = t != NOTHING;
            both += usize::from(person && figure);
            either += usize::from(person || figure);
            pixels.person += usize::from(person);
            let n = frame.normals[i];
            if n == [0.0; 3] {
                pixels.no_normal += usize::from(person);
                continue;
            }
            if !figure {
                pixels.off_surface += usize::from(person);
                continue;
            }
            let n = Vector::new(n[0].into(), n[1].into(), n[2].into());
            // Aᵀ n with the mean of the corners' maps: triangles are small compared with bones.
            let corners = self.mesh.triangles()[t as usize];
            let linear = corners
                .iter()
                .fold(nalgebra::Matrix3::zeros(), |sum, v| sum + self.maps[*v as usize].linear);
            let canonical = unit_or_zero(&(linear.transpose() * n));
            let agreement = canonical.dot(&face_normals[t as usize]) - SAME_PLACE;
            let center =
                nalgebra::Point2::new((i % width) as Real + 0.5, (i / width) as Real + 0.5);
            let sight = self.camera.rotation().transpose() * self.camera.pixel_direction(&center);
            let facing = -n.dot(&unit_or_zero(&sight));
            if agreement <= 0.0 || facing <= 0.0 {
                pixels.contradicting += usize::from(person);
                continue;
            }
            pixels.used += usize::from(person);
            glance.normals.push((t, canonical, facing * facing * agreement));
        }
        glance.overlap = if either == 0 { 0.0 } else { both as Real / either as Real };
    }

    /// Collects rim vertices (between front and back faces) on the silhouette.
    fn collect_rim(
        &self,
        frame: &Observation,
        vertex_normals: &[Vector],
        reach: Real,
        glance: &mut Glance,
    ) {
        let (width, height) = (self.camera.width() as Real, self.camera.height() as Real);
        let front: Vec<bool> = (0..self.mesh.triangles().len())
            .map(|t| {
                let [a, b, c] = self.mesh.triangles()[t].map(|v| self.points[v as usize]);
                (b - a).cross(&(c - a)).dot(&a.coords) < 0.0
            })
            .collect();
        // Edges between a front and a back face.
        let mut rim = vec![false; self.points.len()];
        for (e, sides) in self.edges.triangles.iter().enumerate() {
            if sides[1] != if_core::edges::NONE
                && front[sides[0] as usize] != front[sides[1] as usize]
            {
                self.edges.vertices[e].iter().for_each(|v| rim[*v as usize] = true);
            }
        }
        let pixels_per_metre = pixels_per_metre(self.camera);
        for v in (0..rim.len()).filter(|v| rim[*v]) {
            let p = &self.points[v];
            if p.z <= 0.0 {
                continue;
            }
            let pixel = self.camera.to_pixel(p);
            if !(0.0..width).contains(&pixel.x)
                || !(0.0..height).contains(&pixel.y)
                || !self.on_silhouette(pixel.x, pixel.y)
            {
                continue;
            }
            let away = frame.outside.at(pixel.x, pixel.y);
            let metres = away * p.z / pixels_per_metre;
            if metres.abs() > reach {
                continue;
            }
            let normal = self.camera.rotation() * self.maps[v].normal(&vertex_normals[v]);
            let across = normal.xy().norm();
            if across == 0.0 {
                continue;
            }
            let [du, dv] = frame.outside.slope(pixel.x, pixel.y);
            let along = (du * normal.x + dv * normal.y) / across;
            let tilt = normal.dot(&unit_or_zero(&p.coords)) / ROUND_THE_CORNER;
            let weight = along * (1.0 - tilt * tilt);
            if along > SAME_BORDER && weight > 0.0 {
                glance.rim.push((v as u32, -metres, weight));
            }
        }
    }

    /// Whether pixels both on and off the figure lie within [`BESIDE`] pixels.
    fn on_silhouette(&self, u: Real, v: Real) -> bool {
        let (width, height) = (self.camera.width() as i64, self.camera.height() as i64);
        let (mut figure, mut beside) = (false, false);
        for y in (v - BESIDE).floor() as i64..=(v + BESIDE).floor() as i64 {
            for x in (u - BESIDE).floor() as i64..=(u + BESIDE).floor() as i64 {
                if (x as Real + 0.5 - u).hypot(y as Real + 0.5 - v) > BESIDE {
                    continue;
                }
                let inside = (0..width).contains(&x) && (0..height).contains(&y);
                let seen = inside && self.seen[(y * width + x) as usize] != NOTHING;
                figure |= seen;
                beside |= !seen;
            }
        }
        figure && beside
    }
}
