#!/usr/bin/env python3
"""`ifg reconstruct` where a run of frames takes one garment for another, as programs do that label videos.

    benches/wrong_labels.py IFG [IFG ...] [--first 8] [--last 16] [--seed 0]

The capture is `ifg capture synth --garments trousers,tshirt,jacket`, of 24 frames; poses are exact. In frames FIRST to LAST, by default those that see
the back, one label is given to what is of another, or two take each other's place. A line for each program and change: of trousers and jacket
the mean distance in mm of the reconstruction from the truth, and of the truth from the reconstruction. Needs: pip install numpy pillow meshio
trimesh libigl
"""
import argparse, glob, json, os, shutil, subprocess, tempfile
import igl, meshio, numpy as np, trimesh
from PIL import Image

CHANGES = [{}, {"jacket": "tshirt"}, {"jacket": "tshirt", "tshirt": "jacket"}, {"trousers": "jacket"}]


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("ifg", nargs="+"), a.add_argument("--seed", default="0")
    a.add_argument("--first", type=int, default=8), a.add_argument("--last", type=int, default=16)
    a = a.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        right = os.path.join(folder, "right")
        synth = ["capture", "synth", "--garments", "trousers,tshirt,jacket", "--seed", a.seed, "--out", right]
        subprocess.run([a.ifg[0], *synth], check=True, capture_output=True)
        for number, change in enumerate(CHANGES):
            capture = os.path.join(folder, f"wrong{number}")
            shutil.copytree(right, capture)
            relabel(capture, change, range(a.first, a.last + 1))
            for k, ifg in enumerate(a.ifg):
                out = os.path.join(folder, f"out{number}_{k}")
                subprocess.run([ifg, "reconstruct", capture, "--body", capture + "/body", "--out", out], check=True, capture_output=True)
                told = ", ".join(f"{b} for {g}" for g, b in change.items()) or "right labels"
                of = [
                    f"{g} {'%.1f there, %.1f back' % distances(f'{out}/garments/wrong{number}_{g}/garment.ply', f'{capture}/truth/{g}.ply')}"
                    for g in ("trousers", "jacket")
                ]
                print(f"{told}: {ifg}: {'; '.join(of)}", flush=True)


def relabel(capture, change, frames):
    """Gives another label to each garment of `change` in these frames."""
    names = json.load(open(capture + "/meta.json"))["labels"]
    table = np.arange(256, dtype=np.uint8)
    for garment, label in change.items():
        table[names.index(garment)] = names.index(label)
    for path in glob.glob(capture + "/label*/*.png"):
        if int(os.path.basename(path)[:-4]) in frames:
            Image.fromarray(table[np.array(Image.open(path))]).save(path)


def distances(one, other):
    """Mean distances in mm of 20,000 points of one surface from another one, both ways."""
    if not os.path.exists(one):
        return np.nan, np.nan
    meshes = [read(path) for path in (one, other)]
    mean = []
    for of, to in (meshes, meshes[::-1]):
        points = np.asarray(trimesh.sample.sample_surface(of, 20_000, seed=1)[0])
        squared = igl.point_mesh_squared_distance(points, np.asarray(to.vertices), np.asarray(to.faces, dtype=np.int64))[0]
        mean.append(1e3 * np.sqrt(squared).mean())
    return tuple(mean)


def read(path):
    mesh = meshio.read(path)
    return trimesh.Trimesh(mesh.points.astype(float), mesh.cells_dict["triangle"], process=False)


if __name__ == "__main__":
    main()
