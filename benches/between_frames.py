#!/usr/bin/env python3
"""Judges the frames of `ifg animate` with ipctk: intersections in frames, and, after --continuous, collisions between them.

    benches/between_frames.py BODY.ply OUT GARMENT.ply ...     OUT of ifg animate; needs numpy, meshio, ipctk

Frames: ipctk.has_intersections of the whole scene, each layer with itself as well, in every --step-th. Intervals: between
layers alone (make_vertex_patches_filter), all vertices in straight lines. Exits with 1 if a frame has an intersection or an
answer differs.
"""
import argparse, json, os, struct
import ipctk, meshio, numpy as np

a = argparse.ArgumentParser()
a.add_argument('body'), a.add_argument('out'), a.add_argument('garments', nargs='+')
a.add_argument('--step', type=int, default=1)
a.add_argument('--tolerance', type=float, default=1e-9)
a = a.parse_args()


def cache(path):
    with open(path, 'rb') as file:
        _, _, points, _, _, frames = struct.unpack('<12siiffi', file.read(32))
        return np.frombuffer(file.read(), '<f4').reshape(frames, points, 3).astype(float)


files = [a.body] + a.garments
stems = [os.path.splitext(os.path.basename(f))[0] for f in files]
frames = np.concatenate([cache(f'{a.out}/{s}.pc2') for s in stems], axis=1)
faces, patches, first = [], [], 0
for k, path in enumerate(files):
    mesh = meshio.read(path)
    faces.append(mesh.cells_dict['triangle'].astype(np.int32) + first)
    patches.append(np.full(len(mesh.points), k))
    first += len(mesh.points)
faces = np.concatenate(faces)
scene = ipctk.CollisionMesh(frames[0], ipctk.edges(faces), faces)
scene.can_collide = ipctk.make_vertex_patches_filter(np.concatenate(patches).astype(np.int32))
# By default a fifth of the distance at the start, or a micrometre, counts as a collision.
ccd = ipctk.TightInclusionCCD(tolerance=a.tolerance, max_iterations=10_000_000, conservative_rescaling=0.9999)
whole = ipctk.CollisionMesh(frames[0], ipctk.edges(faces), faces)
judged = range(0, len(frames), a.step)
bad = [k for k in judged if ipctk.has_intersections(whole, frames[k])]
print(f'{len(judged)} frames judged, {len(bad)} with intersections {bad}', flush=True)
ours = json.load(open(f'{a.out}/report.json')).get('between_frames') or []
differ = 0
for k, row in enumerate(ours):
    free = ipctk.is_step_collision_free(scene, frames[k], frames[k + 1], narrow_phase_ccd=ccd)
    same = free == (row['crossings'] == 0)
    differ += not same
    print(f'after frame {row["frame"]}: ours {row["crossings"]} pairs, ipctk {"free" if free else "collision"}{"" if same else "  DIFFERS"}', flush=True)
print(f'{len(ours)} intervals, {differ} differ')
raise SystemExit(differ > 0 or len(bad) > 0)
