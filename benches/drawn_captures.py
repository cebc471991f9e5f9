#!/usr/bin/env python3
"""`ifg reconstruct` on captures of drawn people: body, clothes, motion, pictures and noise.

    benches/drawn_captures.py IFG [IFG ...] [--seed 100] [--count 60] [--shared ../shared]

Each seed draws a body of ../shared/data (body_c strides), a garment for the legs, a top and, of half of the people, an outer one; a
motion; 128 to 512 pixels and 8 to 48 frames; noise of labels and masks of 0, 0.3 or 0.6, and up to 10 mm of non-rigid motion, as
../shared/tools/render_sequence.py draws them. Poses are exact; a third of the captures says so, the others are refined as an
estimator's. Garments meet as they come, and what pokes out has the label of the inner one. A line each: for every garment the mean
distance of its surface from the truth's in mm, and the 95th percentile; `-` if it was not reconstructed. Then for each program, of
outermost garments and of the others, what these means are on average, in the median, the 90th percentile and at most. Needs: pip
install numpy meshio trimesh libigl
"""
import argparse, collections, json, os, random, subprocess, sys, tempfile
import igl, meshio, numpy as np, trimesh

POOLS = {
    "a": ("jeans trousers suit_trousers pencil_skirt flared_skirt shorts", "tshirt sweater blouse tshirt", "cardigan suit_jacket coat - - -"),
    "b": ("jeans trousers", "tshirt sweater newton_shirt", "coat suit_jacket - -"),
    "c": (
        "trousers jeans_m4 midi_skirt mini_skirt shorts pencil_skirt baggy_trousers",
        "tshirt sweater tee_f2 hoodie turtleneck tunic longsleeve",
        "cardigan_s short_jacket wool_coat - - -",
    ),
}
MOTIONS = ["turn_a_96", "turn_a_96", "turn_arms_down_96", "turn_arms_up_72", "turn_walk_84", "turn_static_60"]


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("ifg", nargs="+"), a.add_argument("--seed", type=int, default=100), a.add_argument("--count", type=int, default=60)
    a.add_argument("--shared", default="../shared")
    a = a.parse_args()
    means = collections.defaultdict(list)
    for seed in range(a.seed, a.seed + a.count):
        body, layers, rendering, stated, words = drawn(a.shared, seed)
        with tempfile.TemporaryDirectory() as folder:
            capture = os.path.join(folder, "person")
            render = [sys.executable, f"{a.shared}/tools/render_sequence.py", "--body", body, "--layers", ",".join(layers), "--out", capture]
            subprocess.run([*render, *rendering], check=True, capture_output=True)
            for number, ifg in enumerate(a.ifg):
                out = os.path.join(folder, str(number))
                done = subprocess.run(
                    [ifg, "reconstruct", capture, "--body", body, "--out", out, *stated], capture_output=True, text=True
                )
                found = [distances(body, out, name) for name in layers]
                for k, garment in enumerate(found):
                    if garment:
                        means[ifg, k == len(layers) - 1].append(garment[0])
                text = [f"{n} {'-' if f is None else '%.1f/%.0f' % f}" for n, f in zip(layers, found)]
                print(seed, ifg, words, "exit", done.returncode, "; ".join(text), flush=True)
    for ifg in a.ifg:
        for outermost in (True, False):
            m = means[ifg, outermost]
            which = "outermost" if outermost else "others"
            print(f"{ifg} {which}: {len(m)}, mm: mean {np.mean(m):.2f}, median {np.median(m):.2f}, p90 {np.percentile(m, 90):.1f}, largest {max(m):.1f}")


def drawn(shared, seed):
    """Body, garments, arguments of the renderer, what is stated of the poses, and all that in words."""
    r = random.Random(seed)
    body = r.choice("aabbc")
    layers = [r.choice([None if name == "-" else name for name in pool.split()]) for pool in POOLS[body]]
    if body == "a" and r.random() < 0.15:
        layers = ["dress", None, r.choice(["cardigan", "suit_jacket", "coat", None, None, None])]
    layers = [name for name in layers if name]
    motion, size, frames = r.choice(MOTIONS), r.choice([128, 256, 256, 512]), r.choice([8, 16, 24, 24, 48])
    motion = f"{shared}/data/sequences/{motion}.json"
    with open(motion, encoding="utf-8") as file:
        stride = max(1, len(json.load(file)["frames"]) // frames)
    noise = [r.choice([0, 0.3, 0.6]), r.choice([0, 0.3, 0.6]), r.choice([0, 0.005, 0.01])]
    stated = r.choice([["--pose-noise", "0,0"], [], []])
    rendering = ["--seq", motion, *f"--size {size} --frames {frames} --stride {stride} --seed {seed}".split()]
    rendering += "--label-noise {} --mask-noise {} --nonrigid {}".format(*noise).split()
    words = f"body_{body} {os.path.basename(motion)[:-5]} {size} px {frames} frames, {'exact' if stated else 'refined'}"
    return f"{shared}/data/body_{body}", layers, rendering, stated, words


def distances(body, out, name):
    """Mean and 95th percentile, in mm, of a garment's surface from the truth's; None if it was not reconstructed."""
    path = f"{out}/garments/person_{name}/garment.ply"
    if not os.path.exists(path):
        return None
    ours, truth = (meshio.read(p) for p in (path, f"{body}/garments/{name}.ply"))
    mesh = trimesh.Trimesh(ours.points, ours.cells_dict["triangle"], process=False)
    samples = np.asarray(trimesh.sample.sample_surface(mesh, 8000, seed=0)[0], float)
    squared = igl.point_mesh_squared_distance(samples, truth.points.astype(float), truth.cells_dict["triangle"].astype(np.int64))[0]
    mm = 1e3 * np.sqrt(squared)
    return mm.mean(), np.percentile(mm, 95)


if __name__ == "__main__":
    main()
