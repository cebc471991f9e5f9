#!/usr/bin/env python3
"""`ifg fix` on incomplete and untidy bodies, compared with the result on the whole body.

    benches/incomplete_bodies.py --ifg target/release/ifg --data ../shared/data [--out out/bodies] [--only o1 o3 o5]
                                 [--cases headless masked ...] [--markdown TABLE.md]

Makes variants of body_a/body_clean.ply (holes at random, seeded; cut at neck and wrists; faces under the clothes deleted; eyes;
two overlapping halves; inside out; triangles without common vertices) and takes MakeHuman's own base mesh. Prints for each variant and outfit: state, seconds,
and how far the garments' vertices are from the result on the whole body, for vertices that lie over skin that is there, and for those of them
at least 30 mm from what is missing. Needs numpy, scipy, libigl and meshio.
"""
import argparse, json, os, subprocess, sys, time
import igl, meshio, numpy as np
from outfit_data import outfits


def read(path):
    m = meshio.read(path)
    return np.asarray(m.points, float), np.asarray(m.cells_dict["triangle"], np.int64)


def write(path, v, f):
    used = np.zeros(len(v), bool)
    used[f] = True
    number = np.cumsum(used) - 1
    with open(path, "wb") as out:
        out.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
                  b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % (used.sum(), len(f)))
        out.write(v[used].astype("<f4").tobytes())
        row = np.zeros(len(f), [("n", "u1"), ("v", "<i4", 3)])
        row["n"], row["v"] = 3, number[f]
        out.write(row.tobytes())


def ball(radius, center):
    n, m = 16, 10
    v = [[0, 1, 0]] + [[np.sin(np.pi * i / m) * np.cos(2 * np.pi * k / n), np.cos(np.pi * i / m), np.sin(np.pi * i / m) * np.sin(2 * np.pi * k / n)]
                       for i in range(1, m) for k in range(n)] + [[0, -1, 0]]
    at = lambda i, k: 1 + (i - 1) * n + k % n
    f = [[0, at(1, k + 1), at(1, k)] for k in range(n)] + [[len(v) - 1, at(m - 1, k), at(m - 1, k + 1)] for k in range(n)]
    for i in range(1, m - 1):
        for k in range(n):
            f += [[at(i, k), at(i, k + 1), at(i + 1, k)], [at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)]]
    return np.array(v) * radius + center, np.array(f)


def join(*parts):
    base = np.cumsum([0] + [len(v) for v, _ in parts[:-1]])
    return np.vstack([v for v, _ in parts]), np.vstack([f + b for (_, f), b in zip(parts, base)])


def distance(p, v, f):
    return np.sqrt(igl.point_mesh_squared_distance(p, v, f)[0])


