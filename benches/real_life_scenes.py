#!/usr/bin/env python3
"""`ifg fix` on what people wear besides the garments of the test data, made here from simple shapes.

    benches/real_life_scenes.py --ifg target/release/ifg --data ../shared/data [--body body_a] [--out out/life]
                                [--only hat ...] [-- extra arguments of ifg fix]

Scenes: hair cap below a hat; scarf of one and a half turns over T-shirt and coat; bag with a strap across the trunk
over T-shirt and cardigan; jacket of two sheets joined at their rims, filled with 8 mm of padding, over a T-shirt; buttons
and a zip's slider as loose parts of a blouse; garments as exporters leave them ("sewn"): jeans whose halves differ by rounding at
the seam between, a T-shirt with two pockets on vertices of their own, a cardigan whose halves are wound against each other; all of it at once. Every shape is placed by the body's joints, and deliberately a few
millimetres too tight. Prints for each scene: state, processor seconds, pairs before and after, own pairs, motion and strain.
Needs numpy, scipy and meshio.
"""
import argparse
import json
import os
import resource
import subprocess
import sys

import meshio
import numpy as np
from scipy.spatial import ConvexHull, cKDTree
from outfit_data import arguments

EVEN = 720  # points of an outline


def read(path):
    mesh = meshio.read(path)
    return np.asarray(mesh.points, float), np.asarray(mesh.cells_dict["triangle"], np.int64)


def write(path, shape):
    points, triangles = shape
    meshio.write(path, meshio.Mesh(points.astype(np.float32), [("triangle", triangles.astype(np.int32))]))
    return path


def joined(*shapes):
    offsets = np.cumsum([0] + [len(p) for p, _ in shapes])
    return np.concatenate([p for p, _ in shapes]), np.concatenate([t + o for (_, t), o in zip(shapes, offsets)])


def normals(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], np.cross(b - a, c - a))
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)


def grid(points, wraps):
    """A sheet of rows × columns points; `wraps` joins the last column to the first."""
    rows, columns = points.shape[:2]
    quads = [(r * columns + c, r * columns + (c + 1) % columns, (r + 1) * columns + c, (r + 1) * columns + (c + 1) % columns)
             for r in range(rows - 1) for c in range(columns if wraps else columns - 1)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, d), (a, d, c))]
    return points.reshape(-1, 3), np.array(triangles)


def part(shape, keep):
    """The triangles whose corners are all kept."""
    points, triangles = shape
    triangles = triangles[keep[triangles].all(1)]
    number = np.cumsum(np.isin(np.arange(len(points)), triangles)) - 1
    return points[np.unique(triangles)], number[triangles]


