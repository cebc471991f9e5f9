//! Fitting a deformation to sequences of corresponding points: where each material point of the
//! canonical body is in each frame.

use crate::adam::{Adam, AdamParams};
use crate::deformation::{DeformationNetwork, OffsetLoss, OffsetSample};
use crate::frame::Frame;
use crate::parameter_error::ParameterError;
use crate::schedule::Schedule;
use if_core::math::{Point, Real, Vector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::time::Instant;

/// How to fit a deformation. Lengths are in network units unless they say metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeformParams {
    /// Points of a step, each of a random frame.
    pub batch: usize,
    /// Steps.
    pub steps: u64,
    /// Time at most, in seconds.
    pub seconds: Option<Real>,
    /// Weight of the distance between where a point is and where it should be.
    pub data: f64,
    /// Errors above this count linearly.
    pub data_scale: f64,
    /// Weight of rigidity: ‖FᵀF − 1‖² / 4 with F = 1 + ∂d/∂x, forgiven beyond `rigidity_scale` as
    /// by Geman and McClure.
    pub rigidity: f64,
    /// c of the forgiving.
    pub rigidity_scale: f64,
    /// Weight of |d|², forgiven beyond `small_scale`.
    pub small: f64,
    /// c of the forgiving.
    pub small_scale: f64,
    /// Share of the points of a step that lie between the given ones instead of on them: rigidity
    /// and smallness alone hold there. They are given points moved by N(0, `spread`).
    pub between: Real,
    /// How far.
    pub spread: Real,
    /// Iterations of the annealing of the encoding to one step; 0 has all bands from the start.
    pub anneal: usize,
    /// The learning rate.
    pub schedule: Schedule,
    /// The optimiser.
    pub adam: AdamParams,
    /// Seed of the batches.
    pub seed: u64,
}

impl Default for DeformParams {
    fn default() -> Self {
        Self {
            batch: 2048,
            steps: 2000,
            seconds: None,
            data: 1.0,
            data_scale: 5e-3,
            rigidity: 2e-4,
            rigidity_scale: 0.5,
            small: 1e-5,
            small_scale: 0.05,
            between: 0.25,
            spread: 0.02,
            anneal: 4,
            schedule: Schedule { rate: 1e-3, warmup: 20, last: 0.02 },
            adam: AdamParams {
                beta2: 0.999,
                epsilon: 1e-8,
                sparse: false,
                ..AdamParams::default()
            },
            seed: 1,
        }
    }
}

/// Why there is no deformation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DeformError {
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Next to nothing to fit to.
    #[error("fewer than 4 canonical points, and some are held out to measure at; give more")]
    Empty,
    /// Other frames than the network has.
    #[error("{got} frames of positions, the network has {expected}")]
    Frames {
        /// Frames given.
        got: usize,
        /// Of the network.
        expected: usize,
    },
    /// A frame with other points.
    #[error("frame {frame} has {got} positions for {expected} canonical points")]
    Positions {
        /// Which frame.
        frame: usize,
        /// Positions given.
        got: usize,
        /// Canonical points.
        expected: usize,
    },
    /// A position is NaN or infinite, or too large for single precision in the network's cube.
    #[error("point {point} of {place} is not finite; leave it out of all frames")]
    NotFinite {
        /// Which point.
        point: usize,
        /// `frame 7`, or `the canonical points`.
        place: String,
    },
    /// The network is not a number at the very start.
    #[error(
        "the network or its error at the held-out points is not a number before the first step; make it anew"
    )]
    NotANumber,
}

/// How a fit of a deformation went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeformReport {
    /// Steps done.
    pub steps: u64,
    /// Step of the state that was kept: that with the least error at a check; 0 for the one it
    /// began with.
    pub kept: u64,
    /// Whether it ended as its loss or the network was no number any more, or as its error rose far
    /// above the least.
    pub diverged: bool,
    /// Whether the caller broke.
    pub cancelled: bool,
    /// Seconds of the steps.
    pub seconds: Real,
    /// Errors at the held-out points: every tenth, in all frames.
    pub error: OffsetError,
}

