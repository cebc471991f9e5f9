"""Wardrobes: folders of bodies and garments that fit any body."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from . import _ifgarments as _native
from ._arguments import (
    Progress,
    checked_threads,
    folder,
    listener,
    names,
    number,
    pairs,
    resolve_params,
    whole,
)
from ._outfits import Arrays


class Wardrobe:
    """A folder of bodies and garments, as ``ifg reconstruct`` and ``ifg wardrobe`` write it.

        >>> wardrobe = ifgarments.Wardrobe("wardrobe")
        >>> body, layers = wardrobe.dress("berta", ["anna_trousers", "anna_tshirt"])
        >>> resolved = ifgarments.resolve(body, layers)

    Every call reads the folder anew. The format is in ``docs/reference/wardrobe.md``.

    Raises:
        WardrobeError: a body or a garment is missing or damaged. A folder that is not there yet is
            an empty wardrobe.
        BusyError: another process writes there; try again.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = folder(path, "path")
        self._list()

    def __repr__(self) -> str:
        return f"Wardrobe({self.path!r})"

    def _list(self) -> dict[str, Any]:
        listed: dict[str, Any] = json.loads(_native.wardrobe_list(self.path))
        return listed

    @property
    def bodies(self) -> dict[str, dict[str, Any]]:
        """Metadata of all bodies, by name."""
        bodies: dict[str, dict[str, Any]] = self._list()["bodies"]
        return bodies

    @property
    def garments(self) -> dict[str, dict[str, Any]]:
        """Metadata of all garments, by name."""
        garments: dict[str, dict[str, Any]] = self._list()["garments"]
        return garments

    @property
    def faults(self) -> list[dict[str, str]]:
        """Unreadable folders: ``part``, ``name`` and ``error``."""
        faults: list[dict[str, str]] = self._list()["faults"]
        return faults

    def body(self, name: str) -> Arrays:
        """The mesh of a body."""
        return _native.wardrobe_body(self.path, name)[1:]

    def garment(self, name: str) -> Arrays:
        """The mesh of a garment, in the canonical pose of the body it was made on."""
        return _native.wardrobe_garment(self.path, name)[1:]

    def add_body(
        self,
        name: str,
        mesh: str | os.PathLike[str],
        *,
        template: str | os.PathLike[str] | None = None,
        skeleton: str | os.PathLike[str] | None = None,
        scale: float = 1.0,
    ) -> str:
        """Adds a body unless the wardrobe has it.

        Args:
            name: a number is appended if a body with other files has this name.
            mesh: a PLY, OBJ or glTF file.
            template: a file of the same body in a topology that other bodies share.
            skeleton: a file of its joints.
            scale: from the units of these files to metres.

        Returns:
            The name that the body has in the wardrobe.
        """
        return _native.wardrobe_add_body(
            self.path,
            name,
            folder(mesh, "mesh"),
            None if template is None else folder(template, "template"),
            None if skeleton is None else folder(skeleton, "skeleton"),
            number(scale, "scale"),
        )

    def dress(
        self, body: str, garments: Sequence[str], *, threads: int | None = None
    ) -> tuple[Arrays, dict[str, Arrays]]:
        """Aligns garments on a body, and resolves nothing.

        Args:
            body: name of the body.
            garments: names of garments, inner to outer.
            threads: as in :func:`resolve`.

        Returns:
            The arguments of :func:`resolve`. Garments are float32, as :meth:`match` stores them.
        """
        worn = names(garments, "garments")
        dressed = _native.wardrobe_dress(self.path, body, worn, checked_threads(threads))
        layers: dict[str, Arrays] = {}
        for name, v, f in dressed[1:]:
            layers[name] = (v.astype(np.float32), f)
        return dressed[0][1:], layers

    def match(
        self,
        body: str,
        garments: Sequence[str],
        out: str | os.PathLike[str],
        *,
        clearance: float | None = None,
        params: Mapping[str, Any] | None = None,
        write_unproven: bool = False,
        again: bool = False,
        picture_height: int = 640,
        threads: int | None = None,
        progress: Callable[[Progress], object] | None = None,
    ) -> dict[str, Any]:
        """Aligns and resolves garments on a body, and writes the result into a folder.

        Args:
            body: name of the body.
            garments: names of garments, inner to outer.
            out: the folder; a worse result does not replace a better one.
            clearance: as in :func:`resolve`.
            params: as in :func:`resolve`; ``untangle_strain`` is 1 by default.
            write_unproven: meshes are written even if intersections remain.
            again: it is done again even if the folder has this result.
            picture_height: in pixels; 0 for no pictures.
            threads: as in :func:`resolve`.
            progress: as in :func:`resolve`.

        Returns:
            ``result.json``, with ``state`` (``"clean"``, ``"remaining"`` or ``"failed"``) and
            ``error``; ``placed`` is ``"written"``, ``"before"`` (it was there already) or
            ``"nowhere"`` (the folder has a better result).
        """
        pixels = whole(picture_height, "picture_height", 0, 4096)
        text, placed = _native.wardrobe_match(
            self.path,
            (body, names(garments, "garments")),
            folder(out, "out"),
            resolve_params(params, clearance),
            (bool(write_unproven), bool(again), pixels),
            checked_threads(threads),
            listener(progress),
        )
        result: dict[str, Any] = json.loads(text)
        return {**result, "placed": placed}

    def batch(
        self,
        combinations: Iterable[tuple[str, Sequence[str]]],
        out: str | os.PathLike[str],
        *,
        part: str | None = None,
        clearance: float | None = None,
        params: Mapping[str, Any] | None = None,
        meshes: bool = True,
        again: bool = False,
        picture_height: int = 400,
        at_once: int = 1,
        threads: int | None = None,
        progress: Callable[[Progress], object] | None = None,
    ) -> list[dict[str, Any]]:
        """Aligns and resolves many combinations, each into a folder of its own below ``out``.

        What is there already is taken: a stopped batch goes on. The files are those of
        ``ifg wardrobe batch``.

        Args:
            combinations: pairs of a body and garments, inner to outer.
            out: the folder of results, ``summary.json`` and ``report.html``.
            part: a name, if these are a part of the whole that another process completes: they are
                written into ``out/shards/part``. A call without it collects all parts. See
                :mod:`ifgarments.batch`.
            clearance: as in :func:`resolve`.
            params: as in :func:`resolve`; ``untangle_strain`` is 1 by default.
            meshes: meshes are written.
            again: everything is done again.
            picture_height: in pixels; 0 for no pictures.
            at_once: combinations in parallel, each with about 100 MiB.
            threads: as in :func:`resolve`.
            progress: as in :func:`resolve`; the stage ``"combination"`` is reported after each.

        Returns:
            The entries of ``summary.json``, in the order of ``combinations``: ``state``
            (``"clean"``, ``"remaining"`` or ``"failed"``), ``error``, ``folder`` and figures.
        """
        if part is not None and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", part):
            raise ValueError(f"part is {part!r}; give up to 64 letters, digits, - and _")
        pixels = whole(picture_height, "picture_height", 0, 4096)
        text = _native.wardrobe_batch(
            self.path,
            pairs(combinations),
            (folder(out, "out"), part),
            resolve_params(params, clearance),
            (bool(meshes), bool(again), pixels, whole(at_once, "at_once", 1, 1024)),
            checked_threads(threads),
            listener(progress),
        )
        entries: list[dict[str, Any]] = json.loads(text)
        return entries
