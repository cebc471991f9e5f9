//! Votes: label images of many frames, projected onto the vertices of a moving mesh.
//!
//! ```text
//! for each frame: rasterise the mesh in its pose
//!   a pixel votes, unless it is background, sees a back face, or lies near the edge of a label, of the person,
//!   or of an occlusion; for each corner k of the triangle it sees, with barycentric b, at view cosine c:
//!     W[k][label] += b_k c²        B[k] += b_k
//!   votes[v] += W[v] / (B[v] + HALF)          at most 1 a frame, however fine the mesh
//! ```
//!
//! Where a pixel is larger than the triangles it sees, it votes in parts, so that vertices between
//! the centres of pixels get votes as well. Frames that take one label for another
//! ([`Contradiction`]) lose their votes for it.
//!
//! # Source
//!
//! Our reading of the supplement, B, and of section 3 of the main method ("back-projected and
//! voted").

#[cfg(test)]
mod tests;

use super::contradictions::{Contradiction, FrameVotes, withdraw_contradicted};
use super::error::LabelError;
use super::image_edges::image_edges;
use super::sides::withdraw_minorities;
use super::votes::{LabelVotes, UNDECIDED};
use crate::camera::Camera;
use crate::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Parameters of votes: which pixels vote.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VoteParams {
    /// Pixels nearer than this to an edge do not vote: with 0 all pixels vote, with 1 those that do
    /// not touch one. Where pixels vote in parts it is half a pixel less.
    pub margin: usize,
    /// Difference in depth between neighbouring pixels that counts as an edge, in metres.
    pub step: Real,
    /// Number of votes (frames that see it well) from which on a vertex is saturated.
    pub enough: Real,
    /// A frame is skipped if less than this share of the pixels that see the mesh shows unsaturated
    /// vertices. From 0 to 1.
    pub least_gain: Real,
    /// Parameters of the rasteriser.
    pub raster: RasterParams,
}

impl Default for VoteParams {
    /// 1 pixel (the margin with the least wrong vertices in `docs/evidence/surfaces.md`) and 3 cm;
    /// a frame is skipped if 99.5 % of what it shows has been seen well 24 times.
    fn default() -> Self {
        Self {
            margin: 1,
            step: 0.03,
            enough: 24.0,
            least_gain: 0.005,
            raster: RasterParams::default(),
        }
    }
}

impl VoteParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        check("step", self.step, self.step > 0.0, "positive (m)")?;
        check("enough", self.enough, self.enough > 0.0, "positive")?;
        let gain = self.least_gain;
        check("least_gain", gain, (0.0..=1.0).contains(&gain), "from 0 to 1")?;
        let near = self.raster.near;
        check("near", near, near > 0.0, "positive (m)").map_err(|e| e.within("raster"))
    }
}

/// What a frame can add, known before its label image is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Look {
    /// The frame shows nothing of the mesh.
    Empty,
    /// All that the frame shows is saturated.
    Covered,
    /// The frame shows unsaturated vertices.
    Gains,
}

/// Report of the votes.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct VoteReport {
    /// Frames whose pixels voted.
    pub cast: usize,
    /// Frames skipped because they show nothing of the mesh.
    pub empty: usize,
    /// Frames skipped because all that they show is saturated.
    pub covered: usize,
    /// Pixels that saw the mesh in the frames that voted.
    pub pixels: usize,
    /// Of these, pixels that did not vote because they are near an edge.
    pub near_edge: usize,
    /// Of these, pixels that did not vote because they are background, or see a back face.
    pub mute: usize,
    /// Labels of frames that the other frames contradict, whose votes do not count.
    pub contradictions: Vec<Contradiction>,
}

/// Number of pixels per vertex at which the vote of a frame counts half: a corner with a hundredth
/// of a pixel is hardly seen. A fine mesh has a tenth of a pixel per vertex; a value ten times larger
/// would make its votes negligible against the smoothing, one ten times smaller would trust
/// slivers.
const HALF: f32 = 0.1;

/// Most parts of a pixel along each side: sixteen times the work of whole ones.
const MOST_PARTS: usize = 4;

/// Accumulates the votes of frames.
#[derive(Debug)]
pub struct Voter<'a> {
    mesh: &'a TriMesh,
    labels: usize,
    params: VoteParams,
    /// Mean length of the edges of the mesh.
    edge: Real,
    rasteriser: Rasteriser,
    seen: IdBuffer,
    /// Of the last look, with the parts of a pixel along each side.
    camera: Option<(Camera, usize)>,
    votes: Vec<Real>,
    /// Sum of all votes of each vertex.
    total: Vec<Real>,
    /// The votes of each frame.
    frames: Vec<FrameVotes>,
    /// W and, last, B of each vertex in this frame.
    frame: Vec<f32>,
    report: VoteReport,
}

/// The vote of a pixel.
struct Ballot {
    triangle: u32,
    label: u8,
    bary: [f32; 3],
    weight: f32,
}

