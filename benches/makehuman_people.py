#!/usr/bin/env python3
"""`ifg fix` on people and clothes that MakeHuman makes: other bodies, other garments than the test data.

    benches/makehuman_people.py --makehuman MAKEHUMAN --assets MAKEHUMAN_ASSETS --ifg target/release/ifg [--count 36] [--seed 1]
                                [--only m1_03] [--out out/people] [--referee ../shared/tools/referee.py] [-- extra arguments of ifg fix]

The folders are checkouts of makehumancommunity/makehuman and makehumancommunity/makehuman-assets (CC0). Six people (a
child; heavy, thin, old, strong) wear trousers or a skirt, one or two tops and up to two outer garments, drawn by the seed.
Prints a line an outfit, and the shares of states. Needs numpy, scipy and meshio.
"""
import argparse
import collections
import json
import pathlib
import random
import subprocess
import sys

import meshio
import numpy as np
from outfit_data import arguments, processor_seconds
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

# Gender, age, muscle, weight.
PEOPLE = {
    "child_f": ("female", "child", "average", "average"),
    "heavy_m": ("male", "young", "average", "max"),
    "thin_f": ("female", "young", "min", "min"),
    "old_m": ("male", "old", "min", "average"),
    "strong_m": ("male", "young", "max", "average"),
    "heavy_f": ("female", "old", "average", "max"),
}
# Garments are the connected parts of assets, the one of most triangles first.
LEGS = ["female_casualsuit01_1", "female_sportsuit01_1", "male_casualsuit02_1", "male_casualsuit03_1", "male_casualsuit04_0",
        "male_casualsuit05_1", "male_casualsuit06_1", "male_elegantsuit01_1", "female_elegantsuit01_1", "female_casualsuit02_1"]
TOPS = ["female_casualsuit01_0", "female_casualsuit02_0", "female_sportsuit01_0", "male_casualsuit02_0", "male_casualsuit03_0",
        "male_casualsuit04_1", "male_casualsuit06_0", "male_worksuit01_1"]
OUTER = ["female_elegantsuit01_0", "male_casualsuit05_0", "male_elegantsuit01_0", "male_worksuit01_0", "male_casualsuit01_0"]
DECIMETRES = 0.1


def read_obj(path):
    """Vertices, polygons, and the group of each polygon."""
    vertices, polygons, groups, group = [], [], [], ""
    for line in path.read_text(errors="replace").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["g"]:
            group = words[1]
        elif words[:1] == ["f"]:
            polygons.append([int(w.split("/")[0]) - 1 for w in words[1:]])
            groups.append(group)
    return np.array(vertices), polygons, groups


def triangles(polygons):
    return np.array([[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)])


def person(makehuman, base, gender, age, muscle, weight):
    """The base mesh with the targets of such a person."""
    folder = makehuman / "makehuman/data/targets/macrodetails"
    targets = [(f"{origin}-{gender}-{age}", 1 / 3) for origin in ("african", "asian", "caucasian")]
    moved = base.copy()
    for name, share in [*targets, (f"universal-{gender}-{age}-{muscle}muscle-{weight}weight", 1.0)]:
        for line in (folder / f"{name}.target").read_text().splitlines():
            words = line.split()
            if len(words) == 4 and not line.startswith("#"):
                moved[int(words[0])] += share * np.array(words[1:], float)
    return moved


def fitted(path, body):
    """The vertices of an asset on a body: weights of three vertices and an offset, scaled along each axis."""
    scale, rows = np.ones(3), None
    for line in path.read_text(errors="replace").splitlines():
        words = line.split()
        if words and words[0] in ("x_scale", "y_scale", "z_scale"):
            axis = "xyz".index(words[0][0])
            scale[axis] = abs(body[int(words[1]), axis] - body[int(words[2]), axis]) / float(words[3])
        elif words[:1] == ["verts"]:
            rows = []
        elif rows is not None and words and words[0].isdigit():
            rows.append(words)
        elif rows:
            break
    places = [body[int(r[0])] if len(r) == 1 else np.array(r[3:6], float) @ body[[int(i) for i in r[:3]]]
              + scale * np.array(r[6:9] or [0, 0, 0], float) for r in rows or []]
    return np.array(places)


def write(path, vertices, faces, properties=None):
    """A mesh of the vertices that triangles use, with properties of all vertices."""
    used, faces = np.unique(faces, return_inverse=True)
    cells = [("triangle", faces.reshape(-1, 3).astype(np.int32))]
    of_used = {name: values[used] for name, values in (properties or {}).items()}
    meshio.write(path, meshio.Mesh((DECIMETRES * vertices[used]).astype(np.float32), cells, point_data=of_used))


