//! Training on a small capture of the mannequin.

use super::nets::Nets;
use super::scene::Scene;
use super::step::{Step, random_of};
use super::train::{Begin, train};
use super::*;
use crate::capture::SKIN;
use crate::capture::synth::{BODY, SynthParams, TRUTH, synth};
use crate::reconstruct::canonical::{FloodedField, carried_weights, largest_piece};
use crate::reconstruct::observe::{Observation, observe_used};
use crate::reconstruct::{fit_surface, posed};
use if_body::TemplateBody;
use if_body::mannequin::{Garment, MannequinParams};
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::monitor::{Progress, Silent};
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::index::Bvh;
use if_mesh::ply::{self, Column};
use if_neural::grid::GridConfig;
use if_neural::mlp::{DeformationConfig, SdfConfig};
use if_neural::network::NetworkConfig;
use if_neural::sampling::SamplingParams;
use if_neural::schedule::Schedule;
use if_neural::trainable::TrainableField;
use std::ops::ControlFlow;

/// A capture, and the template as it is as the start: no round of the surface was done.
struct Small {
    folder: tempfile::TempDir,
    capture: Capture,
    template: TemplateBody,
    surface: Surface,
    mesh: TriMesh,
    skin: SkinWeights,
    exact: MeshSdf,
}

impl Small {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let scene = SynthParams {
            garments: vec![Garment::Trousers, Garment::Tshirt],
            frames: 4,
            size: 80,
            nonrigid: 0.01,
            mannequin: MannequinParams { resolution: 0.7, overlap: 0.0 },
            ..SynthParams::default()
        };
        let path = folder.path().join("capture");
        synth(&scene, &path, &mut Silent).unwrap();
        let capture = Capture::open(&path).unwrap();
        let template = TemplateBody::read(&path.join(BODY)).unwrap();
        let read = SurfaceParams { rounds: 0, ..Default::default() };
        let surface = fit_surface(&capture, &template, &read, None, &mut Silent).unwrap();
        let flooded = FloodedField::new(&surface.mesh).unwrap();
        let cells = ExtractParams {
            region: Some(surface.mesh.aabb().inflated(0.02)),
            resolution: Resolution::Cell(0.02),
            newton: 0,
            ..ExtractParams::default()
        };
        let mesh = largest_piece(&extract(&flooded, &cells, &mut Silent).unwrap().mesh);
        let joints = template.skeleton.len();
        let skin = carried_weights(&surface.mesh, &surface.skin, joints, mesh.vertices());
        let exact = MeshSdf::closed(&mesh).unwrap();
        Self { folder, capture, template, surface, mesh, skin, exact }
    }

    fn begin(&self) -> Begin<'_> {
        Begin {
            skeleton: &self.template.skeleton,
            surface: &self.surface,
            mesh: &self.mesh,
            skin: &self.skin,
            exact: &self.exact,
            motion: None,
        }
    }

    fn frames(&self) -> Vec<Observation> {
        let (skeleton, skipped) = (&self.template.skeleton, &self.surface.report.skipped);
        let read = SurfaceParams::default();
        observe_used(&self.capture, skeleton, skipped, &read, &mut Silent).unwrap()
    }

    /// Mean distance of the clothes as they are from a mesh moved by `offsets` in each frame, in
    /// millimetres.
    fn error(&self, mesh: &TriMesh, offsets: &[Vec<if_core::math::Vector>]) -> Real {
        let skin = carried_weights(
            &self.surface.mesh,
            &self.surface.skin,
            self.template.skeleton.len(),
            mesh.vertices(),
        );
        let (mut sum, mut count) = (0.0, 0);
        for (frame, d) in offsets.iter().enumerate() {
            let file = self
                .folder
                .path()
                .join("capture")
                .join(TRUTH)
                .join(format!("frame_{frame:04}.ply"));
            let truth = ply::read_path(&file).unwrap();
            let Column::U8(labels) = &truth.vertex_properties[0].values else {
                panic!("labels are bytes")
            };
            let pose = self.capture.pose(frame);
            let at = posed(mesh, &skin, &self.template.skeleton, pose, d).unwrap();
            let at = mesh.with_vertices(at).unwrap();
            let tree = Bvh::new(&at);
            let cloth = truth.mesh.vertices().iter().zip(labels).filter(|(_, l)| **l > SKIN);
            for (p, _) in cloth.step_by(3) {
                sum += 1e3 * (tree.closest(p, Real::INFINITY).unwrap().point - p).norm();
                count += 1;
            }
        }
        sum / Real::from(count)
    }
}

