//! The mannequin in its clothes, posed and rendered.

use super::SynthParams;
use super::motion::Waves;
use crate::capture::{BACKGROUND, SKIN};
use if_body::mannequin::{self, Garment, rig};
use if_body::{Pose, Skeleton, SkinWeights, TemplateBody};
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::camera::Camera;
use if_mesh::index::Bvh;
use if_mesh::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use rayon::prelude::*;

/// The camera: in front of the person, at breast height, with a vertical field of view of 32°.
pub(super) fn camera(size: usize) -> Camera {
    let (angle, height) = (32.0f64.to_radians(), 1.72);
    let distance = 0.56 * height / (0.5 * angle).tan() + 0.25;
    let (eye, target) =
        (Point::new(0.0, 0.55 * height, distance), Point::new(0.0, 0.5 * height, 0.0));
    Camera::looking_at((size, size), &eye, &target, &Vector::y(), angle)
        .expect("the size is in range, and the eye is not the target")
}

/// A layer in the rest pose.
pub(super) struct Layer {
    pub(super) mesh: TriMesh,
    pub(super) skin: SkinWeights,
    /// Distance of each vertex from the body, in metres.
    clearance: Vec<Real>,
}

/// The mannequin in its clothes, in the rest pose.
pub(super) struct Scene {
    pub(super) worn: Vec<Garment>,
    pub(super) skeleton: Skeleton,
    /// The body, then the garments from inner to outer.
    pub(super) layers: Vec<Layer>,
    /// All layers in one mesh.
    all: TriMesh,
    /// Index of the first triangle of each layer in it.
    first: Vec<usize>,
}

/// The noise-free images of one frame.
pub(super) struct Seen {
    pub(super) mask: Vec<bool>,
    pub(super) labels: Vec<u8>,
    pub(super) normals: Vec<[f32; 3]>,
}

impl Scene {
    pub(super) fn new(params: &SynthParams) -> Self {
        let mut worn = params.garments.clone();
        worn.sort();
        worn.dedup();
        let body = mannequin::body(&params.mannequin);
        let tree = Bvh::new(&body);
        let layer = |mesh: TriMesh| {
            let away = |p: &Point| tree.closest(p, Real::INFINITY).map_or(0.0, |c| c.distance);
            let clearance = mesh.vertices().par_iter().map(away).collect();
            Layer { skin: rig::skin_weights(mesh.vertices()), clearance, mesh }
        };
        let garments = worn.iter().map(|kind| mannequin::garment(*kind, &params.mannequin));
        let layers: Vec<Layer> = std::iter::once(body.clone()).chain(garments).map(layer).collect();
        let (mut vertices, mut triangles, mut first) = (Vec::new(), Vec::new(), Vec::new());
        for layer in &layers {
            let n = vertices.len() as u32;
            first.push(triangles.len());
            vertices.extend_from_slice(layer.mesh.vertices());
            triangles.extend(layer.mesh.triangles().iter().map(|t| t.map(|v| v + n)));
        }
        let all = TriMesh::new(vertices, triangles).expect("meshes side by side are a mesh");
        Self { worn, skeleton: rig::skeleton(), layers, all, first }
    }

    pub(super) fn template(&self) -> TemplateBody {
        let body = &self.layers[0];
        TemplateBody {
            mesh: body.mesh.clone(),
            skin: body.skin.clone(),
            skeleton: self.skeleton.clone(),
        }
    }

    /// The label of each vertex of all layers.
    pub(super) fn labels(&self) -> Vec<u8> {
        let one = |(k, layer): (usize, &Layer)| vec![k as u8 + SKIN; layer.mesh.vertices().len()];
        self.layers.iter().enumerate().flat_map(one).collect()
    }

    /// All layers in a pose; `waves` displace the garments before.
    pub(super) fn posed(&self, pose: &Pose, waves: &Waves, turn: Real) -> TriMesh {
        let transforms =
            self.skeleton.transforms(pose).expect("the pose has the joints of the rig");
        let mut posed = Vec::with_capacity(self.all.vertices().len());
        for (k, layer) in self.layers.iter().enumerate() {
            let mut rest = layer.mesh.vertices().to_vec();
            if k > 0 && !waves.still() {
                rest.iter_mut()
                    .zip(layer.mesh.vertex_normals())
                    .zip(&layer.clearance)
                    .for_each(|((p, n), away)| *p += n * above(waves.at(p, turn), *away));
            }
            let skinned = layer.skin.joints().iter().zip(layer.skin.weights()).zip(&rest);
            posed.extend(skinned.map(|((joints, weights), p)| {
                let parts = joints
                    .iter()
                    .zip(weights)
                    .map(|(j, w)| (transforms[usize::from(*j)] * p).coords * Real::from(*w));
                Point::from(parts.sum::<Vector>())
            }));
        }
        self.all.with_vertices(posed).expect("rotations keep coordinates finite")
    }

