"""A user's function of its unknowns and of the values of those switches that are unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Indices
from pwscont.notation.array_functions import chosen, where
from pwscont.notation.function import Outcome, Pick, UserFunction, taken, true_modes
from pwscont.notation.layout import Layout


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

    def outcome(self, x: Any, alpha: Any, modes: Indices | None) -> Outcome:
        """Call the function with these modes of the other switches, None for the true ones."""
        return self.function.outcome(x[: self.size], alpha, self.layout, self._pick(x, modes))

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
