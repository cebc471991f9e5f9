//! A million substeps of something that is at rest.

use crate::solver_scene::across_edges;
use if_core::math::{Point, Real, Vector};
use if_core::shapes::{Plane, meshes::cloth};
use if_xpbd::collision::SdfCollision;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::params::{Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

/// The farthest that a vertex strays, and the most energy seen, once a cloth has come to rest: hung
/// by two corners, or laid on a slope with friction.
fn stray(substeps: u32, hung: bool) -> (Real, Real) {
    let mesh = cloth(0.4, 0.4, 4, 4);
    let slope = Plane { point: Point::origin(), normal: Vector::new(0.2, 1.0, 0.0).normalize() };
    let n = mesh.vertices().len();
    let turned = mesh
        .vertices()
        .iter()
        .map(|p| if hung { *p } else { Point::new(p.x, -0.2 * p.x + 1e-3, p.y) });
    let mesh = mesh.with_vertices(turned.collect()).unwrap();
    let mut particles = Particles::from_area_density(&mesh, 0.2).unwrap();
    if hung {
        particles = particles.pinned([20, 24]);
    }
    let mut stretch = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-4).unwrap();
    let mut bending = Stretch::new(across_edges(&mesh), 1e-2).unwrap();
    let mut ground =
        SdfCollision::new(&slope, &vec![if hung { 0.0 } else { 1.0 }; n], &vec![1e-3; n]).unwrap();
    ground.friction = 0.5;
    let params = |damping| SolverParams {
        motion: Motion::Dynamic { damping },
        gravity: [0.0, -9.81, 0.0],
        sweeps: 5,
        ..SolverParams::default()
    };
    let mut groups: [&mut dyn Constraint; 3] = [&mut stretch, &mut bending, &mut ground];
    let mut settling = Solver::new(params(5.0)).unwrap();
    for _ in 0..1000 {
        settling.step(&mut particles, &mut groups).unwrap();
    }
    let before = particles.positions.clone();
    let mut solver = Solver::new(params(0.0)).unwrap();
    let (mut strayed, mut energy) = (0.0, 0.0);
    for _ in 0..substeps / 10 {
        let report = solver.step(&mut particles, &mut groups).unwrap();
        energy = report.kinetic_energy.max(energy);
        strayed = particles
            .positions
            .iter()
            .zip(&before)
            .map(|(p, q)| (p - q).norm())
            .fold(strayed, Real::max);
    }
    (strayed, energy)
}

fn rests(substeps: u32) {
    for hung in [true, false] {
        let (strayed, energy) = stray(substeps, hung);
        println!("hung {hung}: strays {strayed:e} m, at most {energy:e} J");
        assert!(strayed < 1e-6 && energy < 1e-9, "hung {hung}: strays {strayed:e} m, {energy:e} J");
    }
}

#[test]
fn a_cloth_at_rest_stays_at_rest() {
    rests(20_000);
}

#[test]
#[ignore = "stress"]
fn a_cloth_at_rest_stays_at_rest_for_a_million_substeps() {
    rests(1_000_000);
}
