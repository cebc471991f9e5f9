#!/usr/bin/env python3
"""A copy of a template body whose shape is off, as estimators make it.

    noisy_template.py BODY OUT [--bones 0.03] [--girth 20] [--seed 1]

Each bone is longer by a normally distributed share of standard deviation --bones, left and right
alike. The surface follows its joints, stretches along its bones, and moves along its normals, out
or in by the seed, by --girth mm of circumference. Needs: pip install numpy meshio
"""
import argparse
import json
import os

import meshio
import numpy as np


class Shares:
    """By how much bones are longer, the same for left and right."""

    def __init__(self, sigma, rng):
        self.sigma, self.rng, self.known = sigma, rng, {}

    def of(self, joint):
        name = joint.replace("Left", "").replace("Right", "")
        if name[:1] in "LR" and name[1:2].isupper():
            name = name[1:]
        if name not in self.known:
            self.known[name] = self.sigma * self.rng.normal()
        return self.known[name]


def vertex_normals(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], np.cross(b - a, c - a))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("body"), a.add_argument("out")
    a.add_argument("--bones", type=float, default=0.03)
    a.add_argument("--girth", type=float, default=20)
    a.add_argument("--seed", type=int, default=1)
    a = a.parse_args()
    rng = np.random.default_rng(a.seed)
    shares = Shares(a.bones, rng)
    skeleton = json.load(open(f"{a.body}/skeleton.json"))
    joints = skeleton["joints"]
    heads, tails = (np.array([j[key] for j in joints]) for key in ("head", "tail"))
    moved, ends = np.zeros_like(heads), np.zeros_like(heads)
    for k, joint in enumerate(joints):
        p = joint["parent"]
        if p >= 0:
            moved[k] = moved[p] + shares.of(joints[p]["name"]) * (heads[k] - heads[p])
        ends[k] = moved[k] + shares.of(joint["name"]) * (tails[k] - heads[k])
    mesh = meshio.read(f"{a.body}/body_clean.ply")
    points = np.asarray(mesh.points, float)
    out = points.copy()
    for i in range(4):
        j = mesh.point_data[f"j{i}"].astype(int)
        weight = mesh.point_data[f"w{i}"].astype(float)[:, None]
        bone = tails[j] - heads[j]
        along = ((points - heads[j]) * bone).sum(1) / np.maximum((bone**2).sum(1), 1e-12)
        out += weight * (moved[j] + along.clip(0, 1)[:, None] * (ends[j] - moved[j]))
    radius = rng.choice([-1, 1]) * a.girth / 2000 / np.pi
    mesh.points = (out + radius * vertex_normals(out, mesh.cells_dict["triangle"])).astype(np.float32)
    os.makedirs(a.out)
    meshio.write(f"{a.out}/body_clean.ply", mesh)
    for k, joint in enumerate(joints):
        joint["head"], joint["tail"] = (heads[k] + moved[k]).tolist(), (tails[k] + ends[k]).tolist()
    json.dump(skeleton, open(f"{a.out}/skeleton.json", "w"))
    off = 1e3 * np.linalg.norm(moved, axis=1)
    print(f"joints are off by {off.mean():.1f} mm on average, {off.max():.1f} mm at most")


if __name__ == "__main__":
    main()
