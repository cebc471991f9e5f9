"""Wardrobe batches on many processes or machines.

    >>> from ifgarments import batch
    >>> entries = batch.run("wardrobe", combinations, "out", workers=8)
    >>> entries = batch.run("wardrobe", combinations, "out", engine="ray")

The list is cut into parts; each is a task that may be repeated, because what is done is taken. The
result has the files of one process that did all of it.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Any

from ._arguments import folder, pairs, whole
from ._wardrobe import Wardrobe
from .errors import BusyError

Combination = tuple[str, Sequence[str]]
_Part = tuple[str, str, list[tuple[str, list[str]]], str, dict[str, Any]]

#: Seconds between looks at a part that another process writes, and their number. On a node that the
#: others take for dead, a worker may go on for a while.
_PAUSE, _LOOKS = 5.0, 60


def run(
    wardrobe: str | os.PathLike[str],
    combinations: Iterable[Combination],
    out: str | os.PathLike[str],
    *,
    engine: str = "processes",
    workers: int | None = None,
    size: int = 8,
    retries: int = 3,
    progress: Callable[[int, int], object] | None = None,
    **options: Any,
) -> list[dict[str, Any]]:
    """Does a batch in parts.

    Args:
        wardrobe: folder of the wardrobe, which all workers can read.
        combinations: as in :meth:`Wardrobe.batch`.
        out: folder of the results, which all workers can write.
        engine: ``"processes"`` of this machine, or ``"ray"``: the cluster that ``ray.init`` finds.
        workers: number of processes; all cores by default. Not for Ray.
        size: combinations of a part.
        retries: how often a part is repeated whose worker was killed.
        progress: is called with the numbers of combinations done and of all.
        options: others of :meth:`Wardrobe.batch`; ``threads`` of a worker are 1 by default.

    Returns:
        As :meth:`Wardrobe.batch`.
    """
    if engine not in _ENGINES:
        raise ValueError(f"engine is {engine!r}; it must be one of {', '.join(_ENGINES)}")
    size = whole(size, "size", 1, 1_000_000)
    retries = whole(retries, "retries", 0, 1_000_000)
    workers = None if workers is None else whole(workers, "workers", 1, 1024)
    wardrobe, out = folder(wardrobe, "wardrobe"), folder(out, "out")
    given = pairs(combinations)
    options = {"threads": 1, **options}
    parts: list[_Part] = [
        (f"{first:08}", str(wardrobe), given[first : first + size], str(out), options)
        for first in range(0, len(given), size)
    ]
    done = 0
    for count in _ENGINES[engine](parts, workers, retries):
        done += count
        if progress is not None:
            progress(done, len(given))
    # Again would repeat what the parts have done.
    return Wardrobe(wardrobe).batch(given, out, **{**options, "again": False})


def _do(part: _Part) -> int:
    """A part, in a worker; returns its number of combinations."""
    name, wardrobe, combinations, out, options = part
    do = partial(Wardrobe(wardrobe).batch, combinations, out, part=name, **options)
    for _ in range(_LOOKS - 1):
        try:
            return len(do())
        except BusyError:
            time.sleep(_PAUSE)
    return len(do())


def _processes(parts: list[_Part], workers: int | None, retries: int) -> Iterator[int]:
    # Forked threads of this process would not exist in the workers.
    context = multiprocessing.get_context("spawn")
    for left in reversed(range(retries + 1)):
        remaining = dict(enumerate(parts))
        try:
            with ProcessPoolExecutor(workers, mp_context=context) as pool:
                try:
                    futures = {pool.submit(_do, part): k for k, part in remaining.items()}
                    for future in as_completed(futures):
                        count = future.result()
                        del remaining[futures[future]]
                        yield count
                except BaseException:  # an error, Ctrl-C, or of `progress`: parts that wait are not begun
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
            return
        except BrokenProcessPool:
            if left == 0:
                raise
            parts = list(remaining.values())


def _ray(parts: list[_Part], workers: int | None, retries: int) -> Iterator[int]:
    import ray  # type: ignore[import-not-found, unused-ignore]

    task = ray.remote(max_retries=retries, num_cpus=parts[0][4]["threads"] if parts else 1)(_do)
    open_tasks = [task.remote(part) for part in parts]
    try:
        while open_tasks:
            finished, open_tasks = ray.wait(open_tasks)
            yield from ray.get(finished)
    except BaseException:
        for waiting in open_tasks:
            ray.cancel(waiting)
        raise


_ENGINES = {"processes": _processes, "ray": _ray}
