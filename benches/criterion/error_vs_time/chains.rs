//! Problems 1 to 6 of `docs/evidence/solver.md`: springs, chains, catenaries and the pendulum,
//! against closed forms.

use crate::record::{Record, Run, timed};
use if_benches::comparators::direct::DirectStretch;
use if_benches::comparators::global::GlobalStretch;
use if_core::math::{Point, Real};
use if_xpbd::attach::Attachments;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::params::{Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

pub(crate) const G: Real = 9.81;

pub(crate) fn run(record: &mut Record) {
    spring(record);
    oscillator(record);
    chain(record);
    catenary(record, 0.0);
    catenary(record, 1e-4);
    pendulum(record);
}

/// Dynamic, under gravity, one substep of `h` a step.
pub(crate) fn falling(h: Real, damping: Real) -> SolverParams {
    SolverParams {
        time_step: h,
        substeps: 1,
        motion: Motion::Dynamic { damping },
        gravity: [0.0, -G, 0.0],
        stop_below: 0.0,
        energy_jump: Real::INFINITY,
        ..Default::default()
    }
}

/// The ways to hold edges at their lengths.
#[derive(Clone, Copy)]
pub(crate) enum Method {
    Sweeps(u32),
    Global(u32),
    Direct,
}

impl Method {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Sweeps(_) => "Gauss-Seidel",
            Self::Global(_) => "global, prefactored",
            Self::Direct => "direct",
        }
    }

    pub(crate) fn setting(self) -> String {
        match self {
            Self::Sweeps(n) => format!("{n} sweeps"),
            Self::Global(n) => format!("{n} iterations"),
            Self::Direct => "Newton to 1e-12 m".into(),
        }
    }

    pub(crate) fn sweeps(self) -> u32 {
        if let Self::Sweeps(n) = self { n } else { 1 }
    }

    pub(crate) fn group(self, edges: EdgeSet, beta: Real) -> Box<dyn Constraint> {
        match self {
            Self::Sweeps(_) => Box::new(Stretch::new(edges, beta).unwrap()),
            Self::Global(iterations) => {
                let mut group = GlobalStretch::new(edges, beta).unwrap();
                (group.iterations, group.tolerance) = (iterations, 0.0);
                Box::new(group)
            }
            Self::Direct => Box::new(DirectStretch::new(&edges, beta).unwrap()),
        }
    }
}

/// Positions after `count` steps, and how often all constraints were visited.
pub(crate) fn settled(
    params: &SolverParams,
    count: u32,
    mut particles: Particles,
    group: &mut dyn Constraint,
) -> (Vec<Point>, u64) {
    let mut solver = Solver::new(params.clone()).unwrap();
    for _ in 0..count {
        solver.step(&mut particles, &mut [group]).unwrap();
    }
    (particles.positions, u64::from(count) * u64::from(params.sweeps))
}

fn line(n: usize, length: Real) -> (Vec<Point>, EdgeSet) {
    let link = length / (n - 1) as Real;
    let p = (0..n).map(|k| Point::new(0.0, -link * k as Real, 0.0)).collect();
    let edges: Vec<[u32; 2]> = (1..n as u32).map(|k| [k - 1, k]).collect();
    (p, EdgeSet::new(&edges, &vec![link; n - 1], n).unwrap())
}

fn spring(record: &mut Record) {
    let (mass, beta) = (0.1, 1e-2);
    for h in [0.1, 0.01] {
        for count in [3, 10, 30, 100, 300, 3000] {
            let (ms, (p, visits)) = timed(|| {
                let (p, edges) = line(2, 0.1);
                let particles = Particles::new(p, vec![0.0, 1.0 / mass]).unwrap();
                settled(&falling(h, 0.0), count, particles, &mut Stretch::new(edges, beta).unwrap())
            });
            let error = ((-p[1].y - 0.1) / (mass * G * beta) - 1.0).abs();
            // On record: 3e-15.
            assert!(count < 3000 || error < 1e-12, "h {h} s: {error}");
            let run = Run {
                problem: "1 hanging spring",
                method: "Gauss-Seidel",
                parameter: format!("h {h} s, {count} steps"),
                unit: "",
                default: false,
            };
            record.push(run, ms, error, [visits, 0]);
        }
    }
}

