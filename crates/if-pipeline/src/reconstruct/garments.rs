//! Labels of the frames become garments of their own.

use super::frames::posed;
use super::motion::MeshMotion;
use super::progress::{Clock, Progress, Stage};
use super::underside::Underside;
use crate::asset::LayerHint;
use crate::capture::{Capture, CaptureError, FIRST_GARMENT};
use if_body::{PoseError, Skeleton};
use if_body::{SkinError, SkinWeights};
use if_core::field::SignedDistance;
use if_core::mesh::TriMesh;
use if_mesh::attributes::{AttributeError, Source, VertexAttributes};
use if_mesh::cleanup::complement::Complement;
use if_mesh::cleanup::openings::Openings;
use if_mesh::cleanup::{CleanupError, CleanupParams, CleanupReport, cleanup};
use if_mesh::cut::{CutError, CutParams, Piece, cut};
use if_mesh::ply::PlyMesh;
use if_mesh::smooth_labels::{SmoothLabelError, SmoothLabelParams, smooth_labels};
use if_mesh::votes::{Look, VoteError, VoteParams, VoteReport, Voter};
use std::ops::ControlFlow;

/// How garments are found.
#[derive(Clone, Debug, Default)]
pub struct GarmentParams {
    /// Which pixels vote.
    pub votes: VoteParams,
    /// How smooth labels are on the surface.
    pub smoothness: SmoothLabelParams,
    /// How triangles are cut.
    pub cut: CutParams,
    /// What is done to each piece. Its `openings` are told as [`openings_of`] says, whatever stands
    /// here.
    pub cleanup: CleanupParams,
}

impl GarmentParams {
    /// Whether all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn validate(&self) -> Result<(), GarmentsError> {
        self.votes.validate().map_err(GarmentsError::Votes)?;
        self.smoothness.validate()?;
        self.cut.validate()?;
        self.cleanup.validate().map_err(GarmentsError::CleanupParams)
    }
}

/// A garment on its own.
#[derive(Clone, Debug)]
pub struct Garment {
    /// What the capture calls it.
    pub name: String,
    /// Its label in the capture.
    pub label: u8,
    /// Its surface in canonical space, in metres.
    pub mesh: TriMesh,
    /// Its weights.
    pub skin: SkinWeights,
    /// What was done to the piece that was cut out.
    pub cleanup: CleanupReport,
}

/// Garments, and the labels they were cut by.
#[derive(Clone, Debug)]
pub struct Garments {
    /// The label of each vertex of the canonical mesh; 0 where nothing is known.
    pub labels: Vec<u8>,
    /// What became of the frames' pixels.
    pub votes: VoteReport,
    /// In the order of the capture, inner to outer. Those of which nothing was seen are not there.
    pub garments: Vec<Garment>,
    /// Those of which nothing was seen.
    pub missing: Vec<String>,
}

