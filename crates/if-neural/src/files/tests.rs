use super::*;
use crate::grid::GridConfig;
use crate::trainable::Sample32;
use if_core::math::Point;

fn frame() -> Frame {
    Frame { center: Point::new(0.1, 0.9, -0.2), scale: 1.0 / 0.93 }
}

fn small_sdf(weight_norm: bool) -> SdfConfig {
    SdfConfig {
        bands: 2,
        width: 24,
        layers: 4,
        skip: Some(2),
        beta: 100.0,
        features: 3,
        weight_norm,
        radius: 0.5,
    }
}

fn networks() -> Vec<Network> {
    let grid = GridConfig {
        coarsest: 4,
        finest: 9,
        levels: 2,
        hidden: 3,
        table: 500,
        ..GridConfig::default()
    };
    let configs = [
        NetworkConfig::Grid(grid),
        NetworkConfig::Sdf(small_sdf(true)),
        NetworkConfig::Sdf(small_sdf(false)),
    ];
    configs.iter().map(|c| Network::new(c, 5).unwrap()).collect()
}

fn written(network: &Network, norm: WeightNorm) -> Vec<u8> {
    let mut file = Vec::new();
    write_network(&mut file, network, &frame(), norm).unwrap();
    file
}

fn values(network: &Network) -> Vec<Sample32> {
    let points: Vec<[f32; 3]> =
        (0..50).map(|k| [0.3, 0.7, 1.1].map(|s| (s * k as f32).sin() * 0.9)).collect();
    let mut out = vec![Sample32::default(); points.len()];
    network.samples32(&points, &mut out);
    out
}

#[test]
fn what_is_written_is_read_to_the_bit() {
    for network in networks() {
        let file = written(&network, WeightNorm::Kept);
        let (read, at) = read_network(file.as_slice()).unwrap();
        assert_eq!((read.config(), at), (network.config(), frame()));
        assert_eq!(read.parameters(), network.parameters());
        assert_eq!(file, written(&read, WeightNorm::Kept), "the same bytes again");
    }
}

#[test]
fn folded_weights_give_the_same_field_to_rounding() {
    let network = Network::Sdf(SdfNetwork::new(&small_sdf(true), 5).unwrap());
    let (folded, _) = read_network(written(&network, WeightNorm::Folded).as_slice()).unwrap();
    assert_eq!(folded.config(), NetworkConfig::Sdf(small_sdf(false)));
    // And read again as one with weight norm, and one with into one without.
    let file = written(&network, WeightNorm::Folded);
    let unfolded = Network::Sdf(read_sdf_weights(file.as_slice(), &small_sdf(true), "").unwrap());
    let kept = written(&network, WeightNorm::Kept);
    let plain = Network::Sdf(read_sdf_weights(kept.as_slice(), &small_sdf(false), "").unwrap());
    for other in [&folded, &unfolded, &plain] {
        for (a, b) in values(&network).iter().zip(values(other)) {
            approx::assert_abs_diff_eq!(a.value, b.value, epsilon = 1e-5);
            (0..3).for_each(|k| {
                approx::assert_abs_diff_eq!(a.gradient[k], b.gradient[k], epsilon = 1e-3)
            });
        }
    }
}

#[test]
fn a_row_of_zeros_is_folded_to_zeros_whatever_its_gain() {
    let config = small_sdf(true);
    let mut theta = SdfNetwork::new(&config, 5).unwrap().parameters().to_vec();
    let layout = config.layout().unwrap();
    let layer = &layout.layers[1];
    theta[layer.weight.start..][..layer.columns].fill(0.0);
    // More than 4 over the smallest norm is infinite.
    theta[layer.gain.as_ref().unwrap().start] = 5.0;
    let network = Network::Sdf(SdfNetwork::from_parameters(&config, theta).unwrap());
    let (folded, _) = read_network(written(&network, WeightNorm::Folded).as_slice()).unwrap();
    let kept = written(&network, WeightNorm::Kept);
    let plain = Network::Sdf(read_sdf_weights(kept.as_slice(), &small_sdf(false), "").unwrap());
    for other in [&folded, &plain] {
        for (a, b) in values(&network).iter().zip(values(other)) {
            approx::assert_abs_diff_eq!(a.value, b.value, epsilon = 1e-5);
        }
    }
}

