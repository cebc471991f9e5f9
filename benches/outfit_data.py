"""The outfits of the test data, for the programs beside this file."""
import json, os, random
from typing import NamedTuple


class Outfit(NamedTuple):
    body: str  # the folder's name: body_a
    name: str
    skin: str  # path of the body's mesh
    layers: list  # names of the garments, innermost first
    garments: list  # their paths


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