fn oscillator(record: &mut Record) {
    let (mass, beta) = (0.5, 0.02);
    let omega = 1.0 / (mass * beta as Real).sqrt();
    for h in [1e-1, 1e-2, 1e-3, 1e-4] {
        let count = (2.0 / h) as u32;
        let (ms, (discrete, continuous)) = timed(|| {
            let mut spring = Attachments::new();
            spring.push(0, Point::origin(), beta).unwrap();
            let mut particles =
                Particles::uniform(vec![Point::new(1.0, 0.0, 0.0)], 1.0 / mass).unwrap();
            let mut solver =
                Solver::new(SolverParams { gravity: [0.0; 3], ..falling(h, 0.0) }).unwrap();
            let (mut worst, mut before): (Real, [Real; 2]) = (0.0, [1.0, 0.0]);
            for _ in 0..count {
                solver.step(&mut particles, &mut [&mut spring]).unwrap();
                let after = [particles.positions[0].x, particles.velocities[0].x / omega];
                let ratio = after[0].hypot(after[1]) / before[0].hypot(before[1]);
                worst = worst.max((ratio - 1.0 / (1.0 + (h * omega).powi(2)).sqrt()).abs());
                before = after;
            }
            (worst, (before[0] - (omega * h * Real::from(count)).cos()).abs())
        });
        // On record: 1e-13 at most, and 0.038 m at a millisecond, in proportion to h.
        assert!(
            discrete < 1e-11 && (h > 2e-3 || continuous < 100.0 * h),
            "h {h} s: {discrete}, {continuous} m"
        );
        for (problem, error, unit) in
            [("2 oscillator, discrete", discrete, ""), ("2 oscillator, at 2 s", continuous, "m")]
        {
            let run = Run {
                problem,
                method: "implicit Euler",
                parameter: format!("h {h} s"),
                unit,
                default: h == 1e-3,
            };
            record.push(run, ms, error, [u64::from(count), 0]);
        }
    }
}

fn chain(record: &mut Record) {
    let beta = 1e-5;
    for n in [11, 31, 101] {
        let problem = format!("3 compliant chain, n {n}");
        let mut sweep = |method: Method, h: Real, count: u32, damping: Real| {
            let params = SolverParams { sweeps: method.sweeps(), ..falling(h, damping) };
            let (ms, (p, visits)) = timed(|| {
                let (p, edges) = line(n, 1.0);
                let particles = Particles::uniform(p, 1.0).unwrap().pinned([0]);
                settled(&params, count, particles, method.group(edges, beta).as_mut())
            });
            let off = |(k, w): (usize, &[Point])| {
                ((w[0] - w[1]).norm() - 1.0 / (n - 1) as Real) / (G * beta * (n - 1 - k) as Real)
                    - 1.0
            };
            let error =
                p.windows(2).enumerate().map(off).fold(0.0, |worst: Real, e| worst.max(e.abs()));
            // On record: 5e-11, for both solvers that come to the end.
            let at_the_end = count == 60 && !matches!(method, Method::Sweeps(_));
            assert!(!at_the_end || error < 1e-8, "n {n}, {}: {error}", method.name());
            let parameter = format!("h {h} s, {count} steps, {}", method.setting());
            let run = Run {
                problem: &problem,
                method: method.name(),
                parameter,
                unit: "",
                default: false,
            };
            record.push(run, ms, error, [visits, 0]);
        };
        for count in [3, 10, 30, 60] {
            sweep(Method::Direct, 1.0, count, 0.0);
        }
        for iterations in [10, 100, 1000] {
            sweep(Method::Global(iterations), 1.0, 60, 0.0);
        }
        for sweeps in [1, 10, 100] {
            for (h, count) in [(0.01, 1000), (0.001, 10_000)] {
                sweep(Method::Sweeps(sweeps), h, count, 2.0);
            }
        }
    }
}

