"""Periodic points of maps with a different formula on either side of a border."""

from __future__ import annotations

from functools import partial
from typing import Any, Self, final

import numpy as np

from pwscont import Block, Character, InvalidInputError, PiecewiseLinearSystem, PiecewiseSystem
from pwscont.extending import EPS, Array, BringsSearches, Indices, Search, dense, finite_array
from pwscont_dynamics.called import Called, Function, affine, first_coordinate, positive_whole
from pwscont_dynamics.shorter import ShorterPeriods, largest_divisors

#: Distance below which two points of an orbit coincide, as a part of the largest coordinate.
SAME = EPS**0.5


class Orbits(PiecewiseSystem, BringsSearches):
    """Points with f(...f(x)) = x after k steps of f = right where the border is >= 0, else left.

    The unknowns are all points of the orbit, z = (x_0, ..., x_{k-1}), so that no products of slopes
    are formed; the rows are x_i - f(x_{i-1}), and det(dH/dz) = det(I - Df^k), whatever n and k. The
    test of step i is the border at x_i. The *word* of an orbit is L or R for each point. An orbit
    of least period k is found k times, once from each point.

    Attributes
    ----------
    n, period : int
        The number of coordinates, and k.
    """

    def __init__(self, left: Called, right: Called, border: Called, n: int, period: int) -> None:
        self.n, self.period = n, positive_whole("period", period)
        self.size = n * self.period
        self._sides, self._border = (left, right), border

    # -- equations ---------------------------------------------------------------------------

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the border at each point of the orbit."""
        return np.concatenate([self._border(x, alpha) for x in self._points(z)])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return each point less the image of the point before."""
        points = self._points(z)
        pairs = zip(points, character.signs, strict=True)
        images = [self._sides[sign](x, alpha) for x, sign in pairs]
        rows: Array = (points - np.roll(images, 1, axis=0)).ravel()
        return rows

    def _points(self, z: Array) -> Array:
        return z.reshape(self.period, self.n)

    def _places(self) -> Indices:
        """Return the places of the coordinates of each point in the unknowns, shape (k, n)."""
        places: Indices = np.arange(self.size).reshape(self.period, self.n)
        return places

    # -- searches ----------------------------------------------------------------------------

    def searches(self) -> list[Search]:
        """Return the search for points of shorter periods, where there are any."""
        shorter = {d: self.of_period(d) for d in largest_divisors(self.period)}
        return [ShorterPeriods(shorter)] if shorter else []

    def of_period(self, period: int) -> Self:
        """Return the same map, whose points of another period are asked for."""
        other = object.__new__(type(self))
        vars(other).update(vars(self), period=period, size=self.n * period)
        return other

    # -- stability ---------------------------------------------------------------------------

    def multipliers(self, z: Array, alpha: float) -> Array:
        """Return the eigenvalues of the derivative of k steps, complex, shape (n,).

        A point on the border counts as a point where the border is >= 0.
        """
        whole = dense(self.jacobian(z, alpha, self.character(z, alpha)))
        product = np.eye(self.n)
        own = np.eye(self.n) if self.period == 1 else 0.0
        for at, after in zip(self._places(), np.roll(self._places(), -1, axis=0), strict=True):
            product = (own - whole[np.ix_(after, at)]) @ product
        values: Array = np.linalg.eigvals(product).astype(complex)
        return values

    def largest_multiplier(self, z: Array, alpha: float) -> float:
        """Return the largest modulus of a multiplier: below 1 the orbit is stable."""
        return float(np.abs(self.multipliers(z, alpha)).max())

    def least_period(self, z: Array, alpha: float) -> int:
        """Return after how many steps, a divisor of k, the orbit comes back to the first point."""
        points = self._points(z)
        slack = SAME * np.abs(points).max()
        shifts = (d for d in range(1, self.period) if self.period % d == 0)
        repeats = (
            d for d in shifts if (np.abs(np.roll(points, d, axis=0) - points) <= slack).all()
        )
        return next(repeats, self.period)

    def test_name(self, test: int) -> str:
        """Return at which point of the orbit the border is tested."""
        return f"the border at point {test}"

    # -- words -------------------------------------------------------------------------------

    def names(self) -> tuple[str, ...]:
        """Return x1, x2, ..., with the step if there are several."""
        steps = [f" at {i}" for i in range(self.period)] if self.period > 1 else [""]
        return tuple(f"x{j + 1}{step}" for step in steps for j in range(self.n))

    def word(self, character: Character) -> str:
        """Return L or R for each point, such as ``LRRL``."""
        return "".join("LR"[sign] for sign in character.signs)

    def describe(self, character: Character) -> str:
        """Return the word."""
        return f"word {self.word(character)}"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return two words, which differ at the point that collides with the border."""
        return f"border collision {self.word(before)} → {self.word(after)}"


@final
class PeriodicPoints(Orbits):
    """Points of period k of a map x -> left(x) or right(x), smooth on either side.

    Parameters
    ----------
    left, right : callable
        (x, alpha) -> the image, shape (n,). The images agree where the border is zero, and each
        function can be evaluated beyond the border.
    border : callable
        (x, alpha) -> a number: right holds where the number is not negative.
    n : int
        The number of coordinates.
    period : int, optional
        k; points whose period divides k are found, too.

    Raises
    ------
    InvalidInputError
        If a function cannot be called, or n or period is no positive whole number.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_dynamics import PeriodicPoints
    >>> tent = PeriodicPoints(
    ...     left=lambda x, mu: mu + 0.5 * x,
    ...     right=lambda x, mu: mu - 3.0 * x,
    ...     border=lambda x, mu: x[0],
    ...     n=1,
    ... )
    >>> explore(tent, (-1.0, 1.0), parameter="mu").count(0.5)
    1
    """

    def __init__(
        self, left: Function, right: Function, border: Function, n: int, period: int = 1
    ) -> None:
        n = positive_whole("n", n)
        first, second = Called("left", left, n), Called("right", right, n)
        super().__init__(first, second, Called("border", border, 1), n, period)


@final
class AffinePeriodicPoints(Orbits, PiecewiseLinearSystem):
    """Points of period k of x -> A x + b + alpha c, with A on either side of x_1 = 0.

    The border-collision normal form of Nusse and Yorke (1992) is the case A = [[tau, 1],
    [-delta, 0]], b = 0, c = (1, 0).

    Parameters
    ----------
    left, right : array_like, shape (n, n)
        A where x_1 < 0, and A where x_1 >= 0; only the first columns may differ.
    c : array_like, shape (n,)
    b : array_like, shape (n,), optional
        Default 0.
    period : int, optional

    Raises
    ------
    InvalidInputError
        If shapes do not fit, or the map jumps at x_1 = 0.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_dynamics import AffinePeriodicPoints
    >>> points = AffinePeriodicPoints([[0.5]], [[-3.0]], [1.0], period=2)
    >>> explore(points, (-1.0, 1.0), parameter="mu").count(0.5)
    3
    """

    def __init__(self, left: Any, right: Any, c: Any, b: Any = None, period: int = 1) -> None:
        c = finite_array("c", c)
        n = c.size
        b = np.zeros(n) if b is None else finite_array("b", b, (n,))
        matrices = finite_array("left", left, (n, n)), finite_array("right", right, (n, n))
        apart = (matrices[0] != matrices[1]).any(axis=0)
        if apart[1:].any():
            column = 2 + int(np.argmax(apart[1:]))
            raise InvalidInputError(
                f"the map jumps at x_1 = 0: left and right differ in column {column}, and may "
                "differ in the first one only"
            )
        first, second = (
            Called(name, partial(affine, A, b, c), n)
            for name, A in zip(("left", "right"), matrices, strict=True)
        )
        super().__init__(first, second, Called("border", first_coordinate, 1), n, period)

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each step, which is on the left or on the right."""
        sides, images = ((False,), (True,)), np.roll(self._places(), -1, axis=0).tolist()
        return tuple(Block((i,), tuple(rows), sides) for i, rows in enumerate(images))
