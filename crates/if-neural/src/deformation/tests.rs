use super::*;
use crate::init::Normal;
use crate::reference::{OffsetLoss64, ReferenceDeformation};

fn config(frames: usize) -> DeformationConfig {
    DeformationConfig { width: 70, embedding: 9, layers: 3, ..DeformationConfig::fast(frames) }
}

fn network(config: &DeformationConfig, isa: Isa) -> DeformationNetwork {
    let start = DeformationNetwork::new(config, 3).expect("a valid shape");
    let mut normal = Normal::seeded(9);
    let theta = start.parameters().iter().map(|v| v + (0.05 * normal.next()) as f32).collect();
    let mut network = DeformationNetwork::with_isa(config, theta, isa).expect("as before");
    network.set_alpha(3.3);
    network
}

fn twin(network: &DeformationNetwork) -> ReferenceDeformation {
    let theta = network.parameters().iter().map(|&v| f64::from(v)).collect();
    let weights = band_weights(network.config.bands, network.alpha());
    ReferenceDeformation::new(&network.config, theta, weights).expect("the same shape")
}

fn inputs(count: usize, frames: usize) -> (Vec<[f32; 3]>, Vec<u32>) {
    let mut normal = Normal::seeded(7);
    let points = (0..count).map(|_| std::array::from_fn(|_| 0.5 * normal.next() as f32)).collect();
    (points, (0..count).map(|n| ((n * 7) % frames) as u32).collect())
}

fn loss(index: usize, sample: OffsetSample) -> OffsetLoss {
    let mut at = OffsetLoss::default();
    for i in 0..3 {
        let off = sample.offset[i] - 0.01 * (index % 7 + i) as f32;
        at.loss += f64::from(off * off);
        at.d_offset[i] = 2.0 * off;
        for j in 0..3 {
            at.loss += 0.5 * f64::from(sample.jacobian[i][j] * sample.jacobian[i][j]);
            at.d_jacobian[i][j] = sample.jacobian[i][j];
        }
    }
    at
}

#[test]
fn offset_and_jacobian_are_those_of_f64_on_every_instruction_set() {
    for isa in Isa::all() {
        for config in [config(5), DeformationConfig { embedding: 0, layers: 1, ..config(5) }] {
            let network = network(&config, isa);
            let twin = twin(&network);
            for count in [1, 25, 130] {
                let (points, frames) = inputs(count, 5);
                let mut offsets = vec![[0.0; 3]; count];
                let mut samples = vec![OffsetSample::default(); count];
                network.offsets(&points, &frames, &mut offsets);
                network.samples(&points, &frames, &mut samples);
                for n in 0..count {
                    assert_eq!(offsets[n], samples[n].offset);
                    let x = points[n].map(f64::from);
                    let (d, j) = twin.sample(x, frames[n] as usize);
                    for i in 0..3 {
                        assert!((f64::from(offsets[n][i]) - d[i]).abs() < 2e-6);
                        for k in 0..3 {
                            let error = f64::from(samples[n].jacobian[i][k]) - j[i][k];
                            assert!(error.abs() < 2e-5, "{}: {error}", isa.name());
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn the_gradient_by_the_parameters_is_that_of_f64_on_every_instruction_set() {
    for isa in Isa::all() {
        for config in [config(5), DeformationConfig { embedding: 0, layers: 1, ..config(5) }] {
            let network = network(&config, isa);
            let (points, frames) = inputs(250, 5);
            let mut gradient = vec![f32::NAN; network.parameters().len()];
            let total = network.loss_gradient(&points, &frames, &loss, &mut gradient);
            let points: Vec<_> = points.iter().map(|x| x.map(f64::from)).collect();
            let (exact_total, exact) = twin(&network).loss_gradient(&points, &frames, |i, d, j| {
                let at = loss(
                    i,
                    OffsetSample {
                        offset: d.map(|v| v as f32),
                        jacobian: j.map(|row| row.map(|v| v as f32)),
                    },
                );
                OffsetLoss64 {
                    loss: at.loss,
                    d_offset: at.d_offset.map(f64::from),
                    d_jacobian: at.d_jacobian.map(|row| row.map(f64::from)),
                }
            });
            assert!((total - exact_total).abs() < 1e-5 * exact_total);
            let scale = exact.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            for (k, (a, b)) in gradient.iter().zip(&exact).enumerate() {
                let error = (f64::from(*a) - b).abs();
                assert!(error < 1e-5 * scale, "{} parameter {k}: {a} {b}", isa.name());
            }
        }
    }
}

#[test]
fn the_same_bits_come_out_for_any_number_of_threads() {
    let network = network(&config(5), Isa::best());
    let (points, frames) = inputs(1500, 5);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("a pool").install(|| {
            let mut gradient = vec![0.0; network.parameters().len()];
            let total = network.loss_gradient(&points, &frames, &loss, &mut gradient);
            (gradient, total)
        })
    };
    assert!(run(1) == run(3));
}

#[test]
fn a_point_that_is_no_number_gives_no_number_and_spoils_no_other() {
    for isa in Isa::all() {
        let network = network(&config(5), isa);
        let (mut points, frames) = inputs(30, 5);
        let mut good = vec![OffsetSample::default(); 30];
        network.samples(&points, &frames, &mut good);
        let kept = std::mem::replace(&mut points[7], [f32::NAN, 0.0, 0.0]);
        let mut samples = good.clone();
        network.samples(&points, &frames, &mut samples);
        assert!(samples[7].offset.iter().all(|d| d.is_nan()), "{}", isa.name());
        for n in (0..30).filter(|n| *n != 7) {
            assert_eq!(samples[n], good[n]);
        }
        let mut gradient = vec![0.0; network.parameters().len()];
        assert!(network.loss_gradient(&points, &frames, &loss, &mut gradient).is_nan());
        points[7] = kept;
        network.loss_gradient(&points, &frames, &loss, &mut gradient);
        assert!(gradient.iter().all(|g| g.is_finite()), "scratch memory keeps a NaN");
    }
}

#[test]
fn a_call_without_points_has_no_gradient() {
    let network = network(&config(5), Isa::best());
    let mut gradient = vec![f32::NAN; network.parameters().len()];
    assert_eq!(network.loss_gradient(&[], &[], &loss, &mut gradient), 0.0);
    assert!(gradient.iter().all(|g| *g == 0.0));
}

#[test]
fn the_initial_deformation_moves_next_to_nothing() {
    let network = DeformationNetwork::new(&DeformationConfig::fast(30), 1).expect("a preset");
    let (points, frames) = inputs(100, 30);
    let mut offsets = vec![[0.0; 3]; 100];
    network.offsets(&points, &frames, &mut offsets);
    let largest = offsets.as_flattened().iter().fold(0.0_f32, |m, d| m.max(d.abs()));
    assert!(largest > 0.0 && largest < 0.01, "{largest}");
}

#[test]
#[should_panic(expected = "frame 5 of 5")]
fn a_frame_that_does_not_exist_panics_with_its_number() {
    let network = network(&config(5), Isa::best());
    network.offsets(&[[0.0; 3]], &[5], &mut [[0.0; 3]]);
}