/// Errors of a deformation, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OffsetError {
    /// Mean distance between where points are and should be.
    pub mean: Real,
    /// The largest.
    pub max: Real,
    /// The same mean for no deformation at all: how far points move.
    pub still: Real,
    /// Mean of ‖FᵀF − 1‖ / 2, the strain: zero where the motion is rigid.
    pub strain: Real,
}

/// Where each canonical point is in each frame, in network units.
struct Correspondences {
    canonical: Vec<[f32; 3]>,
    frames: Vec<Vec<[f32; 3]>>,
}

/// Every tenth point is held out.
fn is_held_out(point: usize) -> bool {
    point % 10 == 3
}

/// Steps from one check on held-out points to the next. At ten times more a good state between two
/// checks is lost; at ten times less the checks take as long as the steps.
const CHECK_EVERY: u64 = 50;
/// Held-out points of a check, each of a frame: no more than a step has by default. The report has
/// all of them.
const CHECKED: usize = 2048;
/// A check that finds the error this many times the least one, or this many times `data_scale`
/// where that is more, stops the fit as diverged.
const DIVERGED: Real = 50.0;

/// Fits `network`, embeddings included, to `frames[i][k]`, where canonical point `k` is in frame
/// `i`, in metres; `progress` hears of each step and its mean loss.
///
/// Then the network has the parameters, and the α, of the check with the least error; the first
/// check is before the first step, so that a fit never leaves more error at the checked points than
/// there was.
///
/// # Errors
///
/// Parameters out of range, positions that are missing or not finite, a network that is no number
/// at the start.
pub fn fit_deformation(
    network: &mut DeformationNetwork,
    at: &Frame,
    canonical: &[Point],
    frames: &[Vec<Point>],
    params: &DeformParams,
    progress: &mut dyn FnMut(u64, Real) -> ControlFlow<()>,
) -> Result<DeformReport, DeformError> {
    params.validate()?;
    let data = Correspondences::new(network, at, canonical, frames)?;
    let checked = data.checked(params.seed);
    let mut best = Best {
        step: 0,
        mean: checked.mean(network),
        alpha: network.alpha(),
        theta: network.parameters().to_vec(),
    };
    if !best.mean.is_finite() || !is_finite(network) {
        return Err(DeformError::NotANumber);
    }
    let mut adam = Adam::new(params.adam, network.parameters().len())?;
    let mut gradient = vec![0.0; network.parameters().len()];
    let (mut diverged, mut cancelled, mut step, start) = (false, false, 0, Instant::now());
    while step < params.steps {
        let done = step as Real / params.steps as Real;
        let timed = params.seconds.map_or(0.0, |s| start.elapsed().as_secs_f64() / s);
        if timed >= 1.0 {
            break;
        }
        if params.anneal > 0 {
            network.anneal((step as usize).saturating_mul(params.anneal));
        }
        let (points, wanted) = data.batch(params, step);
        let frames: Vec<u32> = wanted.iter().map(|w| w.0).collect();
        let share = 1.0 / params.batch as f64;
        let loss = |i: usize, s: OffsetSample| params.loss(wanted[i].1.as_ref(), &s, share);
        let total = network.loss_gradient(&points, &frames, &loss, &mut gradient);
        if !total.is_finite() || !gradient.iter().all(|g| g.is_finite()) {
            diverged = true;
            break;
        }
        adam.step(
            network.parameters_mut(),
            &gradient,
            params.schedule.rate(step, done.max(timed)) as f32,
        );
        network.refresh();
        step += 1;
        if step.is_multiple_of(CHECK_EVERY) && !best.judge(network, step, &checked, params) {
            diverged = true;
            break;
        }
        if progress(step, total).is_break() {
            cancelled = true;
            break;
        }
    }
    diverged = diverged || !best.judge(network, step, &checked, params);
    best.install(network);
    let error = data.error(network, at);
    Ok(DeformReport {
        steps: step,
        kept: best.step,
        diverged,
        cancelled,
        seconds: start.elapsed().as_secs_f64(),
        error,
    })
}

