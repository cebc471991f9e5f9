"""``python -m ifgarments.import_smpl SOURCE --model FILE --out FOLDER``."""

from __future__ import annotations

import argparse
import sys

from ..errors import CaptureError
from . import convert


def _numbers(text: str) -> list[int]:
    try:
        return [int(number) for number in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not NUMBER,NUMBER…") from None


def _garment(text: str) -> tuple[str, list[int]]:
    name, _, numbers = text.partition("=")
    if not name:
        raise argparse.ArgumentTypeError(f"{text!r} has no name before =")
    return name, _numbers(numbers)


def _sigma(text: str) -> tuple[float, float]:
    try:
        degrees, mm = (float(number) for number in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not DEGREES,MILLIMETRES") from None
    return degrees, mm / 1000


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m ifgarments.import_smpl",
        description="Converts a capture with SMPL parameters for `ifg reconstruct`. "
        "Layouts: docs/reference/capture.md.",
    )
    add = parser.add_argument
    add("source", help="folder in the layout of People-Snapshot, SelfRecon or InstantAvatar")
    add("--model", required=True, help="SMPL body model, .pkl or .npz; not part of this package")
    add("--out", required=True, help="folder to write; must not exist")
    add("--frames", type=int, default=24, help="frames, evenly spaced (24)")
    add("--size", type=int, default=512, help="longest side of the pictures, in pixels (512)")
    add("--poses", metavar="FILE", help="file of poses, instead of the layout's")
    add("--labels", metavar="DIR", help="pictures of a human parser, one for each frame")
    add(
        "--garment",
        type=_garment,
        action="append",
        default=[],
        metavar="NAME=NUMBERS",
        help="a garment and the parser's numbers for it; repeat it, inner to outer",
    )
    add(
        "--background",
        type=_numbers,
        default=[0],
        metavar="NUMBERS",
        help="the parser's numbers for the background, and for hair and bags that hide clothes (0)",
    )
    add("--normals", metavar="DIR", help="pictures of normals, one for each frame")
    add("--normal-axes", choices=("opengl", "opencv"), default="opengl")
    add(
        "--pose-noise",
        type=_sigma,
        metavar="DEG,MM",
        help="how far the poses are off; by default what estimators reach",
    )
    return parser


def main() -> int:
    """Runs the command; returns its exit code."""
    parser = _parser()
    given = parser.parse_args()
    names = [name for name, _ in given.garment]
    for name in names:
        if names.count(name) > 1:
            parser.error(f"--garment {name} is given twice; give all its numbers at once")
    try:
        made = convert(
            given.source,
            given.model,
            given.out,
            frames=given.frames,
            size=given.size,
            poses_file=given.poses,
            labels=given.labels,
            garments=dict(given.garment),
            background=given.background,
            normals=given.normals,
            normal_axes=given.normal_axes,
            pose_sigma=given.pose_noise,
        )
    except (CaptureError, ImportError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    width, height = made.size
    print(
        f"Wrote {made.folder}: {len(made.frames)} of {made.available} frames of {width}x{height}, "
        f"the template in body/, {made.body_height:.2f} m"
    )
    print(f"next: ifg reconstruct {made.folder} --body {made.folder / 'body'} --out wardrobe")
    return 0


if __name__ == "__main__":
    sys.exit(main())
