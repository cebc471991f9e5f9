"""What `resolve` and `verify` return."""

import os
import pickle
import threading

import numpy as np
import pytest

import ifgarments
from conftest import BALL


def test_layers_are_resolved_and_verified(body, belt, shirt):
    assert ifgarments.verify(body, [belt, shirt]).state == "not clean"
    resolved = ifgarments.resolve(body, [belt, shirt])
    assert resolved.state == "clean everywhere" and resolved.is_clean
    found = ifgarments.verify(body, resolved.layers)
    assert found.state == "clean everywhere"
    assert [pair["outer"] for pair in found.report["pairs"]] == [
        "layers[0]",
        "layers[1]",
        "layers[1]",
    ]
    assert resolved.report["before"]["pairs"][0]["pairs"]["crossing"] > 0
    assert [layer["name"] for layer in resolved.report["layers"]] == ["layers[0]", "layers[1]"]
    assert min(np.linalg.norm(v, axis=1).min() for v, _ in resolved.layers) > 0.97 * BALL


def test_inputs_are_not_changed(body, belt):
    before = [part.copy() for part in (*body, *belt)]
    resolved = ifgarments.resolve(body, [belt])
    for then, now in zip(before, (*body, *belt)):
        assert np.array_equal(then, now)
    resolved.layers[0][0][:] = 0.0
    resolved.layers[0][1][:] = 0
    assert np.array_equal(before[2], belt[0]) and np.array_equal(before[3], belt[1])


def test_the_collection_comes_back(body, belt, shirt):
    pairs = ifgarments.resolve(body, [("belt", belt), ("shirt", shirt)])
    assert [name for name, _ in pairs.layers] == ["belt", "shirt"]
    mapping = ifgarments.resolve(body, {"belt": belt, "shirt": shirt})
    assert list(mapping.layers) == ["belt", "shirt"]
    mixed = ifgarments.resolve(body, (belt, ["shirt", shirt]))
    assert mixed.layers[1][0] == "shirt" and len(mixed.layers[0]) == 2
    for (_, (v, _)), w in zip(pairs.layers, mapping.layers.values()):
        assert np.array_equal(v, w[0])
    assert np.array_equal(mixed.layers[0][0], mapping.layers["belt"][0])
    assert ifgarments.resolve(body, []).layers == []


def test_float32_is_proven_as_float32(body, belt, shirt):
    single = [(v.astype(np.float32), f) for v, f in (belt, shirt)]
    resolved = ifgarments.resolve(body, single)
    assert all(v.dtype == np.float32 for v, _ in resolved.layers)
    assert ifgarments.verify(body, resolved.layers).is_clean
    doubles = [(v.astype(np.float64), f) for v, f in resolved.layers]
    assert ifgarments.verify(body, doubles).is_clean
    mixed = ifgarments.resolve(body, [single[0], shirt]).layers
    assert [v.dtype for v, _ in mixed] == [np.float32, np.float64]


@pytest.mark.parametrize("kind", ["i4", "i8", "u4", "u8", ">i4", "u2"])
def test_faces_of_every_integer_kind_give_the_same(body, belt, kind):
    wanted = ifgarments.resolve(body, [belt]).layers[0][0]
    faces = belt[1].astype(kind)
    v, f = ifgarments.resolve(body, [(belt[0], faces)]).layers[0]
    assert np.array_equal(v, wanted) and f.dtype == faces.dtype and np.array_equal(f, faces)


