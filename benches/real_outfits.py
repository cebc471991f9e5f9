#!/usr/bin/env python3
"""`ifg fix` on every outfit of the test data, judged by the independent referee.

    benches/real_outfits.py --ifg target/release/ifg --data ../shared/data [--referee ../shared/tools/referee.py --python PY]
                            [--out out/real] [--only o1 o3] [--bodies body_c [--draw 20 --seed 1]] [--markdown TABLE.md] [-- extra arguments of ifg fix]

The bodies are body_a and body_b unless others are named. --draw takes outfits of 3 to 6 layers from the bodies' slots.json; --only takes
names that begin so, and of drawn ones whole names (d1_124).
Prints, for each outfit: wall time of the whole command, pairs and vertices inside before and after by our count, the
referee's pairs after (and before), and for each layer what moved, strain and own pairs; --markdown writes the same as a table. Needs Python 3.9; the referee
needs numpy, scipy, libigl and meshio in PY.
"""
import argparse, json, os, subprocess, sys, time
from outfit_data import arguments, drawn, outfits


def main():
    argv, extra = arguments()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--referee")
    p.add_argument("--python", default=sys.executable)
    p.add_argument("--out", default="out/real")
    p.add_argument("--only", nargs="*")
    p.add_argument("--bodies", nargs="*", default=["body_a", "body_b"])
    p.add_argument("--draw", type=int)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--markdown")
    a = p.parse_args(argv)
    total, bad, table = 0.0, 0, []
    if a.draw:
        found = [outfit for body in a.bodies for outfit in drawn(a.data, body, a.draw, a.seed) if not a.only or outfit.name in a.only]
    else:
        found = outfits(a.data, a.bodies, a.only)
    for _, name, skin, layers, garments in found:
        out = os.path.join(a.out, name)
        start = time.time()
        run = subprocess.run([a.ifg, "fix", "--json", "--write-unproven", "--body", skin, *garments, "--out", out, *extra], capture_output=True, text=True)
        seconds = time.time() - start
        total += seconds
        try:
            report = json.loads(run.stdout)
        except json.JSONDecodeError:
            print(f"{name}: exit {run.returncode}\n{run.stderr}")
            bad += 1
            continue
        report = report.get("report", report)
        sums = lambda v: (sum(sum(q["pairs"].values()) for q in v["pairs"]), sum(q["vertices_inside"] for q in v["pairs"]))
        before, after = sums(report["before"]), sums(report["after"])
        line = f"{name:26} {seconds:6.2f} s  pairs {before[0]:6} -> {after[0]}  inside {before[1]:5} -> {after[1]}"
        judged = ["", ""]
        if a.referee and run.returncode == 0:
            judge = os.path.join(out, "referee.json")
            outputs = [os.path.join(out, os.path.basename(g)) for g in garments]
            subprocess.run([a.python, a.referee, "--body", skin, "--after", *outputs, "--before", *garments, "--json", judge], capture_output=True)
            found = json.load(open(judge))
            inside = sum(r["vertices_inside"]["inside"] for r in found["pairs"])
            judged = [f"{sum(r['before'] for r in found['pairs'])} → {found['total_pairs']}", str(inside)]
            line += f"  referee {sum(r['before'] for r in found['pairs'])} -> {found['total_pairs']}, its pseudo-normal side test {inside}"
            bad += found["total_pairs"] != 0
        bad += run.returncode != 0
        line += "  " + " < ".join(layers) if a.draw else ""
        print(line, flush=True)
        cells = [name, f"{seconds:.2f}", f"{before[0]} → {after[0]}", f"{before[1]} → {after[1]}", *judged]
        for layer in report["layers"]:
            m, s = layer["moved"], layer["strain"]
            print(f"    {layer['name']:16} moved {m['mean']*1e3:6.2f} / {m['p95']*1e3:6.2f} / {m['max']*1e3:6.1f} mm   strain {s['rms']*1e2:5.2f} / {s['p99']*1e2:5.2f} / {s['max']*1e2:4.0f} %   own {layer['own_pairs']['before']} -> {layer['own_pairs']['after']}")
            cells += [layer["name"], f"{m['mean']*1e3:.2f} / {m['p95']*1e3:.2f} / {m['max']*1e3:.1f}", f"{s['rms']*1e2:.2f} / {s['p99']*1e2:.2f} / {s['max']*1e2:.0f}",
                      f"{layer['rounds']} + {layer['repairs']}", f"{layer['own_pairs']['before']} → {layer['own_pairs']['after']}"]
            table.append("| " + " | ".join(cells) + " |")
            cells = [""] * 6
    print(f"total {total:.1f} s, {bad} not clean")
    if a.markdown:
        head = ["outfit", "s", "pairs", "inside", "referee's pairs", "its side test", "layer", "moved mean / p95 / max, mm", "strain rms / p99 / max, %", "rounds", "own pairs"]
        with open(a.markdown, "w", encoding="utf-8") as out:
            print("| " + " | ".join(head) + " |", "|" + "---|" * len(head), *table, "", f"Total {total:.1f} s, {bad} not clean.", sep="\n", file=out)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