fn params() -> FieldsParams {
    let usual = FieldsParams::default();
    let config = GridConfig { coarsest: 8, finest: 32, levels: 3, hidden: 0, ..Default::default() };
    let sampling = SamplingParams { near: 5000, far: 2000, held_out: 500, ..Default::default() };
    let phi =
        crate::reconstruct::PhiParams { network: NetworkConfig::Grid(config), steps: 10, sampling };
    FieldsParams {
        phi,
        deformation: DeformationConfig { bands: 3, embedding: 4, frames: 1, width: 24, layers: 2 },
        steps: 60,
        refresh: 20,
        rays: 400,
        silhouettes: 300,
        points: 200,
        material: 100,
        phi_rate: Schedule { rate: 4e-3, warmup: 5, last: 0.1 },
        deformation_rate: Schedule { rate: 3e-3, warmup: 5, last: 0.1 },
        weights: FieldsWeights { reach: 0.03, ..usual.weights },
        ..usual
    }
}

#[test]
fn the_gradient_of_a_step_is_the_central_difference_of_its_loss() {
    let small = Small::new();
    let frames = small.frames();
    let (surface, camera) = (&small.surface, small.capture.camera());
    let scene = Scene::new(camera, &frames, &surface.mesh, &surface.skin);
    // Silhouettes have a distance that is interpolated between pixels, and its slope is smoothed:
    // their adjoint is tested on its own. Everything else is a loss of its own.
    let usual = FieldsParams::default().weights;
    let none = FieldsWeights {
        normals: 0.0,
        silhouettes: 0.0,
        eikonal: 0.0,
        stay: 0.0,
        bending: 0.0,
        small: 0.0,
        along: 0.0,
        rigid: 0.0,
        mean: 0.0,
        smooth: 0.0,
        ..usual
    };
    let grid = GridConfig { coarsest: 8, finest: 16, levels: 2, hidden: 0, ..Default::default() };
    let sdf = SdfConfig {
        width: 48,
        layers: 3,
        skip: None,
        features: 0,
        bands: 2,
        beta: 20.0,
        ..SdfConfig::fast()
    };
    for network in [NetworkConfig::Grid(grid), NetworkConfig::Sdf(sdf)] {
        let phi = crate::reconstruct::PhiParams { network, steps: 60, ..params().phi };
        let fitted = crate::reconstruct::fit_phi(&small.exact, &phi, &mut Silent).unwrap();
        let config = DeformationConfig { frames: 4, ..params().deformation };
        let mut deformation = DeformationNetwork::new(&config, 3).unwrap();
        // Off the start, where d is almost zero: some millimetres.
        deformation.parameters_mut().iter_mut().enumerate().for_each(|(k, p)| {
            *p += 0.02 * ((7.3 * k as f32).sin());
        });
        deformation.refresh();
        let mut start = fitted.network.clone();
        start.parameters_mut().iter_mut().for_each(|p| *p *= 1.01);
        start.refresh();
        let nets = Nets { phi: fitted.network, deformation, frame: fitted.frame };
        let edges = Edges::new(&small.mesh);
        let offsets = nets.moved(small.mesh.vertices(), 0);
        let sight = scene.look(0, &small.mesh, &edges, &small.skin, &offsets, 0.1);
        for weights in [
            FieldsWeights { normals: 1.0, ..none },
            FieldsWeights { eikonal: 1.0, bending: 1.0, stay: 10.0, ..none },
            FieldsWeights { small: 1.0, along: 1.0, rigid: 0.01, mean: 1.0, smooth: 1.0, ..none },
        ] {
            let params = FieldsParams { weights, newton: 6, ..params() };
            let at = |nets: &Nets| {
                let step = Step {
                    scene: &scene,
                    nets,
                    start: &start,
                    params: &params,
                    vertices: small.mesh.vertices(),
                };
                let mut random = random_of(1, 0);
                step.terms(&mut sight.pixels.clone(), &sight.rims, &mut random)
            };
            let (terms, sums) = at(&nets);
            assert!(sums.loss > 0.0 && sums.rays.used > 50, "{:?}", sums.rays);
            let mut by_phi = vec![0.0; nets.phi.parameters().len()];
            let mut by_d = vec![0.0; nets.deformation.parameters().len()];
            terms.gradients(&nets, &mut by_phi, &mut by_d);
            // Along the gradient itself, of each network alone.
            for (which, gradient) in [&by_phi, &by_d].into_iter().enumerate() {
                let square: f64 = gradient.iter().map(|g| f64::from(*g).powi(2)).sum();
                if square == 0.0 {
                    continue;
                }
                // A change of 1 ‰ of the loss: with more, single rays are found or lost.
                let h = (0.001 * sums.loss / square) as f32;
                let [before, after] = [-h, h].map(|h| {
                    let mut nets = nets.clone();
                    let theta = match which {
                        0 => nets.phi.parameters_mut(),
                        _ => nets.deformation.parameters_mut(),
                    };
                    theta.iter_mut().zip(gradient).for_each(|(p, g)| *p += h * g);
                    nets.phi.refresh();
                    nets.deformation.refresh();
                    at(&nets).1
                });
                let slope = (after.loss - before.loss) / (2.0 * f64::from(h) * square);
                assert!((slope - 1.0).abs() < 0.1, "{weights:?}, network {which}: {slope}");
            }
        }
    }
}

