"""Bad input ends in an error that names argument, row and value."""

import pathlib
import re

import numpy as np
import pytest

import ifgarments
from conftest import ball, band

V, F = band()


def with_vertex(row, column, value, kind=np.float64):
    v = V.astype(kind)
    v[row, column] = value
    return v


def with_face(row, column, value, kind=np.int64):
    f = F.astype(kind)
    f[row, column] = value
    return f


# What is given as a garment, the exception, and what its message must contain.
MESHES = [
    ((with_vertex(7, 1, np.nan), F), ValueError, ["layers[0]", "vertex 7", "y is NaN"]),
    ((with_vertex(0, 2, np.inf), F), ValueError, ["layers[0]", "vertex 0", "z is inf"]),
    ((with_vertex(3, 0, -np.inf, np.float32), F), ValueError, ["vertex 3", "x is -inf"]),
    ((np.ma.masked_less(V, -0.05), F), ValueError, ["layers[0]: vertices", "masked elements"]),
    ((V, np.ma.masked_equal(F, 7)), ValueError, ["layers[0]: faces", "masked elements"]),
    ((V[:, :2], F), ValueError, ["layers[0]: vertices", "(200, 2)"]),
    ((np.hstack([V, V[:, :1]]), F), ValueError, ["vertices", "(200, 4)"]),
    ((V.ravel(), F), ValueError, ["vertices", "(600,)"]),
    ((V[None], F), ValueError, ["vertices", "(1, 200, 3)"]),
    ((np.float64(1.0), F), ValueError, ["vertices", "()"]),
    (([], F), ValueError, ["vertices", "(0,)"]),
    (([[0, 0, 0], [1, 0]], F), ValueError, ["layers[0]: vertices are not an array of numbers"]),
    ((V.astype(np.float16), F), TypeError, ["vertices are float16"]),
    ((V.astype(complex), F), TypeError, ["vertices are complex128"]),
    ((V > 0, F), TypeError, ["vertices are bool"]),
    ((V.astype(str), F), TypeError, ["vertices are <U"]),
    ((V.astype(object), F), TypeError, ["vertices are object"]),
    ((None, F), TypeError, ["vertices are object"]),
    ((V, with_face(5, 2, -1)), ValueError, ["layers[0]: triangle 5", "corner 2", "-1"]),
    ((V, with_face(5, 0, 200)), ValueError, ["triangle 5", "vertex 200", "only 200 vertices"]),
    ((V, with_face(2, 1, 2**40)), ValueError, ["triangle 2", "corner 1", str(2**40)]),
    ((V, with_face(2, 1, 2**63 + 5, np.uint64)), ValueError, ["triangle 2", str(2**63 + 5)]),
    ((V, with_face(4, 1, F[4, 0])), ValueError, ["triangle 4 uses vertex", "twice"]),
    ((V, F.astype(float)), TypeError, ["layers[0]: faces are float64"]),
    ((V, F > 3), TypeError, ["faces are bool"]),
    ((V, F.astype(object)), TypeError, ["faces are object"]),
    ((V, F.ravel()), ValueError, ["faces", f"({F.size},)"]),
    ((V, np.hstack([F, F[:, :1]])), ValueError, ["faces", "(320, 4)", "triangulate"]),
    ((V, F[:, :2]), ValueError, ["faces", "(320, 2)"]),
    ((V, None), TypeError, ["faces are object"]),
    ((V, []), ValueError, ["layer `layers[0]` has no triangles"]),
    ((np.zeros((0, 3)), np.zeros((0, 3), int)), ValueError, ["`layers[0]` has no triangles"]),
    ((V + 50, F), ValueError, ["garment `layers[0]` lies", "m from the body"]),
    ((V * 1e4, F), ValueError, ["garment `layers[0]` is", "times the body"]),
    ((with_vertex(3, 0, 1e300), F), ValueError, ["garment `layers[0]`", "vertex 3"]),
    ((V,), TypeError, ["layers[0] is a tuple", "(vertices, faces)"]),
    ((V, F, V), TypeError, ["layers[0] is a tuple"]),
    (V, TypeError, ["layers[0] is a numpy.ndarray", "trimesh"]),
    (None, TypeError, ["layers[0] is a NoneType"]),
    (7, TypeError, ["layers[0] is a int"]),
    ("coat.ply", TypeError, ["'coat.ply'", "files are not read here"]),
    (pathlib.Path("coat.ply"), TypeError, ["files are not read here"]),
    ({"vertices": V, "faces": F}, TypeError, ["layers[0] is a dict"]),
    ((("coat",), (V, F)), TypeError, ["layers[0]"]),
    ((7, (V, F)), (TypeError, ValueError), ["layers[0]"]),
]


@pytest.mark.parametrize("mesh, kind, words", MESHES)
def test_bad_meshes_are_named(mesh, kind, words):
    for call in (ifgarments.resolve, ifgarments.verify):
        with pytest.raises(kind) as caught:
            call(ball(), [mesh])
        for word in words:
            assert word in str(caught.value)


