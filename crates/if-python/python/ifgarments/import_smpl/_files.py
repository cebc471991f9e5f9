"""Arrays of npz and HDF5 files, with errors that name file, key and shape."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CaptureError

Reals = NDArray[np.float64]


def needed(module: str) -> Any:
    """An optional module.

    Raises:
        ImportError: it is not installed; the message says what to install.
    """
    try:
        return __import__(module, fromlist=["_"])
    except ImportError as error:
        text = f"{error}; captures of other projects need h5py and Pillow: pip install h5py pillow"
        raise ImportError(text) from None


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """All arrays of an npz file; pickled objects are not read."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            if not hasattr(archive, "files"):
                raise CaptureError(path, None, "is a single array; it must be an npz archive")
            content = {}
            for key in archive.files:
                try:
                    content[key] = archive[key]
                except ValueError:  # an array of objects; it matters only if it is needed
                    continue
            return content
    except CaptureError:
        raise
    except OSError as error:
        raise CaptureError(path, None, f"cannot be read: {error.strerror or error}") from None
    except Exception as error:  # a damaged archive raises nearly any exception
        raise CaptureError(path, None, f"is not a valid npz file: {error}") from None


def take(path: Path, content: dict[str, NDArray[Any]], *keys: str) -> NDArray[Any]:
    """The array under the first of these keys that is there."""
    for key in keys:
        if key in content:
            return content[key]
    others = f" (also `{'`, `'.join(keys[1:])}`)" if len(keys) > 1 else ""
    found = ", ".join(sorted(content)) or "nothing"
    raise CaptureError(path, keys[0], f"is missing{others}; found: {found}")


def reals(path: Path, key: str, value: Any, shape: Sequence[int | None]) -> Reals:
    """Finite numbers of a shape, in which ``None`` is any length of at least 1."""
    found = np.asarray(value)
    wanted = "(" + ", ".join("n" if s is None else str(s) for s in shape) + ")"
    if found.dtype.kind not in "fiub":
        raise CaptureError(path, key, f"holds {found.dtype}; it must hold numbers, shape {wanted}")
    fits = found.ndim == len(shape) and all(
        n >= 1 and s in (None, n) for n, s in zip(found.shape, shape, strict=True)
    )
    if not fits:
        raise CaptureError(path, key, f"has shape {found.shape}; it must be {wanted}")
    values = found.astype(np.float64)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        at = tuple(int(i) for i in bad[0])
        raise CaptureError(path, key, f"is {values[at]} at {list(at)}; it must be finite")
    return values


def numbered(folder: Path, *endings: str) -> list[Path]:
    """The files of a folder with these endings, in the order of the last number in their names.

    Raises:
        CaptureError: the folder is missing, or has none.
    """
    if not folder.is_dir():
        raise CaptureError(folder, None, "is missing; it must be a folder")
    files = [p for p in folder.iterdir() if p.suffix.lower() in endings]
    if not files:
        raise CaptureError(folder, None, f"has no files *{', *'.join(endings)}")

    def order(path: Path) -> tuple[int, str]:
        numbers = re.findall(r"\d+", path.stem)
        return (int(numbers[-1]) if numbers else -1, path.name)

    return sorted(files, key=order)
