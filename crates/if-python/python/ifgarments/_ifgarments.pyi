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
    body: Points | None
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
def intersections(
    layers: list[dict[str, Any]], threads: int | None
) -> list[tuple[tuple[int, int], np.ndarray[tuple[int, Literal[2]], np.dtype[np.int64]]]]: ...
def default_params() -> str: ...
def demo_scene(
    trousers: bool, resolution: float, overlap: float
) -> list[tuple[str, Points, Triangles]]: ...
def picture(layers: list[dict[str, Any]], height: int) -> bytes: ...

NamedArrays: TypeAlias = tuple[str, Points, Triangles]

class _Reconstruction(TypedDict):
    person: NamedArrays
    labels: np.ndarray[tuple[int], np.dtype[np.uint8]]
    garments: list[NamedArrays]
    report: str

def reconstruct(
    capture: str,
    body: str,
    cell: float | None,
    every: int,
    checkpoint: str | None,
    threads: int | None,
    progress: ProgressCallback | None,
) -> _Reconstruction: ...
def extract(
    mesh: dict[str, Any] | None,
    network: bytes | None,
    params: list[tuple[str, str]],
    threads: int | None,
    progress: ProgressCallback | None,
) -> tuple[NamedArrays, str]: ...
def fit(
    mesh: dict[str, Any],
    steps: int | None,
    seconds: float | None,
    accuracy: float | None,
    threads: int | None,
    progress: ProgressCallback | None,
) -> tuple[bytes, str]: ...
def animate(
    layers: list[dict[str, Any]],
    motion: bytes | str | np.ndarray[Any, np.dtype[np.float64]],
    skeleton: bytes | str | None,
    weights: list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]] | str | None],
    rate: float,
    folder: str | None,
    params: list[tuple[str, str]],
    threads: int | None,
    progress: ProgressCallback | None,
) -> tuple[
    str,
    str,
    list[str],
    list[np.ndarray[tuple[int, int, Literal[3]], np.dtype[np.float32]]],
]: ...
def wardrobe_list(root: str) -> str: ...
def wardrobe_add_body(
    root: str, name: str, mesh: str, template: str | None, skeleton: str | None, scale: float
) -> str: ...
def wardrobe_body(root: str, name: str) -> NamedArrays: ...
def wardrobe_garment(root: str, name: str) -> NamedArrays: ...
def wardrobe_dress(
    root: str, body: str, garments: list[str], threads: int | None
) -> list[NamedArrays]: ...
def wardrobe_match(
    root: str,
    combination: tuple[str, list[str]],
    out: str,
    params: tuple[list[tuple[str, str]], float | None],
    options: tuple[bool, bool, int],
    threads: int | None,
    progress: ProgressCallback | None,
) -> tuple[str, str]: ...
def wardrobe_batch(
    root: str,
    combinations: list[tuple[str, list[str]]],
    out: tuple[str, str | None],
    params: tuple[list[tuple[str, str]], float | None],
    options: tuple[bool, bool, int, int],
    threads: int | None,
    progress: ProgressCallback | None,
) -> str: ...
def ifg(args: list[str]) -> int: ...
