#!/usr/bin/env python3
"""Clean-up against references and against other people's tools.

    benches/cleanup.py [--data ../shared/data] [--out OUT] [--only PART_OF_NAME] [--samples 100000] [--no-peers]

Runs the program `cleanup` of if-benches (build it first: cargo build --release -p if-benches --example
cleanup) on clothed/*_raw.ply and *_raw_hard.ply against *_ref.ply, and on scans/*_damaged.ply against the originals, and trimesh, pymeshlab and open3d on
the same files. Judged by ../shared/tools/compare.py. Writes OUT/cleanup.csv and prints it.

Needs: pip install numpy scipy libigl meshio trimesh pymeshlab open3d
"""
import argparse, csv, json, os, subprocess, sys, tempfile, time
import numpy as np

a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
a.add_argument("--data", default="../shared/data"), a.add_argument("--out", default="out/cleanup"), a.add_argument("--only", default="")
a.add_argument("--samples", type=int, default=100000), a.add_argument("--no-peers", action="store_true")
a = a.parse_args()
sys.path.insert(0, os.path.join(a.data, "../tools"))
import igl  # noqa: E402
from compare import load, one_way, own_pairs, sample, topology, unique_edges  # noqa: E402

TARGET = os.environ.get("CARGO_TARGET_DIR", "target")
OURS = os.path.join(TARGET, "release/examples/cleanup")


def write(path, V, F):
    import meshio
    meshio.write_points_cells(path, np.asarray(V, np.float32), [("triangle", np.asarray(F, np.int32))])


def ours(path, out, *options):
    r = subprocess.run([OURS, path, out, *options], capture_output=True, text=True)
    if r.returncode:
        raise RuntimeError(r.stderr)
    d = json.loads(r.stdout)
    return load(out), d["milliseconds"]["median"], d["report"]


# Each peer: isolated parts, then holes, with its own tools; a variant with its own smoothing of the whole surface.
def trimesh_(V, F, smooth):
    import trimesh
    m = trimesh.Trimesh(V, F, process=False)
    parts = trimesh.graph.connected_component_labels(m.face_adjacency, node_count=len(m.faces))
    area = np.bincount(parts, weights=m.area_faces)
    m.update_faces(area[parts] >= 0.01 * area.max()), m.remove_unreferenced_vertices()
    trimesh.repair.fill_holes(m)
    if smooth:
        trimesh.smoothing.filter_taubin(m, iterations=10)
    return np.array(m.vertices), np.array(m.faces)


def pymeshlab_(V, F, smooth, hole):
    import pymeshlab as ml
    s = ml.MeshSet()
    s.add_mesh(ml.Mesh(V, F))
    s.meshing_remove_connected_component_by_diameter(mincomponentdiag=ml.PercentageValue(20))
    s.meshing_remove_unreferenced_vertices(), s.meshing_repair_non_manifold_edges(), s.meshing_repair_non_manifold_vertices()
    s.meshing_close_holes(maxholesize=hole, newfaceselected=False)
    if smooth and smooth.startswith("laplacian"):
        s.apply_coord_laplacian_smoothing(stepsmoothnum=3 if smooth == "laplacian 3" else 1)
    elif smooth:
        s.apply_coord_taubin_smoothing(stepsmoothnum=10)
    m = s.current_mesh()
    return m.vertex_matrix(), m.face_matrix()


def open3d_(V, F, smooth, size):
    import open3d as o3d
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    m = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(V), o3d.utility.Vector3iVector(F))
    part, _, area = m.cluster_connected_triangles()
    part, area = np.asarray(part), np.asarray(area)
    m.remove_triangles_by_mask(area[part] < 0.01 * area.max()), m.remove_unreferenced_vertices()
    t = o3d.t.geometry.TriangleMesh.from_legacy(m).fill_holes(size)
    m = t.to_legacy()
    if smooth:
        m = m.filter_smooth_taubin(10)
    return np.asarray(m.vertices), np.asarray(m.triangles)


def peers(V, F, garment):
    for smooth in (False, True):
        yield "trimesh" + (" + taubin" if smooth else ""), lambda s=smooth: trimesh_(V, F, s)
    for hole in (30, 60, 100) if garment else (100,):
        for smooth in (False, "laplacian", "laplacian 3", "taubin"):
            yield f"pymeshlab {hole}" + (f" + {smooth}" if smooth else ""), lambda s=smooth, h=hole: pymeshlab_(V, F, s, h)
    for size in (0.2, 0.6) if garment else (10.0,):
        for smooth in (False, True):
            yield f"open3d {size}" + (" + taubin" if smooth else ""), lambda s=smooth, z=size: open3d_(V, F, s, z)


def beyond(mesh, reference, rng):
    """Share of the reference whose nearest place on the mesh lies on its rim, and its part of the mean distance from the reference, in mm."""
    V, F = mesh
    E, count = unique_edges(F)
    rim = E[count == 1]
    if not len(rim):
        return 0.0, 0.0
    P, _ = sample(*reference, a.samples, rng)
    d2, _, Q = igl.point_mesh_squared_distance(P, V, F)
    on = igl.point_mesh_squared_distance(Q, V, np.c_[rim, rim[:, 1]])[0] < 1e-12
    return round(float(on.mean()), 5), round(1e3 * float(np.sqrt(d2)[on].sum()) / len(P), 4)


