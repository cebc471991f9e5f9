#!/usr/bin/env bash
# The networks' kernels and PyTorch on the same machine, one after the other, three rounds: points per second
# of value, of value and gradient, and of a training step, and the machine's multiply-add peak.
#
#   PYTHON=/path/to/python THREADS=2 benches/peers/neural.sh [fast|paper] [points] [seconds]
#
# PYTHON needs torch (pip). On a machine that others use, compare the rates per CPU second.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
preset="${1:-fast}" points="${2:-4096}" seconds="${3:-2}" threads="${THREADS:-2}"
export RAYON_NUM_THREADS="$threads" OMP_NUM_THREADS="$threads"
cargo build --release --quiet -p if-neural --examples
built="${CARGO_TARGET_DIR:-target}/release/examples"
for _ in 1 2 3; do
    "$built/fma_peak" "$threads"
    "$built/evaluate" "$preset" "$points" "$seconds"
    "$built/step" "$preset" "$points" "$seconds"
    "${PYTHON:-python3}" benches/peers/torch_neural.py "$preset" "$points" "$seconds" "$threads"
done
