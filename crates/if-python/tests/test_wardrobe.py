"""Wardrobes, and the command `ifg` of the package."""

import json
import os
import signal
import subprocess
import sys
from functools import partial

import ifgarments
import numpy as np
import pytest
from conftest import BALL, band
from ifgarments import batch


def write_ply(path, vertices, faces):
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, row)) for row in vertices.astype(np.float32).tolist()]
    lines += ["3 " + " ".join(map(str, row)) for row in faces.tolist()]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def ifg(*arguments):
    command = [sys.executable, "-m", "ifgarments", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.fixture
def folder(tmp_path, body, belt, shirt):
    files = [
        write_ply(tmp_path / f"{name}.ply", *m) for name, m in [("skirt", belt), ("coat", shirt)]
    ]
    mesh = write_ply(tmp_path / "ball.ply", *body)
    done = ifg("wardrobe", "add", tmp_path / "w", "--body", "ball", "--mesh", mesh, *files)
    assert done.returncode == 0, done.stderr
    return tmp_path / "w"


def test_garments_are_listed_dressed_and_resolved(folder, body, belt):
    wardrobe = ifgarments.Wardrobe(folder)
    assert list(wardrobe.bodies) == ["ball"] and list(wardrobe.garments) == ["coat", "skirt"]
    assert wardrobe.garments["skirt"]["body"]["name"] == "ball" and wardrobe.faults == []
    v, f = wardrobe.body("ball")
    assert np.array_equal(v, body[0].astype(np.float32)) and np.array_equal(f, body[1])
    assert np.array_equal(wardrobe.garment("skirt")[0], belt[0].astype(np.float32))
    dressed, layers = wardrobe.dress("ball", ["skirt", "coat"])
    assert list(layers) == ["skirt", "coat"] and layers["coat"][0].dtype == np.float32
    resolved = ifgarments.resolve(dressed, layers)
    assert resolved.state == "clean everywhere"


def test_a_match_is_written_once(folder, tmp_path):
    wardrobe, seen = ifgarments.Wardrobe(folder), []
    match = lambda **options: wardrobe.match(
        "ball", ["skirt", "coat"], tmp_path / "look", **options
    )
    found = match(progress=seen.append, picture_height=64)
    assert (found["state"], found["placed"]) == ("clean", "written") and seen[-1].stage == "done"
    on_disk = json.loads((tmp_path / "look/result.json").read_text())
    assert on_disk == {key: value for key, value in found.items() if key != "placed"}
    assert {"skirt.ply", "coat.ply"} <= {path.name for path in (tmp_path / "look").iterdir()}
    assert match(picture_height=64)["placed"] == "before"
    assert match(picture_height=64, clearance=1e-3)["placed"] == "written"
    with pytest.raises(ifgarments.ParameterError, match="picture_height"):
        match(picture_height=3)


def test_bodies_are_added_once(folder, tmp_path, body):
    wardrobe = ifgarments.Wardrobe(folder)
    same = write_ply(tmp_path / "again.ply", *body)
    assert wardrobe.add_body("again", same) == "ball"
    large = write_ply(tmp_path / "large.ply", 110 * body[0], body[1])
    assert wardrobe.add_body("ball", large, scale=0.01) == "ball_2"
    assert np.abs(wardrobe.body("ball_2")[0]).max() == pytest.approx(1.1 * BALL, rel=1e-6)


def test_what_is_missing_or_damaged_is_named(folder, tmp_path):
    wardrobe = ifgarments.Wardrobe(folder)
    for call in (
        lambda: wardrobe.body("anna"),
        lambda: wardrobe.dress("anna", ["coat"]),
        lambda: wardrobe.match("anna", ["coat"], tmp_path / "look"),
    ):
        with pytest.raises(ifgarments.WardrobeError, match="no body `anna`; it has: ball"):
            call()
    with pytest.raises(ifgarments.WardrobeError, match="no garment `hat`; it has: coat, skirt"):
        wardrobe.dress("ball", ["hat"])
    with pytest.raises(ifgarments.WardrobeError, match="coat"):
        wardrobe.dress("ball", ["coat", "coat"])
    with pytest.raises(ifgarments.WardrobeError, match=r"none\.ply"):
        wardrobe.add_body("b", tmp_path / "none.ply")
    for name in ("", "a/b"):
        with pytest.raises(ifgarments.WardrobeError, match="name"):
            wardrobe.add_body(name, folder / "bodies/ball/body.ply")
    with pytest.raises(ifgarments.ParameterError, match="`scale` is 0"):
        wardrobe.add_body("b", folder / "bodies/ball/body.ply", scale=0)
    with pytest.raises(TypeError, match="path is 3; it must be a path"):
        ifgarments.Wardrobe(3)
    (folder / "garments/coat/asset.json").write_text("{")
    assert [fault["name"] for fault in wardrobe.faults] == ["coat"]
    with pytest.raises(ifgarments.WardrobeError, match=r"asset\.json"):
        wardrobe.garment("coat")
    assert not (tmp_path / "look").exists()


def test_a_folder_that_is_missing_is_an_empty_wardrobe(tmp_path):
    empty = ifgarments.Wardrobe(tmp_path / "none")
    assert (empty.bodies, empty.garments, empty.faults) == ({}, {}, [])
    with pytest.raises(ifgarments.WardrobeError, match="neither `bodies` nor `garments`"):
        empty.body("ball")


def test_the_command_is_the_program(tmp_path, body, belt):
    paths = [
        write_ply(tmp_path / f"{name}.ply", *m) for name, m in [("ball", body), ("belt", belt)]
    ]
    checked = ifg("check", "--body", *paths, "--json")
    assert checked.returncode == 1
    with_names = ifgarments.verify(
        (body[0].astype(np.float32), body[1]), {"belt": (belt[0].astype(np.float32), belt[1])}
    )
    found = json.loads(checked.stdout)["report"]["pairs"][0]
    expected = {**with_names.report["pairs"][0], "inner": "ball"}
    assert found == expected
    assert ifg("--version").stdout.startswith("ifg ") and ifg("--version").returncode == 0
    wrong = ifg("fix", "--no-such-option")
    assert wrong.returncode == 2 and "--no-such-option" in wrong.stderr
    missing = ifg("check", "--body", tmp_path / "none.ply", paths[1])
    assert missing.returncode == 2 and "none.ply" in missing.stderr


def test_a_capture_that_is_missing_is_named(tmp_path):
    with pytest.raises(ifgarments.ReconstructError, match="turn"):
        ifgarments.reconstruct(tmp_path / "turn", tmp_path / "body")


def test_a_garment_of_a_capture_is_reconstructed(tmp_path):
    turn = tmp_path / "turn"
    small = ["--frames", 6, "--size", 96, "--garments", "tshirt"]
    made = ifg("capture", "synth", "--out", turn, *small)
    assert made.returncode == 0, made.stderr
    stages = []

    def enough(progress):
        stages.append(progress.stage)
        if progress.stage == "surface" and progress.done > 1:
            raise InterruptedError("enough")

    with pytest.raises(InterruptedError):
        ifgarments.reconstruct(turn, turn / "body", progress=enough)
    assert stages[0] == "read"
    with pytest.raises(ifgarments.ReconstructError, match="cell"):
        ifgarments.reconstruct(turn, turn / "body", cell=-1)
    found = ifgarments.reconstruct(turn, turn / "body", cell=0.03)
    assert list(found.garments) == ["tshirt"] and len(found.labels) == len(found.person[0])
    v, f = found.garments["tshirt"]
    assert len(v) > 100 and f.max() == len(v) - 1 and found.report["garments"]
    assert found.report["surface"]["frames"] == 6
    third = ifgarments.reconstruct(turn, turn / "body", cell=0.03, every=3)
    assert third.report["surface"]["frames"] == 2


COMBINATIONS = [
    ("ball", ["skirt"]),
    ("ball", ["coat"]),
    ("ball", ["skirt", "coat"]),
    ("ball", ["coat", "skirt"]),
    ("ball", ["skirt", "missing"]),
]


def results(folder):
    """All files but those with seconds and pages."""
    timed = ("timings.json", "summary.csv", "report.html")
    files = [path for path in folder.rglob("*") if path.is_file() and path.name not in timed]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_a_batch_has_the_files_of_the_command(folder, tmp_path):
    wardrobe, seen = ifgarments.Wardrobe(folder), []
    entries = wardrobe.batch(COMBINATIONS, tmp_path / "a", progress=seen.append, at_once=2)
    assert [entry["state"] for entry in entries] == ["clean"] * 4 + ["failed"]
    done = [(p.done, p.total) for p in seen if p.stage == "combination"]
    assert done == [(k, 5) for k in range(1, 6)]
    outfits = [{"body": body, "garments": garments} for body, garments in COMBINATIONS]
    (tmp_path / "list.json").write_text(json.dumps({"outfit": outfits}))
    run = ifg("wardrobe", "batch", folder, "--list", tmp_path / "list.json", "--out", tmp_path / "b")
    assert run.returncode == 2, run.stderr
    assert results(tmp_path / "a") == results(tmp_path / "b")


def test_parts_of_a_batch_are_collected(folder, tmp_path):
    wardrobe, seen = ifgarments.Wardrobe(folder), []
    wardrobe.batch(COMBINATIONS, tmp_path / "one", picture_height=0)
    entries = batch.run(
        folder,
        COMBINATIONS,
        tmp_path / "parts",
        workers=2,
        size=2,
        progress=lambda *p: seen.append(p),
        picture_height=0,
    )
    assert [entry["state"] for entry in entries] == ["clean"] * 4 + ["failed"]
    assert seen[-1] == (5, 5) and len(seen) == 3
    assert results(tmp_path / "one") == results(tmp_path / "parts")
    assert not (tmp_path / "parts/shards").exists()
    for wrong in ({"engine": "dask"}, {"size": 0}):
        with pytest.raises(ValueError):
            batch.run(folder, COMBINATIONS, tmp_path / "no", **wrong)
    with pytest.raises(ValueError, match="part"):
        wardrobe.batch(COMBINATIONS, tmp_path / "no", part="../x")
    assert not (tmp_path / "no").exists()


def test_a_batch_whose_worker_is_killed_goes_on(folder, tmp_path, monkeypatch):
    killed = tmp_path / "killed"
    monkeypatch.setattr(batch, "_do", partial(_killed_once, str(killed)))
    entries = batch.run(folder, COMBINATIONS, tmp_path / "out", workers=1, size=2)
    assert killed.exists() and [e["state"] for e in entries] == ["clean"] * 4 + ["failed"]


def test_a_batch_that_is_told_to_stop_begins_no_more_parts(folder, tmp_path):
    class Enough(Exception):
        pass

    def enough(*_):
        raise Enough

    many = [("ball", ["skirt"])] * 12
    with pytest.raises(Enough):
        batch.run(folder, many, tmp_path / "out", workers=1, size=1, progress=enough)
    # One is done, and some were on their way to the worker.
    assert len(list((tmp_path / "out/shards").iterdir())) < 6


def _killed_once(mark, part):
    """In a worker: the second part kills it, once."""
    if part[0] == "00000002" and not os.path.exists(mark):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return batch._do(part)


@pytest.mark.skipif(sys.platform == "win32", reason="locks the folder as Unix does")
def test_a_part_waits_for_a_worker_that_lives_on(folder, tmp_path, monkeypatch):
    import fcntl

    part = ("0", str(folder), COMBINATIONS[:1], str(tmp_path / "out"), {"picture_height": 0})
    lock = tmp_path / "out/shards/0/results/.ifg-lock"
    lock.parent.mkdir(parents=True)
    waited = []

    def pause(seconds):
        waited.append(seconds)
        if len(waited) == 2:
            fcntl.flock(held, fcntl.LOCK_UN)

    monkeypatch.setattr(batch.time, "sleep", pause)
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert batch._do(part) == 1 and waited == [batch._PAUSE] * 2
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        waited = [0, 0]
        with pytest.raises(ifgarments.BusyError):
            batch._do(part)
        assert len(waited) == 2 + batch._LOOKS - 1
