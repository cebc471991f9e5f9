#!/usr/bin/env python3
"""The paper's chain once whole: two imperfect captures, fields, garments, one outfit.

    whole_chain.py IFG OUT [--degrees 3] [--mm 9] [--camera 0.5] [--steps 100] [--tools DIR] [--python PYTHON]

`ifg capture synth` renders two people whose clothes move, and disturbs poses, camera, masks, labels
and normals; `ifg reconstruct --route fields` trains phi and d on each; `ifg wardrobe match` puts
garments of both on one body, by default, with --method paper, and with the trained phi of the assets
(--fields assets). --tools names the folder of
referee.py and compare.py, which judge the result (they need numpy, meshio and libigl: --python).
"""
import argparse
import json
import os
import subprocess
import sys
import time

CAPTURES = {"anna": "trousers,tshirt", "berta": "skirt,jacket"}
METHODS = {
    "contacts": [],
    "paper": ["--method", "paper"],
    "paper on phi": ["--method", "paper", "--fields", "assets"],
}
OUTFIT = ["anna_trousers", "anna_tshirt", "berta_jacket"]


def run(command, accepted=(0,)):
    """Standard output of a command, and processor seconds."""
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True)
    after = os.times()
    if done.returncode not in accepted:
        sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout, sum(after[2:4]) - sum(before[2:4])


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("ifg"), a.add_argument("out")
    a.add_argument("--degrees", type=float, default=3)
    a.add_argument("--mm", type=float, default=9)
    a.add_argument("--camera", type=float, default=0.5)
    a.add_argument("--steps", type=int, default=100)
    a.add_argument("--tools", help="folder of referee.py and compare.py")
    a.add_argument("--python", default=sys.executable)
    a = a.parse_args()
    os.makedirs(a.out)
    at = lambda *names: os.path.join(a.out, *names)
    wardrobe = at("wardrobe")
    for seed, (name, garments) in enumerate(CAPTURES.items()):
        noise = ["--pose-noise", f"{a.degrees},{a.mm}", "--camera-noise", str(a.camera)]
        noise += ["--normal-noise", "12", "--nonrigid", "1cm", "--seed", str(seed)]
        run([a.ifg, "capture", "synth", "--garments", garments, "--out", at(name), *noise])
        fields = ["--route", "fields", "--fields-steps", str(a.steps), "--json"]
        fields += ["--phi-steps", str(a.steps)]  # each garment gets the trained phi
        text, seconds = run([a.ifg, "reconstruct", at(name), "--body", at(name, "body"), "--out", wardrobe, *fields])
        poses = json.loads(text)["poses"] or {"camera_degrees": 0}
        print(f"{name}: {seconds:.0f} processor seconds, camera turned by {poses['camera_degrees']:.2f} degrees")
        if a.tools:
            for garment in garments.split(","):
                truth = at(name, "truth", f"{garment}.ply")
                found = at("wardrobe", "garments", f"{name}_{garment}", "garment.ply")
                text, _ = run([a.python, f"{a.tools}/compare.py", found, truth, "--samples", "20000"])
                there, back = (1e3 * json.loads(text)[k]["mean"] for k in ("result_to_reference", "reference_to_result"))
                print(f"    {garment}: {there:.1f} mm to the truth on average, {back:.1f} mm back")
    for name, how in METHODS.items():
        look = at(f"look_{name.replace(' ', '_')}")
        begin = time.time()
        match = [a.ifg, "wardrobe", "match", wardrobe, "--body", "body", *OUTFIT, *how, "--json"]
        text, seconds = run([*match, "--out", look])
        result = json.loads(text)
        layers = result["report"]["layers"]
        moved = max(layer["moved"]["max"] for layer in layers)
        strain = max(layer["strain"]["max"] for layer in layers)
        print(f"{name}: {seconds:.1f} processor seconds, {time.time() - begin:.1f} s; moved by {1e3 * moved:.1f} mm"
              f" at most, strain {1e2 * strain:.0f} % at most", end="")
        if a.tools:
            files = [os.path.join(look, f"{name}.ply") for name in OUTFIT]
            text, _ = run([a.python, f"{a.tools}/referee.py", "--body", os.path.join(look, "body.ply"), "--after", *files], (0, 1))
            print(f"; referee: {text.strip().splitlines()[-1]}", end="")
        print()
        for layer in layers:
            did = layer.get("algorithm1")
            if did:
                print(f"    {layer['name']}: {did['queries']} queries, {did['skipped_by_bound']} skipped by a bound and"
                      f" {did['skipped_by_mask']} by the mask; read of the layers below: {', '.join(did['below'])}")
        for field in result.get("fields", []):
            print(f"    {field['garment']}: {field['read']}")


if __name__ == "__main__":
    main()
