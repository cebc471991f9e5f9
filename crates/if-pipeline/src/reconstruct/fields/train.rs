//! The training of φ and d.

use super::checkpoint;
use super::nets::Nets;
use super::params::FieldsParams;
use super::report::{FieldsReport, FieldsRound};
use super::scene::{Pixel, Rim, Scene, Sight};
use super::start::{spread_embeddings, start_at};
use super::state::State;
use super::step::{Step, Sums, random_of};
use crate::build::BUILD;
use crate::capture::Capture;
use crate::reconstruct::checkpoint::{visit_input, visit_mesh};
use crate::reconstruct::error::ReconstructError;
use crate::reconstruct::motion::Motion;
use crate::reconstruct::observe::{Observation, observe_used};
use crate::reconstruct::params::SurfaceParams;
use crate::reconstruct::phi::fit_phi;
use crate::reconstruct::progress;
use crate::reconstruct::surface::Surface;
use if_body::{Skeleton, SkinWeights};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::{Monitor, Progress};
use if_mesh::sdf::MeshSdf;
use if_neural::adam::Adam;
use if_neural::deformation::DeformationNetwork;
use if_neural::mlp::DeformationConfig;
use if_neural::network::Network;
use if_neural::trainable::TrainableField;
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::path::Path;
use std::time::Instant;

/// Frames that are rasterised in parallel: bounds the memory of their images.
const TOGETHER: usize = 8;
/// Longest step of a vertex that follows φ, in metres: half a cell; and steps of a round.
const FOLLOW: Real = 0.004;
const FOLLOWS: usize = 6;
/// Silhouettes farther from the mask's border than this many times `weights.reach` are left out:
/// their pull is below a hundredth of the largest.
const FAR: Real = 3.0;

/// φ and d, and how they were found.
pub(super) struct Trained {
    pub(super) nets: Nets,
    pub(super) report: FieldsReport,
    /// Frames of the capture that were used.
    pub(super) used: Vec<usize>,
}

/// The start of the training: the fitted surface, and the closed mesh extracted from it.
pub(super) struct Begin<'a> {
    pub(super) skeleton: &'a Skeleton,
    pub(super) surface: &'a Surface,
    pub(super) mesh: &'a TriMesh,
    /// Its skinning weights.
    pub(super) skin: &'a SkinWeights,
    /// Its signed distance.
    pub(super) exact: &'a MeshSdf,
    /// The solved motion of the surface's vertices.
    pub(super) motion: Option<&'a Motion>,
}

/// See [`fit_fields`](super::fit_fields).
pub(super) fn train(
    capture: &Capture,
    begin: &Begin,
    read: &SurfaceParams,
    params: &FieldsParams,
    checkpoint: Option<&Path>,
    monitor: &mut dyn Monitor,
) -> Result<Trained, ReconstructError> {
    let Begin { skeleton, surface, mesh, skin, .. } = *begin;
    let frames = observe_used(capture, skeleton, &surface.report.skipped, read, monitor)?;
    let scene = Scene::new(capture.camera(), &frames, &surface.mesh, &surface.skin);
    let rates = [params.phi.network.fit_params().adam, params.deformation_adam];
    let key = checkpoint.map(|_| key(capture, begin, params, &frames));
    let known = match (checkpoint, &key) {
        (Some(path), Some(key)) => checkpoint::read(path, key, params.steps, rates)?,
        _ => None,
    };
    let mut state = match known {
        Some(state) => state,
        None => first_state(capture, begin, params, monitor)?,
    };

    let edges = Edges::new(mesh);
    let total = params.steps as usize;
    progress::report(monitor, "fields", (state.step as usize, total), None)?;
    let mut gradients = [
        vec![0.0; state.nets.phi.parameters().len()],
        vec![0.0; state.nets.deformation.parameters().len()],
    ];
    while state.step < params.steps {
        let start = Instant::now();
        follow(&state.nets, &mut state.vertices);
        let moved = mesh.with_vertices(state.vertices.clone())?;
        let reach = FAR * params.weights.reach;
        let Sight { mut pixels, rims } = sights(&scene, &state.nets, &moved, &edges, skin, reach);
        let mut sums = Sums::default();
        let end = params.steps.min((state.step / params.refresh + 1) * params.refresh);
        while state.step < end {
            let one = advance(&mut state, &scene, params, (&mut pixels, &rims), &mut gradients);
            sums.add(&one);
            let measures = [
                ("loss", one.loss),
                ("normal_degrees", one.normal_degrees()),
                ("silhouette_mm", one.silhouette_mm()),
            ];
            monitor.report(&Progress {
                done: state.step as usize,
                total: Some(total),
                measures: &measures,
                ..Progress::stage("fields")
            })?;
        }
        let round = sums.round(state.step, start.elapsed().as_secs_f64());
        state.nets.check(state.step)?;
        if !round.is_finite() {
            return Err(ReconstructError::FieldsDiverged { steps: state.step });
        }
        state.report.rounds.push(round);
        if let (Some(path), Some(key)) = (checkpoint, &key) {
            checkpoint::write(&state, path, key)?;
        }
    }
    let used = frames.iter().map(|f| f.frame).collect();
    Ok(Trained { nets: state.nets, report: state.report, used })
}