BODIES = [
    ((*band()[:1], band()[1][:0]), ["layer `body` has no triangles"]),
    ((np.zeros((3, 3)), [[0, 1, 2]]), ["`body` cannot be the body"]),
    ((ball()[0] * 100, ball()[1]), ["body `body` is 60.0 units high", "inches"]),
    ((ball()[0] * 300, ball()[1]), ["body `body` is 180.0 units high", "centimetres"]),
    ((ball()[0] * np.nan, ball()[1]), ["body: vertex 0: coordinate x is NaN"]),
]


@pytest.mark.parametrize("body, words", BODIES)
def test_bad_bodies_are_named(body, words):
    with pytest.raises(ValueError) as caught:
        ifgarments.resolve(body, [])
    for word in words:
        assert word in str(caught.value)
    assert isinstance(caught.value, ifgarments.OutfitError) or "NaN" in str(caught.value)


ARGUMENTS = [
    ({"clearance": -1.0}, ValueError, "`goal.clearance` is -1"),
    ({"clearance": float("nan")}, ValueError, "`goal.clearance` is NaN"),
    ({"clearance": "wide"}, TypeError, "clearance is 'wide'"),
    ({"threads": 0}, ValueError, "threads is 0; it must be from 1 to 1024"),
    ({"threads": -3}, ValueError, "threads is -3"),
    ({"threads": 10**30}, ValueError, "threads is 1000"),
    ({"threads": 1.5}, TypeError, "threads is 1.5"),
    ({"threads": True}, TypeError, "threads is True"),
    ({"progress": 3}, TypeError, "progress is 3; it must be callable"),
    ({"params": 3}, TypeError, "params is 3"),
    ({"params": {"clearence": 1.0}}, ValueError, "unknown parameter `clearence`; valid names"),
    ({"params": {"rounds": 0}}, ValueError, "`effort.rounds` is 0; it must be from 1"),
    ({"params": {"rounds": "many"}}, ValueError, "many"),
    ({"params": {"rounds": float("nan")}}, ValueError, "`rounds` is nan"),
    ({"threads": np.float64(2)}, TypeError, "it must be a whole number"),
    ({"threads": np.True_}, TypeError, "it must be a whole number"),
    ({"params": {"rounds": {1}}}, ValueError, "`rounds` is {1}: a set has no JSON; give numbers"),
    ({"params": {"rounds": 3j}}, ValueError, "a complex has no JSON"),
    ({"params": {"goal": {"clearance": np.float32("nan")}}}, ValueError, "not JSON compliant"),
    ({"params": {"goal": {"own": "burn"}}}, ValueError, "burn"),
    (
        {"params": {"goal": 3}},
        ValueError,
        "parameter `goal`: it is a group; give a mapping of its parameters `clearance`, ",
    ),
    (
        {"params": {"own": "keep", "goal": {"own": "remove"}}},
        ValueError,
        "parameter `own` is given twice, as `own` and as `own` in `goal`; give it once",
    ),
    ({"params": {"rounds": 9, "effort.rounds": 8}}, ValueError, "`rounds` and as `effort.rounds`"),
    (
        {"clearance": 1e-3, "params": {"goal": {"clearance": 1e-3}}},
        ValueError,
        "as the argument `clearance` and as `clearance` in `goal`",
    ),
    ({"params": {7: 1}}, ValueError, "unknown parameter `7`"),
]


@pytest.mark.parametrize("arguments, kind, words", ARGUMENTS)
def test_bad_arguments_are_named(arguments, kind, words):
    with pytest.raises(kind, match=re.escape(words)):
        ifgarments.resolve(ball(), [band()], **arguments)


def test_a_parameter_is_named_once():
    with pytest.raises(ifgarments.ParameterError) as caught:
        ifgarments.resolve(ball(), [band()], params={"rounds": -1})
    assert str(caught.value) == "parameter `rounds`: invalid value: integer `-1`, expected usize"


COLLECTIONS = [
    (None, "layers: a NoneType"),
    (3, "layers: a int"),
    ("coats", "layers: a str"),
    (band(), "two arrays are one mesh"),
    (iter([]), "is not a sequence of meshes"),
    ({3: band()}, "its name is 3"),
]


@pytest.mark.parametrize("layers, words", COLLECTIONS)
def test_bad_collections_are_named(layers, words):
    with pytest.raises(TypeError, match=re.escape(words)):
        ifgarments.resolve(ball(), layers)


def test_two_layers_of_one_name_are_refused():
    with pytest.raises(ifgarments.OutfitError, match="two layers are called `coat`"):
        ifgarments.resolve(ball(), [("coat", band()), ("coat", band())])
    with pytest.raises(ifgarments.OutfitError, match="two layers are called `body`"):
        ifgarments.verify(ball(), {"body": band()})


def test_only_arrays_may_be_split():
    from test_kinds import Frozen

    with pytest.raises(ifgarments.ParameterError, match=r"`goal.split`: layers\[0\] is not a pair"):
        ifgarments.resolve(ball(), [Frozen(*band())], params={"goal": {"split": "if_left"}})
