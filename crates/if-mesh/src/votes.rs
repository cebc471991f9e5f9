//! Label images of many frames, cast as votes onto the vertices of a mesh that moves.
//!
//! ```text
//! for each frame: rasterise the mesh as it stands in it
//!   a pixel votes, unless it is background, sees a back, or lies near the edge of a label, of the person, or of
//!   something before something else; for each corner k of the triangle it sees, with barycentric b, at view cosine c:
//!     W[k][label] += b_k c²        B[k] += b_k
//!   votes[v] += W[v] / (B[v] + HALF)          at most 1 a frame, however fine the mesh
//! ```
//!
//! # Source
//!
//! Our reading of the supplement, B, and of section 3 of the main method ("back-projected and
//! voted").

#[cfg(test)]
mod tests;

use crate::camera::Camera;
use crate::raster::{IdBuffer, NOTHING, RasterParams, Rasteriser};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The label of what nothing is known about. In label images it is the background, and casts no
/// vote.
pub const UNDECIDED: u8 = 0;

/// Which pixels vote.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VoteParams {
    /// Pixels nearer than this to an edge do not vote: 0 lets all vote, 1 leaves out those that
    /// touch one.
    pub margin: usize,
    /// A step in depth from one pixel to the next that is an edge, in metres.
    pub step: Real,
    /// Votes (frames that see a vertex well) after which a vertex has enough.
    pub enough: Real,
    /// A frame adds nothing where less than this share of the pixels that see the mesh lacks votes.
    /// From 0 to 1.
    pub least_gain: Real,
    /// How the mesh is looked at.
    pub raster: RasterParams,
}

impl Default for VoteParams {
    /// 1 pixel (the margin with the least wrong vertices in `docs/labels.md`) and 3 cm; a frame is
    /// left out where 99.5 % of what it shows has been seen well 24 times.
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
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// The first that does not.
    pub fn validate(&self) -> Result<(), VoteError> {
        let positive = |x: Real| x > 0.0;
        let checks = [
            ("step", self.step, positive(self.step), "positive"),
            ("enough", self.enough, positive(self.enough), "positive"),
            ("least_gain", self.least_gain, (0.0..=1.0).contains(&self.least_gain), "from 0 to 1"),
            ("near", self.raster.near, positive(self.raster.near), "positive"),
        ];
        match checks.into_iter().find(|c| !c.2) {
            Some((name, value, _, expected)) => Err(VoteError::Param { name, value, expected }),
            None => Ok(()),
        }
    }
}

/// Why votes cannot be cast.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VoteError {
    /// Another number of positions than vertices.
    #[error(
        "the frame has {got} positions for a mesh of {expected} vertices; all frames must have the vertices of the mesh"
    )]
    Positions {
        /// Positions of the frame.
        got: usize,
        /// Vertices of the mesh.
        expected: usize,
    },
    /// A picture of another size than the camera.
    #[error("the label image has {got} pixels, but the camera has {expected}")]
    Pixels {
        /// Pixels of the picture.
        got: usize,
        /// Pixels of the camera.
        expected: usize,
    },
    /// A label that was not announced.
    #[error(
        "the pixel in column {column}, row {row} has the label {label}, but there are only {labels} labels (0 is background)"
    )]
    Label {
        /// Column of the pixel.
        column: usize,
        /// Its row.
        row: usize,
        /// What stands there.
        label: u8,
        /// Number of labels.
        labels: usize,
    },
    /// A parameter out of range.
    #[error("parameter `{name}` of the votes is {value}; it must be {expected}")]
    Param {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: Real,
        /// What it may be.
        expected: &'static str,
    },
}

/// What a frame can add, seen before its label image is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Look {
    /// It shows nothing of the mesh.
    Empty,
    /// All it shows has votes enough.
    Covered,
    /// It shows something that lacks votes.
    Gains,
}

/// What became of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct VoteReport {
    /// Frames whose pixels voted.
    pub cast: usize,
    /// Frames left out because they show nothing of the mesh.
    pub empty: usize,
    /// Frames left out because all they show has votes enough.
    pub covered: usize,
    /// Pixels that saw the mesh in the frames that voted.
    pub pixels: usize,
    /// Of these, pixels that did not vote because they are near an edge.
    pub near_edge: usize,
    /// Of these, pixels that did not vote because they are background there, or see a back.
    pub mute: usize,
}

/// Votes for each vertex and label.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelVotes {
    /// Number of labels, [`UNDECIDED`] among them.
    pub labels: usize,
    /// `weights[v · labels + label]`: how many frames say so, those that see it well. Zero for
    /// [`UNDECIDED`].
    pub weights: Vec<Real>,
}