/// Why garments cannot be found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum GarmentsError {
    /// The capture is at fault.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the skeleton.
    #[error("frame {frame}: {source}")]
    Pose { frame: usize, source: PoseError },
    /// A frame cannot vote.
    #[error("frame {frame}: {source}")]
    Vote { frame: usize, source: VoteError },
    /// The votes' parameters are out of range.
    #[error(transparent)]
    Votes(VoteError),
    /// Labels cannot be made smooth.
    #[error(transparent)]
    Smooth(#[from] SmoothLabelError),
    /// The mesh cannot be cut.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// The parameters of the clean-up are out of range.
    #[error(transparent)]
    CleanupParams(CleanupError),
    /// A piece cannot be cleaned.
    #[error("garment `{name}`: {source}")]
    Cleanup { name: String, source: CleanupError },
    /// Weights that do not belong to the mesh.
    #[error(transparent)]
    Attributes(#[from] AttributeError),
    /// Weights of a cleaned piece that are none.
    #[error("garment `{name}`: {source}")]
    Skin { name: String, source: SkinError },
    /// `watch` asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Votes on the labels of a canonical mesh by all frames, cuts it along them, and cleans the
/// pieces.
///
/// `field` is the signed distance of the canonical mesh: patches and hems are laid on it.
/// `underside` tells what is no cloth though nobody saw it ([`Underside::of`]).
///
/// # Source
///
/// Supplement, Appendix B, for the clean-up; votes and cut are ours. The steps are
/// [`if_mesh::votes`], [`if_mesh::smooth_labels`], [`if_mesh::cut`] and
/// [`if_mesh::cleanup`].
///
/// # Errors
///
/// [`GarmentsError`].
///
/// # Panics
///
/// If `underside` is of another mesh or capture.
#[allow(clippy::too_many_arguments)] // what a stage needs of those before it
pub fn find_garments(
    capture: &Capture,
    skeleton: &Skeleton,
    mesh: &TriMesh,
    skin: &SkinWeights,
    field: &dyn SignedDistance,
    motion: Option<&MeshMotion>,
    underside: Option<&Underside>,
    params: &GarmentParams,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Garments, GarmentsError> {
    let mut clock = Clock::new();
    let steps = capture.len() + capture.garments().len();
    let mut tell = |step| {
        if watch(&clock.at(Stage::Garments, step, steps, None)).is_break() {
            Err(GarmentsError::Cancelled)
        } else {
            Ok(())
        }
    };
    let mut voter =
        Voter::new(mesh, capture.labels().len(), &params.votes).map_err(GarmentsError::Votes)?;
    for frame in 0..capture.len() {
        tell(frame)?;
        let offsets = motion.map(|m| m.offsets(frame)).unwrap_or_default();
        let at = posed(mesh, skin, skeleton, capture.pose(frame), &offsets)
            .map_err(|source| GarmentsError::Pose { frame, source })?;
        let vote = |source| GarmentsError::Vote { frame, source };
        if voter.look(&at, capture.camera()).map_err(vote)? == Look::Gains {
            voter.cast(&capture.label_image(frame)?).map_err(vote)?;
        }
    }
    let (votes, report) = voter.finish();
    let mut scores = smooth_labels(mesh, &votes, &params.smoothness)?;
    if let Some(underside) = underside {
        scores = smooth_labels(mesh, &underside.voted(mesh, &votes, &scores), &params.smoothness)?;
    }
    let labels = scores.winners();
    let pieces = cut(mesh, &scores, &params.cut)?;
    let attributes = VertexAttributes::new(mesh.vertices().len(), skin.to_properties())?;
    let mut found = Garments { labels, votes: report, garments: Vec::new(), missing: Vec::new() };
    for (k, name) in capture.garments().iter().enumerate() {
        tell(capture.len() + k)?;
        let label = FIRST_GARMENT + k as u8;
        let Some(piece) =
            pieces.iter().find(|p| p.label == label && !p.mesh.triangles().is_empty())
        else {
            found.missing.push(name.clone());
            continue;
        };
        let cleaning =
            CleanupParams { openings: openings_of(name, mesh), ..params.cleanup.clone() };
        let carried = attributes.derive(&sources(piece));
        let clean = cleanup(&piece.mesh, &carried, Some(field), &cleaning)
            .map_err(|source| GarmentsError::Cleanup { name: name.clone(), source })?;
        if clean.mesh.triangles().is_empty() {
            found.missing.push(name.clone());
            continue;
        }
        let ply = PlyMesh {
            vertex_properties: clean.attributes.into_properties(),
            ..PlyMesh::new(clean.mesh)
        };
        let skin = SkinWeights::from_ply(&ply, skeleton.len())
            .map_err(|source| GarmentsError::Skin { name: name.clone(), source })?;
        found.garments.push(Garment {
            name: name.clone(),
            label,
            mesh: ply.mesh,
            skin,
            cleanup: clean.report,
        });
    }
    Ok(found)
}

/// Which loops of the garment `name`, cut out of `body`, stay open: those that
///
/// - bound a large part of what is not the garment: [`Complement`]. Islands of other labels within
///   a garment are holes of it, like what nobody saw; no vertex is marked as foreign;
/// - let something pass: the openness of [`Openings::default`]. Where a garment's border meets
///   another one the extracted surface may hold a tunnel of one cell, whose section bounds the
///   other garment as the hem does, but is 2 cm long;
/// - are among as many of the most open as a garment of its class has:
///   [`GarmentClass::most_openings`].
///
/// [`GarmentClass::most_openings`]: crate::asset::GarmentClass::most_openings
pub fn openings_of(name: &str, body: &TriMesh) -> Openings {
    let mut policies =
        vec![Openings::Complement(Box::new(Complement::new(body.clone()))), Openings::default()];
    policies.extend(LayerHint::of_name(name).class.most_openings().map(Openings::Count));
    Openings::Each(policies)
}

/// What the vertices of a piece are made of.
fn sources(piece: &Piece) -> Vec<Source> {
    let of = |origin: &if_mesh::cut::Origin| match origin.source() {
        Some(v) => Source::Vertex(v),
        None => {
            let mut parts: Vec<(u32, f64)> = origin
                .vertices
                .iter()
                .copied()
                .zip(origin.weights)
                .filter(|(_, w)| *w > 0.0)
                .collect();
            parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            Source::Blend(parts)
        }
    };
    piece.origins.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::{Point, Real};
    use std::f64::consts::TAU;

    /// A closed drum with a tunnel of 2 to 3 cm radius along its axis, and its upper half: mantle
    /// and lid.
    fn drum_with_a_tunnel() -> (TriMesh, TriMesh) {
        const AROUND: u32 = 48;
        const STEPS: u32 = 20;
        // The profile from the lower end of the mantle up, inwards over the lid, and down the
        // tunnel, which widens.
        let corners = [[0.2, 0.0], [0.2, 1.0], [0.02, 1.0], [0.03, 0.0]];
        let side = |k: usize| (0..STEPS).map(move |i| (k, Real::from(i) / Real::from(STEPS)));
        let profile: Vec<[Real; 2]> = (0..4)
            .flat_map(side)
            .map(|(k, s)| {
                [0, 1].map(|axis| corners[k][axis] * (1.0 - s) + corners[(k + 1) % 4][axis] * s)
            })
            .collect();
        let rows = profile.len() as u32;
        let at = |[r, y]: [Real; 2], k: u32| {
            let (sin, cos) = (TAU * Real::from(k) / Real::from(AROUND)).sin_cos();
            Point::new(r * cos, y, r * sin)
        };
        let vertices: Vec<Point> =
            profile.iter().flat_map(|p| (0..AROUND).map(move |k| at(*p, k))).collect();
        let quad = |j: u32, k: u32| {
            let (j1, k1) = ((j + 1) % rows, (k + 1) % AROUND);
            let [a, b, c, d] = [j * AROUND + k, j * AROUND + k1, j1 * AROUND + k1, j1 * AROUND + k];
            [[a, c, b], [a, d, c]]
        };
        let part = |rows: std::ops::Range<u32>| {
            let triangles = rows.flat_map(|j| (0..AROUND).flat_map(move |k| quad(j, k))).collect();
            TriMesh::new(vertices.clone(), triangles).unwrap()
        };
        (part(0..rows), part(STEPS / 2..2 * STEPS))
    }

    #[test]
    fn a_tunnel_to_another_garment_is_no_opening() {
        let (body, piece) = drum_with_a_tunnel();
        let loops = |openings: Openings| {
            let params = CleanupParams { openings, smooth: None, ..CleanupParams::default() };
            let none = VertexAttributes::none(piece.vertices().len());
            let report = cleanup(&piece, &none, None, &params).unwrap().report;
            (report.holes.openings.len(), report.holes.filled.len())
        };
        // What lies beyond the tunnel is the other half: what the loop bounds does not tell the two
        // apart.
        assert_eq!(loops(Openings::Complement(Box::new(Complement::new(body.clone())))), (2, 0));
        for name in ["sweater", "thing"] {
            assert_eq!(loops(openings_of(name, &body)), (1, 1), "{name}");
        }
    }
}
