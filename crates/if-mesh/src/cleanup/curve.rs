//! How rough a closed line is, and Taubin's filter along it.

use super::boundary::SmoothParams;
use if_core::math::{Point, Real};

/// The mean turn from edge to edge above that of a regular polygon, as the root of
///
/// ```text
/// Σ |pᵢ₋₁ − 2pᵢ + pᵢ₊₁|² / Σ |pᵢ₊₁ − pᵢ|²
/// ```
///
/// less 2 sin(π/n), in radians; 0 for a loop without length.
pub(super) fn roughness(points: &[Point]) -> Real {
    let n = points.len();
    let (mut turn, mut size) = (0.0, 0.0);
    for k in 0..n {
        let (a, b, c) = (points[(k + n - 1) % n], points[k], points[(k + 1) % n]);
        turn += ((a - b) + (c - b)).norm_squared();
        size += (c - b).norm_squared();
    }
    if size > 0.0 { ((turn / size).sqrt() - 2.0 * (std::f64::consts::PI / n as Real).sin()).max(0.0) } else { 0.0 }
}

/// One step of λ and one of μ along a closed line.
pub(super) fn taubin_loop(points: &mut [Point], params: &SmoothParams) {
    let n = points.len();
    for factor in [params.lambda, params.mu] {
        let old = points.to_vec();
        for k in 0..n {
            let mean = nalgebra::center(&old[(k + n - 1) % n], &old[(k + 1) % n]);
            points[k] = old[k] + (mean - old[k]) * factor;
        }
    }
}
