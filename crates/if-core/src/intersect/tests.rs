//! Against rational arithmetic: clip one triangle by the other's half-spaces, and look where the
//! middle of what is left lies.

use super::*;
use num_bigint::BigInt;
use num_rational::{BigRational, Ratio};
use num_traits::{One, Signed, Zero};

/// A field in which all is exact.
trait Exact: Clone + PartialOrd + Zero + One + Signed {
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

type V<T> = [T; 3];
fn sub<T: Exact>(a: &V<T>, b: &V<T>) -> V<T> {
    [0, 1, 2].map(|k| a[k].clone() - b[k].clone())
}
fn dot<T: Exact>(a: &V<T>, b: &V<T>) -> T {
    a[0].clone() * b[0].clone() + a[1].clone() * b[1].clone() + a[2].clone() * b[2].clone()
}
fn cross<T: Exact>(a: &V<T>, b: &V<T>) -> V<T> {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i].clone() * b[j].clone() - a[j].clone() * b[i].clone()
    })
}
fn is_zero<T: Exact>(a: &V<T>) -> bool {
    a.iter().all(Zero::is_zero)
}

/// A convex set: where all of `equal` are zero and all of `within` are ≥ 0. (origin, normal)
struct Set<T> {
    equal: Vec<(V<T>, V<T>)>,
    within: Vec<(V<T>, V<T>)>,
    hull: Vec<V<T>>,
}

fn set<T: Exact>(t: &[V<T>; 3]) -> Set<T> {
    let n = cross(&sub(&t[1], &t[0]), &sub(&t[2], &t[0]));
    let units = [[T::one(), T::zero(), T::zero()], [T::zero(), T::one(), T::zero()], [T::zero(), T::zero(), T::one()]];
    if !is_zero(&n) {
        let within = (0..3).map(|k| (t[k].clone(), cross(&n, &sub(&t[(k + 1) % 3], &t[k])))).collect();
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
        return Set { equal: units.into_iter().map(|u| (p.clone(), u)).collect(), within: vec![], hull: vec![p] };
    }
    let equal = units.iter().map(|u| (p.clone(), cross(&d, u))).filter(|(_, n)| !is_zero(n)).collect();
    let back = [0, 1, 2].map(|k| -d[k].clone());
    Set { equal, within: vec![(p.clone(), d), (q.clone(), back)], hull: vec![p, q] }
}

fn height<T: Exact>(plane: &(V<T>, V<T>), p: &V<T>) -> T {
    dot(&plane.1, &sub(p, &plane.0))
}

fn clip<T: Exact>(polygon: Vec<V<T>>, plane: &(V<T>, V<T>), only_zero: bool) -> Vec<V<T>> {
    let h: Vec<T> = polygon.iter().map(|p| height(plane, p)).collect();
    let n = polygon.len();
    let mut out = Vec::new();
    for i in 0..n {
        if h[i].is_zero() || (h[i].is_positive() && !only_zero) {
            out.push(polygon[i].clone());
        }
        let j = (i + 1) % n;
        if (h[i].is_positive() && h[j].is_negative()) || (h[i].is_negative() && h[j].is_positive()) {
            let t = h[i].clone() / (h[i].clone() - h[j].clone());
            out.push([0, 1, 2].map(|k| polygon[i][k].clone() + t.clone() * (polygon[j][k].clone() - polygon[i][k].clone())));
        }
    }
    out
}

/// Corners of the common part, with repetitions.
fn common_part<T: Exact>(sa: &Set<T>, sb: &Set<T>) -> Vec<V<T>> {
    let mut common = sa.hull.clone();
    for plane in &sb.equal {
        common = clip(common, plane, true);
    }
    for plane in &sb.within {
        common = clip(common, plane, false);
    }
    common
}

fn exact<T: Exact>(t: [&Point; 3]) -> [V<T>; 3] {
    t.map(|p| [0, 1, 2].map(|k| T::of(p[k])))
}

/// The slow twin.
fn reference<T: Exact>(a: [&Point; 3], b: [&Point; 3]) -> Contact {
    let (ta, tb): ([V<T>; 3], [V<T>; 3]) = (exact(a), exact(b));
    let (sa, sb) = (set(&ta), set(&tb));
    let common = common_part(&sa, &sb);
    if common.is_empty() {
        return Contact::Disjoint;
    }
    let count = common.iter().fold(T::zero(), |n, _| n + T::one());
    let middle = [0, 1, 2].map(|k| common.iter().fold(T::zero(), |s, p| s + p[k].clone()) / count.clone());
    if sa.within.iter().chain(&sb.within).any(|plane| !height(plane, &middle).is_positive()) {
        return Contact::Touching;
    }
    let flat = |s: &Set<T>, others: &[V<T>; 3]| others.iter().all(|p| height(&s.equal[0], p).is_zero());
    let coplanar = match (sa.hull.len(), sb.hull.len()) {
        (3, _) => flat(&sa, &tb),
        (_, 3) => flat(&sb, &ta),
        // Segments and points that meet always lie in one plane.
        _ => true,
    };
    if coplanar { Contact::Coplanar } else { Contact::Crossing }
}

