//! Problem 13 of `docs/evidence/solver.md`: points inside a ball or a box, brought onto its surface
//! by lines 6 to 10 as printed and as corrected, with fields whose gradients are too long or too
//! short; and a block on an incline, which sticks iff μ ≥ tan θ.

use crate::chains::{G, falling};
use crate::record::{Record, Run, timed};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_core::shapes::meshes::icosphere;
use if_core::shapes::{Cuboid, Plane, ScaledGradient, Sphere};
use if_mesh::baked::{BakeParams, Baked};
use if_xpbd::collision::{Push, SdfCollision};
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::particles::Particles;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

const BALL: Sphere = Sphere { center: Point::new(0.1, 0.1, -0.19), radius: 0.2 };

pub(crate) fn run(record: &mut Record) {
    let baked =
        Baked::new(&BALL, &BakeParams { cell: 0.01, ..Default::default() }, &mut Silent).unwrap();
    let cuboid = Cuboid { center: BALL.center, half: Vector::new(0.2, 0.15, 0.1) };
    let fields: [(&str, &dyn SignedDistance, Box<dyn SignedDistance>); 5] = [
        ("ball, exact", &BALL, Box::new(BALL)),
        ("ball, gradients x 0.5", &BALL, Box::new(ScaledGradient { field: BALL, factor: 0.5 })),
        ("ball, gradients x 2", &BALL, Box::new(ScaledGradient { field: BALL, factor: 2.0 })),
        ("ball, baked, 10 mm", &BALL, Box::new(baked)),
        ("box", &cuboid, Box::new(cuboid)),
    ];
    for (name, truth, field) in &fields {
        let problem = format!("13 points out of a {name}");
        let start = deep(*truth);
        for (method, push) in [("as printed", Push::Literal), ("corrected", Push::Corrected)] {
            for visits in [1, 3, 10, 30, 100] {
                let (ms, (off, counts)) =
                    timed(|| out(field.as_ref(), *truth, &start, push, visits));
                // Corrected, one visit is enough. On record: 6e-17 m, and 5 µm out of the baked
                // ball.
                let most = if name.contains("baked") { 2e-5 } else { 1e-12 };
                assert!(push == Push::Literal || off < most, "{name}, {visits} visits: {off} m");
                let run = Run {
                    problem: &problem,
                    method,
                    parameter: format!("{visits} visits"),
                    unit: "m",
                    default: push == Push::Corrected && visits == 1,
                };
                record.push(run, ms, off, counts);
            }
        }
    }
    incline(record);
}

/// A block of four particles on an incline of θ = 0.5 for a second: how far it slides, against ½ g
/// (sin θ − μ cos θ) t².
fn incline(record: &mut Record) {
    let theta: Real = 0.5;
    let ground =
        Plane { point: Point::origin(), normal: Vector::new(theta.sin(), theta.cos(), 0.0) };
    let along = Vector::new(theta.cos(), -theta.sin(), 0.0);
    let corner = |a: Real, b: Real| Point::from(along * a + Vector::z() * b);
    let start = [corner(0.0, 0.0), corner(0.1, 0.0), corner(0.1, 0.1), corner(0.0, 0.1)];
    let edges = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]];
    let rests: Vec<Real> = edges
        .iter()
        .map(|e: &[u32; 2]| (start[e[0] as usize] - start[e[1] as usize]).norm())
        .collect();
    for (method, share) in [
        ("slides, 0.5 tan", 0.5),
        ("slides, 0.9 tan", 0.9),
        ("sticks, tan", 1.0 + 1e-12),
        ("sticks, 2 tan", 2.0),
    ] {
        for h in [1e-2, 3e-3, 1e-3, 1e-4] {
            let count = (1.0 / h as Real).round() as u32;
            let mu = share * theta.tan();
            let (ms, slid) = timed(|| {
                let mut ties =
                    Stretch::new(EdgeSet::new(&edges, &rests, 4).unwrap(), 1e-9).unwrap();
                let mut contact = SdfCollision::new(&ground, &[1.0; 4], &[0.0; 4]).unwrap();
                contact.friction = mu;
                let mut particles = Particles::uniform(start.to_vec(), 1.0).unwrap();
                let mut solver = Solver::new(falling(h, 0.0)).unwrap();
                for _ in 0..count {
                    solver.step(&mut particles, &mut [&mut ties, &mut contact]).unwrap();
                }
                (particles.positions[0] - start[0]).dot(&along)
            });
            let time = h * Real::from(count);
            let exact = (0.5 * G * (theta.sin() - mu * theta.cos()) * time * time).max(0.0);
            // On record: 1.2 h m where it slides, nothing where it sticks.
            let most = if share < 1.0 { 2.5 * h } else { 1e-9 };
            assert!((slid - exact).abs() <= most, "{method}, h {h} s: {slid} m, not {exact} m");
            let parameter = format!("h {h} s");
            let run = Run {
                problem: "13 a block on an incline",
                method,
                parameter,
                unit: "m in 1 s",
                default: h == 1e-3,
            };
            record.push(run, ms, (slid - exact).abs(), [u64::from(count), 0]);
        }
    }
}

/// Points up to 20 mm deep in what stands where the ball does.
fn deep(truth: &dyn SignedDistance) -> Vec<Point> {
    (icosphere(1.0, 3).vertices().iter().enumerate())
        .map(|(k, p)| {
            let at = |t: Real| BALL.center + p.coords * t;
            let depth = 0.02 * ((k * 37) % 101) as Real / 101.0;
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if truth.distance(&at(middle)) < -depth { low = middle } else { high = middle }
            }
            at(low)
        })
        .collect()
}

/// After so many visits, the largest distance of the points from the surface; and queries made.
fn out(
    field: &dyn SignedDistance,
    truth: &dyn SignedDistance,
    start: &[Point],
    push: Push,
    visits: u32,
) -> (Real, [u64; 2]) {
    let mut points = start.to_vec();
    let n = points.len();
    let mut contact = SdfCollision::new(field, &vec![1.0; n], &vec![0.0; n]).unwrap();
    (contact.push, contact.max_push) = (push, Real::INFINITY);
    let weights = vec![1.0; n];
    for _ in 0..visits {
        let before = points.clone();
        contact.begin_substep(&before, &before, &weights, 1e-3);
        contact.project(&mut points, &weights, 1e-3);
    }
    let off = points.iter().map(|p| truth.distance(p).abs()).fold(0.0, Real::max);
    let counters = contact.counters();
    (off, [counters.queries, counters.skipped_by_bound + counters.skipped_by_mask])
}
