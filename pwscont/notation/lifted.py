"""A user's function of its unknowns and of the values of those switches that are unknowns.

Failure modes and answers
-------------------------
- With its mode frozen, ``sw.abs`` or ``sw.relu`` is negative beyond its cell, where a power or a
  root is not defined; at zero its slope may be infinite. Where a call is not finite, H is continued
  beyond zero by its mirror image, 2 H(0) - H(-y), which has the same value and slope at zero.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Indices
from pwscont.notation.array_functions import chosen, where
from pwscont.notation.dual import Dual, value_of
from pwscont.notation.function import Outcome, Pick, UserFunction, taken, true_modes
from pwscont.notation.layout import Layout
from pwscont.notation.operations import ABS, RELU

#: Stands for zero, where a slope may be infinite.
ZERO = sys.float_info.min


@final
class LiftedFunction:
    """A user's function of x = (z, y, alpha), y the values of the hidden switches."""

    def __init__(self, function: UserFunction, size: int, layout: Layout, hidden: Indices) -> None:
        self.function, self.size, self.layout, self.hidden = function, size, layout, hidden
        is_hidden = np.zeros(layout.count, dtype=bool)
        is_hidden[hidden] = True
        self._is_hidden = [is_hidden[mine] for mine in layout.slices]
        self._all_hidden = [bool(some.all()) for some in self._is_hidden]
        self._none_hidden = [not some.any() for some in self._is_hidden]
        first = size + np.cumsum(is_hidden) - 1
        #: Where in x the hidden switches of each call are; any place for the others.
        self._places = [np.where(is_hidden[mine], first[mine], 0) for mine in layout.slices]
        self._is_magnitude = [call.operation in (ABS, RELU) for call in layout.calls]

    def outcome(self, x: Any, alpha: Any, modes: Indices | None) -> Outcome:
        """Call the function with these modes of the other switches, None for the true ones."""
        pick = self._pick(x, modes)
        if modes is None or not any(self._is_magnitude):
            return self.function.outcome(x[: self.size], alpha, self.layout, pick)
        with np.errstate(invalid="ignore", divide="ignore"):  # what is not finite is mended
            found = self.function.outcome(x[: self.size], alpha, self.layout, pick)
        if _is_finite(found):
            return found
        at_zero, mirrored = (
            self.function.outcome(x[: self.size], alpha, self.layout, self._beyond(pick, sign))
            for sign in (0.0, -1.0)
        )
        pairs = zip(_parts(at_zero), _parts(mirrored), strict=True)
        return Outcome(*(2.0 * a - b for a, b in pairs))

    def _beyond(self, pick: Pick, sign: float) -> Pick:
        """Return what picks zero, or the mirror image, for magnitudes that are not positive."""

        def beyond(number: int, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
            y = pick(number, tests, branches)
            if not self._is_magnitude[number]:
                return y
            other = sign * y + ZERO if sign else np.full(np.shape(value_of(y)), ZERO)
            return where(value_of(y) <= 0.0, other, y)

        return beyond

    def _pick(self, x: Any, modes: Indices | None) -> Pick:
        def pick(number: int, tests: Sequence[Any], branches: Sequence[Any]) -> Any:
            shape = self.layout.calls[number].shape
            if self._all_hidden[number]:
                return chosen(x, self._places[number].reshape(shape))
            mine = self.layout.slices[number]
            mode = true_modes(tests) if modes is None else modes[mine].reshape(shape)
            value = taken(mode, branches)
            if self._none_hidden[number]:
                return value
            hidden = self._is_hidden[number]
            return where(
                hidden.reshape(shape), chosen(x, self._places[number].reshape(shape)), value
            )

        return pick


def _parts(outcome: Outcome) -> tuple[Any, Any, Any]:
    return outcome.value, outcome.tests, outcome.branches


def _is_finite(outcome: Outcome) -> bool:
    """Tell whether all numbers are finite, derivatives included; what JAX traces counts as such."""
    for part in _parts(outcome):
        known = [value_of(part)] if isinstance(part, np.ndarray | Dual) else []
        if isinstance(part, Dual):
            known.append(part.rows.data if sp.issparse(part.rows) else part.rows)
        if not all(np.isfinite(numbers).all() for numbers in known):
            return False
    return True