/// One step of both networks.
fn advance(
    state: &mut State,
    scene: &Scene,
    params: &FieldsParams,
    (pixels, rims): (&mut [Pixel], &[Rim]),
    [by_phi, by_deformation]: &mut [Vec<f32>; 2],
) -> Sums {
    let step =
        Step { scene, nets: &state.nets, start: &state.start, params, vertices: &state.vertices };
    let mut random = random_of(params.seed, state.step);
    let (terms, sums) = step.terms(pixels, rims, &mut random);
    terms.gradients(&state.nets, by_phi, by_deformation);
    if let (Network::Grid(_), Some(constant)) = (&state.nets.phi, by_phi.last_mut()) {
        // The constant of the grid encoding moves φ everywhere at once.
        *constant = 0.0;
    }
    let share = state.step as Real / params.steps as Real;
    let rate = params.phi_rate.rate(state.step, share) as f32;
    state.phi_adam.step(state.nets.phi.parameters_mut(), by_phi, rate);
    let rate = params.deformation_rate.rate(state.step, share) as f32;
    state.deformation_adam.step(state.nets.deformation.parameters_mut(), by_deformation, rate);
    state.nets.phi.refresh();
    state.nets.deformation.refresh();
    state.step += 1;
    sums
}

/// φ fitted to the start, and d to the solved motion; without one it is close to zero.
fn first_state(
    capture: &Capture,
    begin: &Begin,
    params: &FieldsParams,
    monitor: &mut dyn Monitor,
) -> Result<State, ReconstructError> {
    let fitted = fit_phi(begin.exact, &params.phi, monitor)?;
    let config = DeformationConfig { frames: capture.len(), ..params.deformation.clone() };
    let mut deformation = DeformationNetwork::new(&config, params.seed)?;
    spread_embeddings(&mut deformation, params.seed);
    if let Some(motion) = begin.motion.filter(|_| params.motion_steps > 0) {
        let solved = (motion, &begin.surface.mesh);
        start_at(&mut deformation, &fitted.frame, solved, params, monitor)?;
    }
    let (n, m) = (fitted.network.parameters().len(), deformation.parameters().len());
    let report = FieldsReport {
        phi_parameters: n,
        deformation_parameters: m,
        start_mm: fitted.report.mean_mm,
        rounds: Vec::new(),
    };
    Ok(State {
        step: 0,
        phi_adam: Adam::new(params.phi.network.fit_params().adam, n)?,
        deformation_adam: Adam::new(params.deformation_adam, m)?,
        start: fitted.network.clone(),
        nets: Nets { phi: fitted.network, deformation, frame: fitted.frame },
        vertices: begin.mesh.vertices().to_vec(),
        report,
    })
}

