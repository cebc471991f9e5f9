"""Outfits and motions as USD files."""

import re

import numpy as np
import pytest
from conftest import ball, band
from ifgarments import usd

FRAMES = 3


def moved(vertices):
    """Positions whose digits fill single precision."""
    at = vertices[None] * np.array([1.0, 1.1, 1 / 3])[:, None, None] + [0.1, -1e-7, 1e4]
    return at.astype(np.float32)


def point_cache(path, positions):
    head = b"POINTCACHE2\0" + np.array([1, positions.shape[1]], "<i4").tobytes()
    head += np.array([0, 1], "<f4").tobytes() + np.array([len(positions)], "<i4").tobytes()
    path.write_bytes(head + positions.astype("<f4").tobytes())
    return path


@pytest.fixture
def written(tmp_path):
    body, belt = ball(rings=5, around=6), band(around=7)
    frames = {"body": moved(body[0]), "été 2": moved(belt[0])}
    cache = point_cache(tmp_path / "belt.pc2", frames["été 2"])
    meshes = {"body": body, "été 2": belt, "still": ball(rings=4, around=5)}
    usd.write(tmp_path / "a.usda", meshes, {"body": frames["body"], "été 2": cache}, fps=25)
    return tmp_path / "a.usda", meshes, frames


def test_the_text_has_all_bits_of_all_frames(written):
    path, meshes, frames = written
    text = path.read_text("utf-8")
    assert re.search(r"metersPerUnit = 1\n\s+upAxis = \"Y\"", text)
    blocks = re.findall(r"point3f\[\] points.timeSamples = \{\n(.*?)\n        \}", text, re.S)
    assert len(blocks) == 2
    for block, positions in zip(blocks, frames.values(), strict=True):
        for frame, line in enumerate(block.splitlines()):
            time, values = line.split(":")
            found = np.array(re.findall(r"[-+\d.e]+", values), np.float32).reshape(-1, 3)
            assert int(time) == frame and np.array_equal(found, positions[frame])


def test_pixars_reader_sees_the_same_meshes(written):
    pxr = pytest.importorskip("pxr", reason="needs usd-core: pip install usd-core")
    from pxr import Usd, UsdGeom

    path, meshes, frames = written
    stage = Usd.Stage.Open(str(path))
    assert pxr and stage.GetDefaultPrim().GetName() == "outfit"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdGeom.GetStageUpAxis(stage) == "Y"
    times = (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond())
    assert times == (0, FRAMES - 1, 25)
    prims = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert [prim.GetName() for prim in prims] == ["body", "_t__2", "still"]
    assert prims[1].GetDisplayName() == "été 2"
    for prim, (name, (v, f)) in zip(prims, meshes.items(), strict=True):
        mesh = UsdGeom.Mesh(prim)
        corners, counts = mesh.GetFaceVertexIndicesAttr().Get(), mesh.GetFaceVertexCountsAttr().Get()
        assert np.array_equal(np.array(corners).reshape(-1, 3), f) and set(counts) == {3}
        assert mesh.ValidateTopology(corners, counts, len(v))[0]
        assert np.array_equal(np.array(mesh.GetPointsAttr().Get()), v.astype(np.float32))
        for frame in range(FRAMES):
            at = np.array(mesh.GetPointsAttr().Get(frame))
            truth = frames[name][frame] if name in frames else v.astype(np.float32)
            assert np.array_equal(at, truth)
            extent = np.array(mesh.GetExtentAttr().Get(frame))
            assert np.array_equal(extent, [truth.min(axis=0), truth.max(axis=0)])


def test_only_control_characters_are_escaped(tmp_path):
    names = ("a\u200b", "\xa0\u00ad", "\N{GRINNING FACE}", 'q"\\', "tab\t\x7f")
    usd.write(tmp_path / "a.usda", {name: ball(rings=4, around=5) for name in names})
    shown = re.findall(r'displayName = "(.*)"\n', (tmp_path / "a.usda").read_text("utf-8"))
    assert shown == [*names[:3], 'q\\"\\\\', r"tab\x09\x7f"]


@pytest.mark.parametrize(
    "meshes, more, words",
    [
        ([ball()], {}, "meshes is a list"),
        ({"a": ball()}, {"frames": [1]}, "frames is a list"),
        ({"a": ball()}, {"fps": "fast"}, "fps is 'fast'; give a number"),
    ],
)
def test_arguments_of_a_wrong_kind_are_named(tmp_path, meshes, more, words):
    with pytest.raises(TypeError) as caught:
        usd.write(tmp_path / "a.usda", meshes, **more)
    assert words in str(caught.value)


def test_nothing_moves_without_frames(tmp_path):
    usd.write(tmp_path / "a.usda", {"ball": ball()})
    text = (tmp_path / "a.usda").read_text()
    assert "timeSamples" not in text and "startTimeCode" not in text


def nan(positions):
    positions = positions.copy()
    positions[1, 2, 0] = np.inf
    return positions


V, F = ball(rings=5, around=6)


@pytest.mark.parametrize(
    "meshes, frames, words",
    [
        ({}, None, "meshes is empty"),
        ({"a": (V, F), "b": (V[:0], F[:0])}, None, "meshes['b']: has no vertices"),
        ({"a": (V, F + 1)}, None, f"is {len(V)}; there are {len(V)} vertices"),
        ({"a": (V * 1e40, F)}, None, "meshes['a']: vertex 0: coordinate y is"),
        ({"a b": (V, F), "a-b": (V, F)}, None, "'a b' and 'a-b' are both called a_b"),
        ({"a": (V, F)}, {"b": moved(V)}, "frames['b']: there is no such mesh"),
        ({"a": (V, F)}, {"a": moved(V)[:, 1:]}, f"must be ('frames', {len(V)}, 3)"),
        ({"a": (V, F)}, {"a": moved(V)[:0]}, "has the shape (0, "),
        ({"a": (V, F)}, {"a": nan(moved(V))}, "frame 1: vertex 2: coordinate x is inf"),
        ({"a": (V, F), "b": (V, F)}, {"a": moved(V), "b": moved(V)[:2]}, "has 2 frames, but 'a'"),
    ],
)
def test_what_does_not_fit_is_named_and_the_old_file_stays(tmp_path, meshes, frames, words):
    (tmp_path / "a.usda").write_text("old")
    with pytest.raises(ValueError) as caught:
        usd.write(tmp_path / "a.usda", meshes, frames)
    assert words in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["a.usda"]
    assert (tmp_path / "a.usda").read_text() == "old"


def test_damaged_point_caches_are_named(tmp_path):
    whole = point_cache(tmp_path / "a.pc2", moved(V)).read_bytes()
    assert np.array_equal(usd.read_point_cache(tmp_path / "a.pc2"), moved(V))
    for damaged in (b"", whole[:31], b"X" + whole[1:], whole[:-1], whole + b"0"):
        (tmp_path / "b.pc2").write_bytes(damaged)
        with pytest.raises(ValueError, match="b.pc2"):
            usd.read_point_cache(tmp_path / "b.pc2")
    with pytest.raises(ValueError, match="usda"):
        usd.write(tmp_path / "a.usd", {"a": (V, F)})
    with pytest.raises(ValueError, match="fps"):
        usd.write(tmp_path / "a.usda", {"a": (V, F)}, fps=0)
