//! Training and held-out points: many near the surface, some everywhere, the same for the same
//! seed.

mod scan;
mod surface;

pub(crate) use scan::Scan;

use crate::accuracy::HeldOut;
use crate::cloud::OrientedPoints;
use crate::error::TargetError;
use crate::frame::Frame;
use crate::loss::Known;
use crate::random::gaussian;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::parameter::ParameterError;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Counts and places of training points. Lengths are in network units, halves of the cube's side, unless
/// they are given in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SamplingParams {
    /// Training points near the surface.
    pub near: usize,
    /// Training points anywhere in the cube.
    pub far: usize,
    /// Held-out points near the surface. Of oriented points these lie along the normals of every twentieth,
    /// which nothing else is taken from.
    pub held_out: usize,
    /// Standard deviations of the training points' distance from the surface; they are used in
    /// turn.
    pub spread: [Real; 2],
    /// Standard deviation of the held-out points' distance from the surface.
    pub held_out_spread: Real,
    /// Free space between the box of the target and the cube, in metres; `None` is 6 % of the
    /// longest side.
    pub margin: Option<Real>,
    /// Of oriented points: width over which noise is averaged, in metres; `None` is 1.5 times their
    /// spacing.
    pub smoothing: Option<Real>,
    /// Seed of all points.
    pub seed: u64,
}

impl Default for SamplingParams {
    fn default() -> Self {
        Self {
            near: 300_000,
            far: 40_000,
            held_out: 20_000,
            spread: [0.004, 0.02],
            held_out_spread: 0.01,
            margin: None,
            smoothing: None,
            seed: 1,
        }
    }
}

impl SamplingParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (name, count) in [("near", self.near), ("far", self.far), ("held_out", self.held_out)] {
            let ok = (64..=1 << 28).contains(&count);
            ParameterError::check(name, count as Real, ok, "from 64 to 2^28 points")?;
        }
        for (index, spread) in self.spread.into_iter().enumerate() {
            ParameterError::check_share("spread", spread).map_err(|e| e.at(index))?;
        }
        ParameterError::check_share("held_out_spread", self.held_out_spread)?;
        for (name, length) in [("margin", self.margin), ("smoothing", self.smoothing)] {
            length.map_or(Ok(()), |length| ParameterError::check_positive(name, length))?;
        }
        Ok(())
    }

    /// The width over which noise of `cloud` is averaged, in metres.
    pub(crate) fn smoothing_of(&self, cloud: &OrientedPoints) -> Real {
        self.smoothing.unwrap_or(1.5 * cloud.spacing())
    }

    fn frame(&self, aabb: &if_core::aabb::Aabb) -> Result<Frame, TargetError> {
        Frame::around(aabb, self.margin.unwrap_or(0.06 * aabb.size().amax()))
    }

    fn random(&self, stream: u64) -> Pcg64Mcg {
        Pcg64Mcg::seed_from_u64(self.seed ^ stream.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }
}

/// Points with what is known at them, in the order of a space-filling curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Where, in network units.
    pub points: Vec<[f32; 3]>,
    /// What is known there.
    pub known: Vec<Known>,
}

/// Training points, and held-out points to measure at.
#[derive(Clone, Debug)]
pub struct TrainingSet {
    /// Where the cube lies.
    pub frame: Frame,
    /// Points near the surface.
    pub near: Samples,
    /// Points anywhere in the cube.
    pub far: Samples,
    /// Points that no step uses.
    pub held_out: HeldOut,
}

