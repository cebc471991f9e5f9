//! Refinement of poses that are estimates.

mod chain;
mod constant_camera;
mod gauge;
mod normal_image;
mod params;
mod report;
mod rotations;
mod terms;
mod twists;

pub use params::PoseParams;
pub use report::{JointCorrection, PoseReport, PoseRound};

use super::error::ReconstructError;
use super::evidence::gather;
use super::figure::Figure;
use super::observe::Observation;
use super::params::SurfaceParams;
use super::quality::Residual;
use super::report::SurfaceReport;
use super::start::{Start, start};
use super::surface::{BYTES_A_PIXEL, check_input, read_frames, without_elsewhere};
use super::{progress, quality, refine};
use crate::capture::Capture;
use chain::{Chain, FrameTerms};
use gauge::SkinVotes;
use if_body::{Pose, Skeleton, TemplateBody};
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::monitor::Monitor;
use if_mesh::camera::Camera;
use nalgebra::Rotation3;
use normal_image::NormalImage;
use rayon::prelude::*;
use terms::{Residuals, Subject, View, add_terms};
use twists::Twists;

/// Refined poses.
#[derive(Clone, Debug)]
pub struct RefinedPoses {
    /// The pose of each frame.
    pub poses: Vec<Pose>,
    /// The camera, turned if its orientation is off by a constant error.
    pub camera: Camera,
    /// Report.
    pub report: PoseReport,
}

/// Steps of the poses by priors and smoothness alone, before images are used: two converge, since
/// only the logarithm is not linear.
const FIRST_STEPS: usize = 3;
/// Rounds of the surface before the first step of the poses.
const FIRST_ROUNDS: usize = 2;
/// The round before which loose clothes are looked for. Before, poses may be so far off that limbs
/// lie beside the masks as skirts do.
const LOOSE_ROUND: usize = 2;
/// Bytes per pixel of a frame beside those of the surface: blurred normals, and labels.
const BLURRED: u64 = 12 + 1;
/// Of how many frames one is held out of the surface, to judge it.
const HELD_OUT: usize = 6;
/// Fewer frames are all needed.
const LEAST_FRAMES: usize = 12;
/// A turn of the camera that moves the person by less, in metres, is never worth it: half a pixel.
const LEAST_TURN: Real = 0.003;
/// Turn in degrees and shift in millimetres of a step below which the poses have converged: a tenth
/// of what remains at the smallest stated noise.
const SETTLED: (Real, Real) = (0.02, 0.1);