#[test]
fn training_brings_the_template_to_the_clothes_and_resumes_with_the_same_bits() {
    let small = Small::new();
    let (capture, skeleton) = (&small.capture, &small.template.skeleton);
    let (surface, params) = (&small.surface, params());
    let (begin, read) = ((&small.mesh, &small.skin, &small.exact), SurfaceParams::default());
    let run = |path: Option<&Path>, monitor: &mut dyn Monitor| {
        fit_fields(capture, skeleton, surface, begin, None, &read, &params, path, monitor)
    };
    let found = run(None, &mut Silent).unwrap();

    // Closer to the clothes than the template, with d and without it.
    let still = vec![Vec::new(); 4];
    let before = small.error(&small.mesh, &still);
    let cells = ExtractParams { resolution: Resolution::Cell(0.02), ..Default::default() };
    let field = found.field().unwrap();
    let mesh = largest_piece(&extract(&field, &cells, &mut Silent).unwrap().mesh);
    let after = small.error(&mesh, &still);
    let moved = small.error(&mesh, &found.motion(mesh.vertices()).offsets);
    assert!(after < 0.5 * before && moved < 0.5 * before, "{before} {after} {moved}");
    let report = &found.report;
    let (first, last) = (report.rounds[0], *report.rounds.last().unwrap());
    assert_eq!((report.rounds.len(), last.steps), (3, 60));
    assert!(last.silhouette_mm < first.silhouette_mm, "{first:?} {last:?}");
    assert!(last.normal_degrees < first.normal_degrees && last.motion_mm > 0.0);
    let r = last.rays;
    assert_eq!(r.used + r.grazing + r.lost + r.contradicting, 20 * params.rays);
    assert!(r.used > 10 * params.rays && first.rays.grazing > 0, "{first:?} {last:?}");

    // Another number of threads, and a run that was stopped in its second round.
    let same = |other: &Fields| {
        other.phi.parameters() == found.phi.parameters()
            && other.deformation.parameters() == found.deformation.parameters()
    };
    let path = small.folder.path().join("state");
    let stopped = run(Some(&path), &mut |p: &Progress| {
        if p.stage == "fields" && p.done == 27 {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    assert!(matches!(stopped, Err(ReconstructError::Cancelled(_))));
    let mut stages = Vec::new();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let resumed = pool.install(|| {
        run(Some(&path), &mut |p: &Progress| {
            stages.push((p.stage.to_owned(), p.done));
            ControlFlow::Continue(())
        })
    });
    assert!(same(&resumed.unwrap()));
    let first = stages.iter().find(|s| s.0 == "fields").unwrap();
    assert!(first.1 == 20 && stages.iter().all(|s| s.0 != "phi"), "{first:?}");
    // A file of another run is left aside, a broken one is an error.
    let mut bytes = std::fs::read(&path).unwrap();
    let other = FieldsParams { seed: 2, steps: 1, ..params.clone() };
    let again = train(capture, &small.begin(), &read, &other, Some(&path), &mut Silent).unwrap();
    assert_eq!(again.report.rounds.len(), 1);
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let broken = run(Some(&path), &mut Silent);
    assert!(matches!(broken, Err(ReconstructError::BrokenCheckpoint { .. })));
}

#[test]
fn parameters_out_of_range_are_errors() {
    for usual in [FieldsParams::default(), FieldsParams::mlp()] {
        assert!(usual.validate().is_ok());
        let w = usual.weights;
        for (bad, name) in [
            (FieldsParams { rays: 0, ..usual.clone() }, "rays"),
            (FieldsParams { newton: 0, ..usual.clone() }, "newton"),
            (FieldsParams { refresh: 0, ..usual.clone() }, "refresh"),
            (
                FieldsParams { weights: FieldsWeights { small: -1.0, ..w }, ..usual.clone() },
                "weights.small",
            ),
            (
                FieldsParams { weights: FieldsWeights { reach: 0.0, ..w }, ..usual.clone() },
                "weights.reach",
            ),
            (
                FieldsParams {
                    phi_rate: Schedule { rate: -1.0, ..usual.phi_rate },
                    ..usual.clone()
                },
                "phi_rate.rate",
            ),
        ] {
            assert_eq!(bad.validate().unwrap_err().name, name);
        }
    }
}
