//! Oriented points, divided into those that a network learns from and those that it is judged by.

use super::{Samples, SamplingParams, TrainingSet, anywhere};
use crate::accuracy::HeldOut;
use crate::cloud::OrientedPoints;
use crate::error::TargetError;
use crate::loss::Known;
use crate::random::gaussian;
use if_core::aabb::Aabb;
use if_core::field::FieldSample;
use if_core::math::{Point, Real, Vector};
use rand::RngExt;
use rayon::prelude::*;

/// One point of this many is held out.
const OF: usize = 20;
/// A held-out point beside the surface is as far from it as from its own point, if no other point is nearer than
/// this share of that distance: else it lies beside another sheet.
const OWN: Real = 0.8;
/// How often a point beside another sheet is tried at half the distance, before it stays on the surface.
const HALVED: usize = 4;

/// A cloud in two parts.
pub(crate) struct Scan {
    learnt: OrientedPoints,
    /// Those that are held out, with their normals.
    held: Vec<(Point, Vector)>,
    /// Around all.
    aabb: Aabb,
    /// Width over which noise is averaged, in metres.
    smoothing: Real,
}

impl TrainingSet {
    /// Points of a noisy, possibly holed surface. Every twentieth is held out: distances, also those that a
    /// network begins with, are estimated from the others, and judged at points along its normal.
    ///
    /// # Errors
    ///
    /// A parameter out of range, or too few points.
    pub fn of_points(cloud: &OrientedPoints, params: &SamplingParams) -> Result<Self, TargetError> {
        params.validate()?;
        Scan::new(cloud, params)?.training_set(params)
    }
}

impl Scan {
    /// # Errors
    ///
    /// Too few points.
    pub(crate) fn new(
        cloud: &OrientedPoints,
        params: &SamplingParams,
    ) -> Result<Self, TargetError> {
        let all = cloud.points().iter().copied().zip(cloud.normals().iter().copied()).enumerate();
        let (held, learnt): (Vec<_>, Vec<_>) = all.partition(|(i, _)| i % OF == OF - 1);
        let (points, normals) = learnt.into_iter().map(|(_, point)| point).unzip();
        Ok(Self {
            learnt: OrientedPoints::new(points, normals)?,
            held: held.into_iter().map(|(_, point)| point).collect(),
            aabb: cloud.aabb(),
            smoothing: params.smoothing_of(cloud),
        })
    }

    /// Distances by the points that are learnt from, in metres.
    pub(crate) fn distances(&self, points: &[Point], out: &mut [Real]) {
        let distance = |p: &Point| self.learnt.estimate(p, self.smoothing).distance;
        points.par_iter().zip(out).for_each(|(p, d)| *d = distance(p));
    }

    /// Points with what those that are learnt from tell of them, and others to judge by.
    ///
    /// # Errors
    ///
    /// No extent.
    pub(crate) fn training_set(&self, params: &SamplingParams) -> Result<TrainingSet, TargetError> {
        let (learnt, smoothing) = (&self.learnt, self.smoothing);
        let frame = params.frame(&self.aabb)?;
        let mut random = params.random(1);
        let near: Vec<Point> = (0..params.near)
            .map(|k| {
                let p = learnt.points()[random.random_range(0..learnt.points().len())];
                p + gaussian(&mut random) * (params.spread[k % 2] / frame.scale)
            })
            .collect();
        let far = anywhere(&frame, params.far, &mut params.random(2));
        let known = |points: Vec<Point>, near: bool| -> Samples {
            let known = points.par_iter().map(|p| {
                let e = learnt.estimate(p, smoothing);
                // Far from the points only the side and a rough distance are known.
                let trust = e.trust * if near { 1.0 } else { 0.3 };
                Known {
                    distance: (e.distance * frame.scale) as f32,
                    gradient: e.normal.map(|x| x as f32).into(),
                    distance_trust: trust as f32,
                    gradient_trust: if e.nearest <= 2.0 * smoothing { trust as f32 } else { 0.0 },
                }
            });
            Samples {
                known: known.collect(),
                points: points.iter().map(|p| frame.to_unit(p)).collect(),
            }
            .sorted()
        };
        let held_out = self.held_out(params, params.held_out_spread / frame.scale);
        Ok(TrainingSet { frame, near: known(near, true), far: known(far, false), held_out })
    }

    /// Points along the normals of those held out, `spread` metres off, and these themselves.
    fn held_out(&self, params: &SamplingParams, spread: Real) -> HeldOut {
        let mut random = params.random(3);
        let sample = |distance, gradient: &Vector| FieldSample { distance, gradient: *gradient };
        let is_own = |p: &Point, off: Real| {
            self.learnt.estimate(p, self.smoothing).nearest >= OWN * off.abs()
        };
        let offsets: Vec<Real> =
            (0..params.held_out).map(|_| gaussian(&mut random).x * spread).collect();
        let (beside, samples): (Vec<Point>, Vec<FieldSample>) = offsets
            .par_iter()
            .enumerate()
            .map(|(k, off)| {
                let (p, n) = &self.held[k % self.held.len()];
                let mut offs = (0..HALVED).map(|k| off / Real::from(1u32 << k));
                let off = offs.find(|off| is_own(&(p + n * *off), *off)).unwrap_or(0.0);
                (p + n * off, sample(off, n))
            })
            .unzip();
        let on: Vec<Point> = self.held.iter().map(|(p, _)| *p).collect();
        let there: Vec<FieldSample> = self.held.iter().map(|(_, n)| sample(0.0, n)).collect();
        HeldOut::new(&beside, &samples, &on, &there)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    #[test]
    fn every_point_is_learnt_from_or_held_out() {
        let points = meshes::torus(0.5, 0.2, 48, 24).vertices().to_vec();
        let cloud = OrientedPoints::new(points.clone(), points.iter().map(|p| p.coords).collect());
        let scan = Scan::new(&cloud.unwrap(), &SamplingParams::default()).unwrap();
        assert_eq!(scan.held.len(), points.len() / OF);
        assert_eq!(scan.learnt.points().len() + scan.held.len(), points.len());
        assert!(scan.held.iter().all(|(p, _)| !scan.learnt.points().contains(p)));
    }

    #[test]
    fn no_point_to_judge_by_lies_beside_another_sheet() {
        // Two sheets 10 mm apart, which look away from each other.
        let grid = (0..40 * 40).map(|k| (Real::from(k % 40) * 0.005, Real::from(k / 40) * 0.005));
        let (upper, lower) = (
            grid.clone().map(|(x, z)| Point::new(x, 0.01, z)),
            grid.map(|(x, z)| Point::new(x, 0.0, z)),
        );
        let points: Vec<Point> = upper.chain(lower).collect();
        let normals = points.iter().map(|p| if p.y > 0.0 { Vector::y() } else { -Vector::y() });
        let cloud = OrientedPoints::new(points.clone(), normals.collect()).unwrap();
        let params = SamplingParams { held_out: 2000, held_out_spread: 0.1, ..Default::default() };
        let set = TrainingSet::of_points(&cloud, &params).unwrap();
        let (at, distances) = set.held_out.beside();
        let deep = distances.iter().filter(|d| **d < -2e-3).count();
        assert!(deep > 100, "{deep}");
        for (p, d) in at.iter().zip(distances) {
            let truly = (p.y - 0.005).abs() - 0.005;
            assert!((truly - d).abs() <= (1.0 - OWN) * d.abs() + 1e-9, "{p} {d} {truly}");
        }
    }
}
