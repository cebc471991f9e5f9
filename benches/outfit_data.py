"""The outfits of the test data, for the programs beside this file."""
import json, os, random, subprocess, sys
from typing import NamedTuple


class Outfit(NamedTuple):
    body: str  # the folder's name: body_a
    name: str
    skin: str  # path of the body's mesh
    layers: list  # names of the garments, innermost first
    garments: list  # their paths


def arguments():
    """The program's own arguments, and those after `--`, which are of `ifg fix`."""
    argv = sys.argv[1:]
    if "--" not in argv:
        return argv, []
    return argv[: argv.index("--")], argv[argv.index("--") + 1 :]


def outfits(data, bodies, only=None):
    """All outfits of some bodies, in the order of their files; with `only`, those whose names begin with one of these."""
    for body in bodies:
        folder = os.path.join(data, body)
        with open(os.path.join(folder, "outfits.json"), encoding="utf-8") as file:
            found = json.load(file)
        for name, outfit in found.items():
            if only and not any(name.startswith(o) for o in only):
                continue
            layers = outfit["layers_inner_to_outer"]
            garments = [os.path.join(folder, "garments", g + ".ply") for g in layers]
            yield Outfit(body, name, os.path.join(folder, "body_clean.ply"), layers, garments)


def drawn(data, body, count, seed):
    """Outfits drawn from the body's `slots.json`: 3 to 6 slots, innermost first, and a garment of each; not a skirt over a dress."""
    folder = os.path.join(data, body)
    with open(os.path.join(folder, "slots.json"), encoding="utf-8") as file:
        slots = json.load(file)["slots_inner_to_outer"]
    generator = random.Random(seed)
    for number in range(count):
        while True:
            chosen = sorted(generator.sample(range(len(slots)), generator.randint(3, 6)))
            names = [list(slots)[k] for k in chosen]
            if not {"skirt", "one_piece"} <= set(names):
                break
        layers = [generator.choice(slots[name]) for name in names]
        garments = [os.path.join(folder, "garments", g + ".ply") for g in layers]
        yield Outfit(body, f"d{seed}_{number + 1:02}", os.path.join(folder, "body_clean.ply"), layers, garments)


class Resolved(NamedTuple):
    name: str
    skin: str  # path of the body's mesh
    before: list  # paths of the garments as they came, innermost first
    after: list  # paths of what ifg wrote
    report: dict
    seconds: float  # of processor, of the whole command


def resolved(ifg, data, names, out, extra=()):
    """Outfits resolved by `ifg fix`, one after the other: those of body_a and body_b named (`o1` is `o1_casual`); `demo` is the built-in scene."""
    for name in names:
        if name == "demo":
            folder = os.path.join(out, "demo")
            yield _resolve(ifg, name, ["demo"], None, [], folder, extra)
            continue
        found = outfits(data, ("body_a", "body_b")) if os.path.isdir(data) else []
        found = [outfit for outfit in found if outfit.name == name or outfit.name.startswith(name + "_")]
        if not found:
            sys.exit(f"{name}: no such outfit in {data}. The test data are not part of the repository; `demo` needs none")
        for _, full, skin, _, garments in found:
            folder = os.path.join(out, full)
            yield _resolve(ifg, full, ["fix", "--body", skin, *garments], skin, garments, folder, extra)


def processor_seconds():
    """Of this process and of those that it waited for, all threads together."""
    return sum(os.times()[:4])


def _resolve(ifg, name, command, skin, before, folder, extra):
    try:
        start = processor_seconds()
        run = subprocess.run([ifg, *command, "--json", "--no-pictures", "--out", folder, *extra], capture_output=True, text=True)
        seconds = processor_seconds() - start
    except FileNotFoundError:
        sys.exit(f"{ifg}: not found. Build it with `cargo build --release`, or name it with --ifg")
    if run.returncode != 0:
        sys.exit(f"{name}: ifg ended with exit code {run.returncode}\n{run.stderr}")
    with open(os.path.join(folder, "receipt.json"), encoding="utf-8") as file:
        receipt = json.load(file)
    files = [os.path.basename(i["file"]) for i in receipt["inputs"]]
    if skin is None:
        skin, *before = [os.path.join(folder, "input", file) for file in files]
    return Resolved(name, skin, before, [os.path.join(folder, file) for file in files[1:]], receipt["report"], seconds)
