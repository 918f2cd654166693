"""Equilibria and pseudo-equilibria of vector fields with a discontinuity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import final

import numpy as np
import scipy.linalg as sl

from pwscont import Character, PiecewiseSystem
from pwscont.extending import Array, dense
from pwscont_dynamics.called import Called, Function, positive_whole

#: Mode by the number of tests that are not negative.
WORDS = ("regular equilibrium where h < 0", "pseudo-equilibrium", "regular equilibrium where h > 0")
SHORT = ("regular, h < 0", "pseudo-equilibrium", "regular, h > 0")


@final
class FilippovEquilibria(PiecewiseSystem):
    r"""Equilibria of x' = plus(x) where h(x) > 0 and x' = minus(x) where h(x) < 0.

    On h = 0 Filippov (1988) takes the convex combination share * plus + (1 - share) * minus that is
    tangent to h = 0; zeros of the combination with 0 < share < 1 are *pseudo-equilibria*. With a
    further unknown y and share = clip(y, 0, 1) all equilibria satisfy

    share * plus(x) + (1 - share) * minus(x) = 0,  h(x) = y - share:

    y is above 1 where h > 0, below 0 where h < 0, and the share where h = 0. H is continuous,
    although the field is not. A regular equilibrium that meets h = 0, a *boundary equilibrium*, is
    a transition; at a non-smooth fold the regular equilibrium and a pseudo-equilibrium meet and
    vanish (di Bernardo, Nordmark and Olivar 2008). The last row compares h with a share: give h in
    a unit in which h is about 1 at equilibria, or a search may miss pseudo-equilibria.

    Parameters
    ----------
    plus, minus : callable
        (x, alpha) -> the vector field, shape (n,), each smooth beyond h = 0.
    h : callable
        (x, alpha) -> a number, smooth.
    n : int
        The number of coordinates.

    Raises
    ------
    InvalidInputError
        If a function cannot be called, or n is no positive whole number.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_dynamics import FilippovEquilibria
    >>> system = FilippovEquilibria(
    ...     plus=lambda x, mu: [-x[0] + x[1] + mu, -x[1]],
    ...     minus=lambda x, mu: [1.0, 0.3],
    ...     h=lambda x, mu: x[0],
    ...     n=2,
    ... )
    >>> explore(system, (-1.0, 1.0), parameter="mu").count(0.5)
    1
    """

    def __init__(self, plus: Function, minus: Function, h: Function, n: int) -> None:
        self.n = positive_whole("n", n)
        self.size = self.n + 1
        self._plus, self._minus = Called("plus", plus, self.n), Called("minus", minus, self.n)
        self._h = Called("h", h, 1)

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return y and y - 1."""
        return np.array([z[-1], z[-1] - 1.0])

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the gradients of y and y - 1."""
        gradients = np.zeros((2, self.size + 1))
        gradients[:, self.n] = 1.0
        return gradients

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the combined field, and h by y less h."""
        x, y = z[:-1], z[-1]
        share = (0.0, y, 1.0)[sum(character.signs)]
        field = np.zeros(self.n)
        if share != 0.0:
            field += share * self._plus(x, alpha)
        if share != 1.0:
            field += (1.0 - share) * self._minus(x, alpha)
        return np.append(field, y - share - self._h(x, alpha))

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return the tests that bound a mode: two for a pseudo-equilibrium, else a single test."""
        return ([0], [0, 1], [1])[sum(character.signs)]

    def cells(self) -> Iterator[Character]:
        """Yield the three modes."""
        yield from map(Character, ((True, True), (True, False), (False, False)))

    def share(self, z: Array, alpha: float) -> float:
        """Return the share of ``plus``."""
        return float(np.clip(z[-1], 0.0, 1.0))

    # -- stability ---------------------------------------------------------------------------

    def eigenvalues(self, z: Array, alpha: float) -> Array:
        """Return the eigenvalues of the field, shape (n,), or of sliding, shape (n - 1,).

        Sliding, at pseudo-equilibria, is the differential-algebraic system x' = F(x, y), h(x) = 0,
        with the finite eigenvalues of the pencil dH/dz - s diag(1, ..., 1, 0).
        """
        slopes = dense(self.jacobian(z, alpha, self.character(z, alpha)))[:, :-1]
        mass = np.diag(np.append(np.ones(self.n), 0.0))
        a, b = sl.eigvals(slopes, mass, homogeneous_eigvals=True)
        count = self.n if abs(slopes[-1, -1]) > 0.0 else self.n - 1
        finite = np.argsort(-np.abs(b))[:count]
        values: Array = (a[finite] / b[finite]).astype(complex)
        return values

    def growth(self, z: Array, alpha: float) -> float:
        """Return the largest real part of an eigenvalue: along h = 0 for a pseudo-equilibrium.

        For a pseudo-equilibrium the sign tells stability only where sliding attracts, see
        :meth:`pull`.
        """
        return float(self.eigenvalues(z, alpha).real.max(initial=-np.inf))

    def pull(self, z: Array, alpha: float) -> float:
        """Return h' under minus less h' under plus: sliding attracts where the pull is positive."""
        x = z[:-1]
        sliding = Character((True, False))
        gradient = -dense(self.jacobian(z, alpha, sliding))[-1, : self.n]
        return float(gradient @ (self._minus(x, alpha) - self._plus(x, alpha)))

    # -- words -------------------------------------------------------------------------------

    def names(self) -> tuple[str, ...]:
        """Return x1, x2, ... and y."""
        return (*(f"x{i + 1}" for i in range(self.n)), "y")

    def describe(self, character: Character) -> str:
        """Return the kind of equilibrium."""
        return WORDS[sum(character.signs)]

    def label(self, character: Character) -> str:
        """Return the kind of equilibrium, in short."""
        return SHORT[sum(character.signs)]

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return that an equilibrium meets h = 0."""
        return f"boundary equilibrium: {self.label(before)} → {self.label(after)}"