def test_every_layout_gives_the_same(body, belt):
    wanted = ifgarments.resolve(body, [belt]).layers[0][0]
    v, f = belt
    padded = np.zeros((2 * len(v), 4))[::2, :3]
    padded[:] = v
    read_only = v.copy()
    read_only.flags.writeable = False
    layouts = [
        (np.asfortranarray(v), np.asfortranarray(f)),
        (padded, f[::-1][::-1]),
        (v.astype(">f8"), f),
        (read_only, f),
        (v.tolist(), f.tolist()),
        [v, f],
    ]
    for mesh in layouts:
        assert np.array_equal(ifgarments.resolve(body, [mesh]).layers[0][0], wanted)
    whole = (1000 * v).round().astype(np.int32)
    assert ifgarments.verify((np.round(body[0] * 1000) / 100, body[1]), [(whole // 100, f)])


def test_results_do_not_depend_on_threads(body, belt, shirt):
    one, three = (ifgarments.resolve(body, [belt, shirt], threads=n).layers for n in (1, 3))
    for (v, _), (w, _) in zip(one, three):
        assert np.array_equal(v, w)


def test_calls_from_several_threads_give_the_same(body, belt):
    wanted, found = ifgarments.resolve(body, [belt]).layers[0][0], []
    work = lambda: found.append(ifgarments.resolve(body, [belt], threads=1).layers[0][0])
    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 4 and all(np.array_equal(v, wanted) for v in found)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")
def test_a_forked_process_can_resolve(body, belt):
    wanted = ifgarments.resolve(body, [belt]).layers[0][0]
    child = os.fork()
    if child == 0:  # no exception may leave the child
        try:
            same = np.array_equal(ifgarments.resolve(body, [belt]).layers[0][0], wanted)
            os._exit(0 if same else 1)
        except BaseException:
            os._exit(2)
    assert os.waitpid(child, 0)[1] == 0


def test_a_layer_that_needs_nothing_keeps_its_bits(body):
    from conftest import band

    loose = band(1.1 * BALL)
    assert np.array_equal(ifgarments.resolve(body, [loose]).layers[0][0], loose[0])


def test_clearance_and_parameters_are_used(body, belt):
    near, far = (
        ifgarments.resolve(body, [belt], clearance=c).report["after"]["pairs"][0]["least_distance"]
        for c in (0.5e-3, 4e-3)
    )
    assert near["distance"] < 2e-3 < far["distance"]
    by_name = [
        {"clearance": 4e-3},
        {"goal.clearance": np.float64(4e-3)},
        {"goal": {"clearance": 4e-3}},
    ]
    for params in by_name:
        again = ifgarments.resolve(body, [belt], params=params).report
        assert again["after"]["pairs"][0]["least_distance"] == far
    assert ifgarments.default_params()["goal"]["clearance"] == 3e-4


def test_what_remains_is_raised_with_what_was_reached(body, belt):
    twin = (belt[0].copy(), belt[1])
    with pytest.raises(ifgarments.IntersectionsRemain) as caught:
        ifgarments.resolve(body, {"belt": belt, "twin": twin}, params={"rounds": 1})
    error = caught.value
    assert str(error).endswith("remain") and "`twin`" in str(error)
    between = error.unresolved["between"]
    assert between["outer"] == "twin" and between["pairs"] + between["inside"] > 0
    assert error.partial.state == "not clean" and not error.partial.is_clean
    assert list(error.partial.layers) == ["belt", "twin"]
    pairs = ifgarments.verify(body, error.partial.layers).report["pairs"]
    assert sum(sum(pair["pairs"].values()) for pair in pairs) == between["pairs"]
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) and again.unresolved == error.unresolved


def crossed():
    """A band of cloth round the ball, and two triangles away from it that cross in one edge."""
    from conftest import band

    v, f = band(1.1 * BALL)
    flat = [[0, 0.4, 0], [0.05, 0.4, 0], [0, 0.4, 0.05]]
    upright = [[0.01, 0.38, 0.01], [0.01, 0.42, 0.01], [0.01, 0.42, 0.02]]
    return np.vstack([v, flat, upright]), np.vstack([f, [[0, 1, 2], [3, 4, 5]] + np.array(len(v))])


def test_strict_refuses_garments_that_intersect_themselves(body):
    keep = {"own": "keep"}
    assert ifgarments.resolve(body, [crossed()], params=keep).state == "clean between layers"
    with pytest.raises(
        ifgarments.IntersectionsRemain, match=r"own pairs of `layers\[0\]`: 1"
    ) as caught:
        ifgarments.resolve(body, [crossed()], params=keep, strict=True)
    assert caught.value.unresolved == {"between": None, "own": {"layers[0]": 1}, "triangles": []}
    assert caught.value.partial.state == "clean between layers"
    assert ifgarments.resolve(body, [crossed()], strict=True).state == "clean everywhere"


def test_notes_say_what_was_assumed_of_the_body(body, belt):
    assert ifgarments.verify(body, [belt]).notes == []
    v, f = body
    notes = ifgarments.verify((v, f[:-2]), [belt]).notes
    assert len(notes) == 1 and notes[0].startswith("`body`: "), notes
    lying = ifgarments.verify((v * [1, 0.4, 1], f), []).notes
    assert "y must point up" in lying[0]


def test_triangles_of_arrays_may_be_split(body):
    from conftest import band

    coarse = band(1.1 * BALL, around=3, along=1, height=0.3)
    v, f = ifgarments.resolve(body, [coarse], params={"split": "if_strained"}).layers[0]
    assert len(v) > len(coarse[0]) and len(f) > len(coarse[1]) and f.max() == len(v) - 1
    assert ifgarments.verify(body, [(v, f)]).is_clean


def test_a_picture_shows_intersections_in_red(body, belt, tmp_path):
    resolved = ifgarments.resolve(body, [belt])
    path = tmp_path / "after.png"
    png = ifgarments.picture(body, resolved.layers, path, height=160)
    assert png[:8] == b"\x89PNG\r\n\x1a\n" and path.read_bytes() == png
    assert ifgarments.picture(body, [belt], height=160) != png
    with pytest.raises(ValueError, match="height is 1;"):
        ifgarments.picture(body, [belt], height=1)


def test_intersections_are_listed_as_verify_counts_them(body, belt, shirt):
    layers = {"belt": belt, "shirt": shirt}
    found = {(p.inner, p.outer): p.triangles for p in ifgarments.intersections(body, layers)}
    pairs = ifgarments.verify(body, layers).report["pairs"]
    counts = {(p["inner"], p["outer"]): sum(p["pairs"].values()) for p in pairs}
    assert {key: len(triangles) for key, triangles in found.items()} == {
        key: n for key, n in counts.items() if n
    }
    triangles = found["body", "belt"]
    assert triangles.shape[1] == 2 and triangles[:, 0].max() < len(body[1])
    assert not ifgarments.intersections(body, ifgarments.resolve(body, layers).layers)
    v, f = belt
    twice = (np.vstack([v, v + [0, 0.01, 0.001]]), np.vstack([f, f + len(v)]))
    assert ("cloth", "cloth") in {p[:2] for p in ifgarments.intersections(body, {"cloth": twice})}


def test_numbers_of_numpy_are_numbers(body, belt):
    plain = {"rounds": 50, "goal": {"clearance": 0.001}}
    wanted = ifgarments.resolve(body, [belt], threads=2, params=plain)
    given = {"rounds": np.uint16(50), "goal": {"clearance": np.longdouble(0.001)}}
    found = ifgarments.resolve(body, [belt], threads=np.int64(2), params=given)
    assert np.array_equal(found.layers[0][0], wanted.layers[0][0])
    assert ifgarments.picture(body, [belt], height=np.int32(32)).startswith(b"\x89PNG")
