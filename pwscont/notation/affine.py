"""The coefficients of a user's function that is affine, with the values of its switches free.

With u = (z, y, alpha), y the values of all switches, its values, tests and branches are C u + c.
C comes from one call with Duals, without cancellation; or from as many calls as there are columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix, Signs
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.generic import generic
from pwscont.basics.rounding import EPS, GUARD
from pwscont.notation.dual import Dual, as_dual
from pwscont.notation.function import Pick, UserFunction
from pwscont.notation.layout import Layout

#: A function promised to be affine may differ from its affine model by this part of its terms.
BENT = EPS**0.5
#: Sizes of the points at which that is checked.
CHECKED = (1.0, 1e3)


def coefficients(function: UserFunction, size: int, layout: Layout) -> tuple[Matrix, Array]:
    """Return C, csr, shape (n + m + b, n + S + 1), and c, shape (n + m + b,).

    Raises
    ------
    InvalidSystemError
        If the function is not affine, with the words for what is not.
    """
    zero = np.zeros(size + layout.count + 1)
    rest = _called(function, size, layout, zero)
    points = [reach * generic(len(zero), shift) for shift, reach in enumerate(CHECKED)]
    values = [_called(function, size, layout, u) for u in points]
    traced = _traced(function, size, layout, zero)
    if traced is not None and not any(
        _bent(layout, size, *each, traced, rest).any() for each in zip(points, values, strict=True)
    ):
        return traced, rest
    units = np.eye(len(zero))
    columns = [_called(function, size, layout, u) - rest for u in units]
    matrix = sp.csr_array(np.stack(columns, axis=1))
    for u, value in zip(points, values, strict=True):
        _check(layout, size, _bent(layout, size, u, value, matrix, rest))
    return matrix, rest


def _traced(function: UserFunction, size: int, layout: Layout, zero: Array) -> Matrix | None:
    """Return C from one call with Duals, None where the function does what they do not know."""
    try:
        called = _called(function, size, layout, Dual.variables(zero, 0, len(zero)))
    except InvalidSystemError:
        raise
    except Exception:  # numbers it can do
        return None
    return sp.csr_array(as_dual(called, len(zero)).rows)


def _called(function: UserFunction, size: int, layout: Layout, u: Any) -> Any:
    alpha = u[-1] if isinstance(u, Dual) else float(u[-1])
    with np.errstate(all="ignore"):
        return function.outcome(u[:size], alpha, layout, _given(layout, u[size:-1])).all()


def _given(layout: Layout, y: Any) -> Pick:
    """Return a pick of given values for the switches."""

    def pick(number: int, tests: Any, branches: Any) -> Any:
        mine = y[layout.slices[number]].reshape(layout.calls[number].shape)
        return mine if isinstance(mine, Dual) else mine[()]

    return pick


def _bent(layout: Layout, size: int, u: Array, value: Array, matrix: Matrix, rest: Array) -> Signs:
    """Tell which rows are not what the coefficients say."""
    terms = np.abs(value) + np.abs(rest) + abs(matrix) @ np.abs(u)
    with np.errstate(invalid="ignore"):
        off = np.abs(value - rest - matrix @ u)
        right: Signs = off <= BENT * terms + _rounding(layout, size, value)
    return ~right


def _rounding(layout: Layout, size: int, value: Array) -> Array:
    """Return how far rounding moves each row: a test is the difference of two branches."""
    branches = np.abs(value[size + layout.number_of_tests :])
    branches[~np.isfinite(branches)] = 0.0
    sizes = branches[layout.branches].max(axis=1)[layout.switch_of]
    return GUARD * EPS * np.concatenate([np.zeros(size), sizes, np.zeros(len(branches))])


def _check(layout: Layout, size: int, bent: Signs) -> None:
    """Refuse a function that is not affine."""
    if bent.any():
        raise InvalidSystemError(
            f"linear=True, but {_part(layout, size, int(np.argmax(bent)))} is not affine in z and "
            "alpha: leave out linear=True"
        )


def _part(layout: Layout, size: int, row: int) -> str:
    """Return in words which part of a function a row is."""
    if row < size:
        return f"entry {row} of the function"
    row -= size
    if row < layout.number_of_tests:
        switch = int(layout.switch_of[row])
    else:
        switch = int(np.argmax((layout.branches == row - layout.number_of_tests).any(axis=1)))
    call = int(np.searchsorted([s.stop for s in layout.slices], switch, side="right"))
    return f"an argument of call {call + 1} of sw, {layout.calls[call]},"
