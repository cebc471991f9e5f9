//! Problems 7 to 9 of `docs/evidence/solver.md`: cloth against implicit Euler that is solved to the
//! last digits, on the same mesh.

use crate::chains::{G, Method, falling, settled};
use crate::implicit::Springs;
use crate::record::{Record, Run, timed};
use if_benches::comparators::direct::DirectStretch;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::shapes::Sphere;
use if_core::shapes::meshes::cloth;
use if_xpbd::collision::SdfCollision;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::params::SolverParams;
use if_xpbd::particles::Particles;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

/// kg/m².
const DENSITY: Real = 0.2;

pub(crate) fn run(record: &mut Record) {
    residual(record);
    let sizes: &[u32] = if record.quick { &[20] } else { &[30, 60, 100] };
    sizes.iter().for_each(|n| hanging(record, *n));
    let sizes: &[u32] = if record.quick { &[10] } else { &[10, 20, 40] };
    sizes.iter().for_each(|n| drape(record, *n));
    if !record.quick {
        refined(record, 40);
    }
    let sizes: &[u32] = if record.quick { &[10] } else { &[10, 20, 40] };
    sizes.iter().for_each(|n| over_a_ball(record, *n));
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

/// How far max |C + β̃ λ| falls in one substep of 1 ms, for a cloth stretched by 5 % and shaken by
/// 1 mm.
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
            let mut group = Stretch::new(edges.clone(), beta).unwrap();
            let mut p = shaken.clone();
            group.begin_substep(&shaken, &shaken, &weights, h);
            for _ in 0..sweeps {
                group.project(&mut p, &weights, h);
            }
            group.residual(&p, h).max
        });
        let parameter = format!("{sweeps} sweeps");
        let run =
            Run { problem, method: "Gauss-Seidel", parameter, unit: "m", default: sweeps == 1 };
        record.push(run, ms, error, [u64::from(sweeps) * edges.len() as u64, 0]);
    }
    for iterations in [1, 2, 3, 5, 10, 20] {
        let (ms, error) = timed(|| {
            let mut group = DirectStretch::new(&edges, beta).unwrap();
            group.iterations = iterations;
            let mut p = shaken.clone();
            group.begin_substep(&shaken, &shaken, &weights, h);
            group.project(&mut p, &weights, h);
            // A visit without a step tells what is left.
            group.iterations = 0;
            group.project(&mut p, &weights, h).max
        });
        let parameter = format!("{iterations} Newton steps");
        let run =
            Run { problem, method: "direct", parameter, unit: "m", default: iterations == 20 };
        record.push(run, ms, error, [u64::from(iterations) * edges.len() as u64, 0]);
    }
}

