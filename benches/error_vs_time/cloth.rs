//! Problems 7 to 9 of `physics.md` §5: cloth against implicit Euler that is solved to the last digits, on the same mesh.

use crate::chains::{G, Method, falling, settled};
use crate::implicit::Springs;
use crate::record::{Record, Run, timed};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::cloth;
use if_xpbd::constraint::Constraint;
use if_xpbd::direct::DirectStretch;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::params::SolverParams;
use if_xpbd::particles::Particles;
use if_xpbd::stretch::Stretch;

/// kg/m².
const DENSITY: Real = 0.2;

pub(crate) fn run(record: &mut Record) {
    residual(record);
    let sizes: &[u32] = if record.quick { &[20] } else { &[20, 50, 100] };
    sizes.iter().for_each(|n| hanging(record, *n));
    let sizes: &[u32] = if record.quick { &[10] } else { &[10, 20, 40] };
    sizes.iter().for_each(|n| drape(record, *n));
}

/// A square metre of cloth that hangs down from the x-axis, its upper row first.
fn hung(n: u32) -> TriMesh {
    let flat = cloth(1.0, 1.0, n, n);
    let down = flat.vertices().iter().map(|p| Point::new(p.x, -p.y, 0.0)).collect();
    flat.with_vertices(down).unwrap()
}

fn rms(a: &[Point], b: &[Point]) -> Real {
    (a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<Real>() / a.len() as Real).sqrt()
}

/// How far max |C + β̃ λ| falls in one substep of 1 ms, for a cloth stretched by 5 % and shaken by 1 mm.
fn residual(record: &mut Record) {
    let n = 30;
    let mesh = hung(n);
    let edges = EdgeSet::of_mesh(&mesh);
    let (h, beta) = (1e-3, 1e-5);
    let shaken: Vec<Point> = (mesh.vertices().iter().enumerate())
        .map(|(k, p)| {
            let s = |f: Real| 1e-3 * (f * (k as Real + 1.0)).sin();
            Point::new(1.05 * p.x + s(12.9898), 1.05 * p.y + s(78.233), s(37.719))
        })
        .collect();
    let weights = Particles::from_area_density(&mesh, DENSITY).unwrap().inverse_masses;
    let problem = "7 stretched cloth, a substep";
    for sweeps in [1u32, 3, 10, 30, 100, 300, 1000, 3000] {
        let (ms, error) = timed(|| {
            let mut group = Stretch::new(edges.clone(), beta);
            let mut p = shaken.clone();
            group.begin_substep(&shaken, &shaken, &weights, h);
            for _ in 0..sweeps {
                group.project(&mut p, &weights, h);
            }
            group.residual(&p, h).max
        });
        let parameter = format!("{sweeps} sweeps");
        let run = Run { problem, method: "Gauss-Seidel", parameter, unit: "m", default: sweeps == 1 };
        record.push(run, ms, error, [u64::from(sweeps) * edges.len() as u64, 0]);
    }
    for iterations in [1, 2, 3, 5, 10, 20] {
        let (ms, error) = timed(|| {
            let mut group = DirectStretch::new(edges.clone(), beta);
            group.iterations = iterations;
            let mut p = shaken.clone();
            group.begin_substep(&shaken, &shaken, &weights, h);
            group.project(&mut p, &weights, h);
            // A visit without a step tells what is left.
            group.iterations = 0;
            group.project(&mut p, &weights, h).max
        });
        let parameter = format!("{iterations} Newton steps");
        let run = Run { problem, method: "direct", parameter, unit: "m", default: iterations == 20 };
        record.push(run, ms, error, [u64::from(iterations) * edges.len() as u64, 0]);
    }
}

