//! Problem 14 of `docs/evidence/solver.md`: do two triangles meet? Time against wrong answers,
//! judged by rational arithmetic, on pairs in general position and on pairs that nearly or exactly
//! touch.

use crate::record::{Record, Run, timed};
use if_core::intersect::{Contact, triangles};
use if_core::math::Point;
use if_core::random::SplitMix64;
use num_rational::{BigRational, Ratio};
use num_traits::Float;
use rational::{grid, near_degenerate, reference};
use rayon::prelude::*;

// `if-core`'s own twin, with which its tests compare.
#[allow(dead_code, reason = "the tests need more of it")]
#[path = "../../../crates/if-core/src/intersect/rational.rs"]
mod rational;

/// Pairs that one seed draws.
const CHUNK: usize = 1000;
/// Pairs of which rational arithmetic is timed.
const TIMED: usize = 200;

type Pair = [Point; 6];

pub(crate) fn run(record: &mut Record) {
    let any = |r: &mut SplitMix64| [(); 6].map(|()| Point::new(r.unit(), r.unit(), r.unit()));
    // A million in all; most of them where rational arithmetic is cheap.
    compare(record, "1 m, any", 5, any, meets::<BigRational>);
    compare(record, "1 m, near-degenerate", 10, |r| near_degenerate(r, 1.0), meets::<BigRational>);
    compare(
        record,
        "5 mm, near-degenerate",
        10,
        |r| near_degenerate(r, 5e-3),
        meets::<BigRational>,
    );
    compare(record, "corners on a grid of 4", 975, |r| grid(r, 4), meets::<Ratio<i128>>);
}

fn meets<T: rational::Exact>(p: &Pair) -> bool {
    let [a, b, c, d, e, f] = p.each_ref();
    reference::<T>([a, b, c], [d, e, f]) != Contact::Disjoint
}

