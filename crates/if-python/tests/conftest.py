"""A small outfit: a ball with a band of cloth that dips into it."""

import numpy as np
import pytest

BALL = 0.3


def ball(radius=BALL, rings=16, around=24):
    """A closed mesh, wound outwards."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)[None, :]
    rows = [np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn, np.sin(polar) * np.cos(turn)]
    middle = np.stack(rows, axis=-1).reshape(-1, 3)
    vertices = radius * np.vstack([middle, [[0, 1, 0], [0, -1, 0]]])
    top, bottom = len(vertices) - 2, len(vertices) - 1
    quads = [(r, k) for r in range(rings - 2) for k in range(around)]
    faces = []
    for r, k in quads:
        a, b = r * around + k, r * around + (k + 1) % around
        faces += [[a, a + around, b], [b, a + around, b + around]]
    last = (rings - 2) * around
    for k in range(around):
        faces.append([top, k, (k + 1) % around])
        faces.append([bottom, last + (k + 1) % around, last + k])
    return vertices, np.array(faces)


def band(radius=0.98 * BALL, around=40, along=4, height=0.1):
    """A tube about the ball, without ends, wound outwards."""
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    y = np.linspace(-height / 2, height / 2, along + 1)
    rows = [[radius * np.sin(t), level, radius * np.cos(t)] for level in y for t in turn]
    faces = []
    for r in range(along):
        for k in range(around):
            a, b = r * around + k, r * around + (k + 1) % around
            faces += [[a, b, a + around], [b, b + around, a + around]]
    return np.array(rows), np.array(faces)


@pytest.fixture
def body():
    return ball()


@pytest.fixture
def belt():
    return band()


@pytest.fixture
def shirt():
    """A second layer, over the belt."""
    return band(0.99 * BALL, around=44, along=6, height=0.12)
