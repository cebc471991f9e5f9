#!/usr/bin/env python3
"""`ifg reconstruct` on the built-in person with an estimator's errors, drawn by many seeds.

    benches/capture_seeds.py IFG [--seeds 3] [--poses 3,9 6,18] [--outfits trousers,tshirt skirt,tshirt coat]

Every capture has 24 pictures of 256 x 256, the template's bones off by 2 %, its girth by 10 mm, normals by 10 degrees, the camera by
0.5 degrees; labels and masks as noisy as by default. For each garment the mean distance in mm of its vertices from the truth's surface,
which no template is off: so the error of the template's shape is part of it. After a stroke its roughness: the mean angle in degrees
between the two triangles at an edge, weighted by the edge's length; then the median distance in mm from the truth's hems to its own, by
vertices. Needs: pip install numpy trimesh rtree scipy
"""
import argparse, json, os, subprocess, sys, tempfile, time
import numpy as np, trimesh
from scipy.spatial import cKDTree

NOISE = "--shape-noise 2,10 --normal-noise 10 --camera-noise 0.5".split()


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("ifg"), a.add_argument("--seeds", type=int, default=3)
    a.add_argument("--poses", nargs="+", default=["3,9", "6,18"])
    a.add_argument("--outfits", nargs="+", default=["trousers,tshirt", "skirt,tshirt", "trousers,tshirt,jacket", "coat"])
    a = a.parse_args()
    print("outfit poses seed exit seconds warned silhouette_mm garments")
    for outfit in a.outfits:
        for poses in a.poses:
            for seed in range(1, a.seeds + 1):
                print(outfit, poses, seed, *judged(os.path.abspath(a.ifg), outfit, poses, seed), flush=True)


def judged(ifg, outfit, poses, seed):
    """Exit code, seconds, whether a warning was given, the silhouettes' error, and each garment's."""
    with tempfile.TemporaryDirectory() as folder:
        def run(*args):
            return subprocess.run([ifg, *args], cwd=folder, capture_output=True, text=True)
        made = run("capture", "synth", "--out", "person", "--garments", outfit, "--seed", str(seed), "--pose-noise", poses, *NOISE)
        if made.returncode:
            sys.exit(made.stderr)
        start = time.time()
        done = run("reconstruct", "person", "--body", "person/body", "--out", "w", "--json")
        seconds = time.time() - start
        if done.returncode:
            return done.returncode, f"{seconds:.1f}", done.stderr
        garments = []
        for name in outfit.split(","):
            truth = trimesh.load(f"{folder}/person/truth/{name}.ply", process=False)
            found = f"{folder}/w/garments/person_{name}/garment.ply"
            if os.path.exists(found):
                mesh = trimesh.load(found, process=False)
                distance = 1e3 * np.mean(trimesh.proximity.closest_point(truth, mesh.vertices)[1])
                garments.append(f"{name}={distance:.1f}/{roughness(mesh):.1f}/{hems(truth, mesh):.1f}")
            else:
                garments.append(f"{name}=missing")
        silhouette = json.loads(done.stdout)["poses"]["held_out"]["silhouette_mm"]
        return 0, f"{seconds:.1f}", "warning:" in done.stderr, f"{silhouette:.1f}", *garments


def roughness(mesh):
    edges = mesh.vertices[mesh.face_adjacency_edges]
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    return np.degrees(np.average(mesh.face_adjacency_angles, weights=lengths))


def hems(truth, mesh):
    ours, theirs = (m.vertices[boundary(m)] for m in (mesh, truth))
    return 1e3 * np.median(cKDTree(ours).query(theirs)[0])


def boundary(mesh):
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return np.unique(edges[count == 1])


if __name__ == "__main__":
    main()
