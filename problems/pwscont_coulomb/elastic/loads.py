"""Supports and loads of a body, each with a constant part and a part that grows with alpha.

A *region* is the name of a boundary or subdomain of the mesh, or a predicate of position that
takes midpoints, shape (2, k), and returns (k,) truth values. A *field* is a pair (x, y) or a
function of position, shape (2, ...), that returns pairs along the first axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import Array

Region: TypeAlias = str | Callable[[Array], Any]
Field: TypeAlias = Any

NOTHING = (0.0, 0.0)


@final
@dataclass(frozen=True, slots=True)
class Support:
    """Displacements prescribed on a boundary: constant + alpha growing.

    Attributes
    ----------
    boundary : Region
    constant, growing : Field
        Displacement at alpha = 0 and per unit of alpha (length); default none: clamped.
    directions : str
        ``"xy"``, or ``"x"`` or ``"y"`` for a roller that leaves the other direction free.

    Raises
    ------
    InvalidInputError
        If ``directions`` are other letters.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Support
    >>> Support("top", constant=(0.0, -0.01), growing=(0.01, 0.0)).directions
    'xy'
    """

    boundary: Region
    constant: Field = NOTHING
    growing: Field = NOTHING
    directions: str = "xy"

    def __post_init__(self) -> None:
        if self.directions not in ("x", "y", "xy"):
            raise InvalidInputError(
                f"directions of a support must be 'x', 'y' or 'xy', got {self.directions!r}"
            )

    @property
    def components(self) -> list[int]:
        """The prescribed components of the displacement."""
        return ["xy".index(letter) for letter in self.directions]


@final
@dataclass(frozen=True, slots=True)
class Traction:
    """A force per area on a boundary: constant + alpha growing.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Traction
    >>> Traction("left", growing=(1.0, 0.0)).boundary
    'left'
    """

    boundary: Region
    constant: Field = NOTHING
    growing: Field = NOTHING


@final
@dataclass(frozen=True, slots=True)
class BodyForce:
    """A force per volume, in the whole body or a subdomain: constant + alpha growing.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import BodyForce
    >>> BodyForce(constant=(0.0, -9.81)).constant
    (0.0, -9.81)
    """

    constant: Field = NOTHING
    growing: Field = NOTHING
    subdomain: Region | None = None


def evaluate(name: str, field: Field, x: Array) -> Array:
    """Return a field at positions, shape (2, ...) like ``x``.

    Raises
    ------
    InvalidInputError
        If the field is no pair, has another shape, or is not finite.
    """
    try:
        found = np.asarray(field(x) if callable(field) else field, dtype=float)
        if found.ndim != x.ndim:  # a single pair, which would broadcast over two positions
            found = found.reshape((2,) + (1,) * (x.ndim - 1))
        values = np.broadcast_to(found, x.shape)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"{name} must be a pair (x, y), or a function of positions (2, ...) that returns "
            f"pairs along its first axis: {error}"
        ) from error
    if not np.isfinite(values).all():
        raise InvalidInputError(f"{name} is not finite everywhere")
    return values
