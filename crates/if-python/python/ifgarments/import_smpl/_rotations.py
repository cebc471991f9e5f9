"""Rotations as quaternions (w, x, y, z), matrices and rotation vectors."""

from __future__ import annotations

import numpy as np

from ._files import Reals


def of_vectors(vectors: Reals) -> Reals:
    """Unit quaternions of rotation vectors in radians, shape (…, 3); of zero, no rotation."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # np.sinc(x) is sin(πx)/(πx): no division by an angle of 0.
    part = 0.5 * np.sinc(angle / (2 * np.pi)) * vectors
    return np.concatenate([np.cos(angle / 2), part], axis=-1)


def product(a: Reals, b: Reals) -> Reals:
    """First ``b``, then ``a``."""
    w, u, x, v = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    scalar = w * x - np.sum(u * v, axis=-1, keepdims=True)
    return np.concatenate([scalar, w * v + x * u + np.cross(u, v)], axis=-1)


def matrix(q: Reals) -> Reals:
    """The matrix of a quaternion, which is normalised."""
    w, x, y, z = q / np.linalg.norm(q)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


def of_matrix(m: Reals) -> Reals:
    """The unit quaternion of a rotation matrix.

    It is the eigenvector of the largest eigenvalue of a symmetric matrix [Bar-Itzhack 2000]:
    accurate for every angle, half turns included.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    k = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    q = np.linalg.eigh(k)[1][:, -1]
    return np.asarray(q if q[0] >= 0 else -q)


def is_rotation(m: Reals) -> bool:
    """Whether a matrix is a rotation within the rounding of a text file of six digits."""
    return bool(np.abs(m @ m.T - np.eye(3)).max() < 1e-4 and np.linalg.det(m) > 0)