/// Refines the poses of a capture, whose errors `params` state, by its masks, labels and normals.
///
/// ```text
/// poses ← least of priors and accelerations
/// camera ← turned and zoomed, where the template is off the masks in all frames   constant_camera.rs
/// for each round
///     surface: a round of fit_surface, two at first
///     X ← the template where frames vote for skin, the surface elsewhere
///     steps of Gauss–Newton for all poses at once, X fixed: silhouettes, normals, priors, accelerations
/// ```
///
/// One frame in six is not seen by the surface, only its pose is fitted: its residual is that of a
/// surface that could not adapt to it. From fewer than 12 frames none is held out.
///
/// A joint's constant error and a surface that compensates it look alike: the template at skin is the
/// gauge, so its shape should be the person's. Frames without usable images follow from their
/// neighbours in time. What images cannot show (twists along bones, fingers) keeps its prior.
///
/// Stages: `read`, `start`, and `poses` with the measure `silhouette_mm`.
///
/// # Errors
///
/// [`ReconstructError`].
pub fn refine_poses(
    capture: &Capture,
    template: &TemplateBody,
    read: &SurfaceParams,
    params: &PoseParams,
    monitor: &mut dyn Monitor,
) -> Result<RefinedPoses, ReconstructError> {
    read.validate()?;
    params.validate()?;
    check_input(capture, template, read, BYTES_A_PIXEL + BLURRED)?;
    let given: Vec<Pose> = (0..capture.len()).map(|k| capture.pose(k).clone()).collect();
    let numbers: Vec<u32> = (0..capture.len()).map(|k| capture.number(k)).collect();
    let chain = Chain::new(&given, &numbers, params);
    let mut poses = given.clone();
    let no_images = vec![None; poses.len()];
    for _ in 0..FIRST_STEPS {
        chain.step(&mut poses, &no_images).ok_or(ReconstructError::PosesDiverged { round: 0 })?;
    }

    let mut scene = Scene::new(capture, template, read, params, &poses, monitor)?;
    let mut report = PoseReport {
        degrees: params.sigma.degrees,
        translation_mm: 1e3 * params.sigma.translation,
        unused: scene.unused(capture.len()),
        camera_zoom: scene.capture.camera().intrinsics()[(0, 0)]
            / capture.camera().intrinsics()[(0, 0)],
        camera_degrees: angle_between(capture.camera(), scene.capture.camera()),
        ..Default::default()
    };
    let mut measure = None;
    for round in 0..params.rounds {
        progress::report(monitor, "poses", (round, params.rounds), measure)?;
        let reach = (params.reach * 0.5f64.powi(round as i32)).max(params.least_reach);
        let fresh = round == 0 || (round == LOOSE_ROUND && scene.fill_loose(template, monitor)?);
        for _ in 0..if fresh { FIRST_ROUNDS } else { 1 } {
            scene.fit_surface(reach, round)?;
        }
        let done = scene.fit_poses(&chain, &mut poses, reach, params, round)?;
        measure = Some(("silhouette_mm", done.silhouette_mm));
        report.rounds.push(done);
        if round >= LOOSE_ROUND && done.turn_degrees < SETTLED.0 && done.shift_mm < SETTLED.1 {
            break;
        }
    }
    report.held_out = scene.held_out();
    report.joints = corrections(&template.skeleton, &given, &poses)?;
    // Everything is done: cancelling has no effect any more.
    let _ = progress::report(monitor, "poses", (params.rounds, params.rounds), measure);
    Ok(RefinedPoses { poses, camera: scene.capture.camera().clone(), report })
}

/// The images, and the surface so far.
struct Scene<'a> {
    /// With the refined camera.
    capture: Capture,
    skeleton: &'a Skeleton,
    read: SurfaceParams,
    /// Usable frames, posed as the poses are now; those that the surface does not see are last.
    frames: Vec<Observation>,
    /// The number of frames that the surface sees.
    fitted: usize,
    normals: Vec<NormalImage>,
    labels: Vec<Vec<u8>>,
    /// The surface before the fit: the template.
    start: Start,
    mesh: if_core::mesh::TriMesh,
    edges: Edges,
}

impl<'a> Scene<'a> {
    fn new(
        capture: &'a Capture,
        template: &'a TemplateBody,
        read: &SurfaceParams,
        params: &PoseParams,
        poses: &[Pose],
        monitor: &mut dyn Monitor,
    ) -> Result<Self, ReconstructError> {
        let mut report = SurfaceReport { frames: capture.len(), ..Default::default() };
        let mut frames = read_frames(capture, template, read, &mut report, monitor)?;
        let skeleton = &template.skeleton;
        place(&mut frames, skeleton, poses)?;
        let mut capture = capture.clone();
        if params.camera_degrees > 0.0 {
            let (degrees, shift) = (params.camera_degrees, params.sigma.translation);
            let shift = shift.max(LEAST_TURN);
            let found =
                constant_camera::corrected(capture.camera(), template, &frames, degrees, shift);
            if let Some(camera) = found {
                let turn = camera.rotation().transpose() * capture.camera().rotation();
                frames.par_iter_mut().for_each(|frame| frame.turn_normals(&turn));
                capture = capture.with_camera(camera);
            }
        }
        let camera = capture.camera();
        let edges = Edges::new(&template.mesh);
        let seen = gather(&template.mesh, &edges, &template.skin, camera, &frames, params.reach);
        let frames = without_elsewhere(frames, &seen.overlap, read.least_overlap, &mut report);
        if frames.is_empty() {
            return Err(report.nothing_seen(&capture));
        }
        let (frames, fitted) = held_out_last(frames);
        let start = Start::template(template);
        let normals = frames
            .par_iter()
            .map(|f| {
                let (width, height) = (camera.width(), camera.height());
                NormalImage::new(&f.normals, width, height, params.normal_blur)
            })
            .collect();
        let labels: Result<Vec<_>, _> =
            frames.par_iter().map(|f| capture.label_image(f.frame)).collect();
        let (mesh, edges) = (start.mesh.clone(), Edges::new(&start.mesh));
        Ok(Self {
            capture,
            skeleton,
            read: read.clone(),
            frames,
            fitted,
            normals,
            labels: labels?,
            start,
            mesh,
            edges,
        })
    }

