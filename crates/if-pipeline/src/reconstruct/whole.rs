//! From a capture to garments, in one call.

use super::canonical::{FloodedField, carried_weights, largest_piece};
use super::garments::{Garment, GarmentParams, Garments, GarmentsError, find_garments};
use super::motion::{
    MeshMotion, MotionError, MotionNetwork, MotionNetworkError, MotionNetworkParams, MotionParams,
    distil_motion, fit_motion,
};
use super::phi::{PhiError, PhiNetwork, PhiParams, fit_phi};
use super::progress::{Clock, Progress, Stage};
use super::surface::{SurfaceError, fit_surface};
use super::underside::Underside;
use super::whole_report::{GarmentReport, LabelReport, ReconstructReport, Seconds};
use super::{ParamError, SurfaceParams};
use crate::capture::Capture;
use if_body::SkinWeights;
use if_body::TemplateBody;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::baked::{BakeError, BakeParams, Baked, Redistance};
use if_mesh::extract::{ExtractError, ExtractParams, Resolution, extract};
use if_mesh::sdf::{MeshSdf, SdfError};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// How a capture is reconstructed.
#[derive(Clone, Debug)]
pub struct ReconstructParams {
    /// How the surface is found.
    pub surface: SurfaceParams,
    /// Cells of the extraction, in metres: about the mean edge length of the canonical mesh.
    pub cell: Real,
    /// How the motion of single frames is solved; `None` skips it, for who writes no frames.
    pub motion: Option<MotionParams>,
    /// How that motion becomes a network; `None` skips it, and so does no motion.
    pub motion_network: Option<MotionNetworkParams>,
    /// How φ is baked; its `region` is chosen here where it is not given.
    pub bake: BakeParams,
    /// How φ is fitted as a network; `None` skips it.
    pub phi: Option<PhiParams>,
    /// How garments are found.
    pub garments: GarmentParams,
}

impl Default for ReconstructParams {
    /// Cells of 8 mm, as small as a pixel of the sample captures; no motion of single frames.
    fn default() -> Self {
        Self {
            surface: SurfaceParams::default(),
            cell: 0.008,
            motion: None,
            motion_network: None,
            bake: BakeParams { redistance: Redistance::Never, ..BakeParams::default() },
            phi: Some(PhiParams::default()),
            garments: GarmentParams::default(),
        }
    }
}

impl ReconstructParams {
    /// Whether all parameters are in range. [`reconstruct`] asks first of all: the surface takes
    /// minutes.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn validate(&self) -> Result<(), ReconstructError> {
        if !(self.cell > 0.0 && self.cell.is_finite()) {
            return Err(ParamError {
                name: "cell",
                value: self.cell,
                needs: "a length above zero, in metres",
            }
            .into());
        }
        self.surface.validate()?;
        self.motion.as_ref().map_or(Ok(()), MotionParams::validate)?;
        if let Some(network) = &self.motion_network {
            network.fit.validate().map_err(|e| MotionNetworkError::Fit(e.into()))?;
        }
        self.bake.validate().map_err(BakeError::from)?;
        self.phi.as_ref().map_or(Ok(()), PhiParams::validate)?;
        Ok(self.garments.validate()?)
    }
}

/// A person in clothes, and the clothes.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The surface in canonical space: closed, extracted once for all frames.
    pub mesh: TriMesh,
    /// Its weights.
    pub skin: SkinWeights,
    /// The label of each of its vertices.
    pub labels: Vec<u8>,
    /// d of single frames at its vertices, where it was asked for.
    pub motion: Option<MeshMotion>,
    /// d as a network, where it was asked for.
    pub motion_network: Option<MotionNetwork>,
    /// φ: its signed distance, baked.
    pub field: Baked,
    /// φ as a network, where one was asked for.
    pub phi: Option<PhiNetwork>,
    /// The garments, inner to outer.
    pub garments: Vec<Garment>,
    /// What was used, left out and reached.
    pub report: ReconstructReport,
}

