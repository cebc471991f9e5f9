"""Tests of the Blender add-on, without a window: `python -m pytest` with bpy and ifgarments."""

import os
import pathlib
import runpy
import struct
import sys
import tomllib
import zipfile

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
here = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(here))

import if_garments  # noqa: E402
import ifgarments  # noqa: E402
from if_garments.meshes import INTERSECTIONS, RESULT  # noqa: E402

# The meshes of the package's own tests.
_shapes = runpy.run_path(str(here.parent / "tests/conftest.py"))
ball, band = _shapes["ball"], _shapes["band"]


@pytest.fixture(autouse=True)
def scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if_garments.register()
    yield bpy.context.scene
    if_garments.unregister()


def test_the_packed_extension_is_what_blender_expects(request):
    packed = request.config.getoption("--extension")
    if packed is None:
        pytest.skip("--extension names it")
    with zipfile.ZipFile(packed) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        names = archive.namelist()
        assert all(wheel.removeprefix("./") in names for wheel in manifest["wheels"])
        for file in (here / "if_garments").glob("*.py"):
            assert archive.read(file.name) == file.read_bytes()
    assert manifest["id"] == "if_garments"
    assert all(manifest["version"] in wheel for wheel in manifest["wheels"])
    if_garments.unregister()
    try:
        installed = bpy.ops.extensions.package_install_files(
            filepath=packed, repo="user_default", enable_on_install=True
        )
        assert installed == {"FINISHED"}
        assert "bl_ext.user_default.if_garments" in bpy.context.preferences.addons
        assert bpy.ops.if_garments.add() == {"CANCELLED"}, "its operators are there"
        bpy.ops.preferences.addon_disable(module="bl_ext.user_default.if_garments")
    finally:
        if_garments.register()


def thing(name, vertices, faces):
    """An object of a mesh in metres with y up."""
    mesh = bpy.data.meshes.new(name)
    x, y, z = np.asarray(vertices, dtype=np.float64).T
    mesh.from_pydata(np.stack([x, -z, y], axis=1).tolist(), [], np.asarray(faces).tolist())
    found = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(found)
    return found


@pytest.fixture
def dressed(scene):
    """A ball with two bands of cloth that dip into it and into each other."""
    settings = scene.if_garments
    settings.body = thing("skin", *ball())
    parts = {"belt": band(), "shirt": band(0.285, around=44, along=6, height=0.12)}
    for name, mesh in parts.items():
        settings.garments.add().mesh = thing(name, *mesh)
    return settings


def things(settings):
    return [settings.body, *(item.mesh for item in settings.garments)]


def shown(thing):
    """What Blender shows, with modifiers, in the world: metres, y up."""
    found = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = found.to_mesh()
    v = np.array([found.matrix_world @ vertex.co for vertex in mesh.vertices], dtype=np.float64)
    mesh.calc_loop_triangles()
    f = np.array([t.vertices[:] for t in mesh.loop_triangles])
    found.to_mesh_clear()
    if found.matrix_world.determinant() < 0:
        f = f[:, ::-1]
    return np.stack([v[:, 0], v[:, 2], -v[:, 1]], axis=1), f


def verified(settings):
    body, *garments = things(settings)
    return ifgarments.verify(shown(body), {g.name: shown(g) for g in garments})


def test_the_result_is_a_shape_key_and_clean(dressed):
    assert not verified(dressed).is_clean
    before = [np.array([v.co for v in t.data.vertices]) for t in things(dressed)]
    assert bpy.ops.if_garments.resolve() == {"FINISHED"}
    assert dressed.state == "clean everywhere"
    assert verified(dressed).state == "clean everywhere"
    for t, was in zip(things(dressed), before):
        assert np.array_equal([v.co for v in t.data.vertices], was), "the mesh itself stays"
    # The key off: as it came.
    for item in dressed.garments:
        item.mesh.data.shape_keys.key_blocks[RESULT].value = 0.0
    assert not verified(dressed).is_clean


def test_a_second_run_starts_from_the_mesh_again(dressed):
    belt = dressed.garments[0].mesh
    results = []
    for _ in range(2):
        bpy.ops.if_garments.resolve()
        results.append([p.co[:] for p in belt.data.shape_keys.key_blocks[RESULT].data])
    assert results[0] == results[1]
    assert [key.name for key in belt.data.shape_keys.key_blocks] == ["Basis", RESULT]


def test_other_shape_keys_and_transforms_count(dressed):
    belt = dressed.garments[0].mesh
    belt.shape_key_add(name="Basis")
    wide = belt.shape_key_add(name="wide")
    for point in wide.data:
        point.co *= 0.98
    wide.value = 0.5
    for k, t in enumerate(things(dressed)):
        t.rotation_euler = (0.3, 0.2, 0.1)
        t.location = (1.0, 2.0, 3.0)
        t.scale = (2.0, 2.0, 2.0 if k != 2 else -2.0)
    bpy.context.scene.unit_settings.scale_length = 0.5
    bpy.context.view_layer.update()
    assert bpy.ops.if_garments.resolve() == {"FINISHED"}
    assert wide.value == 0.5
    assert verified(dressed).is_clean


