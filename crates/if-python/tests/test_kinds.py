"""Meshes of other packages come back as they came, with other positions."""

import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

import ifgarments


@pytest.fixture
def wanted(body, belt):
    return ifgarments.resolve(body, [belt]).layers[0][0]


def test_trimesh_keeps_textures_and_attributes(body, belt, wanted):
    trimesh = pytest.importorskip("trimesh")
    uv = np.random.default_rng(1).random((len(belt[0]), 2))
    mesh = trimesh.Trimesh(*belt, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv)
    mesh.metadata["maker"] = "loom"
    mesh.face_attributes["panel"] = np.arange(len(mesh.faces))
    mesh.vertex_attributes["weight"] = np.arange(len(mesh.vertices)) / 7
    normals, before = mesh.vertex_normals.copy(), mesh.vertices.copy()
    found = ifgarments.resolve(trimesh.Trimesh(*body, process=False), [mesh]).layers[0]
    assert type(found) is trimesh.Trimesh and np.array_equal(found.vertices, wanted)
    assert np.array_equal(found.faces, mesh.faces) and np.array_equal(found.visual.uv, uv)
    assert found.metadata["maker"] == "loom"
    assert np.array_equal(found.face_attributes["panel"], mesh.face_attributes["panel"])
    assert np.array_equal(found.vertex_attributes["weight"], mesh.vertex_attributes["weight"])
    assert not np.array_equal(found.vertex_normals, normals)
    assert np.array_equal(mesh.vertices, before)


def test_trimesh_keeps_colours(body, belt):
    trimesh = pytest.importorskip("trimesh")
    colours = np.random.default_rng(1).integers(0, 255, (len(belt[0]), 4), dtype=np.uint8)
    mesh = trimesh.Trimesh(*belt, vertex_colors=colours, process=False)
    found = ifgarments.resolve(body, {"belt": mesh}).layers["belt"]
    assert np.array_equal(found.visual.vertex_colors, colours)


def test_meshio_keeps_data_and_precision(body, belt):
    meshio = pytest.importorskip("meshio")
    v, f = belt[0].astype(np.float32), belt[1]
    cells = [("triangle", f[:100]), ("line", np.array([[0, 1]])), ("triangle", f[100:])]
    mesh = meshio.Mesh(v, cells, point_data={"label": np.arange(len(v))})
    found = ifgarments.resolve(body, [mesh]).layers[0]
    assert type(found) is meshio.Mesh and found.points.dtype == np.float32
    assert [len(block.data) for block in found.cells] == [100, 1, len(f) - 100]
    assert np.array_equal(found.point_data["label"], mesh.point_data["label"])
    again = ifgarments.resolve(body, [(v, f)]).layers[0][0]
    assert np.array_equal(found.points, again) and np.array_equal(mesh.points, v)
    cells = [("triangle", part.astype(np.uint64)) for part in (f[:100], f[100:])]
    unsigned = ifgarments.resolve(body, [meshio.Mesh(v, cells)]).layers[0]
    assert np.array_equal(unsigned.points, again)
    quads = meshio.Mesh(v, [("quad", np.array([[0, 1, 2, 3]]))])
    with pytest.raises(ValueError, match=r"layers\[0\]: cells are of type 'quad'; triangulate"):
        ifgarments.resolve(body, [quads])


def test_open3d_keeps_colours_and_renews_normals(body, belt, wanted):
    open3d = pytest.importorskip("open3d")
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(belt[0]), open3d.utility.Vector3iVector(belt[1])
    )
    mesh.paint_uniform_color([0.1, 0.5, 0.9])
    mesh.compute_vertex_normals()
    found = ifgarments.resolve(body, [mesh]).layers[0]
    assert type(found) is open3d.geometry.TriangleMesh
    assert np.array_equal(np.asarray(found.vertices), wanted)
    assert np.array_equal(np.asarray(found.vertex_colors), np.asarray(mesh.vertex_colors))
    assert not np.array_equal(np.asarray(found.vertex_normals), np.asarray(mesh.vertex_normals))
    assert np.array_equal(np.asarray(mesh.vertices), belt[0])