/// A thousand times `thousands` pairs (a twentieth where it must be quick), each answered by every
/// method on one thread.
fn compare(
    record: &mut Record,
    name: &str,
    thousands: u64,
    draw: impl Fn(&mut SplitMix64) -> Pair + Sync,
    truth: impl Fn(&Pair) -> bool + Sync,
) {
    let chunks = if record.quick { thousands / 20 } else { thousands };
    let drawn = |seed: u64| {
        let mut random = SplitMix64::new(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        (0..CHUNK).map(|_| draw(&mut random)).collect::<Vec<_>>()
    };
    let pairs: Vec<Pair> = (1..=chunks).into_par_iter().flat_map_iter(drawn).collect();
    let right: Vec<bool> = pairs.par_iter().map(&truth).collect();
    let problem = format!("14 triangle pairs, {name}");
    let count = pairs.len() as u64;
    let unit = "wrong of all";
    let mut push = |method: &str, parameter: String, default: bool, ms: f64, wrong: usize| {
        assert!(!default || wrong == 0, "{problem}: {method} is wrong of {wrong} pairs");
        let parameter = format!(
            "{parameter}, {wrong} wrong of {count}, {:.0} ns a pair",
            ms * 1e6 / count as f64
        );
        let error = wrong as f64 / count as f64;
        record.push(
            Run { problem: &problem, method, parameter, unit, default },
            ms,
            error,
            [count, 0],
        );
    };
    let mut ask = |method: &str, parameter: &str, default: bool, answer: &dyn Fn(&Pair) -> bool| {
        let (ms, wrong) =
            timed(|| pairs.iter().zip(&right).filter(|(p, r)| answer(p) != **r).count());
        push(method, parameter.into(), default, ms, wrong);
    };
    ask("if-core", "exact", true, &|p| {
        let [a, b, c, d, e, f] = p.each_ref();
        triangles([a, b, c], [d, e, f]).is_some()
    });
    ask("floating point", "f64", false, &|p| moller::<f64>(p, 0.0));
    ask("floating point", "f32", false, &|p| moller::<f32>(p, 0.0));
    for epsilon in [1e-6, 1e-9, 1e-12, 1e-15] {
        ask("with an epsilon", &format!("f64, {epsilon:.0e}"), false, &|p| {
            moller::<f64>(p, epsilon)
        });
    }
    ask("with an epsilon", "f32, 1e-6", false, &|p| moller::<f32>(p, 1e-6));
    let sample = &pairs[..TIMED.min(pairs.len())];
    let (ms, _) = timed(|| sample.iter().filter(|p| truth(p)).count());
    push(
        "rational arithmetic",
        "by brute force".into(),
        false,
        ms * pairs.len() as f64 / sample.len() as f64,
        0,
    );
}

type V<T> = [T; 3];

fn sub<T: Float>(a: V<T>, b: V<T>) -> V<T> {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot<T: Float>(a: V<T>, b: V<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<T: Float>(a: V<T>, b: V<T>) -> V<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// What most programs have: Möller 1997, *A fast triangle–triangle intersection test*, with its
/// absolute epsilon (1e-6 in the published code) below which a corner is taken for one in the
/// other's plane; none where `epsilon` is 0.
fn moller<T: Float>(pair: &Pair, epsilon: f64) -> bool {
    let epsilon = T::from(epsilon).unwrap();
    let p = pair.map(|q| [q.x, q.y, q.z].map(|c| T::from(c).unwrap()));
    let (v, u) = ([p[0], p[1], p[2]], [p[3], p[4], p[5]]);
    let normal = |t: &[V<T>; 3]| cross(sub(t[1], t[0]), sub(t[2], t[0]));
    let heights = |n: V<T>, t: &[V<T>; 3], other: &[V<T>; 3]| {
        let d = -dot(n, t[0]);
        other.map(|q| dot(n, q) + d).map(|h| if h.abs() < epsilon { T::zero() } else { h })
    };
    let one_side = |h: [T; 3]| h[0] * h[1] > T::zero() && h[0] * h[2] > T::zero();
    let n1 = normal(&v);
    let du = heights(n1, &v, &u);
    if one_side(du) {
        return false;
    }
    let n2 = normal(&u);
    let dv = heights(n2, &u, &v);
    if one_side(dv) {
        return false;
    }
    let along = cross(n1, n2);
    let axis = largest(along);
    let (Some(s), Some(t)) = (interval(v.map(|q| q[axis]), dv), interval(u.map(|q| q[axis]), du))
    else {
        return in_one_plane(n1, &v, &u);
    };
    s[0].max(s[1]) >= t[0].min(t[1]) && t[0].max(t[1]) >= s[0].min(s[1])
}

fn largest<T: Float>(v: V<T>) -> usize {
    let a = v.map(|c| c.abs());
    if a[0] >= a[1] && a[0] >= a[2] {
        0
    } else if a[1] >= a[2] {
        1
    } else {
        2
    }
}

/// Where a triangle crosses the line of both planes; `None` where it lies in the other's plane.
fn interval<T: Float>(x: [T; 3], d: [T; 3]) -> Option<[T; 2]> {
    let zero = T::zero();
    let alone = if d[0] * d[1] > zero {
        2
    } else if d[0] * d[2] > zero {
        1
    } else if d[1] * d[2] > zero || d[0] != zero {
        0
    } else if d[1] != zero {
        1
    } else if d[2] != zero {
        2
    } else {
        return None;
    };
    Some([1, 2].map(|k| {
        let other = (alone + k) % 3;
        x[alone] + (x[other] - x[alone]) * d[alone] / (d[alone] - d[other])
    }))
}

/// Both triangles seen along the largest part of the normal: an edge crosses an edge, or one holds
/// the other.
fn in_one_plane<T: Float>(normal: V<T>, v: &[V<T>; 3], u: &[V<T>; 3]) -> bool {
    let drop = largest(normal);
    let flat = |t: &[V<T>; 3]| t.map(|q| [q[(drop + 1) % 3], q[(drop + 2) % 3]]);
    let (v, u) = (flat(v), flat(u));
    let minus = |a: [T; 2], b: [T; 2]| [a[0] - b[0], a[1] - b[1]];
    let turn = |a: [T; 2], b: [T; 2]| a[0] * b[1] - a[1] * b[0];
    let cross_edges = |a: [T; 2], b: [T; 2], c: [T; 2], d: [T; 2]| {
        // a + s (b − a) = c + t (d − c)
        let (e, f, g) = (minus(b, a), minus(c, d), minus(c, a));
        let whole = turn(e, f);
        let (s, t) = (turn(g, f), turn(e, g));
        let within = |x: T| {
            if whole > T::zero() {
                x >= T::zero() && x <= whole
            } else {
                x <= T::zero() && x >= whole
            }
        };
        whole != T::zero() && within(s) && within(t)
    };
    for i in 0..3 {
        for j in 0..3 {
            if cross_edges(v[i], v[(i + 1) % 3], u[j], u[(j + 1) % 3]) {
                return true;
            }
        }
    }
    let holds = |t: &[[T; 2]; 3], q: [T; 2]| {
        let s = [0, 1, 2].map(|k| turn(minus(t[(k + 1) % 3], t[k]), minus(q, t[k])));
        s.iter().all(|x| *x > T::zero()) || s.iter().all(|x| *x < T::zero())
    };
    holds(&u, v[0]) || holds(&v, u[0])
}
