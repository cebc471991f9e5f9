"""Body models with the keys of SMPL [Loper et al. 2015], and template bodies made from them.

```text
v_template    (V, 3)       vertices in the rest pose, metres
shapedirs     (V, 3, B)    directions of the shape coefficients
J_regressor   (J, V)       joints from vertices, dense or sparse
weights       (V, J)       skinning weights
kintree_table (2, J)       parents, and joints
f             (F, 3)       triangles
```

A template body is skinned without the pose-dependent directions (``posedirs``).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CaptureError
from ._files import Reals, read_npz, reals, take
from ._pickles import array, read_pickle

#: The joints of SMPL in their order.
SMPL_JOINTS = (
    "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 "
    "left_foot right_foot neck left_collar right_collar head left_shoulder right_shoulder "
    "left_elbow right_elbow left_wrist right_wrist left_hand right_hand"
).split()
#: Weights of a vertex in a template body.
_MOST_WEIGHTS = 4
#: Sum of the weights kept, of 1. The format takes 0.97 (docs/reference/capture.md).
_LEAST_SUM = 0.97


@dataclass(frozen=True, eq=False)
class Model:
    """A body model."""

    path: Path
    template: Reals
    shapes: Reals
    regressor: Reals
    weights: Reals
    parents: list[int]
    faces: NDArray[np.int64]

    @property
    def joints(self) -> int:
        """The number of joints."""
        return len(self.parents)

    def vertices(self, betas: Reals, file: Path, key: str = "betas") -> Reals:
        """The vertices of a shape. File and key are of the coefficients, for errors."""
        if len(betas) > self.shapes.shape[2]:
            raise CaptureError(
                file,
                key,
                f"has {len(betas)} coefficients, but {self.path} has {self.shapes.shape[2]}",
            )
        return np.asarray(self.template + self.shapes[:, :, : len(betas)] @ betas)


@dataclass(frozen=True, eq=False)
class Template:
    """A template body: docs/reference/capture.md."""

    vertices: Reals
    faces: NDArray[np.int64]
    #: Four joints of each vertex, and their weights.
    indices: NDArray[np.uint8]
    weights: Reals
    names: list[str]
    parents: list[int]
    heads: Reals
    tails: Reals


def read_model(path: Path) -> Model:
    """Reads a body model, an npz or a pickle file; pickles need neither chumpy nor scipy.

    Raises:
        CaptureError: the file or an array of it is missing or has the wrong shape.
    """
    archive = read_npz(path) if path.suffix == ".npz" else None
    content = read_pickle(path) if archive is None else {}

    def get(key: str) -> NDArray[Any]:
        return array(path, content, key) if archive is None else take(path, archive, key)

    template = reals(path, "v_template", get("v_template"), (None, 3))
    count = len(template)
    shapes = reals(path, "shapedirs", get("shapedirs"), (count, 3, None))
    weights = reals(path, "weights", get("weights"), (count, None))
    joints = weights.shape[1]
    if joints > 255:
        raise CaptureError(path, "weights", f"has {joints} joints; at most 255 can be written")
    regressor = reals(path, "J_regressor", get("J_regressor"), (joints, count))
    parents = _parents(path, reals(path, "kintree_table", get("kintree_table"), (2, joints)))
    faces = reals(path, "f", get("f"), (None, 3)).astype(np.int64)
    out = np.argwhere((faces < 0) | (faces >= count))
    if len(out):
        row, corner = (int(i) for i in out[0])
        index = faces[row, corner]
        raise CaptureError(path, "f", f"is {index} at [{row}, {corner}]; there are {count} vertices")
    return Model(path, template, shapes, regressor, weights, parents, faces)


def _parents(path: Path, table: Reals) -> list[int]:
    """The parent of each joint, -1 of the root; SMPL stores 4294967295 for it."""
    parents = [int(p) for p in table[0]]
    parents[0] = -1
    for joint, parent in enumerate(parents[1:], 1):
        if not 0 <= parent < joint:
            problem = f"is {parent} at [0, {joint}]; parents must come before their children"
            raise CaptureError(path, "kintree_table", problem)
    return parents


def template_body(model: Model, betas: Reals, file: Path) -> Template:
    """The body of a shape. ``file`` is that of the coefficients, for errors.

    Raises:
        CaptureError: too many coefficients, or weights that four joints do not hold.
    """
    vertices = model.vertices(betas, file)
    heads = np.asarray(model.regressor @ vertices)
    # Stable: of equal weights the first joints.
    kept = np.argsort(-model.weights, axis=1, kind="stable")[:, :_MOST_WEIGHTS]
    weights = np.take_along_axis(model.weights, kept, axis=1)
    missing = ((0, 0), (0, _MOST_WEIGHTS - kept.shape[1]))  # fewer than four joints in all
    kept, weights = np.pad(kept, missing), np.pad(weights, missing)
    sums = weights.sum(axis=1)
    worst = int(np.argmin(sums))
    if weights.min() < 0 or sums[worst] < _LEAST_SUM:
        raise CaptureError(
            model.path,
            "weights",
            f"row {worst}: the {_MOST_WEIGHTS} largest weights sum to {sums[worst]:.3f}; "
            f"they must be at least 0 and sum to at least {_LEAST_SUM}",
        )
    known = model.joints == len(SMPL_JOINTS)
    names = SMPL_JOINTS if known else [f"joint_{j}" for j in range(model.joints)]
    return Template(
        vertices=vertices,
        faces=model.faces,
        indices=kept.astype(np.uint8),
        weights=weights / sums[:, None],
        names=list(names),
        parents=model.parents,
        heads=heads,
        tails=_tails(model, vertices, heads),
    )


def _tails(model: Model, vertices: Reals, heads: Reals) -> Reals:
    """The ends of the bones.

    They are the mean of the children; for a joint without children, as far beyond the centre of
    its vertices as that is from the joint; and without vertices, as long as the bone before it.
    """
    tails = heads.copy()
    for joint, head in enumerate(heads):
        children = [c for c, p in enumerate(model.parents) if p == joint]
        weight = model.weights[:, joint]
        if children:
            tails[joint] = heads[children].mean(axis=0)
        elif weight.sum() > 0:
            tails[joint] = head + 2 * (weight @ vertices / weight.sum() - head)
        elif model.parents[joint] >= 0:
            tails[joint] = head + (head - heads[model.parents[joint]])
    return tails


def read_consensus(path: Path, model: Model) -> Reals:
    """The vertices of a clothed rest shape as `videoavatars` writes it: shape and offsets."""
    content: dict[str, Any] = read_pickle(path)
    betas = reals(path, "betas", array(path, content, "betas"), (None,))
    offsets = array(path, content, "v_personal")
    return model.vertices(betas, path) + reals(path, "v_personal", offsets, model.template.shape)