/// The ballots of a row of pixels, and its counts for the report.
#[derive(Default)]
struct Row {
    ballots: Vec<Ballot>,
    pixels: usize,
    near_edge: usize,
    mute: usize,
}

impl<'a> Voter<'a> {
    /// For a mesh, in any pose, and label images of `labels` labels, including the background (0).
    ///
    /// # Errors
    ///
    /// A parameter out of range.
    pub fn new(
        mesh: &'a TriMesh,
        labels: usize,
        params: &VoteParams,
    ) -> Result<Self, ParameterError> {
        let valid = (2..=256).contains(&labels);
        ParameterError::check("labels", labels as Real, valid, "from 2 to 256")?;
        params.validate()?;
        let n = mesh.vertices().len();
        Ok(Self {
            mesh,
            labels,
            params: *params,
            edge: mesh.mean_edge(),
            rasteriser: Rasteriser::default(),
            seen: IdBuffer::default(),
            camera: None,
            votes: vec![0.0; n * labels],
            total: vec![0.0; n],
            frames: Vec::new(),
            frame: vec![0.0; n * (labels + 1)],
            report: VoteReport::default(),
        })
    }

    /// Adds the votes of a frame with the vertices at `positions`, unless the frame is skipped.
    ///
    /// # Errors
    ///
    /// Positions or pixels of another number, or a label out of range.
    pub fn add(
        &mut self,
        positions: &[Point],
        camera: &Camera,
        labels: &[u8],
    ) -> Result<Look, LabelError> {
        let look = self.look(positions, camera)?;
        if look == Look::Gains {
            self.cast(labels)?;
        }
        Ok(look)
    }

    /// Rasterises the mesh with its vertices at `positions`. Unless the result is [`Look::Gains`],
    /// the frame is skipped and its label image need not be read; else call [`Voter::cast`].
    ///
    /// # Errors
    ///
    /// Positions of another number than the mesh has vertices.
    pub fn look(&mut self, positions: &[Point], camera: &Camera) -> Result<Look, LabelError> {
        let expected = self.mesh.vertices().len();
        if positions.len() != expected {
            return Err(LabelError::Positions { got: positions.len(), expected });
        }
        let (camera, parts) = self.in_parts(positions, camera);
        self.rasteriser.rasterise(
            self.mesh,
            positions,
            &camera,
            &self.params.raster,
            &mut self.seen,
        );
        self.camera = Some((camera, parts));
        let (total, enough, triangles) = (&self.total, self.params.enough, self.mesh.triangles());
        let count = |row: &[u32]| {
            let seen = row.iter().filter(|t| **t != NOTHING);
            let lacks =
                |t: &&u32| triangles[**t as usize].iter().any(|v| total[*v as usize] < enough);
            (seen.clone().count(), seen.filter(lacks).count())
        };
        let (seen, lacking) = self
            .seen
            .triangle
            .par_chunks(self.seen.width)
            .map(count)
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        Ok(if seen == 0 {
            self.report.empty += 1;
            Look::Empty
        } else if lacking == 0 || (lacking as Real) < self.params.least_gain * seen as Real {
            self.report.covered += 1;
            Look::Covered
        } else {
            Look::Gains
        })
    }

    /// The camera with pixels in as many parts along each side as edges of the mesh fit beside each
    /// other, and their number.
    fn in_parts(&self, positions: &[Point], camera: &Camera) -> (Camera, usize) {
        let sum: Vector = positions.iter().map(|p| p.coords).sum();
        let depth = camera.to_camera(&Point::from(sum / positions.len().max(1) as Real)).z;
        let pixel = depth / camera.intrinsics()[(0, 0)];
        // A negative or undefined number becomes 0.
        let parts = ((pixel / self.edge) as usize).clamp(1, MOST_PARTS);
        match camera.scaled(parts as Real) {
            Ok(finer) if parts > 1 => (finer, parts),
            _ => (camera.clone(), 1),
        }
    }

    /// Adds the votes of the frame of the last [`Voter::look`].
    ///
    /// # Errors
    ///
    /// Pixels of another number than the camera has, or a label out of range. No vote is added then.
    ///
    /// # Panics
    ///
    /// Without a call of [`Voter::look`] before.
    pub fn cast(&mut self, labels: &[u8]) -> Result<(), LabelError> {
        let (camera, parts) = self.camera.take().expect("`look` is called before `cast`");
        let width = self.seen.width;
        let expected = self.seen.triangle.len() / (parts * parts);
        if labels.len() != expected {
            return Err(LabelError::Pixels { got: labels.len(), expected });
        }
        if let Some(at) = labels.iter().position(|l| usize::from(*l) >= self.labels) {
            let (label, labels) = (labels[at], self.labels);
            let (column, row) = (at % (width / parts), at / (width / parts));
            return Err(LabelError::Label { column, row, label, labels });
        }
        let rows = self.ballots(&enlarged(labels, width, parts), &camera, parts);
        let touched = self.count(&rows);
        self.tally(&touched);
        self.report.cast += 1;
        Ok(())
    }

