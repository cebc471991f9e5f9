#!/usr/bin/env python3
"""`ifg fix` on the outfits of body_a with their garments decimated: what splitting triangles brings.

    benches/low_poly.py --ifg target/release/ifg --data ../shared/data --out out/low [--shares 0.2 0.1 0.05] [--only o1 o3] [--markdown TABLE.md]

Each garment is decimated to a share of its triangles by libigl (shortest edges first), and each outfit resolved with `split` at "never", "if_left" and
"if_strained". A row sums up the outfits: how many are clean, and of each outfit's worst garment the largest displacement and the strain. Needs numpy, libigl and meshio.
"""
import argparse, json, os, statistics, subprocess, time

import igl, meshio, numpy as np


def decimated(source, target, share):
    mesh = meshio.read(source)
    points, triangles = mesh.points.astype(float), mesh.cells_dict["triangle"].astype(np.int64)
    points, triangles = [a for a in igl.decimate(points, triangles, int(len(triangles) * share)) if isinstance(a, np.ndarray)][:2]
    meshio.write(target, meshio.Mesh(points.astype(np.float32), [("triangle", triangles.astype(np.int32))]))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--out", default="out/low")
    p.add_argument("--shares", type=float, nargs="*", default=[0.2, 0.1, 0.05])
    p.add_argument("--only", nargs="*")
    p.add_argument("--markdown")
    a = p.parse_args()
    body = os.path.join(a.data, "body_a")
    outfits = json.load(open(os.path.join(body, "outfits.json")))
    outfits = {k: v["layers_inner_to_outer"] for k, v in outfits.items() if not a.only or any(k.startswith(o) for o in a.only)}
    rows = []
    for share in a.shares:
        folder = os.path.join(a.out, str(share))
        os.makedirs(folder, exist_ok=True)
        names = sorted({g for layers in outfits.values() for g in layers})
        for name in names:
            decimated(os.path.join(body, "garments", name + ".ply"), os.path.join(folder, name + ".ply"), share)
        for split in ("never", "if_left", "if_strained"):
            clean, left, moved, rms, p99, seconds = 0, 0, [], [], [], []
            for name, layers in outfits.items():
                files = [os.path.join(folder, g + ".ply") for g in layers]
                command = [a.ifg, "fix", "--json", "--body", os.path.join(body, "body_clean.ply"), *files, "--no-pictures", "--write-unproven",
                           "--set", "split=" + split, "--out", os.path.join(folder, split, name)]
                start = time.time()
                run = subprocess.run(command, capture_output=True, text=True)
                seconds.append(time.time() - start)
                if run.returncode > 1:
                    print(name, run.stderr)
                    continue
                report = json.loads(run.stdout)
                report = report.get("report", report)
                pairs = sum(sum(q["pairs"].values()) for q in report["after"]["pairs"])
                clean += run.returncode == 0
                left += pairs
                moved.append(max(l["moved"]["max"] for l in report["layers"]) * 1e3)
                rms.append(max(l["strain"]["rms"] for l in report["layers"]) * 100)
                p99.append(max(l["strain"]["p99"] for l in report["layers"]) * 100)
                print(f"{share} {split:12} {name:22} {'clean' if run.returncode == 0 else 'left'} {pairs:5} {moved[-1]:7.1f} mm {rms[-1]:6.1f} % {seconds[-1]:6.2f} s", flush=True)
            both = lambda v: f"{statistics.median(v):.1f} / {max(v):.1f}"
            rows.append(f"| {share:.0%} | `{split}` | {clean} of {len(outfits)} | {left} | {both(moved)} | {both(rms)} | {both(p99)} | {both(seconds)} |")
    table = "\n".join(["| triangles kept | `split` | clean | pairs left | largest displacement, mm, median / max | strain rms, % | strain p99, % | seconds |",
                       "|---|---|---|---|---|---|---|---|", *rows])
    print(table)
    if a.markdown:
        open(a.markdown, "w").write(table + "\n")


if __name__ == "__main__":
    main()
