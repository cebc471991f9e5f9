"""Outfits that follow motions."""

import json
import re

import ifgarments
import numpy as np
import pytest

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


def test_every_frame_is_clean_and_follows_the_motion(outfit, tmp_path):
    body, layers, weights = outfit
    seen = []
    done = ifgarments.animate(*outfit, SKELETON, MOTION, progress=seen.append)
    assert done.is_clean and done.weights_from_body == ["belt", "shirt"]
    assert done.joints_not_in_motion == [] and done.skeleton_from_skin is None
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
        again = ifgarments.animate(*outfit, *files, frames=tmp_path / "frames", threads=1)
        assert np.array_equal(again.layers["shirt"], done.layers["shirt"])
        assert again.report["kept"] == kept
    frames = [{key: np.array(value) for key, value in frame.items()} for frame in MOTION["frames"]]
    motion = {**MOTION, "fps": np.int64(25), "frames": frames}
    assert np.array_equal(ifgarments.animate(*outfit, SKELETON, motion).body, done.body)


def test_what_does_not_fit_is_named(outfit, belt):
    body, layers, weights = outfit
    joints, values = weights["body"]
    short = {"body": (joints[1:], values[1:])}
    cases = [
        (ValueError, "there is no such layer", (body, layers, {**weights, "hat": short})),
        (ValueError, r"it must be \(\d+, 4\)", (body, layers, short)),
        (ValueError, "not from 0", (body, layers, {"body": (joints - 1, values)})),
        (TypeError, "no pair", (body, layers, {"body": joints})),
        (TypeError, "weights is None", (body, layers, None)),
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
            ifgarments.animate(*arguments, SKELETON, MOTION)
    for change, message in (({"joints": ["a", "b"]}, "motion"), ({"frames": []}, "motion")):
        with pytest.raises(ifgarments.AnimateError, match=message):
            ifgarments.animate(*outfit, SKELETON, {**MOTION, **change})
    with pytest.raises(ifgarments.AnimateError, match="skeleton"):
        ifgarments.animate(*outfit, {"joints": []}, MOTION)
    with pytest.raises(FileNotFoundError):
        ifgarments.animate(*outfit, SKELETON, "missing.json")


def test_parameters_are_given_by_name(outfit, tmp_path):
    def kept(**arguments):
        done = ifgarments.animate(*outfit, SKELETON, MOTION, frames=tmp_path, **arguments)
        return done.report["kept"]

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
        ifgarments.animate(*outfit, SKELETON, MOTION, pinch="yield", params=arguments)
