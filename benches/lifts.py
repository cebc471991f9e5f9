#!/usr/bin/env python3
"""How far an inner garment would have to be lifted to lie below an outer one: a twin of `obstacle.rs` in Python.

    benches/lifts.py [--data ../shared/data] [--above 0.03] body_a [body_b …]      # all ordered pairs of the body's garments
    benches/lifts.py --outfits body_c                                              # the pairs of its outfits.json, in order

Works on the garments as they came, without closed layers: normals are those of the mesh. Needs numpy, scipy, meshio, libigl
and trimesh.
"""
import argparse
import functools
import itertools
import json
import os

import igl
import meshio
import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

MOST = 64


def read(path):
    """Points and triangles, seams sewn."""
    mesh = meshio.read(path)
    points, index = np.unique(np.round(np.asarray(mesh.points, float), 7), axis=0, return_inverse=True)
    return points, index.ravel()[mesh.cells_dict["triangle"].astype(int)]


def edges(triangles):
    return np.unique(np.sort(np.vstack([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), 1), axis=0)


@functools.cache
def body(path):
    points, triangles = read(path)
    a, b = edges(triangles).T
    length = np.linalg.norm(points[a] - points[b], axis=1)
    return points, triangles, coo_matrix((length, (a, b)), (len(points),) * 2).tocsr()


@functools.cache
def bridges(path, skin):
    """Rows of: middle, junction, inward normal, and for both ends the end and its nearest point of the skin."""
    points, triangles = read(path)
    b_points, b_triangles, ways = body(skin)
    _, nearest, feet = igl.point_mesh_squared_distance(points, b_points, b_triangles)[:3]
    normals = igl.per_vertex_normals(points, triangles)
    inner_side = np.einsum("ij,ij->i", feet - points, normals) < 0
    v, w = edges(triangles).T
    apart = np.linalg.norm(feet[v] - feet[w], axis=1) > 2 * np.linalg.norm(points[v] - points[w], axis=1) + 0.02
    spans = np.flatnonzero(apart & inner_side[v] & inner_side[w])
    if not len(spans):
        return np.zeros((0, 7, 3))
    spans = spans[:: -(-len(spans) // MOST)]
    v, w = v[spans], w[spans]
    from_, to = b_triangles[nearest[v], 0], b_triangles[nearest[w], 0]
    distance, before = dijkstra(ways, False, from_, return_predecessors=True)
    rows = []
    for k in range(len(spans)):
        length, at = distance[k, to[k]], to[k]
        if not np.isfinite(length):
            continue
        while distance[k, at] > length / 2:
            at = before[k, at]
        inward = -(normals[v[k]] + normals[w[k]])
        inward /= np.linalg.norm(inward)
        rows.append([(points[v[k]] + points[w[k]]) / 2, b_points[at], inward, points[v[k]], feet[v[k]], points[w[k]], feet[w[k]]])
    return np.array(rows).reshape(-1, 7, 3)


def lift(inner, outer, skin):
    """The largest lift of a bridge, and where."""
    rows = bridges(inner, skin)
    if not len(rows):
        return 0.0, None
    middle, junction, inward, *ends = rows.transpose(1, 0, 2)
    mesh = trimesh.Trimesh(*read(outer), process=False)

    def first_hit(start, direction, limit):
        found = np.full(len(start), np.inf)
        at, ray, _ = mesh.ray.intersects_location(start, direction, multiple_hits=True)
        for p, r in zip(at, ray):
            d = np.linalg.norm(p - start[r])
            if d <= limit[r]:
                found[r] = min(found[r], d)
        return found

    def along(start, end):
        length = np.linalg.norm(end - start, axis=1)
        return first_hit(start, (end - start) / np.maximum(length, 1e-9)[:, None], length)

    up = along(middle, junction)
    inwards = first_hit(middle, inward, np.ones(len(middle)))
    covered = np.isfinite(along(ends[0], ends[1])) & np.isfinite(along(ends[2], ends[3]))
    lifts = np.where(np.isfinite(up) & covered, np.minimum(up, inwards), 0)
    return lifts.max(), middle[lifts.argmax()]


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("bodies", nargs="+")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--outfits", action="store_true")
    p.add_argument("--above", type=float, default=0.03, help="print lifts above this, in metres")
    a = p.parse_args()
    for name in a.bodies:
        folder = os.path.join(a.data, name)
        if a.outfits:
            with open(os.path.join(folder, "outfits.json")) as file:
                layers = [o.get("layers_inner_to_outer", []) for o in json.load(file).values() if isinstance(o, dict)]
            pairs = [pair for o in layers for pair in itertools.combinations(o, 2)]
        else:
            names = sorted(n[:-4] for n in os.listdir(os.path.join(folder, "garments")) if n.endswith(".ply"))
            pairs = list(itertools.permutations(names, 2))
        count = 0
        for inner, outer in pairs:
            files = [os.path.join(folder, "garments", f"{g}.ply") for g in (inner, outer)]
            height, at = lift(*files, os.path.join(folder, "body_clean.ply"))
            count += height > 0.2
            if height > a.above:
                print(f"{name}: {inner} under {outer}: {1e2 * height:.0f} cm at {np.round(at, 2)}", flush=True)
        print(f"{name}: {count} of {len(pairs)} pairs above 20 cm")


if __name__ == "__main__":
    main()
