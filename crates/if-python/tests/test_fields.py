"""Surfaces of fields, and networks fitted to meshes."""

import ifgarments
import numpy as np
import pytest
from conftest import BALL, ball, band


def test_a_closed_mesh_is_remeshed(body):
    (v, f), report = ifgarments.extract(body, cell=0.05)
    radius = np.linalg.norm(v, axis=1)
    assert report["cell"] == 0.05 and 0.9 * BALL < radius.min() <= radius.max() < 1.01 * BALL
    (w, _), _ = ifgarments.extract(body, cell=0.05, params={"phase": [0.2, 0.4, 0.6]})
    assert not np.array_equal(v, w)
    (coarse, _), _ = ifgarments.extract(body, params={"resolution": {"cells": 6}})
    assert len(coarse) < len(v)


def test_a_network_is_fitted_stored_and_extracted(body, tmp_path):
    path = tmp_path / "ball.safetensors"
    seen = []
    file, report = ifgarments.fit(body, path, steps=20, progress=seen.append)
    assert path.read_bytes() == file and report["steps"] == 20 and seen
    (v, _), _ = ifgarments.extract(file, cell=0.06)
    radius = np.linalg.norm(v, axis=1)
    assert 0.85 * BALL < radius.min() <= radius.max() < 1.1 * BALL


@pytest.mark.parametrize(
    ("given", "seconds"),
    [({}, 60.0), ({"accuracy": 1e-3}, 600.0), ({"steps": 3, "accuracy": 1e-3}, None)],
)
def test_a_fit_takes_as_long_as_the_program_lets_it(body, monkeypatch, given, seconds):
    taken = []

    def fit(mesh, steps, limit, *others):
        taken.append(limit)
        return b"", "{}"

    monkeypatch.setattr(ifgarments._fields._native, "fit", fit)
    ifgarments.fit(body, **given)
    assert taken == [seconds]


def test_numbers_and_arrays_of_numpy_are_taken(body):
    phase = [0.25, 0.5, 0.75]
    wanted, _ = ifgarments.extract(body, cell=0.0625, params={"phase": phase, "newton": 2})
    given = {"phase": np.array(phase), "newton": np.int8(2)}
    found, _ = ifgarments.extract(body, cell=np.float32(0.0625), params=given)
    assert np.array_equal(found[0], wanted[0])
    assert ifgarments.fit(body, steps=np.int64(3))[1]["steps"] == 3


@pytest.mark.parametrize(
    "call, kind, words",
    [
        (lambda: ifgarments.extract(band()), ValueError, "has no inside; close its holes"),
        (
            lambda: ifgarments.extract(ball(), cell="2cm"),
            TypeError,
            "cell is '2cm'; give a number, in metres",
        ),
        (lambda: ifgarments.fit(ball(), accuracy="1mm"), TypeError, "give a number, in metres"),
        (lambda: ifgarments.extract(b"no network"), ValueError, "field: "),
        (lambda: ifgarments.extract(7), TypeError, "field is a int"),
        (lambda: ifgarments.extract(ball(), cell=0), ifgarments.ParameterError, "cell"),
        (lambda: ifgarments.extract(ball(), cell=np.nan), ifgarments.ParameterError, "nan"),
        (
            lambda: ifgarments.extract(ball(), params={"sells": 1}),
            ifgarments.ParameterError,
            "sells",
        ),
        (
            lambda: ifgarments.extract(ball(), params={"relax": -3}),
            ifgarments.ParameterError,
            "parameter `relax`: invalid value: integer `-3`",
        ),
        (
            lambda: ifgarments.extract(ball(), cell=0.02, params={"resolution": {"cell": 0.05}}),
            ifgarments.ParameterError,
            "give one",
        ),
        (lambda: ifgarments.extract(ball(), params=3), TypeError, "params is 3"),
        (lambda: ifgarments.extract(ball(), cell=1e-7), ValueError, "field: "),
        (lambda: ifgarments.fit(ball(), accuracy=-1.0), ifgarments.ParameterError, "accuracy"),
        (lambda: ifgarments.fit(ball(), seconds=-1.0), ifgarments.ParameterError, "seconds"),
        (lambda: ifgarments.fit((ball()[0], ball()[1][:, ::-1]), steps=1), ValueError, "outside"),
    ],
)
def test_bad_input_is_named(call, kind, words):
    with pytest.raises(kind) as caught:
        call()
    assert words in str(caught.value)
