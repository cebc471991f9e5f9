//! From a capture to garments, in one call.

use super::canonical::{FloodedField, carried_weights, largest_piece};
use super::crumpled;
use super::error::ReconstructError;
use super::fields::{Fields, FieldsParams, fit_fields};
use super::garments::{ClothedPerson, Garment, GarmentParams, Garments, find_garments};
use super::motion::{
    MeshMotion, MotionNetwork, MotionNetworkParams, MotionParams, distil_motion, fit_motion,
};
use super::params::SurfaceParams;
use super::phi::{PhiNetwork, PhiParams, fit_phi};
use super::poses::{PoseParams, RefinedPoses, refine_poses};
use super::progress;
use super::surface::{Surface, fit_surface};
use super::underside::Underside;
use super::whole_report::{GarmentReport, LabelReport, ReconstructReport, Seconds};
use crate::capture::{Capture, CaptureError};
use if_body::{Pose, SkinWeights, TemplateBody};
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
use if_mesh::baked::{BakeParams, Baked};
use if_mesh::camera::Camera;
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::sdf::MeshSdf;
use if_neural::field::NeuralField;
use if_neural::network::Network;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Parameters of [`reconstruct`].
#[derive(Clone, Debug)]
pub struct ReconstructParams {
    /// Refinement of the poses; skipped if its `sigma` is exact. `None`: the defaults, for the error
    /// that the capture states, or for that of an estimator if it states none.
    pub poses: Option<PoseParams>,
    /// The fit of the surface.
    pub surface: SurfaceParams,
    /// Cell size of the extraction, in metres: about the mean edge length of the canonical mesh.
    pub cell: Real,
    /// φ and d as networks, trained on the images from the fitted surface: the paper's own route.
    /// The canonical mesh is then that of φ, and the motion that of d. `None` keeps the surface.
    pub fields: Option<FieldsParams>,
    /// The motion of single frames; `None` skips this step. With `fields` it is the start of d.
    pub motion: Option<MotionParams>,
    /// The network of that motion; `None` skips it. Ignored without `motion`.
    pub motion_network: Option<MotionNetworkParams>,
    /// The baking of φ round each garment ([`Baked::part`]); `None` skips it.
    pub bake: Option<BakeParams>,
    /// The network of φ; `None` skips it. Ignored with `fields`.
    pub phi: Option<PhiParams>,
    /// Votes, cuts and clean-up of the garments.
    pub garments: GarmentParams,
}

impl Default for ReconstructParams {
    /// Cells of 8 mm, as small as a pixel of the sample captures; no motion of single frames, and
    /// no φ: garments are found and resolved without it.
    fn default() -> Self {
        Self {
            poses: None,
            surface: SurfaceParams::default(),
            cell: 0.008,
            fields: None,
            motion: None,
            motion_network: None,
            bake: None,
            phi: None,
            garments: GarmentParams::default(),
        }
    }
}

impl ReconstructParams {
    /// Checks the ranges. [`reconstruct`] does this before it starts.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let in_range = (5e-4..=0.1).contains(&self.cell);
        ParameterError::check("cell", self.cell, in_range, "from 0.0005 to 0.1 m")?;
        let group = |name: &'static str| move |e: ParameterError| e.within(name);
        self.surface.validate().map_err(group("surface"))?;
        let poses = self.poses.as_ref().map_or(Ok(()), PoseParams::validate);
        poses.map_err(group("poses"))?;
        let fields = self.fields.as_ref().map_or(Ok(()), FieldsParams::validate);
        fields.map_err(group("fields"))?;
        let motion = self.motion.as_ref().map_or(Ok(()), MotionParams::validate);
        motion.map_err(group("motion"))?;
        let network = self.motion_network.as_ref().map_or(Ok(()), MotionNetworkParams::validate);
        network.map_err(group("motion_network"))?;
        self.bake.as_ref().map_or(Ok(()), BakeParams::validate).map_err(group("bake"))?;
        self.phi.as_ref().map_or(Ok(()), PhiParams::validate).map_err(group("phi"))?;
        self.garments.validate().map_err(group("garments"))
    }
}