def variants(v, f, joints, garments):
    """Name, vertices, faces, and which faces of the whole body are gone."""
    middle = v[f].mean(1)
    none = np.zeros(len(f), bool)

    def cut(gone):
        return v, f[~gone], gone

    def holes(count):
        random, gone = np.random.default_rng(count), none.copy()
        for _ in range(count):
            if random.random() < 0.5:
                gone[random.integers(len(f))] = True
            else:
                gone[(f == random.integers(len(v))).any(1)] = True
        return cut(gone)

    yield "whole", v, f, none
    for count in (1, 40, 400):
        yield f"{count} holes", *holes(count)
    yield "headless", *cut(middle[:, 1] > joints["Neck1"][1])
    wrists = none.copy()
    for side in ("Left", "Right"):
        along = joints[f"{side}Hand"] - joints[f"{side}ForeArm"]
        length = np.linalg.norm(along)
        beyond = (middle - joints[f"{side}Hand"]) @ along / length
        wrists |= (beyond > 0) & (np.linalg.norm(middle - joints[f"{side}Hand"], axis=1) < 0.25)
    yield "cut at the wrists", *cut(wrists)
    # Covered: a garment is near, and not with its hem.
    covered = none.copy()
    for gv, gf in garments:
        d, t, c = igl.point_mesh_squared_distance(middle, gv, gf)
        rim = np.zeros(len(gv), bool)
        rim[igl.boundary_facets(gf)[0] if isinstance(igl.boundary_facets(gf), tuple) else igl.boundary_facets(gf)] = True
        covered |= (d < 0.025**2) & ~rim[gf[t]].any(1)
    yield "masked under the clothes", *cut(covered)
    front = lambda x, y: v[np.hypot(v[:, 0] - x, v[:, 1] - y) < 0.015][:, 2].max()
    eyes = [np.array([x, joints["Head"][1] + 0.06, front(x, joints["Head"][1] + 0.06)]) for x in (-0.03, 0.03)]
    inside, out = [ball(0.012, e - [0, 0, 0.035]) for e in eyes], [ball(0.012, e - [0, 0, 0.008]) for e in eyes]
    yield "eyes inside", *join((v, f), *inside), none
    yield "eyes poking out", *join((v, f), *out), none
    left, right = f[middle[:, 0] > -0.01], f[middle[:, 0] < 0.01]
    yield "two halves", *join((v, left), (v, right)), none
    normals = igl.per_vertex_normals(v, f)
    yield "two halves, 0.2 mm apart", *join((v, left), (v - 2e-4 * normals, right)), none
    yield "inside out", v, f[:, ::-1], none
    yield "loose triangles", v[f].reshape(-1, 3), np.arange(3 * len(f)).reshape(-1, 3), none


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--out", default="out/bodies")
    p.add_argument("--only", nargs="*", default=["o1", "o3", "o5"])
    p.add_argument("--cases", nargs="*")
    p.add_argument("--markdown")
    a = p.parse_args()
    folder = os.path.join(a.data, "body_a")
    v, f = read(os.path.join(folder, "body_clean.ply"))
    joints = {j["name"]: np.array(j["head"]) for j in json.load(open(os.path.join(folder, "skeleton.json")))["joints"]}
    table, bad = [], 0
    for _, name, skin, _, paths in outfits(a.data, ["body_a"], a.only):
        garments = [read(g) for g in paths]
        cases = list(variants(v, f, joints, garments)) + [("MakeHuman's base mesh", None, None, np.zeros(len(f), bool))]
        whole = None
        for case, bv, bf, gone in cases:
            if a.cases and case != "whole" and not any(c in case for c in a.cases):
                continue
            out = os.path.join(a.out, name, case.replace(" ", "_").replace("'", ""))
            os.makedirs(out, exist_ok=True)
            body = os.path.join(folder, "body.ply")
            if bv is not None:
                body = os.path.join(out, "body_variant.ply")
                write(body, bv, bf)
            if case == "whole":
                body = skin
            start = time.time()
            run = subprocess.run([a.ifg, "fix", "--json", "--no-pictures", "--write-unproven", "--body", body, *paths, "--out", out], capture_output=True, text=True)
            seconds = time.time() - start
            try:
                answer = json.loads(run.stdout)
            except json.JSONDecodeError:
                print(f"{name} {case}: exit {run.returncode}\n{run.stderr}")
                bad += 1
                continue
            report = answer["report"]
            after = report["after"]
            pairs, inside = sum(sum(q["pairs"].values()) for q in after["pairs"]), sum(q["vertices_inside"] for q in after["pairs"])
            state = "clean" if run.returncode == 0 else f"{pairs} pairs, {inside} inside"
            bad += run.returncode != 0
            results = [read(os.path.join(out, os.path.basename(g)))[0] for g in paths]
            if case == "whole":
                whole = results
            there, away = [], []
            for (gv, _), mine, other in zip(garments, results, whole):
                moved = np.linalg.norm(mine - other, axis=1) * 1e3
                _, t, _ = igl.point_mesh_squared_distance(other, v, f)
                over = ~gone[t]
                there.append(moved[over])
                if gone.any():
                    far = distance(other, v, f[gone]) > 0.03
                    away.append(moved[over & far])
            there = np.concatenate(there)
            away = np.concatenate(away) if away else there
            say = lambda d: f"{(d <= 1).mean() * 100:.1f} / {np.percentile(d, 99):.2f} / {d.max():.1f}" if len(d) else "–"
            assumed = report["before"].get("body") or {}
            notes = f"{len(assumed.get('holes', []))} holes, {assumed.get('inner_parts', 0)} inner, {assumed.get('own_pairs', 0)} own pairs"
            print(f"{name:16} {case:26} {state:22} {seconds:5.2f} s  there {say(there):24} away {say(away):24} {notes}", flush=True)
            table.append(f"| {name} | {case} | {state} | {seconds:.2f} | {say(there)} | {say(away)} |")
    print(f"{bad} not clean")
    if a.markdown:
        with open(a.markdown, "w", encoding="utf-8") as out:
            print("| outfit | body | state | s | over skin: within 1 mm %, p99, max mm | and 30 mm from what is missing |", "|---|---|---|---|---|---|", *table, sep="\n", file=out)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
