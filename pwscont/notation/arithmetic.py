"""Arithmetic of arrays with derivatives, and the derivatives of numpy's functions.

A small curved system spends most of the time here: numpy's ufuncs take ten times as long for a
single number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from numpy.lib.mixins import NDArrayOperatorsMixin

from pwscont import InvalidSystemError
from pwscont.extending import Array, Matrix, dense

#: Smooth functions of one argument: the derivative, exact for proofs, from argument and value.
SMOOTH: dict[str, Callable[[Any, Any], Any]] = {
    "negative": lambda x, y: -np.ones_like(x),
    "positive": lambda x, y: np.ones_like(x),
    "square": lambda x, y: 2.0 * x,
    "sqrt": lambda x, y: 0.5 / y,
    "cbrt": lambda x, y: y / (3.0 * x),
    "reciprocal": lambda x, y: -y * y,
    "exp": lambda x, y: y,
    "exp2": lambda x, y: np.log(2.0) * y,
    "expm1": lambda x, y: y + 1.0,
    "log": lambda x, y: 1.0 / x,
    "log2": lambda x, y: 1.0 / (np.log(2.0) * x),
    "log10": lambda x, y: 1.0 / (np.log(10.0) * x),
    "log1p": lambda x, y: 1.0 / (1.0 + x),
    "sin": lambda x, y: np.cos(x),
    "cos": lambda x, y: -np.sin(x),
    "tan": lambda x, y: 1.0 + y * y,
    "arcsin": lambda x, y: 1.0 / np.sqrt(1.0 - x * x),
    "arccos": lambda x, y: -1.0 / np.sqrt(1.0 - x * x),
    "arctan": lambda x, y: 1.0 / (1.0 + x * x),
    "sinh": lambda x, y: np.cosh(x),
    "cosh": lambda x, y: np.sinh(x),
    "tanh": lambda x, y: 1.0 - y * y,
    "arcsinh": lambda x, y: 1.0 / np.sqrt(1.0 + x * x),
    "arccosh": lambda x, y: 1.0 / np.sqrt(x * x - 1.0),
    "arctanh": lambda x, y: 1.0 / (1.0 - x * x),
    "deg2rad": lambda x, y: np.full_like(x, np.pi / 180.0),
    "rad2deg": lambda x, y: np.full_like(x, 180.0 / np.pi),
}
#: Smooth functions of two arguments: the derivatives by each argument, from the arguments and the
#: value.
OF_TWO: dict[str, tuple[Callable[[Any, Any, Any], Any], ...]] = {
    "add": (lambda a, b, y: 1.0, lambda a, b, y: 1.0),
    "subtract": (lambda a, b, y: 1.0, lambda a, b, y: -1.0),
    "multiply": (lambda a, b, y: b, lambda a, b, y: a),
    "divide": (lambda a, b, y: 1.0 / b, lambda a, b, y: -y / b),
    "arctan2": (lambda a, b, y: b / (a * a + b * b), lambda a, b, y: -a / (a * a + b * b)),
    "hypot": (lambda a, b, y: a / y, lambda a, b, y: b / y),
    "power": (lambda a, b, y: b * a ** (b - 1.0), lambda a, b, y: np.log(a) * y),
    "float_power": (lambda a, b, y: b * a ** (b - 1.0), lambda a, b, y: np.log(a) * y),
}
#: What to write for comparisons, in which max, min and np.where of Python and numpy end.
COMPARED = "sw.where instead; for max and min: sw.max, sw.min"
#: Functions with kinks or jumps -> what to write, empty if no switch fits.
KINKED = {
    **dict.fromkeys(["absolute", "fabs"], "sw.abs instead"),
    **dict.fromkeys(["maximum", "fmax", "max", "amax"], "sw.max instead"),
    **dict.fromkeys(["minimum", "fmin", "min", "amin"], "sw.min instead"),
    "clip": "sw.clip instead",
    **dict.fromkeys(["sort", "argsort", "argmax", "argmin", "median", "round", "around"], ""),
    **dict.fromkeys(["sign", "heaviside", "copysign", "signbit"], ""),
    **dict.fromkeys(["floor", "ceil", "rint", "trunc", "remainder", "fmod"], ""),
    **dict.fromkeys(["floor_divide", "mod", "logical_and", "logical_or", "logical_not"], ""),
    **dict.fromkeys(["less", "less_equal", "greater", "greater_equal"], COMPARED),
    **dict.fromkeys(["equal", "not_equal"], COMPARED),
}
#: Functions that are answered from the values alone.
QUESTIONS = frozenset({"isfinite", "isnan", "isinf"})


class UntraceableError(TypeError):
    """A function was applied to a Dual, and the derivative of that function is not known."""


def refuse_kink(name: str) -> InvalidSystemError:
    """Return the error for a kink that no switch announces."""
    better = KINKED.get(name) or "a continuous formula with the switches of sw"
    return InvalidSystemError(
        f"the function decides by numpy's {name!r} of something that depends on (z, alpha), a kink "
        f"that no switch announces: write {better}; if the function is smooth all the same, "
        "Complementarity takes its derivatives as jacobian=..., and a PiecewiseSystem any function"
    )


#: Types of plain numbers.
PLAIN = frozenset({float, int, np.float64})


class Arithmetic(NDArrayOperatorsMixin):
    """An array with derivatives; numpy's ufuncs do the arithmetic that is not written out here.

    Attributes
    ----------
    value : ndarray
    rows : ndarray or scipy.sparse array, shape (value.size, D)
    """

    __slots__ = ("rows", "value")

    value: Array
    rows: Matrix

    @classmethod
    def made(cls, value: Any, rows: Matrix) -> Self:
        """Return an array with derivatives from values and rows that are not checked."""
        new = object.__new__(cls)
        new.value, new.rows = value, rows
        return new

    def _is_like(self, other: Any) -> bool:
        """Tell whether ``other`` has the same shape or shape (), and no derivatives are sparse."""
        if not (type(other) is type(self) and type(self.rows) is np.ndarray is type(other.rows)):
            return False
        shape, others = self.value.shape, other.value.shape
        return shape == others or not shape or not others  # rows broadcast as values do

    def __add__(self, other: Any) -> Any:
        if self._is_like(other):
            return self.made(self.value + other.value, self.rows + other.rows)
        if type(other) in PLAIN:
            return self.made(self.value + other, self.rows)
        return super().__add__(other)

    def __radd__(self, other: Any) -> Any:
        if type(other) in PLAIN:
            return self.made(other + self.value, self.rows)
        return super().__radd__(other)

    def __neg__(self) -> Self:
        return self.made(-self.value, -self.rows)

    def __sub__(self, other: Any) -> Any:
        if self._is_like(other):
            return self.made(self.value - other.value, self.rows - other.rows)
        if type(other) in PLAIN:
            return self.made(self.value - other, self.rows)
        return super().__sub__(other)

    def __rsub__(self, other: Any) -> Any:
        if type(other) in PLAIN:
            return self.made(other - self.value, -self.rows)
        return super().__rsub__(other)

    def __mul__(self, other: Any) -> Any:
        if type(other) in PLAIN:
            return self.made(self.value * other, self.rows * other)
        if not self._is_like(other):
            return super().__mul__(other)
        a, b = self.value, other.value
        return self.made(a * b, scaled(self.rows, b) + scaled(other.rows, a))

    def __rmul__(self, other: Any) -> Any:
        if type(other) in PLAIN:
            return self.made(other * self.value, other * self.rows)
        return super().__rmul__(other)

    def __truediv__(self, other: Any) -> Any:
        if type(other) in PLAIN:
            return self.made(self.value / other, self.rows / other)
        return super().__truediv__(other)

    def __pow__(self, other: Any) -> Any:
        if type(other) not in PLAIN:
            return super().__pow__(other)
        slope = other * self.value ** (other - 1) if other else 0.0 * self.value
        return self.made(self.value**other, scaled(self.rows, slope))


def scaled(rows: Matrix, factors: Any) -> Matrix:
    """Return the rows of a matrix, each multiplied by a factor of its own."""
    column = factors.reshape(-1, 1)
    return column * rows if type(rows) is np.ndarray else rows.multiply(column).tocsr()


def added(one: Matrix, other: Matrix) -> Matrix:
    """Return the sum of two matrices of derivatives, dense unless each matrix is sparse."""
    if sp.issparse(one) and sp.issparse(other):
        return (one + other).tocsr()
    return dense(one) + dense(other)