    pub(super) fn seen(
        &self,
        moved: &TriMesh,
        camera: &Camera,
        rasteriser: &mut Rasteriser,
    ) -> Seen {
        let mut ids = IdBuffer::default();
        rasteriser.rasterise(moved, moved.vertices(), camera, &RasterParams::default(), &mut ids);
        let normals: Vec<Vector> =
            moved.vertex_normals().iter().map(|n| camera.rotation() * n).collect();
        let (width, n) = (camera.width(), ids.triangle.len());
        let mut seen =
            Seen { mask: vec![false; n], labels: vec![BACKGROUND; n], normals: vec![[0.0; 3]; n] };
        for (at, &id) in ids.triangle.iter().enumerate().filter(|(_, id)| **id != NOTHING) {
            let layer = self.first.partition_point(|first| *first <= id as usize) - 1;
            seen.mask[at] = true;
            seen.labels[at] = layer as u8 + SKIN;
            if let Some((bary, cos)) = rasteriser.hit(moved, camera, id, at % width, at / width) {
                let corners = moved.triangles()[id as usize];
                let sum: Vector = (0..3).map(|k| normals[corners[k] as usize] * bary[k]).sum();
                // An estimator returns normals that face the camera, also of back sides.
                let normal = unit_or_zero(&sum) * if cos < 0.0 { -1.0 } else { 1.0 };
                seen.normals[at] = [normal.x as f32, normal.y as f32, normal.z as f32];
            }
        }
        seen
    }
}

/// What a displacement along the normal becomes `away` metres from the body: inwards at most half of the way
/// there. What is farther away remains so, so that no layer shows through another.
fn above(displacement: Real, away: Real) -> Real {
    if displacement >= 0.0 || away <= 0.0 {
        return displacement.max(0.0);
    }
    0.5 * away * ((2.0 * displacement / away).exp() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::tests::small;
    use super::*;

    #[test]
    fn waves_move_clothes_by_their_amplitude_and_not_the_body() {
        let scene = Scene::new(&small(0.0));
        let pose = rig::turning_pose(1, 8);
        let still = scene.posed(&pose, &Waves::new(0.0, 1), 0.25);
        let moved = scene.posed(&pose, &Waves::new(0.01, 1), 0.25);
        let mut square = [(0.0, 0.0); 2];
        for ((p, q), label) in still.vertices().iter().zip(moved.vertices()).zip(scene.labels()) {
            let sum = &mut square[usize::from(label > SKIN)];
            *sum = (sum.0 + (p - q).norm_squared(), sum.1 + 1.0);
        }
        assert_eq!(square[0].0, 0.0);
        let high = (square[1].0 / square[1].1 as Real).sqrt();
        assert!((0.003..0.015).contains(&high), "{high}");
    }

    #[test]
    fn waves_keep_layers_in_order_and_above_the_body() {
        for displacement in [-0.05, -0.01, -0.001, 0.0, 0.01] {
            let places = (1..100).map(|k| 1e-3 * Real::from(k));
            let moved: Vec<Real> = places.clone().map(|d| d + above(displacement, d)).collect();
            assert!(moved.windows(2).all(|w| w[0] < w[1]), "{displacement}");
            assert!(moved.iter().zip(places).all(|(now, was)| *now >= 0.5 * was));
        }
        assert_eq!((above(0.01, 0.002), above(-0.01, 0.0)), (0.01, 0.0));
        approx::assert_relative_eq!(above(-0.001, 10.0), -0.001, max_relative = 1e-3);
        // The skin that the pictures show is about the same.
        let scene = Scene::new(&small(0.0));
        let (camera, pose) = (camera(128), rig::turning_pose(1, 8));
        let skin = |amount: Real| {
            let moved = scene.posed(&pose, &Waves::new(amount, 1), 0.25);
            let seen = scene.seen(&moved, &camera, &mut Rasteriser::default());
            seen.labels.iter().filter(|label| **label == SKIN).count() as Real
        };
        let (still, waving) = (skin(0.0), skin(0.01));
        assert!((waving / still - 1.0).abs() < 0.03, "{still} {waving}");
    }

    #[test]
    fn the_mask_of_a_pose_contains_its_joints() {
        let scene = Scene::new(&small(0.0));
        let camera = camera(64);
        let pose = rig::turning_pose(1, 8);
        let moved = scene.posed(&pose, &Waves::new(0.0, 0), 0.0);
        let seen = scene.seen(&moved, &camera, &mut Rasteriser::default());
        for (joint, frame) in
            scene.skeleton.joints().iter().zip(scene.skeleton.frames(&pose).unwrap())
        {
            let pixel = camera.project(&Point::from(frame.translation.vector)).unwrap();
            let at = pixel.y as usize * 64 + pixel.x as usize;
            assert!(seen.mask[at], "{} at {pixel}", joint.name);
        }
    }
}
