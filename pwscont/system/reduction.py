"""A smaller system with the same solutions, and the way back from it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.character import Character
from pwscont.system.system import PiecewiseSystem


class Reducible(ABC):
    """A system that may know a smaller one with the same solutions."""

    __slots__ = ()

    @abstractmethod
    def reduction(self, lo: float, hi: float) -> Reduction | None:
        """Return the smaller system for alpha in [lo, hi], None if there is none.

        Only what provably stays in one mode on the whole interval may be left out.
        """


def reduction_of(system: PiecewiseSystem, interval: tuple[float, float]) -> Reduction | None:
    """Return what remains of a system on an interval, None where nothing can be left out."""
    return system.reduction(*interval) if isinstance(system, Reducible) else None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """A smaller system, without the parts that provably stay in one mode.

    Attributes
    ----------
    system : PiecewiseSystem
        The smaller system.
    kept : ndarray of int
        The places of its unknowns among those of the full system; all others are zero.
    tests : ndarray of int
        The places of its test functions among those of the full system.
    idle : Character
        A character of the full system with the signs of the parts left out.
    reasons : tuple of str
        For every part left out, the proof in words.
    """

    system: PiecewiseSystem
    kept: Indices
    tests: Indices
    idle: Character
    reasons: tuple[str, ...]

    def points(self, points: Array, size: int) -> Array:
        """Return points (..., z, alpha) with the unknowns left out put back as zeros."""
        full = np.zeros((*points.shape[:-1], size + 1))
        full[..., self.kept], full[..., -1] = points[..., :-1], points[..., -1]
        return full

    def state(self, z: Array) -> Array:
        """Return the unknowns that remain of a state of the full system."""
        kept: Array = z[self.kept]
        return kept

    def character(self, character: Character) -> Character:
        """Return the character of the full system."""
        signs = self.idle.array.copy()
        signs[self.tests] = character.array
        return Character.of(np.where(signs, 1.0, -1.0))
