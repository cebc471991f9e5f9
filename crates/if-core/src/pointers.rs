//! References, boxes and [`std::sync::Arc`]s of a trait's implementors implement the trait too.

/// Implements a trait whose methods take `&self` for `&T`, `Box<T>` and `Arc<T>`. Every method is
/// forwarded, provided ones too, so that an overridden batch stays in use.
macro_rules! through_pointers {
    ($of:ident $methods:tt) => {
        through_pointers!(impl [T: $of + ?Sized] $of for &T, $methods);
        through_pointers!(impl [T: $of + ?Sized] $of for Box<T>, $methods);
        // Any thread may drop the content of an `Arc`: it must be `Send` for the `Arc` to be `Sync`.
        through_pointers!(impl [T: $of + ?Sized + Send] $of for std::sync::Arc<T>, $methods);
    };
    (impl [$($bounds:tt)*] $of:ident for $pointer:ty, {
        $(fn $name:ident(&self $(, $argument:ident: $type:ty)*) $(-> $result:ty)?;)*
    }) => {
        impl<$($bounds)*> $of for $pointer {
            $(
                #[inline]
                fn $name(&self $(, $argument: $type)*) $(-> $result)? {
                    (**self).$name($($argument),*)
                }
            )*
        }
    };
}

pub(crate) use through_pointers;

#[cfg(test)]
mod tests {
    use crate::aabb::Aabb;
    use crate::closest::{Closest, ClosestPoint, Feature};
    use crate::field::{FieldSample, SignedDistance};
    use crate::masked::{BoxMask, Mask, Masked};
    use crate::math::{Point, Real, Vector};
    use crate::shapes::{Sphere, Union};
    use std::sync::Arc;

    const BALL: Sphere = Sphere { center: Point::new(0.0, 0.0, 0.0), radius: 1.0 };

    /// A field that returns another value from each method.
    struct Distinct;
    impl SignedDistance for Distinct {
        fn distance(&self, _: &Point) -> Real {
            1.0
        }
        fn sample(&self, _: &Point) -> FieldSample {
            FieldSample { distance: 2.0, gradient: Vector::zeros() }
        }
        fn distances(&self, _: &[Point], out: &mut [Real]) {
            out.fill(3.0);
        }
        fn samples(&self, _: &[Point], out: &mut [FieldSample]) {
            out.fill(FieldSample { distance: 4.0, gradient: Vector::zeros() });
        }
        fn bounds(&self) -> Option<Aabb> {
            BALL.bounds()
        }
        fn lipschitz(&self) -> Real {
            5.0
        }
        fn free_radius(&self, _: &Point, _: Real, _: Real) -> Real {
            6.0
        }
    }
    impl ClosestPoint for Distinct {
        fn closest(&self, p: &Point, max_distance: Real) -> Option<Closest> {
            let distance = 0.5;
            let place = Closest {
                point: *p,
                distance,
                triangle: 0,
                barycentric: [1.0, 0.0, 0.0],
                feature: Feature::Face,
            };
            (distance <= max_distance).then_some(place)
        }
    }

    fn values(field: impl SignedDistance) -> [Real; 6] {
        let none = FieldSample { distance: 0.0, gradient: Vector::zeros() };
        let (p, mut values, mut samples) = ([Point::origin()], [0.0], [none]);
        field.distances(&p, &mut values);
        field.samples(&p, &mut samples);
        assert_eq!(field.bounds(), BALL.bounds());
        [
            field.distance(&p[0]),
            field.sample(&p[0]).distance,
            values[0],
            samples[0].distance,
            field.lipschitz(),
            field.free_radius(&p[0], 1.0, 0.0),
        ]
    }

    #[test]
    fn pointers_to_fields_forward_every_method() {
        let field: &dyn SignedDistance = &Distinct;
        let boxed: Box<dyn SignedDistance> = Box::new(Distinct);
        let shared: Arc<dyn SignedDistance + Send> = Arc::new(Distinct);
        for found in [
            values(field),
            values(&boxed),
            values(boxed),
            values(&shared),
            values(shared),
            values(Arc::new(Distinct)),
        ] {
            assert_eq!(found, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        }
    }

    #[test]
    fn pointers_to_fields_surfaces_and_masks_are_accepted() {
        let p = Point::new(0.0, 0.0, 0.5);
        let all = BoxMask::new(Aabb {
            min: Point::new(-1.0, -1.0, -1.0),
            max: Point::new(1.0, 1.0, 1.0),
        })
        .unwrap();
        let field: &dyn SignedDistance = &BALL;
        assert_eq!(Masked { field, mask: all }.distance(&p), -0.5);
        let boxed: Box<dyn SignedDistance> = Box::new(BALL);
        assert_eq!(
            Masked { field: boxed, mask: Box::new(all) as Box<dyn Mask> }.distance(&p),
            -0.5
        );
        assert_eq!(Masked { field: Arc::new(BALL), mask: Arc::new(all) }.distance(&p), -0.5);
        assert_eq!(Union(field, Arc::new(BALL)).distance(&p), -0.5);
        // A surface that is borrowed, owned or shared.
        let away = |surface: &dyn ClosestPoint| surface.closest(&p, 1.0).unwrap().distance;
        assert_eq!(away(&&Distinct), 0.5);
        assert_eq!(away(&(Box::new(Distinct) as Box<dyn ClosestPoint>)), 0.5);
        assert_eq!(away(&Arc::new(Distinct)), 0.5);
    }
}
