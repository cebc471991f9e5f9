"""Outfits that follow motions."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from . import _ifgarments as _native
from ._arguments import (
    Progress,
    checked_threads,
    folder,
    json_text,
    listener,
    named_params,
    number,
)
from ._kinds import plain, read_outfit, unmasked
from ._outfits import Layers, Mesh

#: Joints and weights of all vertices, four of each: shapes (n, 4); or a mesh file that has them.
Weights = Union[tuple[Any, Any], str, "os.PathLike[str]"]

#: Extensions of files that are read as glTF.
GLTF = (".glb", ".gltf", ".vrm")


@dataclass(frozen=True, eq=False)
class Animated:
    """An outfit in all frames of a motion."""

    #: Positions of the body, shape (frames, n, 3), in metres.
    body: NDArray[np.float32]
    #: Positions of the garments by name, inner to outer, in the same shape.
    layers: dict[str, NDArray[np.float32]]
    #: A row for each frame, and figures of all: ``report`` of what ``ifg animate --json`` prints.
    report: dict[str, Any] = field(repr=False)
    #: What was noticed of skeleton, weights and motion, in words.
    notes: list[str] = field(repr=False)
    #: The same as ``report.json`` of ``ifg animate`` has it: ``weights_from_body``, ``weights_left_out``,
    #: ``joints_not_in_motion``, ``joints_of_motion_left_over``, ``limbs_not_moved``, ``moved_to_origin``,
    #: ``rest_frame`` and ``skeleton_from_skin`` (``docs/animate.md``).
    noticed: dict[str, Any] = field(repr=False)

    @property
    def is_clean(self) -> bool:
        """In no frame a layer intersects another, or has a new intersection with itself."""
        return bool(self.report["clean"] == len(self.body))


def animate(
    body: Mesh,
    layers: Layers,
    motion: str | os.PathLike[str] | Mapping[str, Any] | Any,
    *,
    skeleton: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    weights: Mapping[str, Weights] | None = None,
    fps: float | None = None,
    pinch: str | None = None,
    frames: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
    params: Mapping[str, Any] | None = None,
) -> Animated:
    """Moves a clean outfit through a motion, and proves every frame.

    Args:
        body: in its rest pose. Where it meets itself in a pose it yields.
        layers: garments in the same pose, inner to outer, as :func:`resolve` returns them.
        motion: the body in each frame, an array of shape (frames, n, 3) in metres, or a folder with its
            meshes; garments follow the nearest skin. Or poses of a skeleton: a file (.json, .bvh), or
            what such a file has (``docs/animate.md``).
        skeleton: of a motion of poses: a file (.json, or a glTF file with a skin), or what such a JSON
            file has (``docs/reference/capture.md``).
        weights: of a motion of poses: skinning weights by name, those of ``"body"`` among them;
            garments without follow the body. For each layer a pair of arrays, indices of joints and
            weights, four for each vertex; or the mesh file (PLY, glTF) that has them.
        fps: frames per second of bodies, 30 by default; poses have their own.
        pinch: what happens where the body meets itself or leaves no room for cloth: it yields by
            default (``"yield"``), or stays as skinned (``"keep"``), and what intersects it there is
            named in the report.
        frames: a folder in which frames are kept as they are done, so that a call that was stopped
            goes on there; none by default.
        threads: as in :func:`resolve`.
        progress: as in :func:`resolve`; the stages are ``"walked"``, ``"averaged"``, ``"frame"`` and
            ``"measured"``, each with the frames that are done of all.
        params: other parameters, by name (``{"smoothing": 0.1}``) or group
            (``{"walk": {"sweeps": 40}}``): see ``docs/animate.md``.

    Returns:
        The positions in all frames, and a report. A frame that cannot be made clean is no error:
        ``is_clean`` is false, and the report names it.

    Raises:
        OutfitError: the layers are not a valid outfit.
        ParameterError: a parameter is unknown, out of range or given twice.
        AnimateError: the outfit is not clean, or skeleton, weights or motion do not belong to it, or
            another process keeps frames in ``frames``.
        ValueError, TypeError: an argument is no mesh, or no array of the right shape.
    """
    if pinch not in (None, "yield", "keep"):
        raise ValueError(f'pinch is {pinch!r}; it must be "yield" or "keep"')
    named = named_params(params, pinch=pinch)
    if pinch is not None:
        named.append(("pinch", json_text(pinch)))
    outfit = read_outfit(body, layers)
    names = [layer.name for layer in outfit]
    moving = _motion(motion)
    of_bodies = "the motion has the body in each frame"
    unused: list[tuple[str, Any, str]] = [
        ("skeleton", skeleton, of_bodies),
        ("weights", weights, of_bodies),
    ]
    if isinstance(moving, bytes):
        unused = [("fps", fps, "poses have their own")]
    for argument, value, reason in unused:
        if value is not None:
            raise ValueError(f"{argument} is of no use: {reason}; leave it out")
    weights = {} if weights is None else weights
    if not isinstance(weights, Mapping):
        raise TypeError(f"weights is {weights!r}; it must be a mapping of names to pairs or files")
    unknown = [name for name in weights if name not in names]
    if unknown:
        raise ValueError(f"weights[{unknown[0]!r}]: there is no such layer; layers are {names}")
    given = [
        _weights(weights[layer.name], layer.name, len(layer.vertices))
        if layer.name in weights
        else None
        for layer in outfit
    ]
    report, noticed, notes, positions = _native.animate(
        [layer.native() for layer in outfit],
        moving,
        None if skeleton is None else _skeleton(skeleton),
        given,
        30.0 if fps is None else number(fps, "fps", ", frames per second"),
        None if frames is None else folder(frames, "frames"),
        named,
        checked_threads(threads),
        listener(progress),
    )
    rows: dict[str, Any] = json.loads(report)
    moved = dict(zip(names[1:], positions[1:]))
    return Animated(positions[0], moved, rows, notes, json.loads(noticed))


def _motion(given: Any) -> bytes | str | NDArray[np.float64]:
    """Poses as JSON or BVH; or the folder of the body in each frame, or its positions."""
    if isinstance(given, Mapping):
        return _json(given, "motion")
    if isinstance(given, (str, os.PathLike)):
        path = folder(given, "motion")
        return path if os.path.isdir(path) else _bytes(path)
    try:
        positions = unmasked(given)
    except Exception as error:  # ragged lists; tensors of other devices
        raise ValueError(f"motion is not an array of numbers: {error}") from error
    if positions.ndim != 3 or positions.shape[2] != 3:
        raise ValueError(
            f"motion has the shape {positions.shape}; it must be (frames, n, 3), a path or a mapping"
        )
    if positions.dtype.kind not in "fiu":
        raise TypeError(f"motion has elements of {positions.dtype}; they must be numbers")
    return plain(positions, np.float64)


def _weights(given: Any, name: str, vertices: int) -> tuple[NDArray[Any], NDArray[Any]] | str:
    argument = f"weights[{name!r}]"
    if isinstance(given, (str, os.PathLike)):
        return folder(given, argument)
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise TypeError(f"{argument} is no pair of joints and weights")
    joints, weights = np.asarray(given[0]), np.asarray(given[1])
    for what, array in (("joints", joints), ("weights", weights)):
        if array.shape != (vertices, 4):
            raise ValueError(
                f"{argument}: {what} have the shape {array.shape}; it must be ({vertices}, 4)"
            )
    if joints.dtype.kind not in "iu" or weights.dtype.kind not in "fiu":
        raise TypeError(f"{argument}: joints must be integers, and weights numbers")
    if joints.size and not 0 <= joints.min() <= joints.max() < 2**16:
        raise ValueError(f"{argument}: a joint is not from 0 to {2**16 - 1}")
    return plain(joints, np.uint16), plain(weights, np.float32)


def _skeleton(given: Any) -> bytes | str:
    """JSON, or the path of a glTF file."""
    if isinstance(given, Mapping):
        return _json(given, "skeleton")
    path = folder(given, "skeleton")
    content = _bytes(path)
    return path if path.lower().endswith(GLTF) else content


def _json(given: Mapping[str, Any], argument: str) -> bytes:
    try:
        return json_text(given).encode()
    except (TypeError, ValueError) as error:
        raise ValueError(f"{argument}: {error}") from None


def _bytes(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read()