fn is_finite(network: &DeformationNetwork) -> bool {
    network.parameters().iter().all(|p| p.is_finite())
}

/// The state with the least error so far. Bands that the annealing did not reach were never
/// trained: α belongs to it.
struct Best {
    step: u64,
    mean: Real,
    alpha: f32,
    theta: Vec<f32>,
}

impl Best {
    /// Keeps the network's state if it is the best; false where it is hopeless.
    fn judge(
        &mut self,
        network: &DeformationNetwork,
        step: u64,
        checked: &Checked,
        params: &DeformParams,
    ) -> bool {
        // A closed ReLU makes a 0 of NaN: the error alone does not tell.
        let mean = if is_finite(network) { checked.mean(network) } else { Real::NAN };
        if !mean.is_finite() || mean > DIVERGED * self.mean.max(params.data_scale) {
            return false;
        }
        if mean < self.mean {
            (self.step, self.mean, self.alpha) = (step, mean, network.alpha());
            self.theta.copy_from_slice(network.parameters());
        }
        true
    }

    fn install(&self, network: &mut DeformationNetwork) {
        network.parameters_mut().copy_from_slice(&self.theta);
        network.set_alpha(self.alpha);
        network.refresh();
    }
}

/// Held-out points of a check, each with its frame and where it should be moved.
struct Checked {
    points: Vec<[f32; 3]>,
    frames: Vec<u32>,
    wanted: Vec<[f32; 3]>,
}

impl Checked {
    /// Mean distance between where the points are and should be, in network units.
    fn mean(&self, network: &DeformationNetwork) -> Real {
        let mut out = vec![[0.0; 3]; self.points.len()];
        network.offsets(&self.points, &self.frames, &mut out);
        let off = |(d, w): (&[f32; 3], &[f32; 3])| {
            Vector::from([0, 1, 2].map(|c| f64::from(d[c]) - f64::from(w[c]))).norm()
        };
        out.iter().zip(&self.wanted).map(off).sum::<Real>() / out.len() as Real
    }
}

