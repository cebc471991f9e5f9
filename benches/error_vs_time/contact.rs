//! Problem 13 of `physics.md` §5: points inside a ball, brought onto its surface by lines 6 to 10 as printed and as corrected, with
//! fields whose gradients are too long or too short.

use crate::record::{Record, Run, timed};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::shapes::meshes::icosphere;
use if_core::shapes::{ScaledGradient, Sphere};
use if_mesh::baked::{BakeParams, Baked};
use if_xpbd::collision::{Push, SdfCollision};
use if_xpbd::constraint::Constraint;

const BALL: Sphere = Sphere { center: Point::new(0.1, 0.1, -0.19), radius: 0.2 };

pub(crate) fn run(record: &mut Record) {
    let baked = Baked::new(&BALL, &BakeParams { cell: 0.01, ..Default::default() }).unwrap();
    let fields: [(&str, Box<dyn SignedDistance>); 4] = [
        ("exact", Box::new(BALL)),
        ("gradients x 0.5", Box::new(ScaledGradient { field: BALL, factor: 0.5 })),
        ("gradients x 2", Box::new(ScaledGradient { field: BALL, factor: 2.0 })),
        ("baked, 10 mm", Box::new(baked)),
    ];
    for (name, field) in &fields {
        let problem = format!("13 points out of a ball, {name}");
        for (method, push) in [("as printed", Push::Literal), ("corrected", Push::Corrected)] {
            for visits in [1, 3, 10, 30, 100] {
                let (ms, (off, counts)) = timed(|| out(field.as_ref(), push, visits));
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
}

/// After so many visits, the largest distance from the surface of points that started up to 20 mm deep; and queries made.
fn out(field: &dyn SignedDistance, push: Push, visits: u32) -> (Real, [u64; 2]) {
    let mut points: Vec<Point> = (icosphere(1.0, 3).vertices().iter().enumerate())
        .map(|(k, p)| BALL.center + p.coords * (BALL.radius - 0.02 * ((k * 37) % 101) as Real / 101.0))
        .collect();
    let n = points.len();
    let mut contact = SdfCollision::new(field, &vec![1.0; n], &vec![0.0; n]).unwrap();
    (contact.push, contact.max_push) = (push, Real::INFINITY);
    let weights = vec![1.0; n];
    for _ in 0..visits {
        let before = points.clone();
        contact.begin_substep(&before, &before, &weights, 1e-3);
        contact.project(&mut points, &weights, 1e-3);
    }
    let off = points.iter().map(|p| BALL.distance(p).abs()).fold(0.0, Real::max);
    let counters = contact.counters();
    (off, [counters.queries, counters.skipped_by_bound + counters.skipped_by_mask])
}