/// A person in clothes, and the clothes.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The clothed person in canonical space: one closed mesh for all frames.
    pub mesh: TriMesh,
    /// Its skinning weights.
    pub skin: SkinWeights,
    /// The refined pose of each frame, if poses are estimates.
    pub poses: Option<Vec<Pose>>,
    /// The camera that those go with.
    pub camera: Option<Camera>,
    /// The label of each of its vertices.
    pub labels: Vec<u8>,
    /// φ and d as networks, if they were trained.
    pub fields: Option<Fields>,
    /// The motion d of its vertices in single frames, if requested or trained.
    pub motion: Option<MeshMotion>,
    /// That motion as a network, if requested.
    pub motion_network: Option<MotionNetwork>,
    /// φ, the signed distance of the mesh, as a network, if requested.
    pub phi: Option<PhiNetwork>,
    /// The garments, inner to outer.
    pub garments: Vec<Garment>,
    /// Report.
    pub report: ReconstructReport,
}

impl Reconstruction {
    /// The capture with the poses and the camera that were found: those that all else here goes with.
    ///
    /// # Errors
    ///
    /// It has other joints.
    ///
    /// # Panics
    ///
    /// If it has another number of frames, or pictures of another size.
    pub fn corrected(&self, capture: &Capture) -> Result<Capture, CaptureError> {
        match (&self.poses, &self.camera) {
            (Some(poses), Some(camera)) => corrected(capture, poses, camera),
            _ => Ok(capture.clone()),
        }
    }
}

/// The capture with other poses and another camera.
fn corrected(capture: &Capture, poses: &[Pose], camera: &Camera) -> Result<Capture, CaptureError> {
    Ok(capture.with_poses(poses.to_vec())?.with_camera(camera.clone()))
}

