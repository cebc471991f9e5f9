//! What all else calls most: nearest points, exact triangle pairs, samples of a field. Each result
//! is checked.

#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use if_core::closest::closest_on_triangle;
use if_core::field::{FieldSample, SignedDistance};
use if_core::intersect::{Contact, triangles};
use if_core::math::{Point, Real, Vector, barycentric_point};
use if_core::shapes::Torus;
use std::hint::black_box;

const COUNT: usize = 4096;

/// Points in the cube from −1 to 1.
fn point(k: usize, salt: Real) -> Point {
    let at = |f: Real| (f * (k as Real + 1.0) + salt).sin();
    Point::new(at(12.9898), at(78.233), at(37.719))
}

fn nearest(c: &mut Criterion) {
    let all: Vec<(Point, [Point; 3])> = (0..COUNT)
        .map(|k| (point(k, 0.3), [point(k, 1.1), point(k, 2.7), point(k, 4.9)]))
        .collect();
    let distance = |(p, [a, b, c]): &(Point, [Point; 3])| {
        let (w, _) = closest_on_triangle(p, a, b, c);
        (barycentric_point([a, b, c], w) - p).norm()
    };
    // Nothing on a lattice of the triangle is nearer.
    for case in &all {
        let (p, [a, b, c]) = case;
        let least = distance(case);
        for i in 0..=6 {
            for j in 0..=6 - i {
                let w = [i, j, 6 - i - j].map(|n| Real::from(n) / 6.0);
                assert!((barycentric_point([a, b, c], w) - p).norm() >= least - 1e-12);
            }
        }
    }
    let mut group = c.benchmark_group("if-core/closest_on_triangle");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function(COUNT.to_string(), |b| {
        b.iter(|| black_box(&all).iter().map(distance).sum::<Real>())
    });
    group.finish();
}

fn contacts(c: &mut Criterion) {
    let floor = |k: usize| [point(k, 1.1), point(k, 2.7), point(k, 4.9)];
    // The same triangle, lifted beyond reach, turned about its middle by a right angle, and moved
    // in its plane.
    let with = |k: usize, f: &dyn Fn(&[Point; 3]) -> [Point; 3]| (floor(k), f(&floor(k)));
    let lifted = |t: &[Point; 3]| t.map(|p| p + Vector::new(0.0, 0.0, 3.0));
    let pierced = |t: &[Point; 3]| {
        let middle = Point::from((t[0].coords + t[1].coords + t[2].coords) / 3.0);
        let normal = (t[1] - t[0]).cross(&(t[2] - t[0]));
        [middle - normal, middle + normal, t[0] + (t[0] - middle) * 9.0]
    };
    let beside = |t: &[Point; 3]| *t;
    type Made<'a> = (&'a str, Contact, &'a dyn Fn(&[Point; 3]) -> [Point; 3]);
    let kinds: [Made; 3] = [
        ("disjoint", Contact::Disjoint, &lifted),
        ("crossing", Contact::Crossing, &pierced),
        ("coplanar", Contact::Coplanar, &beside),
    ];
    let mut group = c.benchmark_group("if-core/triangles");
    group.throughput(Throughput::Elements(COUNT as u64));
    for (name, contact, make) in kinds {
        let all: Vec<_> = (0..COUNT).map(|k| with(k, make)).collect();
        let of_kind = |all: &[([Point; 3], [Point; 3])]| {
            all.iter().filter(|(a, b)| triangles(a.each_ref(), b.each_ref()) == contact).count()
        };
        assert_eq!(of_kind(&all), COUNT, "{name}");
        group.bench_function(name, |b| b.iter(|| assert_eq!(of_kind(black_box(&all)), COUNT)));
    }
    group.finish();
}

fn samples(c: &mut Criterion) {
    let torus = Torus { center: Point::origin(), major: 0.6, minor: 0.2 };
    let points: Vec<Point> = (0..COUNT).map(|k| point(k, 0.3)).collect();
    let mut out = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; COUNT];
    torus.samples(&points, &mut out);
    for (p, s) in points.iter().zip(&out) {
        assert!(
            torus.distance(&(p - s.gradient * s.distance)).abs() < 1e-9,
            "a step along the gradient ends on the torus"
        );
    }
    let mut group = c.benchmark_group("if-core/torus_samples");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function(COUNT.to_string(), |b| {
        b.iter(|| torus.samples(black_box(&points), black_box(&mut out)))
    });
    group.finish();
}

criterion_group!(benches, nearest, contacts, samples);
criterion_main!(benches);
