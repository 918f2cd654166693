"""Derivatives of a user's function, and the coefficients of an affine function.

With u = (z, y, alpha), y the values of all switches, the values, tests and branches of an affine
function are C u + c. C comes from one call with Duals, without cancellation; or from a call for
each column.

Which way a function allows is found out once, by comparing the derivatives with a difference.

Failure modes and answers
-------------------------
- The function does something that no Dual knows, but only with alpha, such as interpolating a load:
  only z is traced, and derivatives by alpha are differences.
- The function is written with ``jax.numpy``: JAX computes the derivatives.
- The function changes an array of plain numbers in place, or calls ``math.sin``, a table or a
  solver: all derivatives are differences.
- Derivatives that disagree with a difference are not used.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidSystemError
from pwscont.extending import EPS, GUARD, Array, Differences, Indices, Matrix, Signs, dense, generic
from pwscont.notation.dual import Dual, as_dual, value_of
from pwscont.notation.function import LiftedFunction, Pick, UserFunction
from pwscont.notation.layout import Layout

#: Part of the sum of the terms' magnitudes by which a function promised to be affine may differ
#: from the affine model: half of the digits, for C may come from differences of values.
BENT = EPS**0.5
#: Magnitudes of the points at which a function is compared with the affine model.
CHECKED = (1.0, 1e3)


def coefficients(function: UserFunction, size: int, layout: Layout) -> tuple[Matrix, Array, bool]:
    """Return C, csr, shape (n + m + b, n + S + 1), and c, shape (n + m + b,).

    And whether C was traced: differences of values may have lost digits.
    """
    zero = np.zeros(size + layout.count + 1)
    rest = _called(function, size, layout, zero)
    points = [reach * generic(len(zero), shift) for shift, reach in enumerate(CHECKED)]
    values = [_called(function, size, layout, u) for u in points]
    traced = _traced_coefficients(function, size, layout, zero)
    if traced is not None and not any(
        _bent(layout, size, *each, traced, rest).any() for each in zip(points, values, strict=True)
    ):
        return traced, rest, True
    units = np.eye(len(zero))
    columns = [_called(function, size, layout, u) - rest for u in units]
    matrix = sp.csr_array(np.stack(columns, axis=1))
    for u, value in zip(points, values, strict=True):
        _check(layout, size, _bent(layout, size, u, value, matrix, rest))
    return matrix, rest, False


def _traced_coefficients(
    function: UserFunction, size: int, layout: Layout, zero: Array
) -> Matrix | None:
    """Return C from a call with Duals, None if the function does something that no Dual knows."""
    try:
        called = _called(function, size, layout, Dual.variables(zero, 0, len(zero)))
    except InvalidSystemError:
        raise
    except Exception:  # the function may take plain numbers only
        return None
    return sp.csr_array(as_dual(called, len(zero)).rows)


def _called(function: UserFunction, size: int, layout: Layout, u: Any) -> Any:
    alpha = u[-1] if isinstance(u, Dual) else float(u[-1])
    with np.errstate(all="ignore"):
        return function.outcome(u[:size], alpha, layout, _given(layout, u[size:-1])).all()


def _given(layout: Layout, y: Any) -> Pick:
    """Return a ``Pick`` that gives the switches the values y."""

    def pick(number: int, tests: Any, branches: Any) -> Any:
        mine = y[layout.slices[number]].reshape(layout.calls[number].shape)
        return mine if isinstance(mine, Dual) else mine[()]

    return pick


def _bent(layout: Layout, size: int, u: Array, value: Array, matrix: Matrix, rest: Array) -> Signs:
    """Tell which rows of a value at u differ from C u + c by more than rounding."""
    terms = np.abs(value) + np.abs(rest) + abs(matrix) @ np.abs(u)
    with np.errstate(invalid="ignore"):
        off = np.abs(value - rest - matrix @ u)
        right: Signs = off <= BENT * terms + _rounding(layout, size, value)
    return ~right


def _rounding(layout: Layout, size: int, value: Array) -> Array:
    """Return the rounding error of each row; a test is the difference of two branches."""
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
    """Return a phrase for the part of the function that a row belongs to."""
    if row < size:
        return f"entry {row} of the function"
    row -= size
    if row < layout.number_of_tests:
        switch = int(layout.switch_of[row])
    else:
        switch = int(np.argmax((layout.branches == row - layout.number_of_tests).any(axis=1)))
    call = int(np.searchsorted([s.stop for s in layout.slices], switch, side="right"))
    return f"an argument of call {call + 1} of sw, {layout.calls[call]},"


#: x = (z, alpha), modes, alpha -> differences; derivatives of values, tests and branches by x.
Derivatives = Callable[[Array, Indices, Callable[[float], Differences]], Matrix]
#: Derivatives that disagree with a difference by this part of the sum of the terms' magnitudes are
#: not used; a difference itself has half of the digits.
WRONG = EPS**0.25


def by_duals(lifted: LiftedFunction, x: Array, modes: Indices, differences: Any) -> Matrix:
    """Return the derivatives at x from a call with Duals."""
    u = Dual.variables(x, 0, len(x))
    return _traced(lifted, u, u[-1], modes)


def by_duals_of_z(lifted: LiftedFunction, x: Array, modes: Indices, differences: Any) -> Matrix:
    """Return the derivatives at x: by z from a call with Duals, by alpha from differences."""
    alpha = float(x[-1])
    rows = dense(_traced(lifted, Dual.variables(x, 0, len(x)), alpha, modes))
    rows[:, -1] = differences(alpha).by_parameter(
        lambda a: lifted.outcome(x, a, modes).all(), alpha
    )
    return rows


@np.errstate(all="ignore")  # a slope may be infinite where a value is not
def _traced(lifted: LiftedFunction, u: Dual, alpha: Any, modes: Indices) -> Matrix:
    return as_dual(lifted.outcome(u, alpha, modes).all(), u.rows.shape[1]).rows


def by_jax(lifted: LiftedFunction, x: Array, modes: Indices, differences: Any) -> Matrix:
    """Return the derivatives at x from JAX, in double precision."""
    import jax  # noqa: PLC0415  an extra

    jax.config.update("jax_enable_x64", True)

    def values(u: Any) -> Any:
        return lifted.outcome(u, u[-1], modes).all()

    return np.asarray(jax.jacfwd(values)(x), dtype=float)


def derivatives_of(lifted: LiftedFunction, points: list[Array]) -> Derivatives | None:
    """Return the most exact derivatives that a function allows, None if only differences work.

    Parameters
    ----------
    lifted : LiftedFunction
    points : list of ndarray, shape (n + 1,)
        Points at which the function is finite.
    """
    ways = [by_duals, by_duals_of_z, *([by_jax] if "jax" in sys.modules else [])]
    for way in ways:
        try:
            slopes = partial(way, lifted)  # no closure: systems are pickled
            if all(_is_right(lifted, slopes, x) for x in points):
                return slopes
        except InvalidSystemError:
            raise
        except Exception:  # the function does something that this way does not know
            continue
    return None


def _is_right(lifted: LiftedFunction, slopes: Derivatives, x: Array) -> bool:
    """Tell whether derivatives at x, along a direction, agree with a difference."""
    scale = np.maximum(np.abs(x), 1.0)
    differences = Differences(scale)
    outcome = lifted.outcome(x, float(x[-1]), None)
    modes = lifted.layout.modes(outcome.tests >= 0.0)

    def values(u: Array) -> Array:
        return value_of(lifted.outcome(u, float(u[-1]), modes).all())

    with np.errstate(all="ignore"):
        matrix, way = slopes(x, modes, lambda alpha: differences), generic(len(x)) * scale
        expected = differences.along(values, x, way)
        terms = abs(matrix) @ np.abs(way) + np.abs(expected) + np.abs(values(x))
        off = np.abs(matrix @ way - expected)
        # where a row has a double zero, as u**2 at 0, its difference is rounding of larger values
        rounding = np.nan_to_num(EPS * np.abs(values(x + way)), posinf=0.0)
    known = np.isfinite(expected)
    return bool((off <= WRONG * terms + rounding)[known].all())