#[test]
fn weights_are_found_behind_a_prefix() {
    let network = SdfNetwork::new(&small_sdf(true), 5).unwrap();
    let file = written(&Network::Sdf(network.clone()), WeightNorm::Kept);
    let prefixed = with_header(&file, |h| h.replace("\"lin", "\"module.sdf.lin"));
    let read = read_sdf_weights(prefixed.as_slice(), &small_sdf(true), "module.sdf.").unwrap();
    assert_eq!(read.parameters(), network.parameters());
    let missing = read_sdf_weights(prefixed.as_slice(), &small_sdf(true), "").unwrap_err();
    assert!(matches!(&missing, ReadError::Missing { name } if name == "lin0.weight"), "{missing}");
    let missing = read_sdf_weights(file.as_slice(), &small_sdf(true), "module.").unwrap_err();
    assert!(
        matches!(&missing, ReadError::Missing { name } if name == "module.lin0.weight"),
        "{missing}"
    );
}

#[test]
fn a_deformation_comes_back() {
    let config = DeformationConfig { bands: 2, embedding: 5, frames: 7, width: 16, layers: 2 };
    let mut network = DeformationNetwork::new(&config, 3).unwrap();
    network.set_alpha(1.25);
    let mut file = Vec::new();
    write_deformation(&mut file, &network, &frame()).unwrap();
    let (read, at) = read_deformation(file.as_slice()).unwrap();
    assert_eq!((read.config(), read.alpha(), at), (&config, 1.25, frame()));
    assert_eq!(read.parameters(), network.parameters());
    assert!(matches!(read_network(file.as_slice()), Err(ReadError::Kind { .. })));
}

/// A file with another header.
fn with_header(file: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    let n = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    let header = change(std::str::from_utf8(&file[8..8 + n]).unwrap());
    let mut out = (header.len() as u64).to_le_bytes().to_vec();
    out.extend_from_slice(header.as_bytes());
    out.extend_from_slice(&file[8 + n..]);
    out
}

#[test]
fn files_at_fault_are_refused_with_a_reason() {
    let networks = networks();
    let file = written(&networks[1], WeightNorm::Kept);
    let read = |file: &[u8]| read_network(file).map(|_| ()).unwrap_err();
    for cut in [0, 7, 8, 20, file.len() / 2, file.len() - 1] {
        assert!(matches!(read(&file[..cut]), ReadError::Header { .. }), "cut at {cut}");
    }
    let mut terabytes = file.clone();
    terabytes[..8].copy_from_slice(&(1u64 << 42).to_le_bytes());
    assert!(matches!(read(&terabytes), ReadError::Header { .. }));
    let changed = |from: &str, to: &str| {
        read(&with_header(&file, |h| {
            assert!(h.contains(from), "{h}");
            h.replace(from, to)
        }))
    };
    assert!(matches!(
        changed("\\\"version\\\":1", "\\\"version\\\":9"),
        ReadError::Version { found: 9 }
    ));
    assert!(matches!(changed("if_neural", "something"), ReadError::NoMetadata));
    assert!(matches!(
        changed("\\\"kind\\\":\\\"network\\\"", "\\\"kind\\\":\\\"teapot\\\""),
        ReadError::Kind { .. }
    ));
    assert!(matches!(changed("\\\"width\\\":24", "\\\"width\\\":25"), ReadError::Shape { .. }));
    assert!(matches!(
        changed("\\\"width\\\":24", "\\\"width\\\":999999999999"),
        ReadError::Parameter(_)
    ));
    assert!(matches!(changed("\\\"width\\\":24", "\\\"wide\\\":24"), ReadError::Metadata { .. }));
    assert!(
        matches!(changed("lin1.bias", "lin9.bias"), ReadError::Missing { name } if name == "lin1.bias")
    );
    assert!(matches!(changed("\\\"scale\\\":1", "\\\"scale\\\":-1"), ReadError::Parameter(_)));
    assert!(matches!(changed("[24,15]", "[15,24]"), ReadError::Shape { .. }));
    // A shape of 2^62 numbers does not fit the data.
    assert!(matches!(changed("[24,15]", "[2147483648,2147483648]"), ReadError::Header { .. }));
    let grid = written(&networks[0], WeightNorm::Kept);
    let table = |n: &str| {
        with_header(&grid, |h| h.replace("\\\"table\\\":500", &format!("\\\"table\\\":{n}")))
    };
    assert!(matches!(read(&table("900")), ReadError::Shape { .. }));
    assert!(matches!(read(&table("4000000000")), ReadError::Parameter(_)));
    let mut nan = file.clone();
    let end = nan.len();
    nan[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(read(&nan), ReadError::Network(_)));
    let mut nan = grid.clone();
    let end = nan.len();
    nan[end - 4..].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert!(matches!(read(&nan), ReadError::Network(_)));
}

