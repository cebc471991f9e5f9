"""What type checkers find: `layers` of a result has the type of the garments given, and is not Any,
which `mypy --strict` refuses to return."""

import ifgarments
from ifgarments import Arrays


class Coat:
    """A mesh of the caller's."""


def by_name(body: Arrays, layers: dict[str, Arrays]) -> dict[str, Arrays]:
    return ifgarments.resolve(body, layers).layers


def in_a_row(body: Arrays, layers: tuple[Coat, Coat]) -> list[Coat]:
    return ifgarments.resolve(body, layers, clearance=1e-3).layers


def with_names(body: Arrays, coat: Coat) -> list[tuple[str, Coat]]:
    return ifgarments.resolve(body, [("coat", coat)]).layers
