"""Opens motion.glb of `ifg animate --gltf` in Blender, and compares each frame with the point caches.

    python benches/animated_gltf.py FOLDER

FOLDER is the output of the command. Needs a Python with bpy and numpy. Prints for each layer the
number of vertices and frames, and the largest difference of a coordinate from NAME.pc2, in metres;
exit code 1 if one differs.
"""

import pathlib
import sys

import bpy
import numpy as np

folder = pathlib.Path(sys.argv[1])


def cache(path):
    """Positions, frames × vertices × 3, of a point cache."""
    data = path.read_bytes()
    points, frames = np.frombuffer(data, "<i4", 1, 16)[0], np.frombuffer(data, "<i4", 1, 28)[0]
    return np.frombuffer(data, "<f4", offset=32).reshape(frames, points, 3)


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 24
bpy.ops.import_scene.gltf(filepath=str(folder / "motion.glb"))
scene = bpy.context.scene
worst = 0.0
for thing in (o for o in bpy.data.objects if o.type == "MESH"):
    expected = cache(folder / f"{thing.name}.pc2")
    keys = thing.data.shape_keys
    curves = keys.animation_data.action.fcurves if keys and keys.animation_data else []
    times = sorted({point.co[0] for curve in curves for point in curve.keyframe_points}) or [0.0]
    assert len(times) == len(expected), f"{thing.name}: {len(times)} times, {len(expected)} frames"
    largest = 0.0
    for time, frame in zip(times, expected):
        whole = int(np.floor(time))
        scene.frame_set(whole, subframe=time - whole)
        mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        shown = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", shown)
        x, y, z = shown.reshape(-1, 3).T
        largest = max(largest, float(np.abs(np.stack([x, z, -y], axis=1) - frame).max()))
    print(f"{thing.name}: {expected.shape[1]} vertices, {len(times)} frames, difference {largest:g} m")
    worst = max(worst, largest)
sys.exit(worst != 0.0)
