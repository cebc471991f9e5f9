"""Kinds of meshes: what callers give becomes arrays, and results the kind that was given."""

from __future__ import annotations

import copy
import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vertices = NDArray[np.floating[Any]]
Faces = NDArray[np.integer[Any]]
# Makes a mesh of the caller's kind of new vertices, and of new faces if they are not None.
Rebuild = Callable[[Vertices, "Faces | None"], Any]

KINDS = (
    "give a pair of arrays (vertices, faces), or a mesh with .vertices and .faces (trimesh), "
    ".vertices and .triangles (Open3D), or .points and .cells (meshio)"
)


def plain(array: Any, kind: Any) -> NDArray[Any]:
    """The array as the native module reads it: of this kind, contiguous, and aligned."""
    return np.require(array, kind, ["C_CONTIGUOUS", "ALIGNED"])


@dataclasses.dataclass(frozen=True)
class Layer:
    """A mesh of the caller as arrays."""

    argument: str
    name: str
    vertices: Vertices
    faces: Faces
    # The mesh, if it is not a pair of arrays, and the name of its positions.
    mesh: Any = None
    attribute: str = ""

    def native(self) -> dict[str, Any]:
        """The layer as the native module takes it."""
        return {
            "argument": self.argument,
            "name": self.name,
            "vertices": plain(self.vertices, np.float64),
            "faces": plain(self.faces, np.int64),
            "single": self.vertices.dtype == np.float32,
            "has_attributes": self.mesh is not None,
        }

    def rebuild(self) -> Rebuild:
        """Copies the mesh; the function returned gives the copy other positions.

        A mesh that cannot be copied so is an error here, before the work.
        """
        kind = self.vertices.dtype
        if self.mesh is None:
            given = np.array(self.faces)

            def pair(vertices: Vertices, faces: Faces | None) -> Any:
                # Single precision was proven: nothing is lost here.
                return vertices.astype(kind), given if faces is None else faces

            return pair
        try:
            copied = _copy(self.mesh)
            copied = _with(copied, self.attribute, np.array(self.vertices))
        except Exception as error:
            raise TypeError(
                f"{self.argument} is {_called(self.mesh)} that cannot be copied with other "
                f"{self.attribute} ({error}); give a pair of arrays (vertices, faces)"
            ) from error
        return lambda vertices, _: _with(copied, self.attribute, vertices.astype(kind))


@dataclasses.dataclass(frozen=True)
class Layers:
    """The garments, and the names that they came with."""

    layers: list[Layer]
    # None for meshes without a name.
    names: list[str | None]
    is_mapping: bool

    def collected(self, meshes: list[Any]) -> Any:
        """Meshes in the collection that was given."""
        if self.is_mapping:
            return dict(zip(self.names, meshes))
        pairs = zip(self.names, meshes)
        return [mesh if name is None else (name, mesh) for name, mesh in pairs]


def read_layers(given: Any) -> Layers:
    """The garments of the argument `layers`: a mapping, pairs of name and mesh, or meshes."""
    if isinstance(given, Mapping):
        named = [read(mesh, f"layers[{name!r}]", name) for name, mesh in given.items()]
        return Layers(named, list(given), True)
    if isinstance(given, (str, bytes, os.PathLike)) or not isinstance(given, Sequence):
        raise TypeError(
            f"layers: {_called(given)} is not a sequence of meshes, inner to outer; "
            "give a list, or a dict of names and meshes"
        )
    if len(given) == 2 and all(isinstance(part, np.ndarray) for part in given):
        raise TypeError("layers: two arrays are one mesh; give [(vertices, faces)]")
    layers: list[Layer] = []
    names: list[str | None] = []
    for k, item in enumerate(given):
        argument = f"layers[{k}]"
        is_named = isinstance(item, (tuple, list)) and len(item) == 2 and isinstance(item[0], str)
        name, mesh = item if is_named else (None, item)
        layers.append(read(mesh, argument, argument if name is None else name))
        names.append(name)
    return Layers(layers, names, False)


def read_outfit(body: Any, layers: Any) -> list[Layer]:
    """The body, and the garments of the argument `layers`."""
    return [read(body, "body", "body"), *read_layers(layers).layers]


def read(mesh: Any, argument: str, name: Any) -> Layer:
    """One mesh; errors begin with `argument`."""
    if not isinstance(name, str):
        raise TypeError(f"{argument}: its name is {name!r}; names must be text")
    try:
        name.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{argument}: its name {name!r} is no valid Unicode") from None
    vertices, faces, attribute = _parts(mesh, argument)
    return Layer(
        argument,
        name,
        _vertices(vertices, argument),
        _faces(faces, argument),
        mesh if attribute else None,
        attribute,
    )


