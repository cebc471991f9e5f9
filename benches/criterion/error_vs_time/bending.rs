//! Problems 10 and 11 of `docs/evidence/solver.md`: a clamped strip that bends under its weight,
//! against the elastica by shooting; and rigid motions and uniform stretches of a cloth, which have
//! closed forms at every size.

use crate::chains::{G, falling};
use crate::record::{Record, Run, timed};
use if_benches::comparators::bending::{Bending, BendingModel};
use if_core::math::{Point, Real, Vector};
use if_core::shapes::meshes::cloth;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::params::SolverParams;
use if_xpbd::particles::Particles;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

const MODELS: [(&str, BendingModel); 2] =
    [("dihedral", BendingModel::Dihedral), ("isometric", BendingModel::Isometric)];

/// Length and width of the strip, in metres.
const LENGTH: Real = 0.2;
const WIDTH: Real = 0.02;
/// Its weight per length, in N/m: cloth of 0.2 kg/m².
const WEIGHT: Real = 0.2 * WIDTH * G;
/// w L³ / B: the strip hangs down steeply.
const LOAD: Real = 10.0;
/// B, in N m².
const STIFFNESS: Real = WEIGHT * LENGTH * LENGTH * LENGTH / LOAD;
/// How long the strip is given to come to rest, in seconds, and the damping that stops it, in 1/s.
const TIME: Real = 4.0;
const DAMPING: Real = 8.0;

pub(crate) fn run(record: &mut Record) {
    elastica(record);
    patches(record);
}

fn elastica(record: &mut Record) {
    let exact = tip();
    for (method, model) in MODELS {
        let smallest = if record.quick { 1e-3 } else { 1e-4 };
        for (segments, h, sweeps) in [
            (10, 1e-3, 1),
            (20, 1e-3, 1),
            (40, 1e-3, 1),
            (10, 1e-3, 10),
            (20, 1e-3, 10),
            (40, 1e-3, 10),
            (10, 1e-4, 1),
            (20, 1e-4, 1),
            (40, 1e-4, 1),
            (20, 1e-4, 10),
            (40, 1e-4, 10),
            (20, 1e-3, 100),
        ] {
            if h < smallest {
                continue;
            }
            let (ms, (end, visits)) = timed(|| hung(model, segments, h, sweeps));
            let run = Run {
                problem: "10 cantilever, elastica",
                method,
                parameter: format!("{segments} segments, h {h:.0e} s, {sweeps} sweeps"),
                unit: "of its length",
                default: model == BendingModel::default() && (segments, h, sweeps) == (20, 1e-3, 1),
            };
            let error = (end - exact).norm() / LENGTH;
            // On record: 0.0096 at most. (One sweep at a millisecond leaves edges loose: 0.37 at
            // the default.)
            assert!(
                (segments, h, sweeps) != (10, 1e-3, 10) || error < 0.02,
                "{method}: {error} of its length"
            );
            record.push(run, ms, error, [visits, 0]);
        }
    }
}

/// Where the elastica's free end is: `B θ'' = w (L − s) cos θ`, θ(0) = 0, θ'(L) = 0, by shooting
/// with Runge and Kutta.
fn tip() -> Vector {
    const STEPS: u32 = 4000;
    let step = LENGTH / Real::from(STEPS);
    // s, θ, θ', x, y.
    let slope = |[s, angle, bend, ..]: [Real; 5]| {
        [1.0, bend, WEIGHT / STIFFNESS * (LENGTH - s) * angle.cos(), angle.cos(), angle.sin()]
    };
    let shoot = |bend: Real| {
        let mut y = [0.0, 0.0, bend, 0.0, 0.0];
        let along =
            |y: [Real; 5], k: [Real; 5], by: Real| std::array::from_fn(|i| y[i] + by * k[i]);
        for _ in 0..STEPS {
            let a = slope(y);
            let b = slope(along(y, a, 0.5 * step));
            let c = slope(along(y, b, 0.5 * step));
            let d = slope(along(y, c, step));
            y = std::array::from_fn(|i| {
                y[i] + step / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
            });
        }
        y
    };
    // The moment at the clamp is at most that of the whole weight at the end; more of it bends the
    // end upwards.
    let (mut low, mut high) = (-WEIGHT * LENGTH * LENGTH / STIFFNESS, 0.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if shoot(middle)[2] < 0.0 { low = middle } else { high = middle }
    }
    let end = shoot(0.5 * (low + high));
    Vector::new(end[3], end[4], 0.0)
}

