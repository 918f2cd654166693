"""The solutions of a slice of a system: points, and faces of infinitely many solutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from pwscont.basics.arrays import Array
from pwscont.basics.character import Character
from pwscont.enumeration.face import Face


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """An isolated solution.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
        The point (z, alpha).
    error : ndarray, shape (k, n + 1)
        Samples of its error.
    characters : sequence of Character
        The cells in whose closure the point lies; one unless it lies on an interface.
    det_sign : int
        Sign of det(dH/dz) in the first of these cells.
    known_signs : tuple of int
        The signs in all of these cells, where they are known; else empty.
    in_doubt : bool or None
        Whether rounding leaves open in which cells the point lies; None if not yet tested.
    """

    x: Array
    error: Array
    characters: Sequence[Character]
    det_sign: int
    known_signs: tuple[int, ...] = ()
    in_doubt: bool | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """All solutions at one alpha.

    Attributes
    ----------
    points : tuple of Point
    faces : tuple of Face
    undecided : int
        Number of cells that may or may not hold a solution, because of rounding.
    exact : bool
        Whether the points were found in exact arithmetic.
    singular : int
        Number of cells whose equations rounding does not tell from singular ones, although exact
        arithmetic finds a solution, of which no digit is certain.
    """

    points: tuple[Point, ...]
    faces: tuple[Face, ...]
    undecided: int = 0
    exact: bool = False
    singular: int = 0
