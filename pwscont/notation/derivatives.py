"""Derivatives of a user's function: by Duals, by JAX, or by differences.

Which of these a function allows is found out once, by comparing them with a difference.

Failure modes and answers
-------------------------
- The function does something that no Dual knows, but only with alpha, as where a load is
  interpolated: then z alone is traced, and alpha changed by differences.
- It is written with ``jax.numpy``: JAX differentiates it.
- It changes an array of plain numbers in place, calls ``math.sin``, a table, a solver: differences.
- Derivatives that disagree with a difference are not used.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, Indices, Matrix, dense
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.generic import generic
from pwscont.basics.rounding import EPS
from pwscont.notation.dual import Dual, as_dual, value_of
from pwscont.notation.lifted import LiftedFunction
from pwscont.system.differences import Differences

#: x = (z, alpha), modes, alpha -> differences; derivatives of all that a call gives, by x.
Derivatives = Callable[[Array, Indices, Callable[[float], Differences]], Matrix]
#: Derivatives that disagree with a difference by this part of their terms are not used.
WRONG = EPS**0.25


def by_duals(lifted: LiftedFunction, x: Array, modes: Indices, differences: Any) -> Matrix:
    """Return derivatives by one call with Duals."""
    u = Dual.variables(x, 0, len(x))
    return _traced(lifted, u, u[-1], modes)


def by_duals_of_z(lifted: LiftedFunction, x: Array, modes: Indices, differences: Any) -> Matrix:
    """Return derivatives by a call with Duals for z, and by differences for alpha."""
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
    """Return derivatives by JAX, in double precision."""
    import jax  # noqa: PLC0415  an extra

    jax.config.update("jax_enable_x64", True)

    def values(u: Any) -> Any:
        return lifted.outcome(u, u[-1], modes).all()

    return np.asarray(jax.jacfwd(values)(x), dtype=float)


def derivatives_of(lifted: LiftedFunction, points: list[Array]) -> Derivatives | None:
    """Return the best derivatives that a function allows, None where only differences do.

    Parameters
    ----------
    lifted : LiftedFunction
    points : list of ndarray, shape (n + 1,)
        Where the function is finite.

    Raises
    ------
    InvalidSystemError
        If the function has a kink that no switch announces.
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
    """Tell whether derivatives along a direction agree with a difference."""
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
    known = np.isfinite(expected)
    return bool((off <= WRONG * terms)[known].all())
