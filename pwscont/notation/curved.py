"""Curved systems written with switches: the user's function, called with frozen switches.

A switch on which no other switch depends needs no unknown of its own: with a frozen mode the switch
is a smooth function of the unknowns, put in wherever the user's function asks for the value. A
switch within the argument of another switch is an unknown y with the row y - branch, so that test
functions are smooth.
"""

from __future__ import annotations

from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont import Character
from pwscont.extending import Array, GivesFormula, Indices, Matrix
from pwscont.notation.derivatives import Derivatives
from pwscont.notation.function import Function, LiftedFunction, Outcome
from pwscont.notation.notated import Given, Notated


@final
class SwitchedSystem(Notated, GivesFormula):
    """A curved system written with switches; made by :func:`pwscont.Switched`."""

    def __init__(
        self,
        lifted: LiftedFunction,
        derivatives: Derivatives | None,
        given: Given,
        own_names: dict[int, int],
    ) -> None:
        super().__init__(lifted.size, lifted.layout, lifted.hidden, given, own_names)
        self._lifted, self._derivatives = lifted, derivatives
        #: The last outcome, with point and signs: tests and residual are asked for in turn.
        self._last: tuple[bytes, float, bytes, Outcome] | None = None
        self._last_slopes: tuple[bytes, float, bytes, Matrix] | None = None

    @property
    def knows_jacobian(self) -> bool:
        """Whether derivatives come from Duals or JAX, not from differences."""
        return self._derivatives is not None

    @property
    def formula(self) -> Function:
        """The user's function of (z, alpha, sw)."""
        return self._lifted.function.f

    def formula_at(self, z: Array, alpha: float) -> Array:
        """Return the value of the user's function of the user's unknowns, shape (n,)."""
        value: Array = self._lifted.function.outcome(z, alpha, self._layout).value
        return value

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the values of the test functions of all switches at (z, alpha), shape (m,)."""
        tests: Array = self._outcome(z, alpha, None).tests.copy()
        return tests

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the user's equations, then the equations of the hidden unknowns, shape (size,)."""
        outcome = self._outcome(z, alpha, character)
        if not len(self._hidden):
            value: Array = outcome.value.copy()
            return value
        modes = self._layout.modes(character.array)
        rows = z[self.shown :] - outcome.branches[self._hidden_branches(modes)]
        return np.concatenate([outcome.value, rows])

    def _hidden_branches(self, modes: Indices) -> Indices:
        places: Indices = self._layout.branches[self._hidden, modes[self._hidden]]
        return places

    def _outcome(self, z: Array, alpha: float, character: Character | None) -> Outcome:
        """Return an outcome, from the last call if equal; character None stands for true modes."""
        place, signs = z.tobytes(), bytes(character) if character is not None else b""
        last = self._last
        if last and last[0] == place and last[1] == alpha and signs in (b"", last[2]):
            return last[3]
        modes = self._layout.modes(character.array) if character is not None else None
        outcome = self._lifted.outcome(z, float(alpha), modes)
        if character is None:
            signs = (outcome.tests >= 0.0).tobytes()
        self._last = (place, alpha, signs, outcome)
        return outcome

    def values_of_switches(self, z: Array, alpha: float) -> Array:
        """Return the value of each switch."""
        outcome = self._lifted.function.outcome(z, float(alpha), self._layout)
        return self._layout.values(outcome.branches, self._layout.modes(outcome.tests >= 0.0))

    # -- derivatives -------------------------------------------------------------------------

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the derivatives of the equations, exact where the function can be traced."""
        if self._derivatives is None:
            return super().jacobian(z, alpha, character)
        slopes, n, m = self._slopes(z, alpha, character), self.shown, self._layout.number_of_tests
        if not _is_usable(slopes):  # inf / inf of an exponential, where H may be finite
            return super().jacobian(z, alpha, character)
        if not len(self._hidden):
            return slopes[:n]
        modes = self._layout.modes(character.array)
        own = np.eye(len(self._hidden), self.size + 1, k=n)
        branches = slopes[n + m + self._hidden_branches(modes)]
        if sp.issparse(slopes):
            return sp.vstack([slopes[:n], sp.csr_array(own) - branches], "csr")
        return np.vstack([slopes[:n], own - branches])

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the derivatives of the tests, exact where the function can be traced."""
        if self._derivatives is None:
            return super().test_jacobian(z, alpha)
        slopes = self._slopes(z, alpha, self.character(z, alpha))
        if not _is_usable(slopes):
            return super().test_jacobian(z, alpha)
        return slopes[self.shown : self.shown + self._layout.number_of_tests]

    def _slopes(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the derivatives of values, tests and branches by (z, alpha)."""
        place, signs, last = z.tobytes(), bytes(character), self._last_slopes
        if last and last[:3] == (place, alpha, signs):
            return last[3]
        assert self._derivatives is not None
        modes = self._layout.modes(character.array)
        found = self._derivatives(np.append(z, alpha), modes, self.differences)
        self._last_slopes = (place, alpha, signs, found)
        return found


def _is_usable(slopes: Matrix) -> bool:
    """Tell whether derivatives are finite, or differences would need too much memory."""
    return not isinstance(slopes, np.ndarray) or bool(np.isfinite(slopes).all())