impl TrainingSet {
    /// Points of a field that is finite all over its box, such as that of a closed mesh.
    ///
    /// # Errors
    ///
    /// See [`TargetError`].
    pub fn of_field(
        target: &(impl SignedDistance + ?Sized),
        params: &SamplingParams,
    ) -> Result<Self, TargetError> {
        params.validate()?;
        let bounds = target.bounds().ok_or(TargetError::Unbounded)?;
        let frame = params.frame(&bounds)?;
        let per_point = 4;
        let surface = surface::points(
            target,
            &bounds,
            params.near.div_ceil(per_point),
            &mut params.random(1),
        )?;
        let mut random = params.random(2);
        let near: Vec<Point> = (0..params.near)
            .map(|k| {
                surface[k / per_point]
                    + gaussian(&mut random) * (params.spread[k % 2] / frame.scale)
            })
            .collect();
        let far = anywhere(&frame, params.far, &mut params.random(3));
        let judged = surface::points(target, &bounds, params.held_out, &mut params.random(4))?;
        let mut random = params.random(5);
        let beside: Vec<Point> = judged
            .iter()
            .map(|p| p + gaussian(&mut random) * (params.held_out_spread / frame.scale))
            .collect();
        let near = known_of_field(target, &frame, near, 1.0)?;
        let far = known_of_field(target, &frame, far, 0.0)?;
        let held_out =
            HeldOut::new(&beside, &sampled(target, &beside)?, &judged, &sampled(target, &judged)?);
        Ok(Self { frame, near, far, held_out })
    }
}

fn anywhere(frame: &Frame, n: usize, random: &mut Pcg64Mcg) -> Vec<Point> {
    (0..n).map(|_| frame.to_metres(&[0; 3].map(|_| random.random_range(-1.0..1.0)))).collect()
}

fn sampled(
    target: &(impl SignedDistance + ?Sized),
    points: &[Point],
) -> Result<Vec<FieldSample>, TargetError> {
    let mut samples = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
    target.samples(points, &mut samples);
    match samples
        .iter()
        .position(|s| !(s.distance.is_finite() && s.gradient.iter().all(|g| g.is_finite())))
    {
        Some(k) => Err(TargetError::NotFinite { point: points[k], sample: samples[k] }),
        None => Ok(samples),
    }
}

fn known_of_field(
    target: &(impl SignedDistance + ?Sized),
    frame: &Frame,
    points: Vec<Point>,
    gradient_trust: f32,
) -> Result<Samples, TargetError> {
    let samples = sampled(target, &points)?;
    let known = samples.iter().map(|s| {
        let n = unit_or_zero(&s.gradient);
        Known {
            distance: (s.distance * frame.scale) as f32,
            gradient: n.map(|x| x as f32).into(),
            distance_trust: 1.0,
            gradient_trust: if n == Vector::zeros() { 0.0 } else { gradient_trust },
        }
    });
    Ok(Samples {
        known: known.collect(),
        points: points.iter().map(|p| frame.to_unit(p)).collect(),
    }
    .sorted())
}

impl Samples {
    /// Along the curve of Morton 1966: a batch that takes one point of each stretch is spread
    /// evenly, and its points read memory in order.
    fn sorted(self) -> Self {
        let spread = |x: u64| {
            let x = (x | x << 32) & 0x001f_0000_0000_ffff;
            let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
            let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
            let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
            (x | x << 2) & 0x1249_2492_4924_9249
        };
        let code = |p: &[f32; 3]| {
            let [x, y, z] =
                p.map(|x| spread(((x + 2.0) * 262_144.0).clamp(0.0, 1_048_575.0) as u64));
            x | y << 1 | z << 2
        };
        let mut order: Vec<(u64, u32)> =
            self.points.iter().enumerate().map(|(i, p)| (code(p), i as u32)).collect();
        order.sort_unstable();
        Self {
            points: order.iter().map(|(_, i)| self.points[*i as usize]).collect(),
            known: order.iter().map(|(_, i)| self.known[*i as usize]).collect(),
        }
    }

    /// Appends `n` points to a batch, one of each of `n` equal stretches of the curve.
    pub(crate) fn draw(&self, n: usize, random: &mut Pcg64Mcg, to: &mut Samples) {
        let len = self.points.len();
        for k in 0..n {
            let (from, end) = (k * len / n, (k + 1) * len / n);
            let i = if end > from + 1 { random.random_range(from..end) } else { from.min(len - 1) };
            to.points.push(self.points[i]);
            to.known.push(self.known[i]);
        }
    }
}

#[cfg(test)]
mod tests;