/// The slow twin of [`triangles_sharing`]: is a corner of the common part off the hull of the shared ones?
fn reference_sharing<T: Exact>(a: [&Point; 3], b: [&Point; 3], shared: usize) -> bool {
    let (ta, tb) = (exact::<T>(a), exact(b));
    let common = common_part(&set(&ta), &set(&tb));
    let edge = set(&[ta[0].clone(), ta[shared - 1].clone(), ta[0].clone()]);
    common
        .iter()
        .any(|p| edge.equal.iter().any(|e| !height(e, p).is_zero()) || edge.within.iter().any(|e| height(e, p).is_negative()))
}

struct Random(u64);
impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        self.0 >> 33
    }
    fn unit(&mut self) -> f64 {
        (self.next() as f64 + self.next() as f64 / 2147483648.0) / 2147483648.0
    }
    fn below(&mut self, n: u64) -> u64 {
        (self.next() >> 8) % n
    }
}

/// Triangles with corners on a small integer grid: most pairs touch, lie in one plane or are degenerate.
fn grid(random: &mut Random, n: u64) -> [Point; 6] {
    let flat = random.below(4) == 0;
    [(); 6].map(|()| {
        let mut c = || random.below(n) as f64;
        Point::new(c(), c(), if flat { 1.0 } else { c() })
    })
}

