"""The native part of ifgarments. Its functions are called by the package only."""

from collections.abc import Callable
from typing import Any, Literal, TypedDict, TypeAlias

import numpy as np

Points: TypeAlias = np.ndarray[tuple[int, Literal[3]], np.dtype[np.float64]]
Triangles: TypeAlias = np.ndarray[tuple[int, Literal[3]], np.dtype[np.int64]]
ProgressCallback: TypeAlias = Callable[[str, str, int, int | None, dict[str, float]], object]

class _Verified(TypedDict):
    report: str
    state: str
    notes: list[str]

class _Resolved(_Verified):
    layers: list[tuple[Points, Triangles | None]]
    unresolved: tuple[str, str] | None

BUILD: str

def resolve(
    layers: list[dict[str, Any]],
    params: list[tuple[str, str]],
    clearance: float | None,
    strict: bool,
    threads: int | None,
    progress: ProgressCallback | None,
) -> _Resolved: ...
def verify(layers: list[dict[str, Any]], threads: int | None) -> _Verified: ...
def default_params() -> str: ...
def demo_scene(
    trousers: bool, resolution: float, overlap: float
) -> list[tuple[str, Points, Triangles]]: ...
def picture(layers: list[dict[str, Any]], height: int) -> bytes: ...
