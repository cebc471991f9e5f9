#!/usr/bin/env python3
"""Exact intersections of two layers of 100 000 triangles with igl.predicates, beside ours.

    igl_predicates.py FOLDER

FOLDER holds the meshes that `cargo bench -p if-benches --bench verify` wrote with IFG_PEER_MESHES, and ours.txt, what
it printed: lines of name, pairs, median seconds. Both sides build their trees within the time. Prints
the table of docs/evidence/solver.md. Exit status 1 where the pair counts differ or the ratio is below 2.
Needs: pip install numpy libigl meshio
"""
import sys
import time

import igl.predicates
import meshio
import numpy as np

RUNS = 11
TARGET = 2.0


def load(path):
    mesh = meshio.read(path)
    return np.ascontiguousarray(mesh.points, dtype=float), np.ascontiguousarray(mesh.cells_dict["triangle"], dtype=np.int64)


def main():
    folder, good = sys.argv[1], True
    print("| scene | pairs | igl.predicates, ms | ours, ms | ratio |")
    print("|---|---|---|---|---|")
    for line in open(f"{folder}/ours.txt"):
        name, ours_pairs, ours = line.split()
        (v1, f1), (v2, f2) = (load(f"{folder}/{name}_{part}.ply") for part in ("below", "above"))
        found = igl.predicates.find_intersections(v1, f1, v2, f2)[1]
        seconds = []
        for _ in range(RUNS):
            start = time.perf_counter()
            igl.predicates.find_intersections(v1, f1, v2, f2)
            seconds.append(time.perf_counter() - start)
        theirs = float(np.median(seconds))
        ratio = theirs / float(ours)
        print(f"| {name} | {len(found)} | {theirs * 1e3:.1f} | {float(ours) * 1e3:.1f} | {ratio:.2f} |")
        if len(found) != int(ours_pairs):
            print(f"{name}: igl finds {len(found)} pairs, we find {ours_pairs}")
            good = False
        good = good and ratio >= TARGET
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
