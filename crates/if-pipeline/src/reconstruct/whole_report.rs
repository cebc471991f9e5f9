//! The report of a whole reconstruction.

use super::fields::FieldsReport;
use super::garments::Garment;
use super::motion::{MotionNetworkReport, MotionReport};
use super::phi::PhiReport;
use super::poses::PoseReport;
use super::report::SurfaceReport;
use super::shown::LabelShown;
use super::struts::tunnels;
use crate::asset::{LayerHint, least_openings};
use crate::capture::Capture;
use if_core::edges::part_count;
use if_core::math::Real;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::labels::{Contradiction, VoteReport};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Votes of the label images.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LabelReport {
    /// Frames whose pixels voted.
    pub frames_cast: usize,
    /// Frames skipped because they show nothing of the mesh.
    pub frames_empty: usize,
    /// Frames skipped because everything they show had enough votes.
    pub frames_covered: usize,
    /// Pixels on the mesh in the frames that voted.
    pub pixels: usize,
    /// Of these, skipped near an edge.
    pub near_edge: usize,
    /// Of these, skipped as background, or because they see a back side.
    pub mute: usize,
    /// Labels of frames that the other frames contradict, and that did not count.
    #[serde(default)]
    pub contradictions: Vec<LabelContradiction>,
    /// How the label images that were read show each label, by its name.
    #[serde(default)]
    pub shown: BTreeMap<String, LabelShown>,
    /// How far masks reach beyond the label images, the median along their rims, in millimetres at the person.
    #[serde(default)]
    pub masks_beyond_mm: Real,
}

/// A frame that takes most of what it sees of a label for another one.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LabelContradiction {
    /// Number of the frame in the capture.
    pub frame: u32,
    /// The label that it gives.
    pub label: String,
    /// The label that the other frames give.
    pub others: String,
}

/// Report of a garment.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GarmentReport {
    /// Its name in the capture.
    pub name: String,
    /// Vertices of its mesh.
    pub vertices: usize,
    /// Triangles of its mesh.
    pub triangles: usize,
    /// Area, in square metres.
    pub area: Real,
    /// The share of it that was seen in no frame ([`Garment::unseen`]).
    #[serde(default)]
    pub unseen: Real,
    /// Boundary loops that stay open: neck, cuffs, hem.
    pub openings: usize,
    /// Largest number of openings for its class, if the name determines the class.
    pub most_openings: Option<usize>,
    /// Smallest number of openings by its name: a jacket may be open in front. `None` if unknown.
    pub least_openings: Option<usize>,
    /// Holes that were filled.
    pub filled: usize,
    /// Holes that could not be filled.
    pub holes_left: usize,
    /// Isolated pieces that were removed.
    pub dropped: usize,
    /// Pieces that it consists of.
    #[serde(default)]
    pub pieces: usize,
    /// Tunnels through it, as between struts: its genus.
    #[serde(default)]
    pub tunnels: usize,
    /// Pairs of its triangles that intersect.
    #[serde(default)]
    pub own_pairs: usize,
}

impl LabelReport {
    pub(super) fn of(
        votes: &VoteReport,
        (shown, masks_beyond): (Vec<LabelShown>, Real),
        capture: &Capture,
    ) -> Self {
        let name = |label: u8| capture.labels()[usize::from(label)].clone();
        let named = |c: &Contradiction| LabelContradiction {
            frame: capture.number(c.frame),
            label: name(c.label),
            others: name(c.others),
        };
        Self {
            frames_cast: votes.cast,
            frames_empty: votes.empty,
            frames_covered: votes.covered,
            pixels: votes.pixels,
            near_edge: votes.near_edge,
            mute: votes.mute,
            contradictions: votes.contradictions.iter().map(named).collect(),
            shown: capture.labels().iter().cloned().zip(shown).collect(),
            masks_beyond_mm: 1e3 * masks_beyond,
        }
    }
}

