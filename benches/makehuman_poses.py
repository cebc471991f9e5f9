#!/usr/bin/env python3
"""`ifg animate` on people, clothes, skeleton and poses that MakeHuman makes, each pose as a motion of one frame.

    benches/makehuman_poses.py --makehuman MAKEHUMAN --assets MAKEHUMAN_ASSETS --ifg target/release/ifg [--count 36] [--seed 3]
                               [--only m3_01] [--poses sit01 run01] [--out out/poses] [-- extra arguments of ifg animate]

Folders and outfits are those of makehuman_people.py. The skeleton has 163 joints, with fingers, toes and a face; poses are BVH files
with z up (all of the assets by default). Garments take their weights from the body. Prints a line a pose, and the shares of states.
Needs numpy, scipy and meshio.
"""
import collections
import json
import subprocess
import sys

import numpy as np
from makehuman_people import DECIMETRES, chosen, make, options, standing, write
from outfit_data import arguments, processor_seconds


def parents_first(bones):
    """Names of the bones, each after its parent."""
    order = []

    def add(name):
        if name not in order:
            if bones[name].get("parent"):
                add(bones[name]["parent"])
            order.append(name)

    for name in bones:
        add(name)
    return order


def rig(makehuman, folder, name):
    """Writes a person with the weights of MakeHuman's default rig, and its skeleton."""
    body, skin = standing(makehuman, name)
    rigs = makehuman / "makehuman/data/rigs"
    skeleton = json.loads((rigs / "default.mhskel").read_text())
    bones, order = skeleton["bones"], parents_first(skeleton["bones"])

    def at(joint):
        return (DECIMETRES * body[skeleton["joints"][joint]].mean(0)).tolist()

    joints = [{"id": k, "name": bone, "parent": order.index(bones[bone]["parent"]) if bones[bone].get("parent") else -1,
               "head": at(bones[bone]["head"]), "tail": at(bones[bone]["tail"])} for k, bone in enumerate(order)]
    (folder / "skeleton.json").write_text(json.dumps({"joints": joints}))
    weights = np.zeros((len(body), len(order)))
    for bone, of_bone in json.loads((rigs / "default_weights.mhw").read_text())["weights"].items():
        for vertex, weight in of_bone:
            weights[vertex, order.index(bone)] += weight
    most = np.argsort(-weights, 1, kind="stable")[:, :4]
    weights = np.take_along_axis(weights, most, 1)
    # Vertices that are not of the skin may have none.
    weights /= np.maximum(weights.sum(1, keepdims=True), 1e-9)
    properties = {f"j{k}": most[:, k].astype(np.int32) for k in range(4)}
    properties.update({f"w{k}": weights[:, k].astype(np.float32) for k in range(4)})
    write(folder / "body.ply", body, skin, properties)


def main():
    argv, extra = arguments()
    p = options(__doc__, 3, "out/poses")
    p.add_argument("--poses", nargs="*")
    a = p.parse_args(argv)
    poses = sorted((a.assets / "base/poses").glob("*.bvh"))
    if a.poses:
        poses = [a.assets / f"base/poses/{pose}.bvh" for pose in a.poses]
    states = collections.Counter()
    for identifier, name, order in chosen(a):
        folder = a.out / name
        if not (folder / "skeleton.json").exists():
            make(a, folder, name)
            rig(a.makehuman, folder, name)
        garments = [str(folder / f"{garment}.ply") for garment in order]
        for pose in poses:
            out = a.out / f"{identifier}_{pose.stem}"
            command = [a.ifg, "--threads", "1", "animate", "--body", str(folder / "body.ply"), *garments, "--motion", str(pose)]
            start = processor_seconds()
            run = subprocess.run([*command, "--frames", "0", "--out", str(out), *extra], capture_output=True, text=True)
            seconds = processor_seconds() - start
            if run.returncode not in (0, 1):
                sys.exit(run.stderr)
            frame = json.loads((out / "report.json").read_text())["report"]["frames"][0]
            own = frame["own_pairs"] + frame["body_own_pairs"]
            state = "not clean" if run.returncode else "clean everywhere" if own == 0 else "clean between layers"
            states[state] += 1
            print(f"{identifier} {name} {pose.stem}: {state}, pairs {frame['pairs_before']} -> {frame['pairs']}, own {frame['own_pairs']} + "
                  f"{frame['body_own_pairs']}, let go {frame['let_go']}, garments {1e3 * frame['moved']['mean']:.2f} / "
                  f"{1e3 * frame['moved']['max']:.1f} mm, body {1e3 * frame['body']['moved']['max']:.1f} mm, {seconds:.1f} s", flush=True)
    print(dict(states))


if __name__ == "__main__":
    main()
