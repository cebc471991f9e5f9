#!/usr/bin/env python3
"""Judges meshes of single frames against the posed truth that ../shared/tools/render_sequence.py writes with --meshes.

    benches/motion.py CAPTURE BODY OUT [--every 3]     OUT as the program `motion` of if-benches writes it; needs numpy, libigl, meshio, pillow

For each folder of OUT with frame_NNNN.ply, mean of every third frame, of the garments, in mm:
  there    from our surface, where the truth's nearest triangle is a garment's, to the truth: mean and p95
  back     from the garments' vertices to our surface: mean and p95
  seen     the same as back, of vertices that the camera sees in that frame alone
  facing   from those vertices that face the camera by cosines above 0.8 to our surface, signed (out is positive): mean
  material distance between where a garment's vertex is and where ours is that lies nearest to it in canonical space: mean and p95
"""
import argparse, json, os, sys
import igl, meshio, numpy as np
from PIL import Image

a = argparse.ArgumentParser()
a.add_argument('capture'); a.add_argument('body'); a.add_argument('out')
a.add_argument('--every', type=int, default=3)
a.add_argument('--shared', default='../shared')
a = a.parse_args()
sys.path.insert(0, a.shared + '/tools')
from render_sequence import read_ply

meta = json.load(open(a.capture + '/meta.json'))
names = meta['layers_inner_to_outer']
ours = meshio.read(a.out + '/canonical.ply')
F = ours.cells_dict['triangle'].astype(np.int64)
truth = [read_ply(f'{a.body}/body.ply')] + [read_ply(f'{a.body}/garments/{n}.ply') for n in names]
first = np.cumsum([0] + [len(t[0]) for t in truth])
TF = np.concatenate([t[1] + o for t, o in zip(truth, first)]).astype(np.int64)
body = len(truth[0][1])
V0 = np.asarray(ours.points, float)
X0 = np.concatenate([t[0] for t in truth]).astype(float)
place = lambda p, v, f: igl.point_mesh_squared_distance(np.ascontiguousarray(p), np.ascontiguousarray(v), f)
own = np.concatenate([np.full(len(t[0]), k + 2) for k, t in enumerate(truth[1:])])
# Where each vertex of the garments lies on our canonical surface.
_, near, foot = place(X0[first[1]:], V0, F)
corners = F[near]
bary = igl.barycentric_coordinates(foot, *(np.ascontiguousarray(V0[corners[:, k]]) for k in range(3)))
K, R, t = (np.array(meta[k]) for k in ('K', 'R', 't'))
for name in sorted(d for d in os.listdir(a.out) if os.path.isdir(f'{a.out}/{d}')):
    rows = []
    for i in range(0, len(meta['frames']), a.every):
        V = np.asarray(meshio.read(f'{a.out}/{name}/frame_{i:04d}.ply').points, float)
        z = np.load(f'{a.capture}/mesh/{i:04d}.npz')
        T = np.concatenate([z[n] for n in ['body'] + names]).astype(float)
        G = T[first[1]:]
        d, tri, _ = place(V, T, TF)
        there = np.sqrt(d)[tri >= body]
        squared, _, nearest = place(G, V, F)
        back = np.sqrt(squared)
        # Seen: not farther than 1 cm behind what the depth image shows, where the label is the vertex's own.
        c = G @ R.T + t
        px = (c @ K.T)[:, :2] / c[:, 2:]
        depth = np.asarray(Image.open(f'{a.capture}/depth/{i:04d}.png')).astype(float) * 1e-4
        label = np.asarray(Image.open(f'{a.capture}/label/{i:04d}.png'))
        u, v = (np.clip(px[:, k].astype(int), 0, depth.shape[1 - k] - 1) for k in range(2))
        seen = (depth[v, u] > 0) & (c[:, 2] < depth[v, u] + 0.01) & (label[v, u] == own)
        out = igl.per_vertex_normals(T, TF)[first[1]:]
        sight = -t @ R - G
        turned = (out * sight).sum(1) > 0.8 * np.linalg.norm(sight, axis=1)
        signed = ((nearest - G) * out).sum(1)[seen & turned]
        material = np.linalg.norm((V[corners] * bary[:, :, None]).sum(1) - G, axis=1)
        rows.append([f(x) for x in (there, back, back[seen], material, signed) for f in (np.mean, lambda y: np.percentile(y, 95))])
    r = 1e3 * np.mean(rows, 0)
    print(f'{name:>6}: there {r[0]:.2f} p95 {r[1]:.2f}, back {r[2]:.2f} p95 {r[3]:.2f}, seen {r[4]:.2f} p95 {r[5]:.2f}, '
          f'material {r[6]:.2f} p95 {r[7]:.2f}, facing {r[8]:+.2f} mm ({len(rows)} frames)', flush=True)
