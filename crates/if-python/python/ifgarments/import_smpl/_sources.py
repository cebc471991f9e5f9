"""The layouts of captures that are read. docs/reference/capture.md describes them, with sources."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CaptureError
from . import _rotations as rotations
from ._files import Reals, needed, numbered, read_npz, reals, take
from ._pickles import array, read_pickle
from ._pictures import Mask, foreground, read_mask

#: Coefficients of the lens [Brown 1966], in OpenCV's order: k1, k2, p1, p2, k3.
_NO_DISTORTION = np.zeros(5)


@dataclass(frozen=True, eq=False)
class Sequence:
    """A capture as its files have it: one camera, SMPL parameters and a mask of each frame."""

    #: Where the poses come from, for errors.
    file: Path
    width: int
    height: int
    #: Camera matrix in pixels, and distortion of the lens.
    k: Reals
    distortion: Reals
    #: x_cam = R x + t, with x right, y down, z forward.
    rotation: Reals
    translation: Reals
    #: Rotation vectors, shape (n, J, 3), the root first.
    poses: Reals
    #: Shape (n, 3).
    trans: Reals
    betas: Reals
    #: The mask of a frame, in full size.
    mask: Callable[[int], Mask]
    #: Number of masks.
    count: int
    #: The clothed rest shape of the capture, if it has one.
    consensus: Path | None = None


def read_source(folder: Path, joints: int, poses: Path | None) -> Sequence:
    """Recognises the layout of a folder by its files, and reads all but the masks.

    Raises:
        CaptureError: no layout fits, or a file is missing or damaged.
    """
    for marker, reader in _LAYOUTS.items():
        if (folder / marker).is_file():
            return reader(folder, joints, poses)
    known = ", ".join(f"{marker} ({name})" for marker, name in _NAMES.items())
    raise CaptureError(folder, None, f"is not a capture of a known layout; none of {known}")


def people_snapshot(folder: Path, joints: int, poses: Path | None) -> Sequence:
    """`camera.pkl`, `masks.hdf5` and `reconstructed_poses.hdf5` [Alldieck et al. 2018]."""
    h5py = needed("h5py")
    path = folder / "camera.pkl"
    content = read_pickle(path)

    def value(key: str, *shape: int) -> Reals:
        return reals(path, key, array(path, content, key), shape)

    width, height = (_size(path, key, value(key)) for key in ("width", "height"))
    turn, shift = value("camera_rt", 3), value("camera_t", 3)
    file = poses or folder / "reconstructed_poses.hdf5"
    with _hdf5(h5py, file) as data:
        pose = _data(file, data, "pose", (None, 3 * joints))
        trans = _data(file, data, "trans", (None, 3))
        betas = _data(file, data, "betas", None).reshape(-1)
    masks = folder / "masks.hdf5"
    with _hdf5(h5py, masks) as data:
        shape = _dataset(masks, data, "masks").shape
    if shape != (len(pose), height, width):
        problem = f"has shape {shape}; poses and camera have {(len(pose), height, width)}"
        raise CaptureError(masks, "masks", problem)

    def mask(frame: int) -> Mask:
        with _hdf5(h5py, masks) as data:
            try:
                return foreground(np.asarray(_dataset(masks, data, "masks")[frame]))
            except OSError as error:
                raise CaptureError(masks, "masks", f"frame {frame}: {error}") from None

    consensus = folder / "consensus.pkl"
    return Sequence(
        file=file,
        width=width,
        height=height,
        k=_pinhole(path, "camera_f", value("camera_f", 2), value("camera_c", 2)),
        distortion=value("camera_k", 5),
        rotation=rotations.matrix(rotations.of_vectors(turn)),
        translation=shift,
        poses=pose.reshape(len(pose), joints, 3),
        trans=_as_many(file, "trans", trans, pose),
        betas=betas,
        mask=mask,
        count=len(pose),
        consensus=consensus if consensus.is_file() else None,
    )


def selfrecon(folder: Path, joints: int, poses: Path | None) -> Sequence:
    """`camera.npz`, `smpl_rec.npz` and `masks/` [Jiang et al. 2022, SelfRecon]."""
    file = poses or folder / "smpl_rec.npz"
    content = read_npz(file)
    pose = reals(file, "poses", _flat(take(file, content, "poses")), (None, 3 * joints))
    trans = reals(file, "trans", take(file, content, "trans"), (None, 3))
    betas = reals(file, "shape", take(file, content, "shape").reshape(-1), (None,))
    path = folder / "camera.npz"
    camera = read_npz(path)

    def value(key: str, *shape: int) -> Reals:
        return reals(path, key, take(path, camera, key), shape)

    focal, centre = (np.array([value(a), value(b)]) for a, b in (("fx", "fy"), ("cx", "cy")))
    quaternion = value("quat", 4)
    if not np.linalg.norm(quaternion) > 0.5:
        raise CaptureError(path, "quat", f"is {quaternion}; it must be a unit quaternion w, x, y, z")
    # PyTorch3D's camera has x left and y up; `quat` turns it to the world.
    axes = np.diag([-1.0, -1.0, 1.0])
    mask, count, (height, width) = _mask_files(folder / "masks", len(pose), file, more_poses=True)
    return Sequence(
        file=file,
        width=width,
        height=height,
        k=_pinhole(path, "fx", focal, centre),
        distortion=_NO_DISTORTION,
        rotation=axes @ rotations.matrix(quaternion).T,
        translation=axes @ value("T", 3),
        poses=pose.reshape(len(pose), joints, 3),
        trans=_as_many(file, "trans", trans, pose),
        betas=betas,
        mask=mask,
        count=count,
    )


#: Files of poses in a folder with `cameras.npz`, the best first.
_POSE_FILES = ("poses_optimized.npz", "poses.npz", "smpl_params.npz")


def instant_avatar(folder: Path, joints: int, poses: Path | None) -> Sequence:
    """`cameras.npz`, `poses_optimized.npz` and `masks/` [Jiang et al. 2023, InstantAvatar]."""
    path = folder / "cameras.npz"
    camera = read_npz(path)
    found = [folder / name for name in _POSE_FILES if (folder / name).is_file()]
    if poses is None and not found:
        raise CaptureError(folder / _POSE_FILES[0], None, f"is missing, as is {_POSE_FILES[1]}")
    file = poses or found[0]
    content = read_npz(file)
    if "body_pose" in content or "global_orient" in content:
        root = reals(file, "global_orient", _flat(take(file, content, "global_orient")), (None, 3))
        rest = take(file, content, "body_pose")
        rest = reals(file, "body_pose", _flat(rest), (len(root), 3 * joints - 3))
        pose = np.concatenate([root, rest], axis=1)
    else:
        pose = reals(
            file, "thetas", _flat(take(file, content, "thetas", "poses", "pose")), (None, 3 * joints)
        )
    trans = reals(file, "transl", take(file, content, "transl", "trans"), (None, 3))
    betas = np.asarray(take(file, content, "betas", "shape"))
    if betas.ndim > 1 and len(betas) > 1:
        raise CaptureError(file, "betas", f"has shape {betas.shape}; one shape for all frames")
    k = reals(path, "intrinsic", take(path, camera, "intrinsic"), (3, 3))
    pinhole = _pinhole(path, "intrinsic", np.diag(k)[:2], k[:2, 2])
    world = reals(path, "extrinsic", take(path, camera, "extrinsic"), (4, 4))
    if not rotations.is_rotation(world[:3, :3]):
        raise CaptureError(path, "extrinsic", "its first three rows and columns are not a rotation")
    width, height = (
        _size(path, key, reals(path, key, take(path, camera, key), ()))
        for key in ("width", "height")
    )
    mask, count, _ = _mask_files(folder / "masks", len(pose), file, size=(height, width))
    return Sequence(
        file=file,
        width=width,
        height=height,
        k=pinhole,
        distortion=_NO_DISTORTION,
        rotation=world[:3, :3],
        translation=world[:3, 3],
        poses=pose.reshape(len(pose), joints, 3),
        trans=_as_many(file, "transl", trans, pose),
        betas=reals(file, "betas", betas.reshape(-1), (None,)),
        mask=mask,
        count=count,
    )


_LAYOUTS: dict[str, Callable[[Path, int, Path | None], Sequence]] = {
    "reconstructed_poses.hdf5": people_snapshot,
    "smpl_rec.npz": selfrecon,
    "cameras.npz": instant_avatar,
}
_NAMES = dict(zip(_LAYOUTS, ("People-Snapshot", "SelfRecon", "InstantAvatar"), strict=True))

#: Most pixels along a side of a picture.
_MOST_PIXELS = 20_000


def _size(path: Path, key: str, value: Reals) -> int:
    size = float(value)
    if not (1 <= size <= _MOST_PIXELS and size == int(size)):
        raise CaptureError(path, key, f"is {size}; it must be a whole number of pixels")
    return int(size)


def _pinhole(path: Path, key: str, focal: Reals, centre: Reals) -> Reals:
    if not min(focal) > 0:
        raise CaptureError(path, key, f"has the focal lengths {focal.tolist()}; they must be above 0")
    (fx, fy), (cx, cy) = focal, centre
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _flat(pose: NDArray[Any]) -> NDArray[Any]:
    """(n, J, 3) as (n, 3J)."""
    return pose.reshape(len(pose), -1) if pose.ndim == 3 else pose


def _as_many(file: Path, key: str, values: Reals, pose: Reals) -> Reals:
    if len(values) != len(pose):
        raise CaptureError(file, key, f"has {len(values)} frames, the poses have {len(pose)}")
    return values


def _mask_files(
    folder: Path,
    poses: int,
    file: Path,
    *,
    size: tuple[int, int] | None = None,
    more_poses: bool = False,
) -> tuple[Callable[[int], Mask], int, tuple[int, int]]:
    """Masks in files, one for each pose in the order of their numbers; their count and size."""
    paths = numbered(folder, ".png", ".npy", ".jpg")
    if len(paths) != poses and not (more_poses and len(paths) < poses):
        raise CaptureError(folder, None, f"has {len(paths)} masks, but {file} has {poses} poses")
    rows, columns = size or read_mask(paths[0], None).shape
    return (lambda frame: read_mask(paths[frame], (rows, columns))), len(paths), (rows, columns)


def _hdf5(h5py: Any, path: Path) -> Any:
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise CaptureError(path, None, f"is not a readable HDF5 file: {error}") from None


def _dataset(path: Path, file: Any, key: str) -> Any:
    found = file.get(key)
    if not hasattr(found, "shape"):
        raise CaptureError(path, key, f"is missing; found: {', '.join(file)}")
    return found


def _data(path: Path, file: Any, key: str, shape: tuple[int | None, ...] | None) -> Reals:
    found = _dataset(path, file, key)
    try:
        return reals(path, key, found[()], shape or (None,) * max(found.ndim, 1))
    except OSError as error:
        raise CaptureError(path, key, f"cannot be read: {error}") from None
