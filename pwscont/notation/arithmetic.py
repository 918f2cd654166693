"""Plus, minus and times of arrays with dense derivatives, without numpy's slow dispatch.

A small curved system spends its time here: numpy's way takes ten times as long for a number.
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from numpy.lib.mixins import NDArrayOperatorsMixin

from pwscont.basics.arrays import Array, Matrix, dense

#: Types of plain numbers.
PLAIN = frozenset({float, int, np.float64})


class Arithmetic(NDArrayOperatorsMixin):
    """An array with derivatives; whatever is not done here goes numpy's way.

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
        """Return a new one without looking at what it is made of."""
        new = object.__new__(cls)
        new.value, new.rows = value, rows
        return new

    def _is_like(self, other: Any) -> bool:
        """Tell whether another one has the same shape, and both have dense derivatives."""
        return (
            type(other) is type(self)
            and self.value.shape == other.value.shape
            and type(self.rows) is np.ndarray is type(other.rows)
        )

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
        if a.ndim:
            rows = b.reshape(-1, 1) * self.rows + a.reshape(-1, 1) * other.rows
        else:
            rows = b * self.rows + a * other.rows
        return self.made(a * b, rows)

    def __rmul__(self, other: Any) -> Any:
        if type(other) in PLAIN:
            return self.made(other * self.value, other * self.rows)
        return super().__rmul__(other)

    def __pow__(self, other: Any) -> Any:
        if type(other) not in PLAIN or self.value.ndim or type(self.rows) is not np.ndarray:
            return super().__pow__(other)
        slope = other * self.value ** (other - 1) if other else 0.0
        return self.made(self.value**other, slope * self.rows)


def scaled(rows: Matrix, factors: Any) -> Matrix:
    """Return rows multiplied by one factor each."""
    column = factors.reshape(-1, 1)
    return rows.multiply(column).tocsr() if sp.issparse(rows) else column * rows


def added(one: Matrix, other: Matrix) -> Matrix:
    """Return the sum of two matrices of derivatives, sparse if both are."""
    if sp.issparse(one) and sp.issparse(other):
        return (one + other).tocsr()
    return dense(one) + dense(other)
