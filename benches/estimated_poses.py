#!/usr/bin/env python3
"""Poses, camera and shape that are estimates: what `ifg reconstruct` makes of them.

    estimated_poses.py IFG OUT.csv [--shared ../shared] [--only TEXT ...]

Renders the captures of docs/evidence/reconstruction.md (24 frames of 256², or 28 that walk; masks and labels of noise
0.3, clothes that move), takes copies whose poses, normals, camera or template are off, and reconstructs each twice: poses
taken as exact (where the camera is), and refined. A row for each: distance from the truth by compare.py's measure,
openings, and, where the camera is exact, errors of the joints before and after, mean / 95th percentile. --only takes the
cases whose names hold a TEXT. Residuals are those of the program's own report: median / largest of the frames.
Needs: pip install numpy scipy libigl meshio pillow
"""
import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile

from outfit_data import processor_seconds

TURN, WALK = ["turn_a_96.json", "--stride", "4", "--frames", "24"], ["turn_walk_84.json", "--stride", "3", "--frames", "28"]
CAPTURES = {
    "sweater": ("o0_clean", TURN, 0.01, 77, "c1_trousers_sweater_solid"),
    "walking": ("o0_clean", WALK, 0.004, 11, "c1_trousers_sweater_solid"),
    "suit": ("o0_clean_suit", TURN, 0.01, 5, "c4_suit_solid"),
    "dress": ("o0_clean_dress", TURN, 0.01, 6, "c3_dress_solid"),
}
OFF = ["--degrees", "3", "--mm", "9"]
LESS = ["--degrees", "2", "--mm", "6"]
# Name, capture, how poses, normals and camera are off, how the template is.
CASES = [
    ("stated as exact", "sweater", ["--degrees", "0"], None),
    *((f"{c}, stated as exact", c, ["--degrees", "0"], None) for c in ("walking", "suit", "dress")),
    ("a forearm, 40° in frames 8 to 12", "sweater", ["--joint", "LeftForeArm", "40", "8-12"], None),
    ("1°, 3 mm", "sweater", ["--degrees", "1", "--mm", "3"], None),
    *((f"3°, 9 mm, seed {s}", "sweater", [*OFF, "--seed", s], None) for s in "12"),
    *((f"3°, 9 mm over 8 frames, seed {s}", "sweater", [*OFF, "--correlation", "8", "--seed", s], None) for s in "12"),
    ("6°, 18 mm", "sweater", ["--degrees", "6", "--mm", "18"], None),
    ("normals 12°", "sweater", ["--normals", "12"], None),
    ("3°, 9 mm; normals 12°", "sweater", [*OFF, "--normals", "12"], None),
    *((f"{c}, 3°, 9 mm", c, OFF, None) for c in ("walking", "suit", "dress")),
    ("2°, 6 mm", "sweater", LESS, None),
    *((f"2°, 6 mm; camera, seed {s}", "sweater", [*LESS, "--camera", "1", "--seed", s], None) for s in "123"),
    *((f"2°, 6 mm; shape, seed {s}", "sweater", LESS, s) for s in "123"),
    *((f"2°, 6 mm; camera, seed 2; shape, seed {s}", "sweater", [*LESS, "--camera", "1", "--seed", "2"], s) for s in "123"),
    *((f"{c}, 3°, 9 mm; camera", c, [*OFF, "--camera", "1"], None) for c in ("walking", "suit", "dress")),
]


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("ifg"), a.add_argument("out"), a.add_argument("--shared", default="../shared")
    a.add_argument("--only", nargs="*", default=[""])
    a = a.parse_args()
    sys.path.insert(0, f"{a.shared}/tools")
    import numpy as np
    from compare import load, one_way
    from render_sequence import skin_mats

    here, body = os.path.dirname(os.path.abspath(__file__)), f"{a.shared}/data/body_a"
    skeleton = json.load(open(f"{body}/skeleton.json"))["joints"]
    heads, parents = np.array([j["head"] for j in skeleton]), [j["parent"] for j in skeleton]

    def joints(path):
        return np.array([skin_mats(heads, parents, frame)[2] for frame in json.load(open(path))["frames"]])

    def off(path, truth):
        """Mean and 95th percentile of the errors of joints, in mm."""
        errors = 1e3 * np.linalg.norm(joints(path) - truth, axis=2)
        return f"{errors.mean():.1f} / {np.percentile(errors, 95):.1f}"

    def spread(residual, said):
        """Median and largest of the frames' residuals."""
        values = [frame["residual"][residual] for frame in said["surface"]["quality"]["frames"]]
        return f"{np.median(values):.1f} / {max(values):.1f}"

    python = [sys.executable]
    with tempfile.TemporaryDirectory() as scratch, open(a.out, "w", newline="") as file:
        writer = None
        for number, (name, capture, noise, shape) in enumerate(CASES):
            if not any(text in name for text in a.only):
                continue
            outfit, sequence, motion, seed, reference = CAPTURES[capture]
            exact, copy, template = f"{scratch}/{capture}", f"{scratch}/case{number}", body
            if not os.path.exists(exact):
                render = [f"{a.shared}/tools/render_sequence.py", "--body", body, "--outfit", outfit, "--out", exact]
                render += ["--seq", f"{a.shared}/data/sequences/{sequence[0]}", *sequence[1:], "--size", "256"]
                render += ["--label-noise", "0.3", "--mask-noise", "0.3", "--nonrigid", str(motion), "--seed", str(seed)]
                subprocess.run(python + render, check=True, stdout=subprocess.DEVNULL)
            subprocess.run([*python, f"{here}/noisy_capture.py", exact, copy, *noise], check=True)
            if shape:
                template = f"{scratch}/shape{number}"
                command = [*python, f"{here}/noisy_template.py", body, template, "--seed", shape]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            true = joints(f"{exact}/meta.json")
            runs = ["exact", "refined"]
            if "--camera" in noise:
                runs = ["refined"]
            elif noise[0] in ("--normals", "--joint") or noise[1] == "0":
                runs = ["exact"]  # the poses are, and stated so
            for poses in runs:
                out = f"{scratch}/out{number}{poses}"
                command = [a.ifg, "--threads", "1", "reconstruct", copy, "--body", template, "--out", out, "--json"]
                command += ["--pose-noise", "0,0"] if poses == "exact" else []
                before = processor_seconds()
                run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True)
                seconds, said = processor_seconds() - before, json.loads(run.stdout)
                clothed = f"{out}/clothed/case{number}"
                mesh, truth = load(f"{clothed}/canonical.ply"), load(f"{a.shared}/data/clothed/{reference}.ply")
                rng = np.random.default_rng(0)
                there, back = (one_way(*pair, 60000, rng)["mean"] for pair in ((mesh, truth), (truth, mesh)))
                told, doubts = f"{clothed}/poses.json", said["surface"]["quality"]["doubts"]
                row = {
                    "case": name, "poses": poses, "there_mm": f"{1e3 * there:.2f}", "back_mm": f"{1e3 * back:.2f}",
                    "mean_mm": f"{500 * (there + back):.2f}",
                    "openings": " ".join(str(g["openings"]) for g in said["garments"]),
                    "missing": " ".join(said["missing"]), "processor_s": f"{seconds:.1f}",
                    "silhouettes_mm": spread("silhouette_mm", said), "normals_degrees": spread("normal_degrees", said),
                    "doubted_frames": len({doubt["frame"] for doubt in doubts}),
                    "doubted_joints": " ".join(sorted({doubt["joint"] for doubt in doubts if doubt["joint"]})),
                    "joints_before_mm": "" if "--camera" in noise else off(f"{copy}/meta.json", true),
                    "joints_after_mm": off(told, true) if os.path.exists(told) and "--camera" not in noise else "",
                }
                if writer is None:
                    writer = csv.DictWriter(file, row.keys())
                    writer.writeheader()
                writer.writerow(row)
                file.flush()
                print(*row.values(), sep="; ", flush=True)


if __name__ == "__main__":
    main()
