"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A file to fill, which takes the name `path` at the end.

    A folder that cannot be written is an error here, before the work. After an exception nothing has
    changed. A link stays one: what it names is written.
    """
    given, target = Path(path), Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(f"{given} is a folder; give the name of a file")
    if target.exists() and not target.is_file():
        raise OSError(f"{given} is a device or a pipe; give the name of a file")
    try:
        handle, temporary = tempfile.mkstemp(prefix=".ifg-", suffix=".part", dir=target.parent)
    except OSError as error:  # whose text names the temporary file
        reason = f"cannot write into the folder: {error.strerror}"
        raise type(error)(error.errno, reason, str(given)) from None
    try:
        with open(handle, "wb") as file:
            yield file
        Path(temporary).chmod(0o666 & ~_umask())
        os.replace(temporary, target)
    except BaseException:
        os.unlink(temporary)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
