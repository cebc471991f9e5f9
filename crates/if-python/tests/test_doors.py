"""Bad input at every function: a typed error names argument and value, and nothing is written."""

import os
import signal
import threading
from functools import partial

import ifgarments
import numpy as np
import pytest
from conftest import BALL, ball, band
from ifgarments import batch, usd

V, F = band(1.1 * BALL)
CLEAN = {"belt": (V, F)}
NAN = (np.where(np.arange(3) == 1, np.nan, V), F)
HOLES = (V, np.where(np.arange(3) == 2, -1, F))
ROOT = {"id": 0, "name": "root", "parent": -1, "head": [0, -0.3, 0], "tail": [0, 0.3, 0]}


class Raises:
    """A mesh whose positions cannot be had."""

    faces = F

    @property
    def vertices(self):
        raise RuntimeError("the file is gone")


class Empty:
    """An object of a scene without vertices."""

    vertices = None
    faces = None


def structured():
    return np.zeros(4, dtype=[("x", "f8"), ("y", "f8"), ("z", "f8")])


def animate(weights=None, skeleton=None, motion=None, layers=CLEAN, **options):
    body = ball()
    n = len(body[0])
    whole = np.tile([1.0, 0, 0, 0], (n, 1))
    frame = {"root_t": [0, 0, 0], "rot": [[1, 0, 0, 0]]}
    return ifgarments.animate(
        body,
        layers,
        {"joints": ["root"], "frames": [frame]} if motion is None else motion,
        skeleton={"joints": [ROOT]} if skeleton is None else skeleton,
        weights={"body": (np.zeros((n, 4), int), whole)} if weights is None else weights,
        **options,
    )


def wardrobe():
    return ifgarments.Wardrobe("w")


resolve = partial(ifgarments.resolve, ball())
verify = partial(ifgarments.verify, ball())
find = partial(ifgarments.intersections, ball())
picture = partial(ifgarments.picture, ball())
extract, fit = partial(ifgarments.extract, ball()), partial(ifgarments.fit, ball())
ParameterError, AnimateError = ifgarments.ParameterError, ifgarments.AnimateError

