#!/usr/bin/env python3
"""Error against processor seconds of both routes of `ifg reconstruct`.

    routes.py IFG CAPTURE TRUTH.ply OUT.csv [--shared ../shared] [--body body_a] [--off 1] [--steps 0,100,300]
        [--route surface,fields] [--frames]

CAPTURE as ../shared/tools/render_sequence.py writes it (with --meshes for --frames), TRUTH.ply the
clothed body at rest of ../shared/data/clothed. With --off SEED the capture's poses are off by 3
degrees and 9 mm, as noisy_capture.py draws them, and refined; otherwise they are exact, and stated.
A row for each run is added to OUT.csv: the canonical mesh by compare.py's measure, openings, and
garments in frames by motion.py (--frames). Needs: pip install numpy scipy libigl meshio pillow
"""
import argparse
import csv
import json
import os
import re
import subprocess
import sys
import tempfile

from outfit_data import processor_seconds


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("ifg"), a.add_argument("capture"), a.add_argument("truth"), a.add_argument("out")
    a.add_argument("--shared", default="../shared"), a.add_argument("--body", default="body_a")
    a.add_argument("--off", type=int), a.add_argument("--steps", default="0,100,300")
    a.add_argument("--route", default="surface,fields"), a.add_argument("--frames", action="store_true")
    a = a.parse_args()
    sys.path.insert(0, f"{a.shared}/tools")
    import numpy as np
    from compare import load, one_way

    here, truth = os.path.dirname(os.path.abspath(__file__)), load(a.truth)
    body = f"{a.shared}/data/{a.body}"
    name = os.path.basename(os.path.abspath(a.capture))
    with tempfile.TemporaryDirectory() as scratch:
        capture, noise = a.capture, ["--pose-noise", "0,0"]
        if a.off is not None:
            capture, noise = f"{scratch}/{name}", []
            turned = ["--degrees", "3", "--mm", "9", "--seed", str(a.off)]
            subprocess.run([sys.executable, f"{here}/noisy_capture.py", a.capture, capture, *turned], check=True)
        runs = [("surface", None)] if "surface" in a.route else []
        runs += [("fields", int(n)) for n in a.steps.split(",")] if "fields" in a.route else []
        for route, steps in runs:
            out = f"{scratch}/{route}{steps}"
            command = [a.ifg, "reconstruct", capture, "--body", body, "--out", out, "--json", "--frames", *noise]
            command += ["--route", "fields", "--fields-steps", str(steps)] if route == "fields" else []
            before = processor_seconds()
            run = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            seconds = processor_seconds() - before
            clothed = f"{out}/clothed/{name}"
            rng = np.random.default_rng(0)
            mesh = load(f"{clothed}/canonical.ply")
            there, back = one_way(mesh, truth, 60000, rng), one_way(truth, mesh, 60000, rng)
            garments = json.loads(run.stdout)["garments"]
            row = {
                "capture": name, "off": "exact" if a.off is None else f"3/9 seed {a.off}", "route": route, "steps": steps,
                "processor_s": round(seconds, 1), "there_mm": 1e3 * there["mean"], "back_mm": 1e3 * back["mean"],
                "there_p95_mm": 1e3 * there["p95"], "back_p95_mm": 1e3 * back["p95"],
                "openings": " ".join(str(g.get("openings")) for g in garments),
            }
            if a.frames:
                judge = [sys.executable, f"{here}/motion.py", a.capture, body, clothed, "--shared", a.shared]
                text = subprocess.run(judge, check=True, stdout=subprocess.PIPE, text=True).stdout
                found = re.search(r"there ([\d.]+) p95 [\d.]+, back ([\d.]+)", text)
                row["frames_there_mm"], row["frames_back_mm"] = map(float, found.groups())
            else:
                row["frames_there_mm"] = row["frames_back_mm"] = ""
            row = {k: round(v, 2) if isinstance(v, float) else v for k, v in row.items()}
            fresh = not os.path.exists(a.out)
            with open(a.out, "a", newline="") as file:
                writer = csv.DictWriter(file, row.keys())
                if fresh:
                    writer.writeheader()
                writer.writerow(row)
            print(*row.values(), flush=True)


if __name__ == "__main__":
    main()
