"""From a capture of a turning person to garments."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _ifgarments as _native
from ._arguments import Progress, checked_threads, folder, length, listener, whole
from ._outfits import Arrays


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A person in clothes, and the clothes, in the canonical pose of the template body."""

    #: The clothed person: one closed mesh.
    person: Arrays = field(repr=False)
    #: The label of each of its vertices, shape (n,).
    labels: NDArray[np.uint8] = field(repr=False)
    #: The garments by name, inner to outer.
    garments: dict[str, Arrays] = field(repr=False)
    #: The report, with the keys of ``ifg reconstruct --json`` but ``wrote``.
    report: dict[str, Any] = field(repr=False)


def reconstruct(
    capture: str | os.PathLike[str],
    body: str | os.PathLike[str],
    *,
    cell: float | None = None,
    every: int = 1,
    checkpoint: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> Reconstruction:
    """Reconstructs a clothed person and each garment from the folder of a capture.

    Args:
        capture: the folder, as ``docs/reference/capture.md`` specifies it.
        body: the folder of the template body.
        cell: cell size of the extraction, in metres; 8 mm by default.
        every: use the first frame and each so many-th after it.
        checkpoint: a file in which a stopped run goes on.
        threads: as in :func:`resolve`.
        progress: as in :func:`resolve`.

    Returns:
        Meshes and report. ``ifg reconstruct`` also writes them into a wardrobe.

    Raises:
        ReconstructError: the capture, the body or a parameter cannot be used.
        KeyboardInterrupt: Ctrl-C.
    """
    found = _native.reconstruct(
        folder(capture, "capture"),
        folder(body, "body"),
        None if cell is None else length(cell, "cell"),
        whole(every, "every", 1, 2**31),
        None if checkpoint is None else folder(checkpoint, "checkpoint"),
        checked_threads(threads),
        listener(progress),
    )
    garments: dict[str, Arrays] = {name: (v, f) for name, v, f in found["garments"]}
    report = json.loads(found["report"])
    return Reconstruction(found["person"][1:], found["labels"], garments, report)
