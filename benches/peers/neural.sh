#!/usr/bin/env bash
# The networks' kernels and PyTorch on the same machine, one after the other, three rounds: points per second
# of value, of value and gradient, and of a training step, and the machine's multiply-add peak.
#
#   PYTHON=/path/to/python THREADS=2 benches/peers/neural.sh [fast|paper] [points] [seconds]
#
# PYTHON needs torch (pip). On a machine that others use, compare the rates per CPU second. glibc is asked to keep
# freed memory: else PyTorch takes its arrays from the system again and again (170,000 page faults a second), and is up to three
# times as slow for it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
preset="${1:-fast}" points="${2:-4096}" seconds="${3:-2}" threads="${THREADS:-2}"
export RAYON_NUM_THREADS="$threads" OMP_NUM_THREADS="$threads"
cargo build --release --quiet -p if-benches --example fma_peak --example evaluate --example step
keep=(MALLOC_MMAP_THRESHOLD_=33000000 MALLOC_TRIM_THRESHOLD_=4000000000 MALLOC_TOP_PAD_=268435456)
built="${CARGO_TARGET_DIR:-target}/release/examples"
for _ in 1 2 3; do
    "$built/fma_peak" "$threads"
    "$built/evaluate" "$preset" "$points" "$seconds"
    "$built/step" "$preset" "$points" "$seconds"
    env "${keep[@]}" "${PYTHON:-python3}" benches/peers/torch_neural.py "$preset" "$points" "$seconds" "$threads"
done
