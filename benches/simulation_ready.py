#!/usr/bin/env python3
"""Whether simulators may start from what `ifg fix` writes, judged by ipctk (the toolkit of Incremental Potential Contact).

    benches/simulation_ready.py --ifg target/release/ifg --data ../shared/data [--out out/ready] [--only o1 o3] [-- extra arguments of ifg fix]

For each outfit of the test data, body and garments together: `ipctk.has_intersections` before and after, own pairs of the garments before and
after, those that are kept with their reasons, and the least distance of all pairs of triangles that share no vertex, by our report (two layers,
a garment to itself) and by ipctk (the whole scene with the body to itself). Prints a Markdown table. Needs Python 3.9, ipctk, meshio and numpy.
"""
import argparse, collections, json, os, subprocess, sys
import ipctk, meshio, numpy as np
from outfit_data import arguments, outfits

# Pairs farther apart are not collected, in metres.
REACH = 2e-3


def scene(files):
    vertices, triangles, count = [], [], 0
    for file in files:
        mesh = meshio.read(file)
        vertices.append(mesh.points.astype(float))
        triangles.append(np.vstack([c.data for c in mesh.cells if c.type == "triangle"]) + count)
        count += len(vertices[-1])
    vertices, triangles = np.vstack(vertices), np.vstack(triangles)
    return ipctk.CollisionMesh(vertices, ipctk.edges(triangles), triangles), vertices


def least(mesh, vertices):
    pairs = ipctk.NormalCollisions()
    pairs.build(mesh, vertices, REACH)
    return np.sqrt(pairs.compute_minimum_distance(mesh, vertices))


def main():
    argv, extra = arguments()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--out", default="out/ready")
    p.add_argument("--only", nargs="*")
    a = p.parse_args(argv)
    print("| outfit | state | ipctk: intersections | own pairs | kept | layers, mm | share of clearance, % | garment to itself, mm | ipctk: scene, mm |")
    print("|---|---|---|---|---|---|---|---|---|")
    met = 0
    for _, name, skin, _, garments in outfits(a.data, ("body_a", "body_b"), a.only):
        out = os.path.join(a.out, name)
        run = subprocess.run([a.ifg, "fix", "--json", "--no-pictures", "--body", skin, *garments, "--out", out, *extra], capture_output=True, text=True)
        if run.returncode != 0:
            sys.exit(f"{name}: exit {run.returncode}\n{run.stderr}")
        found = json.loads(run.stdout)
        report = found["report"]
        before = scene([skin, *garments])
        after = scene([skin, *(os.path.join(out, os.path.basename(g)) for g in garments)])
        meets = [ipctk.has_intersections(*s) for s in (before, after)]
        met += meets[1]
        own = [sum(l["own_pairs"][k] for l in report["layers"]) for k in ("before", "after")]
        kept = collections.Counter(k["reason"] for l in report["layers"] for k in l["kept_own_pairs"])
        kept = ", ".join(f"{n} {reason}" for reason, n in kept.items()) or "none"
        between = min(q["least_distance"]["distance"] for q in report["after"]["pairs"])
        itself = min(d["distance"] for d in report["after"]["own_least_distances"] if d)
        share = 100 * report["clearance_reached"]
        share = f"{share:.2g}" if share < 100 else f"{share:.0f}"
        words = " → ".join("yes" if m else "no" for m in meets)
        print(f"| {name} | {found['state'].removeprefix('clean ')} | {words} | {own[0]} → {own[1]} | {kept} | {between*1e3:.2g} | {share} "
              f"| {itself*1e3:.2g} | {least(*after)*1e3:.2g} |", flush=True)
    print(f"\n{met} with intersections after.")
    sys.exit(1 if met else 0)


if __name__ == "__main__":
    main()
