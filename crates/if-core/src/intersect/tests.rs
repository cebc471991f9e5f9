//! Against rational arithmetic ([`super::rational`]).

use super::rational::*;
use super::*;
use num_rational::{BigRational, Ratio};
use num_traits::Zero;

/// The slow twin of [`triangles_sharing`]: is a corner of the common part off the hull of the
/// shared ones?
fn reference_sharing<T: Exact>(a: [&Point; 3], b: [&Point; 3], shared: usize) -> bool {
    let (ta, tb) = (exact::<T>(a), exact(b));
    let common = common_part(&set(&ta), &set(&tb));
    let edge = set(&[ta[0].clone(), ta[shared - 1].clone(), ta[0].clone()]);
    common.iter().any(|p| {
        edge.equal.iter().any(|e| !height(e, p).is_zero())
            || edge.within.iter().any(|e| height(e, p).is_negative())
    })
}

fn check<T: Exact>(p: &[Point; 6], counts: &mut [usize; 4]) {
    let [a, b] = [[&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[5]]];
    let expected = reference::<T>(a, b);
    counts[expected as usize] += 1;
    for turn in 0..3 {
        let a = [a[turn], a[(turn + 1) % 3], a[(turn + 2) % 3]];
        assert_eq!(triangles(a, b), expected, "{p:?}, corners turned by {turn}");
        let b = [b[2], b[1], b[0]];
        assert_eq!(
            triangles(b, a),
            expected,
            "{p:?} the other way round, corners turned by {turn}"
        );
    }
}

fn compare_grids(pairs: usize, seed: u64) {
    let mut random = SplitMix64::new(seed);
    let mut counts = [0; 4];
    for k in 0..pairs {
        check::<Ratio<i128>>(&grid(&mut random, 2 + k % 4), &mut counts);
    }
    assert!(counts.iter().all(|n| *n > pairs / 50), "all kinds must occur: {counts:?}");
}

fn compare_floats(pairs: usize, seed: u64) {
    let mut random = SplitMix64::new(seed);
    let mut counts = [0; 4];
    for k in 0..pairs {
        let scale = [1.0, 1.0, 1e-100, 1e100, 1e-30, 1e9, 1e-300, 1e300][k % 8];
        check::<BigRational>(&near_degenerate(&mut random, scale), &mut counts);
    }
    assert!(counts.iter().all(|n| *n > pairs / 100), "all kinds must occur: {counts:?}");
}

fn compare_mixed(pairs: usize, seed: u64) {
    let mut random = SplitMix64::new(seed);
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
    let mut random = SplitMix64::new(seed);
    let mut counts = [[0; 4]; 2];
    for k in 0..pairs {
        let n = 1 + k % 2;
        let mut p = grid(&mut random, 2 + k % 4);
        let indices = [[0, 1, 2], if n == 1 { [0, 4, 5] } else { [0, 1, 5] }];
        indices[1].iter().enumerate().for_each(|(i, v)| p[3 + i] = p[*v as usize]);
        let (a, b) = ([&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[5]]);
        let expected = if reference_sharing::<Ratio<i128>>(a, b, n) {
            reference::<Ratio<i128>>(a, b)
        } else {
            Contact::Disjoint
        };
        counts[n - 1][expected as usize] += 1;
        for turn in 0..3 {
            let at = |t: [&'_ Point; 3], i: [u32; 3]| -> ([Point; 3], [u32; 3]) {
                ([0, 1, 2].map(|k| *t[(k + turn) % 3]), [0, 1, 2].map(|k| i[(k + turn) % 3]))
            };
            let ((ta, ia), ([x, y, z], [i, j, k])) = (at(a, indices[0]), at(b, indices[1]));
            assert_eq!(
                triangles_sharing(ta.each_ref(), ia, [&z, &y, &x], [k, j, i]),
                expected,
                "{p:?} {indices:?}"
            );
            assert_eq!(
                triangles_sharing([&x, &y, &z], [i, j, k], ta.each_ref(), ia),
                expected,
                "{p:?} {indices:?}"
            );
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
    let p = grid(&mut SplitMix64::new(3), 5);
    let t = [&p[0], &p[1], &p[2]];
    assert_eq!(triangles_sharing(t, [7, 8, 9], [t[2], t[0], t[1]], [9, 7, 8]), Contact::Disjoint);
    assert!(triangles_sharing(t, [7, 8, 9], t, [4, 5, 6]).is_some());
}

#[test]
fn a_segment_passes_where_rational_arithmetic_says_so() {
    let mut random = SplitMix64::new(11);
    let mut passages = 0;
    for k in 0..4000 {
        let p = grid(&mut random, 3 + k % 3);
        let (t, needle) = ([&p[0], &p[1], &p[2]], [&p[3], &p[4], &p[4]]);
        let (st, sn) = (set(&exact::<Ratio<i128>>(t)), set(&exact::<Ratio<i128>>(needle)));
        let one_plane =
            st.hull.len() < 3 || sn.hull.iter().all(|x| height(&st.equal[0], x).is_zero());
        let common = common_part(&sn, &st);
        let got = segment_triangle(needle[0], needle[1], t);
        assert_eq!(got.is_some(), !one_plane && !common.is_empty(), "{p:?}");
        if let Some(passage) = got {
            let place: Vec<f64> =
                common[0].iter().map(|x| *x.numer() as f64 / *x.denom() as f64).collect();
            let place = Point::new(place[0], place[1], place[2]);
            let on_segment = needle[0] + (needle[1] - needle[0]) * passage.parameter;
            // The coordinates are below 5: a few roundings.
            approx::assert_relative_eq!(on_segment, place, epsilon = 1e-14);
            approx::assert_relative_eq!(
                crate::math::barycentric_point(t, passage.barycentric),
                place,
                epsilon = 1e-14
            );
            assert_eq!(
                passage.direction,
                if needle[1] == &on_segment { -1 } else { 1 }
                    * side_of_plane(
                        t[0],
                        t[1],
                        t[2],
                        if needle[1] == &on_segment { needle[0] } else { needle[1] }
                    )
            );
            passages += 1;
        }
    }
    assert!(passages > 200, "{passages}");
}

#[test]
fn a_passage_keeps_its_numbers_in_range_at_every_scale() {
    for scale in [1e-320, 1e-160, 1.0, 1e160, 1e307] {
        let t =
            [Point::new(0.0, 0.0, 0.0), Point::new(scale, 0.0, 0.0), Point::new(0.0, scale, 0.0)];
        let (p, q) = (
            Point::new(scale * 0.25, scale * 0.25, scale),
            Point::new(scale * 0.25, scale * 0.25, -scale),
        );
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
