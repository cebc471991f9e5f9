"""Outfits and their motions as USD text files (``.usda``), with a time sample for each frame.

    >>> from ifgarments import usd
    >>> usd.write("outfit.usda", {"body": body, **layers})
    >>> usd.write("walk.usda", {"body": body, **layers}, {"body": done.body, **done.layers})
    >>> usd.write("walk.usda", {"jeans": jeans}, {"jeans": "walk/jeans.pc2"}, fps=24)

Positions are in single precision with nine digits: readers get the same bits. The text follows the
grammar of Pixar's ``.usda`` and the schema ``UsdGeomMesh``; pxr itself is not needed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from io import TextIOWrapper
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from ._arguments import number
from ._files import whole_file
from ._kinds import Layer, read, unmasked

__all__ = ["read_point_cache", "write"]

Positions = NDArray[np.float32]

#: Start of a point cache: name, version 1, points, first frame, frames a sample, samples.
_CACHE = np.dtype(
    [("name", "S12"), ("version", "<i4"), ("points", "<i4")]
    + [("first", "<f4"), ("rate", "<f4"), ("samples", "<i4")]
)


def read_point_cache(path: str | os.PathLike[str]) -> Positions:
    """The positions in a PC2 file, such as ``ifg animate`` writes: shape (frames, n, 3).

    The file is mapped, not read: frames are loaded when they are used.

    Raises:
        ValueError: it is no PC2 file, or is incomplete.
    """
    file = Path(path)
    size = file.stat().st_size
    if size < _CACHE.itemsize:
        raise ValueError(f"{file}: {size} bytes are no point cache (PC2)")
    head = np.fromfile(file, _CACHE, 1)[0]
    if head["name"] != b"POINTCACHE2" or head["version"] != 1:
        raise ValueError(f"{file}: is no point cache (PC2, version 1)")
    shape = (int(head["samples"]), int(head["points"]), 3)
    expected = _CACHE.itemsize + 4 * shape[0] * shape[1] * 3
    if min(shape) < 1 or size != expected:
        frames = f"{shape[0]} frames of {shape[1]} points"
        raise ValueError(f"{file}: has {size} bytes; {frames} need {expected}")
    return np.memmap(file, "<f4", "r", _CACHE.itemsize, shape)


def write(
    path: str | os.PathLike[str],
    meshes: Mapping[str, Any],
    frames: Mapping[str, Any] | None = None,
    *,
    fps: float = 30.0,
) -> None:
    """Writes meshes, and their positions in all frames, as one file.

    Args:
        path: the file, ``….usda``. It is replaced only when the new one is complete.
        meshes: by name, as in :func:`ifgarments.resolve`, in metres, with y up.
        frames: for some of the meshes, positions of shape (frames, n, 3), or the path of a point
            cache; equally many frames each. The others do not move.
        fps: frames a second.

    Raises:
        ValueError: names, counts of vertices or of frames do not fit, or a coordinate is not finite
            in single precision; the message names mesh, frame and vertex.
    """
    target = Path(path)
    if target.suffix != ".usda":
        raise ValueError(f"{target}: the name must end with .usda")
    fps = number(fps, "fps")
    if not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps is {fps}; it must be above 0")
    for argument, given in (("meshes", meshes), ("frames", {} if frames is None else frames)):
        if not isinstance(given, Mapping):
            raise TypeError(f"{argument} is a {type(given).__name__}; give a mapping of names")
    layers = [read(mesh, f"meshes[{name!r}]", name) for name, mesh in meshes.items()]
    if not layers:
        raise ValueError("meshes is empty; give at least one")
    for layer in layers:
        _check_faces(layer)
    moving = _moving(layers, frames or {})
    count = max((len(positions) for positions in moving.values()), default=0)
    names = _identifiers([layer.name for layer in layers])
    with whole_file(target) as file:
        out = TextIOWrapper(file, encoding="utf-8", newline="\n")
        out.write(_header(count, fps))
        for layer, name in zip(layers, names, strict=True):
            _write_mesh(out, layer, name, moving.get(layer.name))
        out.write("}\n")
        out.detach()


def _check_faces(layer: Layer) -> None:
    """Corners must be vertices, of which there must be some."""
    count = len(layer.vertices)
    bad = np.argwhere((layer.faces < 0) | (layer.faces >= count))
    if count == 0:
        raise ValueError(f"{layer.argument}: has no vertices")
    if len(bad):
        row, corner = (int(k) for k in bad[0])
        index = layer.faces[row, corner]
        raise ValueError(
            f"{layer.argument}: triangle {row}: corner {corner} is {index}; "
            f"there are {count} vertices"
        )


def _moving(layers: list[Layer], frames: Mapping[str, Any]) -> dict[str, Positions]:
    """The positions of each mesh that moves, checked for their shape."""
    counts = {layer.name: len(layer.vertices) for layer in layers}
    moving: dict[str, Positions] = {}
    for name, given in frames.items():
        if name not in counts:
            raise ValueError(f"frames[{name!r}]: there is no such mesh; meshes are {list(counts)}")
        is_path = isinstance(given, (str, os.PathLike))
        positions = read_point_cache(given) if is_path else unmasked(given)
        if positions.dtype.kind not in "fiu":
            raise TypeError(f"frames[{name!r}]: is {positions.dtype}; positions must be numbers")
        expected = ("frames", counts[name], 3)
        if positions.ndim != 3 or positions.shape[1:] != expected[1:] or not len(positions):
            shape = positions.shape
            raise ValueError(f"frames[{name!r}]: has the shape {shape}; it must be {expected}")
        first = next(iter(moving), name)
        if first in moving and len(moving[first]) != len(positions):
            raise ValueError(
                f"frames[{name!r}]: has {len(positions)} frames, but {first!r} has "
                f"{len(moving[first])}"
            )
        moving[name] = positions
    return moving


def _identifiers(names: list[str]) -> list[str]:
    """Names of prims: letters, digits and underscores, and no two alike."""
    found: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if re.match("[A-Za-z_]", plain) else f"_{plain}"
        if plain in found:
            both = f"{found[plain]!r} and {name!r}"
            raise ValueError(f"meshes: {both} are both called {plain} in USD; rename one")
        found[plain] = name
    return list(found)


def _text(value: str) -> str:
    """A quoted text."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    control = re.compile(r"[\x00-\x1f\x7f]")
    return '"' + control.sub(lambda found: f"\\x{ord(found[0]):02x}", escaped) + '"'


