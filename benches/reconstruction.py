#!/usr/bin/env python3
"""Reconstruction of rendered captures, judged by other people's code.

    benches/reconstruction.py SHARED OUT.csv [--frames 12,24,48,96] [--noise 0,0.3,1] [--outfits o0_clean,o0_clean_suit]
                              [--size 256] [--sequence turn_a_96] [--keep DIR]

Renders each capture with SHARED/tools/render_sequence.py (mask noise at most 0.3, non-rigid motion of 4 mm), runs the program
`reconstruction_stages` on it (build it before: cargo build --release -p if-benches --example reconstruction_stages), and
compares template, visual hull, surface, canonical mesh and garments with SHARED/data/clothed by compare.py's functions.
A row for each mesh; `label_accuracy` is the share of the canonical surface's vertices whose label is that of the truth's nearest
vertex. The truths are closed: below a skirt a lid spans hem and legs, which is of no layer and bears labels all the same. So
`label_on_layers` leaves out vertices whose nearest one of the truth lies more than 8 mm (a cell of the canonical mesh) off the layer
that it bears the label of, and `left_out` is their share. Needs: pip install numpy scipy libigl meshio
"""
import argparse, csv, json, os, subprocess, sys, tempfile, time
import numpy as np

SCENES = {"o0_clean": "c1_trousers_sweater", "o0_clean_suit": "c4_suit", "o0_clean_dress": "c3_dress"}
LAYERS = {"o0_clean": ["trousers", "sweater"], "o0_clean_suit": ["suit_trousers", "suit_jacket"], "o0_clean_dress": ["dress"]}


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("shared"), a.add_argument("out")
    a.add_argument("--frames", default="12,24,48,96"), a.add_argument("--noise", default="0,0.3,1")
    a.add_argument("--outfits", default="o0_clean,o0_clean_suit"), a.add_argument("--size", type=int, default=256)
    a.add_argument("--sequence", default="turn_a_96"), a.add_argument("--keep")
    a = a.parse_args()
    sys.path.insert(0, os.path.join(a.shared, "tools"))
    import igl, meshio
    from compare import one_way
    from scipy.spatial import cKDTree
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    program = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(root, "target")), "release", "examples", "reconstruction_stages")
    body = os.path.join(a.shared, "data", "body_a")

    def load(path):
        m = meshio.read(path)
        return (m.points.astype(float), m.cells_dict["triangle"].astype(np.int64)), m.point_data

    rows = []
    for outfit in a.outfits.split(","):
        truth, data = load(os.path.join(a.shared, "data", "clothed", SCENES[outfit] + "_solid.ply"))
        known = np.asarray(data["label"]).ravel()
        nearest = cKDTree(truth[0])
        layers = [load(os.path.join(body, "body.ply"))[0]] + [load(os.path.join(body, "garments", n + ".ply"))[0] for n in LAYERS[outfit]]
        off = np.zeros(len(known))
        for k, (v, f) in enumerate(layers):
            mine = known == k + 1
            off[mine] = np.sqrt(igl.point_mesh_squared_distance(np.ascontiguousarray(truth[0][mine]), np.ascontiguousarray(v), f)[0])
        for frames in map(int, a.frames.split(",")):
            for noise in map(float, a.noise.split(",")):
                with tempfile.TemporaryDirectory() as scratch:
                    capture = os.path.join(a.keep or scratch, f"{outfit}_{frames}_{noise}_{a.size}")
                    if not os.path.exists(os.path.join(capture, "meta.json")):
                        subprocess.run([sys.executable, os.path.join(a.shared, "tools", "render_sequence.py"), "--body", body, "--outfit", outfit,
                                        "--seq", os.path.join(a.shared, "data", "sequences", a.sequence + ".json"), "--out", capture, "--size", str(a.size),
                                        "--stride", str(96 // frames), "--frames", str(frames), "--label-noise", str(noise),
                                        "--mask-noise", str(min(noise, 0.3)), "--nonrigid", "0.004"], check=True, stdout=subprocess.DEVNULL)
                    out, start = os.path.join(scratch, "out"), time.time()
                    subprocess.run([program, capture, body, out], check=True, stdout=subprocess.DEVNULL)
                    seconds = time.time() - start
                    for name in ("template", "hull", "surface", "canonical"):
                        mesh, data = load(os.path.join(out, name + ".ply"))
                        rng = np.random.default_rng(0)
                        there, back = one_way(mesh, truth, 100000, rng), one_way(truth, mesh, 100000, rng)
                        row = {"outfit": outfit, "frames": frames, "noise": noise, "size": a.size, "mesh": name,
                               "chamfer_mm": round(500 * (there["mean"] + back["mean"]), 2), "p95_mm": round(1000 * max(there["p95"], back["p95"]), 2),
                               "max_mm": round(1000 * max(there["max"], back["max"]), 1),
                               "normal_deg": round((there["normal_deg_mean"] + back["normal_deg_mean"]) / 2, 2), "seconds_all": round(seconds, 1)}
                        if "label" in data:
                            place = nearest.query(mesh[0])[1]
                            ours, theirs, on = np.asarray(data["label"]).ravel(), known[place], off[place] <= 0.008
                            row["label_accuracy"] = round(float((ours == theirs).mean()), 4)
                            row["label_on_layers"] = round(float((ours == theirs)[on].mean()), 4)
                            row["left_out"] = round(float((~on).mean()), 4)
                            row["label_recall"] = json.dumps({int(k): round(float((ours == theirs)[theirs == k].mean()), 4) for k in np.unique(known) if k > 0})
                        rows.append(row)
                        print(row, flush=True)
    with open(a.out, "w", newline="") as f:
        names = list(dict.fromkeys(k for r in rows for k in r))
        w = csv.DictWriter(f, names)
        w.writeheader(), w.writerows(rows)


if __name__ == "__main__":
    main()
