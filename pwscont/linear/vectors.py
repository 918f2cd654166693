"""Products and sums of vectors by BLAS: of few entries numpy's take several times as long."""

from __future__ import annotations

from collections.abc import Callable

from scipy.linalg import blas

from pwscont.basics.arrays import Array

#: The inner product of two vectors.
dot: Callable[[Array, Array], float] = blas.ddot


def times(factor: float, vector: Array) -> Array:
    """Multiply a vector in place, and return it."""
    multiple: Array = blas.dscal(factor, vector)
    return multiple


def plus(point: Array, factor: float, direction: Array) -> Array:
    """Add a multiple of a direction to a point, in place, and return the point."""
    moved: Array = blas.daxpy(direction, point, a=factor)
    return moved


def add_multiples(rows: Array, factors: Array, row: Array) -> None:
    """Add multiples of a row to rows, shape (l, k), in place."""
    blas.dger(1.0, row, factors, 1, 1, rows.T, 0, 0, 1)  # no strides, and only rows change
