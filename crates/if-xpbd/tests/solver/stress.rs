//! What a scene can do to the solver by itself: no NaN, no panic, bounded
//! energy, or a typed error.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::{Sphere, meshes};
use if_xpbd::algorithm1::{Below, run_algorithm1};
use if_xpbd::collision::SdfCollision;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::params::{Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

fn finite(p: &[Point]) -> bool {
    p.iter().all(|x| x.iter().all(|c| c.is_finite()))
}

/// A cloth, half of it inside a ball, settled with `params`; everything scaled by `unit`.
fn settled(mesh: &TriMesh, unit: Real, params: &SolverParams) -> Vec<Point> {
    let mesh = mesh.scaled(unit).unwrap();
    let ball =
        Sphere { center: Point::new(0.05 * unit, 0.05 * unit, -0.19 * unit), radius: 0.2 * unit };
    let mask = vec![1.0; mesh.vertices().len()];
    let below = Below { field: &ball, mask: &mask, air: None };
    run_algorithm1(&mesh, &below, params, &mut Silent).unwrap().0
}

#[test]
fn steps_sweeps_and_compliances_of_all_sizes_stay_finite() {
    let mesh = meshes::cloth(0.1, 0.1, 8, 8);
    for time_step in [1e-1, 1e-3, 1e-6] {
        for substeps in [1, 100] {
            for sweeps in [0, 1, 100] {
                for compliance in [0.0, 1e-12, 1e3, Real::INFINITY] {
                    let params = SolverParams {
                        time_step,
                        substeps,
                        sweeps,
                        compliance,
                        steps: 2,
                        ..Default::default()
                    };
                    let p = settled(&mesh, 1.0, &params);
                    assert!(finite(&p), "{params:?}");
                    assert!(p.iter().all(|x| x.z.abs() < 0.05), "{params:?}");
                }
            }
        }
    }
}

#[test]
fn degenerate_meshes_stay_finite() {
    let o = Point::origin();
    let needle = vec![o, Point::new(0.1, 0.0, 0.0), Point::new(0.05, 1e-12, 0.0)];
    let star: Vec<Point> = std::iter::once(Point::new(0.05, 0.05, 0.0))
        .chain((0..100).map(|k| {
            let a = f64::from(k) * 0.0628;
            Point::new(0.05 + 0.05 * a.cos(), 0.05 + 0.05 * a.sin(), 0.0)
        }))
        .collect();
    let fan = (1..100).map(|k| [0, k, k + 1]).collect();
    let quad = vec![
        o,
        Point::new(0.1, 0.0, 0.0),
        Point::new(0.1, 0.1, 0.0),
        Point::new(0.0, 0.1, 0.0),
        Point::new(0.05, 0.0, 0.05),
    ];
    let table = [
        ("empty", vec![], vec![]),
        ("one point", vec![o], vec![]),
        ("needle", needle, vec![[0, 1, 2]]),
        ("coincident", vec![o; 4], vec![[0, 1, 2], [1, 2, 3]]),
        ("a hundred triangles at a vertex", star, fan),
        ("non-manifold, flipped", quad, vec![[0, 1, 2], [0, 2, 3], [1, 0, 4], [0, 1, 3]]),
    ];
    for (name, vertices, triangles) in table {
        let mesh = TriMesh::new(vertices, triangles).unwrap();
        for params in [SolverParams::default(), SolverParams::literal()] {
            assert!(finite(&settled(&mesh, 1.0, &SolverParams { steps: 20, ..params })), "{name}");
        }
        let mut particles = Particles::from_area_density(&mesh, 0.2).unwrap();
        let mut stretch = Stretch::new(EdgeSet::of_mesh(&mesh), 0.0).unwrap();
        let mut solver =
            Solver::new(SolverParams { gravity: [0.0, 0.0, -9.81], ..Default::default() }).unwrap();
        solver.step(&mut particles, &mut [&mut stretch]).unwrap();
        assert!(finite(&particles.positions), "{name}");
    }
}

#[test]
fn mass_ratios_of_a_million_and_masses_of_nothing_are_fine() {
    let mesh = meshes::cloth(0.1, 0.1, 8, 8);
    let ball = Sphere { center: Point::new(0.05, 0.05, -0.15), radius: 0.2 };
    let n = mesh.vertices().len();
    for weight in [
        |_: usize| 0.0,
        |k| if k % 2 == 0 { 1.0 } else { 1e6 },
        |k| if k % 3 == 0 { 0.0 } else { 1e-6 },
    ] {
        let mut particles =
            Particles::new(mesh.vertices().to_vec(), (0..n).map(weight).collect()).unwrap();
        let mut stretch = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-5).unwrap();
        let mut collision = SdfCollision::new(&ball, &vec![1.0; n], &vec![1e-3; n]).unwrap();
        let mut solver = Solver::new(SolverParams { sweeps: 5, ..Default::default() }).unwrap();
        for _ in 0..20 {
            solver.step(&mut particles, &mut [&mut stretch, &mut collision]).unwrap();
        }
        assert!(finite(&particles.positions));
        for k in 0..n {
            assert!(weight(k) > 0.0 || particles.positions[k] == mesh.vertices()[k]);
        }
    }
}

#[test]
fn units_from_micrometres_to_kilometres_settle_alike() {
    let mesh = meshes::cloth(0.1, 0.1, 8, 8);
    let at = |unit: Real| {
        let params = SolverParams {
            clearance: 1e-3 * unit,
            max_push: 0.01 * unit,
            stop_below: 1e-6 * unit,
            ..Default::default()
        };
        settled(&mesh, unit, &params)
    };
    let metres = at(1.0);
    for unit in [1e-5, 1e3, 1e4] {
        for (p, q) in metres.iter().zip(at(unit)) {
            assert!((p - q / unit).norm() < 1e-9, "{unit}");
        }
    }
}

#[test]
fn a_bounded_energy_stays_bounded_for_a_cloth_dropped_on_a_ball() {
    let mesh = meshes::cloth(0.3, 0.3, 12, 12);
    let ball = Sphere { center: Point::new(0.15, 0.15, -0.12), radius: 0.1 };
    let n = mesh.vertices().len();
    let mut particles = Particles::from_area_density(&mesh, 0.2).unwrap();
    let mut stretch = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-7).unwrap();
    let mut collision = SdfCollision::new(&ball, &vec![1.0; n], &vec![1e-3; n]).unwrap();
    collision.friction = 0.3;
    let params = SolverParams {
        motion: Motion::Dynamic { damping: 0.5 },
        gravity: [0.0, 0.0, -9.81],
        sweeps: 4,
        ..Default::default()
    };
    let mut solver = Solver::new(params).unwrap();
    let mass: Real = particles.inverse_masses.iter().map(|w| 1.0 / w).sum();
    for step in 0..100 {
        solver.step(&mut particles, &mut [&mut stretch, &mut collision]).unwrap();
        // It fell by at most this much; everything else takes energy away.
        let lowest = particles.positions.iter().map(|p| p.z).fold(0.0, Real::min);
        assert!(particles.kinetic_energy() <= mass * 9.81 * -lowest + 1e-9, "step {step}");
    }
    use if_core::field::SignedDistance;
    assert!(particles.positions.iter().all(|p| ball.distance(p) > 0.0));
}
