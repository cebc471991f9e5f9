"""Resolves an outfit by the Blender add-on, without a window, and writes what Blender then shows.

    python benches/blender_outfit.py BODY.ply GARMENT.ply ... --out DIR

Needs a Python with bpy, meshio and ifgarments. The files in DIR have the positions of the result as
float32; judge them with any tool.
"""

import argparse
import pathlib
import sys
import time

import bpy
import meshio
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "crates/if-python/blender"))
import if_garments  # noqa: E402

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
parser.add_argument("body", type=pathlib.Path)
parser.add_argument("garments", nargs="+", type=pathlib.Path, help="inner to outer")
parser.add_argument("--out", required=True, type=pathlib.Path)
args = parser.parse_args()


def thing(path):
    """The mesh of a file as an object, z up."""
    read = meshio.read(path)
    x, y, z = read.points.T
    mesh = bpy.data.meshes.new(path.stem)
    faces = np.concatenate([cells.data for cells in read.cells if cells.type == "triangle"])
    mesh.from_pydata(np.stack([x, -z, y], axis=1).tolist(), [], faces.tolist())
    found = bpy.data.objects.new(path.stem, mesh)
    bpy.context.collection.objects.link(found)
    return found


def shown(thing):
    """Positions that Blender shows, y up, and triangles."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    x, y, z = points.reshape(-1, 3).T
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return np.stack([x, z, -y], axis=1), triangles.reshape(-1, 3)


bpy.ops.wm.read_factory_settings(use_empty=True)
if_garments.register()
settings = bpy.context.scene.if_garments
settings.body = thing(args.body)
for path in args.garments:
    settings.garments.add().mesh = thing(path)
bpy.ops.if_garments.check()
start = time.perf_counter()
bpy.ops.if_garments.resolve()
print(f"resolved in {time.perf_counter() - start:.1f} s: {settings.state}")
args.out.mkdir(parents=True, exist_ok=True)
for item in settings.garments:
    points, faces = shown(item.mesh)
    file = args.out / f"{item.mesh.name}.ply"
    meshio.write(file, meshio.Mesh(points, [("triangle", faces)]))
    print(file)
if_garments.unregister()
