//! `if-neural` with extreme weights, learning rates, targets, point clouds and spoiled files.

use crate::cases::{Random, Tally, cases, check, same_on_all_threads, share};
use crate::fields::{Fault, Hostile, Solid};
use crate::files::mutated;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_neural::adam::AdamParams;
use if_neural::cloud::OrientedPoints;
use if_neural::deformation::DeformationNetwork;
use if_neural::field::NeuralField;
use if_neural::files::{
    WeightNorm, read_checkpoint, read_deformation, read_network, write_checkpoint,
    write_deformation, write_network,
};
use if_neural::fit::{Fit, FitParams, FitReport};
use if_neural::frame::Frame;
use if_neural::grid::GridConfig;
use if_neural::loss::LossParams;
use if_neural::mlp::{DeformationConfig, SdfConfig};
use if_neural::network::{Network, NetworkConfig};
use if_neural::sampling::{SamplingParams, TrainingSet};
use if_neural::schedule::Schedule;
use if_neural::trainable::{Sample32, TrainableField};

/// A small network of either kind.
fn config(r: &mut Random) -> NetworkConfig {
    if r.chance(0.5) {
        let (features, hidden) = (r.pick(&[1, 2, 4]), r.pick(&[0, 4]));
        NetworkConfig::Grid(GridConfig {
            coarsest: 3,
            finest: 7,
            levels: 2,
            features,
            table: 256,
            hidden,
            ..GridConfig::default()
        })
    } else {
        let (skip, weight_norm) = (r.pick(&[None, Some(1)]), r.chance(0.5));
        NetworkConfig::Sdf(SdfConfig {
            bands: 2,
            width: 20,
            layers: 2,
            skip,
            features: 0,
            weight_norm,
            ..SdfConfig::paper()
        })
    }
}

fn extreme(r: &mut Random) -> f32 {
    r.pick(&[
        0.0,
        -0.0,
        1e-45,
        1e-38,
        1e-20,
        1e10,
        -1e10,
        1e20,
        -1e20,
        1e38,
        f32::MAX,
        f32::MIN,
        f32::NAN,
        f32::INFINITY,
    ])
}

fn finite(s: &Sample32) -> bool {
    s.value.is_finite() && s.gradient.iter().all(|g| g.is_finite())
}

fn weights(count: u32) -> Tally {
    cases("extreme weights", count, |r| {
        let config = config(r);
        let sound = Network::new(&config, 1).map_err(|e| e.to_string())?;
        let mut theta = sound.parameters().to_vec();
        match r.below(3) {
            0 => (0..1 + r.below(4)).for_each(|_| {
                let k = r.below(theta.len());
                theta[k] = extreme(r);
            }),
            1 => {
                let factor = r.power(-38.0, 38.0) as f32;
                theta.iter_mut().for_each(|t| *t *= factor);
            }
            _ => theta.iter_mut().for_each(|t| *t = r.between(-1.0, 1.0) as f32),
        }
        let spoilt = theta.iter().any(|t| !t.is_finite());
        let network = match Network::with_parameters(&config, theta) {
            Ok(network) => network,
            Err(error) => {
                return check(spoilt, || format!("{error}: {config:?}")).map(|()| "refused");
            }
        };
        check(!spoilt, || format!("a weight that is no number was taken: {config:?}"))?;
        let points: Vec<[f32; 3]> =
            (0..300).map(|_| r.vector(1.0).map(|x| x as f32).into()).collect();
        let mut out = vec![Sample32::default(); points.len()];
        network.samples32(&points, &mut out);
        // A network is made into a field only where it is a number: seldom looked at, as 300,000
        // points are asked.
        if r.chance(0.9) {
            return Ok(if out.iter().all(finite) { "numbers" } else { "no numbers" });
        }
        let Ok(field) =
            NeuralField::new(network, Frame { center: Point::new(1.0, 2.0, 3.0), scale: 0.5 })
        else {
            return Ok("no field");
        };
        for p in (0..100).map(|_| Point::new(1.0, 2.0, 3.0) + r.vector(4.0)) {
            let s = field.sample(&p);
            check(s.distance.is_finite() && s.gradient.norm().is_finite(), || {
                format!("{s:?} in {p}: {config:?}")
            })?;
        }
        Ok("field")
    })
}

