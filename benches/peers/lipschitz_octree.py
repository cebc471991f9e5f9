"""Evaluations of a field that finding the cells of a surface takes: libigl's lipschitz_octree and ours, on the same fields.

    lipschitz_octree.py EXTRACTION [DEPTH]

EXTRACTION is the built program `extraction` of if-benches. libigl's count is of the centres it asks for, level by level, and of the
unique corners of the leaves that are left, without which there are no triangles; ours is of all nodes. Both use the slope 1 that the
fields have, on the same lattice of 2^DEPTH cells along 2.4 m. Exit status 1 where ours is above 0.8 of libigl's. Needs: pip install
libigl numpy
"""
import csv
import io
import subprocess
import sys

import igl
import numpy as np

depth = int(sys.argv[2]) if len(sys.argv) > 2 else 8
cells = 2**depth
side = 2.4
cell = side / cells
center = np.array([0.011, -0.017, 0.023])


def ball(p, radius):
    return np.linalg.norm(p - center, axis=1) - radius


def torus(p):
    d = p - center
    return np.hypot(np.hypot(d[:, 0], d[:, 2]) - 0.75, d[:, 1]) - 0.3


def shell(distance, half):
    return np.abs(distance) - half


fields = {
    "sphere": lambda p: ball(p, 0.9),
    "torus": torus,
    "two layers": lambda p: np.minimum(ball(p, 0.85), shell(ball(p, 0.85 + 2 * cell + 0.05), 0.05)),
    "shell 8 mm": lambda p: shell(ball(p, 0.9), 0.004),
}
ours = subprocess.run([sys.argv[1], "evaluations", str(cells)], capture_output=True, text=True, check=True).stdout
ours = {row["field"]: int(row["evaluations"]) for row in csv.DictReader(io.StringIO(ours))}
worst = 0
print("field,libigl centres,libigl corners,libigl,ours,ratio")
for name, field in fields.items():
    count = 0

    def unsigned(p):
        global count
        count += len(p)
        return np.abs(field(np.asarray(p)))

    origin = np.full(3, -0.5 * side)
    leaves = igl.lipschitz_octree(origin, side, depth, unsigned)
    corners = igl.unique_sparse_voxel_corners(origin, side, depth, leaves)[2]
    theirs = count + len(corners)
    ratio = ours[name] / theirs
    worst = max(worst, ratio)
    print(f"{name},{count},{len(corners)},{theirs},{ours[name]},{ratio:.2f}")
sys.exit(worst > 0.8)
