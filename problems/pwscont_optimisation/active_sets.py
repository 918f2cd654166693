"""Optimality conditions whose active set changes from piece to piece.

Each *part*, a constraint or a feature, has several modes: inactive, or active in some way. The mode
of a part chooses a row of H; all rows and tests are affine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np

from pwscont import Block, Character, PiecewiseLinearSystem
from pwscont.extending import EPS, Array, Indices

#: Most active parts that a label names; a label gives the number of more parts.
MOST_NAMED = 12


class ActiveSets(PiecewiseLinearSystem):
    """Parts that are active or not; subclasses say what active means.

    A part is in mode j where j tests of the part are not negative.

    Parameters
    ----------
    parts : sequence of str, length p
        The names of the parts.
    rows : ndarray, shape (k + 1, n, n + 2)
        Affine rows of H in x = (z, alpha, 1). The mode of each part chooses among the last p rows;
        the rows above are the same in all modes.
    tests : ndarray, shape (p, k, n + 2)
        The tests of each part, largest first.
    always : ndarray, shape (q, n + 2)
        Affine functions that are not negative at solutions.
    """

    #: The suffix of an active part's name in each mode; None for the inactive mode.
    active: ClassVar[tuple[str | None, ...]]
    #: The verbs for a part that becomes active, and for a part that becomes inactive.
    enters: ClassVar[str]
    leaves: ClassVar[str]

    def __init__(self, parts: Sequence[str], rows: Array, tests: Array, always: Array) -> None:
        modes, self.size, _ = rows.shape
        self._parts, self._rows, self._always = tuple(parts), rows, always
        self._tests = tests.reshape(-1, rows.shape[2])
        self._shape = (len(parts), modes - 1)

    # -- equations ---------------------------------------------------------------------------

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the tests, part by part."""
        return _values(self._tests, z, alpha)

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the constant gradients of the tests."""
        return self._tests[:, :-1]

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows that the modes choose."""
        return _values(self._chosen(character), z, alpha)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the constant matrix of a cell."""
        return self._chosen(character)[:, :-1]

    def _chosen(self, character: Character) -> Array:
        modes = np.zeros(self.size, dtype=np.intp)
        modes[self.size - len(self._parts) :] = self.modes(character)
        rows: Array = self._rows[modes, np.arange(self.size)]
        return rows

    # -- cells -------------------------------------------------------------------------------

    def modes(self, character: Character) -> Indices:
        """Return the mode of each part."""
        modes: Indices = character.array.reshape(self._shape).sum(axis=1)
        return modes

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return the bounding tests: tests j - 1 and j of each part in mode j."""
        modes, numbers = self.modes(character)[:, np.newaxis], np.arange(self._shape[1])
        bounding = (numbers == modes - 1) | (numbers == modes)
        found: list[int] = np.flatnonzero(bounding).tolist()
        return found

    def cells(self) -> Iterator[Character]:
        """Yield the characters of all combinations of modes."""
        signs = _signs(self._shape[1])
        for chosen in np.ndindex(*[len(signs)] * len(self._parts)):
            yield Character([sign for mode in chosen for sign in signs[mode]])

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each part."""
        parts, each = self._shape
        first, signs = self.size - parts, _signs(each)
        return tuple(
            Block(tuple(range(part * each, (part + 1) * each)), (first + part,), signs)
            for part in range(parts)
        )

    def necessary(self, alpha: float) -> tuple[Array, Array]:
        """Return the affine functions that are not negative at solutions in any mode."""
        rows = self._always
        return rows[:, :-2], rows[:, -1] + alpha * rows[:, -2]

    # -- words -------------------------------------------------------------------------------

    def active_set(self, character: Character) -> tuple[str, ...]:
        """Return the names of the active parts."""
        signs = (self.active[mode] for mode in self.modes(character))
        pairs = zip(self._parts, signs, strict=True)
        return tuple(part + sign for part, sign in pairs if sign is not None)

    def describe(self, character: Character) -> str:
        """Return all active parts."""
        return f"active: {', '.join(self.active_set(character)) or 'none'}"

    def label(self, character: Character) -> str:
        """Return the active parts, or how many there are."""
        count = len(self.active_set(character))
        return self.describe(character) if count <= MOST_NAMED else f"{count} active"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return which parts become active, and which become inactive."""
        old, new = self.active_set(before), self.active_set(after)
        words = [f"{part} {self.leaves}" for part in old if part not in new]
        return ", ".join(words + [f"{part} {self.enters}" for part in new if part not in old])


def is_symmetric(matrix: Array) -> bool:
    """Tell whether a matrix is symmetric to half of the digits, whatever the units of the rows.

    Each entry is compared with the diagonal entries of its row and column, and with itself.
    """
    units = np.sqrt(np.abs(matrix.diagonal()))
    sizes = np.multiply.outer(units, units) + np.abs(matrix)
    return bool((np.abs(matrix - matrix.T) <= EPS**0.5 * sizes).all())


def _values(rows: Array, z: Array, alpha: float) -> Array:
    values: Array = rows[:, :-2] @ z + rows[:, -2] * alpha + rows[:, -1]
    return values


def _signs(tests: int) -> tuple[tuple[bool, ...], ...]:
    """Return the signs of the tests of a part in each mode."""
    return tuple(tuple(j < mode for j in range(tests)) for mode in range(tests + 1))
