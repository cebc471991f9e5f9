#!/usr/bin/env python3
"""One wardrobe batch on two nodes, of which one dies: whether the bytes are those of one process.

    benches/two_nodes.py WARDROBE OUT --count 16 [--ifg PATH] [--hq PATH] [--ways hyperqueue ray]

The nodes are two network namespaces of this machine, joined by a virtual cable: what runs in one
reaches the other alone. It needs root, Linux and iproute2, and says so where namespaces are not
permitted. `hyperqueue` runs `hq`, the program of HyperQueue; `ray` runs `ray start` and
ifgarments.batch. OUT is the folder that both nodes share.

The first node is the head and works as well. On the second, when a quarter of the results is there,
one worker is killed (SIGKILL), and replaced. At half of them the second node dies: its cable is cut,
and all its processes are killed.
"""

import argparse
import contextlib
import os
import pathlib
import shlex
import signal
import subprocess
import sys
import tempfile
import time

from batches import command, digest, listed, one

# Of this run alone; addresses of a range for tests (RFC 2544).
HEAD, SECOND = f"ifg-{os.getpid()}-head", f"ifg-{os.getpid()}-second"
HOSTS = {HEAD: "198.18.23.1", SECOND: "198.18.23.2"}
PARTS = 8


def ip(*arguments):
    subprocess.run(["ip", *arguments], check=True)


def nodes_up():
    """Two namespaces and a cable between them; without a way to anywhere else."""
    try:
        for node in HOSTS:
            ip("netns", "add", node)
        ip("link", "add", "eth0", "netns", HEAD, "type", "veth", "peer", "eth0", "netns", SECOND)
        for node, address in HOSTS.items():
            ip("-n", node, "link", "set", "lo", "up")
            ip("-n", node, "address", "add", f"{address}/24", "dev", "eth0")
            ip("-n", node, "link", "set", "eth0", "up")
    except (OSError, subprocess.CalledProcessError) as error:
        nodes_down()
        sys.exit(
            f"no network namespaces: {error}. Run as root, with iproute2, where they are permitted"
        )


def processes(node):
    """Process ids and command lines of a node."""
    pids = subprocess.run(["ip", "netns", "pids", node], capture_output=True, text=True).stdout
    found = {}
    for pid in pids.split():
        try:
            line = pathlib.Path(f"/proc/{pid}/cmdline").read_bytes()
        except OSError:  # it has just ended
            continue
        found[int(pid)] = line.replace(b"\0", b" ").decode(errors="replace").strip()
    return found


def kill_all(node):
    """Until nothing is left: a process may start another one meanwhile."""
    killed = 0
    while left := [pid for pid, line in processes(node).items() if line]:
        for pid in left:
            try:
                os.kill(pid, signal.SIGKILL)
                killed += 1
            except ProcessLookupError:
                pass
        time.sleep(0.1)
    return killed


def nodes_down():
    for node in HOSTS:
        if (pathlib.Path("/run/netns") / node).exists():
            kill_all(node)
            ip("netns", "delete", node)