impl Correspondences {
    fn new(
        network: &DeformationNetwork,
        at: &Frame,
        canonical: &[Point],
        frames: &[Vec<Point>],
    ) -> Result<Self, DeformError> {
        let finite = |points: &[Point], place: &dyn Fn() -> String| {
            let units: Vec<[f32; 3]> = points.iter().map(|p| at.to_unit(p)).collect();
            match units.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
                Some(point) => Err(DeformError::NotFinite { point, place: place() }),
                None => Ok(units),
            }
        };
        // One of ten is held out: with fewer there may be none.
        if canonical.len() < 4 {
            return Err(DeformError::Empty);
        }
        let expected = network.config().frames;
        if frames.len() != expected {
            return Err(DeformError::Frames { got: frames.len(), expected });
        }
        let expected = canonical.len();
        if let Some(frame) = frames.iter().position(|f| f.len() != expected) {
            return Err(DeformError::Positions { frame, got: frames[frame].len(), expected });
        }
        let moved = frames.iter().enumerate().map(|(i, f)| finite(f, &|| format!("frame {i}")));
        Ok(Self {
            canonical: finite(canonical, &|| "the canonical points".into())?,
            frames: moved.collect::<Result<_, _>>()?,
        })
    }

    /// Points, each with its frame, and the offset wanted there, if it is known.
    #[allow(clippy::type_complexity)]
    fn batch(
        &self,
        params: &DeformParams,
        step: u64,
    ) -> (Vec<[f32; 3]>, Vec<(u32, Option<[f32; 3]>)>) {
        let mut random =
            Pcg64Mcg::seed_from_u64(params.seed ^ (step + 1).wrapping_mul(0xd134_2543_de82_ef95));
        let between = (params.batch as Real * params.between).round() as usize;
        let one = |k: usize| {
            let frame = random.random_range(0..self.frames.len());
            let mut point = random.random_range(0..self.canonical.len());
            if is_held_out(point) {
                point -= 1;
            }
            let p = self.canonical[point];
            if k < between {
                let off = crate::sampling::gaussian(&mut random) * params.spread;
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
    fn checked(&self, seed: u64) -> Checked {
        let held = self.held_out();
        let all = held.len() * self.frames.len();
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

    fn error(&self, network: &DeformationNetwork, at: &Frame) -> OffsetError {
        let held = self.held_out();
        let points: Vec<[f32; 3]> = held.iter().map(|k| self.canonical[*k]).collect();
        let mut out = vec![OffsetSample::default(); points.len()];
        let mut error = OffsetError::default();
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
        OffsetError {
            mean: error.mean / n,
            still: error.still / n,
            strain: error.strain / n,
            ..error
        }
    }
}

fn gradient_of(s: &OffsetSample) -> nalgebra::Matrix3<f64> {
    nalgebra::Matrix3::from_fn(|r, c| f64::from(s.jacobian[r][c]) + f64::from(u8::from(r == c)))
}

/// (FᵀF − 1) / 2.
fn strain(s: &OffsetSample) -> nalgebra::Matrix3<f64> {
    let f = gradient_of(s);
    (f.transpose() * f - nalgebra::Matrix3::identity()) * 0.5
}

impl DeformParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let fault = |name, value, needs| Err(ParameterError { name, value, needs });
        if !(1..=1 << 24).contains(&self.batch) {
            return fault("batch", self.batch as f64, "from 1 to 2^24 points");
        }
        if !(0.0..=1.0).contains(&self.between) {
            return fault("between", self.between, "from 0 to 1");
        }
        for (name, value) in [
            ("data", self.data),
            ("rigidity", self.rigidity),
            ("small", self.small),
            ("spread", self.spread),
        ] {
            ParameterError::unless_at_least_zero(name, value)?;
        }
        let scales = [
            ("data_scale", self.data_scale),
            ("rigidity_scale", self.rigidity_scale),
            ("small_scale", self.small_scale),
        ];
        for (name, value) in scales.into_iter().chain(self.seconds.map(|s| ("seconds", s))) {
            ParameterError::unless_above_zero(name, value)?;
        }
        self.schedule.validate()?;
        self.adam.validate()
    }

    /// The loss at a point where `wanted` is the offset, if it is known.
    fn loss(&self, wanted: Option<&[f32; 3]>, s: &OffsetSample, share: f64) -> OffsetLoss {
        let d = s.offset.map(f64::from);
        let (mut loss, mut d_offset) = (0.0, [0.0; 3]);
        if let Some(wanted) = wanted {
            let e = [0, 1, 2].map(|k| d[k] - f64::from(wanted[k]));
            let root =
                (e.iter().map(|x| x * x).sum::<f64>() + self.data_scale * self.data_scale).sqrt();
            loss += self.data * share * (root - self.data_scale);
            (0..3).for_each(|k| d_offset[k] += self.data * share * e[k] / root);
        }
        // Geman and McClure 1985: s / (s + c²).
        let forgiven = |square: f64, c: f64| {
            let below = square + c * c;
            (square / below, c * c / (below * below))
        };
        let (small, slope) = forgiven(d.iter().map(|x| x * x).sum(), self.small_scale);
        loss += self.small * share * small;
        (0..3).for_each(|k| d_offset[k] += self.small * share * slope * 2.0 * d[k]);
        let (f, e) = (gradient_of(s), strain(s));
        let (stretched, slope) = forgiven(e.norm_squared(), self.rigidity_scale);
        loss += self.rigidity * share * stretched;
        let by_f = f * e * (2.0 * self.rigidity * share * slope);
        let d_jacobian = [0, 1, 2].map(|r| [0, 1, 2].map(|c| by_f[(r, c)] as f32));
        OffsetLoss { loss, d_offset: d_offset.map(|x| x as f32), d_jacobian }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mlp::DeformationConfig;

    #[test]
    fn derivatives_of_the_loss_are_central_differences() {
        let params = DeformParams {
            rigidity: 0.7,
            small: 0.4,
            data: 0.9,
            data_scale: 0.1,
            small_scale: 0.5,
            ..Default::default()
        };
        let sample = OffsetSample {
            offset: [0.1, -0.2, 0.05],
            jacobian: [[0.1, 0.3, -0.2], [0.0, -0.1, 0.4], [0.2, 0.1, 0.3]],
        };
        let at = |s: &OffsetSample| params.loss(Some(&[0.3, 0.1, 0.0]), s, 0.5);
        let got = at(&sample);
        let h = 1e-3f32;
        for k in 0..3 {
            let moved = |d: f32| {
                let mut s = sample;
                s.offset[k] += d;
                at(&s).loss
            };
            approx::assert_abs_diff_eq!(
                f64::from(got.d_offset[k]),
                (moved(h) - moved(-h)) / 2e-3,
                epsilon = 1e-4
            );
            for c in 0..3 {
                let moved = |d: f32| {
                    let mut s = sample;
                    s.jacobian[k][c] += d;
                    at(&s).loss
                };
                approx::assert_abs_diff_eq!(
                    f64::from(got.d_jacobian[k][c]),
                    (moved(h) - moved(-h)) / 2e-3,
                    epsilon = 1e-4
                );
            }
        }
        let turned = OffsetSample {
            offset: [0.0; 3],
            jacobian: [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0; 3]],
        };
        assert!(strain(&turned).norm() < 1e-12, "a turn by 90° is rigid");
    }

    /// A bar whose upper half bends to and fro.
    fn bending() -> (Vec<Point>, Vec<Vec<Point>>) {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let mut within = |a: f64, b: f64| random.random_range(a..b);
        let canonical: Vec<Point> = (0..400)
            .map(|_| Point::new(within(-0.1, 0.1), within(-0.9, 0.9), within(-0.1, 0.1)))
            .collect();
        let frames = (0..5).map(|i| {
            let bend = 0.3 * (i as f64 - 2.0) / 2.0;
            canonical.iter().map(|p| p + Vector::x() * (bend * p.y.max(0.0).powi(2))).collect()
        });
        (canonical.clone(), frames.collect())
    }

    #[test]
    fn a_known_motion_is_learned_and_seen_at_points_that_were_held_out() {
        let (canonical, frames) = bending();
        let config = DeformationConfig { bands: 2, embedding: 8, frames: 5, width: 32, layers: 2 };
        let mut network = DeformationNetwork::new(&config, 1).unwrap();
        let params = DeformParams {
            steps: 250,
            batch: 128,
            anneal: 40,
            schedule: Schedule { rate: 5e-3, ..DeformParams::default().schedule },
            ..Default::default()
        };
        let run = fit_deformation(
            &mut network,
            &Frame::UNIT,
            &canonical,
            &frames,
            &params,
            &mut |_, _| ControlFlow::Continue(()),
        );
        let report = run.unwrap();
        assert!(
            report.error.mean < 0.25 * report.error.still && report.error.still > 0.02,
            "{report:?}"
        );
        assert!(report.error.strain < 0.5 && !report.diverged, "{report:?}");
    }

    #[test]
    fn bad_input_is_named() {
        let (canonical, frames) = bending();
        let config = DeformationConfig { bands: 2, embedding: 8, frames: 5, width: 16, layers: 2 };
        let mut network = DeformationNetwork::new(&config, 1).unwrap();
        let mut run = |canonical: &[Point], frames: &[Vec<Point>], params: DeformParams| {
            fit_deformation(&mut network, &Frame::UNIT, canonical, frames, &params, &mut |_, _| {
                ControlFlow::Break(())
            })
        };
        let params = DeformParams { batch: 8, ..Default::default() };
        for few in 0..4 {
            let fault = run(&canonical[..few], &frames, params).unwrap_err();
            assert!(
                fault == DeformError::Empty
                    && fault.to_string().contains("fewer than 4 canonical points"),
                "{fault}"
            );
        }
        assert_eq!(
            run(&canonical, &frames[1..], params),
            Err(DeformError::Frames { got: 4, expected: 5 })
        );
        let mut short = frames.clone();
        short[3].pop();
        assert_eq!(
            run(&canonical, &short, params),
            Err(DeformError::Positions { frame: 3, got: 399, expected: 400 })
        );
        let mut bad = frames.clone();
        bad[2][7].z = f64::NAN;
        assert_eq!(
            run(&canonical, &bad, params),
            Err(DeformError::NotFinite { point: 7, place: "frame 2".into() })
        );
        bad[2][7].z = 1e300;
        assert_eq!(
            run(&canonical, &bad, params),
            Err(DeformError::NotFinite { point: 7, place: "frame 2".into() })
        );
        for (bad, name) in [
            (DeformParams { batch: 0, ..params }, "batch"),
            (
                DeformParams { adam: AdamParams { beta2: 1.0, ..params.adam }, ..params },
                "adam.beta2",
            ),
            (
                DeformParams { adam: AdamParams { beta2: f32::NAN, ..params.adam }, ..params },
                "adam.beta2",
            ),
            (
                DeformParams { schedule: Schedule { rate: 1e300, ..params.schedule }, ..params },
                "schedule.rate",
            ),
        ] {
            let fault = run(&canonical, &frames, bad).unwrap_err();
            assert!(
                matches!(fault, DeformError::Parameter(ParameterError { name: n, .. }) if n == name),
                "{fault}"
            );
        }
        let report = run(&canonical, &frames, params).unwrap();
        assert!(report.cancelled && report.steps == 1);
        network.parameters_mut()[5] = f32::NAN;
        let never = &mut |_, _| ControlFlow::Continue(());
        assert_eq!(
            fit_deformation(&mut network, &Frame::UNIT, &canonical, &frames, &params, never),
            Err(DeformError::NotANumber)
        );
    }

    #[test]
    fn a_fit_that_runs_away_leaves_the_state_it_began_with() {
        let (canonical, frames) = bending();
        let config = DeformationConfig { bands: 2, embedding: 8, frames: 5, width: 32, layers: 2 };
        let start = DeformationNetwork::new(&config, 1).unwrap();
        let usual = DeformParams::default().schedule;
        let run = |rate: f64, steps: u64| {
            let mut network = start.clone();
            let params = DeformParams {
                batch: 64,
                steps,
                schedule: Schedule { rate, ..usual },
                ..Default::default()
            };
            let go_on = &mut |_, _| ControlFlow::Continue(());
            let report =
                fit_deformation(&mut network, &Frame::UNIT, &canonical, &frames, &params, go_on)
                    .unwrap();
            (report, network)
        };
        let before = run(1e-3, 0).0.error;
        assert!(before.mean > 0.02, "{before:?}");
        // Far off after a step; no numbers after the last step, or after one more.
        for (rate, steps) in [(1e6, 1), (1e30, 1), (1e38, 1), (1e38, 2), (1e38, CHECK_EVERY)] {
            let (report, network) = run(rate, steps);
            assert_eq!(
                (report.kept, report.diverged, report.error),
                (0, true, before),
                "rate {rate}: {report:?}"
            );
            assert!(
                network.parameters() == start.parameters() && network.alpha() == start.alpha(),
                "rate {rate}"
            );
        }
        // Too fast to learn: what is left is no worse than the start.
        let (report, network) = run(10.0, 300);
        assert!(report.error.mean <= before.mean, "{report:?}");
        assert!(report.kept > 0 || network.parameters() == start.parameters());
    }
}