class Scene:
    """A body, its joints and its garments."""

    def __init__(self, data, body):
        self.folder = os.path.join(data, body)
        self.skin = os.path.join(self.folder, "body_clean.ply")
        self.points, self.triangles = read(self.skin)
        with open(os.path.join(self.folder, "skeleton.json"), encoding="utf-8") as file:
            self.joints = {j["name"]: np.array(j["head"]) for j in json.load(file)["joints"]}
        self.normals = normals(self.points, self.triangles)

    def garment(self, name):
        return read(os.path.join(self.folder, "garments", f"{name}.ply"))

    def head(self):
        """Middle and half axes of the head above the ears."""
        top = self.points[:, 1].max()
        head = self.points[self.points[:, 1] > top - 0.12]
        low, high = head.min(0), head.max(0)
        middle = (low + high) / 2
        middle[1] = top - 0.12
        return middle, np.array([(high - low)[0] / 2, 0.12, (high - low)[2] / 2])

    def hair(self):
        """The scalp, 6 mm off, rougher than a skin: waves of 4 mm."""
        middle, _ = self.head()
        keep = (self.points[:, 1] > middle[1] + 0.01) | ((self.points[:, 1] > middle[1] - 0.07) & (self.points[:, 2] < middle[2] - 0.02))
        waves = 4e-3 * np.sin(90 * self.points[:, 0]) * np.sin(80 * self.points[:, 2])
        return part((self.points + self.normals * (6e-3 + waves)[:, None], self.triangles), keep)

    def hat(self):
        """A dome on a brim of 7 cm, as wide as the skin and 5 mm."""
        middle, axes = self.head()
        around = np.linspace(0, 2 * np.pi, 96, endpoint=False)
        axes = axes + np.array([5e-3, 2e-2, 5e-3])
        rows = []
        for brim in (0.07, 0.055, 0.04, 0.03, 0.02, 0.01):
            rows.append((axes[0] + brim, 0.02 - 0.1 * brim, axes[2] + brim))
        for up in np.radians(np.linspace(0, 87, 22)):
            rows.append((axes[0] * np.cos(up), 0.02 + axes[1] * np.sin(up), axes[2] * np.cos(up)))
        return grid(np.array([[middle + np.array([x * np.cos(a), y, -z * np.sin(a)]) for a in around] for x, y, z in rows]), True)

    def outline(self, shapes, origin, axes, margin):
        """A closed curve round the shapes in a plane, by angles round the origin: their convex hull, grown by `margin`, at even steps."""
        normal = np.cross(*axes)
        points = np.concatenate(shapes)
        flat = points[np.abs((points - origin) @ normal) < 0.03] - origin
        flat = np.stack([flat @ axes[0], flat @ axes[1]], 1)
        hull = flat[ConvexHull(flat).vertices]
        turn = np.linspace(0, 2 * np.pi, 720, endpoint=False)
        ways = np.stack([np.cos(turn), np.sin(turn)], 1)
        # Support in each direction, then the point of the hull there, grown.
        curve = hull[np.argmax(ways @ hull.T, axis=1)] + margin * ways
        curve = origin + curve[:, :1] * axes[0] + curve[:, 1:] * axes[1]
        closed = np.concatenate([curve, curve[:1]])
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
        even = np.linspace(0, length[-1], EVEN, endpoint=False)
        return np.stack([np.interp(even, length, closed[:, k]) for k in range(3)], 1)

    def scarf(self, under):
        """A band of 9 cm, one and a half turns round the neck, its second turn 8 mm over the first."""
        neck = self.joints["Neck"] + [0, 0.03, 0]
        axes = np.array([[1.0, 0, 0], [0, 0, -1.0]])
        near = [p[np.linalg.norm((p - neck)[:, [0, 2]], axis=1) < 0.12] for p in under]
        loop = self.outline(near, neck, axes, 2e-3)
        middle = loop.mean(0)
        turns = np.linspace(0, 1.5, 150)
        rows = []
        for height in np.linspace(-0.045, 0.045, 11):
            row = []
            for t in turns:
                p = loop[int(EVEN * t) % EVEN]
                way = (p - middle) / np.linalg.norm(p - middle)
                row.append(p + way * (8e-3 * t) + np.array([0, height, 0]))
            rows.append(row)
        return grid(np.array(rows), False)

    def bag(self, under):
        """A strap of 4 cm from the right shoulder to the left hip, as tight as a tape, and a box of 22 × 16 × 6 cm there."""
        shoulder, hip = self.joints["RightArm"], self.joints["Hips"]
        high = shoulder * [0.55, 1, 1] + [0, 0.06, 0]
        across = np.array([0.19 if shoulder[0] < 0 else -0.19, hip[1] - 0.05, hip[2]])
        way = (across - high) / np.linalg.norm(across - high)
        side = np.array([0, 0, 1.0]) - way * way[2]
        axes = np.array([way, side / np.linalg.norm(side)])
        width = np.cross(*axes)
        trunk = [p[(np.abs(p[:, 0]) < 0.24) & (p[:, 1] > hip[1] - 0.12)] for p in under]
        curve = self.outline(trunk, (high + across) / 2, axes, 1e-3)[::4]
        strap = grid(np.array([[p + width * w for p in curve] for w in np.linspace(-0.02, 0.02, 5)]), True)
        at = curve[np.argmin(curve[:, 1])]
        out = np.array([np.sign(across[0]), 0, 0])
        box = np.array([0.03, 0.08, 0.11])
        return joined(strap, cuboid(at + out * 0.025 - [0, 0.05, 0], box))

    def padded(self, garment, thickness):
        """Two sheets joined at their rims: the garment as it is, and the same further out."""
        points, triangles = garment
        _, number = np.unique(points.round(6), axis=0, return_inverse=True)
        number = number.ravel()
        first = np.full(number.max() + 1, len(points))
        np.minimum.at(first, number, np.arange(len(points)))
        triangles = first[number][triangles]
        triangles = triangles[[len(set(t)) == 3 for t in triangles]]
        points, triangles = part((points, triangles), np.ones(len(points), bool))
        out = normals(points, triangles)
        for _ in range(5):
            total = np.zeros_like(out)
            for k in range(3):
                np.add.at(total, triangles[:, k], out[triangles].sum(1))
            out = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
        directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        known = set(map(tuple, directed))
        rim = np.array([e for e in directed if (e[1], e[0]) not in known])
        n = len(points)
        walls = np.concatenate([np.stack([rim[:, 1], rim[:, 0], rim[:, 0] + n], 1), np.stack([rim[:, 1], rim[:, 0] + n, rim[:, 1] + n], 1)])
        return np.concatenate([points, points + thickness * out]), np.concatenate([triangles[:, ::-1], triangles + n, walls])

    def buttons(self, garment):
        """The garment with seven discs of 11 mm along its front, half a millimetre inside it, and a slider of 8 × 12 × 3 mm."""
        points, triangles = garment
        out, tree = normals(points, triangles), cKDTree(points)
        low, high = np.percentile(points[:, 1], [15, 85])
        parts = [garment]
        for y in np.linspace(low, high, 7):
            k = tree.query([0.012, y, points[:, 2].max()])[1]
            a = np.cross(out[k], [0, 1.0, 0])
            a, b = a / np.linalg.norm(a), np.cross(out[k], a / np.linalg.norm(a))
            turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
            rim = [points[k] - out[k] * 5e-4 + 5.5e-3 * (np.cos(t) * a + np.sin(t) * b) for t in turn]
            disc = np.array([points[k] - out[k] * 5e-4] + rim)
            fan = np.array([[0, 1 + j, 1 + (j + 1) % 12] for j in range(12)])
            parts.append((disc, fan))
        k = tree.query([-0.02, low, points[:, 2].max()])[1]
        parts.append(cuboid(points[k] + out[k] * 1e-3, np.array([4e-3, 6e-3, 1.5e-3])))
        return joined(*parts)