impl ReconstructReport {
    /// With the numbers of frames in the capture, which its file names have, instead of their indices.
    pub(super) fn numbered(mut self, capture: &Capture) -> Self {
        let number = |frame: &mut usize| *frame = capture.number(*frame) as usize;
        let surface = &mut self.surface;
        surface.skipped = surface.skipped.drain(..).map(|s| s.numbered(capture)).collect();
        surface.quality.frames.iter_mut().for_each(|f| number(&mut f.frame));
        surface.quality.doubts.iter_mut().for_each(|d| number(&mut d.frame));
        if let Some(poses) = &mut self.poses {
            poses.unused.iter_mut().for_each(number);
        }
        if let Some(motion) = &mut self.motion {
            motion.skipped.iter_mut().for_each(number);
            motion.frames.iter_mut().for_each(|f| number(&mut f.frame));
        }
        self
    }
}

impl GarmentReport {
    pub(super) fn of(garment: &Garment) -> Self {
        let clean = &garment.cleanup;
        let (class, mesh) = (LayerHint::of_name(&garment.name).class, &garment.mesh);
        Self {
            name: garment.name.clone(),
            vertices: mesh.vertices().len(),
            triangles: mesh.triangles().len(),
            area: mesh.area(),
            unseen: garment.unseen,
            openings: clean.holes.openings.len(),
            most_openings: class.most_openings(),
            least_openings: least_openings(&garment.name),
            filled: clean.holes.filled.len(),
            holes_left: clean.holes.left.len(),
            dropped: clean.components.dropped.len(),
            pieces: part_count(mesh),
            tunnels: tunnels(mesh),
            own_pairs: own_pairs(mesh, &Bvh::new(mesh)).len(),
        }
    }
}

/// Wall-clock seconds of each step.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Refining the poses.
    #[serde(default)]
    pub poses: Real,
    /// Reading frames and fitting the surface.
    pub surface: Real,
    /// Extracting the canonical mesh.
    pub extract: Real,
    /// Training φ and d, and extracting the canonical mesh from φ.
    #[serde(default)]
    pub fields: Real,
    /// Solving the motion of single frames.
    #[serde(default)]
    pub motion: Real,
    /// Fitting that motion as a network.
    #[serde(default)]
    pub motion_network: Real,
    /// Fitting φ as a network.
    pub phi: Real,
    /// Votes, cuts and clean-up.
    pub garments: Real,
    /// Baking φ.
    #[serde(default)]
    pub bake: Real,
}

impl Seconds {
    /// The seconds of all stages together.
    pub fn sum(&self) -> Real {
        let fit = self.poses + self.surface + self.extract + self.fields + self.phi;
        fit + self.motion + self.motion_network + self.garments + self.bake
    }
}

/// Report of a reconstruction.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ReconstructReport {
    /// The refinement of the poses, if requested.
    #[serde(default)]
    pub poses: Option<PoseReport>,
    /// The fit of the surface.
    pub surface: SurfaceReport,
    /// The training of φ and d, if requested.
    #[serde(default)]
    pub fields: Option<FieldsReport>,
    /// Vertices of the canonical mesh.
    pub vertices: usize,
    /// Triangles of the canonical mesh.
    pub triangles: usize,
    /// Votes of the label images.
    pub labels: LabelReport,
    /// The motion of single frames, if requested.
    #[serde(default)]
    pub motion: Option<MotionReport>,
    /// Errors of the network of that motion, if requested.
    #[serde(default)]
    pub motion_network: Option<MotionNetworkReport>,
    /// Errors of the network of φ, if requested.
    pub phi: Option<PhiReport>,
    /// The garments.
    pub garments: Vec<GarmentReport>,
    /// Garments that no frame shows, or so little of them that it is no garment.
    pub missing: Vec<String>,
    /// Wall-clock seconds.
    pub seconds: Seconds,
}
