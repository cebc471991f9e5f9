#!/usr/bin/env python3
"""Does anybody see that the body yields? Masks of the clothed person with the body drawn back and as it was skinned, from outside.

    benches/clothed_masks.py BODY_FOLDER MOTION.json OUT [--every 1] [--step 7]      OUT of ifg animate; needs numpy, pillow

BODY_FOLDER has body_clean.ply, skeleton.json and garments/. Eight level views in turn, orthographic, 2 mm a pixel; of each pixel
the nearest triangle (sorted by its middle). Of every --step-th frame:
  mask      pixels that are person in one of the two pictures alone, in % of the person
  seen      body that is seen, in % of the person
  moved     seen body that is displaced by more than 1 mm, in % of the person
"""
import argparse, json, os, struct, sys
import numpy as np
from PIL import Image, ImageDraw

a = argparse.ArgumentParser()
a.add_argument('body'), a.add_argument('motion'), a.add_argument('out')
a.add_argument('--every', type=int, default=1)
a.add_argument('--step', type=int, default=7)
a.add_argument('--shared', default='../shared')
a = a.parse_args()
sys.path.insert(0, a.shared + '/tools')
from render_sequence import lbs, read_ply, skin_mats


def cache(path):
    with open(path, 'rb') as file:
        _, _, points, _, _, frames = struct.unpack('<12siiffi', file.read(32))
        return np.frombuffer(file.read(), '<f4').reshape(frames, points, 3).astype(float)


names = [f[:-4] for f in sorted(os.listdir(a.out)) if f.endswith('.pc2') and f != 'body_clean.pc2']
body, faces, joints, weights = read_ply(f'{a.body}/body_clean.ply')
skeleton = json.load(open(f'{a.body}/skeleton.json'))['joints']
heads, parents = np.array([j['head'] for j in skeleton]), [j['parent'] for j in skeleton]
moved = cache(f'{a.out}/body_clean.pc2')
cloth = [(cache(f'{a.out}/{n}.pc2'), read_ply(f'{a.body}/garments/{n}.ply')[1]) for n in names]
poses = json.load(open(a.motion))['frames'][::a.every]


def picture(layers, angle, origin, size):
    """The triangle seen in each pixel, counted through the layers from 1; 0 for none."""
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    corners = np.concatenate([(v @ turn.T)[f] for v, f in layers])
    order = np.argsort(corners[:, :, 2].mean(1))
    flat = (corners[:, :, :2] - origin) / 0.002
    image = Image.new('I', size)
    draw = ImageDraw.Draw(image)
    for t in order:
        draw.polygon([tuple(p) for p in flat[t]], fill=int(t) + 1)
    return np.asarray(image)


worst = np.zeros(3)
for frame in range(0, len(moved), a.step):
    g, b, _ = skin_mats(heads, parents, poses[frame])
    skinned = lbs(body, joints, weights, g, b)
    far = np.linalg.norm(moved[frame] - skinned, axis=1)
    garments = [(v[frame], f) for v, f in cloth]
    every = np.concatenate([skinned] + [v for v, _ in garments])
    reach = np.abs(every[:, [0, 2]]).max() + 0.05
    size = (int(2 * reach / 0.002), int((np.ptp(every[:, 1]) + 0.1) / 0.002))
    origin = np.array([-reach, every[:, 1].min() - 0.05])
    differ = seen = shifted = person = 0
    for k in range(8):
        now, then = (picture([(v, faces)] + garments, k * np.pi / 4, origin, size) for v in (moved[frame], skinned))
        differ += ((now > 0) != (then > 0)).sum()
        person += (then > 0).sum()
        skin = now[(now > 0) & (now <= len(faces))] - 1
        seen += len(skin)
        shifted += (far[faces[skin]].max(1) > 1e-3).sum()
    row = 100 * np.array([differ, seen, shifted]) / person
    worst = np.maximum(worst, row)
    print(f'frame {frame}: mask {row[0]:.4f} %, seen {row[1]:.1f} %, moved {row[2]:.4f} %, largest {1e3 * far.max():.1f} mm', flush=True)
print(f'worst: mask {worst[0]:.4f} %, moved {worst[2]:.4f} %')
