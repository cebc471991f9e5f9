"""Outfits that follow motions."""

import base64
import json
import re

import ifgarments
import meshio
import numpy as np
import pytest
import trimesh

SKELETON = {
    "joints": [
        {"id": 0, "name": "root", "parent": -1, "head": [0, -0.3, 0], "tail": [0, 0, 0]},
        {"id": 1, "name": "top", "parent": 0, "head": [0, 0, 0], "tail": [0, 0.3, 0]},
    ]
}


def turned(angle):
    return [np.cos(angle / 2), np.sin(angle / 2), 0, 0]


MOTION = {
    "fps": 25,
    "joints": ["root", "top"],
    "frames": [
        {"root_t": [0, 0.01 * k, 0], "rot": [turned(0), turned(0.05 * k)]} for k in range(3)
    ],
}


@pytest.fixture
def outfit(body, belt, shirt):
    resolved = ifgarments.resolve(body, {"belt": belt, "shirt": shirt})
    y = body[0][:, 1]
    joints = np.tile([0, 1, 0, 0], (len(y), 1))
    top = np.clip(0.5 + y / 0.2, 0, 1)
    return body, resolved.layers, {"body": (joints, np.stack([1 - top, top, 0 * y, 0 * y], axis=1))}


def moved(outfit, skeleton=SKELETON, motion=MOTION, **arguments):
    body, layers, weights = outfit
    return ifgarments.animate(
        body, layers, motion, skeleton=skeleton, weights=weights, **arguments
    )


def skinned(path, body, joints, weights):
    """Writes the body as glTF, with a skin on the joints of SKELETON."""
    positions, faces = body[0].astype("<f4"), body[1].astype("<u4")
    bind = np.tile(np.eye(4, dtype="<f4"), (2, 1, 1))
    bind[0, 3, 1] = 0.3  # of columns: the root stands at y = -0.3
    parts = [
        (positions, "VEC3", 5126, len(positions)),
        (joints.astype("<u2"), "VEC4", 5123, len(positions)),
        (weights.astype("<f4"), "VEC4", 5126, len(positions)),
        (faces, "SCALAR", 5125, faces.size),
        (bind, "MAT4", 5126, 2),
    ]
    buffer, views, accessors = b"", [], []
    for k, (array, kind, component, count) in enumerate(parts):
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": array.nbytes})
        accessors.append(
            {"bufferView": k, "componentType": component, "count": count, "type": kind}
        )
        buffer += array.tobytes()
    accessors[0] |= {"min": positions.min(0).tolist(), "max": positions.max(0).tolist()}
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "body", "mesh": 0, "skin": 0},
            {"name": "root", "translation": [0, -0.3, 0], "children": [2]},
            {"name": "top", "translation": [0, 0.3, 0]},
        ],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}],
        "buffers": [{"byteLength": len(buffer), "uri": uri}],
        "bufferViews": views,
        "accessors": accessors,
    }
    path.write_text(json.dumps(document))


def test_every_frame_is_clean_and_follows_the_motion(outfit, tmp_path):
    body, layers, weights = outfit
    seen = []
    done = moved(outfit, progress=seen.append)
    assert done.is_clean and done.notes == ["Weights taken from the body: belt, shirt"]
    assert done.noticed["weights_from_body"] == ["belt", "shirt"]
    assert done.noticed["joints_not_in_motion"] == [] and done.noticed["skeleton_from_skin"] is None
    assert list(done.layers) == ["belt", "shirt"]
    assert done.body.shape == (3, len(body[0]), 3) and done.body.dtype == np.float32
    assert {p.stage for p in seen} >= {"frame"}
    for k in range(3):
        posed = {name: (at[k], layers[name][1]) for name, at in done.layers.items()}
        assert ifgarments.verify((done.body[k], body[1]), posed).is_clean
    # The lowest vertex follows the root alone.
    low = body[0][:, 1].argmin()
    assert np.allclose(done.body[2, low] - body[0][low], [0, 0.02, 0], atol=1e-6)
    # Files are the same as mappings, one thread as several, and frames of before are kept.
    for name, value in (("skeleton", SKELETON), ("motion", MOTION)):
        (tmp_path / f"{name}.json").write_text(json.dumps(value))
    files = (tmp_path / "skeleton.json", tmp_path / "motion.json")
    for kept in (0, 3):
        again = moved(outfit, *files, frames=tmp_path / "frames", threads=1)
        assert np.array_equal(again.layers["shirt"], done.layers["shirt"])
        assert again.report["kept"] == kept
    frames = [{key: np.array(value) for key, value in frame.items()} for frame in MOTION["frames"]]
    motion = {**MOTION, "fps": np.int64(25), "frames": frames}
    assert np.array_equal(moved(outfit, motion=motion).body, done.body)


def test_a_gltf_file_gives_skeleton_and_weights(outfit, tmp_path):
    body, layers, weights = outfit
    path = tmp_path / "person.gltf"
    skinned(path, body, *weights["body"])
    found = moved((body, layers, {"body": path}), skeleton=path)
    expected = moved(outfit)
    assert found.is_clean and found.noticed["weights_from_body"] == ["belt", "shirt"]
    assert np.abs(found.body - expected.body).max() < 1e-6
    assert np.abs(found.body - found.body[0]).max() > 0.02
    bare = tmp_path / "bare.glb"
    trimesh.Trimesh(*body, process=False).export(bare)
    with pytest.raises(ifgarments.AnimateError, match=r"weights\['body'\]: there are no skinning"):
        moved((body, layers, {"body": bare}))
    with pytest.raises(ifgarments.AnimateError, match="skeleton: the skeleton has no joints"):
        moved(outfit, skeleton=bare)
    with pytest.raises(FileNotFoundError):
        moved(outfit, skeleton=tmp_path / "missing.glb")


