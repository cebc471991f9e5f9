#!/usr/bin/env python3
"""Copies a body of ../shared/data with its flared skirt widened to a round hem of 1.3 m.

    benches/wide_skirt.py ../shared/data/body_a wide      # needs numpy

x and z grow by 1 + 1.8 t and 1 + 3.2 t, with t from 0 at the waist (y = 0.92 m) to 1 at the hem (0.35 m).
"""
import shutil, sys
import numpy as np

source, target = sys.argv[1:]
shutil.copytree(source, target)
name = target + '/garments/flared_skirt.ply'
data = open(name, 'rb').read()
start = data.index(b'end_header\n') + 11
types = {'float': '<f4', 'uchar': 'u1'}
element, fields, count = '', [], 0
for words in (line.split() for line in data[:start].decode().splitlines()):
    if words[0] == 'element':
        element = words[1]
        count = int(words[2]) if element == 'vertex' else count
    elif words[0] == 'property' and element == 'vertex':
        fields.append((words[2], types[words[1]]))
v = np.frombuffer(data, fields, count, start).copy()
t = np.clip((0.92 - v['y']) / (0.92 - 0.35), 0, 1)
v['x'] *= 1 + 1.8 * t
v['z'] = 0.02 + (v['z'] - 0.02) * (1 + 3.2 * t)
with open(name, 'wb') as file:
    file.write(data[:start] + v.tobytes() + data[start + v.nbytes:])
