"""Exceptions of ifgarments. All derive from :class:`Error`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._results import Resolved

__all__ = [
    "AnimateError",
    "BusyError",
    "Cancelled",
    "CaptureError",
    "Error",
    "IntersectionsRemain",
    "OutfitError",
    "ParameterError",
    "ReconstructError",
    "SolverError",
    "WardrobeError",
]


class Error(Exception):
    """Base of all exceptions of this package."""


class OutfitError(Error, ValueError):
    """The layers are not a valid outfit: the message names the layer and what to do."""


class ParameterError(Error, ValueError):
    """A parameter is unknown or out of range."""


class SolverError(Error):
    """A step of the cloth solver failed."""


class WardrobeError(Error):
    """A wardrobe, or a body or garment of it, is missing or damaged."""


class BusyError(WardrobeError):
    """Another process writes into the folder: try again later."""


class ReconstructError(Error):
    """A capture or its template body cannot be used."""


class CaptureError(Error, ValueError):
    """A file of somebody else's capture cannot be converted.

    Attributes:
        file: its path.
        key: the key, data set or array in it, or ``None`` if the file as a whole is meant.
    """

    file: str
    key: str | None

    def __init__(self, file: object, key: str | None, problem: str) -> None:
        super().__init__(file, key, problem)
        self.file, self.key, self.problem = str(file), key, problem

    def __str__(self) -> str:
        place = self.file if self.key is None else f"{self.file}: `{self.key}`"
        return f"{place}: {self.problem}"


class AnimateError(Error):
    """An outfit cannot follow a motion: the message names layer, vertex or frame."""


class Cancelled(Error):
    """The work was cancelled."""


class IntersectionsRemain(Error):
    """The outfit is not as clean as asked for; what was reached is in ``partial``.

    Attributes:
        partial: the result as far as it came, with its report.
        unresolved: ``between`` (``pairs``, ``inside``, ``outer``, ``inner``, or ``None`` if nothing
            remains between layers), ``own`` (intersections of garments with themselves, by name)
            and ``triangles`` (some of the pairs, inner triangle first).
    """

    partial: Resolved[Any]
    unresolved: dict[str, Any]

    def __init__(self, message: str, partial: Resolved[Any], unresolved: dict[str, Any]) -> None:
        super().__init__(message, partial, unresolved)
        self.partial = partial
        self.unresolved = unresolved

    def __str__(self) -> str:
        return str(self.args[0])