    /// Ballots and counts of each row of pixels, in parallel.
    fn ballots(&self, labels: &[u8], camera: &Camera, parts: usize) -> Vec<Row> {
        let Self { seen, rasteriser, mesh, .. } = self;
        // Half a pixel less: with a whole one 68 instead of 99 % of the skin's vertices got their label
        // in 8 frames of 96² with noise.
        let margin = (parts * self.params.margin).saturating_sub(parts / 2);
        let edges = image_edges(seen, labels, margin, self.params.step);
        let row = |row: usize| {
            let mut found = Row::default();
            for column in 0..seen.width {
                let at = row * seen.width + column;
                let triangle = seen.triangle[at];
                if triangle == NOTHING {
                    continue;
                }
                // A pixel is counted at one of its parts.
                let pixel = usize::from((row % parts, column % parts) == (parts / 2, parts / 2));
                found.pixels += pixel;
                if edges[at] {
                    found.near_edge += pixel;
                    continue;
                }
                match rasteriser.hit(mesh, camera, triangle, column, row) {
                    Some((bary, cos)) if cos > 0.0 && labels[at] != UNDECIDED => {
                        found.ballots.push(Ballot {
                            triangle,
                            label: labels[at],
                            bary: bary.map(|b| b as f32),
                            weight: (cos * cos) as f32,
                        })
                    }
                    _ => found.mute += pixel,
                }
            }
            found
        };
        (0..seen.height).into_par_iter().map(row).collect()
    }

    /// Sums ballots at vertices, and returns those that have some. In order, so that the bits do not
    /// depend on threads.
    fn count(&mut self, rows: &[Row]) -> Vec<u32> {
        let stride = self.labels + 1;
        let mut touched: Vec<u32> = Vec::new();
        for row in rows {
            self.report.pixels += row.pixels;
            self.report.near_edge += row.near_edge;
            self.report.mute += row.mute;
            for ballot in &row.ballots {
                let corners = self.mesh.triangles()[ballot.triangle as usize];
                for (v, b) in corners.iter().zip(ballot.bary) {
                    let w = &mut self.frame[*v as usize * stride..][..stride];
                    if b > 0.0 {
                        if w[self.labels] == 0.0 {
                            touched.push(*v);
                        }
                        w[self.labels] += b;
                        w[usize::from(ballot.label)] += b * ballot.weight;
                    }
                }
            }
        }
        touched
    }

    /// Gives each vertex with ballots its one vote of the frame, divided among labels.
    fn tally(&mut self, touched: &[u32]) {
        let stride = self.labels + 1;
        let frame = self.report.empty + self.report.covered + self.report.cast;
        let mut own = FrameVotes { frame, votes: Vec::new() };
        for v in touched {
            let w = &mut self.frame[*v as usize * stride..][..stride];
            let scale = 1.0 / (w[self.labels] + HALF);
            let votes = &mut self.votes[*v as usize * self.labels..][..self.labels];
            for (label, (vote, w)) in votes.iter_mut().zip(w.iter()).enumerate() {
                let one = w * scale;
                *vote += Real::from(one);
                self.total[*v as usize] += Real::from(one);
                if one > 0.0 {
                    own.votes.push((*v, label as u8, one));
                }
            }
            w.fill(0.0);
        }
        self.frames.push(own);
    }

    /// The report so far.
    pub fn report(&self) -> &VoteReport {
        &self.report
    }

    /// The sum of all votes that the other frames do not contradict, and the report.
    pub fn finish(mut self) -> (LabelVotes, VoteReport) {
        let labels = self.labels;
        let mut found = withdraw_minorities(&mut self.frames, self.total.len(), labels);
        if !found.is_empty() {
            self.sum_anew();
        }
        let more = withdraw_contradicted(&mut self.frames, &self.votes, labels);
        if !more.is_empty() {
            self.sum_anew();
        }
        found.extend(more);
        found.sort_unstable_by_key(|c| (c.frame, c.others, c.label));
        self.report.contradictions = found;
        (LabelVotes { labels, weights: self.votes }, self.report)
    }

    /// Sums the votes of all frames anew: sums that something was subtracted from are rounded.
    fn sum_anew(&mut self) {
        self.votes.fill(0.0);
        for (v, label, vote) in self.frames.iter().flat_map(|own| &own.votes) {
            self.votes[*v as usize * self.labels + usize::from(*label)] += Real::from(*vote);
        }
    }
}

/// The image with each pixel repeated along both sides; `width` is that of the result.
fn enlarged(labels: &[u8], width: usize, parts: usize) -> Cow<'_, [u8]> {
    if parts == 1 {
        return labels.into();
    }
    let row = |at: usize| &labels[at / parts * (width / parts)..][..width / parts];
    let rows = labels.len() * parts * parts / width;
    (0..rows).flat_map(|at| row(at).iter().flat_map(|l| std::iter::repeat_n(*l, parts))).collect()
}
