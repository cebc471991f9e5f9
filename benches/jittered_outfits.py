#!/usr/bin/env python3
"""`ifg fix` on outfits whose garments do not lie where they belong.

    benches/jittered_outfits.py --ifg target/release/ifg --data ../shared/data [--count 40] [--seed 1] [--only o1 o3]
                                [--any-order] [--out out/jittered] [-- extra arguments of ifg fix]

Takes the outfits of body_a and body_b in turn. Each garment moves by up to 15 mm, turns by up to 3 degrees about a random
axis through its middle, and is scaled by 0.95 to 1.05; with --any-order 2 to 6 garments of the body are drawn instead, in
any order. Prints a line an outfit, and the shares of states. Needs numpy and meshio.
"""
import argparse
import collections
import json
import os
import random
import subprocess
import sys
import time

import meshio
import numpy as np
from outfit_data import Outfit, arguments, outfits


def jittered(path, out, rng):
    """Writes the garment of `path` to `out`, moved, turned and scaled."""
    mesh = meshio.read(path)
    points = np.asarray(mesh.points, float)
    middle = (points.min(0) + points.max(0)) / 2
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    angle, scale = np.radians(rng.uniform(-3, 3)), rng.uniform(0.95, 1.05)
    shift = rng.normal(size=3)
    shift *= rng.uniform(0, 0.015) / np.linalg.norm(shift)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    mesh.points = (scale * (points - middle) @ turn.T + middle + shift).astype(np.float32)
    meshio.write(out, meshio.Mesh(mesh.points, [("triangle", mesh.cells_dict["triangle"])]))


def any_order(data, seed):
    """2 to 6 garments of a body, in any order."""
    generator = random.Random(seed)
    body = generator.choice(["body_a", "body_b"])
    folder = os.path.join(data, body)
    names = sorted(n[:-4] for n in os.listdir(os.path.join(folder, "garments")) if n.endswith(".ply"))
    layers = generator.sample(names, generator.randint(2, min(6, len(names))))
    garments = [os.path.join(folder, "garments", f"{name}.ply") for name in layers]
    return Outfit(body, "+".join(layers), os.path.join(folder, "body_clean.ply"), layers, garments)


def main():
    argv, extra = arguments()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--count", type=int, default=40)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--only", nargs="*")
    p.add_argument("--any-order", action="store_true")
    p.add_argument("--out", default="out/jittered")
    a = p.parse_args(argv)
    known = list(outfits(a.data, ["body_a", "body_b"], a.only))
    states, times = collections.Counter(), []
    for k in range(a.count):
        seed = 1000 * a.seed + k
        outfit = any_order(a.data, seed) if a.any_order else known[k % len(known)]
        folder = os.path.join(a.out, f"{seed}")
        os.makedirs(os.path.join(folder, "in"), exist_ok=True)
        garments = [os.path.join(folder, "in", os.path.basename(g)) for g in outfit.garments]
        rng = np.random.default_rng(seed)
        for source, target in zip(outfit.garments, garments):
            if a.any_order:
                if not os.path.lexists(target):
                    os.symlink(os.path.abspath(source), target)
            else:
                jittered(source, target, rng)
        start = time.time()
        command = [a.ifg, "fix", "--json", "--write-unproven", "--body", outfit.skin, *garments, "--out", folder, "--no-pictures"]
        run = subprocess.run([*command, *extra], capture_output=True, text=True)
        times.append(time.time() - start)
        try:
            found = json.loads(run.stdout)
        except json.JSONDecodeError:
            found = {"state": f"exit {run.returncode}", "error": run.stderr.strip().splitlines()[:2]}
        states[found["state"]] += 1
        line = f"{seed} {outfit.name:26} {times[-1]:6.2f} s  {found['state']}"
        if "report" in found:
            layers = found["report"]["layers"]
            left = sum(sum(pair["pairs"].values()) for pair in found["report"]["after"]["pairs"])
            own = sum(layer["own_pairs"]["new"] for layer in layers)
            worst = max(layers, key=lambda layer: layer["strain"]["max"])
            line += f"  strain {1e2 * worst['strain']['rms']:.1f} / {1e2 * worst['strain']['max']:.0f} %"
            line += f"  left {left}, new own {own}" if left or own else ""
        else:
            line += f"  {found.get('error')}"
        print(line, flush=True)
    shares = ", ".join(f"{state}: {count} of {a.count}" for state, count in states.most_common())
    print(f"{shares}; median {np.median(times):.2f} s, worst {max(times):.2f} s")


if __name__ == "__main__":
    main()
