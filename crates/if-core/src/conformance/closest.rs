//! The contract of [`ClosestPoint`].

use crate::closest::{Closest, ClosestPoint, Feature, closest_on_triangle};
use crate::math::{Point, Real, barycentric_point};
use crate::mesh::TriMesh;
use rayon::prelude::*;

/// Which part of the contract of [`ClosestPoint`] is violated, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClosestFault {
    /// Another point of the mesh is nearer, or the distance is not that to the point.
    #[error(
        "point {index} {point}: nearest point {got:?}, but all triangles give the distance {expected}"
    )]
    Distance {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// The result.
        got: Closest,
        /// The smallest distance to any triangle.
        expected: Real,
    },
    /// Triangle, barycentric coordinates or feature do not match the point.
    #[error("point {index} {point}: {what} in {got:?}")]
    Place {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// What is inconsistent.
        what: &'static str,
        /// The result.
        got: Closest,
    },
    /// A point within the limit is not found, or one beyond it is returned.
    #[error(
        "point {index} {point}: with the limit {limit} m the result is {got:?}, but the nearest triangle is {expected} m away"
    )]
    Limit {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// The limit, in metres.
        limit: Real,
        /// The result.
        got: Option<Closest>,
        /// The smallest distance to any triangle, in metres.
        expected: Real,
    },
    /// The same query returns two different results.
    #[error("point {index} {point}: a second query returns {again:?} instead of {first:?}")]
    Repeat {
        /// Index of the point.
        index: usize,
        /// The point.
        point: Point,
        /// The first result.
        first: Closest,
        /// The second result.
        again: Option<Closest>,
    },
}

/// Checks the contract of [`ClosestPoint`] against all triangles of `mesh`. `tolerance` is the
/// rounding allowed for a length, in metres.
///
/// # Errors
///
/// The first violation.
#[allow(clippy::result_large_err)] // once a test
pub fn check_closest_point(
    surface: &(impl ClosestPoint + ?Sized),
    mesh: &TriMesh,
    points: &[Point],
    tolerance: Real,
) -> Result<(), ClosestFault> {
    let again: Vec<Option<Closest>> =
        points.par_iter().map(|p| surface.closest(p, Real::INFINITY)).collect();
    for (index, (&point, again)) in points.iter().zip(again).enumerate() {
        let nearest = (0..mesh.triangles().len())
            .map(|t| {
                let c = mesh.corners(t);
                (barycentric_point(c, closest_on_triangle(&point, c[0], c[1], c[2]).0) - point)
                    .norm()
            })
            .min_by(Real::total_cmp);
        let got = surface.closest(&point, Real::INFINITY);
        let (Some(expected), Some(first)) = (nearest, got) else {
            if nearest.is_none() && got.is_none() {
                continue;
            }
            let expected = nearest.unwrap_or(Real::INFINITY);
            return Err(ClosestFault::Limit { index, point, limit: Real::INFINITY, got, expected });
        };
        if (first.distance - expected).abs() > tolerance
            || ((first.point - point).norm() - expected).abs() > tolerance
        {
            return Err(ClosestFault::Distance { index, point, got: first, expected });
        }
        if again != Some(first) {
            return Err(ClosestFault::Repeat { index, point, first, again });
        }
        if let Some(what) = misplaced(&first, mesh, tolerance) {
            return Err(ClosestFault::Place { index, point, what, got: first });
        }
        for (limit, found) in
            [(expected * 1.01 + 2.0 * tolerance, true), (expected * 0.99 - 2.0 * tolerance, false)]
        {
            if limit < 0.0 {
                continue;
            }
            let got = surface.closest(&point, limit);
            if got.is_some() != found
                || got.is_some_and(|c| (c.distance - expected).abs() > tolerance)
            {
                return Err(ClosestFault::Limit { index, point, limit, got, expected });
            }
        }
    }
    Ok(())
}

fn misplaced(c: &Closest, mesh: &TriMesh, tolerance: Real) -> Option<&'static str> {
    let b = c.barycentric;
    if c.triangle as usize >= mesh.triangles().len() {
        return Some("the triangle index is out of range");
    }
    if !b.iter().all(|w| *w >= 0.0) || (b.iter().sum::<Real>() - 1.0).abs() > 1e-12 {
        return Some("barycentric coordinates are not three numbers ≥ 0 with sum 1");
    }
    if (barycentric_point(mesh.corners(c.triangle as usize), b) - c.point).norm() > tolerance {
        return Some("barycentric coordinates do not give the point");
    }
    let on_feature = match c.feature {
        Feature::Face => true,
        Feature::Edge(k) => k < 3 && b[(k as usize + 2) % 3] == 0.0,
        Feature::Vertex(k) => k < 3 && b[k as usize] == 1.0,
    };
    (!on_feature).then_some("the feature does not fit the barycentric coordinates")
}

#[cfg(test)]
mod tests {
    use super::super::points;
    use super::*;
    use crate::shapes::meshes;

    /// Nearest points by all triangles, with one error.
    struct Brute<'a>(&'a TriMesh, &'static str);
    impl ClosestPoint for Brute<'_> {
        fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
            let all = (0..self.0.triangles().len()).map(|t| {
                let c = self.0.corners(t);
                let (barycentric, feature) = closest_on_triangle(p, c[0], c[1], c[2]);
                let point = barycentric_point(c, barycentric);
                Closest {
                    point,
                    distance: (point - p).norm(),
                    triangle: t as u32,
                    barycentric,
                    feature,
                }
            });
            let mut best = all.min_by(|a, b| a.distance.total_cmp(&b.distance))?;
            match self.1 {
                "far" => best.distance += 1e-6,
                "corner" => best.barycentric.swap(0, 1),
                "feature" => best.feature = Feature::Vertex(0),
                "limit" => return Some(best),
                _ => {}
            }
            (best.distance <= max_distance).then_some(best)
        }
    }

    #[test]
    #[allow(clippy::result_large_err)]
    fn wrong_nearest_points_are_found() {
        let mesh = meshes::torus(0.8, 0.3, 12, 8);
        let check = |kind| check_closest_point(&Brute(&mesh, kind), &mesh, &points(60), 1e-12);
        assert_eq!(check("none"), Ok(()));
        assert!(matches!(check("far"), Err(ClosestFault::Distance { .. })));
        assert!(matches!(check("corner"), Err(ClosestFault::Place { .. })));
        assert!(matches!(check("feature"), Err(ClosestFault::Place { .. })));
        assert!(matches!(check("limit"), Err(ClosestFault::Limit { .. })));
        let nothing = TriMesh::default();
        assert_eq!(
            check_closest_point(&Brute(&nothing, "none"), &nothing, &points(3), 0.0),
            Ok(())
        );
    }
}