impl LabelVotes {
    /// One full vote for the label of each vertex, none where it is [`UNDECIDED`].
    ///
    /// # Panics
    ///
    /// If a label is not below `labels`.
    pub fn from_labels(of: &[u8], labels: usize) -> Self {
        let mut weights = vec![0.0; of.len() * labels];
        for (v, &label) in of.iter().enumerate() {
            assert!(usize::from(label) < labels, "vertex {v} has the label {label} of {labels}");
            if label != UNDECIDED {
                weights[v * labels + usize::from(label)] = 1.0;
            }
        }
        Self { labels, weights }
    }

    /// The votes of a vertex, one number for each label.
    ///
    /// # Panics
    ///
    /// If `vertex` is out of range.
    pub fn of(&self, vertex: usize) -> &[Real] {
        &self.weights[vertex * self.labels..(vertex + 1) * self.labels]
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.weights.len() / self.labels.max(1)
    }

    /// The label with most votes, the smaller one of equals; [`UNDECIDED`] where there are none.
    pub fn winner(&self, vertex: usize) -> u8 {
        winner(self.of(vertex))
    }

    /// The logarithm of how much likelier `label` is than the best other one, in natural units:
    /// `(votes − votes of the best other) ln(r (n − 1) / (1 − r))` for n labels that a parser gets
    /// right with probability r, independently in each frame. Zero where nothing was seen.
    pub fn log_odds(&self, vertex: usize, label: u8, reliability: Real) -> Real {
        let votes = self.of(vertex);
        let known = (self.labels.max(3) - 1) as Real;
        let r = reliability.clamp(1e-6, 1.0 - 1e-6);
        let others = votes.iter().enumerate().skip(1).filter(|(l, _)| *l != usize::from(label));
        let best = others.map(|(_, w)| *w).fold(0.0, Real::max);
        (votes[usize::from(label)] - best) * (r * (known - 1.0) / (1.0 - r)).ln()
    }
}

/// Index of the largest positive number, the first of equals; [`UNDECIDED`] where none is positive.
pub(crate) fn winner(weights: &[Real]) -> u8 {
    let mut best = usize::from(UNDECIDED);
    for (label, w) in weights.iter().enumerate().skip(1) {
        if *w > 0.0 && (best == 0 || *w > weights[best]) {
            best = label;
        }
    }
    best as u8
}

/// Pixels' worth of a vertex at which a frame counts half: a corner that a frame touches with a
/// hundredth of a pixel says little about it. A fine mesh has a tenth of a pixel for each vertex;
/// ten times more would make its votes count for nothing beside the smoothing, ten times less would
/// believe slivers.
const HALF: f32 = 0.1;

/// Casts the votes of one frame after the other.
#[derive(Debug)]
pub struct Voter<'a> {
    mesh: &'a TriMesh,
    labels: usize,
    params: VoteParams,
    rasteriser: Rasteriser,
    seen: IdBuffer,
    camera: Option<Camera>,
    votes: Vec<Real>,
    /// Sum of all votes of each vertex.
    total: Vec<Real>,
    /// W and, last, B of each vertex in this frame.
    frame: Vec<f32>,
    report: VoteReport,
}

/// What a pixel says.
struct Ballot {
    triangle: u32,
    label: u8,
    bary: [f32; 3],
    weight: f32,
}

impl<'a> Voter<'a> {
    /// For a mesh, in any pose, and label images of `labels` labels, the background (0) among them.
    ///
    /// # Errors
    ///
    /// A parameter out of range.
    pub fn new(mesh: &'a TriMesh, labels: usize, params: &VoteParams) -> Result<Self, VoteError> {
        if !(2..=256).contains(&labels) {
            return Err(VoteError::Param {
                name: "labels",
                value: labels as Real,
                expected: "from 2 to 256",
            });
        }
        params.validate()?;
        let n = mesh.vertices().len();
        Ok(Self {
            mesh,
            labels,
            params: *params,
            rasteriser: Rasteriser::default(),
            seen: IdBuffer::default(),
            camera: None,
            votes: vec![0.0; n * labels],
            total: vec![0.0; n],
            frame: vec![0.0; n * (labels + 1)],
            report: VoteReport::default(),
        })
    }

    /// Looks at the mesh with its vertices at `positions`, and lets the pixels vote unless the
    /// frame adds nothing.
    ///
    /// # Errors
    ///
    /// Positions or pixels of another number, or a label that was not announced.
    pub fn add(
        &mut self,
        positions: &[Point],
        camera: &Camera,
        labels: &[u8],
    ) -> Result<Look, VoteError> {
        let look = self.look(positions, camera)?;
        if look == Look::Gains {
            self.cast(labels)?;
        }
        Ok(look)
    }

