"""Captures of other projects, converted and reconstructed."""

import json
import os
import pickle
import shutil
import subprocess
import sys

import ifgarments
import numpy as np
import pytest
import smpl_files as files
from ifgarments.errors import CaptureError
from ifgarments.import_smpl import _pictures, _rotations, convert
from PIL import Image


def run(*arguments):
    command = [sys.executable, "-m", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    turn = tmp_path_factory.mktemp("synth") / "turn"
    small = ["--frames", 8, "--size", 128, "--garments", "tshirt", "--noise", 0]
    made = run("ifgarments", "capture", "synth", "--out", turn, *small)
    assert made.returncode == 0, made.stderr
    return files.Source(turn)


@pytest.fixture(params=sorted(files.LAYOUTS))
def layout(request, source, tmp_path):
    if request.param == "people_snapshot":
        pytest.importorskip("h5py", reason="People-Snapshot's files need h5py: pip install h5py")
    files.LAYOUTS[request.param](source, tmp_path / "theirs")
    source.write_extras(tmp_path / "extra")
    return tmp_path


@pytest.fixture(scope="module")
def written(source, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    files.instant_avatar(source, folder / "theirs")
    source.write_extras(folder / "extra")
    source.write_model(folder / "smpl.npz")
    return folder


@pytest.fixture
def theirs(written, tmp_path):
    """A copy, to be changed."""
    return shutil.copytree(written, tmp_path, dirs_exist_ok=True)


EXTRAS = {"garments": {"tshirt": [5, 6]}, "pose_sigma": (0.0, 0.0)}


def extras(folder):
    return {"labels": folder / "extra/parser", "normals": folder / "extra/normals", **EXTRAS}


def test_the_written_parameters_show_the_person_in_the_masks(source):
    """The premise of all tests below: SMPL's own formula, projected, lies within the masks."""
    poses, trans = source.parameters()
    for frame in range(source.count):
        seen = files.smpl(source.model, files.BETAS, poses[frame], trans[frame]) @ source.k.T
        columns, rows = np.floor(seen[:, :2] / seen[:, 2:]).astype(int).T
        mask = source.image("mask", frame) >= 128
        for axis in (0, 1):  # a pixel of the outline has its centre outside
            mask = mask | np.roll(mask, 1, axis) | np.roll(mask, -1, axis)
        assert mask[rows, columns].all()


def test_soft_masks_of_people_snapshot_are_foreground_from_half_of_white(source, tmp_path):
    h5py = pytest.importorskip("h5py", reason="People-Snapshot's files need h5py: pip install h5py")
    source.write_model(tmp_path / "smpl.npz")
    found = []
    for black, white in [(0, 1), (0.02, 1), (3, 255)]:
        theirs, ours = tmp_path / f"theirs{len(found)}", tmp_path / f"ours{len(found)}"
        files.people_snapshot(source, theirs)
        with h5py.File(theirs / "masks.hdf5", "r+") as file:
            masks = file["masks"][...].astype(float)
            del file["masks"]
            file["masks"] = black + (white - black) * masks
        convert(theirs, tmp_path / "smpl.npz", ours)
        found.append([p.read_bytes() for p in sorted((ours / "mask").iterdir())])
    assert len(found[0]) == source.count and found[0] == found[1] == found[2]


def test_a_converted_body_is_where_smpl_places_it(layout, source):
    model = source.write_model(layout / "smpl.pkl")
    made = convert(layout / "theirs", model, layout / "ours", frames=99, **extras(layout))
    assert made.frames == list(range(source.count)) and made.size == (128, 128)
    assert made.body_height == pytest.approx(np.ptp(source.model["v_template"][:, 1]), abs=0.05)
    poses, trans = source.parameters()
    meta = json.loads((layout / "ours/meta.json").read_text())
    assert np.allclose(meta["K"], source.k) and meta["labels"] == ["background", "skin", "tshirt"]
    for frame in range(0, source.count, 3):
        # In the axes of the camera; their files have single precision.
        truth = files.smpl(source.model, files.BETAS, poses[frame], trans[frame])
        assert np.abs(files.posed(layout / "ours", frame) - truth).max() < 1e-5
        for kind in ("mask", "label"):
            ours = np.array(Image.open(layout / "ours" / kind / f"{frame:04}.png"))
            assert np.array_equal(ours, source.image(kind, frame)), kind
        ours = np.array(Image.open(layout / f"ours/normal/{frame:04}.png"))
        known = source.image("mask", frame) >= 128
        assert np.array_equal(ours[known], source.image("normal", frame)[known])
    if (layout / "theirs/consensus.pkl").exists():
        clothed = files.meshio.read(layout / "ours/consensus.ply").points
        offset = clothed - files.meshio.read(layout / "ours/body/body_clean.ply").points
        assert np.allclose(offset, 0.01, atol=1e-6)


def test_a_converted_capture_is_reconstructed_as_the_original(theirs, source):
    convert(theirs / "theirs", theirs / "smpl.npz", theirs / "ours", **extras(theirs))
    ours = ifgarments.reconstruct(theirs / "ours", theirs / "ours/body", cell=0.025)
    first = ifgarments.reconstruct(source.folder, source.folder / "body", cell=0.025)
    assert list(ours.garments) == ["tshirt"]
    truth = files.meshio.read(source.folder / "truth/tshirt.ply").points
    original, converted = (
        distances(truth, found.garments["tshirt"][0]) for found in (first, ours)
    )
    # Half a cell of the extraction; a wrong sign, axis or offset leaves it at centimetres.
    assert np.mean(converted) < 0.0125
    assert np.mean(converted) < np.mean(original) + 1e-5


def test_hair_that_hides_clothes_is_background(theirs):
    command = ["ifgarments.import_smpl", theirs / "theirs", "--model", theirs / "smpl.npz"]
    command += ["--frames", 1, "--labels", theirs / "extra/parser", "--garment", "tshirt=5"]
    for name, more in (("hair", ["--background", "0,13"]), ("skin", [])):
        made = run(*command, *more, "--out", theirs / name)
        assert made.returncode == 0, made.stderr
    hair, skin = (np.array(Image.open(theirs / f"{n}/label/0000.png")) for n in ("hair", "skin"))
    changed = hair != skin
    assert changed.any() and (hair[changed] == 0).all() and (skin[changed] == 1).all()
    wrong = run(*command, "--background", "a", "--out", theirs / "wrong")
    assert wrong.returncode == 2 and "NUMBER,NUMBER" in wrong.stderr


def distances(points, others):
    """From points to the nearest of others."""
    return np.array([np.linalg.norm(others - p, axis=1).min() for p in points[::5]])


def test_the_command_converts_masks_alone_and_ifg_reconstructs_them(theirs):
    command = ["ifgarments.import_smpl", theirs / "theirs", "--model", theirs / "smpl.npz"]
    made = run(*command, "--out", theirs / "ours", "--frames", 4, "--size", 64)
    assert made.returncode == 0 and "4 of 8 frames of 64x64" in made.stdout, made.stderr
    folder, out = theirs / "ours", theirs / "wardrobe"
    meta = json.loads((folder / "meta.json").read_text())
    assert [f["index"] for f in meta["frames"]] == [0, 2, 4, 6] and meta["K"][0][2] == 32.0
    options = ["--out", out, "--cell", "4cm", "--pose-noise", "0,0"]
    done = run("ifgarments", "reconstruct", folder, "--body", folder / "body", *options)
    assert done.returncode == 0 and (out / "clothed").is_dir(), done.stderr
    again = run(*command, "--out", theirs / "ours")
    assert again.returncode == 2 and "exists" in again.stderr


def test_a_pickle_runs_nothing(source, tmp_path):
    class Evil:
        def __reduce__(self):
            return os.system, (f"touch {tmp_path / 'ran'}",)

    for content in (Evil(), {"v_template": Evil()}):
        (tmp_path / "smpl.pkl").write_bytes(pickle.dumps(content, protocol=2))
        with pytest.raises(CaptureError, match="system"):
            convert(tmp_path, tmp_path / "smpl.pkl", tmp_path / "out")
    assert not (tmp_path / "ran").exists()


def test_selected_elements_of_chumpy_and_old_texts_are_read(tmp_path):
    from ifgarments.import_smpl._pickles import array, read_pickle

    whole = files.foreign("chumpy.ch", "Ch", {"x": np.arange(12.0).reshape(3, 4)})
    at = np.array([1, 2, 5, 6])
    state = {"a": whole, "idxs": at, "preferred_shape": (2, 2)}
    content = {"part": files.foreign("chumpy.reordering", "Select", state), "whole": whole}
    content["sum"] = files.foreign("chumpy.ch_ops", "add", {"a": whole, "b": whole})
    files.dump(tmp_path / "a.pkl", content)
    read = read_pickle(tmp_path / "a.pkl")
    assert np.array_equal(array(tmp_path, read, "part"), [[1, 2], [5, 6]])
    with pytest.raises(CaptureError, match="`sum`.*chumpy expression, `add`"):
        array(tmp_path, read, "sum")


def changed(name, **arrays):
    def change(folder):
        with np.load(folder / name) as archive:
            content = {key: archive[key] for key in archive.files}
        for key, value in arrays.items():
            content[key] = value(content[key]) if callable(value) else value
        np.savez(folder / name, **{k: v for k, v in content.items() if v is not None})

    return change


def spoiled(values):
    values = values.copy()
    values[-1, 1] = np.nan
    return values


@pytest.mark.parametrize(
    "change, words",
    [
        (changed("smpl.npz", weights=None), "smpl.npz: `weights`: is missing; found: J_regressor"),
        (changed("smpl.npz", f=lambda f: f + 9_000_000), "`f`: is 900"),
        (changed("smpl.npz", v_template=lambda v: v.T), "`v_template`: has shape (3, "),
        (changed("smpl.npz", weights=lambda w: w * 0.5), "largest weights sum to 0.500"),
        (changed("smpl.npz", kintree_table=lambda t: t[:, ::-1]), "parents must come before"),
        (changed("smpl.npz", shapedirs=lambda s: s[..., :3]), "has 10 coefficients"),
        (changed("theirs/cameras.npz", intrinsic=np.eye(4)), "`intrinsic`: has shape (4, 4)"),
        (changed("theirs/cameras.npz", extrinsic=2 * np.eye(4)), "not a rotation"),
        (changed("theirs/cameras.npz", width=127), "shape (128, 128); it must be (128, 127)"),
        (changed("theirs/cameras.npz", height=1e9), "`height`: is 1000000000.0"),
        (changed("theirs/poses_optimized.npz", transl=lambda t: t[:-1]), "has 7 frames"),
        (changed("theirs/poses_optimized.npz", transl=spoiled), "`transl`: is nan at [7, 1]"),
        (changed("theirs/poses_optimized.npz", body_pose=lambda p: p[:, 3:]), "has shape (8, 66)"),
        (changed("theirs/poses_optimized.npz", betas=np.zeros((8, 10))), "one shape for all"),
        (lambda f: (f / "theirs/masks/mask_0007.npy").unlink(), "has 7 masks"),
        (lambda f: (f / "theirs/masks/mask_0003.npy").write_bytes(b"no"), "mask_0003.npy"),
        (lambda f: (f / "extra/parser/frame_2.png").unlink(), "has 7 pictures"),
        (lambda f: (f / "extra/normals/frame_2.png").write_bytes(b"no"), "frame_2.png"),
        (lambda f: (f / "theirs/cameras.npz").write_bytes(b"PK\3\4no"), "cameras.npz"),
        (lambda f: (f / "theirs/cameras.npz").unlink(), "not a capture of a known layout"),
    ],
)
def test_bad_files_are_named_and_nothing_is_written(theirs, change, words):
    change(theirs)
    with pytest.raises(CaptureError) as caught:
        convert(theirs / "theirs", theirs / "smpl.npz", theirs / "ours", **extras(theirs))
    assert words in str(caught.value) and str(theirs) in caught.value.file
    assert sorted(p.name for p in theirs.iterdir()) == ["extra", "smpl.npz", "theirs"]


@pytest.mark.parametrize(
    "options, words",
    [
        ({"frames": 0}, "frames is 0"),
        ({"size": 3}, "size is 3"),
        ({"garments": None}, "labels and garments"),
        ({"garments": {"a": [1], "b": [1]}}, "label 1 is given to a and b"),
        ({"garments": {"a": [256]}}, "label 256"),
        ({"garments": {"a/b": [1]}}, "'a/b' is not a valid name"),
        ({"garments": {"": [1]}}, "'' is not a valid name"),
        ({"garments": {".a": [1]}}, "'.a' is not a valid name"),
        ({"garments": {5: [1]}}, "5 is not a valid name"),
        ({"garments": {"skin": [1]}}, "'skin' is not a valid name"),
        ({"normal_axes": "maya"}, "normal_axes is 'maya'"),
        ({"pose_sigma": (90, 0)}, "60 degrees"),
    ],
)
def test_bad_arguments_are_named(theirs, options, words):
    with pytest.raises(ValueError) as caught:
        target = theirs / "ours"
        convert(theirs / "theirs", theirs / "smpl.npz", target, **{**extras(theirs), **options})
    assert words in str(caught.value) and not (theirs / "ours").exists()


@pytest.mark.parametrize("name", ["camera.pkl", "reconstructed_poses.hdf5", "masks.hdf5"])
def test_damaged_files_of_people_snapshot_are_named(source, tmp_path, name):
    pytest.importorskip("h5py", reason="People-Snapshot's files need h5py: pip install h5py")
    files.people_snapshot(source, tmp_path / "theirs")
    model = source.write_model(tmp_path / "smpl.npz")
    whole = (tmp_path / "theirs" / name).read_bytes()
    for kept in (0, 1, len(whole) // 2, len(whole) - 3):
        (tmp_path / "theirs" / name).write_bytes(whole[:kept])
        with pytest.raises(CaptureError, match=name):
            convert(tmp_path / "theirs", model, tmp_path / "ours")
    assert not (tmp_path / "ours").exists()


def test_quaternions_of_half_turns_are_exact():
    for vector in ([np.pi, 0, 0], [0, 3.1, 0.5], [0, 0, 0], [1e-9, 0, 0], [1.0, 2.0, -0.5]):
        m = files.rotation(np.array(vector))
        for q in (_rotations.of_matrix(m), _rotations.of_vectors(np.array(vector))):
            assert np.allclose(_rotations.matrix(q), m, atol=1e-12)


def test_a_lens_is_undistorted():
    """A point at distance r from the axis is seen at r (1 + k₁ r²)."""
    k = np.array([[100.0, 0, 100.0], [0, 100.0, 50.0], [0, 0, 1]])
    lens = _pictures.Resampling(200, 100, k, np.array([0.2, 0, 0, 0, 0]), None)
    columns = np.broadcast_to(np.arange(200), (100, 200))
    row = lens(columns)[50]
    for column in (110, 150, 175):
        r = (column + 0.5 - 100) / 100
        assert row[column] == int(100 + 100 * r * (1 + 0.2 * r * r))
    assert row[199] == 0 and lens.k is not k and np.array_equal(lens.k, k)
    half = _pictures.Resampling(200, 100, k, np.zeros(5), 100)
    assert (half.width, half.height) == (100, 50) and half.k[1, 2] == 25.0
    assert np.array_equal(half(columns)[0], np.arange(1, 200, 2))


@pytest.mark.parametrize("mode", ["P", "RGBA", "LA"])
def test_masks_of_other_modes_are_refused_instead_of_read_as_shades(tmp_path, mode):
    picture = Image.new("RGBA", (4, 4), (128, 0, 0, 255)).convert(mode)
    picture.save(tmp_path / "mask.png")
    with pytest.raises(CaptureError, match=f"mode {mode}; it must be 1 or L or RGB"):
        _pictures.read_mask(tmp_path / "mask.png", None)
    Image.new("L", (4, 4), 255).save(tmp_path / "mask.png")
    assert _pictures.read_mask(tmp_path / "mask.png", (4, 4)).all()


@pytest.mark.parametrize(
    "given, words", [(["a=1", "a=2"], "given twice"), (["=1"], "has no name")]
)
def test_garments_are_named_once(given, words):
    options = [text for one in given for text in ("--garment", one)]
    ended = run("ifgarments.import_smpl", "a", "--model", "b", "--out", "c", *options)
    assert ended.returncode == 2 and words in ended.stderr