def _parts(mesh: Any, argument: str) -> tuple[Any, Any, str]:
    """Vertices, faces, and the attribute that has the vertices; no attribute for a pair."""
    if hasattr(mesh, "points") and isinstance(getattr(mesh, "cells", None), list):
        return mesh.points, _triangles(mesh.cells, argument), "points"
    for faces in ("faces", "triangles"):
        if hasattr(mesh, "vertices") and hasattr(mesh, faces):
            return mesh.vertices, getattr(mesh, faces), "vertices"
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return mesh[0], mesh[1], ""
    if isinstance(mesh, (str, bytes, os.PathLike)):
        raise TypeError(
            f"{argument} is {mesh!r}: files are not read here; read it with "
            "trimesh.load(path, process=False), or use the command `ifg fix`"
        )
    raise TypeError(f"{argument} is {_called(mesh)}; {KINDS}")


def _triangles(cells: list[Any], argument: str) -> Faces:
    """The triangles of a mesh of meshio."""
    blocks = [block for block in cells if block.type not in ("vertex", "line")]
    for block in blocks:
        if block.type != "triangle":
            raise ValueError(
                f"{argument}: cells are of type {block.type!r}; triangulate the mesh first"
            )
    # Each by itself: joined, int64 and uint64 would become float64.
    data = [_faces(block.data, argument).astype(np.int64, copy=False) for block in blocks]
    return np.concatenate([np.zeros((0, 3), np.int64), *data])


def _copy(mesh: Any) -> Any:
    """A copy with all attributes; trimesh copies textures in a way of its own."""
    own = getattr(mesh, "copy", None)
    return own() if callable(own) else copy.deepcopy(mesh)


def _with(mesh: Any, attribute: str, vertices: Vertices) -> Any:
    """The mesh with other positions: itself, or another one if it is immutable."""
    if hasattr(mesh, "_replace"):  # a named tuple
        return mesh._replace(**{attribute: vertices})
    if dataclasses.is_dataclass(mesh) and not isinstance(mesh, type):
        return dataclasses.replace(mesh, **{attribute: vertices})
    stored = getattr(mesh, attribute)
    is_array = isinstance(stored, (np.ndarray, list, tuple))
    # Open3D has vectors of its own.
    setattr(mesh, attribute, vertices if is_array else type(stored)(vertices))
    if callable(getattr(mesh, "has_vertex_normals", None)) and mesh.has_vertex_normals():
        mesh.compute_vertex_normals()
    return mesh


def _vertices(given: Any, argument: str) -> Vertices:
    array = _array(given, argument, "vertices")
    if array.dtype == np.float16 or array.dtype.kind not in "fiu":
        raise TypeError(
            f"{argument}: vertices are {array.dtype}; they must be float64, float32 or integers"
        )
    _check_shape(array, argument, "vertices", "(n, 3)")
    kind = np.float32 if array.dtype.newbyteorder("=") == np.float32 else np.float64
    return array.astype(kind, copy=False)


def _faces(given: Any, argument: str) -> Faces:
    array = _array(given, argument, "faces")
    if array.size == 0 and array.ndim <= 2:
        array = np.zeros((0, 3), np.int64)  # An empty list has no kind.
    if array.dtype.kind not in "iu":
        raise TypeError(f"{argument}: faces are {array.dtype}; they must be integers")
    hint = "; triangulate the mesh first" if array.ndim == 2 and array.shape[1] > 3 else ""
    _check_shape(array, argument, "faces", "(m, 3)", hint)
    if array.dtype == np.uint64 and (array > np.iinfo(np.int64).max).any():
        row = int((array > np.iinfo(np.int64).max).any(axis=1).argmax())
        raise ValueError(f"{argument}: triangle {row} is {array[row].tolist()}; out of range")
    return array


def unmasked(given: Any) -> NDArray[Any]:
    """`given` as an array; what is below a mask is no value."""
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        raise ValueError("it has masked elements: fill or remove them")
    return np.asarray(given)


def _array(given: Any, argument: str, what: str) -> NDArray[Any]:
    try:
        return unmasked(given)
    except Exception as error:  # ragged lists; tensors of other devices
        raise ValueError(f"{argument}: {what} are not an array of numbers: {error}") from error


def _check_shape(array: NDArray[Any], argument: str, what: str, shape: str, hint: str = "") -> None:
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(
            f"{argument}: {what} have the shape {array.shape}; it must be {shape}{hint}"
        )


def _called(thing: Any) -> str:
    """`a trimesh.base.Trimesh`."""
    kind = type(thing)
    module = "" if kind.__module__ == "builtins" else f"{kind.__module__}."
    return f"a {module}{kind.__qualname__}"
