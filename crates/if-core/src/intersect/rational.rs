//! What rational arithmetic says of two triangles, and pairs that are hard to decide. Part of the
//! tests of `intersect`, and of the benches (`benches/error_vs_time`).
//!
//! One triangle is clipped by the other's half-spaces; where the middle of what is left lies tells
//! the rest.

use super::{Contact, Point, SplitMix64};
use num_bigint::BigInt;
use num_rational::{BigRational, Ratio};
use num_traits::{One, Signed, Zero};

/// A field in which all is exact.
pub(super) trait Exact: Clone + PartialOrd + Zero + One + Signed {
    fn of(x: f64) -> Self;
}
/// Integers of small size.
impl Exact for Ratio<i128> {
    fn of(x: f64) -> Self {
        assert!(x.fract() == 0.0 && x.abs() < 100.0);
        Ratio::from_integer(x as i128)
    }
}
impl Exact for BigRational {
    fn of(x: f64) -> Self {
        Ratio::<BigInt>::from_float(x).unwrap()
    }
}

pub(super) type V<T> = [T; 3];
pub(super) fn sub<T: Exact>(a: &V<T>, b: &V<T>) -> V<T> {
    [0, 1, 2].map(|k| a[k].clone() - b[k].clone())
}
pub(super) fn dot<T: Exact>(a: &V<T>, b: &V<T>) -> T {
    a[0].clone() * b[0].clone() + a[1].clone() * b[1].clone() + a[2].clone() * b[2].clone()
}
pub(super) fn cross<T: Exact>(a: &V<T>, b: &V<T>) -> V<T> {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i].clone() * b[j].clone() - a[j].clone() * b[i].clone()
    })
}
pub(super) fn is_zero<T: Exact>(a: &V<T>) -> bool {
    a.iter().all(Zero::is_zero)
}

/// A convex set: where all of `equal` are zero and all of `within` are ≥ 0. (origin, normal)
pub(super) struct Set<T> {
    pub(super) equal: Vec<(V<T>, V<T>)>,
    pub(super) within: Vec<(V<T>, V<T>)>,
    pub(super) hull: Vec<V<T>>,
}

pub(super) fn set<T: Exact>(t: &[V<T>; 3]) -> Set<T> {
    let n = cross(&sub(&t[1], &t[0]), &sub(&t[2], &t[0]));
    let units = [
        [T::one(), T::zero(), T::zero()],
        [T::zero(), T::one(), T::zero()],
        [T::zero(), T::zero(), T::one()],
    ];
    if !is_zero(&n) {
        let within =
            (0..3).map(|k| (t[k].clone(), cross(&n, &sub(&t[(k + 1) % 3], &t[k])))).collect();
        return Set { equal: vec![(t[0].clone(), n)], within, hull: t.to_vec() };
    }
    // The longest of three sides is the segment.
    let k = (0..3).max_by(|&i, &j| {
        let length = |k: usize| dot(&sub(&t[(k + 1) % 3], &t[k]), &sub(&t[(k + 1) % 3], &t[k]));
        length(i).partial_cmp(&length(j)).unwrap()
    });
    let (p, q) = (t[k.unwrap()].clone(), t[(k.unwrap() + 1) % 3].clone());
    let d = sub(&q, &p);
    if is_zero(&d) {
        return Set {
            equal: units.into_iter().map(|u| (p.clone(), u)).collect(),
            within: vec![],
            hull: vec![p],
        };
    }
    let equal =
        units.iter().map(|u| (p.clone(), cross(&d, u))).filter(|(_, n)| !is_zero(n)).collect();
    let back = [0, 1, 2].map(|k| -d[k].clone());
    Set { equal, within: vec![(p.clone(), d), (q.clone(), back)], hull: vec![p, q] }
}

pub(super) fn height<T: Exact>(plane: &(V<T>, V<T>), p: &V<T>) -> T {
    dot(&plane.1, &sub(p, &plane.0))
}

pub(super) fn clip<T: Exact>(
    polygon: Vec<V<T>>,
    plane: &(V<T>, V<T>),
    only_zero: bool,
) -> Vec<V<T>> {
    let h: Vec<T> = polygon.iter().map(|p| height(plane, p)).collect();
    let n = polygon.len();
    let mut out = Vec::new();
    for i in 0..n {
        if h[i].is_zero() || (h[i].is_positive() && !only_zero) {
            out.push(polygon[i].clone());
        }
        let j = (i + 1) % n;
        if (h[i].is_positive() && h[j].is_negative()) || (h[i].is_negative() && h[j].is_positive())
        {
            let t = h[i].clone() / (h[i].clone() - h[j].clone());
            out.push([0, 1, 2].map(|k| {
                polygon[i][k].clone() + t.clone() * (polygon[j][k].clone() - polygon[i][k].clone())
            }));
        }
    }
    out
}