def _header(frames: int, fps: float) -> str:
    lines = ["#usda 1.0", "(", '    defaultPrim = "outfit"', "    metersPerUnit = 1"]
    lines += ['    upAxis = "Y"']
    if frames:
        lines += [f"    framesPerSecond = {fps:.9g}", f"    timeCodesPerSecond = {fps:.9g}"]
        lines += ["    startTimeCode = 0", f"    endTimeCode = {frames - 1}"]
    return "\n".join(
        [*lines, ")", "", 'def Xform "outfit" (', '    kind = "component"', ")", "{", ""]
    )


def _write_mesh(out: TextIO, layer: Layer, name: str, positions: Positions | None) -> None:
    shown = f" (\n        displayName = {_text(layer.name)}\n    )" if name != layer.name else ""
    faces = np.asarray(layer.faces)
    corners = ", ".join(map(str, faces.ravel().tolist()))
    out.write(f'    def Mesh "{name}"{shown}\n    {{\n')
    out.write('        uniform token subdivisionScheme = "none"\n')
    out.write(f"        int[] faceVertexCounts = [{', '.join(['3'] * len(faces))}]\n")
    out.write(f"        int[] faceVertexIndices = [{corners}]\n")
    rest = _single(layer.vertices, f"meshes[{layer.name!r}]")
    out.write(f"        float3[] extent = {_extent(rest)}\n")
    out.write(f"        point3f[] points = {_points(rest)}\n")
    if positions is not None:
        for attribute, formatted in (("float3[] extent", _extent), ("point3f[] points", _points)):
            out.write(f"        {attribute}.timeSamples = {{\n")
            for frame, given in enumerate(positions):
                at = _single(given, f"frames[{layer.name!r}]: frame {frame}")
                out.write(f"            {frame}: {formatted(at)},\n")
            out.write("        }\n")
    out.write("    }\n")


def _single(points: Any, place: str) -> Positions:
    """Positions in single precision; a coordinate that is not finite there is an error."""
    with np.errstate(over="ignore"):
        single = np.asarray(points).astype(np.float32)
    bad = np.argwhere(~np.isfinite(single))
    if len(bad):
        vertex, axis = (int(k) for k in bad[0])
        value = points[vertex][axis]
        raise ValueError(f"{place}: vertex {vertex}: coordinate {'xyz'[axis]} is {value}")
    return single


def _points(points: Positions) -> str:
    """Nine digits tell all numbers of single precision apart."""
    rows = ["(%.9g, %.9g, %.9g)"] * len(points)
    return f"[{', '.join(rows) % tuple(points.ravel().tolist())}]"


def _extent(points: Positions) -> str:
    return _points(np.stack([points.min(axis=0), points.max(axis=0)]))
