#!/usr/bin/env python3
"""A copy of a capture (links to its images) with errors as estimators make them.

    noisy_capture.py CAPTURE OUT [--degrees 3] [--mm 9] [--correlation 8] [--normals 12] [--camera 1]
        [--joint LeftForeArm 40 8-12] [--seed 1]

Poses: each joint turns by a normally distributed rotation vector of root mean square --degrees, the
root shifts by --mm along each axis; independently in each frame, or correlated by exp(-2 d^2 / c^2)
in frames d apart. Normals: turned smoothly by --normals degrees, afresh in each frame.
One joint: turned by as many degrees about its first axis in some frames, on top.
The camera: turned about its centre by a vector of standard deviation --camera degrees along each
axis. `meta.json` of the copy states the errors of poses and camera. Needs: pip install numpy pillow
"""
import argparse
import json
import os

import numpy as np
from PIL import Image


def product(a, b):
    """The product of quaternions (w, x, y, z)."""
    (p, u), (q, v) = (a[0], np.array(a[1:])), (b[0], np.array(b[1:]))
    return [p * q - u @ v, *(p * v + q * u + np.cross(u, v))]


def quaternion(turn):
    """The rotation by a rotation vector."""
    angle = np.linalg.norm(turn)
    return [np.cos(angle / 2), *(np.sinc(angle / 2 / np.pi) / 2 * turn)]


def tracks(frames, count, correlation, rng):
    """Standard normal numbers, (frames, count)."""
    white = rng.normal(size=(frames, count))
    if correlation <= 0:
        return white
    apart = np.subtract.outer(np.arange(frames), np.arange(frames))
    covariance = np.exp(-2 * (apart / correlation) ** 2) + 1e-9 * np.eye(frames)
    return np.linalg.cholesky(covariance) @ white


def turned(picture, degrees, rng):
    """A picture of normals, turned by rotation vectors that are smooth in the image."""
    h, w, _ = picture.shape
    normals = picture / 127.5 - 1
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-9)
    coarse = [rng.normal(size=(16, 16)).astype(np.float32) for _ in range(3)]
    fields = [np.asarray(Image.fromarray(c).resize((w, h), Image.BICUBIC)) for c in coarse]
    # Two of three components of a rotation vector turn a normal.
    turn = np.stack([f / f.std() for f in fields], 2) * np.radians(degrees) / np.sqrt(2)
    angle = np.linalg.norm(turn, axis=2, keepdims=True)
    axis = turn / np.maximum(angle, 1e-9)
    along = axis * (axis * normals).sum(2, keepdims=True) * (1 - np.cos(angle))
    out = normals * np.cos(angle) + np.cross(axis, normals) * np.sin(angle) + along
    known = picture.sum(2, keepdims=True) > 0
    return np.where(known, np.round((out / 2 + 0.5) * 255), 0).clip(0, 255).astype(np.uint8)


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("capture"), a.add_argument("out")
    for name in ("degrees", "mm", "correlation", "normals", "camera"):
        a.add_argument(f"--{name}", type=float, default=0)
    a.add_argument("--joint", nargs=3, metavar=("NAME", "DEGREES", "FRAMES"))
    a.add_argument("--seed", type=int, default=1)
    a = a.parse_args()
    rng = np.random.default_rng(a.seed)
    meta = json.load(open(f"{a.capture}/meta.json"))
    frames, joints = len(meta["frames"]), len(meta["joints"])
    turns = tracks(frames, 3 * joints, a.correlation, rng).reshape(frames, joints, 3)
    shifts = tracks(frames, 3, a.correlation, rng)
    os.makedirs(a.out)
    for name in os.listdir(a.capture):
        if name != "meta.json" and not (name == "normal" and a.normals > 0):
            os.symlink(os.path.abspath(f"{a.capture}/{name}"), f"{a.out}/{name}")
    for k, frame in enumerate(meta["frames"]):
        noise = turns[k] * np.radians(a.degrees) / np.sqrt(3)
        frame["rot"] = [product(q, quaternion(n)) for q, n in zip(frame["rot"], noise)]
        frame["root_t"] = (np.array(frame["root_t"]) + shifts[k] * a.mm / 1000).tolist()
    if a.joint:
        joint, (first, last) = meta["joints"].index(a.joint[0]), map(int, a.joint[2].split("-"))
        for frame in meta["frames"][first : last + 1]:
            frame["rot"][joint] = product(frame["rot"][joint], quaternion(np.radians(float(a.joint[1])) * np.eye(3)[0]))
    meta["pose_sigma_degrees"], meta["pose_sigma_mm"] = a.degrees, a.mm
    meta["camera_sigma_degrees"] = a.camera
    if a.camera > 0:
        q = quaternion(np.radians(a.camera) * np.random.default_rng(a.seed + 1000).normal(size=3))
        turned_axes = [product(product(q, [0, *axis]), [q[0], *-np.array(q[1:])])[1:] for axis in np.eye(3)]
        turn = np.array(turned_axes).T
        meta["R"], meta["t"] = (turn @ meta["R"]).tolist(), (turn @ meta["t"]).tolist()
    json.dump(meta, open(f"{a.out}/meta.json", "w"))
    if a.normals > 0:
        os.makedirs(f"{a.out}/normal")
        for name in sorted(os.listdir(f"{a.capture}/normal")):
            picture = np.asarray(Image.open(f"{a.capture}/normal/{name}")).astype(float)
            Image.fromarray(turned(picture, a.normals, rng)).save(f"{a.out}/normal/{name}")


if __name__ == "__main__":
    main()