class Vector:
    """A vector type of its own, as Open3D has."""

    def __init__(self, rows):
        self.rows = np.array(rows)

    def __array__(self, dtype=None, copy=None):
        return np.array(self.rows, dtype)

    def __deepcopy__(self, memo):
        return Vector(self.rows)


class Legacy:
    """The interface of Open3D's meshes."""

    def __init__(self, vertices, triangles):
        self.vertices, self.triangles = Vector(vertices), Vector(triangles)
        self.computed = 0

    def has_vertex_normals(self):
        return True

    def compute_vertex_normals(self):
        self.computed += 1


def test_vectors_of_other_types_and_normals_are_renewed(body, belt, wanted):
    mesh = Legacy(*belt)
    found = ifgarments.resolve(body, [mesh]).layers[0]
    assert type(found.vertices) is Vector and np.array_equal(found.vertices.rows, wanted)
    assert found.computed > 0 and mesh.computed == 0
    assert np.array_equal(mesh.vertices.rows, belt[0])


class Named(NamedTuple):
    vertices: np.ndarray
    faces: np.ndarray
    size: str


@dataclass(frozen=True)
class Frozen:
    vertices: np.ndarray
    faces: np.ndarray
    size: str = "m"


@pytest.mark.parametrize("kind", [Named, Frozen])
def test_immutable_meshes_come_back_as_another_one(body, belt, wanted, kind):
    mesh = kind(*belt, "xl")
    found = ifgarments.resolve(body, [mesh]).layers[0]
    assert type(found) is kind and found.size == "xl" and np.array_equal(found.vertices, wanted)
    assert mesh.vertices is belt[0]


class Sealed:
    """A mesh whose positions cannot be set."""

    def __init__(self, vertices, faces):
        self._vertices, self.faces = vertices, faces

    @property
    def vertices(self):
        return self._vertices


def test_a_mesh_that_cannot_be_changed_is_an_error_before_the_work(body, belt):
    sealed = Sealed(*belt)
    with pytest.raises(
        TypeError, match=r"layers\[0\] is a test_kinds.Sealed that cannot be copied"
    ):
        ifgarments.resolve(body, [sealed], progress=lambda _: pytest.fail("the work has begun"))
    assert not ifgarments.verify(Sealed(*body), [sealed]).is_clean
    assert ifgarments.resolve(Sealed(*body), [belt]).is_clean


def test_the_copy_is_made_before_the_work(body, belt, wanted):
    mesh = Legacy(*belt)

    def spoil(_):
        mesh.vertices = Vector(np.zeros((3, 3)))

    found = ifgarments.resolve(body, [mesh], progress=spoil).layers[0]
    assert np.array_equal(found.vertices.rows, wanted)
    assert copy.copy(found) is not found


def misaligned(array):
    """The same numbers at an odd address."""
    return np.frombuffer(b"!" + array.tobytes(), array.dtype, offset=1).reshape(array.shape)


def test_arrays_may_lie_anywhere(body, belt, wanted):
    given = tuple(misaligned(np.ascontiguousarray(part)) for part in belt)
    assert not given[0].flags.aligned and not given[1].flags.aligned
    found = ifgarments.resolve(body, [given]).layers[0][0]
    assert np.array_equal(found, wanted)


@pytest.mark.parametrize("order", "<>")
def test_single_precision_stays_in_any_order_of_bytes(body, belt, order):
    expected = ifgarments.resolve(body, [(belt[0].astype(np.float32), belt[1])]).layers[0][0]
    found = ifgarments.resolve(body, [(belt[0].astype(f"{order}f4"), belt[1])]).layers[0][0]
    assert found.dtype.itemsize == 4 and np.array_equal(found, expected)


def test_names_that_are_no_unicode_are_named(body, belt):
    with pytest.raises(ValueError, match=r"layers\['\\udc80'\]: its name .* no valid Unicode"):
        ifgarments.resolve(body, {"\udc80": belt})
