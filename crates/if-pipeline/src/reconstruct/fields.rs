//! The paper's own route: φ and d as networks, trained on the images of all frames through the
//! surface by implicit differentiation.

mod checkpoint;
mod nets;
mod params;
mod place;
mod report;
mod scene;
mod skin;
mod start;
mod state;
mod step;
mod terms;
#[cfg(test)]
mod tests;
mod train;

pub use params::{FieldsParams, FieldsWeights};
pub use report::{FieldsReport, FieldsRound, Rays};

use super::error::ReconstructError;
use super::motion::{Motion, MotionReport};
use super::params::SurfaceParams;
use super::surface::Surface;
use crate::capture::Capture;
use if_body::{Skeleton, SkinWeights};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_mesh::sdf::MeshSdf;
use if_neural::deformation::DeformationNetwork;
use if_neural::field::{FieldError, NeuralField};
use if_neural::files::{WeightNorm, write_deformation, write_network};
use if_neural::frame::Frame;
use if_neural::network::Network;
use std::io;
use std::path::Path;

/// φ of the clothed person and d of its frames, trained on a capture.
#[derive(Clone, Debug)]
pub struct Fields {
    /// φ.
    pub phi: Network,
    /// d, with an embedding for each frame of the capture.
    pub deformation: DeformationNetwork,
    /// The map from metres to the unit cube of both networks.
    pub frame: Frame,
    /// For each frame of the capture whether its images were used; embeddings of the others follow
    /// from their neighbours in time.
    pub used: Vec<bool>,
    /// Report.
    pub report: FieldsReport,
}

/// Trains φ and d on the normals and masks of all frames, from a fitted `surface`.
///
/// ```text
/// φ ← fitted to the signed distance of `mesh`, which was extracted from the surface
/// d ← fitted to the solved `motion` of the surface's vertices; without one 0
/// for each round
///     mesh ← follows φ = 0;  LBS(x + d) in each frame, rasterised: start of all rays
///     for each step
///         random pixels with normals, random points of silhouettes, points near and on the surface
///         x of a pixel ← Newton on φ(x) = 0 and LBS(x + d(x, hᵢ)) on the ray
///         loss of normals, silhouettes, |∇φ| = 1, bending; d small, rigid and smooth in time
///         its derivative by φ and d: x moves with both, by implicit differentiation
///         Adam on both networks
/// ```
///
/// Weights of points in space are those of the nearest point of the surface. With a `checkpoint`
/// path, the state is written there after each round. If the file exists and is of the same capture,
/// surface and parameters, training continues from it, and its result has the same bits as that of
/// an uninterrupted run. The caller deletes the file.
///
/// Stages: `read`, `phi`, `motion_network`, and `fields` with the measures `loss`, `normal_degrees` and
/// `silhouette_mm`.
///
/// # Source
///
/// Section 3.2 of the paper and its Appendix E, after SelfRecon [Jiang et al. 2022]; implicit
/// differentiation as in IDR [Yariv et al. 2020]. Ours: the start from the solved surface,
/// silhouettes in place of a loss on mask values, the bending relative to the start, and a mean of d
/// that is drawn to zero. No colours are rendered.
///
/// # Errors
///
/// [`ReconstructError`].
///
/// # Panics
///
/// If `mesh` has no triangles.
pub fn fit_fields(
    capture: &Capture,
    skeleton: &Skeleton,
    surface: &Surface,
    (mesh, skin, exact): (&TriMesh, &SkinWeights, &MeshSdf),
    motion: Option<&Motion>,
    read: &SurfaceParams,
    params: &FieldsParams,
    checkpoint: Option<&Path>,
    monitor: &mut dyn Monitor,
) -> Result<Fields, ReconstructError> {
    read.validate()?;
    params.validate()?;
    capture.check_skeleton(skeleton)?;
    let begin = train::Begin { skeleton, surface, mesh, skin, exact, motion };
    let trained = train::train(capture, &begin, read, params, checkpoint, monitor)?;
    let nets::Nets { phi, deformation, frame } = trained.nets;
    let used = (0..capture.len()).map(|k| trained.used.contains(&k)).collect();
    Ok(Fields { phi, deformation, frame, used, report: trained.report })
}

impl Fields {
    /// φ as a field in metres.
    ///
    /// # Errors
    ///
    /// The network is not finite, or negative at the border of its cube.
    pub fn field(&self) -> Result<NeuralField<Network>, FieldError> {
        NeuralField::new(self.phi.clone(), self.frame)
    }

    /// d of all frames at `points` of canonical space.
    pub fn motion(&self, points: &[Point]) -> Motion {
        let nets = nets::Nets {
            phi: self.phi.clone(),
            deformation: self.deformation.clone(),
            frame: self.frame,
        };
        let offsets = train::motion_of(&nets, points);
        let report = MotionReport::of(&offsets, &self.used, Vec::new());
        Motion { offsets, report }
    }

    /// The bytes of φ's file; [`if_neural::files::read_network`] reads them.
    ///
    /// # Errors
    ///
    /// None, unless memory is exhausted.
    pub fn phi_bytes(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        write_network(&mut bytes, &self.phi, &self.frame, WeightNorm::Kept)?;
        Ok(bytes)
    }

    /// The bytes of d's file; [`if_neural::files::read_deformation`] reads them.
    ///
    /// # Errors
    ///
    /// None, unless memory is exhausted.
    pub fn deformation_bytes(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        write_deformation(&mut bytes, &self.deformation, &self.frame)?;
        Ok(bytes)
    }
}