def test_check_marks_vertices_and_faces_and_resolve_removes_the_marks(dressed):
    bpy.ops.if_garments.check()
    assert dressed.state == "not clean"
    body, belt, shirt = things(dressed)
    (pair,) = ifgarments.intersections(shown(body), {t.name: shown(t) for t in (belt, shirt)})
    assert dressed.pairs == f"{len(pair.triangles):,} of belt and body"
    assert INTERSECTIONS not in shirt.vertex_groups and not any(p.select for p in shirt.data.polygons)
    for t in (body, belt):
        group = t.vertex_groups[INTERSECTIONS]
        members = {v.index for v in t.data.vertices if group.index in [g.group for g in v.groups]}
        chosen = [p for p in t.data.polygons if p.select]
        assert chosen and members == {v for p in chosen for v in p.vertices}
    bpy.ops.if_garments.resolve()
    assert dressed.pairs == ""
    assert all(INTERSECTIONS not in t.vertex_groups for t in things(dressed))
    bpy.ops.if_garments.check()
    assert dressed.state == "clean everywhere", "check counts what is shown"
    dressed.body = shirt
    assert dressed.state == "", "found of other meshes"


def test_a_frame_range_becomes_point_caches(dressed, tmp_path):
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 3, 5
    dressed.what, dressed.caches = "FRAMES", str(tmp_path)
    for t in things(dressed):  # modifiers that deform: all in one
        twist = t.modifiers.new("twist", "SIMPLE_DEFORM")
        twist.deform_method, twist.deform_axis = "TWIST", "Z"
        twist.angle = 0.0
        twist.keyframe_insert("angle", frame=3)
        twist.angle = 1.0
        twist.keyframe_insert("angle", frame=5)
    scene.frame_set(4)
    assert not verified(dressed).is_clean
    assert bpy.ops.if_garments.resolve() == {"FINISHED"}
    assert scene.frame_current == 4
    poses = []
    for frame in range(3, 6):
        scene.frame_set(frame)
        assert verified(dressed).is_clean, frame
        poses.append(shown(dressed.garments[0].mesh)[0])
    assert np.abs(poses[2] - poses[0]).max() > 0.01
    assert sorted(os.listdir(tmp_path)) == ["belt.pc2", "shirt.pc2"]
    head = struct.unpack("<12siiffi", (tmp_path / "belt.pc2").read_bytes()[:32])
    assert head == (b"POINTCACHE2\0", 1, 200, 3.0, 1.0, 3)
    # Again: the caches of before are not taken for the clothes as they came.
    assert bpy.ops.if_garments.resolve() == {"FINISHED"}
    assert len(dressed.garments[0].mesh.modifiers) == 2


def test_errors_are_messages_and_nothing_is_written(dressed, tmp_path):
    def message(**settings):
        for name, value in settings.items():
            setattr(dressed, name, value)
        with pytest.raises(RuntimeError) as error:  # how Blender passes on reported errors
            bpy.ops.if_garments.resolve()
        return str(error.value)

    body = dressed.body
    assert "save the Blender file first" in message(what="FRAMES")
    thick = dressed.garments[0].mesh.modifiers.new("thick", "SOLIDIFY")
    assert "belt: its modifiers change the number of vertices" in message(caches=str(tmp_path))
    assert os.listdir(tmp_path) == []
    dressed.garments[0].mesh.modifiers.remove(thick)
    assert "choose the body" in message(what="MODELLED", body=None)
    assert "cannot be a garment, too" in message(body=dressed.garments[1].mesh)
    dressed.garments.add().mesh = dressed.garments[0].mesh
    assert "belt: it is in the list twice" in message(body=body)
    dressed.garments.clear()
    assert "add garments" in message()
    sheet = thing("sheet", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    dressed.garments.add().mesh = sheet
    sheet.data.clear_geometry()
    assert "sheet: it has no faces" in message()


def test_what_remains_is_kept_marked_and_said(dressed, monkeypatch):
    given = ifgarments.resolve
    few = lambda *a, **k: given(*a, **k, params={"rounds": 1, "own": "keep"})
    monkeypatch.setattr(ifgarments, "resolve", few)
    with pytest.raises(RuntimeError, match="intersect"):
        bpy.ops.if_garments.resolve()
    assert dressed.state == "not clean"
    assert any(INTERSECTIONS in t.vertex_groups for t in things(dressed))
    assert RESULT in dressed.garments[0].mesh.data.shape_keys.key_blocks


def test_the_list_is_edited(scene):
    settings = scene.if_garments
    settings.body = thing("skin", *ball())
    for k in range(3):
        thing(f"g{k}", *band()).select_set(True)
    settings.body.select_set(True)
    bpy.ops.if_garments.add()
    names = lambda: [item.mesh.name for item in settings.garments]
    assert sorted(names()) == ["g0", "g1", "g2"]
    first, second, third = names()
    settings.active = 2
    bpy.ops.if_garments.move(step=-1)
    assert names() == [first, third, second] and settings.active == 1
    bpy.ops.if_garments.remove()
    assert names() == [first, second]
    assert bpy.ops.if_garments.move(step=5) == {"CANCELLED"}
