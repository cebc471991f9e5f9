#!/usr/bin/env python3
"""Docstrings of Python packages, and how soon Ctrl-C ends a long call of each.

    benches/python_peers.py ifgarments pysplashsurf manifold3d trimesh

Prints a row for each package that is installed: public functions, classes and methods with a
docstring, and seconds from SIGINT in the middle of a call until the process has ended. trimesh
needs scipy and rtree.
"""

import importlib
import inspect
import signal
import subprocess
import sys
import time

#: A call of a minute or so (manifold3d: seconds), and when it is interrupted.
CALLS = {
    "ifgarments": (4.0, "p.resolve(*p.demo_scene(resolution=3.0))"),
    "pysplashsurf": (
        5.0,
        "p.reconstruct_surface(random.random((400000, 3)).astype('f'), particle_radius=0.003, "
        "smoothing_length=2.0, cube_size=0.5, iso_surface_threshold=0.6)",
    ),
    "manifold3d": (
        2.5,
        "(lambda s: (s - s.translate([0.3, 0, 0])).num_tri())(p.Manifold.sphere(1, 1500))",
    ),
    "trimesh": (
        6.0,
        "p.proximity.signed_distance(p.creation.icosphere(subdivisions=7), "
        "random.random((200000, 3)))",
    ),
}


def documented(name):
    """Public names with a docstring, and all."""
    module = importlib.import_module(name)
    names = getattr(module, "__all__", None) or dir(module)
    found = []
    for public in (getattr(module, n) for n in names if not n.startswith("_")):
        if not callable(public):
            continue
        found.append(public)
        if inspect.isclass(public):
            members = (v for k, v in vars(public).items() if not k.startswith("_"))
            kinds = (property, classmethod, staticmethod)
            found += [v for v in members if callable(v) or isinstance(v, kinds)]
    return sum(bool((inspect.getdoc(f) or "").strip()) for f in found), len(found)


def interrupted(name):
    """Seconds until the process ends; `None` if the call was over before."""
    after, call = CALLS[name]
    program = f"import {name} as p, numpy as np\nrandom = np.random.default_rng(0)\n{call}\n"
    run = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
    time.sleep(after)
    if run.poll() is not None:
        return None
    run.send_signal(signal.SIGINT)
    sent = time.perf_counter()
    run.wait()
    return time.perf_counter() - sent


def main():
    for name in sys.argv[1:] or CALLS:
        try:
            with_text, count = documented(name)
        except ImportError as error:
            print(f"{name}: {error}")
            continue
        seconds = interrupted(name)
        ended = "ended before the signal" if seconds is None else f"ended after {seconds:.1f} s"
        print(f"{name}: {with_text} of {count} documented, {ended}", flush=True)


if __name__ == "__main__":
    main()