#[test]
fn tensors_of_another_type_and_files_too_large_for_any_network_are_refused() {
    let file = written(&networks()[1], WeightNorm::Kept);
    let whole_numbers =
        with_header(&file, |h| h.replacen("\"dtype\":\"F32\"", "\"dtype\":\"I32\"", 1));
    let fault = read_network(whole_numbers.as_slice()).map(|_| ()).unwrap_err();
    assert!(matches!(&fault, ReadError::Type { found, .. } if found == "I32"), "{fault}");
    // 2^35 numbers in a file of a hundred bytes.
    let header = r#"{"a":{"dtype":"F32","shape":[34359738368],"data_offsets":[0,137438953472]}}"#;
    let mut claims = (header.len() as u64).to_le_bytes().to_vec();
    claims.extend_from_slice(header.as_bytes());
    let fault = read_network(claims.as_slice()).map(|_| ()).unwrap_err();
    assert!(matches!(fault, ReadError::TooLarge { limit } if limit == 1 << 36), "{fault}");
}

/// A file that never ends, and counts what is taken of it: `head`, and then zeros. After 16 MiB it
/// fails.
struct Endless<'a> {
    head: &'a [u8],
    taken: usize,
}

impl Read for Endless<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        for byte in buffer.iter_mut() {
            *byte = self.head.get(self.taken).copied().unwrap_or(0);
            self.taken += 1;
        }
        if self.taken > 1 << 24 {
            Err(io::Error::other("far too much is read"))
        } else {
            Ok(buffer.len())
        }
    }
}

#[test]
fn no_more_is_read_than_the_header_speaks_of() {
    let file = written(&networks()[1], WeightNorm::Kept);
    // Zeros have a header of no length; sevens one of 5e17 bytes.
    let cases: [(&[u8], usize); 3] = [(&file, file.len() + 1), (&[0; 8], 8), (&[7; 100], 8)];
    for (head, most) in cases {
        let mut reader = Endless { head, taken: 0 };
        let fault = read_network(&mut reader).map(|_| ()).unwrap_err();
        assert!(matches!(fault, ReadError::Header { .. }), "{fault}");
        assert!(reader.taken <= most, "{} bytes of {most}", reader.taken);
    }
}