/// A chain of 101 points, 1 m long and 1 kg, between pins 0.6 m apart; `beta` is each link's. Its
/// links are the chords of the curve to second order in their length.
fn catenary(record: &mut Record, beta: Real) {
    let quick = record.quick;
    let problem = if beta == 0.0 { "4 inextensible catenary" } else { "5 elastic catenary" };
    let (links, length, span) = (100usize, 1.0, 0.6);
    let link = length / links as Real;
    let weight = G * length; // of all of it: 1 kg a metre
    let stiffness = if beta == 0.0 { Real::INFINITY } else { link / beta };
    // Half of the curve from the lowest point: x(s) = H s / EA + a asinh(s / a), a = H / (weight
    // per metre).
    let per_metre = weight / length;
    let reach = |h: Real| {
        h * 0.5 * length / stiffness + h / per_metre * (0.5 * length * per_metre / h).asinh()
    };
    let (mut low, mut high) = (1e-6, 1e4);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if reach(middle) < 0.5 * span { low = middle } else { high = middle }
    }
    let h = low;
    let at = |s: Real| {
        let x = h * s / stiffness + h / per_metre * (per_metre * s / h).asinh();
        Point::new(x, per_metre * s * s / (2.0 * stiffness) + (h / per_metre).hypot(s), 0.0)
    };
    let (left, top) = (at(-0.5 * length), at(0.5 * length).y);
    let exact: Vec<Point> = (0..=links)
        .map(|k| {
            let p = at((k as Real / links as Real - 0.5) * length);
            Point::new(p.x - left.x, p.y - top, 0.0)
        })
        .collect();
    let start: Vec<Point> = (0..=links)
        .map(|k| {
            // A V of links of the right length.
            let s = k as Real * link;
            let depth = (0.25 * length * length - 0.25 * span * span).sqrt();
            Point::new(span * s / length, -depth * (1.0 - (2.0 * s / length - 1.0).abs()), 0.0)
        })
        .collect();
    let edges: Vec<[u32; 2]> = (0..links as u32).map(|k| [k, k + 1]).collect();
    let mut sweep = |method: Method, h: Real, count: u32, damping: Real| {
        let params = SolverParams { sweeps: method.sweeps(), ..falling(h, damping) };
        let (ms, (p, visits)) = timed(|| {
            let set = EdgeSet::new(&edges, &vec![link; links], links + 1).unwrap();
            let particles =
                Particles::uniform(start.clone(), 1.0 / link).unwrap().pinned([0, links as u32]);
            settled(&params, count, particles, method.group(set, beta).as_mut())
        });
        let error = p.iter().zip(&exact).map(|(p, q)| (p - q).norm()).fold(0.0, Real::max);
        // On record: 0.032 mm.
        assert!(
            !matches!(method, Method::Direct) || h > 2e-3 || error < 1e-4,
            "{problem}: {error} m"
        );
        let parameter = format!("h {h} s, {count} steps, {}", method.setting());
        let run = Run { problem, method: method.name(), parameter, unit: "m", default: false };
        record.push(run, ms, error, [visits, 0]);
    };
    for (h, count) in [(0.01, 1000), (0.005, 2000), (0.002, 5000)] {
        sweep(Method::Direct, h, count, 2.0);
    }
    if beta > 0.0 {
        for iterations in [30, 300] {
            sweep(Method::Global(iterations), 0.02, 1000, 2.0);
        }
    }
    for sweeps in [1, 10, 100] {
        for (h, count) in [(0.01, 2000), (0.001, 20_000)] {
            if !quick || count == 2000 {
                sweep(Method::Sweeps(sweeps), h, count, 2.0);
            }
        }
    }
}

fn pendulum(record: &mut Record) {
    // T = 2π √(L/g) / AGM(1, cos(θ₀/2)), θ₀ = 90°.
    let (mut a, mut b) = (1.0, std::f64::consts::FRAC_PI_4.cos());
    for _ in 0..6 {
        (a, b) = (0.5 * (a + b), (a * b as Real).sqrt());
    }
    let period = std::f64::consts::TAU / (G.sqrt() * a);
    for h in [1e-2, 1e-3, 1e-4, 1e-5] {
        if record.quick && h < 1e-4 {
            continue;
        }
        let count = (10.0 / h as Real).round() as u32;
        let (ms, (quarter, energy)) = timed(|| {
            let mut rod = Stretch::new(EdgeSet::new(&[[0, 1]], &[1.0], 2).unwrap(), 0.0).unwrap();
            let mut particles =
                Particles::new(vec![Point::origin(), Point::new(1.0, 0.0, 0.0)], vec![0.0, 1.0])
                    .unwrap();
            let mut solver = Solver::new(falling(h, 0.0)).unwrap();
            let mut quarter = None;
            for k in 0..count {
                let before = particles.positions[1].x;
                solver.step(&mut particles, &mut [&mut rod]).unwrap();
                let after = particles.positions[1].x;
                if quarter.is_none() && after <= 0.0 {
                    quarter = Some((Real::from(k) + before / (before - after)) * h);
                }
            }
            (
                quarter.unwrap(),
                (particles.kinetic_energy() + G * (particles.positions[1].y + 1.0)) / G,
            )
        });
        let off = (4.0 * quarter / period - 1.0).abs();
        // On record: 6.4e-4 of the period and 0.175 of the energy at a millisecond, and at most in
        // proportion to h.
        assert!(
            off < 1.5 * h && (h > 2e-3 || (0.0..400.0 * h).contains(&(1.0 - energy))),
            "h {h} s: {off}, {energy}"
        );
        for (problem, error) in
            [("6 pendulum, first quarter", off), ("6 pendulum, energy lost in 10 s", 1.0 - energy)]
        {
            let run = Run {
                problem,
                method: "implicit Euler",
                parameter: format!("h {h} s"),
                unit: "",
                default: h == 1e-3,
            };
            record.push(run, ms, error, [u64::from(count), 0]);
        }
    }
}
