#!/usr/bin/env python3
"""Writes motions for `ifg animate` (docs/animate.md), for skeletons with the joints of MakeHuman's CMU rig.

    benches/motions.py SKELETON.json OUT.json act                        sit down with crossed arms, stand up, lift a knee
    benches/motions.py SKELETON.json OUT.json random [--count 50] [--seed 1]

A random pose turns each joint of RANGES about x, y and z by angles drawn evenly from its ranges, in degrees, in the frame of
the rest pose (A-pose, y up, facing +z); right joints have the mirrored ranges of left ones. Needs numpy and scipy.
"""
import argparse, json
import numpy as np
from scipy.spatial.transform import Rotation

# Joint: degrees about x, y and z; of the first the turn comes last.
RANGES = {
    'LeftUpLeg': [(-80, 20), (-15, 15), (-5, 30)],
    'LeftLeg': [(0, 100), (0, 0), (0, 0)],
    'LeftFoot': [(-20, 20), (0, 0), (0, 0)],
    'LeftShoulder': [(0, 0), (-10, 10), (-5, 15)],
    'LeftArm': [(-30, 30), (-70, 20), (-30, 80)],
    'LeftForeArm': [(-55, 10), (-55, 10), (0, 0)],
    'LowerBack': [(-8, 15), (-12, 12), (-8, 8)],
    'Spine': [(-8, 15), (-12, 12), (-8, 8)],
    'Spine1': [(-8, 15), (-12, 12), (-8, 8)],
    'Neck': [(-15, 15), (-20, 20), (-10, 10)],
    'Head': [(-10, 10), (-20, 20), (-5, 5)],
}


def euler(x, y, z):
    return Rotation.from_euler('xyz', [x, y, z], degrees=True)


def mirrored(turn):
    x, y, z = turn.as_rotvec()
    return Rotation.from_rotvec([x, -y, -z])


def between(a, b):
    """The least turn from direction a to direction b."""
    a, b = (np.asarray(v, float) / np.linalg.norm(v) for v in (a, b))
    axis = np.cross(a, b)
    length = np.linalg.norm(axis)
    return Rotation.from_rotvec(axis / max(length, 1e-12) * np.arctan2(length, a @ b))


def random_pose(rng):
    pose = {}
    for joint, ranges in RANGES.items():
        sides = [joint, joint.replace('Left', 'Right')] if joint.startswith('Left') else [joint]
        for side in sides:
            turn = euler(*(rng.uniform(*r) for r in ranges))
            pose[side] = mirrored(turn) if side != joint else turn
    return np.zeros(3), pose


def act(skeleton, frames_each=16):
    """Key poses, and smooth ways between them."""
    joints = {j['name']: j for j in skeleton['joints']}

    def bone(name):
        return np.subtract(joints[name]['tail'], joints[name]['head'])

    def arms(upper, fore, apart):
        """Both upper arms and forearms point in these directions on the left; the right one lower by apart."""
        pose = {}
        for side, sign, down in (('Left', 1, 0.0), ('Right', -1, apart)):
            flip = np.array([sign, 1, 1])
            arm = between(bone(f'{side}Arm'), np.add(upper, [0, -down, 0]) * flip)
            pose[f'{side}Arm'] = arm
            pose[f'{side}ForeArm'] = between(bone(f'{side}ForeArm'), arm.inv().apply(np.add(fore, [0, -down, 0]) * flip))
        return pose

    crossed = arms([0.35, -0.8, 0.5], [-0.75, 0.25, 0.55], 0.25)
    sitting = {'LowerBack': euler(5, 0, 0), 'Spine': euler(5, 0, 0)}
    for side, sign in (('Left', 1), ('Right', -1)):
        sitting[f'{side}UpLeg'] = euler(-75, 0, 8 * sign)
        sitting[f'{side}Leg'] = euler(80, 0, 0)
    knee = {'LeftUpLeg': euler(-85, 0, 5), 'LeftLeg': euler(95, 0, 0), 'RightUpLeg': euler(3, 0, 0)}
    low = np.array([0, -0.3, -0.25])
    keys = [(np.zeros(3), {}), (np.zeros(3), crossed), (low, {**crossed, **sitting}), (np.zeros(3), crossed),
            (np.zeros(3), {**arms([0.5, -0.85, 0.0], [0.3, -0.8, 0.5], 0.0), **knee})]
    out = []
    for (t0, a), (t1, b) in zip(keys, keys[1:]):
        for k in range(frames_each):
            s = k / frames_each
            s = s * s * (3 - 2 * s)
            pose = {}
            for name in set(a) | set(b):
                p, q = a.get(name, Rotation.identity()), b.get(name, Rotation.identity())
                pose[name] = p * Rotation.from_rotvec(s * (p.inv() * q).as_rotvec())
            out.append((t0 + s * (t1 - t0), pose))
    return out + [keys[-1]]


def main():
    a = argparse.ArgumentParser()
    a.add_argument('skeleton'), a.add_argument('out'), a.add_argument('kind', choices=['act', 'random'])
    a.add_argument('--count', type=int, default=50)
    a.add_argument('--seed', type=int, default=1)
    a = a.parse_args()
    skeleton = json.load(open(a.skeleton))
    names = [j['name'] for j in skeleton['joints']]
    missing = [n for n in RANGES if n not in names]
    if missing:
        raise SystemExit(f'{a.skeleton} lacks {", ".join(missing)}')
    rng = np.random.default_rng(a.seed)
    # Random poses have nothing to do with one another: half a second apart, nothing is smoothed over time.
    poses, fps = (act(skeleton), 30) if a.kind == 'act' else ([random_pose(rng) for _ in range(a.count)], 2)
    frames = []
    for root, pose in poses:
        turns = [pose.get(n, Rotation.identity()).as_quat() for n in names]
        frames.append({'root_t': [float(x) for x in root], 'rot': [[float(q[k]) for k in (3, 0, 1, 2)] for q in turns]})
    with open(a.out, 'w') as file:
        json.dump({'fps': fps, 'joints': names, 'frames': frames}, file)
    print(f'{a.out}: {len(frames)} frames')


main()