/// At rest under its own weight, the upper row pinned: off the springs' equilibrium, by Newton's method.
fn hanging(record: &mut Record, n: u32) {
    let mesh = hung(n);
    let edges = EdgeSet::of_mesh(&mesh);
    let beta = 1e-4;
    let particles = || Particles::from_area_density(&mesh, DENSITY).unwrap().pinned(0..=n);
    let start = particles();
    let rest = Springs::new(&edges, beta, &start, Vector::new(0.0, -G, 0.0));
    let exact = rest.minimize(start.positions.clone(), &start.positions, 1e4);
    let problem = format!("8 hanging cloth, {n} x {n}");
    let mut sweep = |method: Method, h: Real, count: u32, damping: Real| {
        let params = SolverParams { sweeps: method.sweeps(), ..falling(h, damping) };
        let (ms, (p, visits)) = timed(|| settled(&params, count, particles(), method.group(edges.clone(), beta).as_mut()));
        let parameter = format!("h {h} s, {count} steps, {}", method.setting());
        let run = Run { problem: &problem, method: method.name(), parameter, unit: "of its height", default: false };
        record.push(run, ms, rms(&p, &exact), [visits, 0]);
    };
    for (h, count) in [(0.01, 100), (0.03, 30), (0.1, 3), (0.1, 10), (1.0, 3)] {
        sweep(Method::Direct, h, count, 0.0);
    }
    for (h, iterations, count) in
        [(0.1, 3, 10), (0.1, 10, 10), (0.1, 30, 20), (1.0, 30, 1), (1.0, 100, 1), (1.0, 100, 5), (10.0, 300, 1)]
    {
        sweep(Method::Global(iterations), h, count, 0.0);
    }
    for sweeps in [1, 10, 100] {
        for (h, count) in [(0.01, 100), (0.01, 400), (0.002, 1000)] {
            if u64::from(sweeps * count) * u64::from(n * n) <= 400_000_000 {
                sweep(Method::Sweeps(sweeps), h, count, 5.0);
            }
        }
    }
}

/// Falls for 0.3 s from the horizontal, two corners pinned, in substeps of 5 ms: off implicit Euler with the same
/// substep, by Newton's method.
fn drape(record: &mut Record, n: u32) {
    let mesh = cloth(1.0, 1.0, n, n);
    // The plane of the cloth is horizontal, gravity is −y.
    let mesh = mesh.with_vertices(mesh.vertices().iter().map(|p| Point::new(p.x, 0.0, p.y)).collect()).unwrap();
    let edges = EdgeSet::of_mesh(&mesh);
    let beta = 1e-4;
    let (h, count) = (5e-3, 60);
    let particles = || Particles::from_area_density(&mesh, DENSITY).unwrap().pinned([0, n]);
    let mut now = particles();
    for _ in 0..count {
        let aim: Vec<Point> = now.positions.iter().zip(&now.velocities).map(|(p, v)| p + v * h).collect();
        let next = Springs::new(&edges, beta, &now, Vector::new(0.0, -G, 0.0)).minimize(now.positions.clone(), &aim, h);
        now.velocities = next.iter().zip(&now.positions).map(|(q, p)| (q - p) / h).collect();
        now.positions = next;
    }
    let exact = now.positions;
    assert!(exact.iter().any(|p| p.y < -0.3 * 0.5 * G * 0.09), "the cloth fell");
    let problem = format!("9 square drape, {n} x {n}");
    let mut sweep = |method: Method, substeps: u32| {
        let params = SolverParams { sweeps: method.sweeps(), substeps, ..falling(h, 0.0) };
        let (ms, (p, visits)) = timed(|| settled(&params, count, particles(), method.group(edges.clone(), beta).as_mut()));
        let parameter = format!("{substeps} substeps, {}", method.setting());
        let run = Run { problem: &problem, method: method.name(), parameter, unit: "m rms", default: false };
        record.push(run, ms, rms(&p, &exact), [visits * u64::from(substeps), 0]);
    };
    for sweeps in [1, 3, 10, 30, 100, 300, 1000] {
        sweep(Method::Sweeps(sweeps), 1);
    }
    // Small steps instead of sweeps: they converge to the motion, not to this substep's implicit Euler.
    for substeps in [3, 10, 30] {
        sweep(Method::Sweeps(1), substeps);
    }
    for iterations in [1, 3, 10, 30, 100, 300] {
        sweep(Method::Global(iterations), 1);
    }
    sweep(Method::Direct, 1);
}
