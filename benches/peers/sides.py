#!/usr/bin/env python3
"""What free sight says of the vertices that the referee's side test counts.

    python benches/peers/sides.py BODY INNER OUTER [--rays 512]

The referee (../shared/tools/referee.py) takes the side of a vertex of OUTER from the pseudo-normal of the nearest triangle of INNER,
which points the other way under a folded collar. This script repeats that test, and from each vertex that it counts sends rays
everywhere: the share that meets neither BODY nor INNER. A vertex between the two sees the open only through the openings of INNER.
For comparison it does the same with points 5 mm under INNER's triangles, towards the body. Needs numpy, scipy, libigl, meshio, trimesh, embreex.
"""
import argparse, os, sys
import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../shared/tools"))
from referee import load, side  # noqa: E402

a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
a.add_argument("body"), a.add_argument("inner"), a.add_argument("outer"), a.add_argument("--rays", type=int, default=512)
a = a.parse_args()
body, inner, outer = load(a.body), load(a.inner), load(a.outer)
scene = RayMeshIntersector(trimesh.util.concatenate([trimesh.Trimesh(V, F, process=False) for V, F in (body, inner)]))
k = np.arange(a.rays) + 0.5
polar, turn = np.arccos(1 - 2 * k / a.rays), np.pi * (1 + 5**0.5) * k
ways = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], 1)


def free_share(points):
    hits = scene.intersects_any(np.repeat(points, a.rays, 0), np.tile(ways, (len(points), 1)))
    return 1 - hits.reshape(len(points), a.rays).mean(1)


def told(name, share):
    q = np.percentile(share, [0, 5, 50, 95]) if len(share) else [float("nan")] * 4
    print(f"{name}: {len(share)} points; free share of all directions: least {q[0]:.3f}, 5 % {q[1]:.3f}, median {q[2]:.3f}, 95 % {q[3]:.3f}")


distance, ok = side(outer[0], *inner)
counted = ok & (distance < 0)
told("counted by pseudo-normals", free_share(outer[0][counted]))
told("all other vertices of the outer layer", free_share(outer[0][~counted]))
V, F = inner
middle, normal = V[F].mean(1), np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
under = middle - 0.005 * normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
told("5 mm under the inner layer", free_share(under))
if counted.any():
    P = outer[0][counted]
    print(f"the counted lie in x {P[:,0].min():.3f} to {P[:,0].max():.3f}, y {P[:,1].min():.3f} to {P[:,1].max():.3f}, z {P[:,2].min():.3f} to {P[:,2].max():.3f} m; "
          f"largest depth by pseudo-normals {-1e3 * distance[counted].min():.1f} mm")
