"""Signed distance fields: surfaces of fields, and networks fitted to meshes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from typing import Any

from . import _ifgarments as _native
from ._arguments import (
    Progress,
    checked_threads,
    folder,
    length,
    listener,
    named_params,
    number,
    whole,
)
from ._files import whole_file
from ._kinds import read
from ._outfits import Arrays, Mesh
from .errors import ParameterError


def extract(
    field: Mesh | bytes,
    *,
    cell: float | None = None,
    params: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> tuple[Arrays, dict[str, Any]]:
    """Extracts the surface of a signed distance field as a mesh.

    Args:
        field: a closed mesh, which is remeshed by its signed distance; or a network, as the bytes
            of the file that :func:`fit` and ``ifg fit`` write.
        cell: side of the cells, in metres: about the mean edge length. 0.01 by default.
        params: other parameters by name: ``{"relax": 4, "newton": 2}``.
        threads: as in :func:`resolve`.
        progress: as in :func:`resolve`.

    Returns:
        The mesh, and a report with its error, cost and warnings.

    Raises:
        ParameterError: a parameter is unknown, out of range or given twice.
        ValueError, TypeError: the mesh is not closed, or no mesh; the bytes are no network.
    """
    is_network = isinstance(field, (bytes, bytearray, memoryview))
    mesh = None if is_network else read(field, "field", "field").native()
    named = named_params(params)
    if cell is not None:
        if params is not None and "resolution" in params:
            raise ParameterError("`cell` and the parameter `resolution` are the same; give one")
        named += named_params({"resolution": {"cell": length(cell, "cell")}})
    network = bytes(field) if is_network else None
    threads = checked_threads(threads)
    (_, v, f), report = _native.extract(mesh, network, named, threads, listener(progress))
    return (v, f), json.loads(report)


def fit(
    mesh: Mesh,
    path: str | os.PathLike[str] | None = None,
    *,
    steps: int | None = None,
    seconds: float | None = None,
    accuracy: float | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> tuple[bytes, dict[str, Any]]:
    """Fits a network (the grid encoding) to the signed distance of a mesh.

    Args:
        mesh: closed; or open, then its vertices and normals are fitted.
        path: where the safetensors file is written, if anywhere.
        steps: steps at most. Without ``seconds``, two runs give the same bits.
        seconds: time at most. One minute if neither steps nor seconds are given, ten with an accuracy.
        accuracy: stop at this mean error near the surface, in metres.
        threads: as in :func:`resolve`.
        progress: as in :func:`resolve`.

    Returns:
        The safetensors file, and a report with the errors at held-out points.

    Raises:
        ParameterError: a parameter is out of range.
        ValueError, TypeError: the mesh has no outside, or is no mesh.
    """
    if steps is None and seconds is None:
        seconds = 60.0 if accuracy is None else 600.0
    arguments = (
        read(mesh, "mesh", "mesh").native(),
        None if steps is None else whole(steps, "steps", 0, 2**63 - 1),
        None if seconds is None else number(seconds, "seconds"),
        None if accuracy is None else length(accuracy, "accuracy"),
        checked_threads(threads),
        listener(progress),
    )
    if path is None:
        file, report = _native.fit(*arguments)
    else:
        with whole_file(folder(path, "path")) as out:
            file, report = _native.fit(*arguments)
            out.write(file)
    return file, json.loads(report)
