"""Arguments that several functions take."""

from __future__ import annotations

import json
import operator
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from .errors import ParameterError


class Progress(NamedTuple):
    """What a callback receives."""

    #: The stage of the work: ``"verify"``, ``"untangle"``, ``"settle"``, ``"repair"``, ``"done"``,
    #: ``"apart"``, with ``params={"method": "paper"}`` also ``"algorithm 1"`` and its own.
    stage: str
    #: The layer.
    item: str
    #: Rounds done in this stage.
    done: int
    #: Rounds of this stage, if known.
    total: int | None
    #: Numbers such as ``garment``, ``garments``, and ``pairs`` that remain.
    measures: dict[str, float]


def named_params(params: Mapping[str, Any] | None, **arguments: Any) -> list[tuple[str, str]]:
    """Names and values as JSON.

    `arguments` are those of the caller that are parameters too: who gives one, must not give it in
    `params` as well.
    """
    if params is None:
        return []
    if not isinstance(params, Mapping):
        raise TypeError(f"params is {params!r}; it must be a mapping of names to values")
    _check_given_once(params, [name for name, value in arguments.items() if value is not None])
    named = []
    for name, value in params.items():
        try:
            named.append((str(name), json_text(value)))
        except (TypeError, ValueError) as error:
            raise ParameterError(f"parameter `{name}` is {value!r}: {error}") from None
    return named


def resolve_params(
    params: Mapping[str, Any] | None, clearance: float | None
) -> tuple[list[tuple[str, str]], float | None]:
    """Parameters of :func:`resolve` as the native module takes them."""
    gap = None if clearance is None else length(clearance, "clearance")
    return named_params(params, clearance=clearance), gap


def _check_given_once(params: Mapping[str, Any], arguments: list[str]) -> None:
    """Of a parameter that is given as `own` and as `goal.own` the last value would be taken."""
    given = [(name, f"as the argument `{name}`") for name in arguments]
    for name, value in params.items():
        if isinstance(value, Mapping):
            given += [(f"{name}.{field}", f"as `{field}` in `{name}`") for field in value]
        else:
            given.append((str(name), f"as `{name}`"))
    for k, (path, place) in enumerate(given):
        group, _, field = path.rpartition(".")
        for other, other_place in given[:k]:
            other_group, _, other_field = other.rpartition(".")
            if field == other_field and (group == other_group or "" in (group, other_group)):
                raise ParameterError(
                    f"parameter `{field}` is given twice, {other_place} and {place}; give it once"
                )


def json_text(value: Any) -> str:
    """JSON of values of Python and of numpy."""
    return json.dumps(value, allow_nan=False, default=_plain)


def _plain(value: Any) -> Any:
    """A value of Python for one that JSON lacks."""
    if isinstance(value, np.floating):
        return float(value)  # `tolist` keeps those of more than double precision.
    if isinstance(value, Mapping):
        return dict(value)
    if callable(getattr(value, "tolist", None)):
        return value.tolist()
    kind = type(value).__qualname__
    raise TypeError(f"a {kind} has no JSON; give numbers, texts, lists, arrays and mappings")


def checked_threads(threads: int | None) -> int | None:
    return None if threads is None else whole(threads, "threads", 1, 1024)


def listener(
    progress: Callable[[Progress], object] | None,
) -> Callable[[str, str, int, int | None, dict[str, float]], object] | None:
    if progress is None:
        return None
    if not callable(progress):
        raise TypeError(f"progress is {progress!r}; it must be callable")
    return lambda *values: progress(Progress(*values))


def number(value: Any, argument: str, unit: str = "") -> float:
    """A number as the native module takes it; `unit` ends the advice: `, in metres`."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{argument} is {value!r}; give a number{unit}") from None


def length(value: Any, argument: str) -> float:
    """A length as the native module takes it."""
    return number(value, argument, ", in metres")


def whole(value: Any, argument: str, least: int, most: int) -> int:
    """A whole number in a range."""
    try:
        found = operator.index(value)
    except TypeError:
        found = None
    if found is None or isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{argument} is {value!r}; it must be a whole number")
    if not least <= found <= most:
        raise ValueError(f"{argument} is {found}; it must be from {least} to {most}")
    return found


def names(given: Any, argument: str) -> list[str]:
    """Names of garments: not one text, which is a sequence of letters, too."""
    is_list = isinstance(given, Iterable) and not isinstance(given, (str, bytes, Mapping))
    listed: list[Any] = list(given) if is_list else [None]
    if not all(isinstance(name, str) for name in listed):
        raise TypeError(f"{argument} is {given!r}; it must be a list of names")
    return listed


def pairs(given: Any) -> list[tuple[str, list[str]]]:
    """Bodies and the garments that each wears."""
    if isinstance(given, (str, bytes, Mapping)) or not isinstance(given, Iterable):
        raise TypeError(f"combinations is {given!r}; it must be a list of pairs (body, garments)")
    found = []
    for k, pair in enumerate(given):
        is_pair = isinstance(pair, (tuple, list)) and len(pair) == 2 and isinstance(pair[0], str)
        if not is_pair:
            raise TypeError(f"combinations[{k}] is {pair!r}; it must be a pair (body, garments)")
        found.append((pair[0], names(pair[1], f"combinations[{k}][1]")))
    return found


def folder(path: str | os.PathLike[str], argument: str) -> str:
    """A path as text."""
    try:
        text = os.fsdecode(path)
    except TypeError:
        raise TypeError(f"{argument} is {path!r}; it must be a path") from None
    if "\0" in text:
        raise ValueError(f"{argument} is {path!r}; a path has no zero bytes")
    return text
