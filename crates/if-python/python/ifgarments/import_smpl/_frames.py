"""Poses and pictures of the frames that are taken."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CaptureError
from . import _rotations as rotations
from ._files import Reals, numbered
from ._pictures import Bytes, Mask, Resampling, read_labels, read_normals, write_png
from ._sources import Sequence

#: The world of the capture: the camera's, turned by half about x, so that y points up.
_WORLD = np.diag([1.0, -1.0, -1.0])


def _name(name: Any) -> str:
    """The name of a garment, which becomes one of files and a label."""
    fits = isinstance(name, str) and all(c.isalnum() or c in "_-. " for c in name)
    if not fits or not name or name.startswith(".") or name in ("background", "skin"):
        raise ValueError(
            f"garments: {name!r} is not a valid name: use letters, digits, blanks, _, - and ., and do not "
            "begin with .; background and skin are labels of their own"
        )
    return str(name)


class Labels:
    """Pictures of a human parser, and what their numbers mean."""

    def __init__(
        self,
        folder: str | os.PathLike[str] | None,
        garments: Mapping[str, Iterable[int]] | None,
        background: Iterable[int],
    ) -> None:
        given = {_name(name): tuple(numbers) for name, numbers in (garments or {}).items()}
        if (folder is None) != (not given):
            raise ValueError("labels and garments must be given together")
        #: Names, inner to outer.
        self.garments = list(given)
        self.folder = None if folder is None else Path(folder)
        # All numbers but these are skin.
        self._meaning = np.ones(256, dtype=np.uint8)
        owner: dict[int, str] = {}
        groups = [("background", 0, tuple(background))]
        groups += [(name, 2 + k, numbers) for k, (name, numbers) in enumerate(given.items())]
        for name, label, numbers in groups:
            for number in numbers:
                if not 0 <= number <= 255:
                    raise ValueError(f"label {number} of {name} must be from 0 to 255")
                if number in owner:
                    raise ValueError(f"label {number} is given to {owner[number]} and {name}")
                owner[number] = name
                self._meaning[number] = label

    def read(self, path: Path, size: tuple[int, int]) -> Bytes:
        """Our labels from a picture of the parser."""
        return np.asarray(self._meaning[read_labels(path, size)])


class Normals:
    """Pictures of normals, and their axes."""

    def __init__(self, folder: str | os.PathLike[str] | None, axes: str) -> None:
        if axes not in ("opengl", "opencv"):
            raise ValueError(f"normal_axes is {axes!r}; it must be 'opengl' or 'opencv'")
        self.folder = None if folder is None else Path(folder)
        self._turned = axes == "opengl"

    def read(self, path: Path, size: tuple[int, int]) -> Bytes:
        """Normals along the axes of OpenCV, black where they are missing."""
        code = read_normals(path, size).copy()
        known = code.any(axis=-1)
        if self._turned:
            code[known, 1:] = 255 - code[known, 1:]
        return code


def poses(sequence: Sequence, chosen: list[int], pelvis: Reals) -> dict[str, Any]:
    """Camera and frames for ``meta.json``.

    SMPL places a vertex at R₀(x − p) + p + τ, with R₀ the rotation of the pelvis p, before the
    camera's x_cam = R x + t. With A = W R and W the turn from the camera's axes to the world's,

    ```text
    R₀′ = A R₀        τ′ = A (p + τ) + W t − p
    ```

    are root rotation and translation in our convention (docs/reference/capture.md).
    """
    turn = _WORLD @ sequence.rotation
    root = sequence.trans[chosen] + pelvis
    root_t = root @ turn.T + _WORLD @ sequence.translation - pelvis
    rot = rotations.of_vectors(sequence.poses[chosen])
    rot[:, 0] = rotations.product(rotations.of_matrix(turn), rot[:, 0])
    return {
        "R": _WORLD.tolist(),
        "t": [0.0, 0.0, 0.0],
        "frames": [
            {"index": index, "root_t": t.tolist(), "rot": q.tolist()}
            for index, t, q in zip(chosen, root_t, rot, strict=True)
        ],
    }


def pictures(
    out: Path,
    sequence: Sequence,
    chosen: list[int],
    lens: Resampling,
    labels: Labels,
    normals: Normals,
) -> None:
    """Writes masks, labels and normals."""
    size = (sequence.height, sequence.width)
    label_files = _files(labels.folder, sequence)
    normal_files = _files(normals.folder, sequence)
    for kind in ("mask", "label", "normal"):
        (out / kind).mkdir()
    for frame in chosen:
        name = f"{frame:04}.png"
        mask: Mask = lens(sequence.mask(frame))
        label = mask.astype(np.uint8)
        if label_files:
            label = lens(labels.read(label_files[frame], size))
        normal = np.zeros((*mask.shape, 3), dtype=np.uint8)
        if normal_files:
            normal = lens(normals.read(normal_files[frame], size))
            normal[~mask] = 0
        write_png(out / "mask" / name, 255 * mask.astype(np.uint8))
        write_png(out / "label" / name, label)
        write_png(out / "normal" / name, normal)


def _files(folder: Path | None, sequence: Sequence) -> list[Path]:
    """The pictures in a folder, one for each frame of the source."""
    if folder is None:
        return []
    files = numbered(folder, ".png", ".jpg")
    if len(files) != sequence.count:
        problem = f"has {len(files)} pictures; the capture has {sequence.count} frames"
        raise CaptureError(folder, None, problem)
    return files