/// Corners in general position, or on the other triangle's corners, edges or plane up to rounding.
fn near_degenerate(random: &mut Random, scale: f64) -> [Point; 6] {
    let mut p = [(); 6].map(|()| Point::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5) * scale);
    for k in 3..6 {
        let (i, j) = (random.below(3) as usize, random.below(3) as usize);
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

fn check<T: Exact>(p: &[Point; 6], counts: &mut [usize; 4]) {
    let [a, b] = [[&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[5]]];
    let expected = reference::<T>(a, b);
    counts[expected as usize] += 1;
    for turn in 0..3 {
        let a = [a[turn], a[(turn + 1) % 3], a[(turn + 2) % 3]];
        assert_eq!(triangles(a, b), expected, "{p:?}, corners turned by {turn}");
        let b = [b[2], b[1], b[0]];
        assert_eq!(triangles(b, a), expected, "{p:?} the other way round, corners turned by {turn}");
    }
}

fn compare_grids(pairs: usize, seed: u64) {
    let mut random = Random(seed);
    let mut counts = [0; 4];
    for k in 0..pairs {
        check::<Ratio<i128>>(&grid(&mut random, 2 + (k % 4) as u64), &mut counts);
    }
    assert!(counts.iter().all(|n| *n > pairs / 50), "all kinds must occur: {counts:?}");
}

fn compare_floats(pairs: usize, seed: u64) {
    let mut random = Random(seed);
    let mut counts = [0; 4];
    for k in 0..pairs {
        let scale = [1.0, 1.0, 1e-100, 1e100, 1e-30, 1e9, 1e-300, 1e300][k % 8];
        check::<BigRational>(&near_degenerate(&mut random, scale), &mut counts);
    }
    assert!(counts.iter().all(|n| *n > pairs / 100), "all kinds must occur: {counts:?}");
}

/// Coordinates from both ends of the range in one pair, some of them shared or a last digit apart.
fn mixed(random: &mut Random) -> [Point; 6] {
    const ENDS: [f64; 12] = [0.0, 5e-324, 1e-310, f64::MIN_POSITIVE, 1e-160, 1e-16, 1.0, 3.0, 1e16, 1e154, 1e300, f64::MAX];
    let mut p = [(); 6].map(|()| {
        let mut c = || {
            let x = ENDS[random.below(12) as usize] * if random.below(2) == 0 { 1.0 } else { -1.0 };
            if random.below(4) == 0 { x * random.unit() } else { x }
        };
        Point::new(c(), c(), c())
    });
    for _ in 0..random.below(8) {
        let (i, j, k) = (random.below(6) as usize, random.below(6) as usize, random.below(3) as usize);
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

fn compare_mixed(pairs: usize, seed: u64) {
    let mut random = Random(seed);
    let mut counts = [0; 4];
    for _ in 0..pairs {
        check::<BigRational>(&mixed(&mut random), &mut counts);
    }
    assert!(counts.iter().filter(|n| **n > 0).count() >= 3, "kinds must occur: {counts:?}");
}

#[test]
fn pairs_of_denormals_beside_1e300_agree_with_rational_arithmetic() {
    compare_mixed(60, 1);
}

#[test]
fn pairs_on_small_grids_agree_with_rational_arithmetic() {
    compare_grids(20_000, 1);
}

#[test]
fn near_degenerate_pairs_of_all_scales_agree_with_rational_arithmetic() {
    compare_floats(500, 1);
}

fn compare_sharing(pairs: usize, seed: u64) {
    let mut random = Random(seed);
    let mut counts = [[0; 4]; 2];
    for k in 0..pairs {
        let n = 1 + k % 2;
        let mut p = grid(&mut random, 2 + (k % 4) as u64);
        let indices = [[0, 1, 2], if n == 1 { [0, 4, 5] } else { [0, 1, 5] }];
        indices[1].iter().enumerate().for_each(|(i, v)| p[3 + i] = p[*v as usize]);
        let (a, b) = ([&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[5]]);
        let expected = if reference_sharing::<Ratio<i128>>(a, b, n) { reference::<Ratio<i128>>(a, b) } else { Contact::Disjoint };
        counts[n - 1][expected as usize] += 1;
        for turn in 0..3 {
            let at = |t: [&'_ Point; 3], i: [u32; 3]| -> ([Point; 3], [u32; 3]) {
                ([0, 1, 2].map(|k| *t[(k + turn) % 3]), [0, 1, 2].map(|k| i[(k + turn) % 3]))
            };
            let ((ta, ia), ([x, y, z], [i, j, k])) = (at(a, indices[0]), at(b, indices[1]));
            assert_eq!(triangles_sharing(ta.each_ref(), ia, [&z, &y, &x], [k, j, i]), expected, "{p:?} {indices:?}");
            assert_eq!(triangles_sharing([&x, &y, &z], [i, j, k], ta.each_ref(), ia), expected, "{p:?} {indices:?}");
        }
    }
    assert!(
        counts[0].iter().all(|n| *n > pairs / 100) && counts[1][0] > 0 && counts[1][3] > 0,
        "all kinds must occur: {counts:?}"
    );
}

#[test]
fn pairs_that_share_corners_agree_with_rational_arithmetic() {
    compare_sharing(10_000, 1);
}

#[test]
fn the_same_triangle_twice_is_left_to_checks_of_connectivity() {
    let p = grid(&mut Random(3), 5);
    let t = [&p[0], &p[1], &p[2]];
    assert_eq!(triangles_sharing(t, [7, 8, 9], [t[2], t[0], t[1]], [9, 7, 8]), Contact::Disjoint);
    assert!(triangles_sharing(t, [7, 8, 9], t, [4, 5, 6]).is_some());
}

#[test]
fn a_segment_passes_where_rational_arithmetic_says_so() {
    let mut random = Random(11);
    let mut passages = 0;
    for k in 0..4000 {
        let p = grid(&mut random, 3 + (k % 3) as u64);
        let (t, needle) = ([&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[4]]);
        let (st, sn) = (set(&exact::<Ratio<i128>>(t)), set(&exact::<Ratio<i128>>(needle)));
        let one_plane = st.hull.len() < 3 || sn.hull.iter().all(|x| height(&st.equal[0], x).is_zero());
        let common = common_part(&sn, &st);
        let got = segment_triangle(needle[0], needle[1], t);
        assert_eq!(got.is_some(), !one_plane && !common.is_empty(), "{p:?}");
        if let Some(passage) = got {
            let place: Vec<f64> = common[0].iter().map(|x| *x.numer() as f64 / *x.denom() as f64).collect();
            let place = Point::new(place[0], place[1], place[2]);
            let on_segment = needle[0] + (needle[1] - needle[0]) * passage.parameter;
            // The coordinates are below 5: a few roundings.
            approx::assert_relative_eq!(on_segment, place, epsilon = 1e-14);
            approx::assert_relative_eq!(crate::math::barycentric_point(t, passage.barycentric), place, epsilon = 1e-14);
            assert_eq!(
                passage.direction,
                if needle[1] == &on_segment { -1 } else { 1 }
                    * side_of_plane(t[0], t[1], t[2], if needle[1] == &on_segment { needle[0] } else { needle[1] })
            );
            passages += 1;
        }
    }
    assert!(passages > 200, "{passages}");
}

#[test]
fn a_passage_keeps_its_numbers_in_range_at_every_scale() {
    for scale in [1e-320, 1e-160, 1.0, 1e160, 1e307] {
        let t = [Point::new(0.0, 0.0, 0.0), Point::new(scale, 0.0, 0.0), Point::new(0.0, scale, 0.0)];
        let (p, q) = (Point::new(scale * 0.25, scale * 0.25, scale), Point::new(scale * 0.25, scale * 0.25, -scale));
        let hit = segment_triangle(&p, &q, t.each_ref()).unwrap();
        assert_eq!(hit.direction, -1);
        assert!((0.0..=1.0).contains(&hit.parameter), "{hit:?}");
        assert!(hit.barycentric.iter().all(|b| (0.0..=1.0).contains(b)), "{hit:?}");
    }
}

#[test]
#[ignore = "stress"]
fn a_million_pairs_agree_with_rational_arithmetic() {
    std::thread::scope(|scope| {
        for seed in 2..4 {
            scope.spawn(move || compare_grids(450_000, seed));
            scope.spawn(move || compare_floats(50_000, seed));
            scope.spawn(move || compare_sharing(200_000, seed));
            scope.spawn(move || compare_mixed(2_000, seed));
        }
    });
}