    /// Looks at the mesh with its vertices at `positions`. Where the frame adds nothing it is
    /// counted, and there is no need to read its label image; else call [`Voter::cast`].
    ///
    /// # Errors
    ///
    /// Positions of another number than the mesh has vertices.
    pub fn look(&mut self, positions: &[Point], camera: &Camera) -> Result<Look, VoteError> {
        let expected = self.mesh.vertices().len();
        if positions.len() != expected {
            return Err(VoteError::Positions { got: positions.len(), expected });
        }
        self.rasteriser.rasterise(
            self.mesh,
            positions,
            camera,
            &self.params.raster,
            &mut self.seen,
        );
        self.camera = Some(camera.clone());
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

    /// Lets the pixels of the frame that was looked at vote.
    ///
    /// # Errors
    ///
    /// Pixels of another number than the camera has, or a label that was not announced. Then
    /// nothing has voted.
    ///
    /// # Panics
    ///
    /// If nothing was looked at before.
    pub fn cast(&mut self, labels: &[u8]) -> Result<(), VoteError> {
        let camera = self.camera.take().expect("a frame is looked at before its pixels vote");
        let width = self.seen.width;
        let expected = self.seen.triangle.len();
        if labels.len() != expected {
            return Err(VoteError::Pixels { got: labels.len(), expected });
        }
        if let Some(at) = labels.iter().position(|l| usize::from(*l) >= self.labels) {
            let (label, labels) = (labels[at], self.labels);
            return Err(VoteError::Label { column: at % width, row: at / width, label, labels });
        }
        let edges = edges(&self.seen, labels, &self.params);
        let (seen, rasteriser, mesh) = (&self.seen, &self.rasteriser, self.mesh);
        let rows: Vec<(Vec<Ballot>, [usize; 3])> = (0..seen.height)
            .into_par_iter()
            .map(|row| {
                let (mut ballots, mut counts) = (Vec::new(), [0; 3]);
                for column in 0..width {
                    let at = row * width + column;
                    let triangle = seen.triangle[at];
                    if triangle == NOTHING {
                        continue;
                    }
                    counts[0] += 1;
                    if edges[at] {
                        counts[1] += 1;
                        continue;
                    }
                    match rasteriser.hit(mesh, &camera, triangle, column, row) {
                        Some((bary, cos)) if cos > 0.0 && labels[at] != UNDECIDED => {
                            ballots.push(Ballot {
                                triangle,
                                label: labels[at],
                                bary: bary.map(|b| b as f32),
                                weight: (cos * cos) as f32,
                            })
                        }
                        _ => counts[2] += 1,
                    }
                }
                (ballots, counts)
            })
            .collect();

        let stride = self.labels + 1;
        let mut touched: Vec<u32> = Vec::new();
        for (ballots, [pixels, near_edge, mute]) in &rows {
            self.report.pixels += pixels;
            self.report.near_edge += near_edge;
            self.report.mute += mute;
            for ballot in ballots {
                for (v, b) in mesh.triangles()[ballot.triangle as usize].iter().zip(ballot.bary) {
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
        for v in touched {
            let w = &mut self.frame[v as usize * stride..][..stride];
            let scale = 1.0 / (w[self.labels] + HALF);
            let votes = &mut self.votes[v as usize * self.labels..][..self.labels];
            for (vote, w) in votes.iter_mut().zip(w.iter()) {
                let one = Real::from(w * scale);
                *vote += one;
                self.total[v as usize] += one;
            }
            w.fill(0.0);
        }
        self.report.cast += 1;
        Ok(())
    }

    /// What became of the frames so far.
    pub fn report(&self) -> VoteReport {
        self.report
    }

    /// The sum of all votes.
    pub fn finish(self) -> (LabelVotes, VoteReport) {
        (LabelVotes { labels: self.labels, weights: self.votes }, self.report)
    }
}

/// Pixels that are nearer than the margin to an edge: of labels, of the mesh, or of something
/// before something else.
fn edges(seen: &IdBuffer, labels: &[u8], params: &VoteParams) -> Vec<bool> {
    let (width, height) = (seen.width, seen.height);
    let mut found = vec![false; width * height];
    if params.margin == 0 {
        return found;
    }
    let step = params.step as f32;
    let differ = |a: usize, b: usize| {
        let (za, zb) = (seen.depth[a], seen.depth[b]);
        labels[a] != labels[b] || za.is_finite() != zb.is_finite() || (za - zb).abs() > step
    };
    found.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for (column, out) in out.iter_mut().enumerate() {
            let at = row * width + column;
            *out = (column > 0 && differ(at, at - 1))
                || (column + 1 < width && differ(at, at + 1))
                || (row > 0 && differ(at, at - width))
                || (row + 1 < height && differ(at, at + width));
        }
    });
    let reach = params.margin - 1;
    if reach == 0 {
        return found;
    }
    // A square of pixels: along rows, then along columns.
    let mut wide = vec![false; width * height];
    wide.par_chunks_mut(width).zip(found.par_chunks(width)).for_each(|(out, row)| {
        for (column, out) in out.iter_mut().enumerate() {
            *out =
                row[column.saturating_sub(reach)..(column + reach + 1).min(width)].contains(&true);
        }
    });
    found.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(height);
        for (column, out) in out.iter_mut().enumerate() {
            *out = rows.clone().any(|r| wide[r * width + column]);
        }
    });
    found
}