# The call, the exception, and what its message must contain. Calls run in an empty folder that
# holds a file `file`, a folder `folder`, and a folder `shut` that nobody may write to.
CASES = {
    # Meshes, beside those of test_errors.py
    "a property that raises": (lambda: verify([Raises()]), RuntimeError, "the file is gone"),
    "an object without vertices": (lambda: verify([Empty()]), TypeError, "layers[0]: vertices"),
    "structured rows": (lambda: verify([(structured(), F)]), TypeError, "layers[0]: vertices"),
    "dates": (lambda: verify([(V.astype("M8[s]"), F)]), TypeError, "vertices are datetime64"),
    "a set": (lambda: verify({1, 2}), TypeError, "layers: a set is not a sequence"),
    "a generator": (lambda: verify(m for m in [(V, F)]), TypeError, "is not a sequence"),
    "nested lists": (lambda: verify([[[(V, F)]]]), TypeError, "layers[0] is a list"),
    "no body": (lambda: ifgarments.verify(None, []), TypeError, "body is a NoneType"),
    # intersections, which does not need an outfit
    "not a number": (lambda: find([NAN]), ValueError, "layers[0]: vertex 0: coordinate y is NaN"),
    "a negative corner": (
        lambda: find([HOLES]),
        ValueError,
        "triangle 0: corner 2 names vertex -1",
    ),
    "too many threads": (lambda: find(CLEAN, threads=5000), ValueError, "threads is 5000"),
    "threads as text": (lambda: find(CLEAN, threads="2"), TypeError, "threads is '2'"),
    # resolve
    "clearance as text": (
        lambda: resolve(CLEAN, clearance="wide"),
        TypeError,
        "clearance is 'wide'",
    ),
    "clearance as a list": (lambda: resolve(CLEAN, clearance=[1]), TypeError, "clearance is [1]"),
    "clearance too long": (
        lambda: resolve(CLEAN, clearance=10**400),
        TypeError,
        "clearance is 1000",
    ),
    "infinite clearance": (lambda: resolve(CLEAN, clearance=np.inf), ParameterError, "clearance"),
    "a group as a number": (lambda: resolve(CLEAN, params={"goal": 3}), ParameterError, "goal"),
    "no such choice": (lambda: resolve(CLEAN, params={"pinch": "no"}), ParameterError, "`pinch`"),
    "a choice in a group": (
        lambda: resolve(CLEAN, params={"goal": {"own": 3}}),
        ParameterError,
        "`goal.own`",
    ),
    # pictures
    "a height below 16": (lambda: picture(CLEAN, height=2), ValueError, "height is 2; it must be"),
    "a negative height": (lambda: picture(CLEAN, height=-1), ValueError, "height is -1"),
    "a huge height": (lambda: picture(CLEAN, height=10**12), ValueError, "height is 1000000000000"),
    "half a pixel": (lambda: picture(CLEAN, height=99.5), TypeError, "height is 99.5"),
    "a picture of NaN": (lambda: picture([NAN], "a.png"), ValueError, "layers[0]: vertex 0"),
    "a picture nowhere": (lambda: picture(CLEAN, "no/a.png"), FileNotFoundError, "no/a.png"),
    "a picture over a folder": (lambda: picture(CLEAN, "folder"), IsADirectoryError, "folder is a"),
    "a picture below a file": (
        lambda: picture(CLEAN, "file/a.png"),
        NotADirectoryError,
        "file/a.png",
    ),
    "a picture in a shut folder": (lambda: picture(CLEAN, "shut/a.png"), OSError, "shut/a.png"),
    "a picture at a number": (lambda: picture(CLEAN, 3), TypeError, "path is 3; it must be a path"),
    "a zero byte": (lambda: picture(CLEAN, "a\0b"), ValueError, "path is 'a\\x00b'; a path has no"),
    # the scene
    "a resolution as text": (
        lambda: ifgarments.demo_scene(resolution="fine"),
        TypeError,
        "resolution is 'fine'",
    ),
    "an overlap of NaN": (lambda: ifgarments.demo_scene(overlap=np.nan), ParameterError, "overlap"),
    # fields
    "an open field": (lambda: ifgarments.extract((V, F)), ValueError, "field: "),
    "a field of NaN": (lambda: ifgarments.extract(NAN), ValueError, "field: vertex 0"),
    "an empty network": (lambda: ifgarments.extract(b""), ValueError, "field: "),
    "a network that claims gigabytes": (
        lambda: ifgarments.extract(b"\xff" * 8 + b"{}"),
        ValueError,
        "field: ",
    ),
    "cells of nothing": (lambda: extract(cell=-1), ParameterError, "cell"),
    "cells that need terabytes": (lambda: extract(cell=1e-6), ValueError, "field: "),
    "params of extract as a set": (lambda: extract(params={"relax": {1}}), ParameterError, "relax"),
    "half a step": (lambda: fit(steps=1.5), TypeError, "steps is 1.5; it must be a whole number"),
    "negative steps": (lambda: fit(steps=-1), ValueError, "steps is -1"),
    "seconds as text": (lambda: fit(seconds="long"), TypeError, "seconds is 'long'"),
    "a fit nowhere": (lambda: fit("no/a.st", steps=10**9), FileNotFoundError, "no/a.st"),
    "a fit over a folder": (lambda: fit("folder", steps=10**9), IsADirectoryError, "folder is a"),
    # motions
    "weights as an array": (
        lambda: animate({"body": np.zeros((2, 4))}),
        TypeError,
        "weights['body'] is no pair",
    ),
    "no weights": (lambda: animate({}), AnimateError, "body"),
    "a skeleton of text": (lambda: animate(skeleton={"joints": "all"}), AnimateError, "skeleton"),
    "a ring of joints": (
        lambda: animate(skeleton={"joints": [{**ROOT, "parent": 0}]}),
        AnimateError,
        "skeleton",
    ),
    "a motion of NaN": (lambda: animate(motion={"fps": np.nan}), ValueError, "motion"),
    "a motion without frames": (
        lambda: animate(motion={"joints": ["root"], "frames": []}),
        AnimateError,
        "motion",
    ),
    "a motion that is a folder": (lambda: animate(motion="folder"), ValueError, "skeleton is of no"),
    "a folder without bodies": (
        lambda: ifgarments.animate(ball(), CLEAN, "folder"),
        AnimateError,
        "the folder has no .ply",
    ),
    "a skeleton that is a folder": (
        lambda: animate(skeleton="folder"),
        IsADirectoryError,
        "folder",
    ),
    "a skeleton that is no JSON": (lambda: animate(skeleton="file"), AnimateError, "skeleton"),
    "frames below a file": (lambda: animate(frames="file/frames"), AnimateError, "file/frames"),
    "garments that intersect the body": (
        lambda: animate(layers={"belt": band()}),
        AnimateError,
        "resolve the outfit",
    ),
    # USD
    "USD nowhere": (lambda: usd.write("no/a.usda", CLEAN), FileNotFoundError, "no/a.usda"),
    "USD over a folder": (
        lambda: usd.write("b.usda", CLEAN),
        IsADirectoryError,
        "b.usda is a folder",
    ),
    "USD of NaN": (lambda: usd.write("a.usda", {"a": NAN}), ValueError, "meshes['a']: vertex 0"),
    "USD of holes": (lambda: usd.write("a.usda", {"a": HOLES}), ValueError, "corner 2 is -1"),
    "a cache that is none": (lambda: usd.read_point_cache("file"), ValueError, "file: "),
    "a cache that is missing": (lambda: usd.read_point_cache("gone"), FileNotFoundError, "gone"),
    # wardrobes, captures, batches
    "a wardrobe that is a file": (
        lambda: ifgarments.Wardrobe("file").body("a"),
        ifgarments.WardrobeError,
        "file",
    ),
    "garments as one text": (
        lambda: wardrobe().dress("a", "coat"),
        TypeError,
        "garments is 'coat'; it must be a list",
    ),
    "garments of numbers": (lambda: wardrobe().dress("a", [1]), TypeError, "garments is [1]"),
    "combinations as text": (
        lambda: wardrobe().batch("ab", "o"),
        TypeError,
        "combinations is 'ab'",
    ),
    "no pair": (lambda: wardrobe().batch([("a",)], "o"), TypeError, "combinations[0] is ('a',)"),
    "a pair of texts": (
        lambda: wardrobe().batch([("a", "coat")], "o"),
        TypeError,
        "combinations[0][1] is 'coat'",
    ),
    "a negative picture": (
        lambda: wardrobe().match("a", [], "o", picture_height=-1),
        ValueError,
        "picture_height is -1",
    ),
    "nothing at once": (lambda: wardrobe().batch([], "o", at_once=0), ValueError, "at_once is 0"),
    "a part outside": (
        lambda: wardrobe().batch([], "o", part="../x"),
        ValueError,
        "part is '../x'",
    ),
    "a scale as text": (
        lambda: wardrobe().add_body("a", "file", scale="mm"),
        TypeError,
        "scale is 'mm'",
    ),
    "a body that is no mesh": (
        lambda: wardrobe().add_body("a", "file"),
        ifgarments.WardrobeError,
        "file",
    ),
    "an engine that is none": (
        lambda: batch.run("w", [], "o", engine="slurm"),
        ValueError,
        "engine is 'slurm'",
    ),
    "no workers": (lambda: batch.run("w", [], "o", workers=0), ValueError, "workers is 0"),
    "parts of nothing": (lambda: batch.run("w", [], "o", size=0), ValueError, "size is 0"),
    "half a retry": (lambda: batch.run("w", [], "o", retries=0.5), TypeError, "retries is 0.5"),
    "a batch of letters": (lambda: batch.run("w", "ab", "o"), TypeError, "combinations is 'ab'"),
    "a capture that is a file": (
        lambda: ifgarments.reconstruct("file", "folder"),
        ifgarments.ReconstructError,
        "file",
    ),
    "a cell as text": (
        lambda: ifgarments.reconstruct("file", "folder", cell="small"),
        TypeError,
        "cell is 'small'",
    ),
    "no frame at all": (
        lambda: ifgarments.reconstruct("file", "folder", every=0),
        ValueError,
        "every is 0",
    ),
    "a capture at a number": (lambda: ifgarments.reconstruct(7, "b"), TypeError, "capture is 7"),
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The folder of the calls."""
    (tmp_path / "file").write_text("text")
    (tmp_path / "b.usda").mkdir()
    (tmp_path / "folder").mkdir()
    # Not even root may make files in /proc.
    (tmp_path / "shut").symlink_to("/proc")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def content(folder):
    """The names of all files and folders, and the bytes of the files."""
    names = sorted(p for p in folder.rglob("*") if "shut" not in p.parts)
    return [(p, p.read_bytes() if p.is_file() else None) for p in names]


@pytest.mark.skipif(os.name != "posix", reason="folders and links of Unix")
@pytest.mark.parametrize("call, kind, words", CASES.values(), ids=CASES)
def test_bad_input_is_named_and_nothing_is_written(place, call, kind, words):
    before = content(place)
    with pytest.raises(kind) as caught:
        call()
    assert words in str(caught.value)
    assert content(place) == before


def test_a_callback_that_raises_twice_cancels_once():
    calls = []

    def stop(progress):
        calls.append(progress)
        raise ValueError(f"call {len(calls)}")

    with pytest.raises(ValueError, match="call 1"):
        ifgarments.resolve(ball(), [band()], progress=stop)
    assert len(calls) == 1
    assert ifgarments.resolve(ball(), [band()]).is_clean


def test_a_fit_that_is_cancelled_leaves_the_old_file(tmp_path):
    path = tmp_path / "ball.safetensors"
    path.write_bytes(b"old")

    def stop(progress):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        ifgarments.fit(ball(), path, steps=10**6, progress=stop)
    assert [p.name for p in tmp_path.iterdir()] == [path.name] and path.read_bytes() == b"old"


@pytest.mark.skipif(os.name != "posix", reason="signals are sent")
def test_ctrl_c_twice_ends_the_call_and_not_the_interpreter():
    body, layers = ifgarments.demo_scene(resolution=1.0)
    raised = []

    def interrupted(number, frame):
        raised.append(number)
        if len(raised) == 1:
            os.kill(os.getpid(), signal.SIGINT)  # again, before the first has been raised
        raise KeyboardInterrupt(len(raised))

    before = signal.signal(signal.SIGINT, interrupted)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            ifgarments.resolve(body, layers)
    finally:
        timer.join()
        signal.signal(signal.SIGINT, before)
    assert raised == [signal.SIGINT] * 2
    assert ifgarments.resolve(ball(), [band()]).is_clean


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
def test_a_link_stays_one_and_a_pipe_is_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    real, link, pipe = tmp_path / "elsewhere" / "real.png", tmp_path / "link.png", tmp_path / "pipe"
    link.symlink_to(real)
    drawn = picture(CLEAN, link)
    assert link.is_symlink() and real.read_bytes() == drawn
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="pipe is a device or a pipe"):
        picture(CLEAN, pipe)
    names = sorted(p.name for p in tmp_path.iterdir())
    assert pipe.is_fifo() and names == ["elsewhere", "link.png", "pipe"]
