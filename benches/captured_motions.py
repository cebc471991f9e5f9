#!/usr/bin/env python3
"""`ifg animate` on motions that were captured: outfits of the test data, some frames of each BVH file.

    benches/captured_motions.py FILE.bvh ... [--outfits o1 o9] [--frames 16] [--ifg target/release/ifg] [--data ../shared/data] [--out out/captured]
                                [-- extra arguments of ifg animate]

Frames are taken evenly, so that most lie far from the one before. Prints a line a file, and the sums.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys

from outfit_data import arguments, outfits, processor_seconds


def main():
    argv, extra = arguments()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("files", nargs="+", type=pathlib.Path)
    p.add_argument("--outfits", nargs="+", default=["o1", "o9"])
    p.add_argument("--frames", type=int, default=16)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--out", type=pathlib.Path, default="out/captured")
    a = p.parse_args(argv)
    # `o1` is no beginning of o10 here.
    chosen = [o for o in outfits(a.data, ("body_a", "body_b")) if o.name.split("_")[0] in a.outfits]
    if not chosen:
        sys.exit(f"{a.data}: no outfit {a.outfits}")
    for outfit in chosen:
        count, clean, everywhere = 0, 0, 0
        for file in a.files:
            all_frames = int(re.search(r"Frames:\s*(\d+)", file.read_text(errors="replace"))[1])
            out = a.out / f"{outfit.name}_{file.stem}"
            command = [a.ifg, "animate", "--body", outfit.skin, *outfit.garments, "--motion", str(file)]
            start = processor_seconds()
            run = subprocess.run([*command, "--every", str(-(-all_frames // a.frames)), "--no-pictures", "--out", str(out), *extra],
                                 capture_output=True, text=True)
            seconds = processor_seconds() - start
            if run.returncode not in (0, 1):
                print(f"{outfit.name} {file.stem}: exit code {run.returncode}: {run.stderr.strip()}", flush=True)
                continue
            report = json.loads((out / "report.json").read_text())["report"]
            frames = report["frames"]
            count, clean, everywhere = count + len(frames), clean + report["clean"], everywhere + report["clean_everywhere"]
            pairs = [frame["pairs_before"] for frame in frames]
            moved = max(frame["moved"]["max"] for frame in frames)
            left = [frame["frame"] for frame in frames if frame["pairs"] + frame["inside"] + frame["new_own_pairs"]]
            print(f"{outfit.name} {file.stem}: {report['clean']} of {len(frames)} clean, {report['clean_everywhere']} everywhere, pairs before {min(pairs)} to "
                  f"{max(pairs)}, garments {1e3 * moved:.0f} mm, body {1e3 * report['body_max']:.1f} mm, {seconds / len(frames):.1f} s a frame"
                  + (f", left in {left}" if left else ""), flush=True)
        print(f"{outfit.name}: {clean} of {count} clean, {everywhere} everywhere")


if __name__ == "__main__":
    main()