    /// The frames of a capture of `count` whose images are not used.
    fn unused(&self, count: usize) -> Vec<usize> {
        let used = |k: &usize| self.frames.iter().any(|f| f.frame == *k);
        (0..count).filter(|k| !used(k)).collect()
    }

    /// Starts the surface again, with loose clothes, if there are any.
    fn fill_loose(
        &mut self,
        template: &TemplateBody,
        monitor: &mut dyn Monitor,
    ) -> Result<bool, ReconstructError> {
        progress::report(monitor, "start", (0, 1), None)?;
        let start = start(&self.capture, template, &self.read, &self.frames, monitor)?;
        let loose = start.report.filled.is_some();
        if loose {
            (self.mesh, self.edges) = (start.mesh.clone(), Edges::new(&start.mesh));
            self.read = self.read.in_loose_clothes();
            self.start = start;
        }
        Ok(loose)
    }

    /// One round of the surface.
    fn fit_surface(&mut self, reach: Real, round: usize) -> Result<(), ReconstructError> {
        let (skin, camera) = (&self.start.skin, self.capture.camera());
        let seen = &self.frames[..self.fitted];
        let evidence = gather(&self.mesh, &self.edges, skin, camera, seen, reach);
        let (moved, _) =
            refine::step(&self.start.mesh, &self.mesh, &self.edges, &evidence, &self.read)
                .ok_or(ReconstructError::SurfaceDiverged { round })?;
        self.mesh = self.mesh.with_vertices(moved)?;
        Ok(())
    }

    /// The residual of the frames that the surface does not see; `None` without any.
    fn held_out(&self) -> Option<Residual> {
        let (skin, camera) = (&self.start.skin, self.capture.camera());
        let frames = Some(&self.frames[self.fitted..]).filter(|f| !f.is_empty())?;
        let quality =
            quality::measure(&self.mesh, &self.edges, skin, self.skeleton, camera, frames);
        Some(quality.all)
    }

