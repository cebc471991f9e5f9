use super::*;
use if_core::aabb::Aabb;
use if_core::conformance::{FieldTolerances, check_signed_distance};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_core::random::SplitMix64;
use if_core::shapes::{
    Capsule, Cuboid, Cylinder, Gyroid, Intersection, Plane, ScaledGradient, Sphere, Subtraction,
    Torus, Union,
};

fn random_point(random: &mut SplitMix64, b: &Aabb) -> Point {
    Point::from([0, 1, 2].map(|k| b.min[k] + random.unit() * (b.max[k] - b.min[k])))
}

const BALL: Sphere = Sphere { center: Point::new(0.01, 0.02, -0.03), radius: 0.2 };
const TORUS: Torus = Torus { center: Point::new(0.0, 0.01, 0.0), major: 0.2, minor: 0.07 };
const BRICK_SHAPE: Cuboid =
    Cuboid { center: Point::new(0.0, 0.0, 0.003), half: Vector::new(0.1, 0.17, 0.13) };
const LIMB: Capsule =
    Capsule { from: Point::new(-0.1, -0.2, 0.0), to: Point::new(0.15, 0.1, 0.05), radius: 0.06 };
const TIN: Cylinder =
    Cylinder { center: Point::new(0.0, 0.0, 0.0), radius: 0.13, half_height: 0.2 };

/// A source, and the distance that it should read as.
struct Case(&'static str, Box<dyn SignedDistance>, Box<dyn SignedDistance>);

fn cases() -> Vec<Case> {
    fn same<F: SignedDistance + Copy + 'static>(name: &'static str, f: F) -> Case {
        Case(name, Box::new(f), Box::new(f))
    }
    fn scaled<F: SignedDistance + Copy + 'static>(name: &'static str, f: F, factor: Real) -> Case {
        Case(name, Box::new(ScaledGradient { field: f, factor }), Box::new(f))
    }
    vec![
        same("ball", BALL),
        same("torus", TORUS),
        same("cuboid", BRICK_SHAPE),
        same("limb", LIMB),
        same("tin", TIN),
        same("union", Union(BALL, LIMB)),
        same("subtraction", Subtraction(BALL, LIMB)),
        same(
            "half ball",
            Intersection(
                BALL,
                Plane { point: Point::new(0.0, 0.05, 0.0), normal: Vector::new(0.0, 0.8, 0.6) },
            ),
        ),
        scaled("ball / 2", BALL, 0.5),
        scaled("ball × 2", BALL, 2.0),
        scaled("torus / 2", TORUS, 0.5),
        scaled("torus × 2", TORUS, 2.0),
        scaled("limb × 2", LIMB, 2.0),
        scaled("cuboid / 2", BRICK_SHAPE, 0.5),
        scaled("tin × 2", TIN, 2.0),
    ]
}

fn check_error(points: usize, cell: Real) {
    for Case(name, source, truth) in cases() {
        let baked =
            Baked::new(&*source, &BakeParams { cell, ..BakeParams::default() }, &mut Silent)
                .unwrap();
        let solid = baked.bounds().unwrap();
        let region = truth.bounds().unwrap().inflated(0.08);
        let mut random = SplitMix64::new(7);
        for _ in 0..points {
            let p = random_point(&mut random, &region);
            let (got, expected) = (baked.distance(&p), truth.distance(&p));
            let bound = baked.error_bound();
            if expected > baked.band() - bound {
                // Beyond the band, or where the blend says so, the value is at least the band and
                // at most the distance. That is more than what an intersection says, and more than
                // the distance to its box.
                let least = expected.min(baked.band()) - bound;
                let expected = expected.max(solid.distance_squared(&p).sqrt());
                assert!(
                    least <= got && got <= expected + bound,
                    "{name}: {got} for {expected} at {p}"
                );
            } else {
                let bound = baked.error_bound_within(expected.abs());
                assert!(
                    (got - expected).abs() <= bound,
                    "{name}: {got} for {expected} at {p}, bound {bound}"
                );
            }
        }
    }
}

