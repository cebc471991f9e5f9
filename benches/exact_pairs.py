"""Intersecting triangle pairs by libigl's exact predicates, and what a correction cost, for the programs beside this file.

A mesh is a pair (vertices in metres, triangles). Coordinates of single precision are counted as they are: they are exact in double precision.
"""
import itertools, sys
import numpy as np

try:
    import igl.predicates as predicates
    import meshio
except ImportError as missing:
    sys.exit(f"{missing}. Install it: pip install libigl meshio numpy")


def load(path):
    """A mesh of a file; exits with a message if it has no triangles."""
    mesh = meshio.read(path)
    triangles = [cells.data for cells in mesh.cells if cells.type == "triangle"]
    if not triangles:
        sys.exit(f"{path}: no triangles")
    return np.ascontiguousarray(mesh.points, float), np.ascontiguousarray(np.concatenate(triangles), np.int64)


def save(path, mesh):
    """Writes a mesh as binary PLY with positions in single precision."""
    meshio.write_points_cells(path, np.asarray(mesh[0], np.float32), [("triangle", np.asarray(mesh[1], np.int32))], binary=True)


def between(meshes):
    """Intersecting pairs of triangles of two different meshes, touching ones included; a vertex that is not finite is an error."""
    for vertices, _ in meshes:
        if not np.isfinite(vertices).all():
            raise ValueError(f"{np.count_nonzero(~np.isfinite(vertices).all(1))} vertices are not finite")
    return sum(len(predicates.find_intersections(*a, *b)[1]) for a, b in itertools.combinations(meshes, 2))


def own(mesh):
    """Intersecting pairs of triangles of one mesh that share no vertex."""
    _, pairs, _ = predicates.find_self_intersections(*mesh)
    first, second = mesh[1][pairs[:, 0]], mesh[1][pairs[:, 1]]
    return int(np.count_nonzero(~(first[:, :, None] == second[:, None, :]).any((1, 2)))) if len(pairs) else 0


def displacement(before, after):
    """Distances of vertices from where they were, in metres."""
    return np.linalg.norm(after[0] - before[0], axis=1)


def strain(before, after):
    """Relative change of length of each edge; edges shorter than 1e-9 m are left out."""
    triangles = before[1]
    edges = np.unique(np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), 1), axis=0)
    rest, now = (np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (before[0], after[0]))
    return now[rest > 1e-9] / rest[rest > 1e-9] - 1
