#!/usr/bin/env python3
"""Reads meshes that `ifg` wrote with other people's programs, and compares what they see.

    benches/foreign_clients.py FILE.ply FILE.obj FILE.glb ...

Prints a row for each file and client: vertices, triangles, and the largest difference of a position
from what meshio (PLY, OBJ) or trimesh (GLB) reads, in metres. Clients that are not installed are
named. Exit code 1 if anything differs by more than the reader's own rounding: some read the text of
OBJ files as single precision.
"""

import pathlib
import sys

import numpy as np


def with_meshio(path):
    import meshio

    mesh = meshio.read(path)
    faces = [cells.data for cells in mesh.cells if cells.type == "triangle"]
    return mesh.points, np.concatenate(faces)


def with_trimesh(path):
    import trimesh

    if path.suffix == ".glb":
        mesh = trimesh.load(path, process=False).to_geometry()
    else:
        mesh = trimesh.load(path, process=False, maintain_order=True)
    return mesh.vertices, mesh.faces


def with_open3d(path):
    import open3d

    mesh = open3d.io.read_triangle_mesh(str(path))
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def with_pymeshlab(path):
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix()


def with_blender(path):
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.suffix == ".ply":
        bpy.ops.wm.ply_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    elif path.suffix == ".obj":
        bpy.ops.wm.obj_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    else:
        bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=False)
    (thing,) = (thing for thing in bpy.data.objects if thing.type == "MESH")
    mesh, matrix = thing.data, np.array(thing.matrix_world)
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3).astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
    if path.suffix == ".glb":  # Blender turns y up to z up
        points = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
    mesh.calc_loop_triangles()
    faces = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", faces)
    return points, faces.reshape(-1, 3)


CLIENTS = {
    "meshio": (with_meshio, {".ply", ".obj"}),
    "trimesh": (with_trimesh, {".ply", ".obj", ".glb"}),
    "Open3D": (with_open3d, {".ply", ".obj", ".glb"}),
    "PyMeshLab": (with_pymeshlab, {".ply", ".obj"}),
    "Blender": (with_blender, {".ply", ".obj", ".glb"}),
}


def corners(points, faces):
    """Positions of all corners, shape (m, 3, 3): clients may split and merge vertices."""
    return np.asarray(points, dtype=float)[np.asarray(faces)]


def main(files):
    is_equal, missing = True, set()
    for path in map(pathlib.Path, files):
        first = None
        for name, (read, kinds) in CLIENTS.items():
            if path.suffix not in kinds or name in missing:
                continue
            try:
                points, faces = read(path)
            except ImportError:
                missing.add(name)
                continue
            found = corners(points, faces)
            if first is None:
                first = found
            same = found.shape == first.shape
            worst = float(np.abs(found - first).max()) if same else np.inf
            rounding = np.abs(first).max() * 2.0**-24 if path.suffix == ".obj" else 0.0
            is_equal &= worst <= rounding
            print(f"{path.name:24} {name:10} {len(points):7} {len(faces):7} {worst:.1e}")
    for name in sorted(missing):
        print(f"skipped: {name} is not installed")
    return 0 if is_equal else 1


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1:]))
