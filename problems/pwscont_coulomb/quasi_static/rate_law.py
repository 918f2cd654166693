"""The rate problem as a system of pwscont, whose search over modes is cut by linear programs."""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont import Block, Character, SlicewiseLinearSystem, enumerate_solutions
from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.modes import SIGNS, Mode, mode_of

#: Signs of the only test of a node at the friction bound: the node slips, or the node sticks.
SLIPS, STICKS = (True,), (False,)


@final
class RateLaw(SlicewiseLinearSystem):
    """phi = K x - h with each node in one of its modes; alpha has no effect.

    Tests and rows are those of :mod:`pwscont_coulomb.coulomb` for nodes without force, with
    kappa1 = phi_nu - r x_nu and phi_t - r x_t. A node at the bound has the test
    s r x_t - (s phi_t - F phi_nu), positive where the node slips.

    Parameters
    ----------
    K, h, friction, sign, normal, tangent
        As for :class:`pwscont_coulomb.quasi_static.rates.RateProblem`; all nodes have friction.
    """

    def __init__(
        self, K: Array, h: Array, friction: Array, sign: Array, normal: Indices, tangent: Indices
    ) -> None:
        self.size = K.shape[1]
        self._K, self._h, self._F, self._s = K, h, friction, sign
        self._n, self._t = normal, tangent
        self._first = np.concatenate([[0], np.cumsum(np.where(sign == 0, 3, 1))]).astype(int)
        self._one = np.eye(self.size)

    def _r(self, i: int) -> float:
        return float(self._K[self._t[i], self._t[i]])

    def _tests_of(self, i: int) -> tuple[Array, Array]:
        """Return gradients and values at zero of the tests of a node."""
        K, h, n, t, r, F = self._K, self._h, self._n[i], self._t[i], self._r(i), self._F[i]
        if self._s[i]:
            s = self._s[i]
            row = s * r * self._one[t] - (s * K[t] - F * K[n])
            return row[np.newaxis], np.array([s * h[t] - F * h[n]])
        kappa, shear = K[n] - r * self._one[n], K[t] - r * self._one[t]
        rows = np.stack([kappa, shear - F * kappa, shear + F * kappa])
        return rows, -np.array([h[n], h[t] - F * h[n], h[t] + F * h[n]])

    def _rows_of(self, i: int, mode: int) -> tuple[Array, Array]:
        """Return gradients and values at zero of the rows of a node in a mode."""
        K, h, n, t, r, F = self._K, self._h, self._n[i], self._t[i], self._r(i), self._F[i]
        if mode == Mode.NO_CONTACT:
            return K[[n, t]], -h[[n, t]]
        held = r * self._one[t]
        s = 1.0 if mode == Mode.SLIP_PLUS else -1.0
        slip = K[t] - s * F * K[n], -(h[t] - s * F * h[n])
        row, value = (held, 0.0) if mode == Mode.STICK else slip
        if self._s[i]:
            return row[np.newaxis], np.array([value])
        return np.stack([r * self._one[n], row]), np.array([0.0, value])

    def _modes(self, character: Character) -> list[int]:
        return [self.mode(i, character) for i in range(len(self._F))]

    def mode(self, i: int, character: Character) -> int:
        """Return the mode of a node."""
        signs = character.signs[self._first[i] : self._first[i + 1]]
        if not self._s[i]:
            return mode_of(0, Character(signs))
        slip = Mode.SLIP_PLUS if self._s[i] > 0 else Mode.SLIP_MINUS
        return int(slip if signs == SLIPS else Mode.STICK)

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the tests of all nodes."""
        parts = [self._tests_of(i) for i in range(len(self._F))]
        return np.concatenate([rows @ z + values for rows, values in parts])

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the constant gradients."""
        rows = np.vstack([self._tests_of(i)[0] for i in range(len(self._F))])
        return np.column_stack([rows, np.zeros(len(rows))])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows of all nodes."""
        rows, values = self._all_rows(character)
        residual: Array = rows @ z + values
        return residual

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant matrix of a cell."""
        return np.column_stack([self._all_rows(character)[0], np.zeros(self.size)])

    def _all_rows(self, character: Character) -> tuple[Array, Array]:
        rows, values = np.zeros((self.size, self.size)), np.zeros(self.size)
        for i, mode in enumerate(self._modes(character)):
            places = list(self._places(i))
            rows[places], values[places] = self._rows_of(i, mode)
        return rows, values

    def _places(self, i: int) -> tuple[int, ...]:
        """Return the rows of a node: the numbers of the unknowns of the node."""
        return (int(self._t[i]),) if self._s[i] else (int(self._n[i]), int(self._t[i]))

    def bounding_tests(self, character: Character) -> list[int]:
        """Return kappa1 for no contact, kappa2 and kappa3 for stick, kappa1 and one for slip."""
        bounds: list[int] = []
        for i, mode in enumerate(self._modes(character)):
            first = int(self._first[i])
            which = {Mode.NO_CONTACT: (0,), Mode.STICK: (1, 2), Mode.SLIP_PLUS: (0, 1)}
            known = (0,) if self._s[i] else which.get(Mode(mode), (0, 2))
            bounds += [first + k for k in known]
        return bounds

    def blocks(self) -> tuple[Block, ...]:
        """Return one block per node."""
        free = tuple(SIGNS.values())
        return tuple(
            Block(
                tuple(range(self._first[i], self._first[i + 1])),
                self._places(i),
                (SLIPS, STICKS) if self._s[i] else free,
            )
            for i in range(len(self._F))
        )

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return the inequalities that hold in every mode."""
        rows: list[Array] = []
        values: list[float] = []
        for i, F in enumerate(self._F):
            n, t, s = self._n[i], self._t[i], self._s[i]
            K, h = self._K, self._h
            if s:
                rows += [s * self._one[t], s * K[t] - F * K[n]]
                values += [0.0, -s * h[t] + F * h[n]]
            else:
                rows += [-self._one[n], -K[n], K[t] - F * K[n], -K[t] - F * K[n]]
                values += [0.0, h[n], -h[t] + F * h[n], h[t] + F * h[n]]
        return np.array(rows), np.array(values)

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical rates."""
        size = np.sqrt(np.diag(self._K[: self.size]))
        force = float((np.abs(self._h[: self.size]) / size).max())
        return (force or 1.0) / size

    def solutions(self) -> tuple[list[list[int]], list[Array], str]:
        """Return the modes and the unknowns of all solutions, and what may be missing."""
        found = enumerate_solutions(self, 0.0)
        modes = [self._modes(solution.character) for solution in found]
        certain = found.guarantee.startswith("complete") and "infinitely" not in found.guarantee
        return modes, [solution.z for solution in found], "" if certain else found.guarantee