/// Reconstructs a person in clothes and each garment from a capture.
///
/// ```text
/// poses     ← refined by images, if they are estimates                       refine_poses
/// surface   ← the template, fitted to masks and normals                      fit_surface
/// canonical ← zero set of its signed distance, loose clothes laid smooth; weights
/// fields    ← φ and d, trained from there on the images, if requested        fit_fields
///             canonical ← zero set of φ
/// motion    ← d of each frame, and as a network, if requested                fit_motion, distil_motion
/// φ         ← the signed distance of the mesh as a network, if requested     fit_phi
/// garments  ← labels voted by all frames; cut, cleaned                       find_garments
///             φ round each, baked, if requested
/// ```
///
/// `checkpoint` is that of [`fit_surface`], and beside it [`fields_checkpoint`] that of
/// [`fit_fields`]; the other stages are repeated, refined poses too. The monitor receives the stages
/// of all calls, and `extract`.
///
/// # Errors
///
/// [`ReconstructError`].
pub fn reconstruct(
    capture: &Capture,
    template: &TemplateBody,
    params: &ReconstructParams,
    checkpoint: Option<&Path>,
    monitor: &mut dyn Monitor,
) -> Result<Reconstruction, ReconstructError> {
    params.validate()?;
    // What is fitted must have an inside: told of before the work, not after it.
    MeshSdf::closed(&template.mesh).map_err(ReconstructError::TemplateInside)?;
    let skeleton = &template.skeleton;
    let mut seconds = Seconds::default();
    let mut lap = Lap::start();

    let refined = refined_poses(capture, template, params, monitor)?;
    let corrected = match &refined {
        Some(refined) => Some(corrected(capture, &refined.poses, &refined.camera)?),
        None => None,
    };
    let capture = corrected.as_ref().unwrap_or(capture);
    lap.end(&mut seconds.poses);

    let surface = fit_surface(capture, template, &params.surface, checkpoint, monitor)?;
    lap.end(&mut seconds.surface);

    let mut solved = None;
    if let Some(p) = &params.motion {
        solved = Some(fit_motion(capture, skeleton, &surface, &params.surface, p, monitor)?);
    }
    lap.end(&mut seconds.motion);

    let mut canonical = canonical(&surface, template, params, monitor)?;
    lap.end(&mut seconds.extract);

    let mut trained = None;
    if let Some(p) = &params.fields {
        let begin = (&canonical.mesh, &canonical.skin, &canonical.exact);
        let state = checkpoint.map(fields_checkpoint);
        let read = &params.surface;
        let fields = fit_fields(
            capture,
            skeleton,
            &surface,
            begin,
            solved.as_ref(),
            read,
            p,
            state.as_deref(),
            monitor,
        )?;
        let field = fields.field()?;
        canonical = of_field(&field, &surface, template, params, monitor)?;
        trained = Some((fields, field));
    }
    let Canonical { mesh, skin, exact } = canonical;
    lap.end(&mut seconds.fields);

    let motion = match (&trained, solved) {
        (Some((fields, _)), _) => Some(MeshMotion::of_vertices(fields.motion(mesh.vertices()))),
        (None, Some(motion)) => Some(MeshMotion::new(motion, &surface.mesh, mesh.vertices())),
        (None, None) => None,
    };

    let motion_network = match (&motion, &params.motion_network) {
        (Some(motion), Some(p)) if trained.is_none() => {
            Some(distil_motion(motion.motion(), &surface.mesh, p, monitor)?)
        }
        _ => None,
    };
    lap.end(&mut seconds.motion_network);

    let phi = match (&trained, &params.phi) {
        (None, Some(p)) => Some(fit_phi(&exact, p, monitor)?),
        _ => None,
    };
    lap.end(&mut seconds.phi);

    // What is read from here on is the trained φ, if there is one.
    let field: &dyn SignedDistance = match &trained {
        Some((_, field)) => field,
        None => &exact,
    };
    let underside = Underside::of(&surface, template, capture, (&mesh, &skin))?;
    let person = ClothedPerson {
        skeleton,
        mesh: &mesh,
        skin: &skin,
        field,
        motion: motion.as_ref(),
        underside: underside.as_ref(),
        skipped: &surface.report.skipped,
    };
    let Garments { labels, votes, shown, masks_beyond, mut garments, missing } =
        find_garments(capture, &person, &params.garments, monitor)?;
    lap.end(&mut seconds.garments);

    if let Some(params) = &params.bake {
        for garment in &mut garments {
            garment.phi = Some(Baked::part(field, &garment.mesh.aabb(), params, monitor)?);
        }
    }
    lap.end(&mut seconds.bake);

    let (found, pose_report) = refined.map(|r| ((r.poses, r.camera), r.report)).unzip();
    let (poses, camera) = found.unzip();
    let report = ReconstructReport {
        poses: pose_report,
        surface: surface.report,
        fields: trained.as_ref().map(|(fields, _)| fields.report.clone()),
        vertices: mesh.vertices().len(),
        triangles: mesh.triangles().len(),
        labels: LabelReport::of(&votes, (shown, masks_beyond), capture),
        motion: motion.as_ref().map(|m| m.motion().report.clone()),
        motion_network: motion_network.as_ref().map(|n| n.report),
        phi: phi.as_ref().map(|p| p.report),
        garments: garments.iter().map(GarmentReport::of).collect(),
        missing,
        seconds,
    };
    let report = report.numbered(capture);
    let fields = trained.map(|(fields, _)| fields);
    Ok(Reconstruction {
        mesh,
        skin,
        poses,
        camera,
        labels,
        fields,
        motion,
        motion_network,
        phi,
        garments,
        report,
    })
}

