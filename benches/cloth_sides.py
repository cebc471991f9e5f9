#!/usr/bin/env python3
"""`ifg check` of a ball that hangs in the open space under a skirt, by how the skirt's cloth is made.

    benches/cloth_sides.py PROGRAM... [--data ../shared/data] [--out out/sides]

The flared skirt of body_a as it is, wound inwards, with half of its triangles turned, with a back on vertices of its own (as two-sided exports
are), and with 1 mm of thickness; inside it a ball of 2 cm radius, 10 cm above its hem and 5 cm in front of its middle: no two triangles meet. Prints how many
of the ball's 162 vertices each program finds inside. Needs numpy, trimesh.
"""
import argparse, json, os, subprocess
import numpy as np, trimesh

a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
a.add_argument('programs', nargs='+'); a.add_argument('--data', default='../shared/data'); a.add_argument('--out', default='out/sides')
a = a.parse_args()
os.makedirs(a.out, exist_ok=True)
body = f'{a.data}/body_a/body_clean.ply'
read = trimesh.load(f'{a.data}/body_a/garments/flared_skirt.ply', process=False)
read.merge_vertices(merge_tex=True, merge_norm=True)
V, F = np.array(read.vertices), np.array(read.faces)
n = len(V)
turned = np.random.default_rng(1).random(len(F)) < 0.5
mixed = np.where(turned[:, None], F[:, ::-1], F)
directed = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
known = set(map(tuple, directed))
rim = np.array([e for e in directed if (e[1], e[0]) not in known])
p, q = rim.T
rims = np.concatenate([np.stack([p, q, q + n], 1), np.stack([p, q + n, p + n], 1)])
outer = V + 1e-3 * read.vertex_normals
skirts = {
    'as it is': (V, F),
    'wound inwards': (V, F[:, ::-1]),
    'half turned': (V, mixed),
    'two-sided': (np.concatenate([V, V]), np.concatenate([F, F[:, ::-1] + n])),
    'with thickness': (np.concatenate([V, outer]), np.concatenate([F[:, ::-1], F + n, rims])),
}
ball = trimesh.creation.icosphere(2, 0.02)
ball.vertices += [0, V[:, 1].min() + 0.10, 0.05]
ball.export(f'{a.out}/ball.ply')
for name, (points, triangles) in skirts.items():
    path = f'{a.out}/{name.replace(" ", "_")}.ply'
    trimesh.Trimesh(points, triangles, process=False).export(path)
    found = []
    for program in a.programs:
        run = subprocess.run([program, 'check', '--json', '--body', body, path, f'{a.out}/ball.ply'], capture_output=True, text=True)
        if run.returncode not in (0, 1):
            raise SystemExit(run.stderr)
        found.append(sum(pair['vertices_inside'] for pair in json.loads(run.stdout)['report']['pairs'] if pair['outer'] == 'ball'))
    print(f'{name:16}', *found)
