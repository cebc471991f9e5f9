"""The outfits of the test data, for the programs beside this file."""
import json, os
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