def judge(name, tool, mesh, reference, ms, before, extra=""):
    V, F = np.asarray(mesh[0], float), np.asarray(mesh[1]).astype(np.int64)
    rng = np.random.default_rng(0)
    there, back, t = one_way((V, F), reference, a.samples, rng), one_way(reference, (V, F), a.samples, rng), topology(V, F)
    share, part = beyond((V, F), reference, rng)
    mm = lambda x: round(1e3 * x, 4)
    return {"mesh": name, "tool": tool, "ms": round(ms, 1), "components": t["components"], "openings": t["boundary_loops"],
            "nm_edges": t["non_manifold_edges"], "nm_vertices": t["non_manifold_vertices"], "own_pairs_added": t["own_pairs"] - before,
            "chamfer_mm": mm((there["mean"] + back["mean"]) / 2), "to_reference_mm": mm(there["mean"]), "from_reference_mm": mm(back["mean"]),
            "beyond_share": share, "beyond_mm": part,
            "max_mm": mm(max(there["max"], back["max"])), "normal_deg": round((there["normal_deg_mean"] + back["normal_deg_mean"]) / 2, 3), "note": extra}


COUNT = {"sweater": 4, "trousers": 3, "suit_trousers": 3, "blouse": 4, "pencil_skirt": 2, "dress": 4, "suit_jacket": 4}


def jobs():
    folder = os.path.join(a.data, "clothed")
    for f in sorted(os.listdir(folder)):
        if f.endswith("_raw.ply") or f.endswith("_raw_hard.ply"):
            stem = f.replace("_raw_hard.ply", "").replace("_raw.ply", "")
            scene = next(s for s in ("c1_trousers_sweater", "c2_skirt_blouse", "c3_dress", "c4_suit") if stem.startswith(s))
            scan = os.path.join(folder, scene + ("_scan_hard.ply" if "hard" in f else "_scan.ply"))
            count = f"openings={COUNT[stem[len(scene) + 1:]]}"
            solid = os.path.join(folder, scene + "_solid.ply")
            hard = ["components=1"] if "hard" in f else []
            yield os.path.join(folder, f), os.path.join(folder, stem + "_ref.ply"), True, [
                ("ours, by shape", hard), ("ours, by count", hard + [count]), ("ours, by scan", hard + [f"body={scan}"]),
                ("ours, by count + surface 2", hard + [count, "surface=2"]), ("ours, by count + surface 4", hard + [count, "surface=4"]),
                ("ours, by count, rims left", hard + [count, "smooth=false"]),
                ("ours, by count, rims left + surface 2", hard + [count, "smooth=false", "surface=2"]),
                ("ours, body known", hard + [count, f"body={solid}", f"field={solid}"])]
    folder = os.path.join(a.data, "scans")
    for f in sorted(os.listdir(folder)):
        if f.endswith("_damaged.ply"):
            open_ = 1 if f.startswith("demosthenes") else 0
            yield os.path.join(folder, f), os.path.join(folder, f.replace("_damaged", "")), False, [
                ("ours, by count", [f"openings={open_}"]), ("ours, by count + surface 2", [f"openings={open_}", "surface=2"])]


rows = []
os.makedirs(a.out, exist_ok=True)
for path, ref, garment, ways in jobs():
    name = os.path.basename(path)[:-4]
    if a.only not in name:
        continue
    raw, reference = load(path), load(ref)
    raw, reference = [(np.asarray(V, float), np.asarray(F).astype(np.int64)) for V, F in (raw, reference)]
    before = own_pairs(raw)
    rows.append(judge(name, "reference", reference, reference, 0, 0))
    rows.append(judge(name, "raw", raw, reference, 0, before))
    for tool, options in ways:
        out = os.path.join(a.out, f"{name}__{tool.replace('ours, ', '').replace(' ', '_').replace('+', 'and')}.ply")
        mesh, ms, report = ours(path, out, *options)
        h = report["holes"]
        note = f"dropped {len(report['components']['dropped'])}, filled {len(h['filled'])}, left {len(h['left'])}, held back {report['smoothing']['held_back']}"
        rows.append(judge(name, tool, mesh, reference, ms, before, note))
    for tool, run in [] if a.no_peers else peers(*raw, garment):
        start = time.perf_counter()
        try:
            mesh = run()
            ms = 1e3 * (time.perf_counter() - start)
            rows.append(judge(name, tool, mesh, reference, ms, before))
        except Exception as e:  # a peer that fails is a row too
            rows.append({"mesh": name, "tool": tool, "note": f"fails: {e}"})
    print("\n".join(f"{r['mesh']:42} {r['tool']:28} ms {r.get('ms', 0):8} parts {r.get('components')} loops {r.get('openings')} nm {r.get('nm_edges')}/{r.get('nm_vertices')} "
                    f"own +{r.get('own_pairs_added')} chamfer {r.get('chamfer_mm')} max {r.get('max_mm')} {r.get('note', '')}" for r in rows if r["mesh"] == name), flush=True)
with open(os.path.join(a.out, "cleanup.csv"), "w", newline="") as f:
    w = csv.DictWriter(f, fieldnames=list(rows[0]))
    w.writeheader(), w.writerows(rows)
