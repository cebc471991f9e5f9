"""Arguments that several functions take."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from .errors import ParameterError


class Progress(NamedTuple):
    """What a callback receives."""

    #: The stage of the work: ``"verify"``, ``"untangle"``, ``"settle"``, ``"repair"``, ``"done"``.
    stage: str
    #: The layer.
    item: str
    #: Rounds done in this stage.
    done: int
    #: Rounds of this stage, if known.
    total: int | None
    #: Numbers such as ``garment``, ``garments``, and ``pairs`` that remain.
    measures: dict[str, float]


def named_params(params: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Names and values as JSON."""
    if params is None:
        return []
    if not isinstance(params, Mapping):
        raise TypeError(f"params is {params!r}; it must be a mapping of names to values")
    named = []
    for name, value in params.items():
        try:
            number = getattr(value, "item", None)  # a number of numpy
            text = json.dumps(number() if callable(number) else value, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise ParameterError(f"parameter `{name}` is {value!r}: {error}") from None
        named.append((str(name), text))
    return named


def checked_threads(threads: int | None) -> int | None:
    if threads is None:
        return None
    if isinstance(threads, bool) or not isinstance(threads, int):
        raise TypeError(f"threads is {threads!r}; it must be a whole number, or None")
    if not 1 <= threads <= 1024:
        raise ValueError(f"threads is {threads}; it must be from 1 to 1024")
    return threads


def listener(
    progress: Callable[[Progress], object] | None,
) -> Callable[[str, str, int, int | None, dict[str, float]], object] | None:
    if progress is None:
        return None
    if not callable(progress):
        raise TypeError(f"progress is {progress!r}; it must be callable")
    return lambda *values: progress(Progress(*values))


def folder(path: str | os.PathLike[str], argument: str) -> str:
    """A path as text."""
    try:
        return os.fsdecode(path)
    except TypeError:
        raise TypeError(f"{argument} is {path!r}; it must be a path") from None