def halves(garment, noise=0.0, turned=False):
    """The garment with the triangles of its left half on vertices of their own, off by `noise`, or wound the other way."""
    points, triangles = garment
    is_left = points[triangles].mean(1)[:, 0] > 0
    own, number = np.unique(triangles[is_left], return_inverse=True)
    left = number.reshape(-1, 3)
    off = noise * np.random.default_rng(1).uniform(-1, 1, (len(own), 3))
    used, number = np.unique(triangles[~is_left], return_inverse=True)
    return joined((points[used], number.reshape(-1, 3)), (points[own] + off, left[:, ::-1] if turned else left))


def pockets(garment):
    """The garment with two patches of 10 cm on the chest, 2 mm off, and sewn on: their rims have vertices at the positions of the garment's."""
    points, triangles = garment
    out = normals(points, triangles)
    parts = [garment]
    for x in (-0.07, 0.07):
        place = np.array([x, np.percentile(points[:, 1], 60), points[:, 2].max()])
        middle = points[cKDTree(points).query(place)[1]]
        patch = triangles[(np.linalg.norm(points[triangles] - middle, axis=2) < 0.05).all(1)]
        edges = np.sort(np.concatenate([patch[:, [0, 1]], patch[:, [1, 2]], patch[:, [2, 0]]]), axis=1)
        edges, count = np.unique(edges, axis=0, return_counts=True)
        used, number = np.unique(patch, return_inverse=True)
        lift = np.where(np.isin(used, edges[count == 1]), 0, 2e-3)
        parts.append((points[used] + out[used] * lift[:, None], number.reshape(-1, 3)))
    return joined(*parts)


def cuboid(middle, half):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half + middle
    triangles = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return corners, np.array(triangles)


def scenes(scene):
    tshirt, coat, top = (scene.garment(n) for n in ("tshirt", "coat", "cardigan"))
    bottoms = scene.garment("jeans")
    yield "hat", {"hair": scene.hair(), "hat": scene.hat()}
    yield "scarf", {"tshirt": tshirt, "coat": coat, "scarf": scene.scarf([tshirt[0], coat[0], scene.points])}
    yield "bag", {"tshirt": tshirt, "cardigan": top, "bag": scene.bag([tshirt[0], top[0]])}
    yield "padded", {"tshirt": tshirt, "padded": scene.padded(top, 8e-3)}
    yield "buttons", {"blouse": scene.buttons(scene.garment("blouse")), "cardigan": top}
    yield "sewn", {"jeans": halves(bottoms, noise=1e-6), "tshirt": pockets(tshirt), "cardigan": halves(top, turned=True)}
    yield "all", {"hair": scene.hair(), "jeans": bottoms, "tshirt": tshirt, "padded": scene.padded(top, 8e-3),
                  "scarf": scene.scarf([tshirt[0], top[0], scene.points]), "bag": scene.bag([tshirt[0], top[0]]), "hat": scene.hat()}


def main():
    argv, extra = arguments()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--body", default="body_a")
    p.add_argument("--out", default="out/life")
    p.add_argument("--only", nargs="*")
    a = p.parse_args(argv)
    bad = 0
    for name, layers in scenes(Scene(a.data, a.body)):
        if a.only and name not in a.only:
            continue
        folder = os.path.join(a.out, name)
        os.makedirs(os.path.join(folder, "in"), exist_ok=True)
        paths = [write(os.path.join(folder, "in", f"{layer}.ply"), shape) for layer, shape in layers.items()]
        skin = os.path.join(a.data, a.body, "body_clean.ply")
        start = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [a.ifg, "fix", "--json", "--write-unproven", "--body", skin, *paths, "--out", os.path.join(folder, "out"), *extra]
        run = subprocess.run(command, capture_output=True, text=True)
        end = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime
        bad += run.returncode != 0
        try:
            found = json.loads(run.stdout)
        except json.JSONDecodeError:
            print(f"{name}: exit {run.returncode}\n{run.stderr}")
            continue
        report = found["report"]
        pairs = [sum(sum(p["pairs"].values()) for p in report[when]["pairs"]) for when in ("before", "after")]
        print(f"{name:10} {found['state']:12} {seconds:6.1f} s  pairs {pairs[0]:6} -> {pairs[1]}", flush=True)
        for layer in report["layers"]:
            moved, strain, own = layer["moved"], layer["strain"], layer["own_pairs"]
            print(f"    {layer['name']:10} moved {moved['mean'] * 1e3:5.2f} / {moved['max'] * 1e3:5.1f} mm  strain {strain['rms'] * 1e2:5.2f} / {strain['max'] * 1e2:4.0f} %"
                  f"  own {own['before']} -> {own['after']} ({own['new']} new)")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
