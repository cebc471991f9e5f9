"""Captures with SMPL parameters, converted to the format of ``ifg reconstruct``.

    python -m ifgarments.import_smpl people_snapshot_public/female-3-casual \\
        --model basicModel_f_lbs_10_207_0_v1.0.0.pkl --out anna
    ifg reconstruct anna --body anna/body --out wardrobe

Layouts and their sources: ``docs/reference/capture.md``. The body model is the user's own file.
Needs Pillow, and h5py for HDF5 files.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ._frames import Labels, Normals, pictures, poses
from ._model import read_consensus, read_model, template_body
from ._pictures import Resampling
from ._sources import read_source
from ._write import meta, write_json, write_mesh, write_template

__all__ = ["Converted", "convert"]


@dataclass(frozen=True)
class Converted:
    """What was written."""

    #: The folder of the capture; its template body is in ``body``.
    folder: Path
    #: Frames of the source, and those of them that were taken.
    available: int
    frames: list[int]
    #: Pixels of the pictures.
    size: tuple[int, int]
    #: Height of the template body in its rest pose, in metres.
    body_height: float


def convert(
    source: str | os.PathLike[str],
    model: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    frames: int = 24,
    size: int | None = 512,
    poses_file: str | os.PathLike[str] | None = None,
    labels: str | os.PathLike[str] | None = None,
    garments: Mapping[str, Iterable[int]] | None = None,
    background: Iterable[int] = (0,),
    normals: str | os.PathLike[str] | None = None,
    normal_axes: str = "opengl",
    pose_sigma: tuple[float, float] | None = None,
) -> Converted:
    """Converts a capture with SMPL parameters.

    Args:
        source: folder in the layout of People-Snapshot, SelfRecon or InstantAvatar.
        model: the body model, a pickle or npz file with the keys of SMPL.
        out: the folder to write; must not exist. It appears only when it is complete.
        frames: number of frames, evenly spaced; all if there are fewer.
        size: longest side of the pictures; larger ones are made smaller. ``None`` keeps them.
        poses_file: another file of poses than that of the layout, with the same keys.
        labels: folder with pictures of a human parser, one for each frame of the source. Without
            it, every pixel of the person is skin, and no garments are found.
        garments: names, inner to outer, and the parser's numbers of each. All others are skin.
        background: the parser's numbers of the background, and of what hides clothes, such as
            hair and bags: as skin it would cut a hole.
        normals: folder with RGB pictures of normals, one for each frame of the source. Without it
            they are missing, and the surface follows silhouettes only.
        normal_axes: ``"opengl"`` (x right, y up, z to the viewer; PIFuHD, SelfRecon) or
            ``"opencv"`` (x right, y down, z away).
        pose_sigma: how far the poses are off, in degrees and metres; by default an estimator's.

    Returns:
        Frames, sizes and the height of the body.

    Raises:
        CaptureError: a file is missing, damaged, or has the wrong shape; the message names file,
            key and shape.
        FileExistsError: ``out`` exists.
        ImportError: h5py or Pillow is needed and missing.
        ValueError: an argument is invalid.
    """
    target = Path(out)
    if target.exists():
        raise FileExistsError(f"{target} exists; give another folder, or remove it")
    if frames < 1:
        raise ValueError(f"frames is {frames}; it must be at least 1")
    if size is not None and size < 16:
        raise ValueError(f"size is {size}; it must be at least 16")
    names = Labels(labels, garments, background)
    axes = Normals(normals, normal_axes)
    smpl = read_model(Path(model))
    sequence = read_source(
        Path(source), smpl.joints, None if poses_file is None else Path(poses_file)
    )
    body = template_body(smpl, sequence.betas, sequence.file)
    count = sequence.count
    chosen = [k * count // min(frames, count) for k in range(min(frames, count))]
    lens = Resampling(sequence.width, sequence.height, sequence.k, sequence.distortion, size)
    keys = {} if pose_sigma is None else _sigma(pose_sigma)
    target.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        staging.chmod(0o755)
        write_template(staging / "body", body)
        if sequence.consensus is not None:
            clothed = read_consensus(sequence.consensus, smpl)
            write_mesh(staging / "consensus.ply", clothed, smpl.faces)
        pictures(staging, sequence, chosen, lens, names, axes)
        write_json(
            staging / "meta.json",
            meta(
                width=lens.width,
                height=lens.height,
                K=lens.k.tolist(),
                **poses(sequence, chosen, body.heads[0]),
                labels=["background", "skin", *names.garments],
                layers_inner_to_outer=list(names.garments),
                joints=body.names,
                **keys,
            ),
        )
        staging.rename(target)
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        raise
    height = float(np.ptp(body.vertices[:, 1]))
    return Converted(target, count, chosen, (lens.width, lens.height), height)


def _sigma(given: tuple[float, float]) -> dict[str, float]:
    degrees, metres = (float(x) for x in given)
    if not (0 <= degrees <= 60 and 0 <= metres <= 1):
        raise ValueError(f"pose_sigma is {given}; it must be 0 to 60 degrees and 0 to 1 metre")
    return {"pose_sigma_degrees": degrees, "pose_sigma_mm": 1000 * metres}
