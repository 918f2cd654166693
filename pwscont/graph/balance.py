"""The sum of the signs of det(dH/dz), which tells of missing branches (docs/theory, F4)."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.rounding import CONFIDENCE
from pwscont.graph.loose_ends import is_on_purpose, loose_ends
from pwscont.graph.queries import Queries
from pwscont.graph.records import SpecialPoint


class Balance(Queries):
    """The balance of a branch graph; see :class:`pwscont.BranchGraph`."""

    def balance(self, alpha: float) -> int:
        """Return the sum of the signs of det(dH/dz) over all solutions at ``alpha``.

        Where solutions stay bounded the sum is the same at every regular alpha; if not, a
        branch is missing. The converse does not hold: a missed pair cancels.
        """
        self._inside(alpha)
        nodes = sum(self._index(node) for node in self._nodes_at(alpha))
        return nodes + sum(piece.det_sign for piece in self._through(alpha))

    def balances(self) -> list[int]:
        """Return the balance within each interval between successive special points."""
        middles = [0.5 * (a + b) for a, b in pairwise(self.breaks())]
        return [sum(piece.det_sign for piece in self._over(alpha)) for alpha in middles]

    def balance_values(self) -> list[int]:
        """Return the different values of the balance, ascending; one where nothing is missing.

        A stretch of alpha that is no longer than the uncertainty of the special points around it
        does not count: it may not exist, and its ends may be in the other order.
        """
        return sorted({value for value, _ in self._judged()})

    def _judged(self) -> list[tuple[int, tuple[float, float]]]:
        """Return balance and ends of the stretches that are longer than their ends are uncertain.

        If there is no such stretch, return all of them; none where solutions are infinitely many,
        for the signs of the pieces around them say nothing.
        """
        pairs = zip(self.balances(), pairwise(self.breaks()), strict=True)
        everything = [row for row in pairs if not self._is_infinite(0.5 * sum(row[1]))]
        return [row for row in everything if not self._is_blurred(*row[1])] or everything

    def _is_blurred(self, lo: float, hi: float) -> bool:
        """Tell whether the errors of the special points around a stretch overlap within it."""
        left = self._alphas < 0.5 * (lo + hi)
        blur = CONFIDENCE * self._alpha_errors
        first = (self._alphas + blur)[left].max(initial=lo)
        last = (self._alphas - blur)[~left].min(initial=hi)
        return bool(first >= last)

    def is_balanced(self) -> bool:
        """Tell whether the balance is the same at every regular alpha of the interval.

        Where the system knows its degree (+1 for Coulomb friction), the balance must equal it.
        Stretches too short to be judged do not count, see :meth:`balance_values`.
        """
        return not self.unbalanced()

    def unbalanced(self) -> list[tuple[float, float]]:
        """Return the stretches in which the balance is not what it must be.

        Without a known degree: the stretches whose balance differs from the most frequent one, each
        without the signs of branches that end on purpose.
        """
        judged = self._judged()
        degree = self.system.degree if self.system else None
        if degree is None:
            ends = [(p, n) for p, n in loose_ends(self).items() if is_on_purpose(self, p)]
            judged = [(value - _ended(ends, gap), gap) for value, gap in judged]
            values = [value for value, _ in judged]
            degree = max(values, key=values.count, default=None)
        merged: list[tuple[float, float]] = []
        for lo, hi in (gap for value, gap in judged if value != degree):
            if merged and merged[-1][1] == lo:
                merged[-1] = (merged[-1][0], hi)
            else:
                merged.append((lo, hi))
        return merged

    @cached_property
    def _alpha_errors(self) -> Array:
        return np.array([point.error[-1] if len(point.error) else 0.0 for point in self._points])


def _ended(ends: list[tuple[SpecialPoint, int]], gap: tuple[float, float]) -> int:
    """Return by how much the ends to the left of a stretch change the balance."""
    return sum(jump for point, jump in ends if point.alpha < 0.5 * sum(gap))
