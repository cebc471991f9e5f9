//! Fields that garments come with, such as a trained φ: what Algorithm 1 reads of a layer instead of
//! its mesh.

use crate::outfit::Outfit;
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::masked::{BoxMask, Masked};
use if_core::math::{Point, Real};
use if_mesh::baked::Baked;

/// The field of a garment, in metres and in the pose of the outfit, if it comes with one.
///
/// Any field that is right round the garment will do, such as that of a whole clothed person: it is
/// masked by the box of the garment (Appendix C).
pub type FieldOfGarment<'a> = Option<&'a dyn SignedDistance>;

/// The nearest of the layers below: the union of their meshes, and the masked fields of the others.
pub(crate) struct Nearest<'a> {
    /// The body and layers without a field.
    pub(crate) meshes: Baked,
    /// The others.
    pub(crate) fields: Vec<Masked<&'a dyn SignedDistance, BoxMask>>,
}

impl SignedDistance for Nearest<'_> {
    fn distance(&self, p: &Point) -> Real {
        self.fields.iter().map(|f| f.distance(p)).fold(self.meshes.distance(p), Real::min)
    }

    fn sample(&self, p: &Point) -> FieldSample {
        self.fields.iter().map(|f| f.sample(p)).fold(self.meshes.sample(p), nearer)
    }

    fn distances(&self, points: &[Point], out: &mut [Real]) {
        self.meshes.distances(points, out);
        let mut others = vec![0.0; points.len()];
        for field in &self.fields {
            field.distances(points, &mut others);
            out.iter_mut().zip(&others).for_each(|(o, d)| *o = o.min(*d));
        }
    }

    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        self.meshes.samples(points, out);
        let mut others = out.to_vec();
        for field in &self.fields {
            field.samples(points, &mut others);
            out.iter_mut().zip(&others).for_each(|(o, s)| *o = nearer(*o, *s));
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        let boxes = self.fields.iter().map(SignedDistance::bounds);
        boxes.chain([self.meshes.bounds()]).try_fold(Aabb::EMPTY, |all, b| Some(all.merged(&b?)))
    }

    fn lipschitz(&self) -> Real {
        self.fields.iter().map(SignedDistance::lipschitz).fold(self.meshes.lipschitz(), Real::max)
    }

    /// The least of all: `distance` is at most that of each.
    fn free_radius(&self, p: &Point, distance: Real, clearance: Real) -> Real {
        let all = self.fields.iter().map(|f| f.free_radius(p, distance, clearance));
        all.fold(self.meshes.free_radius(p, distance, clearance), Real::min)
    }
}

fn nearer(a: FieldSample, b: FieldSample) -> FieldSample {
    if b.distance < a.distance { b } else { a }
}

/// A garment whose field is NaN, and where: of the vertices in its box of garments over it and of its own, at which
/// the field is read first.
pub(crate) fn undefined(outfit: &Outfit, fields: &[FieldOfGarment<'_>]) -> Option<(usize, Point)> {
    fields.iter().enumerate().find_map(|(k, field)| {
        let garments = &outfit.garments[k..];
        let aabb = Aabb::from_points(garments[0].mesh.vertices());
        let all = garments.iter().flat_map(|layer| layer.mesh.vertices());
        let points: Vec<Point> = all.filter(|p| aabb.contains(p)).copied().collect();
        let mut distances = vec![0.0; points.len()];
        (*field)?.distances(&points, &mut distances);
        let at = distances.iter().position(|d| d.is_nan())?;
        Some((k, points[at]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::monitor::Silent;
    use if_core::shapes::Sphere;
    use if_mesh::baked::BakeParams;

    #[test]
    fn batches_and_points_agree_and_the_free_radius_holds() {
        let [body, vest] =
            [0.0, 0.4].map(|x| Sphere { center: Point::new(x, 0.0, 0.0), radius: 0.2 });
        let meshes = Baked::new(
            &body,
            &BakeParams { cell: 0.02, accuracy: Real::INFINITY, ..Default::default() },
            &mut Silent,
        )
        .expect("a ball");
        let aabb = Aabb { min: Point::new(0.1, -0.1, -0.1), max: Point::new(0.5, 0.1, 0.1) };
        let mask = BoxMask::new(aabb).expect("a box");
        let vest: &dyn SignedDistance = &vest;
        let both = Nearest { meshes, fields: vec![Masked { field: vest, mask }] };
        let points: Vec<Point> = (0..4000)
            .map(|k| {
                let [x, y, z] = [7, 11, 13].map(|m| Real::from((k * m) % 97) / 97.0 - 0.5);
                Point::new(1.2 * x + 0.2, y, z)
            })
            .collect();
        let (mut distances, mut samples) =
            (vec![0.0; points.len()], vec![both.sample(&points[0]); points.len()]);
        both.distances(&points, &mut distances);
        both.samples(&points, &mut samples);
        for (k, p) in points.iter().enumerate() {
            assert_eq!((distances[k], samples[k]), (both.distance(p), both.sample(p)));
            assert_eq!(distances[k], samples[k].distance);
            let free = both.free_radius(p, distances[k], 0.01);
            for other in points.iter().filter(|q| (*q - p).norm() < free) {
                assert!(both.distance(other) >= 0.01, "{p} to {other}");
            }
        }
        // The vest counts in its box alone.
        let [at, beyond] = [Point::new(0.4, 0.0, 0.0), Point::new(0.4, 0.15, 0.0)];
        assert!(both.distance(&at) < -0.19 && both.distance(&beyond) > 0.0);
    }
}
