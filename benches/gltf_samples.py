#!/usr/bin/env python3
"""Sends glTF files through `ifg fix` and back, as a garment beside a ball: what has changed in them.

    benches/gltf_samples.py IFG OUT FILES...       needs trimesh

For each file: the end of `ifg fix`; whether the JSON is the same but for bounds of accessors; and of
each kind of data, in how many accessors a byte has changed.
"""

import json
import pathlib
import struct
import subprocess
import sys

import trimesh

BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read(path):
    """JSON, and the bytes of the only buffer."""
    data = path.read_bytes()
    if path.suffix == ".glb":
        end = 20 + struct.unpack("<I", data[12:16])[0]
        document, buffer = json.loads(data[20:end]), data[end + 8 :]
    else:
        document = json.loads(data)
        buffer = (path.parent / document["buffers"][0]["uri"]).read_bytes()
    assert len(document["buffers"]) == 1, f"{path}: several buffers"
    for accessor in document["accessors"]:
        accessor.pop("min", None), accessor.pop("max", None)
    return document, buffer


def rows(document, buffer, accessor):
    view = document["bufferViews"][accessor["bufferView"]]
    size = BYTES[accessor["componentType"]] * NUMBERS[accessor["type"]]
    first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", size)
    starts = (first + k * stride for k in range(accessor["count"]))
    return [buffer[start : start + size] for start in starts]


def main():
    ifg, out, *files = sys.argv[1:]
    for number, file in enumerate(map(pathlib.Path, files)):
        folder = pathlib.Path(out, str(number))
        folder.mkdir(parents=True)
        low, high = trimesh.load(file, process=False, force="scene").bounds
        size, middle = (high - low).max(), (low + high) / 2
        ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3 * size)
        ball.apply_translation([middle[0], middle[1], high[2] + 0.32 * size])
        ball.export(folder / "ball.glb")
        fix = [ifg, "fix", "--no-pictures", "--scale", str(1 / size), "--body", folder / "ball.glb"]
        done = subprocess.run([*fix, file, "--out", folder / "fixed"], capture_output=True, text=True)
        if done.returncode > 1:
            print(f"{file.name}: {done.stderr.strip()}")
            continue
        before, after = read(file), read(folder / "fixed" / file.name)
        kinds = {p["indices"]: "indices" for m in before[0]["meshes"] for p in m["primitives"] if "indices" in p}
        for mesh in before[0]["meshes"]:
            for primitive in mesh["primitives"]:
                kinds |= {index: kind for kind, index in primitive["attributes"].items()}
        changed = {}
        for index, accessor in enumerate(before[0]["accessors"]):
            if "bufferView" in accessor:
                counts = changed.setdefault(kinds.get(index, "others"), [0, 0])
                counts[0] += rows(*before, accessor) != rows(*after, accessor)
                counts[1] += 1
        json_is = "the same" if before[0] == after[0] else "ANOTHER"
        text = ", ".join(f"{kind} {a} of {b}" for kind, (a, b) in sorted(changed.items()))
        state = done.stdout.strip().splitlines()[-2]
        print(f"{file.name}: {state}; JSON {json_is}; changed: {text}", flush=True)


if __name__ == "__main__":
    main()
