//! A loose garment gives way to a tight one worn over it, and only when it is asked to or must.

use crate::scenes::{assert_clean, assert_clean_or_left, ball_in_tube, moved};
use if_core::math::Point;
use if_core::monitor::Silent;
use if_mesh::solid::ClosedLayer;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{EffortParams, ResolveError, ResolveParams, Resolved, Tuck, resolve};

/// A ball of 0.3 m radius in a band of 0.36 m, and over that a wider one of 0.33 m.
fn tight_over_loose() -> Outfit {
    let [inner, outer] = [ball_in_tube("loose", 0.36), ball_in_tube("tight", 0.33)]
        .map(|mut o| o.garments.remove(0));
    let inner = Layer::new("loose", moved(&inner.mesh, |p| Point::new(p.x, 0.7 * p.y, p.z)));
    Outfit::new(ball_in_tube("loose", 0.36).body, vec![inner, outer]).unwrap()
}

fn run(outfit: &Outfit, params: &ResolveParams) -> Result<Resolved, ResolveError> {
    resolve(outfit, params, &mut Silent)
}

fn with(tuck: Tuck) -> ResolveParams {
    let mut params = ResolveParams::default();
    params.goal.tuck = tuck;
    params
}

/// Vertices of `layer` further out from the axis than `radius`.
fn outside(layer: &Layer, radius: f64) -> usize {
    layer.mesh.vertices().iter().filter(|p| p.x.hypot(p.z) > radius).count()
}

#[test]
fn where_it_is_always_asked_for_the_loose_garment_moves_and_the_tight_one_does_not_tear() {
    let outfit = tight_over_loose();
    let never = assert_clean(&outfit, run(&outfit, &with(Tuck::Never)));
    let always = assert_clean(&outfit, run(&outfit, &with(Tuck::Always)));
    let strain = |r: &Resolved, k: usize| r.report.layers[k].strain.rms;
    // Only the outer of two layers moves: it is stretched by 3 cm in 33.
    assert!(never.report.layers.iter().all(|l| l.tucked == [0; 2]));
    assert_eq!(
        (never.report.layers[0].moved.vertices, never.outfit.garments[0] == outfit.garments[0]),
        (0, true)
    );
    assert!(strain(&never, 1) > 0.05, "{}", strain(&never, 1));
    // All of the inner one stuck out; now next to nothing does.
    let [before, after] = always.report.layers[0].tucked;
    assert_eq!(before, outfit.garments[0].mesh.vertices().len());
    assert!(after * 20 <= before, "{before} -> {after}");
    assert!(
        strain(&always, 1) < 0.2 * strain(&never, 1),
        "{} of {}",
        strain(&always, 1),
        strain(&never, 1)
    );
    assert!(
        outside(&never.outfit.garments[1], 0.34) > 0
            && outside(&always.outfit.garments[0], 0.34) * 20 <= before
    );
    // The inner one stays outside the ball.
    let ball = ClosedLayer::body(&outfit.body.mesh);
    let inner = always.outfit.garments[0].mesh.vertices();
    assert!(inner.iter().all(|p| ball.sided(p, 1.0).is_some_and(|s| s.distance > 0.0)));
}

#[test]
fn where_the_tight_garment_settles_the_loose_one_is_left_alone() {
    let outfit = tight_over_loose();
    assert_eq!(
        run(&outfit, &with(Tuck::IfStuck)).unwrap().outfit,
        run(&outfit, &with(Tuck::Never)).unwrap().outfit
    );
}

#[test]
fn where_the_tight_garment_gets_stuck_the_loose_one_is_pressed_in() {
    let outfit = tight_over_loose();
    // So slow that 3 cm are not made before repairs count as stalled.
    let effort = EffortParams {
        settle_rounds: 1,
        sweeps: 1,
        contact_step: 1e-5,
        max_push: 1e-5,
        rounds: 60,
        ..EffortParams::default()
    };
    let slow = |tuck| ResolveParams { effort: effort.clone(), ..with(tuck) };
    let tucked = |outcome: &Result<Resolved, ResolveError>| match outcome {
        Ok(result) => result.report.layers[0].tucked[0],
        Err(ResolveError::Unresolved { result, .. }) => result.report.layers[0].tucked[0],
        Err(error) => panic!("{error}"),
    };
    let never = run(&outfit, &slow(Tuck::Never));
    let stuck = run(&outfit, &slow(Tuck::IfStuck));
    assert_eq!((tucked(&never), tucked(&stuck)), (0, outfit.garments[0].mesh.vertices().len()));
    // The report holds each layer and pair of layers once, as it is in the end.
    assert_clean_or_left(&outfit, never);
    assert_clean_or_left(&outfit, stuck);
}

#[test]
fn nothing_is_pressed_in_where_garments_do_not_meet_or_only_meet_the_body() {
    let apart = |inner, outer| {
        let garments = [ball_in_tube("inner", inner), ball_in_tube("outer", outer)]
            .map(|mut o| o.garments.remove(0));
        Outfit::new(ball_in_tube("inner", inner).body, garments.to_vec()).unwrap()
    };
    let clean = apart(0.32, 0.34);
    assert_eq!(assert_clean(&clean, run(&clean, &with(Tuck::Always))).outfit, clean);
    // The inner band cuts into the ball, the outer one is far from both.
    let low = apart(0.295, 0.36);
    let always = assert_clean(&low, run(&low, &with(Tuck::Always)));
    assert!(always.report.layers.iter().all(|l| l.tucked == [0; 2]));
    assert_eq!(always.outfit, run(&low, &with(Tuck::Never)).unwrap().outfit);
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let outfit = tight_over_loose();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&outfit, &with(Tuck::Always)).unwrap().outfit)
    };
    assert_eq!(on(1), on(3));
}
