#!/usr/bin/env python3
"""Whether a real simulator starts from what `ifg fix` writes: Newton's vertex block descent, on the processor.

    benches/simulator_start.py [--ifg target/release/ifg] [--data ../shared/data] [--only demo o1 o2 o5] [--out out/simulator] [-- extra arguments of ifg fix]

Each outfit twice, as it came and resolved: the garments are cloth that fall for --frames frames around the fixed body (settings:
newton_cloth.py). Prints a Markdown table of what libigl's exact predicates count in single precision, which is what Newton computes with: pairs of triangles of two layers
(the body is one), and pairs of a garment with itself, at the start and at the end. --out has the last positions, and a line for each frame in frames.csv.
Exit code 1 if a resolved outfit meets at the start. Without --data only `demo` can run.
Needs: pip install newton warp-lang libigl meshio numpy
"""
import argparse, csv, os, sys
import numpy as np
from exact_pairs import between, displacement, load, own, save, strain
from newton_cloth import Settings, newton, simulate, wp
from outfit_data import arguments, resolved

HEAD = "| outfit | start | least distance, mm | pairs of layers, start → end | own pairs, start → end | moved, median / max, mm | strain rms / max, % | fastest at the end, m/s | s |"


def counts(body, garments):
    return between([body, *garments]), sum(own(g) for g in garments)


def main():
    argv, extra = arguments()
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--only", nargs="*", default=["demo", "o1", "o2", "o5"])
    p.add_argument("--out", default="out/simulator")
    p.add_argument("--starts", nargs="*", default=["as it came", "resolved"], choices=["as it came", "resolved"])
    p.add_argument("--frames", type=int, default=100)
    p.add_argument("--rate", type=float, default=120.0, help="frames a second")
    p.add_argument("--substeps", type=int, default=1, help="of a frame")
    p.add_argument("--iterations", type=int, default=4, help="of a substep")
    p.add_argument("--margin", type=float, default=2e-3, help="distance in metres at which contact forces begin")
    p.add_argument("--gap", type=float, default=1.5e-3, help="further distance in metres within which pairs are collected")
    p.add_argument("--body", choices=["particles", "shape"], default="particles", help="how the body collides: newton_cloth.py")
    p.add_argument("--every", type=int, default=10, help="frames between two counts in frames.csv")
    a = p.parse_args(argv)
    settings = Settings(frames=a.frames, substeps=a.substeps, rate=a.rate, iterations=a.iterations, margin=a.margin, gap=a.gap, body=a.body)
    wp.config.quiet = True
    print(f"newton {newton.__version__}, warp {wp.__version__}, {wp.get_device().name}; {settings}\n")
    print(HEAD, "|---" * (HEAD.count("|") - 1) + "|", sep="\n", flush=True)
    met = 0
    for outfit in resolved(a.ifg, a.data, a.only, os.path.join(a.out, "resolved"), extra):
        body = single(load(outfit.skin))
        for start in a.starts:
            files = outfit.after if start == "resolved" else outfit.before
            garments = [single(load(file)) for file in files]
            first = counts(body, garments)
            met += start == "resolved" and first != (0, 0)
            folder = os.path.join(a.out, outfit.name, start.replace(" ", "_"))
            os.makedirs(folder, exist_ok=True)
            with open(os.path.join(folder, "frames.csv"), "w", newline="") as file:
                rows = csv.writer(file)
                rows.writerow(["frame", "pairs", "own_pairs", "moved_median", "moved_max"])

                def row(frame, meshes):
                    if frame % a.every == 0 or frame == a.frames:
                        moved = np.concatenate([displacement(*m) for m in zip(garments, meshes)])
                        rows.writerow([frame, *counts(body, meshes), f"{np.median(moved):.6f}", f"{moved.max():.6f}"])
                        file.flush()

                run = simulate(body, garments, settings, row)
            for path, mesh in zip(files, run.garments):
                save(os.path.join(folder, os.path.basename(path)), mesh)
            last = counts(body, run.garments)
            moved = 1e3 * np.concatenate([displacement(*m) for m in zip(garments, run.garments)])
            stretched = 100 * np.abs(np.concatenate([strain(*m) for m in zip(garments, run.garments)]))
            least = f"{1e3 * min(q['least_distance']['distance'] for q in outfit.report['after']['pairs']):.2g}" if start == "resolved" else "0"
            print(f"| {outfit.name} | {start} | {least} | {first[0]:,} → {last[0]:,} | {first[1]} → {last[1]} | {np.median(moved):.1f} / {moved.max():.1f} "
                  f"| {np.sqrt((stretched**2).mean()):.1f} / {stretched.max():.0f} | {run.speed:.2f} | {run.seconds:.0f} |"
                  + (" a contact buffer was too small" if run.overflow else ""), flush=True)
    sys.exit(1 if met else 0)


def single(mesh):
    """The mesh with its positions rounded to single precision."""
    return mesh[0].astype(np.float32).astype(float), mesh[1]


if __name__ == "__main__":
    main()
