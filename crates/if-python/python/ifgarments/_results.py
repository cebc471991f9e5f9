"""What resolving and verifying an outfit return."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray


#: The garments: a list, or a dict of names.
Collection = TypeVar("Collection", covariant=True)


@dataclass(frozen=True, eq=False)
class Verified:
    """The state of an outfit."""

    #: ``"clean everywhere"``, ``"clean between layers"`` or ``"not clean"``.
    state: str
    #: The report: ``report`` of what ``ifg check --json`` prints.
    report: dict[str, Any] = field(repr=False)
    #: What a person should know about the meshes.
    notes: list[str] = field(repr=False)

    @property
    def is_clean(self) -> bool:
        """No layer intersects another, and no vertex is on the wrong side of one below."""
        return self.state != "not clean"


@dataclass(frozen=True, eq=False)
class Resolved(Verified, Generic[Collection]):
    """A resolved outfit."""

    #: The garments in the kind, the collection and the order given.
    layers: Collection = field(repr=False)
    #: Positions of a body that was drawn back (``params={"pinch": "yield"}``), shape (n, 3); ``None``
    #: if it stayed as it was.
    body: NDArray[np.floating[Any]] | None = field(default=None, repr=False)
