"""Files of docs/reference/capture.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._files import Reals
from ._model import Template

#: As `ifg` writes it.
_SKELETON = (
    "metres, y up. Rest joint frames are world-aligned: G_j = G_parent T(head_j - head_parent) "
    "R_j, root G = T(root_t + head_root) R_root; skin matrix S_j = G_j T(-head_j). parent -1 is "
    "a root"
)
_META = (
    "x_cam = R x_world + t; OpenCV axes (x right, y down, z forward); metres; pixel centre "
    "(i + 0.5); rot (w, x, y, z)"
)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Writes JSON; numbers that are not finite are an error."""
    path.write_text(json.dumps(content, allow_nan=False, ensure_ascii=False) + "\n", "utf-8")


def meta(**keys: Any) -> dict[str, Any]:
    """`meta.json` with these keys."""
    return {"generator": "ifgarments.import_smpl", "convention": _META, **keys}


def write_mesh(
    path: Path, vertices: Reals, faces: NDArray[np.int64], template: Template | None = None
) -> None:
    """A binary PLY file, with skinning weights if a template body is given."""
    columns: list[tuple[str, str, str, NDArray[Any]]] = [
        (axis, "float", "<f4", vertices[:, k]) for k, axis in enumerate("xyz")
    ]
    if template is not None:
        columns += [(f"j{k}", "uchar", "u1", template.indices[:, k]) for k in range(4)]
        columns += [(f"w{k}", "float", "<f4", template.weights[:, k]) for k in range(4)]
    rows = np.empty(len(vertices), dtype=[(name, kind) for name, _, kind, _ in columns])
    for name, _, _, values in columns:
        rows[name] = values
    triangles = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for name, kind, _, _ in columns]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    head = "\n".join([*header, "end_header", ""]).encode()
    path.write_bytes(head + rows.tobytes() + triangles.tobytes())


def write_template(folder: Path, template: Template) -> None:
    """The folder of a template body."""
    folder.mkdir()
    write_mesh(folder / "body_clean.ply", template.vertices, template.faces, template)
    joints = [
        {"id": j, "name": name, "parent": parent, "head": head.tolist(), "tail": tail.tolist()}
        for j, (name, parent, head, tail) in enumerate(
            zip(template.names, template.parents, template.heads, template.tails, strict=True)
        )
    ]
    write_json(folder / "skeleton.json", {"convention": _SKELETON, "joints": joints})