#[test]
fn no_random_point_exceeds_the_stated_error() {
    check_error(2_000, 0.03);
}

#[test]
#[ignore = "stress"]
fn none_of_a_million_points_exceeds_the_stated_error() {
    check_error(1_000_000, 0.012);
}

#[test]
fn smooth_surfaces_are_exact_to_a_hundredth_of_a_millimetre() {
    for (field, factor) in [(BALL, 1.0), (BALL, 0.5), (BALL, 2.0)] {
        let baked =
            Baked::new(&ScaledGradient { field, factor }, &BakeParams::default(), &mut Silent)
                .unwrap();
        assert_eq!(baked.is_redistanced(), factor != 1.0);
        assert!(baked.error_bound_within(0.03) < 1e-5, "{}", baked.error_bound_within(0.03));
        let mut random = SplitMix64::new(3);
        for _ in 0..2000 {
            let direction =
                (random_point(&mut random, &BALL.bounds().unwrap()) - BALL.center).normalize();
            let p = BALL.center + direction * (BALL.radius + 0.06 * random.unit() - 0.03);
            let sample = baked.sample(&p);
            approx::assert_relative_eq!(sample.gradient, direction, epsilon = 2e-3);
        }
    }
    let torus =
        Baked::new(&TORUS, &BakeParams { cell: 0.006, ..BakeParams::default() }, &mut Silent)
            .unwrap();
    assert!(torus.error_bound_within(0.02) < 1e-5, "{}", torus.error_bound_within(0.02));
}

#[test]
fn a_tighter_grid_has_a_smaller_error() {
    let mut last = Real::INFINITY;
    for cell in [0.032, 0.016] {
        let baked = Baked::new(
            &ScaledGradient { field: TORUS, factor: 2.0 },
            &BakeParams { cell, ..BakeParams::default() },
            &mut Silent,
        )
        .unwrap();
        // Fourth order. (From 8 mm on single precision ends it, at about a micrometre.)
        assert!(
            baked.error_bound_within(0.01) < last / 5.0,
            "{cell}: {} after {last}",
            baked.error_bound_within(0.01)
        );
        last = baked.error_bound_within(0.01);
    }
}

#[test]
fn baked_fields_conform() {
    for (k, Case(name, source, _)) in cases().into_iter().enumerate() {
        let depth = [Real::INFINITY, 0.03][k % 2];
        let baked = Baked::new(
            &*source,
            &BakeParams { cell: 0.03, depth, ..BakeParams::default() },
            &mut Silent,
        )
        .unwrap();
        let region = source.bounds().unwrap().inflated(0.1);
        let mut random = SplitMix64::new(1);
        let points: Vec<Point> = (0..250).map(|_| random_point(&mut random, &region)).collect();
        // Faces of cells are slight kinks. At the border of the band the value may jump by the
        // error.
        let tolerances = FieldTolerances {
            rounding: 2.0 * baked.error_bound(),
            kinks: 0.2,
            ..FieldTolerances::default()
        };
        if let Err(fault) = check_signed_distance(&baked, &points, &tolerances) {
            panic!("{name}: {fault}");
        }
    }
}

#[test]
fn a_whole_inside_has_a_direction_everywhere_and_a_shallow_one_a_floor() {
    let params = BakeParams { cell: 0.006, ..BakeParams::default() };
    let whole = Baked::new(&BALL, &params, &mut Silent).unwrap();
    let shallow = Baked::new(&BALL, &BakeParams { depth: 0.04, ..params }, &mut Silent).unwrap();
    assert!(shallow.bytes() < whole.bytes());
    let p = BALL.center + Vector::new(0.05, 0.0, 0.0);
    approx::assert_relative_eq!(whole.sample(&p).gradient, Vector::x(), epsilon = 0.05);
    assert_eq!(shallow.sample(&p), FieldSample { distance: -0.04, gradient: Vector::zeros() });
    assert!(shallow.distance(&BALL.center) < 0.0);
}

