"""The character of a point: the signs of all test functions there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from pwscont.foundation.arrays import Array


@final
@dataclass(frozen=True, slots=True)
class Character:
    """Name of a cell: ``signs[i]`` is True where ``kappa_i >= 0``.

    Attributes
    ----------
    signs : tuple of bool, length m
        One sign per test function (Janovsky and Ligursky 2012, section 3.1; there the
        signs are stored as a triple of 0 and 1 per contact node).
    """

    signs: tuple[bool, ...]

    @classmethod
    def of(cls, tests: Array) -> Character:
        """Return the character of a point with test function values ``tests``, shape (m,)."""
        return cls(tuple((tests >= 0.0).tolist()))

    def flip(self, i: int) -> Character:
        """Return the character on the other side of ``kappa_i = 0``."""
        return self.with_sign(i, not self.signs[i])

    def with_sign(self, i: int, sign: bool) -> Character:
        """Return the character in which test function ``i`` has the given sign."""
        return Character((*self.signs[:i], sign, *self.signs[i + 1 :]))

    def __str__(self) -> str:
        return "".join("+" if sign else "-" for sign in self.signs)
