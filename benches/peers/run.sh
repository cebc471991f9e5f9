#!/usr/bin/env bash
# Exact verification of two layers of 100 000 triangles: ours and igl.predicates on the same meshes, one
# after the other on the same machine, and their ratio.
#
#   PYTHON=/path/to/python benches/peers/run.sh
#
# PYTHON needs numpy, libigl and meshio (pip). RAYON_NUM_THREADS limits our threads.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
IFG_PEER_MESHES="$folder" cargo bench -p if-benches --bench verify -- --quiet | grep '^100k' > "$folder/ours.txt"
"${PYTHON:-python3}" benches/peers/igl_predicates.py "$folder"