#[test]
fn far_away_the_value_is_a_lower_bound() {
    let baked = Baked::new(&BALL, &BakeParams::default(), &mut Silent).unwrap();
    for scale in [0.3, 1.0, 100.0, 1e9, 1e200] {
        let p = Point::new(scale, -0.5 * scale, 0.7 * scale);
        let (got, expected) = (baked.distance(&p), BALL.distance(&p));
        assert!(got >= baked.band() && got <= expected * (1.0 + 1e-12), "{got} for {expected}");
    }
}

/// A ball that is not a number, or infinite, in some places.
struct Hole(Real);
impl SignedDistance for Hole {
    fn distance(&self, p: &Point) -> Real {
        if p.x > 0.15 { self.0 } else { BALL.distance(p) }
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), ..BALL.sample(p) }
    }
    fn bounds(&self) -> Option<Aabb> {
        BALL.bounds()
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

#[test]
fn what_cannot_be_baked_is_refused_with_a_reason() {
    let bake = |params: BakeParams| Baked::new(&BALL, &params, &mut Silent).map(|b| b.bytes());
    let with = BakeParams::default();
    for cell in [0.0, -1.0, Real::NAN, Real::INFINITY] {
        assert!(matches!(
            bake(BakeParams { cell, ..with }),
            Err(BakeError::Parameter(e)) if e.name == "cell"
        ));
    }
    assert!(matches!(
        bake(BakeParams { band: Real::NAN, ..with }),
        Err(BakeError::Parameter(e)) if e.name == "band"
    ));
    // Narrower than a cell, the band has no node near the surface, which is then lost with a stated
    // error of nothing.
    let narrow = BakeParams { band: 0.9 * with.cell, ..with };
    assert!(matches!(bake(narrow), Err(BakeError::Parameter(e)) if e.name == "band"));
    assert!(matches!(
        bake(BakeParams { depth: 0.0, ..with }),
        Err(BakeError::Parameter(e)) if e.name == "depth"
    ));
    for cell in [1e-3, 1e-6, 1e-12, 1e-300] {
        let error = bake(BakeParams { cell, memory: 1 << 24, ..with }).unwrap_err();
        assert!(matches!(error, BakeError::TooLarge { limit: 0x100_0000, .. }), "{error}");
    }
    assert!(matches!(
        bake(BakeParams { region: Some(Aabb::EMPTY), ..with }),
        Err(BakeError::Region { .. })
    ));
    let endless = Plane { point: Point::origin(), normal: Vector::y() };
    assert_eq!(Baked::new(&endless, &with, &mut Silent).unwrap_err(), BakeError::Unbounded);
    let region = Some(Aabb { min: Point::new(-0.2, -0.2, -0.2), max: Point::new(0.2, 0.2, 0.2) });
    assert!(matches!(
        Baked::new(&endless, &BakeParams { region, ..with }, &mut Silent),
        Err(BakeError::Leaves { .. })
    ));
    assert!(matches!(
        Baked::new(
            &Gyroid { period: 0.3 },
            &BakeParams { region, depth: 0.01, ..with },
            &mut Silent
        ),
        Err(BakeError::Leaves { .. })
    ));
    for hole in [Real::NAN, Real::INFINITY, Real::NEG_INFINITY] {
        match Baked::new(&Hole(hole), &with, &mut Silent).unwrap_err() {
            BakeError::NotFinite { point, .. } => assert!(point.x > 0.15),
            other => panic!("{other}"),
        }
    }
    // Steeper than it says: a ball that ends at x = 0.15.
    assert!(matches!(Baked::new(&Hole(9.0), &with, &mut Silent), Err(BakeError::Steep { .. })));
}

#[test]
fn a_surface_that_is_not_there_leaves_an_empty_field() {
    let nothing = Intersection(BALL, Sphere { center: Point::new(9.0, 0.0, 0.0), radius: 1.0 });
    let region = BALL.bounds();
    let baked =
        Baked::new(&nothing, &BakeParams { region, ..BakeParams::default() }, &mut Silent).unwrap();
    assert_eq!(
        baked.sample(&Point::origin()),
        FieldSample { distance: 0.05, gradient: Vector::zeros() }
    );
    assert_eq!(baked.bounds(), Some(Aabb::EMPTY));
}

#[test]
fn a_wall_thinner_than_a_cell_keeps_its_sign_and_halved_cells_give_it_its_depth() {
    // 3 mm in 12 mm cells: no two nodes lie inside, the slopes tell.
    let wall = Cuboid { center: Point::new(0.0, 0.0, 0.0041), half: Vector::new(0.1, 0.1, 0.0015) };
    let whole = Baked::new(
        &wall,
        &BakeParams { accuracy: Real::INFINITY, ..BakeParams::default() },
        &mut Silent,
    )
    .unwrap();
    let halved = Baked::new(&wall, &BakeParams::default(), &mut Silent).unwrap();
    for k in 0..50 {
        let p = Point::new(0.0031 * f64::from(k) - 0.08, 0.011, 0.0041);
        assert!(whole.distance(&p) < 0.0);
        approx::assert_relative_eq!(halved.distance(&p), -0.0015, epsilon = 1e-3);
    }
    assert!(whole.error_bound_within(0.001) > 1e-3, "and its bound says that the depth is poor");
    assert!(
        halved.error_bound_within(0.001) <= 1e-3 && halved.smallest_cell() < whole.smallest_cell()
    );
}

#[test]
fn cells_are_small_only_where_that_is_needed() {
    // A limb as thick as an arm that carries one as thin as a finger.
    let field = Union(
        Capsule { from: Point::new(-0.3, 0.0, 0.0), to: Point::new(0.0, 0.0, 0.0), radius: 0.05 },
        Capsule {
            from: Point::new(0.0, 0.0, 0.0),
            to: Point::new(0.15, 0.01, 0.02),
            radius: 0.007,
        },
    );
    for source in [ScaledGradient { field, factor: 1.0 }, ScaledGradient { field, factor: 2.0 }] {
        let baked = Baked::new(&source, &BakeParams::default(), &mut Silent).unwrap();
        let bound = baked.error_bound_within(0.02);
        // Cells of 1.5 mm, as small as the default allows, leave that much at an axis; where the
        // limbs meet is a crease.
        let crease =
            if baked.is_redistanced() { 0.25 * baked.cell() / Real::sqrt(3.0) } else { 0.0 };
        assert!(bound <= 1.5e-3 + crease, "{bound}");
        let mut random = SplitMix64::new(5);
        let mut worst: Real = 0.0;
        for _ in 0..20_000 {
            let p = random_point(&mut random, &field.bounds().unwrap().inflated(0.02));
            // Where it is the distance: not in the part of one limb that lies in the other.
            let truth = field.distance(&p);
            if truth.abs() < 0.02 && (p.x > 0.07 || truth > 0.0) {
                worst = worst.max((baked.distance(&p) - truth).abs());
            }
        }
        assert!(worst <= bound && bound - crease < 4.0 * worst, "{worst} {bound}");
        // As many bricks as if all cells were as small as the smallest.
        let bricks = baked.bricks_by_level();
        let even: usize =
            bricks.iter().enumerate().map(|(l, n)| n << (3 * (bricks.len() - 1 - l))).sum();
        assert!(even > 10 * bricks.iter().sum::<usize>(), "{bricks:?}");
    }
}

#[test]
fn baking_gives_the_same_bits_on_any_number_of_threads() {
    let source = ScaledGradient { field: Union(TORUS, LIMB), factor: 0.5 };
    let bake = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            Baked::new(&source, &BakeParams { cell: 0.02, ..BakeParams::default() }, &mut Silent)
                .unwrap()
        })
    };
    let (one, seven) = (bake(1), bake(7));
    assert_eq!(one.bricks.nodes, seven.bricks.nodes);
    assert_eq!((one.error_bound(), one.lipschitz()), (seven.error_bound(), seven.lipschitz()));
}
