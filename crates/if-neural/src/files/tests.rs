use super::*;
use crate::grid::GridConfig;
use crate::trainable::Sample32;
use if_core::math::Point;

fn frame() -> Frame {
    Frame { center: Point::new(0.1, 0.9, -0.2), scale: 1.0 / 0.93 }
}

fn small_sdf(weight_norm: bool) -> SdfConfig {
    SdfConfig { bands: 2, width: 24, layers: 4, skip: Some(2), beta: 100.0, features: 3, weight_norm, radius: 0.5 }
}

fn networks() -> Vec<Network> {
    let grid = GridConfig { coarsest: 4, finest: 9, levels: 2, hidden: 3, table: 500, ..GridConfig::default() };
    let configs = [NetworkConfig::Grid(grid), NetworkConfig::Sdf(small_sdf(true)), NetworkConfig::Sdf(small_sdf(false))];
    configs.iter().map(|c| Network::new(c, 5).unwrap()).collect()
}

fn written(network: &Network, norm: WeightNorm) -> Vec<u8> {
    let mut file = Vec::new();
    write_network(&mut file, network, &frame(), norm).unwrap();
    file
}

fn values(network: &Network) -> Vec<Sample32> {
    let points: Vec<[f32; 3]> = (0..50).map(|k| [0.3, 0.7, 1.1].map(|s| (s * k as f32).sin() * 0.9)).collect();
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
            (0..3).for_each(|k| approx::assert_abs_diff_eq!(a.gradient[k], b.gradient[k], epsilon = 1e-3));
        }
    }
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
    assert!(matches!(changed("\\\"version\\\":1", "\\\"version\\\":9"), ReadError::Version { found: 9 }));
    assert!(matches!(changed("if_neural", "something"), ReadError::NoMetadata));
    assert!(matches!(changed("\\\"kind\\\":\\\"network\\\"", "\\\"kind\\\":\\\"teapot\\\""), ReadError::Kind { .. }));
    assert!(matches!(changed("\\\"width\\\":24", "\\\"width\\\":25"), ReadError::Shape { .. }));
    assert!(matches!(changed("\\\"width\\\":24", "\\\"width\\\":999999999999"), ReadError::Network(_)));
    assert!(matches!(changed("\\\"width\\\":24", "\\\"wide\\\":24"), ReadError::Metadata { .. }));
    assert!(matches!(changed("lin1.bias", "lin9.bias"), ReadError::Missing { name } if name == "lin1.bias"));
    assert!(matches!(changed("\\\"scale\\\":1", "\\\"scale\\\":-1"), ReadError::Frame { .. }));
    assert!(matches!(changed("[24,15]", "[15,24]"), ReadError::Shape { .. }));
    // A shape of 2^62 numbers does not fit the data.
    assert!(matches!(changed("[24,15]", "[2147483648,2147483648]"), ReadError::Header { .. }));
    let grid = written(&networks[0], WeightNorm::Kept);
    let table = |n: &str| with_header(&grid, |h| h.replace("\\\"table\\\":500", &format!("\\\"table\\\":{n}")));
    assert!(matches!(read(&table("900")), ReadError::Shape { .. }));
    assert!(matches!(read(&table("4000000000")), ReadError::Network(_)));
    let mut nan = file.clone();
    let end = nan.len();
    nan[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(read(&nan), ReadError::Network(_)));
    let mut nan = grid.clone();
    let end = nan.len();
    nan[end - 4..].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert!(matches!(read(&nan), ReadError::Network(_)));
}

#[cfg(feature = "train")]
#[test]
fn a_fit_goes_on_from_a_file_with_the_same_bits() {
    use crate::fit::{Fit, FitParams};
    use crate::sampling::SamplingParams;
    use crate::target::Target;
    use if_core::shapes::Sphere;
    use std::ops::ControlFlow;
    let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
    let sampling = SamplingParams { near: 1000, far: 100, held_out: 200, ..SamplingParams::default() };
    for config in [networks()[0].config(), NetworkConfig::Sdf(small_sdf(true))] {
        let params = FitParams { batch: 64, steps: Some(12), seconds: None, check_every: 4, ..config.fit_params() };
        let begin = || Target::Field(&ball).begin(&config, &sampling).unwrap();
        let (set, mut whole) = begin();
        Fit::new(params).unwrap().run(&mut whole, &set, &mut |_| ControlFlow::Continue(())).unwrap();
        let (set, mut part) = begin();
        let mut fit = Fit::new(params).unwrap();
        let stop =
            &mut |p: &crate::fit::FitProgress| if p.step == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        fit.run(&mut part, &set, stop).unwrap();
        fit.missed = Some(4);
        let mut file = Vec::new();
        write_checkpoint(&mut file, &fit, &part, &set.frame).unwrap();
        let (mut again, mut network, frame) = read_checkpoint(file.as_slice()).unwrap();
        assert!(again == fit && frame == set.frame);
        again.run(&mut network, &set, &mut |_| ControlFlow::Continue(())).unwrap();
        assert!(network.parameters() == whole.parameters());
        assert!(matches!(read_network(file.as_slice()), Err(ReadError::Kind { .. })));
        let broken = with_header(&file, |h| h.replace("\\\"batch\\\":64", "\\\"batch\\\":0"));
        assert!(matches!(read_checkpoint(broken.as_slice()), Err(ReadError::Checkpoint { .. })));
        let broken = with_header(&file, |h| h.replace("\\\"missed\\\":4", "\\\"missed\\\":6"));
        assert!(matches!(read_checkpoint(broken.as_slice()), Err(ReadError::Checkpoint { .. })));
    }
}
