use super::build::{node_count, of_rank};
use super::pairs::{above, below};
use super::*;
use if_core::closest::{ClosestPoint, closest_on_triangle};
use if_core::math::{Real, barycentric_point};
use if_core::random::SplitMix64;

#[test]
fn nodes_are_counted_as_splits_make_them() {
    fn split(n: usize) -> usize {
        if n <= 4 { 1 } else { 1 + split(n / 2) + split(n - n / 2) }
    }
    for n in (1..3000).chain([65_535, 65_536, 65_537, 1_234_567]) {
        assert_eq!(node_count(n), split(n), "{n}");
    }
}

#[test]
fn nothing_is_nearer_than_a_negative_distance() {
    let tree = Bvh::new(&if_core::shapes::meshes::icosphere(1.0, 1));
    let p = Point::new(1.5, 0.0, 0.0);
    assert!(tree.closest(&p, 1.0).is_some() && tree.closest(&p, 0.1).is_none());
    for limit in [-1.0, -1e-300, Real::NEG_INFINITY, Real::NAN] {
        assert_eq!(tree.closest(&p, limit), None, "{limit}");
    }
    assert!(
        tree.closest(&tree.corners[0][0], 0.0).is_some(),
        "what lies on it is at distance zero"
    );
}

/// A bumpy sheet with some far and some degenerate triangles.
fn sheet(n: u32) -> TriMesh {
    let mut v = Vec::new();
    let mut t = Vec::new();
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (f64::from(x) / f64::from(n), f64::from(y) / f64::from(n));
            v.push(Point::new(x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos()));
        }
    }
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            t.push([a, a + 1, a + n + 2]);
            t.push([a, a + n + 2, a + n + 1]);
        }
    }
    let k = v.len() as u32;
    v.extend([Point::new(9.0, 9.0, 9.0); 3]);
    t.push([k, k + 1, k + 2]);
    TriMesh::new(v, t).unwrap()
}

fn points(n: u64) -> Vec<Point> {
    let mut random = SplitMix64::new(7);
    let mut next = move || random.unit() * 1.6 - 0.3;
    (0..n).map(|_| Point::new(next(), next(), next() * 0.4)).collect()
}

#[test]
fn nearest_points_agree_with_all_triangles() {
    let mesh = sheet(12);
    let bvh = Bvh::new(&mesh);
    for p in points(500) {
        let all = (0..mesh.triangles().len())
            .map(|t| {
                let c = mesh.corners(t);
                (barycentric_point(c, closest_on_triangle(&p, c[0], c[1], c[2]).0) - p).norm()
            })
            .fold(Real::INFINITY, Real::min);
        let got = bvh.closest(&p, Real::INFINITY).unwrap();
        approx::assert_relative_eq!(got.distance, all, epsilon = 1e-14);
        approx::assert_relative_eq!((got.point - p).norm(), all, epsilon = 1e-14);
        assert!(bvh.closest(&p, all * 0.999).is_none());
        assert!(bvh.closest(&p, all * 1.001 + 1e-12).is_some());
    }
}

#[test]
fn a_refitted_tree_returns_the_results_of_a_new_one() {
    let mesh = sheet(10);
    let moved = mesh
        .with_vertices(
            mesh.vertices().iter().map(|p| Point::new(p.z, p.x * 2.0, p.y + p.x)).collect(),
        )
        .unwrap();
    let mut refitted = Bvh::new(&mesh);
    refitted.refit(moved.vertices());
    let fresh = Bvh::new(&moved);
    for p in points(200) {
        let (a, b) = (refitted.closest(&p, 1.0), fresh.closest(&p, 1.0));
        assert_eq!(a.map(|c| c.distance), b.map(|c| c.distance));
    }
}

#[test]
#[should_panic(expected = "all positions must be finite")]
fn a_tree_is_not_refitted_to_nan() {
    let mesh = sheet(3);
    let mut x = mesh.vertices().to_vec();
    x[5].y = Real::NAN;
    Bvh::new(&mesh).refit(&x);
}

