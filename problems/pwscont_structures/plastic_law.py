"""Elastic-plastic bars from a state with given plastic elongations on."""

from __future__ import annotations

from typing import final

import numpy as np
import numpy.typing as npt

from pwscont import Block, Character, LoadHistory, PiecewiseLinearSystem
from pwscont.extending import Array

#: Signs of (strength - trial, strength + trial) of a bar in each mode.
ELASTIC, TENSION, COMPRESSION = (True, True), (False, True), (True, False)
MODES = (ELASTIC, TENSION, COMPRESSION)
WORDS = {ELASTIC: "elastic", TENSION: "yields in tension", COMPRESSION: "yields in compression"}


@final
class PlasticLaw(PiecewiseLinearSystem):
    """Equilibrium of bars with given plastic elongations, z = (u, s).

    Parameters
    ----------
    B : ndarray, shape (m, n)
        Elongations of the bars by displacements.
    stiffness, strength, hardening : ndarray, shape (m,)
    history : LoadHistory
    plastic : ndarray, shape (m,)
        Plastic elongations.
    """

    degree = 1

    def __init__(
        self,
        B: Array,
        stiffness: Array,
        strength: Array,
        hardening: Array,
        history: LoadHistory,
        plastic: Array,
    ) -> None:
        self.B, self.k, self.y, self.H = B, stiffness, strength, hardening
        self.history, self.plastic = history, plastic
        self.m, self.n = B.shape
        self.size = self.n + self.m
        self._hardened = B.T @ (hardening[:, np.newaxis] * B)
        # with hardening everywhere the force grows strictly with the displacements
        self.unique = bool((hardening > 0.0).all() and np.linalg.matrix_rank(B) == self.n)

    def _trial(self, z: Array) -> Array:
        trial: Array = self.k * (self.B @ z[: self.n] - self.plastic)
        return trial

    def _split(self, character: Character) -> tuple[list[tuple[bool, bool]], int]:
        """Return the signs of each bar, and the number of the straight line of the load."""
        signs, tests = character.signs, 2 * self.m
        return list(zip(signs[0:tests:2], signs[1:tests:2], strict=True)), sum(signs[tests:])

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return strength -+ trial force of each bar, then t minus the corners of the load."""
        trial = self._trial(z)
        bars = np.stack([self.y - trial, self.y + trial], axis=1).ravel()
        return np.append(bars, alpha - self.history.corners)

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the constant gradients of the tests."""
        corners = len(self.history.corners)
        rows = np.zeros((2 * self.m + corners, self.size + 1))
        slopes = self.k[:, np.newaxis] * self.B
        rows[0 : 2 * self.m : 2, : self.n], rows[1 : 2 * self.m : 2, : self.n] = -slopes, slopes
        rows[2 * self.m :, -1] = 1.0
        return rows

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the balance of forces at the nodes, then the law of each bar."""
        bars, leg = self._split(character)
        u, s = z[: self.n], z[self.n :]
        begin, slope = self.history.line(leg)
        balance = self._hardened @ u + self.B.T @ s - begin - alpha * slope
        force = np.select(
            [_are(bars, TENSION), _are(bars, COMPRESSION)], [self.y, -self.y], self._trial(z)
        )
        return np.append(balance, s - force)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the constant matrix of a cell."""
        bars, leg = self._split(character)
        matrix = np.zeros((self.size, self.size + 1))
        matrix[: self.n, : self.n], matrix[: self.n, self.n : -1] = self._hardened, self.B.T
        matrix[: self.n, -1] = -self.history.line(leg)[1]
        elastic = _are(bars, ELASTIC)[:, np.newaxis]
        matrix[self.n :, : self.n] = np.where(elastic, -self.k[:, np.newaxis] * self.B, 0.0)
        matrix[self.n :, self.n : -1] = np.eye(self.m)
        return matrix

    def bounding_tests(self, character: Character) -> list[int]:
        """Return both tests of elastic bars, one of yielding bars, and the ends of the line."""
        bars, leg = self._split(character)
        bounds: list[int] = []
        for i, signs in enumerate(bars):
            bounds += {ELASTIC: [2 * i, 2 * i + 1], TENSION: [2 * i]}.get(signs, [2 * i + 1])
        first, corners = 2 * self.m, len(self.history.corners)
        return [*bounds, *(first + k for k in (leg - 1, leg) if 0 <= k < corners)]

    def blocks(self) -> tuple[Block, ...]:
        """Return one block per bar, and one for the load."""
        n, count = self.n, len(self.history.corners)
        bars = [Block((2 * i, 2 * i + 1), (n + i,), MODES) for i in range(self.m)]
        if not count:
            return tuple(bars)
        tests = tuple(2 * self.m + k for k in range(count))
        lines = tuple(tuple(k < leg for k in range(count)) for leg in range(count + 1))
        return (*bars, Block(tests, tuple(range(n)), lines))

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical displacements and forces."""
        force = max(float(np.abs(self.history.loads).max()), float(self.y.max()))
        length = max(force / float(self.k.min()), float(np.abs(self.plastic).max()))
        return np.repeat([length, force], [self.n, self.m])

    def names(self) -> tuple[str, ...]:
        """Return u_1, ... and s_1, ..."""
        u = (f"u_{i + 1}" for i in range(self.n))
        return (*u, *(f"s_{i + 1}" for i in range(self.m)))

    def describe(self, character: Character) -> str:
        """Return which bars yield."""
        bars = self._split(character)[0]
        words = [
            f"bar {i + 1} {WORDS.get(signs, '')}"
            for i, signs in enumerate(bars)
            if signs != ELASTIC
        ]
        return ", ".join(words) or "elastic"


def _are(bars: list[tuple[bool, bool]], mode: tuple[bool, bool]) -> npt.NDArray[np.bool_]:
    return np.array([signs == mode for signs in bars])
