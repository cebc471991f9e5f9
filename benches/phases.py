#!/usr/bin/env python3
"""Where `ifg fix` spends its time: phases of outfits of the test data, by one or more builds in turn.

    benches/phases.py --ifg target/release/ifg [OTHER ...] [--data ../shared/data] [--only o1_ o5] [--runs 5] [--threads 1]
                      [--out out/phases]

Prints for each outfit and build the median seconds of every phase that takes at least a hundredth of the total: of
processors, and on the wall. Outfits are those whose names begin with one of --only. Needs Python 3.9.
"""
import argparse, json, os, statistics, subprocess
from outfit_data import outfits


def flat(phase, path=""):
    name = f"{path}{phase['name']}"
    yield name, (phase.get("processor", 0.0), phase["wall"])
    for inner in phase.get("phases", []):
        yield from flat(inner, name + " / ")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", nargs="+", default=["target/release/ifg"])
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--only", nargs="*", default=["o1_", "o5"])
    p.add_argument("--runs", type=int, default=5)
    p.add_argument("--threads", default="1")
    p.add_argument("--out", default="out/phases")
    a = p.parse_args()
    for _, name, skin, _, garments in outfits(a.data, ["body_a", "body_b"], a.only):
        runs = {ifg: [] for ifg in a.ifg}
        for _ in range(a.runs):
            for ifg in a.ifg:
                command = [ifg, "fix", "--no-pictures", "--json", "--timings", "--threads", a.threads]
                run = subprocess.run([*command, "--out", os.path.join(a.out, name), "--body", skin, *garments], stdout=subprocess.PIPE, check=True)
                runs[ifg].append(dict(flat(json.loads(run.stdout)["phases"])))
        for ifg, found in runs.items():
            print(f"{name}, {ifg}, {a.threads} threads, medians of {a.runs}: processor s, wall s")
            median = lambda phase, k: statistics.median(run[phase][k] for run in found)
            for phase in found[0]:
                if median(phase, 0) >= 0.01 * median("total", 0):
                    print(f"  {median(phase, 0):7.3f} {median(phase, 1):7.3f}  {phase}")


if __name__ == "__main__":
    main()
