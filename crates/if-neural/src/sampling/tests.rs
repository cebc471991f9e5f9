use super::*;
use crate::network::NetworkConfig;
use crate::target::Target;
use crate::trainable::TrainableField;
use if_core::aabb::Aabb;
use if_core::shapes::{Sphere, Torus, meshes};

fn small() -> SamplingParams {
    SamplingParams { near: 4000, far: 500, held_out: 1000, ..SamplingParams::default() }
}

fn ring() -> Torus {
    Torus { center: Point::new(1.0, 2.0, 3.0), major: 0.5, minor: 0.2 }
}

#[test]
fn what_is_known_is_what_the_target_says() {
    let set = TrainingSet::of_field(&ring(), &small()).unwrap();
    assert_eq!((set.near.points.len(), set.far.points.len()), (4000, 500));
    for (u, known) in set
        .near
        .points
        .iter()
        .chain(&set.far.points)
        .zip(set.near.known.iter().chain(&set.far.known))
    {
        let s = ring().sample(&set.frame.to_metres(u));
        approx::assert_abs_diff_eq!(
            f64::from(known.distance) / set.frame.scale,
            s.distance,
            epsilon = 1e-6
        );
    }
    let beyond = set.near.known.iter().filter(|k| k.distance.abs() > 0.08).count();
    assert!(beyond < 4, "{beyond} points lie four deviations off");
}

#[test]
fn points_lie_evenly_on_the_surface() {
    // Of a torus the outer half has the share (π + 2κ) / 2π, κ = minor / major.
    let mut random = small().random(1);
    let points = surface::points(&ring(), &ring().bounds().unwrap(), 4000, &mut random).unwrap();
    let outer =
        points.iter().filter(|p| (p.x - 1.0).hypot(p.z - 3.0) > 0.5).count() as Real / 4000.0;
    let expected = 0.5 + 0.2 / 0.5 / std::f64::consts::PI;
    assert!((outer - expected).abs() < 0.03, "{outer} {expected}");
    assert!(points.iter().all(|p| ring().distance(p).abs() < 1e-5));
}

#[test]
fn the_same_seed_gives_the_same_points_on_any_number_of_threads() {
    let run = |threads, seed| {
        let params = SamplingParams { seed, ..small() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| TrainingSet::of_field(&ring(), &params)).unwrap()
    };
    let one = run(1, 1);
    assert!(one.near == run(3, 1).near && one.held_out == run(2, 1).held_out);
    assert!(one.near != run(1, 2).near);
}

#[test]
fn a_batch_has_one_point_of_each_stretch() {
    let set = TrainingSet::of_field(&ring(), &small()).unwrap();
    let mut batch = Samples::default();
    set.near.draw(100, &mut small().random(9), &mut batch);
    set.far.draw(1000, &mut small().random(9), &mut batch);
    assert_eq!(batch.points.len(), 1100);
    for k in 0..100 {
        assert!(set.near.points[k * 40..(k + 1) * 40].contains(&batch.points[k]));
    }
}

/// A field that ends: like that of an open mesh.
struct Open;

impl SignedDistance for Open {
    fn distance(&self, p: &Point) -> Real {
        if p.y > 0.2 { Real::INFINITY } else { p.coords.norm() - 0.5 }
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), gradient: unit_or_zero(&p.coords) }
    }
    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb { min: Point::new(-0.5, -0.5, -0.5), max: Point::new(0.5, 0.5, 0.5) })
    }
    fn lipschitz(&self) -> Real {
        Real::INFINITY
    }
}

/// Negative outside.
struct Turned;

impl SignedDistance for Turned {
    fn distance(&self, p: &Point) -> Real {
        0.5 - p.coords.norm()
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), gradient: -unit_or_zero(&p.coords) }
    }
    fn bounds(&self) -> Option<Aabb> {
        Open.bounds()
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

#[test]
fn invalid_targets_are_rejected_with_a_reason() {
    let of = |target: &dyn SignedDistance| {
        TrainingSet::of_field(target, &small()).map(|_| ()).unwrap_err()
    };
    let text = of(&Open).to_string();
    assert!(
        matches!(of(&Open), TargetError::NotFinite { .. }) && text.contains("oriented points"),
        "{text}"
    );
    assert!(matches!(of(&Turned), TargetError::InsideOut { distance, .. } if distance < 0.0));
    let point = Sphere { center: Point::origin(), radius: 0.0 };
    assert!(matches!(of(&point), TargetError::NoExtent { .. }));
    for bad in [
        SamplingParams { near: 0, ..small() },
        SamplingParams { spread: [Real::NAN, 0.1], ..small() },
        SamplingParams { margin: Some(-1.0), ..small() },
    ] {
        assert!(matches!(TrainingSet::of_field(&ring(), &bad), Err(TargetError::Parameter(_))));
    }
}

#[test]
fn oriented_points_give_the_distance_near_them_and_the_side_far_away() {
    let mesh = meshes::icosphere(0.5, 4);
    let normals = mesh.vertices().iter().map(|p| p.coords).collect();
    let cloud = OrientedPoints::new(mesh.vertices().to_vec(), normals).unwrap();
    let set = TrainingSet::of_points(&cloud, &small()).unwrap();
    for (samples, error) in [(&set.near, 0.02), (&set.far, 0.02)] {
        for (u, k) in samples.points.iter().zip(&samples.known) {
            let truth = set.frame.to_metres(u).coords.norm() - 0.5;
            approx::assert_abs_diff_eq!(
                f64::from(k.distance) / set.frame.scale,
                truth,
                epsilon = error
            );
        }
    }
    assert_eq!(set.held_out.len(), 1000);
}

#[test]
fn oriented_points_are_judged_by_those_that_nothing_is_taken_from() {
    let ring = Torus { center: Point::origin(), major: 0.5, minor: 0.2 };
    let cloud = |points: Vec<Point>| {
        let normals = points.iter().map(|p| ring.sample(p).gradient).collect();
        OrientedPoints::new(points, normals).unwrap()
    };
    let all = cloud(meshes::torus(0.5, 0.2, 48, 24).vertices().to_vec());
    let config = NetworkConfig::grid();
    let begin = |cloud: &OrientedPoints| Target::Points(cloud).begin(&config, &small()).unwrap();
    let (set, network) = begin(&all);
    // Their distances are the torus's, and most are beside it.
    let (points, distances) = set.held_out.beside();
    assert!(distances.iter().filter(|d| d.abs() > 2e-3).count() > 500);
    for (p, d) in points.iter().zip(distances) {
        approx::assert_abs_diff_eq!(ring.distance(p), *d, epsilon = 1e-9);
    }
    // So the error of a network is that against the torus at other points.
    let error = |set: &TrainingSet| {
        set.held_out.accuracy(&set.frame, |points, out| network.samples32(points, out)).mean
    };
    let truly = error(&TrainingSet::of_field(&ring, &small()).unwrap());
    assert!((error(&set) / truly - 1.0).abs() < 0.25, "{} {truly}", error(&set));
}