def test_garments_follow_a_body_that_is_given_in_each_frame(outfit, tmp_path):
    body, layers, _ = outfit
    posed = moved(outfit).body
    done = ifgarments.animate(body, layers, posed, fps=25)
    assert done.is_clean and done.notes == [] and done.noticed["rest_frame"] is None
    assert np.abs(done.body - posed).max() < 5e-4  # It may yield.
    for k in range(3):
        frame = {name: (at[k], layers[name][1]) for name, at in done.layers.items()}
        assert ifgarments.verify((done.body[k], body[1]), frame).is_clean
    lifted = done.layers["belt"][2] - done.layers["belt"][0]
    assert lifted[:, 1].mean() > 0.01
    # A folder of meshes is the same.
    for k, positions in enumerate(posed):
        meshio.write(tmp_path / f"{k}.ply", meshio.Mesh(positions, [("triangle", body[1])]))
    again = ifgarments.animate(body, layers, tmp_path, fps=25)
    assert np.array_equal(again.layers["shirt"], done.layers["shirt"])
    cases = [
        (ValueError, "it must be (frames, n, 3)", posed[0], {}),
        (TypeError, "must be numbers", posed.astype(bool), {}),
        (ValueError, "skeleton is of no use", posed, {"skeleton": SKELETON}),
        (ifgarments.AnimateError, "motion: there are no frames", posed[:0], {}),
        (ifgarments.AnimateError, "motion: frame 0: ", posed[:, 1:], {}),
        (ifgarments.AnimateError, "motion: frame 1: vertex 7", posed, {}),
        (ifgarments.AnimateError, "frames per second", posed[:1], {"fps": 0}),
        (ValueError, "fps is of no use", MOTION, {"fps": 25}),
        (ifgarments.AnimateError, "skeleton: a motion of poses", MOTION, {}),
    ]
    posed[1, 7, 0] = np.nan
    for kind, message, motion, arguments in cases:
        with pytest.raises(kind, match=re.escape(message)):
            ifgarments.animate(body, layers, motion, **arguments)


def test_what_does_not_fit_is_named(outfit, belt):
    body, layers, weights = outfit
    joints, values = weights["body"]
    short = {"body": (joints[1:], values[1:])}
    cases = [
        (ValueError, "there is no such layer", (body, layers, {**weights, "hat": short})),
        (ValueError, r"it must be \(\d+, 4\)", (body, layers, short)),
        (ValueError, "not from 0", (body, layers, {"body": (joints - 1, values)})),
        (TypeError, "no pair", (body, layers, {"body": joints})),
        (TypeError, "weights is 3", (body, layers, 3)),
        (
            ifgarments.AnimateError,
            r"^weights\['body'\]:",
            (body, layers, {"body": (joints + 1, values)}),
        ),
        (ifgarments.AnimateError, "body", (body, layers, {})),
        (ifgarments.OutfitError, "units high", ((1000 * body[0], body[1]), layers, weights)),
        (ifgarments.OutfitError, "m from the body", ((body[0] + 50, body[1]), layers, weights)),
        (ifgarments.AnimateError, "resolve the outfit", (body, {"belt": belt}, weights)),
    ]
    for kind, message, arguments in cases:
        with pytest.raises(kind, match=message):
            moved(arguments)
    for change, message in (({"joints": ["a", "b"]}, "motion"), ({"frames": []}, "motion")):
        with pytest.raises(ifgarments.AnimateError, match=message):
            moved(outfit, motion={**MOTION, **change})
    with pytest.raises(ifgarments.AnimateError, match="skeleton"):
        moved(outfit, skeleton={"joints": []})
    with pytest.raises(FileNotFoundError):
        moved(outfit, motion="missing.json")


def test_parameters_are_given_by_name(outfit, tmp_path):
    def kept(**arguments):
        return moved(outfit, frames=tmp_path, **arguments).report["kept"]

    # Frames are kept if they are of the same parameters.
    assert kept() == 0
    assert kept(params={"smoothing": 0.4, "walk": {"sweeps": 60}}, pinch="yield") == 3
    assert kept(params={"smoothing": 0, "sweeps": 50}) == 0
    assert kept(params={"smoothing": np.float32(0), "walk.sweeps": 50}) == 3
    assert kept(pinch="keep") == 0 and kept(params={"pinch": "keep"}) == 3


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"smooth": 0.1}, "unknown parameter `smooth`; valid names are `turn`, `body_limit`, "),
        ({"walk": {"sweep": 1}}, "unknown parameter `walk.sweep`; valid names are"),
        ({"walk": 3}, "parameter `walk`: it is a group; give a mapping of its parameters `gap`, "),
        ({"turn": 0}, "parameter `turn` is 0; it must be from 0.001 to 1 (radians)"),
        ({"turn": "wide"}, "parameter `turn`: `wide` is text; give a number"),
        (
            {"gap": 1e-3, "walk": {"gap": 1e-4}},
            "parameter `gap` is given twice, as `gap` and as `gap` in `walk`; give it once",
        ),
        ({"pinch": "keep"}, "parameter `pinch` is given twice, as the argument `pinch` and as"),
    ],
)
def test_bad_parameters_are_named(outfit, arguments, words):
    with pytest.raises(ifgarments.ParameterError, match=re.escape(words)):
        moved(outfit, pinch="yield", params=arguments)
