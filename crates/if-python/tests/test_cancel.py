"""Progress, cancelling and Ctrl-C."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from functools import partial

import numpy as np
import pytest

import ifgarments
from conftest import ball
from test_animate import MOTION, SKELETON


def test_progress_is_reported_in_order(body, belt, shirt):
    seen = []
    resolved = ifgarments.resolve(body, {"belt": belt, "shirt": shirt}, progress=seen.append)
    assert [p.item for p in seen if p.stage == "done"] == ["belt", "shirt"]
    assert {"verify", "settle", "done"} <= {p.stage for p in seen}
    assert seen[0].measures["garment"] == 1 and seen[-1].measures["garments"] == 2
    assert all(isinstance(p, ifgarments.Progress) for p in seen)
    again = ifgarments.resolve(body, [belt, shirt])
    assert np.array_equal(resolved.layers["shirt"][0], again.layers[1][0])


def test_an_exception_of_the_callback_cancels(body, belt):
    class Enough(Exception):
        pass

    calls = []

    def stop(progress):
        calls.append(progress)
        if len(calls) == 3:
            raise Enough("three")

    with pytest.raises(Enough, match="three"):
        ifgarments.resolve(body, [belt], progress=stop)
    assert len(calls) == 3
    assert ifgarments.resolve(body, [belt]).is_clean


def test_other_threads_run_meanwhile():
    body, layers = ifgarments.demo_scene(resolution=0.7)
    ticks, running = [], True

    def tick():
        while running:
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    ifgarments.verify(body, layers)
    end = time.perf_counter()
    running = False
    thread.join()
    assert sum(start < t < end for t in ticks) > 10


@pytest.fixture
def interruptible():
    """Ctrl-C raises also where tests run as a background job, which begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(os.name != "posix", reason="signals are sent")
@pytest.mark.parametrize("with_progress", [False, True])
def test_ctrl_c_ends_a_long_call_soon(with_progress, interruptible):
    body, layers = ifgarments.demo_scene(resolution=1.0)
    sent = []

    def interrupt():
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.2, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        ifgarments.resolve(body, layers, progress=(lambda _: None) if with_progress else None)
    # 0.3 s on a quiet machine; this one may be busy.
    assert time.perf_counter() - sent[0] < 1.5


@pytest.mark.skipif(os.name != "posix", reason="signals are sent")
def test_ctrl_c_ends_the_command_with_its_code(tmp_path):
    command = [sys.executable, "-m", "ifgarments", "demo", "--out", str(tmp_path / "demo")]
    listens = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # also as a background job
    work = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=listens)
    while not (tmp_path / "demo/input").is_dir() and work.poll() is None:
        time.sleep(0.01)
    work.send_signal(signal.SIGINT)
    _, said = work.communicate(timeout=60)
    assert work.returncode == 130 and "cancelled" in said and "Traceback" not in said, said


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are listed there")
@pytest.mark.parametrize("rings", [16, 120])
def test_no_temporary_folder_is_left_when_interrupted_work_ends(
    rings, belt, interruptible, tmp_path, monkeypatch
):
    """With many rings the call ends before the work, which has no frames yet."""

    def working():
        names = []
        for thread in os.listdir("/proc/self/task"):
            try:
                with open(f"/proc/self/task/{thread}/comm") as file:
                    names.append(file.read())
            except OSError:  # It has just ended.
                pass
        return any(name.startswith("ifgarments-") for name in names)

    def interrupt():
        while not os.listdir(tmp_path):
            time.sleep(0.001)
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    body = ball(rings=rings, around=2 * rings)
    outside = 1.1 * belt[0], belt[1]
    weights = np.tile([1, 0, 0, 0], (len(body[0]), 1))
    motion = {**MOTION, "frames": MOTION["frames"] * 500}
    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        ifgarments.animate(
            body, [outside], motion, skeleton=SKELETON, weights={"body": (0 * weights, weights)}
        )
    while working():
        time.sleep(0.01)
    assert os.listdir(tmp_path) == []