#[test]
fn boxes_pairs_and_segments_agree_with_all_triangles() {
    let mesh = sheet(9);
    let bvh = Bvh::new(&mesh);
    let region = Aabb { min: Point::new(0.2, 0.1, -0.02), max: Point::new(0.4, 0.35, 0.05) };
    let mut got = Vec::new();
    bvh.overlapping(&region, |t| got.push(t));
    got.sort_unstable();
    let all: Vec<u32> = (0..mesh.triangles().len() as u32)
        .filter(|&t| Aabb::from_points(mesh.corners(t as usize)).overlaps(&region))
        .collect();
    assert_eq!(got, all);

    let other = mesh
        .with_vertices(
            mesh.vertices().iter().map(|p| Point::new(p.x + 0.03, p.y - 0.02, -p.z)).collect(),
        )
        .unwrap();
    let other_bvh = Bvh::new(&other);
    let mut pairs = bvh.near_pairs(&other_bvh, |a, ta, b, tb| {
        corner_box(ta).overlaps(&corner_box(tb)).then_some((a, b))
    });
    pairs.sort_unstable();
    let mut all = Vec::new();
    for a in 0..mesh.triangles().len() {
        for b in 0..other.triangles().len() {
            if Aabb::from_points(mesh.corners(a)).overlaps(&Aabb::from_points(other.corners(b))) {
                all.push((a as u32, b as u32));
            }
        }
    }
    assert_eq!(pairs, all);

    let hit = bvh
        .first_hit(&Point::new(0.52, 0.53, 1.0), &Point::new(0.52, 0.53, -1.0), |_| true)
        .unwrap();
    let z = 1.0 - 2.0 * hit.parameter;
    let [a, b, c] = mesh.corners(hit.triangle as usize);
    let n = if_core::math::area_vector(a, b, c);
    approx::assert_relative_eq!(n.dot(&(Point::new(0.52, 0.53, z) - a)), 0.0, epsilon = 1e-12);
    assert!(
        bvh.first_hit(&Point::new(0.5, 0.5, 1.0), &Point::new(0.5, 0.5, 0.5), |_| true).is_none()
    );
}

#[test]
fn pairs_of_chosen_triangles_are_those_of_all_that_have_one() {
    let bvh = Bvh::new(&sheet(9));
    let found = |is_searched: &dyn Fn(u32) -> bool| {
        let pair = |i: u32, _: &_, j: u32, _: &_, found: &mut Vec<_>| {
            found.push([i.min(j), i.max(j)]);
        };
        let mut pairs = bvh.own_pairs_within(0.06, is_searched, pair);
        pairs.sort_unstable();
        pairs
    };
    let all = found(&|_| true);
    for n in [1, 2, 7, 50, 1000] {
        let chosen = |t: u32| t % n == 1;
        let of_chosen = all.iter().filter(|p| p.iter().any(|t| chosen(*t)));
        assert_eq!(found(&chosen), of_chosen.copied().collect::<Vec<_>>(), "{n}");
    }
    assert!(found(&|_| false).is_empty() && all.len() > 1000);
}

#[test]
fn rounded_bounds_are_close_and_ranks_in_order() {
    let tiny = [0.0, 5e-324, 1e-310, 1e-45, 1.5e-45, 1e-38, 1.2e-38];
    let large = [3.4028234e38, 3.4028236e38, 1e39, Real::MAX, Real::INFINITY];
    let middle = points(300).into_iter().flat_map(|p| {
        [p.x, p.y * 1e-3, p.z * 1e9, f64::from(p.x as f32), f64::from((p.y as f32).next_up())]
    });
    let all: Vec<Real> =
        tiny.into_iter().chain(large).chain(middle).flat_map(|x| [x, -x]).collect();
    for &x in &all {
        let (l, h) = (f64::from(below(x)), f64::from(above(x)));
        assert!(l <= x && x <= h, "{l} {x} {h}");
        if x.abs() < 1e38 {
            assert!(h - l <= 5.0 * f64::from(f32::EPSILON) * x.abs() + 5e-38, "{l} {x} {h}");
        }
        assert_eq!(of_rank(rank(x)).to_bits(), x.to_bits());
    }
    for (x, y) in all.iter().zip(&all[1..]) {
        assert_eq!(rank(*x).cmp(&rank(*y)), x.total_cmp(y));
    }
}

#[test]
fn queries_of_an_empty_mesh_return_nothing() {
    let bvh = Bvh::new(&TriMesh::default());
    assert!(bvh.is_empty() && bvh.closest(&Point::origin(), Real::INFINITY).is_none());
    bvh.overlapping(&Aabb { min: Point::origin(), max: Point::origin() }, |_| {
        panic!("nothing to visit")
    });
    assert!(bvh.near_pairs(&bvh, |a, _, b, _| Some((a, b))).is_empty());
}