/// At rest under its own weight, the upper row pinned: off the springs' equilibrium, by Newton's
/// method.
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
        let (ms, (p, visits)) = timed(|| {
            settled(&params, count, particles(), method.group(edges.clone(), beta).as_mut())
        });
        let parameter = format!("h {h} s, {count} steps, {}", method.setting());
        let run = Run {
            problem: &problem,
            method: method.name(),
            parameter,
            unit: "of its height",
            default: false,
        };
        record.push(run, ms, rms(&p, &exact), [visits, 0]);
    };
    for (h, count) in [(0.01, 100), (0.03, 30), (0.1, 3), (0.1, 10), (1.0, 3)] {
        sweep(Method::Direct, h, count, 0.0);
    }
    for (h, iterations, count) in [
        (0.1, 3, 10),
        (0.1, 10, 10),
        (0.1, 30, 20),
        (1.0, 30, 1),
        (1.0, 100, 1),
        (1.0, 100, 5),
        (10.0, 300, 1),
    ] {
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

const H: Real = 5e-3;
const STEPS: u32 = 60;
const SPRING: Real = 1e-4;

/// A square metre of n × n in the plane y = 0, and its springs.
fn level(n: u32) -> (TriMesh, EdgeSet) {
    let mesh = cloth(1.0, 1.0, n, n);
    let mesh = mesh
        .with_vertices(mesh.vertices().iter().map(|p| Point::new(p.x, 0.0, p.y)).collect())
        .unwrap();
    let edges = EdgeSet::of_mesh(&mesh);
    (mesh, edges)
}

/// Implicit Euler in steps of `H`, each solved by Newton's method; outside of a ball where there is
/// one.
fn fallen(edges: &EdgeSet, mut now: Particles, ball: Option<(Point, Real)>) -> Vec<Point> {
    for _ in 0..STEPS {
        let aim: Vec<Point> =
            now.positions.iter().zip(&now.velocities).map(|(p, v)| p + v * H).collect();
        let springs = Springs::new(edges, SPRING, &now, Vector::new(0.0, -G, 0.0));
        let next = match ball {
            Some((center, radius)) => {
                springs.minimize_outside(now.positions.clone(), &aim, H, center, radius)
            }
            None => springs.minimize(now.positions.clone(), &aim, H),
        };
        now.velocities = next.iter().zip(&now.positions).map(|(q, p)| (q - p) / H).collect();
        now.positions = next;
    }
    assert!(now.positions.iter().any(|p| p.y < -0.3 * 0.5 * G * 0.09), "the cloth fell");
    now.positions
}

fn by_two_corners(mesh: &TriMesh, n: u32) -> Particles {
    Particles::from_area_density(mesh, DENSITY).unwrap().pinned([0, n])
}

/// Falls for 0.3 s from the horizontal, two corners pinned, in substeps of 5 ms: off implicit Euler
/// with the same substep, by Newton's method.
fn drape(record: &mut Record, n: u32) {
    let (mesh, edges) = level(n);
    let particles = || by_two_corners(&mesh, n);
    let exact = fallen(&edges, particles(), None);
    let (h, count, beta) = (H, STEPS, SPRING);
    let problem = format!("9 square drape, {n} x {n}");
    let mut sweep = |method: Method, substeps: u32| {
        let params = SolverParams { sweeps: method.sweeps(), substeps, ..falling(h, 0.0) };
        let (ms, (p, visits)) = timed(|| {
            settled(&params, count, particles(), method.group(edges.clone(), beta).as_mut())
        });
        let parameter = format!("{substeps} substeps, {}", method.setting());
        let run = Run {
            problem: &problem,
            method: method.name(),
            parameter,
            unit: "m rms",
            default: false,
        };
        record.push(run, ms, rms(&p, &exact), [visits * u64::from(substeps), 0]);
    };
    for sweeps in [1, 3, 10, 30, 100, 300, 1000] {
        sweep(Method::Sweeps(sweeps), 1);
    }
    // Small steps instead of sweeps: they converge to the motion, not to this substep's implicit
    // Euler.
    for substeps in [3, 10, 30] {
        sweep(Method::Sweeps(1), substeps);
    }
    for iterations in [1, 3, 10, 30, 100, 300] {
        sweep(Method::Global(iterations), 1);
    }
    sweep(Method::Direct, 1);
}

/// The same drape, solved by Newton's method on coarser meshes: off the finest one's, at the
/// vertices that both have. Springs of one stiffness are one cloth at every size of mesh.
fn refined(record: &mut Record, finest: u32) {
    let solved = |n: u32| {
        let (mesh, edges) = level(n);
        timed(|| fallen(&edges, by_two_corners(&mesh, n), None))
    };
    let (_, best) = solved(finest);
    for n in [5, 10, 20] {
        let (ms, p) = solved(n);
        let times = finest / n;
        let at: Vec<Point> = (0..=n)
            .flat_map(|row| (0..=n).map(move |column| (row, column)))
            .map(|(row, column)| best[(row * times * (finest + 1) + column * times) as usize])
            .collect();
        let problem = format!("9 square drape, refined to {finest} x {finest}");
        let parameter = format!("{n} x {n}");
        let method = "implicit Euler, Newton";
        record.push(
            Run { problem: &problem, method, parameter, unit: "m rms", default: false },
            ms,
            rms(&p, &at),
            [0, 0],
        );
    }
}

/// Falls for 0.3 s onto a ball of 0.3 m without friction: off implicit Euler with the same substep
/// and the ball as an exact constraint.
fn over_a_ball(record: &mut Record, n: u32) {
    let (mesh, edges) = level(n);
    let ball = Sphere { center: Point::new(0.5, -0.31, 0.5), radius: 0.3 };
    let particles = || Particles::from_area_density(&mesh, DENSITY).unwrap();
    let exact = fallen(&edges, particles(), Some((ball.center, ball.radius)));
    assert!(exact.iter().all(|p| ball.distance(p) > -1e-9), "nothing is inside of the ball");
    let problem = format!("9 drape over a ball, {n} x {n}");
    let count = mesh.vertices().len();
    let mut sweep = |method: Method, substeps: u32| {
        let params = SolverParams { sweeps: method.sweeps(), substeps, ..falling(H, 0.0) };
        let (ms, (p, counters)) = timed(|| {
            let mut group = method.group(edges.clone(), SPRING);
            let mut contact =
                SdfCollision::new(&ball, &vec![1.0; count], &vec![0.0; count]).unwrap();
            contact.max_push = Real::INFINITY;
            let mut now = particles();
            let mut solver = Solver::new(params.clone()).unwrap();
            for _ in 0..STEPS {
                solver.step(&mut now, &mut [group.as_mut(), &mut contact]).unwrap();
            }
            (now.positions, contact.counters())
        });
        let parameter = format!("{substeps} substeps, {}", method.setting());
        let run = Run {
            problem: &problem,
            method: method.name(),
            parameter,
            unit: "m rms",
            default: false,
        };
        record.push(run, ms, rms(&p, &exact), [counters.queries, counters.skipped_by_bound]);
    };
    for sweeps in [1, 3, 10, 30, 100, 300] {
        sweep(Method::Sweeps(sweeps), 1);
    }
    for substeps in [3, 10, 30] {
        sweep(Method::Sweeps(1), substeps);
    }
    for iterations in [1, 10, 100] {
        sweep(Method::Global(iterations), 1);
    }
    sweep(Method::Direct, 1);
}
