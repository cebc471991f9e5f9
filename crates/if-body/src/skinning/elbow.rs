//! An arm, for tests.

use crate::skin_weights::SkinWeights;
use if_core::math::{Point, Real};

/// A tube along x with a joint in the origin that bends about z.
pub(super) fn elbow_body() -> (Vec<Point>, SkinWeights) {
    let mut points = Vec::new();
    let mut weights = Vec::new();
    for i in -20..=20 {
        for k in 0..12 {
            let (s, c) = (Real::from(k) * std::f64::consts::TAU / 12.0).sin_cos();
            points.push(Point::new(0.02 * Real::from(i), 0.05 * c, 0.05 * s));
            let lower = (0.5 + 0.1 * i as f32).clamp(0.0, 1.0);
            weights.push([1.0 - lower, lower, 0.0, 0.0]);
        }
    }
    (points.clone(), SkinWeights::new(vec![[0, 1, 0, 0]; points.len()], weights, 2).unwrap())
}
