#!/usr/bin/env python3
"""One wardrobe batch in several ways, workers killed meanwhile: seconds, and whether the bytes are equal.

    benches/batches.py WARDROBE OUT --count 200 --kills 20 [--ifg PATH] [--ways one shards ...]

WARDROBE is made where it is missing: five garments of the built-in mannequin, coarse, and twelve
bodies of its topology. Ways: `one` process with one thread; `shards`: two of `ifg --shard`,
restarted when killed; `processes` and `ray`: ifgarments.batch; `hyperqueue`: a local cluster. Needs a
Python with ifgarments, and with ray and hyperqueue for these two, which listen on the machine's
address. A network of its own keeps them from other machines, as root:

    unshare -n sh -c 'ip link set lo up; benches/batches.py ...'
"""

import argparse
import hashlib
import itertools
import json
import os
import pathlib
import random
import re
import shlex
import signal
import subprocess
import threading
import time
from functools import partial

import numpy as np
from ifgarments import Wardrobe, batch, demo_scene
from outfit_data import processor_seconds

WORKERS = 2
TIMED = ("timings.json", "summary.csv", "report.html")


def write_ply(path, vertices, faces):
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [*(f"property float {axis}" for axis in "xyz"), f"element face {len(faces)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    rows = np.empty(len(faces), [("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, faces
    path.write_bytes("\n".join(header).encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def make_wardrobe(args):
    """Garments of the mannequin, which is one of twelve bodies: three heights, four girths."""
    drawn = args.out / "drawn"
    drawn.mkdir()
    body, garments = demo_scene(resolution=0.71)
    garments["trousers"] = demo_scene(resolution=0.71, trousers=True)[1]["trousers"]
    for name, mesh in {"mannequin": body, **garments}.items():
        write_ply(drawn / f"{name}.ply", *mesh)
    files = [str(drawn / f"{name}.ply") for name in garments]
    mesh = ["--body", "mannequin", "--mesh", str(drawn / "mannequin.ply")]
    subprocess.run([args.ifg, "wardrobe", "add", args.wardrobe, *mesh, *files], check=True)
    wardrobe = Wardrobe(args.wardrobe)
    for height, girth in itertools.product((0.94, 1.0, 1.06), (0.95, 1.0, 1.05, 1.1)):
        if height == girth == 1.0:
            continue
        name = f"body_{100 * height:.0f}_{100 * girth:.0f}"
        write_ply(drawn / f"{name}.ply", body[0] * [girth, height, girth], body[1])
        wardrobe.add_body(name, drawn / f"{name}.ply")


def combinations(wardrobe, count):
    """Some of all bodies with two to four garments, worn as the garments' hints say."""
    hints = {name: about["layer"] for name, about in wardrobe.garments.items()}
    order = sorted(hints, key=lambda name: (hints[name]["order"], hints[name]["class"], name))
    worn = [list(c) for k in (2, 3, 4) for c in itertools.combinations(order, k)]
    # A skirt or trousers.
    worn = [c for c in worn if not {"skirt", "legs"} <= {hints[name]["class"] for name in c}]
    every = [(body, garments) for body in sorted(wardrobe.bodies) for garments in worn]
    return random.Random(1).sample(every, min(count, len(every)))


def listed(args):
    """The combinations of a run, in the list in its new folder; makes the wardrobe where it is missing."""
    args.out.mkdir(parents=True)
    if not pathlib.Path(args.wardrobe).exists():
        make_wardrobe(args)
    combos = combinations(Wardrobe(args.wardrobe), args.count)
    outfits = [{"body": body, "garments": garments} for body, garments in combos]
    (args.out / "list.json").write_text(json.dumps({"outfit": outfits}))
    return combos


def digest(folder):
    """Number and hash of all files that hold no seconds."""
    files = [p for p in sorted(folder.rglob("*")) if p.is_file() and p.name not in TIMED]
    hashed = hashlib.sha256()
    for path in files:
        hashed.update(str(path.relative_to(folder)).encode())
        hashed.update(path.read_bytes())
    return len(files), hashed.hexdigest()[:16]


class Killer(threading.Thread):
    """Kills a worker every so often; `find` lists their process ids."""

    def __init__(self, find, kills, between):
        super().__init__(daemon=True)
        self.find, self.left, self.between, self.struck = find, kills, between, 0
        self.end = threading.Event()

    def run(self):
        draw = random.Random(2)
        while self.left > self.struck and not self.end.wait(self.between * 2 * draw.random()):
            workers = self.find()
            if workers:
                os.kill(draw.choice(workers), signal.SIGKILL)
                self.struck += 1


def parts_of(args):
    """Process ids of the shards of this run alone."""
    return matching("-f", f"^[^ ]*ifg .* --out {re.escape(str(args.out))}/.* --shard")


def matching(*pattern):
    """Process ids that pgrep finds."""
    found = subprocess.run(["pgrep", *pattern], capture_output=True, text=True, check=False)
    return [int(pid) for pid in found.stdout.split() if int(pid) != os.getpid()]


def command(args, out, *more):
    return [
        *(args.ifg, "--threads", "1", "wardrobe", "batch", args.wardrobe, "--out", str(out)),
        *("--list", str(args.out / "list.json"), "--no-pictures", *more),
    ]


def one(args, combos, out):
    Wardrobe(args.wardrobe).batch(combos, out, threads=1, picture_height=0)


def shards(args, combos, out):
    def part(k):
        arguments = command(args, out, "--shard", f"{k}/{WORKERS}")
        while subprocess.run(arguments, stdout=subprocess.DEVNULL, check=False).returncode < 0:
            pass  # killed: again

    parts = [threading.Thread(target=part, args=(k + 1,)) for k in range(WORKERS)]
    for thread in parts:
        thread.start()
    for thread in parts:
        thread.join()
    subprocess.run(command(args, out), stdout=subprocess.DEVNULL, check=False)


def processes(args, combos, out):
    options = {"workers": WORKERS, "retries": args.kills, "picture_height": 0}
    batch.run(args.wardrobe, combos, out, **options)


def ray(args, combos, out):
    import ray as cluster

    cluster.init("local", num_cpus=WORKERS, include_dashboard=False)  # none that runs already
    batch.run(args.wardrobe, combos, out, engine="ray", retries=args.kills, picture_height=0)
    cluster.shutdown()


def hyperqueue(args, combos, out):
    from hyperqueue import Job, LocalCluster
    from hyperqueue.cluster import WorkerConfig

    parts, again = 8, True
    with LocalCluster() as cluster:
        for _ in range(WORKERS):
            cluster.start_worker(WorkerConfig(cores=1))
        client = cluster.client()
        while again:
            job = Job()
            for k in range(parts):
                part = shlex.join(command(args, out, "--shard", f"{k + 1}/{parts}"))
                # Intersections left (1) are a result. A part that was killed counts as failed: the
                # same job once more.
                job.program(["sh", "-c", f"{part}; test $? -le 2"])
            again = not client.wait_for_jobs([client.submit(job)], raise_on_error=False)
    subprocess.run(command(args, out), stdout=subprocess.DEVNULL, check=False)


WAYS = {
    "one": (one, lambda _: []),
    "shards": (shards, parts_of),
    "processes": (processes, lambda _: matching("-P", str(os.getpid()), "-f", "spawn_main")),
    "ray": (ray, lambda _: matching("-f", "ray::_do")),
    "hyperqueue": (hyperqueue, parts_of),
}


def main():
    about = {"description": __doc__, "formatter_class": argparse.RawTextHelpFormatter}
    parser = argparse.ArgumentParser(**about)
    parser.add_argument("wardrobe")
    parser.add_argument("out", type=pathlib.Path, help="a folder that does not exist yet")
    parser.add_argument("--count", type=int, default=200, help="combinations")
    parser.add_argument("--kills", type=int, default=0, help="of workers, in each way")
    parser.add_argument("--between", type=float, default=5.0, help="mean seconds between kills")
    parser.add_argument("--ifg", default="ifg")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    args = parser.parse_args()
    combos = listed(args)
    # Processor seconds: of this process, and of all that were started and waited for.
    print(
        "| way | seconds | processor s | clean | kills | files, hash |\n|---|---|---|---|---|---|"
    )
    for way in args.ways:
        run, find = WAYS[way]
        kills = 0 if way == "one" else args.kills
        killer = Killer(partial(find, args), kills, args.between)
        killer.start()
        start, used = time.perf_counter(), processor_seconds()
        run(args, combos, args.out / way)
        seconds, used = time.perf_counter() - start, processor_seconds() - used
        killer.end.set()
        clean = json.loads((args.out / way / "summary.json").read_text())["clean"]
        files, hashed = digest(args.out / way)
        row = f"| {way} | {seconds:.1f} | {used:.0f} | {clean} of {len(combos)} | {killer.struck} |"
        print(f"{row} {files}, {hashed} |", flush=True)


if __name__ == "__main__":
    main()
