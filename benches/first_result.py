#!/usr/bin/env python3
"""From nothing to a first result: processor seconds of `pip install` in a fresh virtual environment and of a first program, for ifgarments and three packages on meshes of the kind.

    benches/first_result.py WHEEL [--runs 3]

The smallest of the runs is printed; it needs a package index. Seconds of `pip` include the package index's answers only as far as they cost processor time.
"""
import argparse, os, resource, subprocess, sys, tempfile

PROGRAMS = {
    "ifgarments": """
import ifgarments
body, layers = ifgarments.demo_scene()
resolved = ifgarments.resolve(body, layers)
assert resolved.state == "clean everywhere", resolved.state
""",
    "pysplashsurf": """
import numpy as np, pysplashsurf
points = np.random.default_rng(1).random((2000, 3))
mesh, _ = pysplashsurf.reconstruction_pipeline(points, particle_radius=0.02, smoothing_length=2.0, cube_size=0.5)
assert len(mesh.mesh.triangles) > 100
""",
    "manifold3d": """
from manifold3d import Manifold
joined = Manifold.sphere(1.0, 64) + Manifold.cube((1.2, 1.2, 1.2))
assert joined.num_tri() > 100
""",
    "trimesh": """
import trimesh
ball = trimesh.creation.icosphere(subdivisions=4)
assert ball.is_watertight and ball.contains([[0, 0, 0]])[0]
""",
}
EXTRA = {"trimesh": ["scipy", "rtree"]}


def seconds(command):
    """Processor seconds of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command[:3])} failed:\n{done.stdout}{done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("wheel")
    p.add_argument("--runs", type=int, default=3)
    a = p.parse_args()
    print("package        venv and install, s   first program, s   installed, MB")
    for name, program in PROGRAMS.items():
        installs, firsts, size = [], [], 0
        for _ in range(a.runs):
            with tempfile.TemporaryDirectory() as folder:
                packages = [a.wheel if name == "ifgarments" else name, *EXTRA.get(name, [])]
                venv, python = f"{folder}/venv", f"{folder}/venv/bin/python"
                made = seconds([sys.executable, "-m", "venv", venv])
                empty = used(venv)
                made += seconds([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages])
                size = used(venv) - empty
                installs.append(made)
                firsts.append(seconds([python, "-c", program]))
        print(f"{name:14} {min(installs):19.1f} {min(firsts):18.2f} {size / 1e6:15.0f}", flush=True)


def used(folder):
    """Bytes of all files below a folder."""
    return sum(os.lstat(os.path.join(at, f)).st_size for at, _, files in os.walk(folder) for f in files)


if __name__ == "__main__":
    main()