/// Why a capture cannot be reconstructed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReconstructError {
    /// A parameter is out of range.
    #[error(transparent)]
    Params(#[from] ParamError),
    /// No surface was found.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The surface has no inside.
    #[error("the surface that was found has no inside: {0}")]
    Field(#[from] SdfError),
    /// The canonical mesh cannot be extracted.
    #[error(transparent)]
    Extract(#[from] ExtractError),
    /// The motion of single frames cannot be solved.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The motion of single frames cannot be made a network.
    #[error(transparent)]
    MotionNetwork(#[from] MotionNetworkError),
    /// φ cannot be baked.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// φ cannot be fitted.
    #[error(transparent)]
    Phi(#[from] PhiError),
    /// Garments cannot be found.
    #[error(transparent)]
    Garments(#[from] GarmentsError),
    /// `watch` asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl ReconstructError {
    /// Whether `watch` asked to stop.
    pub fn is_cancelled(&self) -> bool {
        matches!(
            self,
            Self::Cancelled
                | Self::Surface(SurfaceError::Cancelled { .. })
                | Self::Motion(MotionError::Cancelled { .. })
                | Self::MotionNetwork(MotionNetworkError::Cancelled)
                | Self::Phi(PhiError::Cancelled)
                | Self::Garments(GarmentsError::Cancelled)
        )
    }
}

/// Reconstructs a person in clothes and each garment from a capture.
///
/// ```text
/// surface   ← the template, fitted to masks and normals              fit_surface
/// mesh      ← the zero set of the surface's signed distance, once; its largest piece; weights of the nearest place of the surface
/// motion    ← d of each frame, where it is asked for, and as a network       fit_motion, distil_motion
/// φ         ← the mesh's signed distance, baked; and as a network        fit_phi
/// garments  ← the frames' labels voted on the posed mesh, cut, cleaned    find_garments
/// ```
///
/// `watch` and `checkpoint` are those of [`fit_surface`]; the steps after it take seconds and are
/// done again.
///
/// # Errors
///
/// [`ReconstructError`].
pub fn reconstruct(
    capture: &Capture,
    template: &TemplateBody,
    params: &ReconstructParams,
    checkpoint: Option<&Path>,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reconstruction, ReconstructError> {
    params.validate()?;
    let mut seconds = Seconds::default();
    let mut start = Instant::now();
    let mut lap = |slot: &mut Real| {
        *slot = start.elapsed().as_secs_f64();
        start = Instant::now();
    };
    let surface = fit_surface(capture, template, &params.surface, checkpoint, watch)?;
    lap(&mut seconds.surface);

    let mut clock = Clock::new();
    if watch(&clock.at(Stage::Extract, 0, 2, None)).is_break() {
        return Err(ReconstructError::Cancelled);
    }
    let found = extract(
        &FloodedField::new(&surface.mesh)?,
        &ExtractParams {
            region: Some(surface.mesh.aabb().inflated(params.cell)),
            resolution: Resolution::Cell(params.cell),
            // Where the surface passes through itself gradients jump: vertices stay on the edges of
            // their cells.
            newton: 0,
            ..ExtractParams::default()
        },
        &mut Silent,
    )?;
    let mesh = largest_piece(&found.mesh);
    let skin =
        carried_weights(&surface.mesh, &surface.skin, template.skeleton.len(), mesh.vertices());
    if watch(&clock.at(Stage::Extract, 1, 2, None)).is_break() {
        return Err(ReconstructError::Cancelled);
    }
    let exact = MeshSdf::closed(&mesh)?;
    let field = Baked::new(&exact, &params.bake, &mut Silent)?;
    lap(&mut seconds.extract);
    let motion = match &params.motion {
        None => None,
        Some(p) => {
            let motion =
                fit_motion(capture, &template.skeleton, &surface, &params.surface, p, watch)?;
            Some(MeshMotion::new(motion, &surface.mesh, mesh.vertices()))
        }
    };
    lap(&mut seconds.motion);
    let motion_network = match (&motion, &params.motion_network) {
        (Some(motion), Some(p)) => Some(distil_motion(motion.motion(), &surface.mesh, p, watch)?),
        _ => None,
    };
    lap(&mut seconds.motion_network);
    let phi = params.phi.as_ref().map(|p| fit_phi(&exact, p, watch)).transpose()?;
    lap(&mut seconds.phi);

    let underside = Underside::of(&surface, template, capture, &mesh);
    let Garments { labels, votes, garments, missing } = find_garments(
        capture,
        &template.skeleton,
        &mesh,
        &skin,
        &exact,
        motion.as_ref(),
        underside.as_ref(),
        &params.garments,
        watch,
    )?;
    lap(&mut seconds.garments);
    let report = ReconstructReport {
        surface: surface.report,
        vertices: mesh.vertices().len(),
        triangles: mesh.triangles().len(),
        labels: LabelReport {
            frames_cast: votes.cast,
            frames_empty: votes.empty,
            frames_covered: votes.covered,
            pixels: votes.pixels,
            near_edge: votes.near_edge,
            mute: votes.mute,
        },
        motion: motion.as_ref().map(|m| m.motion().report.clone()),
        motion_network: motion_network.as_ref().map(|n| n.report),
        phi: phi.as_ref().map(|p| p.report),
        garments: garments.iter().map(GarmentReport::of).collect(),
        missing,
        seconds,
    };
    Ok(Reconstruction { mesh, skin, labels, motion, motion_network, field, phi, garments, report })
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_mesh::cleanup::CleanupParams;
    use if_mesh::cleanup::holes::FillParams;
    use if_mesh::cut::CutParams;
    use if_neural::sampling::SamplingParams;

    #[test]
    fn every_part_is_looked_at_before_the_work() {
        let good = ReconstructParams {
            motion: Some(MotionParams::default()),
            motion_network: Some(MotionNetworkParams::default()),
            ..Default::default()
        };
        assert!(good.validate().is_ok());
        let spoiled = |spoil: &dyn Fn(&mut ReconstructParams)| {
            let mut params = good.clone();
            spoil(&mut params);
            params.validate().unwrap_err()
        };
        assert!(
            matches!(spoiled(&|p| p.cell = Real::NAN), ReconstructError::Params(e) if e.name == "cell")
        );
        assert!(
            matches!(spoiled(&|p| p.surface.bending = 0.0), ReconstructError::Params(e) if e.name == "bending")
        );
        let motion = MotionParams { stay: -1.0, ..Default::default() };
        assert!(
            matches!(spoiled(&|p| p.motion = Some(motion.clone())), ReconstructError::Params(e) if e.name == "stay")
        );
        let rate = |p: &mut ReconstructParams| {
            p.motion_network.as_mut().unwrap().fit.schedule.rate = Real::NAN
        };
        assert!(matches!(
            spoiled(&rate),
            ReconstructError::MotionNetwork(MotionNetworkError::Fit(_))
        ));
        assert!(matches!(spoiled(&|p| p.bake.cell = 0.0), ReconstructError::Bake(_)));
        let sampling = SamplingParams { near: 0, ..Default::default() };
        let phi = |p: &mut ReconstructParams| p.phi.as_mut().unwrap().sampling = sampling;
        assert!(matches!(spoiled(&phi), ReconstructError::Phi(_)));
        assert!(matches!(
            spoiled(&|p| p.garments.votes.enough = 0.0),
            ReconstructError::Garments(GarmentsError::Votes(_))
        ));
        assert!(matches!(
            spoiled(&|p| p.garments.smoothness.length = -1.0),
            ReconstructError::Garments(GarmentsError::Smooth(_))
        ));
        let cut = |p: &mut ReconstructParams| p.garments.cut = CutParams { least: 0.9 };
        assert!(matches!(spoiled(&cut), ReconstructError::Garments(GarmentsError::Cut(_))));
        let fill = FillParams { exact_up_to: usize::MAX, ..Default::default() };
        let cleanup = |p: &mut ReconstructParams| {
            p.garments.cleanup = CleanupParams { fill: Some(fill), ..Default::default() }
        };
        assert!(matches!(
            spoiled(&cleanup),
            ReconstructError::Garments(GarmentsError::CleanupParams(_))
        ));
    }
}