#[cfg(feature = "train")]
#[test]
fn a_checkpoint_with_numbers_that_no_fit_has_is_refused() {
    use crate::fit::{Fit, FitParams};
    use crate::sampling::SamplingParams;
    use crate::target::Target;
    use if_core::monitor::Silent;
    use if_core::shapes::Sphere;
    let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
    let sampling =
        SamplingParams { near: 1000, far: 100, held_out: 200, ..SamplingParams::default() };
    let config = networks()[1].config();
    let params = FitParams {
        batch: 64,
        steps: Some(3),
        seconds: None,
        check_every: 1,
        ..config.fit_params()
    };
    let (set, mut network) = Target::Field(&ball).begin(&config, &sampling).unwrap();
    let mut fit = Fit::new(params).unwrap();
    fit.run(&mut network, &set, &mut Silent).unwrap();
    let checkpoint = |change: fn(&mut Fit)| {
        let (mut fit, mut file) = (fit.clone(), Vec::new());
        change(&mut fit);
        write_checkpoint(&mut file, &fit, &network, &set.frame).unwrap();
        file
    };
    let refusal = |file: &[u8]| match read_checkpoint(file) {
        Err(ReadError::Checkpoint { what }) => what,
        other => panic!("{other:?}"),
    };
    let sound = checkpoint(|_| ());
    assert!(read_checkpoint(sound.as_slice()).unwrap().0 == fit);
    type Spoil = fn(&mut Fit);
    let cases: [(&str, Spoil); 8] = [
        ("`adam.second` is -0.001 at 2", |f| f.training.adam.as_mut().unwrap().second[2] = -1e-3),
        ("parameters up to step 4 and has done 3", |f| f.training.adam.as_mut().unwrap().steps = 4),
        ("best at step 4 and has done 3", |f| f.training.best.as_mut().unwrap().step = 4),
        ("held-out points at step 4 and has done 3", |f| f.missed = Some(4)),
        ("least error is -0.001 m", |f| f.training.best.as_mut().unwrap().mean = -1e-3),
        ("it has done 1099511627776 steps", |f| f.training.step = 1 << 40),
        // JSON has neither: null is written.
        ("both, or none", |f| f.training.best.as_mut().unwrap().mean = f64::NAN),
        ("both, or none", |f| f.training.best.as_mut().unwrap().mean = f64::INFINITY),
    ];
    for (expected, change) in cases {
        let said = refusal(&checkpoint(change));
        assert!(said.contains(expected), "{said}, not {expected}");
    }
    let step = format!("\\\"best_step\\\":{}", fit.training.best.as_ref().unwrap().step);
    let halved = with_header(&sound, |h| {
        assert!(h.contains(&step), "{h}");
        h.replace(&step, "\\\"best_step\\\":null")
    });
    assert!(refusal(&halved).contains("both, or none"));
}

#[cfg(feature = "train")]
#[test]
fn a_fit_goes_on_from_a_file_with_the_same_bits() {
    use crate::fit::{Fit, FitParams};
    use crate::sampling::SamplingParams;
    use crate::target::Target;
    use if_core::monitor::{Progress, Silent};
    use if_core::shapes::Sphere;
    use std::ops::ControlFlow;
    let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
    let sampling =
        SamplingParams { near: 1000, far: 100, held_out: 200, ..SamplingParams::default() };
    for config in [networks()[0].config(), NetworkConfig::Sdf(small_sdf(true))] {
        let params = FitParams {
            batch: 64,
            steps: Some(12),
            seconds: None,
            check_every: 4,
            ..config.fit_params()
        };
        let begin = || Target::Field(&ball).begin(&config, &sampling).unwrap();
        let (set, mut whole) = begin();
        Fit::new(params).unwrap().run(&mut whole, &set, &mut Silent).unwrap();
        let (set, mut part) = begin();
        let mut fit = Fit::new(params).unwrap();
        let mut stop = |p: &Progress<'_>| {
            if p.done == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        fit.run(&mut part, &set, &mut stop).unwrap_err();
        fit.missed = Some(4);
        let mut file = Vec::new();
        write_checkpoint(&mut file, &fit, &part, &set.frame).unwrap();
        let (mut again, mut network, frame) = read_checkpoint(file.as_slice()).unwrap();
        assert!(again == fit && frame == set.frame);
        again.run(&mut network, &set, &mut Silent).unwrap();
        assert!(network.parameters() == whole.parameters());
        assert!(matches!(read_network(file.as_slice()), Err(ReadError::Kind { .. })));
        let broken = with_header(&file, |h| h.replace("\\\"batch\\\":64", "\\\"batch\\\":0"));
        assert!(matches!(read_checkpoint(broken.as_slice()), Err(ReadError::Checkpoint { .. })));
        let broken = with_header(&file, |h| h.replace("\\\"missed\\\":4", "\\\"missed\\\":6"));
        assert!(matches!(read_checkpoint(broken.as_slice()), Err(ReadError::Checkpoint { .. })));
    }
}
