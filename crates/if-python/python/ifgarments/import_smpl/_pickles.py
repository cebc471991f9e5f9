"""Arrays in pickle files, without running what the files name.

A pickle is a program that may call any function. Here every class and function becomes a
:class:`_Record`, which keeps its arguments and state; nothing is imported and nothing is called.
Arrays of numpy, sparse matrices of scipy and constants of chumpy are then made from their records.
"""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CaptureError

#: Kinds of numbers that are read: booleans, integers, floats, and their bytes.
_NUMBERS = frozenset("b1 i1 i2 i4 i8 u1 u2 u4 u8 f2 f4 f8".split())
#: Entries of a sparse matrix when it is full; a joint regressor of SMPL-X has 0.6 million.
_MOST_ENTRIES = 100_000_000
#: The unpickler in Python: the one in C allocates as many places as a file says.
_Unpickler: Any = pickle._Unpickler


class _Record:
    """What a pickle says of an object."""

    name = ""
    arguments: tuple[Any, ...]
    state: Any

    def __new__(cls, *arguments: Any, **_named: Any) -> _Record:
        self = object.__new__(cls)
        self.arguments, self.state = arguments, None
        return self

    def __init__(self, *_arguments: Any, **_named: Any) -> None:
        pass

    def __setstate__(self, state: Any) -> None:
        self.state = state

    @property
    def origin(self) -> str:
        """The class of the object; old pickles give it as an argument of a constructor."""
        first = self.arguments[0] if self.arguments else None
        made = self.name in ("copy_reg._reconstructor", "copyreg._reconstructor")
        return str(getattr(first, "name", "")) if made else self.name


class _RecordingUnpickler(_Unpickler):  # type: ignore[misc]
    def find_class(self, module: str, name: str) -> type[_Record]:
        return type("_Named", (_Record,), {"name": f"{module}.{name}"})


def read_pickle(path: Path) -> dict[str, Any]:
    """The dictionary in a pickle file, of Python 2 or 3. Values are for :func:`array`.

    Raises:
        CaptureError: the file is missing, damaged, or holds something else.
    """
    try:
        stream = io.BytesIO(path.read_bytes())
        content = _RecordingUnpickler(stream, encoding="latin1").load()
    except OSError as error:
        raise CaptureError(path, None, f"cannot be read: {error.strerror}") from None
    except Exception as error:  # a damaged pickle raises nearly any exception
        raise CaptureError(path, None, f"is not a valid pickle file: {error!r}") from None
    if not isinstance(content, dict):
        raise CaptureError(path, None, f"holds {_kind(content)}; it must hold a dictionary")
    return content


def array(path: Path, content: dict[str, Any], key: str) -> NDArray[Any]:
    """The array under a key of what :func:`read_pickle` read.

    Raises:
        CaptureError: the key is missing, or its value is not an array of numbers.
    """
    if key not in content:
        found = ", ".join(sorted(map(str, content))[:20])
        raise CaptureError(path, key, f"is missing; found: {found}")
    try:
        return np.asarray(_value(content[key], 0))
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, MemoryError) as error:
        raise CaptureError(path, key, f"is not an array of numbers: {error}") from None


def _kind(value: Any) -> str:
    return value.origin if isinstance(value, _Record) else type(value).__name__


def _value(value: Any, depth: int) -> NDArray[Any]:
    """An array from its record. ``depth`` counts nested chumpy objects."""
    if isinstance(value, (bool, int, float)):
        return np.asarray(value)
    if isinstance(value, (list, tuple)) and all(isinstance(v, (bool, int, float)) for v in value):
        return np.asarray(value)
    if not isinstance(value, _Record):
        raise ValueError(f"it is a {_kind(value)}")
    module, _, name = value.origin.rpartition(".")
    if name == "_reconstruct":
        return _dense(value.state)
    if name == "scalar" and module.endswith("multiarray"):
        kind, data = value.arguments
        return _numbers(kind, data, (), False)
    if name == "_frombuffer":
        data, kind, shape, order = value.arguments
        return _numbers(kind, data, shape, order == "F")
    if name.endswith(("csc_matrix", "csr_matrix", "csc_array", "csr_array")):
        return _sparse(value.state, by_column=name.startswith("csc"), depth=depth)
    if module.startswith("chumpy"):
        return _chumpy(name, value.state, depth)
    raise ValueError(f"it is a {value.origin}")


def _dense(state: Any) -> NDArray[Any]:
    """An array from the state that numpy writes: version, shape, type, column order, bytes."""
    *_, shape, kind, columns_first, data = state
    return _numbers(kind, data, shape, bool(columns_first))


def _numbers(kind: Any, data: Any, shape: Any, columns_first: bool) -> NDArray[Any]:
    if isinstance(data, _Record):  # Python 3 writes bytes for Python 2 as encoded text
        data = data.arguments[0]
    if isinstance(data, str):
        data = data.encode("latin1")
    code = kind.arguments[0]
    if code not in _NUMBERS:
        raise ValueError(f"it holds values of kind {code!r}, not numbers")
    order = kind.state[1] if kind.state is not None else "="
    dtype = np.dtype(code).newbyteorder({"<": "<", ">": ">"}.get(order, "="))
    flat = np.frombuffer(data, dtype=dtype)
    if columns_first:
        return flat.reshape(shape[::-1]).T
    return flat.reshape(shape)


def _sparse(state: Any, *, by_column: bool, depth: int) -> NDArray[Any]:
    """A full matrix from compressed columns, or rows."""
    shape = state.get("_shape", state.get("shape"))
    rows, columns = (int(n) for n in shape)
    lines, places = (columns, rows) if by_column else (rows, columns)
    if min(rows, columns) < 0 or rows * columns > _MOST_ENTRIES:
        raise ValueError(f"it is a sparse matrix of {rows} × {columns} entries")
    data, at, starts = (_value(state[k], depth + 1) for k in ("data", "indices", "indptr"))
    counts: NDArray[np.int64] = np.diff(starts.astype(np.int64)).astype(np.int64)
    if len(starts) != lines + 1 or counts.min(initial=0) < 0 or counts.sum() != len(data):
        raise ValueError("it is a sparse matrix whose index pointers are invalid")
    if len(at) != len(data) or (len(at) and not 0 <= at.min() <= at.max() < places):
        raise ValueError("it is a sparse matrix whose indices are out of range")
    full = np.zeros((lines, places))
    np.add.at(full, (np.repeat(np.arange(lines), counts), at), data)
    return full.T if by_column else full


#: chumpy objects within others.
_DEEPEST = 16


def _chumpy(name: str, state: Any, depth: int) -> NDArray[Any]:
    """A constant, or elements selected from one."""
    if depth > _DEEPEST:
        raise ValueError(f"it nests more than {_DEEPEST} objects of chumpy")
    if name == "Ch":
        return _value(state["x"], depth + 1)
    if name == "Select":
        whole, at = _value(state["a"], depth + 1), _value(state["idxs"], depth + 1)
        chosen: NDArray[Any] = whole.ravel()[at]
        shape = state.get("preferred_shape")
        return chosen if shape is None else chosen.reshape(_value(shape, depth + 1).astype(int))
    raise ValueError(f"it is a chumpy expression, `{name}`; save its value (`.r`) instead")
