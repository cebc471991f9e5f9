//! Positions of canonical points in all frames, in network units, and what is held out of them.

use super::loss::strain;
use super::{DeformParams, OffsetAccuracy};
use crate::deformation::{DeformationNetwork, OffsetSample};
use crate::error::FitError;
use crate::frame::Frame;
use crate::random::gaussian;
use crate::training::random_of_step;
use if_core::math::{Point, Real, Vector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Fewest canonical points: of fewer, none may be held out.
const FEWEST: usize = 4;
/// Held-out points of a check, each of a frame: no more than a step has by default. The report has
/// all of them.
const CHECKED: usize = 2048;

/// The position of each canonical point in each frame, in network units.
pub(crate) struct Correspondences {
    canonical: Vec<[f32; 3]>,
    frames: Vec<Vec<[f32; 3]>>,
}

/// The frame of a point of a batch, and its offset if that is known.
pub(crate) type Wanted = (u32, Option<[f32; 3]>);

/// Every tenth point is held out.
fn is_held_out(point: usize) -> bool {
    point % 10 == 3
}

/// Held-out points of a check, each with its frame and where it should be moved.
pub(super) struct Checked {
    points: Vec<[f32; 3]>,
    frames: Vec<u32>,
    wanted: Vec<[f32; 3]>,
}

impl Checked {
    /// Mean distance between where the points are and should be, in network units.
    pub(super) fn mean(&self, network: &DeformationNetwork) -> Real {
        let mut out = vec![[0.0; 3]; self.points.len()];
        network.offsets(&self.points, &self.frames, &mut out);
        let off = |(d, w): (&[f32; 3], &[f32; 3])| {
            Vector::from([0, 1, 2].map(|c| f64::from(d[c]) - f64::from(w[c]))).norm()
        };
        out.iter().zip(&self.wanted).map(off).sum::<Real>() / out.len() as Real
    }
}

impl Correspondences {
    /// Converts the positions to the units of `network`.
    ///
    /// # Errors
    ///
    /// Too few points, other frames than the network has, or positions missing or not finite.
    pub(super) fn new(
        network: &DeformationNetwork,
        at: &Frame,
        canonical: &[Point],
        frames: &[Vec<Point>],
    ) -> Result<Self, FitError> {
        let finite = |points: &[Point], place: &dyn Fn() -> String| {
            let units: Vec<[f32; 3]> = points.iter().map(|p| at.to_unit(p)).collect();
            match units.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
                Some(point) => Err(FitError::NotFinite { point, place: place() }),
                None => Ok(units),
            }
        };
        if canonical.len() < FEWEST {
            return Err(FitError::TooFewPoints { got: canonical.len(), needed: FEWEST });
        }
        let expected = network.config().frames;
        if frames.len() != expected {
            return Err(FitError::FrameCount { got: frames.len(), expected });
        }
        let expected = canonical.len();
        if let Some(frame) = frames.iter().position(|f| f.len() != expected) {
            return Err(FitError::PointCount { frame, got: frames[frame].len(), expected });
        }
        let moved = frames.iter().enumerate().map(|(i, f)| finite(f, &|| format!("frame {i}")));
        Ok(Self {
            canonical: finite(canonical, &|| "the canonical points".into())?,
            frames: moved.collect::<Result<_, _>>()?,
        })
    }

    /// Random points of random frames: the first of them between the given points, where the
    /// offset is unknown.
    pub(crate) fn batch(&self, params: &DeformParams, step: u64) -> (Vec<[f32; 3]>, Vec<Wanted>) {
        let mut random = random_of_step(params.seed, step);
        let between = (params.batch as Real * params.between).round() as usize;
        let one = |k: usize| {
            let frame = random.random_range(0..self.frames.len());
            let mut point = random.random_range(0..self.canonical.len());
            if is_held_out(point) {
                point -= 1;
            }
            let p = self.canonical[point];
            if k < between {
                let off = gaussian(&mut random) * params.spread;
                return ([0, 1, 2].map(|c| p[c] + off[c] as f32), (frame as u32, None));
            }
            let q = self.frames[frame][point];
            (p, (frame as u32, Some([0, 1, 2].map(|c| q[c] - p[c]))))
        };
        (0..params.batch).map(one).unzip()
    }

    fn held_out(&self) -> Vec<usize> {
        (0..self.canonical.len()).filter(|k| is_held_out(*k)).collect()
    }

    /// All held-out points in all frames, or [`CHECKED`] of them drawn by `seed`.
    pub(super) fn checked(&self, seed: u64) -> Checked {
        let held = self.held_out();
        let all = held.len() * self.frames.len();
        // All of them if they are few, else a random choice.
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let chosen: Vec<(usize, usize)> = (0..all.min(CHECKED))
            .map(|k| if all > CHECKED { random.random_range(0..all) } else { k })
            .map(|k| (k / held.len(), held[k % held.len()]))
            .collect();
        let wanted = |(frame, point): &(usize, usize)| {
            let (p, q) = (self.canonical[*point], self.frames[*frame][*point]);
            [0, 1, 2].map(|c| q[c] - p[c])
        };
        Checked {
            points: chosen.iter().map(|c| self.canonical[c.1]).collect(),
            frames: chosen.iter().map(|c| c.0 as u32).collect(),
            wanted: chosen.iter().map(wanted).collect(),
        }
    }

    /// Errors at all held-out points, in metres.
    pub(super) fn accuracy(&self, network: &DeformationNetwork, at: &Frame) -> OffsetAccuracy {
        let held = self.held_out();
        let points: Vec<[f32; 3]> = held.iter().map(|k| self.canonical[*k]).collect();
        let mut out = vec![OffsetSample::default(); points.len()];
        let mut error = OffsetAccuracy::default();
        for (i, frame) in self.frames.iter().enumerate() {
            network.samples(&points, &vec![i as u32; points.len()], &mut out);
            for ((k, p), s) in held.iter().zip(&points).zip(&out) {
                let moved = [0, 1, 2].map(|c| f64::from(frame[*k][c] - p[c]));
                let off = Vector::from([0, 1, 2].map(|c| f64::from(s.offset[c]) - moved[c])).norm()
                    / at.scale;
                error.mean += off;
                error.max = error.max.max(off);
                error.still += Vector::from(moved).norm() / at.scale;
                error.strain += strain(s).norm();
            }
        }
        let n = (held.len() * self.frames.len()) as Real;
        OffsetAccuracy {
            mean: error.mean / n,
            still: error.still / n,
            strain: error.strain / n,
            ..error
        }
    }
}