def standing(makehuman, name):
    """A person on the floor, and the triangles of its skin."""
    base, polygons, groups = read_obj(makehuman / "makehuman/data/3dobjs/base.obj")
    skin = triangles([p for p, g in zip(polygons, groups) if g == "body"])
    body = person(makehuman, base, *PEOPLE[name])
    body[:, 1] -= body[skin, 1].min()
    return body, skin


def make(a, folder, name):
    """Writes a person and the parts of all clothes that have at least 150 triangles."""
    body, skin = standing(a.makehuman, name)
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "body.ply", body, skin)
    for path in sorted((a.assets / "base/clothes").glob("*/*suit*.mhclo")):
        vertices = fitted(path, body)
        drawn, polygons, _ = read_obj(path.with_suffix(".obj"))
        if len(drawn) != len(vertices):
            sys.exit(f"{path}: {len(vertices)} rows below `verts` for {len(drawn)} vertices of its .obj")
        faces = triangles(polygons)
        edges = np.vstack([faces[:, :2], faces[:, 1:]]).T
        _, part = connected_components(coo_matrix((np.ones(edges.shape[1]), edges), shape=(len(drawn),) * 2), False)
        sizes = collections.Counter(part[faces[:, 0]])
        parts = sorted(((n, k) for k, n in sizes.items() if n >= 150), reverse=True)
        for index, (_, k) in enumerate(parts):
            write(folder / f"{path.stem}_{index}.ply", vertices, faces[part[faces[:, 0]] == k])


def drawn(seed, count):
    """Identifier, person and garments of each outfit."""
    rng = random.Random(seed)
    for k in range(count):
        tops, legs = rng.sample(TOPS, rng.choice([1, 1, 2])), [rng.choice(LEGS)]
        outer = rng.sample(OUTER, rng.choice([0, 1, 1, 2]))
        order = (legs + tops if rng.random() < 0.7 else tops + legs) + outer
        yield f"m{seed}_{k:02}", list(PEOPLE)[k % len(PEOPLE)], order


def options(text, seed, out):
    """The arguments that tools for these people have in common."""
    p = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--makehuman", type=pathlib.Path, required=True)
    p.add_argument("--assets", type=pathlib.Path, required=True)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--count", type=int, default=36)
    p.add_argument("--seed", type=int, default=seed)
    p.add_argument("--only", nargs="*")
    p.add_argument("--out", type=pathlib.Path, default=pathlib.Path(out))
    return p


def chosen(a):
    """Those drawn that are asked for."""
    return [outfit for outfit in drawn(a.seed, a.count) if not a.only or outfit[0] in a.only]


def main():
    argv, extra = arguments()
    p = options(__doc__, 1, "out/people")
    p.add_argument("--referee")
    a = p.parse_args(argv)
    states = collections.Counter()
    for identifier, name, order in chosen(a):
        folder, out = a.out / name, a.out / identifier
        if not (folder / "body.ply").exists():
            make(a, folder, name)
        garments = [str(folder / f"{garment}.ply") for garment in order]
        command = [a.ifg, "--threads", "1", "fix", "--no-pictures", "--write-unproven", "--body", str(folder / "body.ply"), *garments]
        start = processor_seconds()
        run = subprocess.run([*command, "--out", str(out), *extra], capture_output=True, text=True)
        seconds = processor_seconds() - start
        if run.returncode not in (0, 1):
            sys.exit(run.stderr)
        report = json.loads((out / "receipt.json").read_text())["report"]
        before, after = report["before"], report["after"]
        pairs = [sum(sum(p["pairs"].values()) for p in state["pairs"]) for state in (before, after)]
        own = [sum(state["own_pairs"]) for state in (before, after)]
        strain = max(layer["strain"]["rms"] for layer in report["layers"])
        states["clean between layers" if run.returncode == 0 else "not clean"] += 1
        judged = ""
        if run.returncode:
            lift = max((o["lift"] for o in report.get("obstacles", [])), default=0)
            judged = f"(a garment would have to be lifted by {100 * lift:.0f} cm) "
        if a.referee:
            results = [str(out / f"{garment}.ply") for garment in order]
            command = [sys.executable, a.referee, "--body", str(folder / "body.ply"), "--after", *results]
            judged += f"referee: exit code {subprocess.run(command, capture_output=True).returncode}"
        print(f"{identifier} {name} {' < '.join(order)}: pairs {pairs[0]} -> {pairs[1]}, own {own[0]} -> {own[1]}, "
              f"strain rms {100 * strain:.1f} %, {seconds:.1f} s {judged}", flush=True)
    print(dict(states))


if __name__ == "__main__":
    main()
