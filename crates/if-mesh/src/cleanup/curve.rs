//! Closed polylines: roughness, and Taubin's filter.

use super::params::SmoothParams;
use if_core::math::{Point, Real};

/// The root mean square turning angle from edge to edge, above that of a regular polygon: the root
/// of
///
/// ```text
/// Σ |pᵢ₋₁ − 2pᵢ + pᵢ₊₁|² / Σ |pᵢ₊₁ − pᵢ|²
/// ```
///
/// less 2 sin(π/n), in radians. 0 for a loop of zero length.
pub(super) fn roughness(points: &[Point]) -> Real {
    let n = points.len();
    let (mut turn, mut size) = (0.0, 0.0);
    let mut a = points.last();
    for (b, c) in points.iter().zip(points.iter().skip(1).chain(points.first())) {
        turn += ((a.unwrap_or(b) - b) + (c - b)).norm_squared();
        size += (c - b).norm_squared();
        a = Some(b);
    }
    if size > 0.0 {
        ((turn / size).sqrt() - 2.0 * (std::f64::consts::PI / n as Real).sin()).max(0.0)
    } else {
        0.0
    }
}

/// One step of λ and one of μ along a closed polyline.
pub(super) fn taubin_loop(points: &mut [Point], params: &SmoothParams) {
    for factor in [params.lambda, params.mu] {
        map_loop(points, |a, b, c| b + (nalgebra::center(a, c) - b) * factor);
    }
}

/// Replaces each point of a closed polyline by a function of the old positions of its predecessor,
/// itself and its successor.
pub(super) fn map_loop(points: &mut [Point], map: impl Fn(&Point, &Point, &Point) -> Point) {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return };
    let mut before = last;
    for k in 0..points.len() {
        let here = points[k];
        let after = points.get(k + 1).copied().unwrap_or(first);
        points[k] = map(&before, &here, &after);
        before = here;
    }
}
