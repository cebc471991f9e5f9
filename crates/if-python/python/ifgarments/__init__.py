"""Layered garments without intersections, proven by exact arithmetic.

    >>> import ifgarments
    >>> body, layers = ifgarments.demo_scene()
    >>> resolved = ifgarments.resolve(body, layers)
    >>> resolved.state
    'clean everywhere'

Meshes are pairs of arrays ``(vertices, faces)``, or objects of trimesh, Open3D and meshio.
Positions are in metres, layers inner to outer. Results come back in the kind given, with all
attributes.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

from . import _ifgarments as _native
from ._animate import Animated, animate
from ._arguments import Progress
from ._capture import Reconstruction, reconstruct
from ._fields import extract, fit
from ._outfits import (
    Arrays,
    Intersections,
    Layers,
    Mesh,
    default_params,
    demo_scene,
    intersections,
    picture,
    resolve,
    verify,
)
from ._results import Resolved, Verified
from ._wardrobe import Wardrobe
from .errors import (
    AnimateError,
    BusyError,
    Cancelled,
    CaptureError,
    Error,
    IntersectionsRemain,
    OutfitError,
    ParameterError,
    ReconstructError,
    SolverError,
    WardrobeError,
)

__all__ = [
    "BUILD",
    "AnimateError",
    "Animated",
    "Arrays",
    "BusyError",
    "Cancelled",
    "CaptureError",
    "Error",
    "Intersections",
    "IntersectionsRemain",
    "Layers",
    "Mesh",
    "OutfitError",
    "ParameterError",
    "Progress",
    "ReconstructError",
    "Reconstruction",
    "Resolved",
    "SolverError",
    "Verified",
    "Wardrobe",
    "WardrobeError",
    "animate",
    "default_params",
    "demo_scene",
    "extract",
    "fit",
    "intersections",
    "picture",
    "reconstruct",
    "resolve",
    "verify",
]

try:
    __version__ = version("ifgarments")
except PackageNotFoundError:  # used from a folder
    __version__ = "0"

#: Version and hash of the sources of the resolver, as in receipts of ``ifg``.
BUILD: str = _native.BUILD