/// Poses and camera by the images; `None` if they are exact.
fn refined_poses(
    capture: &Capture,
    template: &TemplateBody,
    params: &ReconstructParams,
    monitor: &mut dyn Monitor,
) -> Result<Option<RefinedPoses>, ReconstructError> {
    let stated = || PoseParams::of(capture.pose_sigma().unwrap_or_default());
    let mut poses = params.poses.clone().unwrap_or_else(stated);
    poses.camera_degrees = capture.camera_sigma_degrees().unwrap_or(poses.camera_degrees);
    if poses.sigma.is_exact() {
        return Ok(None);
    }
    refine_poses(capture, template, &params.surface, &poses, monitor).map(Some)
}

/// The checkpoint of [`fit_fields`] beside that of the surface: its name with `.fields` after it.
pub fn fields_checkpoint(surface: &Path) -> PathBuf {
    let mut name = surface.as_os_str().to_owned();
    name.push(".fields");
    name.into()
}

/// The canonical mesh.
struct Canonical {
    mesh: TriMesh,
    skin: SkinWeights,
    /// Its signed distance.
    exact: MeshSdf,
}

/// Extracts one closed mesh from the fitted surface, which may intersect itself.
fn canonical(
    surface: &Surface,
    template: &TemplateBody,
    params: &ReconstructParams,
    monitor: &mut dyn Monitor,
) -> Result<Canonical, ReconstructError> {
    progress::report(monitor, "extract", (0, 2), None)?;
    let flooded = FloodedField::new(&surface.mesh).map_err(ReconstructError::Inside)?;
    let cells = ExtractParams {
        region: Some(surface.mesh.aabb().inflated(params.cell)),
        resolution: Resolution::Cell(params.cell),
        // Where the surface intersects itself gradients are discontinuous: vertices stay on the
        // edges of their cells.
        newton: 0,
        ..ExtractParams::default()
    };
    let mut mesh = largest_piece(&extract(&flooded, &cells, monitor)?.mesh);
    if surface.report.start.filled.is_some() {
        mesh = crumpled::smoothed(&mesh);
    }
    with_weights(mesh, surface, template, monitor)
}

/// Extracts the canonical mesh from the trained φ.
fn of_field(
    field: &NeuralField<Network>,
    surface: &Surface,
    template: &TemplateBody,
    params: &ReconstructParams,
    monitor: &mut dyn Monitor,
) -> Result<Canonical, ReconstructError> {
    progress::report(monitor, "extract", (0, 2), None)?;
    let cells = ExtractParams {
        region: field.bounds().map(|b| b.inflated(params.cell)),
        resolution: Resolution::Cell(params.cell),
        ..ExtractParams::default()
    };
    let mesh = largest_piece(&extract(field, &cells, monitor)?.mesh);
    with_weights(mesh, surface, template, monitor)
}

/// A canonical mesh with the weights of the fitted surface.
fn with_weights(
    mesh: TriMesh,
    surface: &Surface,
    template: &TemplateBody,
    monitor: &mut dyn Monitor,
) -> Result<Canonical, ReconstructError> {
    let joints = template.skeleton.len();
    let skin = carried_weights(&surface.mesh, &surface.skin, joints, mesh.vertices());
    progress::report(monitor, "extract", (1, 2), None)?;
    let exact = MeshSdf::closed(&mesh).map_err(ReconstructError::Inside)?;
    Ok(Canonical { mesh, skin, exact })
}

/// Measures consecutive stages.
struct Lap(Instant);

impl Lap {
    fn start() -> Self {
        Self(Instant::now())
    }

