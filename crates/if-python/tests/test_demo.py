"""The built-in scene gives the bytes that the command `ifg demo` writes.

IFG_DEMO names the folder that `ifg demo --out` wrote.
"""

import json
import os
import pathlib

import numpy as np
import pytest

import ifgarments


def coordinates(path):
    """The positions of a binary PLY file of single precision, as bytes."""
    data = path.read_bytes()
    header, rest = data.split(b"end_header\n", 1)
    count = next(
        int(line.split()[2]) for line in header.split(b"\n") if line.startswith(b"element vertex")
    )
    assert b"property float x" in header and b"binary_little_endian" in header
    return rest[: 12 * count]


@pytest.mark.skipif("IFG_DEMO" not in os.environ, reason="IFG_DEMO names no output of `ifg demo`")
def test_the_demo_gives_the_bytes_of_the_command():
    folder = pathlib.Path(os.environ["IFG_DEMO"])
    body, layers = ifgarments.demo_scene()
    for name, (v, _) in {"body": body, **layers}.items():
        assert v.astype("<f4").tobytes() == coordinates(folder / "input" / f"{name}.ply")
    resolved = ifgarments.resolve(body, layers)
    for name, (v, _) in resolved.layers.items():
        assert v.dtype == np.float32
        assert v.astype("<f4").tobytes() == coordinates(folder / f"{name}.ply")
    receipt = json.loads((folder / "receipt.json").read_text())
    assert receipt["tool"]["build"] == ifgarments.BUILD and receipt["state"] == resolved.state
    assert receipt["report"] == without_seconds(resolved.report)


def without_seconds(value):
    if isinstance(value, dict):
        return {key: without_seconds(v) for key, v in value.items() if key != "seconds"}
    return [without_seconds(v) for v in value] if isinstance(value, list) else value


def test_bad_sizes_of_the_demo_are_named():
    with pytest.raises(ifgarments.ParameterError, match="`resolution` is 100; it must be from 0.7"):
        ifgarments.demo_scene(resolution=100)
    assert list(ifgarments.demo_scene(trousers=True, resolution=0.7)[1])[0] == "trousers"
