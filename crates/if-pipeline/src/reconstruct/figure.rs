//! A surface, posed and rasterised in a frame, and its silhouette.

use super::distance_image::DistanceImage;
use super::fair;
use super::projection::pixels_per_metre;
use if_body::SkinWeights;
use if_body::skinning::{Affine, blends, pose_points};
use if_core::edges::{Edges, NONE};
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use nalgebra::{Isometry3, Point2};

// "Mean" below is the mean distance to and from the truth (2.0 to 2.4 mm) of the surfaces fitted to
// the two sample captures of `docs/evidence/reconstruction.md`, all else being as it is.

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
/// The surface, posed and rasterised in a frame.
pub(super) struct Figure<'a> {
    pub(super) mesh: &'a TriMesh,
    edges: &'a Edges,
    pub(super) camera: &'a Camera,
    /// The map of each vertex.
    pub(super) maps: Vec<Affine>,
    /// Vertices in the camera's frame.
    pub(super) points: Vec<Point>,
    /// Their unit normals there, those of the posed surface.
    pub(super) normals: Vec<Vector>,
    /// The visible triangle of each pixel.
    pub(super) seen: IdBuffer,
}

/// A vertex on the silhouette, and the border of the mask beside it.
pub(super) struct RimPoint {
    pub(super) vertex: usize,
    /// Position in the image.
    pub(super) pixel: Point2<Real>,
    /// Signed distance from the rasterised figure's own outline, in pixels, positive outside:
    /// vertices between front and back faces also lie on folds up to [`BESIDE`] pixels inside.
    pub(super) own: Real,
    /// How much farther outside the mask's border it lies than outside the figure's own outline, at
    /// the vertex's depth, in metres. As the difference of two distances that are found alike it is
    /// free of what pixels and filters do to each: they make a surface a quarter of a pixel too
    /// large.
    pub(super) metres: Real,
    /// 1 where the border faces as the vertex, seen in profile.
    pub(super) weight: Real,
}

impl<'a> Figure<'a> {
    /// Poses the surface by the skinning `transforms` of its joints.
    pub(super) fn new(
        mesh: &'a TriMesh,
        edges: &'a Edges,
        skin: &SkinWeights,
        camera: &'a Camera,
        transforms: &[Isometry3<Real>],
    ) -> Self {
        let maps = blends(skin, transforms);
        let world = pose_points(mesh.vertices(), &maps);
        let mut seen = IdBuffer::default();
        Rasteriser::default().rasterise(mesh, &world, camera, &RasterParams::default(), &mut seen);
        let points: Vec<Point> = world.iter().map(|p| camera.to_camera(p)).collect();
        let normals = fair::normals(mesh.triangles(), &points);
        Self { mesh, edges, camera, maps, points, normals, seen }
    }

    /// The figure with other normals at some vertices, given in canonical space.
    pub(super) fn with_normals(mut self, canonical: &[Option<Vector>]) -> Self {
        for (v, normal) in canonical.iter().enumerate() {
            if let Some(n) = normal {
                self.normals[v] = self.camera.rotation() * self.maps[v].normal(n);
            }
        }
        self
    }

    /// The unit normal of a posed triangle in the camera's frame; zero if it has no area.
    pub(super) fn face_normal(&self, t: u32) -> Vector {
        let [a, b, c] = self.mesh.triangles()[t as usize].map(|v| &self.points[v as usize]);
        unit_or_zero(&area_vector(a, b, c))
    }

    /// The step of a vertex along its canonical normal `n` as far as it moves the posed surface along
    /// its own, for each metre.
    pub(super) fn follows(&self, vertex: usize, n: &Vector) -> Real {
        let way = self.camera.rotation() * (self.maps[vertex].linear * n);
        self.normals[vertex].dot(&way)
    }

    /// The normal `n` of triangle `t`, in the camera's frame, carried back to canonical space, where the
    /// triangle's own normal is `rest`: Fᵀ n of length one, F the deformation gradient.
    ///
    /// ```text
    /// F eₖ = e′ₖ   for the edges of the triangle, F rest = A rest with the mean A of the corners' maps
    /// ```
    ///
    /// So Fᵀ n is at right angles to an edge where n is so to the posed edge. Aᵀ n is that only where
    /// weights are even: between the legs of somebody who walks in a skirt they are not.
    pub(super) fn carried_back(&self, t: u32, rest: &Vector, n: &Vector) -> Vector {
        let corners = self.mesh.triangles()[t as usize];
        let [a, b, c] = self.mesh.corners(t as usize);
        let (e, f) = (b - a, c - a);
        let twice_area = e.cross(&f).norm();
        if twice_area == 0.0 {
            return Vector::zeros();
        }
        let [a, b, c] = corners.map(|v| self.points[v as usize]);
        let (along_e, along_f) = (n.dot(&(b - a)), n.dot(&(c - a)));
        let sum = corners
            .iter()
            .fold(Vector::zeros(), |sum, v| sum + self.maps[*v as usize].linear * rest);
        let out = n.dot(&(self.camera.rotation() * sum)) / 3.0;
        let along = f.cross(rest) * along_e + rest.cross(&e) * along_f;
        unit_or_zero(&(along / twice_area + rest * out))
    }