class Run:
    """A batch of one way, and what is done to its nodes. Command lines of processes that do outfits
    begin with `busy`; that of the process that is killed has `worker` in it.
    """

    def __init__(self, args, out, worker, busy):
        self.args, self.out, self.worker, self.busy = args, out, worker, busy
        self.log = args.out / f"{out.name}.log"

    def start(self, node, *arguments, **environment):
        """A process of a node."""
        line = ["ip", "netns", "exec", node, *map(str, arguments)]
        with self.log.open("ab") as log:
            return subprocess.Popen(line, stdout=log, stderr=log, env={**os.environ, **environment})

    def at_outfits(self):
        """How many processes of the second node."""
        return sum(line.startswith(self.busy) for line in processes(SECOND).values())

    def results(self):
        return len(list(self.out.rglob("result.json")))

    def wait_for(self, there, batch):
        """Waits until there are results and the second node is at an outfit."""
        while self.results() < there or not self.at_outfits():
            if batch.poll() is not None:
                sys.exit(
                    f"{self.out.name}: the batch ended too early ({batch.returncode}): {self.log}"
                )
            time.sleep(0.05)

    def strike(self, batch, replace=lambda: None):
        """Kills a worker, and then the node."""
        self.wait_for(self.args.count // 4, batch)
        worker = next(pid for pid, line in processes(SECOND).items() if self.worker in line)
        os.kill(worker, signal.SIGKILL)
        print(f"{self.out.name}: a worker killed at {self.results()} results", end="", flush=True)
        replace()
        time.sleep(2)
        self.wait_for(self.args.count // 2, batch)
        ip("-n", SECOND, "link", "set", "eth0", "down")
        busy, reached, start = self.at_outfits(), self.results(), time.perf_counter()
        with contextlib.suppress(subprocess.TimeoutExpired):
            batch.wait(self.args.lives)
        killed = kill_all(SECOND)
        code = batch.wait()
        seconds = time.perf_counter() - start
        print(f", the second node ({busy} of its processes at outfits) at {reached}, and {killed}")
        print(f"processes killed; ended {seconds:.0f} s after with {code}", flush=True)


def hyperqueue(args, out):
    run = Run(args, out, " worker start ", f"{args.ifg} ")
    home = args.out / "hq"
    hq = [args.hq, "--server-dir", home]
    run.start(HEAD, *hq, "server", "start", "--host", HOSTS[HEAD])
    while not (home / "hq-current/access.json").exists():
        time.sleep(0.1)
    for node in HOSTS:
        run.start(node, *hq, "worker", "start", "--cpus", "1")
    part = f'{shlex.join(command(args, out, "--shard"))} "$HQ_TASK_ID/{PARTS}"'
    # Intersections left (1) are a result; what a lost worker started may still be at the part (75).
    again = f"while {part}; code=$?; test $code = 75; do sleep 1; done; test $code -le 1"
    job = ["submit", "--wait", "--array", f"1-{PARTS}", "--cpus", "1", "--crash-limit", "5"]
    job += ["--stdout", "none", "--stderr", "none"]
    batch = run.start(HEAD, *hq, *job, "--", "sh", "-c", again)
    run.strike(batch, lambda: run.start(SECOND, *hq, "worker", "start", "--cpus", "1"))
    run.start(HEAD, *command(args, out)).wait()


LOOK = """
import json, sys
from ifgarments import batch
wardrobe, looks, out, size = sys.argv[1:]
looks = [(o["body"], o["garments"]) for o in json.load(open(looks))["outfit"]]
batch.run(wardrobe, looks, out, engine="ray", size=int(size), picture_height=0)
"""


def ray(args, out):
    run = Run(args, out, "ray::_do", "ray::_do")
    start = [sys.executable, "-m", "ray.scripts.scripts", "start", "--block", "--num-cpus", "1"]
    start += ["--object-store-memory", str(10**8)]
    # Files of its own, so that no cluster of this machine is taken for it, nor it for another one.
    address, own = f"{HOSTS[HEAD]}:6379", tempfile.mkdtemp(prefix="ifg")
    quiet = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_TMPDIR": own}
    head = ["--head", "--port", "6379", "--include-dashboard", "false"]
    run.start(HEAD, *start, *head, "--node-ip-address", HOSTS[HEAD], **quiet)
    reach = f"import socket; socket.create_connection(('{HOSTS[HEAD]}', 6379))"
    while run.start(HEAD, sys.executable, "-c", reach).wait():
        time.sleep(1)
    second = ["--address", address, "--node-ip-address", HOSTS[SECOND]]
    run.start(SECOND, *start, *second, **quiet)
    look = [args.wardrobe, args.out / "list.json", out, -(-args.count // PARTS)]
    # Ray's driver notices after seven minutes that nothing answers where the cable is cut.
    run.strike(run.start(HEAD, sys.executable, "-c", LOOK, *look, RAY_ADDRESS=address, **quiet))


WAYS = {"hyperqueue": hyperqueue, "ray": ray}


def main():
    about = {"description": __doc__, "formatter_class": argparse.RawTextHelpFormatter}
    parser = argparse.ArgumentParser(**about)
    parser.add_argument("wardrobe", help="made where it is missing, as by batches.py")
    parser.add_argument("out", type=pathlib.Path, help="a folder that does not exist yet")
    parser.add_argument("--count", type=int, default=16, help="combinations")
    lives = "seconds for which the second node goes on, without its cable, before it is killed"
    parser.add_argument("--lives", type=float, default=0.0, help=lives)
    parser.add_argument("--ifg", default="ifg")
    parser.add_argument("--hq", default="hq")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    args = parser.parse_args()
    nodes_up(), nodes_down()  # before anything takes time
    args.out = args.out.resolve()
    combos = listed(args)
    one(args, combos, args.out / "one")
    whole = digest(args.out / "one")
    print(f"one: {whole[0]} files, {whole[1]}", flush=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))  # nothing is left running
    for way in args.ways:
        nodes_up()
        try:
            WAYS[way](args, args.out / way)
        finally:
            nodes_down()
        files, hashed = digest(args.out / way)
        same = "the same bytes" if (files, hashed) == whole else "OTHER BYTES"
        print(f"{way}: {files} files, {hashed}: {same}", flush=True)


if __name__ == "__main__":
    main()
