//! Our files in PyTorch, and PyTorch's in ours, for whoever asks: see `pytorch.py` beside this
//! file.

#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "a test that cannot go on fails")]

use if_neural::files::{WeightNorm, read_network, write_network};
use if_neural::frame::Frame;
use if_neural::mlp::SdfConfig;
use if_neural::network::{Network, NetworkConfig};
use if_neural::trainable::{Sample32, TrainableField};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;

#[derive(Serialize, Deserialize)]
struct Samples {
    points: Vec<[f32; 3]>,
    values: Vec<f32>,
    gradients: Vec<[f32; 3]>,
}

/// Runs the script in the Python of `IF_PYTHON`.
fn python(command: &str, folder: &Path) {
    let python = std::env::var("IF_PYTHON")
        .unwrap_or_else(|_| panic!("name a Python with torch and numpy in IF_PYTHON"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pytorch.py");
    let (network, samples) = (folder.join("n.safetensors"), folder.join("s.json"));
    let run = Command::new(&python).arg(script).arg(command).arg(network).arg(samples).output();
    let run = run
        .unwrap_or_else(|e| panic!("`{python}` does not start ({e}); name a Python in IF_PYTHON"));
    let said = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
    eprintln!("{said}");
    assert!(
        run.status.code() != Some(77),
        "`{python}` lacks torch or numpy; install them, or name another Python in IF_PYTHON"
    );
    assert!(run.status.success(), "{said}");
}

#[test]
#[ignore = "needs Python with torch: IF_PYTHON=/path/to/python"]
fn pytorch_reads_ours_with_the_same_field() {
    let folder = tempfile::tempdir().unwrap();
    let fast = SdfConfig::fast();
    for (config, norm) in [
        (fast.clone(), WeightNorm::Kept),
        (fast.clone(), WeightNorm::Folded),
        (
            SdfConfig { bands: 0, width: 40, layers: 3, skip: None, weight_norm: false, ..fast },
            WeightNorm::Kept,
        ),
    ] {
        let network = Network::new(&NetworkConfig::Sdf(config), 3).unwrap();
        let points: Vec<[f32; 3]> =
            (0..60).map(|k| [0.31, 0.77, 1.13].map(|s| (s * k as f32).sin())).collect();
        let mut out = vec![Sample32::default(); points.len()];
        network.samples32(&points, &mut out);
        let mut file = Vec::new();
        write_network(&mut file, &network, &Frame::UNIT, norm).unwrap();
        std::fs::write(folder.path().join("n.safetensors"), file).unwrap();
        let samples = Samples {
            points,
            values: out.iter().map(|s| s.value).collect(),
            gradients: out.iter().map(|s| s.gradient).collect(),
        };
        std::fs::write(folder.path().join("s.json"), serde_json::to_vec(&samples).unwrap())
            .unwrap();
        python("check", folder.path());
    }
}

#[test]
#[ignore = "needs Python with torch: IF_PYTHON=/path/to/python"]
fn ours_reads_pytorch_with_the_same_field() {
    let folder = tempfile::tempdir().unwrap();
    python("make", folder.path());
    let (network, frame) =
        read_network(std::fs::File::open(folder.path().join("n.safetensors")).unwrap()).unwrap();
    assert_eq!(frame.scale, 1.25);
    let samples: Samples =
        serde_json::from_slice(&std::fs::read(folder.path().join("s.json")).unwrap()).unwrap();
    let mut out = vec![Sample32::default(); samples.points.len()];
    network.samples32(&samples.points, &mut out);
    for (k, s) in out.iter().enumerate() {
        approx::assert_abs_diff_eq!(s.value, samples.values[k], epsilon = 1e-5);
        (0..3).for_each(|c| {
            approx::assert_abs_diff_eq!(s.gradient[c], samples.gradients[k][c], epsilon = 1e-3)
        });
    }
}