    /// Stores the seconds since the last call, and starts the next stage.
    fn end(&mut self, seconds: &mut Real) {
        *seconds = self.0.elapsed().as_secs_f64();
        self.0 = Instant::now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_mesh::cleanup::{CleanupParams, FillParams};
    use if_mesh::labels::CutParams;
    use if_neural::sampling::SamplingParams;

    #[test]
    fn crumpled_places_of_loose_clothes_are_laid_smooth() {
        let ball = if_core::shapes::meshes::icosphere(0.3, 4);
        let n = ball.vertices().len();
        let skin = SkinWeights::new(vec![[0; 4]; n], vec![[1.0, 0.0, 0.0, 0.0]; n], 1).unwrap();
        let at = if_core::math::Point::origin();
        let joint = if_body::Joint { name: "all".into(), parent: None, head: at, tail: at };
        let skeleton = if_body::Skeleton::new(vec![joint]).unwrap();
        let template = TemplateBody { mesh: ball.clone(), skin: skin.clone(), skeleton };
        let crumple = |(k, p): (usize, &if_core::math::Point)| match p.y > 0.2 {
            true => p + p.coords * (0.05 * ((k * 37 % 11) as Real / 5.0 - 1.0)),
            false => *p,
        };
        let rough = ball.vertices().iter().enumerate().map(crumple).collect();
        let mesh = ball.with_vertices(rough).unwrap();
        let mut surface = Surface { mesh, skin, report: Default::default() };
        let params = ReconstructParams { cell: 0.015, ..Default::default() };
        let is_smooth = |surface: &Surface| {
            let silent = &mut if_core::monitor::Silent;
            let found = canonical(surface, &template, &params, silent).unwrap().mesh;
            crumpled::smoothed(&found).vertices() == found.vertices()
        };
        assert!(!is_smooth(&surface), "what does not hang loose keeps its shape");
        surface.report.start.filled = Some(Default::default());
        assert!(is_smooth(&surface));
    }

    #[test]
    fn the_parameters_of_all_stages_are_validated() {
        let good = ReconstructParams {
            motion: Some(MotionParams::default()),
            motion_network: Some(MotionNetworkParams::default()),
            ..Default::default()
        };
        assert!(good.validate().is_ok());
        let motion = MotionParams { stay: -1.0, ..Default::default() };
        let rate = |p: &mut ReconstructParams| {
            p.motion_network.as_mut().unwrap().fit.schedule.rate = Real::NAN
        };
        // Before, only after all else was done.
        let wide = |p: &mut ReconstructParams| {
            p.motion_network.as_mut().unwrap().network.width = 1 << 20;
        };
        let bake = BakeParams { cell: 0.0, ..Default::default() };
        let sampling = SamplingParams { near: 0, ..Default::default() };
        let phi = |p: &mut ReconstructParams| p.phi.get_or_insert_default().sampling = sampling;
        let fill = FillParams { exact_up_to: usize::MAX, ..Default::default() };
        let cleanup = CleanupParams { fill: Some(fill), ..Default::default() };
        let rays = FieldsParams { rays: 0, ..Default::default() };
        type Spoil<'a> = &'a dyn Fn(&mut ReconstructParams);
        let spoilt: [(&str, Spoil<'_>); 12] = [
            ("cell", &|p| p.cell = Real::NAN),
            ("surface.bending", &|p| p.surface.bending = 0.0),
            ("fields.rays", &|p| p.fields = Some(rays.clone())),
            ("motion.stay", &|p| p.motion = Some(motion.clone())),
            ("motion_network.schedule.rate", &rate),
            ("motion_network.width", &wide),
            ("bake.cell", &|p| p.bake = Some(bake)),
            ("phi.sampling.near", &phi),
            ("garments.votes.enough", &|p| p.garments.votes.enough = 0.0),
            ("garments.smoothness.length", &|p| p.garments.smoothness.length = -1.0),
            ("garments.cut.least", &|p| p.garments.cut = CutParams { least: 0.9 }),
            ("garments.cleanup.fill.exact_up_to", &|p| p.garments.cleanup = cleanup.clone()),
        ];
        for (name, spoil) in spoilt {
            let mut params = good.clone();
            spoil(&mut params);
            assert_eq!(params.validate().unwrap_err().name, name);
        }
    }
}