    /// Rim vertices (between front and back faces) on the silhouette, at most `reach` metres from
    /// the border of a mask. `outside` is the distance from it.
    pub(super) fn rim(&self, outside: &DistanceImage, reach: Real) -> Vec<RimPoint> {
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
            if sides[1] != NONE && front[sides[0] as usize] != front[sides[1] as usize] {
                self.edges.vertices[e].iter().for_each(|v| rim[*v as usize] = true);
            }
        }
        let pixels_per_metre = pixels_per_metre(self.camera);
        let figure: Vec<bool> = self.seen.triangle.iter().map(|t| *t != NOTHING).collect();
        let mut found = Vec::new();
        let Some(outline) = outside.outline(&figure, BESIDE) else { return found };
        for vertex in (0..rim.len()).filter(|v| rim[*v]) {
            let p = &self.points[vertex];
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
            let own = outline.at(pixel.x, pixel.y);
            let metres = (outside.at(pixel.x, pixel.y) - own) * p.z / pixels_per_metre;
            if metres.abs() > reach {
                continue;
            }
            let normal = &self.normals[vertex];
            let across = normal.xy().norm();
            if across == 0.0 {
                continue;
            }
            let [du, dv] = outside.slope(pixel.x, pixel.y);
            let along = (du * normal.x + dv * normal.y) / across;
            let tilt = normal.dot(&unit_or_zero(&p.coords)) / ROUND_THE_CORNER;
            let weight = along * (1.0 - tilt * tilt);
            if along > SAME_BORDER && weight > 0.0 {
                found.push(RimPoint { vertex, pixel, own, metres, weight });
            }
        }
        found
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
                let seen = inside && self.seen.triangle[(y * width + x) as usize] != NOTHING;
                figure |= seen;
                beside |= !seen;
            }
        }
        figure && beside
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    #[test]
    fn normals_come_back_and_silhouettes_follow_where_weights_are_uneven() {
        // A ball between two legs: the one forwards and turned, the other back.
        let ball = meshes::icosphere(0.3, 3);
        let share = |p: &Point| (0.5 + p.x / 0.3).clamp(0.0, 1.0) as f32;
        let weights: Vec<[f32; 4]> =
            ball.vertices().iter().map(|p| [1.0 - share(p), share(p), 0.0, 0.0]).collect();
        let skin = SkinWeights::new(vec![[0, 1, 0, 0]; weights.len()], weights, 2).unwrap();
        let legs = [-0.2, 0.2].map(|z| Isometry3::new(Vector::new(0.0, 0.0, z), Vector::x() * z));
        let eye = Point::new(0.4, 0.3, 2.5);
        let camera =
            Camera::looking_at((64, 64), &eye, &Point::origin(), &Vector::y(), 0.9).unwrap();
        let edges = Edges::new(&ball);
        let figure = Figure::new(&ball, &edges, &skin, &camera, &legs);
        let turned = figure.camera.rotation();
        let mut off: Real = 0.0;
        for (t, rest) in ball.face_normals().iter().enumerate() {
            let posed = figure.face_normal(t as u32);
            let back = figure.carried_back(t as u32, rest, &posed);
            assert!((back - rest).norm() < 1e-9, "triangle {t}: {back} {rest}");
            let corner = ball.triangles()[t][0] as usize;
            off = off.max((turned * figure.maps[corner].normal(rest) - posed).norm());
        }
        assert!(off > 0.5, "maps alone are off: {off}");

        // What moves along canonical normals moves the posed surface along its own as it is said to.
        let (h, normals) = (1e-6, ball.vertex_normals());
        for v in (0..normals.len()).step_by(17) {
            let mut points = ball.vertices().to_vec();
            points[v] += normals[v] * h;
            let moved = ball.with_vertices(points).unwrap();
            let moved = Figure::new(&moved, &edges, &skin, &camera, &legs);
            let way = (moved.points[v] - figure.points[v]).dot(&figure.normals[v]) / h;
            assert!((figure.follows(v, &normals[v]) - way).abs() < 1e-6, "vertex {v}: {way}");
        }
        assert!((0..normals.len()).any(|v| figure.follows(v, &normals[v]) < 0.8));
    }
}