    /// Steps of the poses with the surface fixed.
    fn fit_poses(
        &mut self,
        chain: &Chain,
        poses: &mut [Pose],
        reach: Real,
        params: &PoseParams,
        round: usize,
    ) -> Result<PoseRound, ReconstructError> {
        let (skin, camera) = (&self.start.skin, self.capture.camera());
        let none = || SkinVotes::new(self.mesh.vertices().len());
        let count = |mut votes: SkinVotes, (frame, labels): (&Observation, &Vec<u8>)| {
            let figure = Figure::new(&self.mesh, &self.edges, skin, camera, &frame.transforms);
            votes.add(&figure, labels);
            votes
        };
        let frames = self.frames.par_iter().zip(&self.labels);
        // Whole numbers: the same sums on any number of threads.
        let votes = frames.fold(none, count).reduce(none, SkinVotes::joined);
        let tied = votes.skin(params.skin);
        let (mesh, at_steps) = gauge::tied(&self.start.mesh, &self.mesh, &tied);
        let subject = Subject { skin, points: mesh.vertices() };
        let mut done = PoseRound {
            tied: tied.iter().filter(|t| **t).count() as Real / tied.len().max(1) as Real,
            ..Default::default()
        };
        for _ in 0..params.steps {
            let terms: Vec<_> = self
                .frames
                .par_iter()
                .zip(&self.normals)
                .map(|(frame, normals)| {
                    let figure = Figure::new(&mesh, &self.edges, skin, camera, &frame.transforms)
                        .with_normals(&at_steps);
                    let view = View { outside: &frame.outside, normals };
                    let mut twists = Twists::new(self.skeleton.len());
                    let transforms = &frame.transforms;
                    let residuals =
                        add_terms(&mut twists, &figure, &view, &subject, transforms, reach, params);
                    let frames = self
                        .skeleton
                        .frames(&poses[frame.frame])
                        .map_err(|source| ReconstructError::Pose { frame: frame.frame, source })?;
                    Ok((twists.into_pose(self.skeleton, &frames), residuals))
                })
                .collect::<Result<_, ReconstructError>>()?;
            let mut images: Vec<FrameTerms> = vec![None; poses.len()];
            let mut sum = Residuals::default();
            for (frame, (equations, residuals)) in self.frames.iter().zip(terms) {
                images[frame.frame] = Some(equations);
                sum.add(&residuals);
            }
            let (turn, shift) =
                chain.step(poses, &images).ok_or(ReconstructError::PosesDiverged { round })?;
            place(&mut self.frames, self.skeleton, poses)?;
            done.silhouette_mm = 1e3 * sum.silhouette();
            done.normal_degrees = sum.normal().to_degrees();
            (done.turn_degrees, done.shift_mm) = (turn.to_degrees(), 1e3 * shift);
        }
        Ok(done)
    }
}

/// The angle between the orientations of two cameras, in degrees; 0 for equal ones.
fn angle_between(a: &Camera, b: &Camera) -> Real {
    if a.rotation() == b.rotation() {
        return 0.0;
    }
    Rotation3::from_matrix_unchecked(a.rotation() * b.rotation().transpose()).angle().to_degrees()
}

/// Puts every [`HELD_OUT`]-th frame last, if there are enough. Returns the number of the others.
fn held_out_last(frames: Vec<Observation>) -> (Vec<Observation>, usize) {
    if frames.len() < LEAST_FRAMES {
        let count = frames.len();
        return (frames, count);
    }
    let (mut fitted, mut held_out) = (Vec::new(), Vec::new());
    for (k, frame) in frames.into_iter().enumerate() {
        if k % HELD_OUT == HELD_OUT / 2 { &mut held_out } else { &mut fitted }.push(frame);
    }
    let count = fitted.len();
    fitted.append(&mut held_out);
    (fitted, count)
}

/// Poses the observations.
fn place(
    frames: &mut [Observation],
    skeleton: &Skeleton,
    poses: &[Pose],
) -> Result<(), ReconstructError> {
    for frame in frames {
        frame.transforms = skeleton
            .transforms(&poses[frame.frame])
            .map_err(|source| ReconstructError::Pose { frame: frame.frame, source })?;
    }
    Ok(())
}

/// How far each joint was corrected.
fn corrections(
    skeleton: &Skeleton,
    given: &[Pose],
    refined: &[Pose],
) -> Result<Vec<JointCorrection>, ReconstructError> {
    let mut joints: Vec<JointCorrection> = skeleton
        .names()
        .map(|name| JointCorrection { name: name.into(), ..Default::default() })
        .collect();
    let count = given.len().max(1) as Real;
    for (frame, (a, b)) in given.iter().zip(refined).enumerate() {
        let place =
            |pose| skeleton.frames(pose).map_err(|source| ReconstructError::Pose { frame, source });
        let (from, to) = (place(a)?, place(b)?);
        for (k, joint) in joints.iter_mut().enumerate() {
            let turn = a.rotations[k].angle_to(&b.rotations[k]).to_degrees();
            let moved = 1e3 * (from[k].translation.vector - to[k].translation.vector).norm();
            joint.turn_degrees += turn * turn / count;
            joint.moved_mm += moved / count;
            joint.moved_most_mm = joint.moved_most_mm.max(moved);
        }
    }
    joints.iter_mut().for_each(|j| j.turn_degrees = j.turn_degrees.sqrt());
    Ok(joints)
}
