#!/usr/bin/env python3
"""What the package `ifgarments` costs over the library: import, conversion of arrays and reports; how soon Ctrl-C ends a call; and whether it gives what `ifg fix` writes.

    benches/python_overhead.py --data ../shared/data [--only o1] [--runs 5]

Run it with a Python that has the wheel, meshio and numpy; `ifg` is the wheel's own.
"""
import argparse, json, os, signal, subprocess, sys, tempfile, threading, time
from outfit_data import outfits


def imported(module):
    """The shortest of 7 imports in fresh processes, in seconds."""
    code = f"import time; s = time.perf_counter(); import {module}; print(time.perf_counter() - s)"
    return min(float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout) for _ in range(7))


def interrupted(moments=8):
    """Seconds from Ctrl-C to KeyboardInterrupt, at several moments of the built-in scene."""
    import ifgarments

    body, layers = ifgarments.demo_scene(resolution=2.0)
    found = []
    for k in range(moments):
        sent = []

        def interrupt():
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        threading.Timer(0.1 + 0.3 * k, interrupt).start()
        try:
            ifgarments.resolve(body, layers)
        except KeyboardInterrupt:
            found.append(time.perf_counter() - sent[0])
        time.sleep(1)  # what is left of the work ends
    return found


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--only", nargs="*", default=["o1_"])
    p.add_argument("--runs", type=int, default=5)
    a = p.parse_args()
    print(f"import: numpy {imported('numpy'):.3f} s, ifgarments with numpy {imported('ifgarments'):.3f} s")
    found = interrupted()
    print(f"Ctrl-C: KeyboardInterrupt after {min(found):.2f} to {max(found):.2f} s ({len(found)} times)")
    import ifgarments, meshio, numpy as np

    for body, name, skin, layers, garments in outfits(a.data, ("body_a", "body_b", "body_c"), a.only):
        skin_mesh, meshes = meshio.read(skin), {n: meshio.read(g) for n, g in zip(layers, garments)}
        walls, inner = [], []
        for _ in range(a.runs):
            start = time.perf_counter()
            resolved = ifgarments.resolve(skin_mesh, meshes)
            walls.append(time.perf_counter() - start)
            inner.append(resolved.report["seconds"])
        best = min(range(a.runs), key=lambda k: walls[k])
        with tempfile.TemporaryDirectory() as out:
            run = subprocess.run([sys.executable, "-m", "ifgarments", "fix", "--body", skin, *garments, "--out", out, "--no-pictures", "--json"],
                                 capture_output=True, text=True, check=True)
            written = [meshio.read(os.path.join(out, os.path.basename(g))).points for g in garments]
            seconds = json.loads(run.stdout)["report"]["seconds"]
        same = all(np.array_equal(w, m.points) and w.dtype == m.points.dtype for w, m in zip(written, resolved.layers.values()))
        over = [1e3 * (w - i) for w, i in zip(walls, inner)]
        print(f"{body}/{name}: call {walls[best]:.3f} s, of it resolve {inner[best]:.3f} s; beside it {min(over):.1f} to {max(over):.1f} ms, "
              f"{100 * over[best] / 1e3 / inner[best]:.1f} %; `ifg fix` reports {seconds:.3f} s; positions equal: {same}")


if __name__ == "__main__":
    main()