#[test]
fn extreme_weights_make_numbers_or_no_field() {
    let tally = weights(200);
    assert!(share(&tally, "numbers") > 0.3 && share(&tally, "refused") > 0.01, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_extreme_weights_make_numbers_or_no_field() {
    weights(10_000);
}

fn fit_params(r: &mut Random) -> FitParams {
    let weight = |r: &mut Random| r.pick(&[0.0, 1e-6, 1.0, 1e6, 1e30]);
    let scale = |r: &mut Random| r.pick(&[1e-12, 2e-3, 1.0, 1e6]);
    FitParams {
        batch: 1 + r.below(64),
        far: r.pick(&[0.0, 0.1, 1.0]),
        steps: Some(r.below(30) as u64),
        seconds: None,
        accuracy: None,
        check_every: 1 + r.below(10) as u64,
        schedule: Schedule { rate: r.power(-6.0, 6.0), warmup: r.below(5) as u64, last: r.unit() },
        loss: LossParams {
            distance: weight(r),
            distance_scale: scale(r),
            normal: weight(r),
            normal_scale: scale(r),
            eikonal: weight(r),
        },
        adam: AdamParams::default(),
        seed: 1,
    }
}

/// What is left of a fit: the report, and θ. With `many` points in a batch, and held out, several
/// tasks share each sum.
fn fitted(r: &mut Random, many: bool) -> Result<Option<(FitReport, Vec<u32>, bool)>, String> {
    let (config, mut params) = (config(r), fit_params(r));
    let size = r.power(-3.0, 3.0);
    let target = Hostile { solid: Solid::Ball, ..Hostile::any(r, Point::origin(), size) };
    let mut sampling =
        SamplingParams { near: 128, far: 64, held_out: 64, ..SamplingParams::default() };
    if many {
        params.batch = 1_000 + r.below(1_000);
        (sampling.near, sampling.held_out) = (1_000, 1_500);
    }
    let set = match TrainingSet::of_field(&target, &sampling) {
        Ok(set) => set,
        Err(error) => {
            return check(target.fault != Fault::None, || format!("{error}: {target:?}"))
                .map(|()| None);
        }
    };
    let mut network = Network::new(&config, 1).map_err(|e| e.to_string())?;
    let told = || format!("{config:?} {params:?} {target:?}");
    let Ok(mut fit) = Fit::new(params) else { return Ok(None) };
    let Ok(mut report) = fit.run(&mut network, &set, &mut Silent) else {
        return Ok(None);
    };
    report.seconds = 0.0;
    let numbers = network.parameters().iter().all(|t| t.is_finite());
    check(numbers && report.error.is_finite(), || {
        format!("no numbers after {report:?}: {}", told())
    })?;
    let mut out = vec![Sample32::default(); 1];
    network.samples32(&[[0.1, 0.2, 0.3]], &mut out);
    check(finite(&out[0]), || format!("{out:?} after {report:?}: {}", told()))?;
    let diverged = report.ended == if_neural::fit::Ended::Diverged;
    Ok(Some((report, network.parameters().iter().map(|t| t.to_bits()).collect(), diverged)))
}

fn fits(count: u32) -> Tally {
    cases("fits", count, |r| {
        Ok(match fitted(r, false)? {
            Some((.., true)) => "diverged, best kept",
            Some(_) => "fitted",
            None => "refused",
        })
    })
}

#[test]
fn fits_end_with_numbers_whatever_rates_weights_and_targets_are() {
    let tally = fits(300);
    assert!(share(&tally, "fitted") > 0.2 && share(&tally, "refused") > 0.05, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_fits_end_with_numbers() {
    fits(20_000);
}

#[test]
fn fits_have_the_same_bits_on_any_number_of_threads() {
    let tally = cases("fits on threads", 10, |r| {
        let number = r.below(1000) as u32;
        let found =
            same_on_all_threads(|| fitted(&mut Random::new("a fit on threads", number), true))??;
        Ok(match found {
            Some((report, ..)) if report.steps > 0 => "fitted",
            Some(_) => "no step",
            None => "refused",
        })
    });
    assert!(share(&tally, "fitted") > 0.0, "{tally:?}");
}

#[test]
fn clouds_of_any_points_are_taken_or_refused() {
    let tally = cases("clouds", 500, |r| {
        let (n, scale) = (r.below(80), r.power(-6.0, 6.0));
        let mut points: Vec<Point> = (0..n)
            .map(|_| Point::from(if_core::math::unit_or_zero(&r.vector(1.0)) * scale))
            .collect();
        let mut normals: Vec<Vector> = points.iter().map(|p| p.coords).collect();
        let mut spoilt = false;
        for _ in 0..r.below(4) {
            if n > 1 {
                let (i, j) = (r.below(n), r.below(n));
                match r.below(5) {
                    0 => points[i] = points[j],
                    1 => normals[i] = -normals[j],
                    2 => (normals[i], spoilt) = (Vector::zeros(), true),
                    3 => (points[i].x, spoilt) = (Real::NAN, true),
                    _ => points.iter_mut().for_each(|p| p.z = 0.0),
                }
            }
        }
        let Ok(cloud) = OrientedPoints::new(points, normals) else { return Ok("refused") };
        check(!spoilt, || "what is no number was taken".into())?;
        for p in (0..20).map(|_| r.point(2.0 * scale)) {
            let e = cloud.estimate(&p, 0.1 * scale);
            check(e.distance.is_finite() && (0.0..=1.0 + 1e-9).contains(&e.trust), || {
                format!("{e:?} in {p}")
            })?;
        }
        Ok("taken")
    });
    // A fifth has fewer than 16 points, and of the others 46 in a hundred are spoiled.
    assert!(share(&tally, "taken") > 0.25 && share(&tally, "refused") > 0.25, "{tally:?}");
}

fn files(count: u32) -> Tally {
    cases("network files", count, |r| {
        let config = config(r);
        let frame = Frame::UNIT;
        let network = Network::new(&config, 1).map_err(|e| e.to_string())?;
        let kind = r.below(3);
        let mut file = Vec::new();
        match kind {
            0 => write_network(&mut file, &network, &frame, WeightNorm::default()),
            1 => {
                let fit =
                    Fit::new(FitParams { steps: Some(3), seconds: None, ..FitParams::default() })
                        .map_err(|e| e.to_string())?;
                write_checkpoint(&mut file, &fit, &network, &frame)
            }
            _ => {
                let config =
                    DeformationConfig { bands: 1, embedding: 2, frames: 3, width: 8, layers: 1 };
                let network = DeformationNetwork::new(&config, 1).map_err(|e| e.to_string())?;
                write_deformation(&mut file, &network, &frame)
            }
        }
        .map_err(|e| e.to_string())?;
        // The header is where most can go wrong.
        let head = file.len().min(if r.chance(0.7) { 700 } else { usize::MAX });
        let mut bytes = mutated(r, &file[..head]);
        bytes.extend_from_slice(&file[head..]);
        let numbers = |theta: &[f32]| {
            check(theta.iter().all(|t| t.is_finite()), || "a weight that is no number".into())
        };
        Ok(match kind {
            0 => read_network(&bytes[..]).map(|(n, _)| numbers(n.parameters())).ok(),
            1 => read_checkpoint(&bytes[..]).map(|(_, n, _)| numbers(n.parameters())).ok(),
            _ => read_deformation(&bytes[..]).map(|(n, _)| numbers(n.parameters())).ok(),
        }
        .transpose()?
        .map_or("refused", |()| "read"))
    })
}

#[test]
fn spoiled_files_of_networks_are_read_or_refused() {
    let tally = files(2_000);
    assert!(share(&tally, "refused") > 0.3 && share(&tally, "read") > 0.01, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_spoiled_files_of_networks_are_read_or_refused() {
    files(100_000);
}
