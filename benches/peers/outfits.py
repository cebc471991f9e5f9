#!/usr/bin/env python3
"""Other people's ways to part layered garments, beside `ifg fix`, on the same outfits in one run.

    benches/peers/outfits.py [--ifg target/release/ifg] [--data ../shared/data] [--only demo o1 o2 o5] [--out out/peers] [--methods NAME ...]

| method | what it does |
|---|---|
| shrinkwrap | Blender: a shrinkwrap modifier for each lower layer, nearest surface point, outside, offset 1 mm, for vertices within 3 cm |
| blender_cloth | Blender: 100 frames of cloth with collisions and self-collisions over the lower layers as this method left them, all else as Blender presets it |
| blender_cloth_close | the same without gravity, all distances 1 mm, collision quality 10 |
| laplacian | vertices up to 3 cm under a lower layer go to 1 mm above it, the others follow by Laplacian smoothing; up to 50 rounds |
| ours | `ifg fix` |

Prints a Markdown table: pairs of triangles of two layers (the body is one) and of a garment with itself by libigl's exact predicates, displacement,
edge strain, and seconds of processor (ours with reading and writing). --out has the meshes. Needs: pip install bpy libigl meshio numpy scipy; a method whose
package is missing is left out with a message. For Newton see benches/simulator_start.py.
"""
import argparse, os, sys
import numpy as np

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from exact_pairs import between, displacement, load, own, save, strain  # noqa: E402
from outfit_data import processor_seconds, resolved  # noqa: E402

GAP = 1e-3  # metres
FRAMES = 100
ROUNDS = 50
REACH = 0.03  # metres; a vertex deeper under a layer is taken as not under it


def above(points, layer):
    """Signed distances to an open or closed layer by pseudo-normals, nearest points, their normals, and whether the sign is certain: not nearest to the boundary."""
    import igl

    vertices, triangles = layer
    distance, face, nearest, normal = igl.signed_distance(points, vertices, triangles, igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL)[:4]
    edges = np.sort(np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]], 1), 2)
    _, index, count = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    boundary = (count == 1)[index.reshape(-1, 3)][face]
    corners = (vertices[triangles[face, k]] for k in range(3))
    weights = igl.barycentric_coordinates(nearest, *map(np.ascontiguousarray, corners))
    return distance, nearest, normal, ~(boundary & (weights < 1e-6)).any(1)


def laplacian(body, garments):
    from scipy.sparse import csr_array, diags_array

    below, done = [body], []
    for vertices, triangles in garments:
        points, n = vertices.copy(), len(vertices)
        i, j = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
        joined = csr_array((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n, n)).astype(bool).astype(float)
        mean = diags_array(1 / np.maximum(joined.sum(1), 1)) @ joined
        for _ in range(ROUNDS):
            push = np.zeros_like(points)
            for layer in below:
                distance, nearest, normal, certain = above(points, layer)
                under = np.flatnonzero(certain & (distance < GAP - 1e-6) & (distance > -REACH))
                wanted = nearest[under] + GAP * normal[under] - points[under]
                farther = np.linalg.norm(wanted, axis=1) > np.linalg.norm(push[under], axis=1)
                push[under[farther]] = wanted[farther]
            pushed = push.any(1, keepdims=True)
            if not pushed.any():
                break
            moved = push
            for _ in range(10):
                moved = np.where(pushed, push, mean @ moved)
            points += moved
        done.append((points, triangles))
        below.append(done[-1])
    return done


class Blender:
    """A scene of Blender, z up."""

    def __init__(self):
        import bpy

        self.bpy = bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene

    def add(self, mesh):
        data = self.bpy.data.meshes.new("layer")
        x, y, z = mesh[0].T
        data.from_pydata(np.stack([x, -z, y], 1).tolist(), [], mesh[1].tolist())
        thing = self.bpy.data.objects.new("layer", data)
        self.scene.collection.objects.link(thing)
        return thing

    def shown(self, thing, triangles):
        data = thing.evaluated_get(self.bpy.context.evaluated_depsgraph_get()).data
        points = np.empty(3 * len(data.vertices), np.float32)
        data.vertices.foreach_get("co", points)
        x, y, z = points.reshape(-1, 3).T.astype(float)
        return np.ascontiguousarray(np.stack([x, z, -y], 1)), triangles