/// Moves vertices onto φ = 0, along ∇φ.
fn follow(nets: &Nets, vertices: &mut [Point]) {
    for _ in 0..FOLLOWS {
        let samples = nets.field(vertices);
        for (p, s) in vertices.iter_mut().zip(&samples) {
            let step = s.gradient * (-s.distance / s.gradient.norm_squared());
            if step.norm().is_finite() {
                *p += step * (FOLLOW / step.norm()).min(1.0);
            }
        }
    }
}

/// What all frames show of a mesh that is moved by d.
fn sights(
    scene: &Scene,
    nets: &Nets,
    mesh: &TriMesh,
    edges: &Edges,
    skin: &SkinWeights,
    reach: Real,
) -> Sight {
    let mut all = Sight::default();
    let numbers: Vec<usize> = (0..scene.frames.len()).collect();
    for group in numbers.chunks(TOGETHER) {
        let seen: Vec<Sight> = group
            .par_iter()
            .map(|k| {
                let offsets = nets.moved(mesh.vertices(), scene.frames[*k].frame);
                scene.look(*k, mesh, edges, skin, &offsets, reach)
            })
            .collect();
        for sight in seen {
            all.pixels.extend(sight.pixels);
            all.rims.extend(sight.rims);
        }
    }
    all
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.loss += other.loss;
        self.angle += other.angle;
        let (sum, one) = (&mut self.rays, other.rays);
        sum.used += one.used;
        sum.grazing += one.grazing;
        sum.lost += one.lost;
        sum.contradicting += one.contradicting;
        for (sum, one) in [
            (&mut self.silhouette, other.silhouette),
            (&mut self.eikonal, other.eikonal),
            (&mut self.motion, other.motion),
            (&mut self.mean_motion, other.mean_motion),
        ] {
            *sum = (sum.0 + one.0, sum.1 + one.1);
        }
    }

    fn normal_degrees(&self) -> Real {
        self.angle.to_degrees() / self.rays.used.max(1) as Real
    }

    fn silhouette_mm(&self) -> Real {
        root_mm(self.silhouette)
    }

    fn round(&self, steps: u64, seconds: Real) -> FieldsRound {
        FieldsRound {
            steps,
            normal_degrees: self.normal_degrees(),
            silhouette_mm: self.silhouette_mm(),
            eikonal: self.eikonal.0 / self.eikonal.1.max(1) as Real,
            motion_mm: root_mm(self.motion),
            mean_motion_mm: root_mm(self.mean_motion),
            rays: self.rays,
            seconds,
        }
    }
}

/// The root of a mean of squares in m², in millimetres.
fn root_mm((sum, count): (Real, usize)) -> Real {
    1e3 * (sum / count.max(1) as Real).sqrt()
}

/// A hash of everything that the state depends on.
fn key(
    capture: &Capture,
    begin: &Begin,
    params: &FieldsParams,
    frames: &[Observation],
) -> [u8; 32] {
    // A rebuilt program begins anew.
    let mut hash = Sha256::new_with_prefix(BUILD);
    // All parameters: the learning rates depend on the number of steps, too.
    hash.update(format!("{params:?}"));
    let mut number = |x: Real| hash.update(x.to_le_bytes());
    number(capture.len() as Real);
    visit_mesh(begin.mesh, &mut number);
    for d in begin.motion.iter().flat_map(|m| m.offsets.iter().flatten()) {
        d.iter().for_each(|x| number(*x));
    }
    let Surface { mesh, skin, .. } = begin.surface;
    visit_input(capture, (mesh, skin), frames, &mut number);
    hash.finalize().into()
}

/// d of all frames of the capture at points.
pub(super) fn motion_of(nets: &Nets, points: &[Point]) -> Vec<Vec<Vector>> {
    (0..nets.deformation.config().frames).map(|frame| nets.moved(points, frame)).collect()
}
