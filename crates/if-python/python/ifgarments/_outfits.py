"""Outfits: resolved, verified, drawn."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from . import _ifgarments as _native
from ._arguments import (
    Progress,
    checked_threads,
    folder,
    listener,
    number,
    resolve_params,
    whole,
)
from ._files import whole_file
from ._kinds import read, read_layers, read_outfit
from ._results import Resolved, Verified
from .errors import IntersectionsRemain

#: A mesh: ``(vertices, faces)``, or an object of trimesh, Open3D or meshio.
Mesh = Any
#: Garments, inner to outer: meshes, pairs of name and mesh, or a mapping of names to meshes.
Layers = Sequence[Mesh] | Sequence[tuple[str, Mesh]] | Mapping[str, Mesh]
#: A garment as it is given and comes back: a mesh, or a pair of name and mesh.
Garment = TypeVar("Garment")
#: Positions in metres, shape (n, 3), and triangles, shape (m, 3).
Arrays = tuple[NDArray[np.floating[Any]], NDArray[np.integer[Any]]]


@overload
def resolve(
    body: Mesh,
    layers: Mapping[str, Garment],
    *,
    clearance: float | None = None,
    strict: bool = False,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
    params: Mapping[str, Any] | None = None,
) -> Resolved[dict[str, Garment]]: ...
@overload
def resolve(
    body: Mesh,
    layers: Sequence[Garment],
    *,
    clearance: float | None = None,
    strict: bool = False,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
    params: Mapping[str, Any] | None = None,
) -> Resolved[list[Garment]]: ...
def resolve(
    body: Mesh,
    layers: Layers,
    *,
    clearance: float | None = None,
    strict: bool = False,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
    params: Mapping[str, Any] | None = None,
) -> Resolved[Any]:
    """Removes all intersections between layers, and proves it.

    Args:
        body: stays as it is unless ``params={"pinch": "yield"}`` draws it back where it meets itself;
            it may be open, and must have an inside.
        layers: garments, inner to outer. They are not changed. Positions in float32 are proven as
            float32.
        clearance: gap between layers at vertices and long edges, in metres; 0.3 mm by default.
        strict: no garment, nor the body, may intersect itself either.
        threads: number of threads; all cores by default. Results do not depend on it.
        progress: is called with a :class:`Progress`. An exception of it cancels the work.
        params: other parameters, by name (``{"rounds": 200}``, ``{"goal.own": "keep"}``) or group,
            as in outfit files: see :func:`default_params`.

    Returns:
        The garments in the kind and collection given, with a report.

    Raises:
        IntersectionsRemain: not everything could be removed; ``partial`` has what was reached.
        OutfitError: the layers are not a valid outfit.
        ParameterError: a parameter is unknown or out of range.
        SolverError: a step of the cloth solver failed.
        ValueError, TypeError: an argument is no mesh; the message names argument, row and value.
        KeyboardInterrupt: Ctrl-C, within 0.3 s.
    """
    garments = read_layers(layers)
    native = [layer.native() for layer in [read(body, "body", "body"), *garments.layers]]
    rebuild = [layer.rebuild() for layer in garments.layers]
    found = _native.resolve(
        native,
        *resolve_params(params, clearance),
        bool(strict),
        checked_threads(threads),
        listener(progress),
    )
    report, state, notes = found["report"], found["state"], found["notes"]
    meshes = [rebuilt(*arrays) for rebuilt, arrays in zip(rebuild, found["layers"])]
    resolved = Resolved(
        state, json.loads(report), notes, garments.collected(meshes), found["body"]
    )
    if found["unresolved"] is None:
        return resolved
    message, remaining = found["unresolved"]
    raise IntersectionsRemain(message, resolved, json.loads(remaining))


def verify(body: Mesh, layers: Layers, *, threads: int | None = None) -> Verified:
    """Checks an outfit and changes nothing.

    Args:
        body: as in :func:`resolve`.
        layers: as in :func:`resolve`.
        threads: as in :func:`resolve`.

    Returns:
        The state, and a report of every layer against every layer below.

    Raises:
        OutfitError: the layers are not a valid outfit.
        ValueError, TypeError: as in :func:`resolve`.
    """
    found = _native.verify(_native_layers(body, layers), checked_threads(threads))
    return Verified(found["state"], json.loads(found["report"]), found["notes"])


class Intersections(NamedTuple):
    """Intersecting triangles of two layers, or of one with itself."""

    #: Name of the inner layer; the body's is ``"body"``.
    inner: str
    #: Name of the outer layer; the same name for a layer that intersects itself.
    outer: str
    #: Triangles of the inner and of the outer layer, shape (k, 2).
    triangles: NDArray[np.integer[Any]]


def intersections(body: Mesh, layers: Layers, *, threads: int | None = None) -> list[Intersections]:
    """Finds where layers intersect each other and themselves: exact.

    Args:
        body: as in :func:`resolve`.
        layers: as in :func:`resolve`.
        threads: as in :func:`resolve`.

    Returns:
        An entry for every two layers that intersect, and for every layer that intersects itself.

    Raises:
        ValueError, TypeError: as in :func:`resolve`.
    """
    outfit = read_outfit(body, layers)
    names = [layer.name for layer in outfit]
    native = [layer.native() for layer in outfit]
    found = _native.intersections(native, checked_threads(threads))
    return [Intersections(names[a], names[b], triangles) for (a, b), triangles in found]


def picture(
    body: Mesh,
    layers: Layers,
    path: str | os.PathLike[str] | None = None,
    *,
    height: int = 640,
) -> bytes:
    """Draws an outfit from four sides, layers in colours and intersecting triangles in red.

    Args:
        body: as in :func:`resolve`.
        layers: as in :func:`resolve`.
        path: where the PNG file is written, if anywhere.
        height: in pixels.

    Returns:
        The PNG file.
    """
    height = whole(height, "height", 16, 4096)
    native = _native_layers(body, layers)
    if path is None:
        return _native.picture(native, height)
    with whole_file(folder(path, "path")) as file:
        png = _native.picture(native, height)
        file.write(png)
    return png


def demo_scene(
    *, trousers: bool = False, resolution: float = 1.0, overlap: float = 1.0
) -> tuple[Arrays, dict[str, Arrays]]:
    """The built-in scene of ``ifg demo``: a mannequin and four garments with deep intersections.

    Args:
        trousers: trousers, T-shirt, jacket and coat, instead of T-shirt, skirt, jacket and coat.
        resolution: divides the edge length; from 0.7 to 8.
        overlap: depth of the intersections; from 0 to 1.

    Returns:
        The body, and the garments by name; float32 as ``ifg demo`` stores them.
    """
    scene = _native.demo_scene(
        bool(trousers), number(resolution, "resolution"), number(overlap, "overlap")
    )
    layers: dict[str, Arrays] = {name: (v.astype(np.float32), f) for name, v, f in scene}
    return layers.pop("body"), layers


def default_params() -> dict[str, dict[str, Any]]:
    """All parameters of :func:`resolve` with their defaults, in groups.

    They are documented in ``docs/reference/parameters.md``.
    """
    params: dict[str, dict[str, Any]] = json.loads(_native.default_params())
    return params


def _native_layers(body: Mesh, layers: Layers) -> list[dict[str, Any]]:
    return [layer.native() for layer in read_outfit(body, layers)]
