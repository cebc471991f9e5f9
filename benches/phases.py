#!/usr/bin/env python3
"""Where `ifg fix` spends its time: phases of outfits of the test data, by one or more builds in turn.

    benches/phases.py --ifg target/release/ifg [OTHER ...] [--data ../shared/data] [--only o1_ o5] [--runs 5] [--threads 1]
                      [--refine 1] [--out out/phases]

Prints for each outfit and build the median seconds of every phase that takes at least a hundredth of the total: of
processors, and on the wall. Outfits are those whose names begin with one of --only. --refine splits each triangle into
four so often. Needs Python 3.9; --refine needs numpy and trimesh.
"""
import argparse, json, os, statistics, subprocess
from outfit_data import outfits


def flat(phase, path=""):
    name = f"{path}{phase['name']}"
    yield name, (phase.get("processor", 0.0), phase["wall"])
    for inner in phase.get("phases", []):
        yield from flat(inner, name + " / ")


def refined(path, times, folder):
    """The path of a copy in which each triangle is split into four so often."""
    import trimesh

    mesh = trimesh.load(path, process=False)
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(times):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    os.makedirs(folder, exist_ok=True)
    copy = os.path.join(folder, os.path.basename(path))
    trimesh.Trimesh(vertices, faces, process=False).export(copy)
    return copy


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", nargs="+", default=["target/release/ifg"])
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--only", nargs="*", default=["o1_", "o5"])
    p.add_argument("--runs", type=int, default=5)
    p.add_argument("--threads", default="1")
    p.add_argument("--refine", type=int, default=0)
    p.add_argument("--out", default="out/phases")
    a = p.parse_args()
    for _, name, skin, _, garments in outfits(a.data, ["body_a", "body_b"], a.only):
        if a.refine:
            skin, *garments = [refined(path, a.refine, os.path.join(a.out, f"{name}_{a.refine}")) for path in [skin, *garments]]
        runs = {ifg: [] for ifg in a.ifg}
        peak = {}
        for _ in range(a.runs):
            for ifg in a.ifg:
                command = [ifg, "fix", "--no-pictures", "--json", "--timings", "--threads", a.threads]
                run = subprocess.run([*command, "--out", os.path.join(a.out, name), "--body", skin, *garments], stdout=subprocess.PIPE, check=True)
                found = json.loads(run.stdout)
                runs[ifg].append(dict(flat(found["phases"])))
                peak[ifg] = (found["peak_memory"] or 0) / 2**20
        for ifg, found in runs.items():
            print(f"{name}, {ifg}, {a.threads} threads, medians of {a.runs}: processor s, wall s; peak memory {peak[ifg]:.0f} MiB")
            median = lambda phase, k: statistics.median(run[phase][k] for run in found)
            for phase in found[0]:
                # Parts that run beside one another have wall seconds alone.
                if max(median(phase, 0), median(phase, 1)) >= 0.01 * median("total", 0):
                    print(f"  {median(phase, 0):7.3f} {median(phase, 1):7.3f}  {phase}")


if __name__ == "__main__":
    main()
