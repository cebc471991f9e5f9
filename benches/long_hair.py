#!/usr/bin/env python3
"""A copy of a capture of ../shared/tools/render_sequence.py in which hair hides the upper back.

    benches/long_hair.py CAPTURE BODY OUT [--as skin|background] [--shared ../shared]

Pixels of the back, from 8 cm above the joint of the neck to 28 cm below it and up to 11 cm to either side, get the label of skin, as parsers without
hair give it, or of the background, which does not vote. Needs numpy, pillow.
"""
import argparse, json, os, shutil, sys
import numpy as np
from PIL import Image

a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
a.add_argument('capture'); a.add_argument('body'); a.add_argument('out')
a.add_argument('--as', dest='label', choices=('skin', 'background'), default='skin')
a.add_argument('--shared', default='../shared')
a = a.parse_args()
sys.path.insert(0, a.shared + '/tools')
from render_sequence import lbs, read_ply, skin_mats

shutil.copytree(a.capture, a.out)
meta = json.load(open(a.out + '/meta.json'))
K, R, t = (np.array(meta[k]) for k in ('K', 'R', 't'))
points, _, joints, weights = read_ply(a.body + '/body_clean.ply')
skeleton = json.load(open(a.body + '/skeleton.json'))['joints']
heads, parents = np.array([j['head'] for j in skeleton]), [j['parent'] for j in skeleton]
x, y, z = (points - heads[[j['name'] for j in skeleton].index('Neck')]).T
hair = np.flatnonzero((abs(x) < 0.11) & (y < 0.08) & (y > -0.28) & (z < 0))
folder = a.out + ('/label_noisy' if os.path.isdir(a.out + '/label_noisy') else '/label')
changed = 0
for frame in meta['frames']:
    mats, blend, _ = skin_mats(heads, parents, frame)
    seen = lbs(points[hair], joints[hair], weights[hair], mats, blend) @ R.T + t
    column, row = ((seen @ K.T)[:, :2] / seen[:, 2:]).astype(int).T
    depth = np.array(Image.open(f'{a.capture}/depth/{frame["index"]:04d}.png')) * meta['depth_unit_m']
    path = f'{folder}/{frame["index"]:04d}.png'
    label = np.array(Image.open(path))
    before = label.copy()
    for c, r, far in zip(column, row, seen[:, 2]):
        # Not through the person from before.
        if 0 <= r < depth.shape[0] and 0 <= c < depth.shape[1] and abs(depth[r, c] - far) < 0.06:
            part = label[max(r - 1, 0):r + 3, max(c - 1, 0):c + 3]
            part[part > 1] = 1 if a.label == 'skin' else 0
    changed += (label != before).sum()
    Image.fromarray(label).save(path)
print(f'{a.out}: {changed} pixels are {a.label}')
