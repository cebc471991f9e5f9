"""Pictures of a capture: read as they are, undistorted, and made smaller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CaptureError
from ._files import Reals, needed

Mask = NDArray[np.bool_]
Bytes = NDArray[np.uint8]


def read_mask(path: Path, size: tuple[int, int] | None) -> Mask:
    """A mask of rows × columns. Foreground is from half of full white; 1 where 1 is the largest."""
    if path.suffix == ".npy":
        try:
            grey = np.load(path, allow_pickle=False)
        except Exception as error:  # a damaged file raises many kinds
            raise CaptureError(path, None, f"is not a valid npy file: {error}") from None
        if grey.dtype.kind not in "biuf":
            raise CaptureError(path, None, f"holds {grey.dtype}; a mask must hold numbers")
    else:
        # Indices of a palette and transparency would be taken for shades of grey.
        grey = _opened(path, "L", ("1", "L", "RGB"))
    if grey.ndim != 2 or (size is not None and grey.shape != size):
        wanted = "(rows, columns)" if size is None else str(size)
        raise CaptureError(path, None, f"has shape {grey.shape}; it must be {wanted}")
    return foreground(grey)


def foreground(grey: NDArray[Any]) -> Mask:
    """Foreground is from half of full white: of 1 where that is the largest value, else of 255."""
    half = 0.5 if grey.size == 0 or grey.max() <= 1 else 128
    return np.asarray(grey >= half)


def read_labels(path: Path, size: tuple[int, int]) -> Bytes:
    """The labels in a grey or palette picture."""
    return _sized(path, _opened(path, None, ("L", "P")), size)


def read_normals(path: Path, size: tuple[int, int]) -> Bytes:
    """The encoded normals in an RGB picture, rows × columns × 3."""
    return _sized(path, _opened(path, "RGB", ("RGB", "RGBA")), size)


def _sized(path: Path, values: Bytes, size: tuple[int, int]) -> Bytes:
    if values.shape[:2] != size:
        found = f"{values.shape[0]} rows and {values.shape[1]} columns"
        raise CaptureError(path, None, f"has {found}; the camera has {size[0]} and {size[1]}")
    return values


def _opened(path: Path, mode: str | None, modes: tuple[str, ...] = ()) -> Bytes:
    image: Any = needed("PIL.Image")
    try:
        with image.open(path) as picture:
            if modes and picture.mode not in modes:
                problem = f"is a picture of mode {picture.mode}; it must be {' or '.join(modes)}"
                raise CaptureError(path, None, problem)
            return np.asarray(picture if mode is None else picture.convert(mode))
    except CaptureError:
        raise
    except Exception as error:  # decoders raise many kinds
        raise CaptureError(path, None, f"is not a readable picture: {error}") from None


def write_png(path: Path, values: Bytes) -> None:
    """Writes a grey or RGB picture."""
    image: Any = needed("PIL.Image")
    image.fromarray(np.ascontiguousarray(values)).save(path)


class Resampling:
    """From the pictures of a lens to smaller ones of a pinhole camera, by nearest pixels.

    The pixel (i, j) of the new picture takes the old one that holds, with s the factor of sizes,

    ```text
    u = (i + ½, j + ½) / s + f (d(x, y) − (x, y)),     (x, y, 1) = K′⁻¹ (i + ½, j + ½, 1)
    d(x, y) = (1 + k₁r² + k₂r⁴ + k₃r⁶)(x, y) + (2p₁xy + p₂(r² + 2x²), p₁(r² + 2y²) + 2p₂xy)
    ```

    [Brown 1966, with OpenCV's order of coefficients]. Outside of the old picture it is 0.
    """

    def __init__(
        self, width: int, height: int, k: Reals, distortion: Reals, most: int | None
    ) -> None:
        factor = min(1.0, (most or max(width, height)) / max(width, height))
        self.width, self.height = (max(1, round(factor * n)) for n in (width, height))
        scale = np.array([self.width / width, self.height / height, 1.0])
        #: The camera matrix of the new pictures.
        self.k: Reals = scale[:, None] * k
        rows, columns = np.mgrid[: self.height, : self.width] + 0.5
        pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
        seen = (pixels @ np.linalg.inv(self.k).T)[..., :2]
        moved = k[[0, 1], [0, 1]] * (_distorted(seen, distortion) - seen)
        old = np.floor(pixels[..., :2] / scale[:2] + moved).astype(np.int64)
        inside = np.all((old >= 0) & (old < [width, height]), axis=-1)
        self._inside: Mask = inside
        self._rows = np.where(inside, old[..., 1], 0)
        self._columns = np.where(inside, old[..., 0], 0)

    def __call__(self, values: NDArray[Any]) -> NDArray[Any]:
        """A new picture from an old one."""
        chosen = values[self._rows, self._columns]
        chosen[~self._inside] = 0
        return chosen


def _distorted(points: Reals, coefficients: Reals) -> Reals:
    """Points on the plane at distance 1, as the lens shows them."""
    k1, k2, p1, p2, k3 = coefficients
    x, y = points[..., 0], points[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    across = 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    down = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([radial * x + across, radial * y + down], axis=-1)
