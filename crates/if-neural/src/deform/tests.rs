use super::*;
use crate::mlp::DeformationConfig;
use if_core::math::Vector;
use if_core::monitor::{Cancelled, Progress, Silent};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::ops::ControlFlow;

/// A bar whose upper half bends to and fro.
fn bending() -> (Vec<Point>, Vec<Vec<Point>>) {
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mut within = |a: f64, b: f64| random.random_range(a..b);
    let canonical: Vec<Point> = (0..400)
        .map(|_| Point::new(within(-0.1, 0.1), within(-0.9, 0.9), within(-0.1, 0.1)))
        .collect();
    let frames = (0..5).map(|i| {
        let bend = 0.3 * (i as f64 - 2.0) / 2.0;
        canonical.iter().map(|p| p + Vector::x() * (bend * p.y.max(0.0).powi(2))).collect()
    });
    (canonical.clone(), frames.collect())
}

#[test]
fn a_known_motion_is_learned_and_seen_at_points_that_were_held_out() {
    let (canonical, frames) = bending();
    let config = DeformationConfig { bands: 2, embedding: 8, frames: 5, width: 32, layers: 2 };
    let mut network = DeformationNetwork::new(&config, 1).unwrap();
    let params = DeformParams {
        steps: 250,
        batch: 128,
        anneal: 40,
        schedule: Schedule { rate: 5e-3, ..DeformParams::default().schedule },
        ..Default::default()
    };
    let run =
        fit_deformation(&mut network, &Frame::UNIT, &canonical, &frames, &params, &mut Silent);
    let report = run.unwrap();
    assert!(
        report.error.mean < 0.25 * report.error.still && report.error.still > 0.02,
        "{report:?}"
    );
    assert!(report.error.strain < 0.5 && report.ended == Ended::Steps, "{report:?}");
}

#[test]
fn invalid_input_is_named() {
    let (canonical, frames) = bending();
    let config = DeformationConfig { bands: 2, embedding: 8, frames: 5, width: 16, layers: 2 };
    let mut network = DeformationNetwork::new(&config, 1).unwrap();
    let mut run = |canonical: &[Point], frames: &[Vec<Point>], params: DeformParams| {
        fit_deformation(
            &mut network,
            &Frame::UNIT,
            canonical,
            frames,
            &params,
            &mut |_: &Progress<'_>| ControlFlow::Break(()),
        )
    };
    let params = DeformParams { batch: 8, ..Default::default() };
    for few in 0..4 {
        let error = run(&canonical[..few], &frames, params).unwrap_err();
        assert!(error == FitError::TooFewPoints { got: few, needed: 4 }, "{error}");
    }
    assert_eq!(
        run(&canonical, &frames[1..], params),
        Err(FitError::FrameCount { got: 4, expected: 5 })
    );
    let mut short = frames.clone();
    short[3].pop();
    assert_eq!(
        run(&canonical, &short, params),
        Err(FitError::PointCount { frame: 3, got: 399, expected: 400 })
    );
    let mut bad = frames.clone();
    bad[2][7].z = f64::NAN;
    assert_eq!(
        run(&canonical, &bad, params),
        Err(FitError::NotFinite { point: 7, place: "frame 2".into() })
    );
    bad[2][7].z = 1e300;
    assert_eq!(
        run(&canonical, &bad, params),
        Err(FitError::NotFinite { point: 7, place: "frame 2".into() })
    );
    for (bad, name) in [
        (DeformParams { batch: 0, ..params }, "batch"),
        (DeformParams { adam: AdamParams { beta2: 1.0, ..params.adam }, ..params }, "adam.beta2"),
        (
            DeformParams { adam: AdamParams { beta2: f32::NAN, ..params.adam }, ..params },
            "adam.beta2",
        ),
        (
            DeformParams { schedule: Schedule { rate: 1e300, ..params.schedule }, ..params },
            "schedule.rate",
        ),
    ] {
        let error = run(&canonical, &frames, bad).unwrap_err();
        assert!(matches!(&error, FitError::Parameter(e) if e.name == name), "{error}");
    }
    assert_eq!(run(&canonical, &frames, params), Err(FitError::Cancelled(Cancelled)));
    network.parameters_mut()[5] = f32::NAN;
    assert_eq!(
        fit_deformation(&mut network, &Frame::UNIT, &canonical, &frames, &params, &mut Silent),
        Err(FitError::NotANumber)
    );
}

#[test]
fn a_fit_that_runs_away_leaves_the_state_it_began_with() {
    let (canonical, frames) = bending();
    let config = DeformationConfig { bands: 2, embedding: 8, frames: 5, width: 32, layers: 2 };
    let start = DeformationNetwork::new(&config, 1).unwrap();
    let usual = DeformParams::default().schedule;
    let run = |rate: f64, steps: u64| {
        let mut network = start.clone();
        let params = DeformParams {
            batch: 64,
            steps,
            schedule: Schedule { rate, ..usual },
            ..Default::default()
        };
        let report =
            fit_deformation(&mut network, &Frame::UNIT, &canonical, &frames, &params, &mut Silent)
                .unwrap();
        (report, network)
    };
    let before = run(1e-3, 0).0.error;
    assert!(before.mean > 0.02, "{before:?}");
    // Far off after a step; no numbers after the last step, or after one more.
    for (rate, steps) in [(1e6, 1), (1e30, 1), (1e38, 1), (1e38, 2), (1e38, CHECK_EVERY)] {
        let (report, network) = run(rate, steps);
        assert_eq!(
            (report.kept, report.ended, report.error),
            (0, Ended::Diverged, before),
            "rate {rate}: {report:?}"
        );
        assert!(
            network.parameters() == start.parameters() && network.alpha() == start.alpha(),
            "rate {rate}"
        );
    }
    // Too fast to learn: the result is no worse than the start.
    let (report, network) = run(10.0, 300);
    assert!(report.error.mean <= before.mean, "{report:?}");
    assert!(report.kept > 0 || network.parameters() == start.parameters());
}