/// Corners of the common part, with repetitions.
pub(super) fn common_part<T: Exact>(sa: &Set<T>, sb: &Set<T>) -> Vec<V<T>> {
    let mut common = sa.hull.clone();
    for plane in &sb.equal {
        common = clip(common, plane, true);
    }
    for plane in &sb.within {
        common = clip(common, plane, false);
    }
    common
}

pub(super) fn exact<T: Exact>(t: [&Point; 3]) -> [V<T>; 3] {
    t.map(|p| [0, 1, 2].map(|k| T::of(p[k])))
}

/// The slow twin.
pub(super) fn reference<T: Exact>(a: [&Point; 3], b: [&Point; 3]) -> Contact {
    let (ta, tb): ([V<T>; 3], [V<T>; 3]) = (exact(a), exact(b));
    let (sa, sb) = (set(&ta), set(&tb));
    let common = common_part(&sa, &sb);
    if common.is_empty() {
        return Contact::Disjoint;
    }
    let count = common.iter().fold(T::zero(), |n, _| n + T::one());
    let middle =
        [0, 1, 2].map(|k| common.iter().fold(T::zero(), |s, p| s + p[k].clone()) / count.clone());
    if sa.within.iter().chain(&sb.within).any(|plane| !height(plane, &middle).is_positive()) {
        return Contact::Touching;
    }
    let flat =
        |s: &Set<T>, others: &[V<T>; 3]| others.iter().all(|p| height(&s.equal[0], p).is_zero());
    let coplanar = match (sa.hull.len(), sb.hull.len()) {
        (3, _) => flat(&sa, &tb),
        (_, 3) => flat(&sb, &ta),
        // Segments and points that meet always lie in one plane.
        _ => true,
    };
    if coplanar { Contact::Coplanar } else { Contact::Crossing }
}

/// Triangles with corners on a small integer grid: most pairs touch, lie in one plane or are
/// degenerate.
pub(super) fn grid(random: &mut SplitMix64, n: usize) -> [Point; 6] {
    let flat = random.below(4) == 0;
    [(); 6].map(|()| {
        let mut c = || random.below(n) as f64;
        Point::new(c(), c(), if flat { 1.0 } else { c() })
    })
}

/// Corners in general position, or on the other triangle's corners, edges or plane up to rounding.
pub(super) fn near_degenerate(random: &mut SplitMix64, scale: f64) -> [Point; 6] {
    let mut p = [(); 6].map(|()| {
        Point::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5) * scale
    });
    for k in 3..6 {
        let (i, j) = (random.below(3), random.below(3));
        let (u, v) = (random.unit(), random.unit());
        p[k] = match random.below(8) {
            0 => p[i],
            1 => p[i] + (p[j] - p[i]) * u,
            2 => p[0] + (p[1] - p[0]) * u + (p[2] - p[0]) * v,
            3 => p[i] + (p[j] - p[i]) * 2.0,
            4 => Point::new(p[i].x, p[j].y, p[k].z),
            5 => p[0] + (p[1] - p[0]) * u * 0.5 + (p[2] - p[0]) * v * 0.5,
            _ => p[k],
        };
        if random.below(4) == 0 {
            p[k].x = p[k].x.next_up();
        }
    }
    match random.below(8) {
        0 => p[2] = p[0] + (p[1] - p[0]) * 0.5,
        1 => p.iter_mut().for_each(|q| q.y = 0.25 * scale),
        _ => {}
    }
    p
}

/// Coordinates from both ends of the range in one pair, some of them shared or a last digit apart.
pub(super) fn mixed(random: &mut SplitMix64) -> [Point; 6] {
    const ENDS: [f64; 12] = [
        0.0,
        5e-324,
        1e-310,
        f64::MIN_POSITIVE,
        1e-160,
        1e-16,
        1.0,
        3.0,
        1e16,
        1e154,
        1e300,
        f64::MAX,
    ];
    let mut p = [(); 6].map(|()| {
        let mut c = || {
            let x = ENDS[random.below(12)] * if random.below(2) == 0 { 1.0 } else { -1.0 };
            if random.below(4) == 0 { x * random.unit() } else { x }
        };
        Point::new(c(), c(), c())
    });
    for _ in 0..random.below(8) {
        let (i, j, k) = (random.below(6), random.below(6), random.below(3));
        match random.below(4) {
            0 => p[i] = p[j],
            1 => p[i][k] = p[j][k].next_down(),
            _ => p[i][k] = p[j][k],
        }
        if !p[i][k].is_finite() {
            p[i][k] = 1.0;
        }
    }
    p
}
