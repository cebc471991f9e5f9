#!/usr/bin/env python3
"""The openings of reconstructed garments beside the truth's: few pixels, sleeves of coats, masks that are too large.

    benches/reconstructed_openings.py IFG [IFG ...]

Renders the built-in person with exact poses and noise 0.3: T-shirts tucked into skirts and a coat in 12 pictures of 192 x 192, and trousers
with a T-shirt in 24 of 256 x 256, whose masks then grow by a pixel and by two. Each program named reconstructs all of them. Prints for each
garment the lengths of its boundary loops in metres beside those of the truth, the mean distances in mm to the truth and back, and warnings.
Needs: pip install numpy scipy trimesh rtree pillow
"""
import glob, os, subprocess, sys, tempfile
import numpy as np, trimesh
from PIL import Image
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

# Garments, options of `ifg capture synth`, pixels by which masks grow.
SMALL = ["--frames", "12", "--size", "192"]
CAPTURES = {f"skirt {seed}": ("skirt,tshirt", [*SMALL, "--seed", str(seed)], 0) for seed in (61, 72, 74, 76)}
CAPTURES |= {"coat 46": ("coat", [*SMALL, "--seed", "46"], 0)}
CAPTURES |= {f"masks +{grow}": ("trousers,tshirt", ["--seed", "301"], grow) for grow in (0, 1, 2)}


def loops(mesh):
    """Lengths of the boundary loops from 10 cm on, the longest first."""
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    rim = edges[count == 1]
    graph = coo_matrix((np.ones(len(rim)), rim.T), shape=(len(mesh.vertices),) * 2)
    of = connected_components(graph, directed=False)[1][rim[:, 0]]
    lengths = np.bincount(of, np.linalg.norm(mesh.vertices[rim[:, 0]] - mesh.vertices[rim[:, 1]], axis=1))
    return " ".join(f"{length:.2f}" for length in sorted(lengths[lengths > 0.1], reverse=True))


def apart(a, b):
    points = trimesh.sample.sample_surface(a, 4000, seed=0)[0]
    return 1e3 * np.mean(trimesh.proximity.closest_point(b, points)[1])


def grown(folder, pixels):
    for path in glob.glob(os.path.join(folder, "mask*", "*.png")):
        mask = ndimage.binary_dilation(np.asarray(Image.open(path)) > 127, iterations=pixels)
        Image.fromarray(np.uint8(255) * mask).save(path)


def main():
    programs = [os.path.abspath(p) for p in sys.argv[1:]] or sys.exit(__doc__)
    for name, (garments, options, grow) in CAPTURES.items():
        with tempfile.TemporaryDirectory() as folder:
            at = lambda *names: os.path.join(folder, *names)
            synth = [programs[-1], "capture", "synth", "--out", at("person"), "--garments", garments, *options]
            subprocess.run(synth, check=True, capture_output=True)
            if grow:
                grown(at("person"), grow)
            for k, program in enumerate(programs):
                command = [program, "reconstruct", at("person"), "--body", at("person", "body"), "--out", at(str(k))]
                done = subprocess.run(command, capture_output=True, text=True)
                warned = (done.stdout + done.stderr).count("warning:")
                print(f"{name}, program {k + 1}: exit {done.returncode}, {warned} warnings")
                for garment in garments.split(","):
                    truth = trimesh.load(at("person", "truth", f"{garment}.ply"), process=False)
                    path = at(str(k), "garments", f"person_{garment}", "garment.ply")
                    if not os.path.exists(path):
                        print(f"    {garment}: missing")
                        continue
                    mesh = trimesh.load(path, process=False)
                    print(f"    {garment}: openings {loops(mesh)} (truth {loops(truth)}), {apart(mesh, truth):.1f} mm, back {apart(truth, mesh):.1f}", flush=True)


if __name__ == "__main__":
    main()
