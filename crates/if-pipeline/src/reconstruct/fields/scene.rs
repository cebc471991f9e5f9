//! What the frames show of the surface: pixels with normals, and silhouettes beside the masks'
//! borders, each with the canonical point at which training starts.

use super::skin::{Skin, joint_maps};
use crate::reconstruct::figure::Figure;
use crate::reconstruct::observe::Observation;
use if_body::SkinWeights;
use if_body::skinning::Affine;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::index::Bvh;
use if_mesh::raster::NOTHING;
use nalgebra::Point2;

/// The usable frames, and the skinned surface that gives weights to the space around it.
pub(super) struct Scene<'a> {
    pub(super) camera: &'a Camera,
    pub(super) frames: &'a [Observation],
    /// The maps of the joints in each of them.
    pub(super) joints: Vec<Vec<Affine>>,
    surface: &'a TriMesh,
    skin: &'a SkinWeights,
    tree: Bvh,
}

/// A pixel with a normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pixel {
    /// Index in [`Scene::frames`].
    pub(super) frame: u32,
    /// Index in the image.
    pub(super) pixel: u32,
    /// The canonical point that is seen there.
    pub(super) at: Point,
}

/// A point of a silhouette.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rim {
    /// Index in [`Scene::frames`].
    pub(super) frame: u32,
    /// The canonical point.
    pub(super) at: Point,
    /// Its signed distance from the figure's own outline, in pixels.
    pub(super) own: Real,
    /// Its weight.
    pub(super) weight: Real,
}

/// What a frame shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Sight {
    pub(super) pixels: Vec<Pixel>,
    pub(super) rims: Vec<Rim>,
}

impl<'a> Scene<'a> {
    pub(super) fn new(
        camera: &'a Camera,
        frames: &'a [Observation],
        surface: &'a TriMesh,
        skin: &'a SkinWeights,
    ) -> Self {
        let joints = frames.iter().map(|f| joint_maps(&f.transforms)).collect();
        Self { camera, frames, joints, surface, skin, tree: Bvh::new(surface) }
    }

    /// The weights around a canonical point.
    pub(super) fn skin(&self, at: &Point) -> Skin {
        Skin::near(&self.tree, self.surface, self.skin, at)
    }

    /// The camera's centre, and the unit direction of the ray through a pixel's centre.
    pub(super) fn ray(&self, pixel: usize) -> (Point, Vector) {
        let width = self.camera.width();
        let center = Point2::new((pixel % width) as Real + 0.5, (pixel / width) as Real + 0.5);
        let (from, along) = self.camera.ray(&center);
        (from, unit_or_zero(&along))
    }

    /// How much farther than `own` pixels outside the border of the mask of a frame a posed point
    /// lies, at its depth, in metres; and the derivative of that by a motion along the unit vector `normal`.
    /// `None` behind the camera.
    pub(super) fn beside_mask(
        &self,
        frame: usize,
        posed: &Point,
        normal: &Vector,
        own: Real,
    ) -> Option<(Real, Real)> {
        let p = self.camera.to_camera(posed);
        if p.z <= 0.0 {
            return None;
        }
        let pixel = self.camera.to_pixel(&p);
        let outside = &self.frames[frame].outside;
        let k = self.camera.intrinsics();
        let focal = 0.5 * (k[(0, 0)] + k[(1, 1)]);
        let [du, dv] = outside.slope(pixel.x, pixel.y);
        let n = self.camera.rotation() * normal;
        // A motion n moves the pixel by f (n_xy − n_z p_xy / z) / z.
        let slope = du * (n.x - n.z * p.x / p.z) + dv * (n.y - n.z * p.y / p.z);
        Some(((outside.at(pixel.x, pixel.y) - own) * p.z / focal, slope))
    }

    /// What frame `k` shows of a canonical `mesh` with weights `skin`, moved by `offsets`.
    /// Silhouettes farther than `reach` metres from the mask's border are ignored.
    pub(super) fn look(
        &self,
        k: usize,
        mesh: &TriMesh,
        edges: &Edges,
        skin: &SkinWeights,
        offsets: &[Vector],
        reach: Real,
    ) -> Sight {
        let frame = &self.frames[k];
        let moved = mesh.vertices().iter().zip(offsets).map(|(p, d)| p + d).collect();
        let moved = mesh.with_vertices(moved).expect("offsets of networks were checked");
        let figure = Figure::new(&moved, edges, skin, self.camera, &frame.transforms);
        let rim = figure.rim(&frame.outside, reach);
        let k = k as u32;
        let rims = rim
            .iter()
            .map(|r| Rim { frame: k, at: mesh.vertices()[r.vertex], own: r.own, weight: r.weight })
            .collect();
        let width = self.camera.width();
        let mut pixels = Vec::new();
        for (i, &t) in figure.seen.triangle.iter().enumerate() {
            if t == NOTHING || frame.normals[i] == [0.0; 3] {
                continue;
            }
            let corners = mesh.triangles()[t as usize].map(|v| v as usize);
            let center = Point2::new((i % width) as Real + 0.5, (i / width) as Real + 0.5);
            let along = self.camera.pixel_direction(&center);
            let [a, b, c] = corners.map(|v| figure.points[v].coords);
            // Volumes of the ray with two corners are to each other as barycentric coordinates.
            let parts = [(b, c), (c, a), (a, b)].map(|(p, q)| along.dot(&p.cross(&q)));
            let sum: Real = parts.iter().sum();
            if sum == 0.0 {
                continue;
            }
            let at = corners
                .iter()
                .zip(parts)
                .map(|(v, part)| mesh.vertices()[*v].coords * (part / sum))
                .sum::<Vector>();
            pixels.push(Pixel { frame: k, pixel: i as u32, at: Point::from(at) });
        }
        Sight { pixels, rims }
    }
}