def shrinkwrap(body, garments):
    blender = Blender()
    below, done = [(blender.add(body), body)], []
    for garment in garments:
        thing = blender.add(garment)
        for target, mesh in below:
            modifier = thing.modifiers.new("wrap", "SHRINKWRAP")
            modifier.target, modifier.offset = target, GAP
            modifier.wrap_method, modifier.wrap_mode = "NEAREST_SURFACEPOINT", "OUTSIDE"
            group = thing.vertex_groups.new()
            group.add(np.flatnonzero(np.abs(above(garment[0], mesh)[0]) < REACH).tolist(), 1.0, "REPLACE")
            modifier.vertex_group = group.name
        done.append(blender.shown(thing, garment[1]))
        below.append((thing, done[-1]))
    return done


def blender_cloth(body, garments, close=False):
    done = []
    for k, garment in enumerate(garments):
        blender = Blender()
        for layer in [body, *done[:k]]:
            collision = blender.add(layer)
            collision.modifiers.new("collision", "COLLISION")
            if close:
                collision.collision.thickness_outer = GAP
        thing = blender.add(garment)
        cloth = thing.modifiers.new("cloth", "CLOTH")
        cloth.collision_settings.use_self_collision = True
        if close:
            blender.scene.use_gravity = False
            cloth.collision_settings.collision_quality = 10
            cloth.collision_settings.distance_min = cloth.collision_settings.self_distance_min = GAP
        cloth.point_cache.frame_end = FRAMES + 1
        for frame in range(1, FRAMES + 2):
            blender.scene.frame_set(frame)
        done.append(blender.shown(thing, garment[1]))
    return done


def blender_cloth_close(body, garments):
    return blender_cloth(body, garments, close=True)


METHODS = {f.__name__: f for f in (shrinkwrap, blender_cloth, blender_cloth_close, laplacian)}
HEAD = "| outfit | method | pairs left | own pairs | moved, mean / max, mm | strain rms / max, % | s |"


def row(outfit, method, body, before, after, seconds):
    """A line of the table; metres and shares become millimetres and percent."""
    if not all(np.isfinite(vertices).all() for vertices, _ in after):
        print(f"| {outfit} | {method} | not finite | | | | {seconds:.1f} |", flush=True)
        return
    moved = 1e3 * np.concatenate([displacement(*m) for m in zip(before, after)])
    stretched = 100 * np.abs(np.concatenate([strain(*m) for m in zip(before, after)]))
    print(f"| {outfit} | {method} | {between([body, *after]):,} | {sum(own(g) for g in after):,} | {moved.mean():.1f} / {moved.max():.1f} "
          f"| {np.sqrt((stretched**2).mean()):.1f} / {stretched.max():,.0f} | {seconds:.1f} |", flush=True)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--only", nargs="*", default=["demo", "o1", "o2", "o5"])
    p.add_argument("--out", default="out/peers")
    p.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS)
    a = p.parse_args()
    print(HEAD, "|---" * (HEAD.count("|") - 1) + "|", sep="\n", flush=True)
    for outfit in resolved(a.ifg, a.data, a.only, os.path.join(a.out, "ours")):
        body, before = load(outfit.skin), [load(file) for file in outfit.before]
        row(outfit.name, "as it came", body, before, before, 0.0)
        for name in a.methods:
            start = processor_seconds()
            try:
                after = METHODS[name](body, before)
            except (ImportError, SystemExit) as missing:
                print(f"{name} left out: {missing}", file=sys.stderr)
                continue
            seconds = processor_seconds() - start
            folder = os.path.join(a.out, name, outfit.name)
            os.makedirs(folder, exist_ok=True)
            for file, mesh in zip(outfit.before, after):
                save(os.path.join(folder, os.path.basename(file)), mesh)
            row(outfit.name, name, body, before, after, seconds)
        row(outfit.name, "ours", body, before, [load(file) for file in outfit.after], outfit.seconds)


if __name__ == "__main__":
    main()