/// The end of a strip of two rows that has come to rest, from the clamp; and visits of all
/// constraints.
fn hung(model: BendingModel, segments: u32, h: Real, sweeps: u32) -> (Vector, u64) {
    let link = LENGTH / Real::from(segments);
    // Columns −1 and 0 are clamped.
    let columns = segments + 2;
    let place = |c: u32, row: Real| Point::new(link * (Real::from(c) - 1.0), 0.0, row * WIDTH);
    let p: Vec<Point> = (0..columns).flat_map(|c| [place(c, 0.0), place(c, 1.0)]).collect();
    let mut edges = Vec::new();
    for c in 0..columns {
        let v = 2 * c;
        edges.push([v, v + 1]);
        if c + 1 < columns {
            edges.extend([[v, v + 2], [v + 1, v + 3], [v, v + 3]]);
        }
    }
    let rests: Vec<Real> =
        edges.iter().map(|[a, b]| (p[*a as usize] - p[*b as usize]).norm()).collect();
    let edges = EdgeSet::new(&edges, &rests, p.len()).unwrap();
    // A hinge on each side of each cross-piece, at half of B = 3 k width; the clamp's stands for
    // half a segment.
    let hinges = |c: u32| {
        [[2 * c, 2 * c + 1, 2 * c - 2, 2 * c + 2], [2 * c, 2 * c + 1, 2 * c - 1, 2 * c + 3]]
    };
    let soft = 6.0 * WIDTH / STIFFNESS;
    let inner: Vec<[u32; 4]> = (2..columns - 1).flat_map(hinges).collect();
    let mut inner = Bending::of_hinges(&inner, &p, model, soft).unwrap();
    let mut clamp = Bending::of_hinges(&hinges(1), &p, model, 0.5 * soft).unwrap();
    let mut stretch = Stretch::new(edges, 0.0).unwrap();
    let mass = WEIGHT / G * link / 2.0;
    let weights = (0..columns).flat_map(|c| {
        let own = if c + 1 == columns { 0.5 * mass } else { mass };
        [if c < 2 { 0.0 } else { 1.0 / own }; 2]
    });
    let mut particles = Particles::new(p.clone(), weights.collect()).unwrap();
    let params = SolverParams { sweeps, ..falling(h, DAMPING) };
    let mut solver = Solver::new(params).unwrap();
    let steps = (TIME / h).round() as u32;
    for _ in 0..steps {
        solver.step(&mut particles, &mut [&mut clamp, &mut inner, &mut stretch]).unwrap();
    }
    let x = &particles.positions;
    let end = (x[x.len() - 1].coords + x[x.len() - 2].coords) * 0.5;
    (Vector::new(end.x, end.y, 0.0), u64::from(steps) * u64::from(sweeps))
}

/// A cloth of 20 × 20 at three sizes: turned and moved by ten lengths it has no strain and no bend;
/// stretched evenly, every edge has the strain that the stretch gives its direction.
fn patches(record: &mut Record) {
    for size in [1e-3, 1.0, 1e3] {
        let mesh = cloth(size, size, 20, 20);
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.0, -2.0);
        let moved: Vec<Point> = mesh
            .vertices()
            .iter()
            .map(|p| turn * p + Vector::new(10.0, -10.0, 10.0) * size)
            .collect();
        let still = vec![0.0; moved.len()];
        let mut push = |method: &str, problem: &str, unit, (ms, error): (Real, Real)| {
            // On record: 1.3e-13 at most.
            assert!(error < 1e-11, "{problem}, {method}, {size} m: {error}");
            let parameter = format!("{size:.0e} m");
            record.push(
                Run { problem, method, parameter, unit, default: false },
                ms,
                error,
                [1, 0],
            );
        };
        let rigid = "11 a rigid motion strains nothing";
        let edges = EdgeSet::of_mesh(&mesh);
        let strains = |p: &[Point]| edges.strains(p);
        push(
            "edges",
            rigid,
            "strain or angle",
            timed(|| strains(&moved).into_iter().map(Real::abs).fold(0.0, Real::max)),
        );
        for (method, model) in MODELS {
            let mut group = Bending::of_mesh(&mesh, model, 1.0).unwrap();
            // |c| is a length times an angle.
            let over = if model == BendingModel::Isometric { 20.0 / size } else { 1.0 };
            let visit = timed(|| group.project(&mut moved.clone(), &still, 1.0).max * over);
            push(method, rigid, "strain or angle", visit);
        }
        let stretched: Vec<Point> = mesh
            .vertices()
            .iter()
            .map(|p| Point::new(1.1 * p.x + 0.2 * p.y, 0.9 * p.y, 0.3 * p.x))
            .collect();
        let off = || {
            let mut worst: Real = 0.0;
            let given = if_core::edges::Edges::new(&mesh).vertices;
            for (e, strain) in given.iter().zip(strains(&stretched)) {
                let d = mesh.vertices()[e[0] as usize] - mesh.vertices()[e[1] as usize];
                // Its direction decides: (F d)² = dᵀ C d with C = FᵀF.
                let c = 1.3 * d.x * d.x + 2.0 * 0.22 * d.x * d.y + 0.85 * d.y * d.y;
                worst = worst.max((strain + 1.0 - (c / d.norm_squared()).sqrt()).abs());
            }
            worst
        };
        push("edges", "11 an even stretch", "strain", timed(off));
    }
}
