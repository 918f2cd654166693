"""Whether derivatives that a user gives are the derivatives of the user's functions.

A Jacobian with a single wrong number sends every step astray, or turns the wrong way at a fold,
without a word. A generic direction shows the row of a wrong number, at the cost of two values.

Failure modes and answers
-------------------------
- A function may change within less than a step: the quotients by steps of other lengths then differ
  among themselves, and say nothing. Rounding, and noise of the function, show in the same way.
- At special points, as z = 0, wrong terms vanish: derivatives are compared next to the point.
- Far from zero a step may be lost in the rounding of the point: the quotients then say nothing.
- Beside the point the function may not be defined: values that are not finite say nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from pwscont.basics.arrays import Array, Matrix, generic, product
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.looks import at
from pwscont.system.contract import jacobian_at, residual_at
from pwscont.system.differences import Differences
from pwscont.system.system import PiecewiseSystem

#: Distance from a point at which derivatives are compared, in typical magnitudes.
DISTANCE_TO_POINT = 0.01
#: Lengths of steps, in typical magnitudes; the first length nearly always confirms the derivative.
STEPS = (1e-5, 1e-4, 1e-6)
#: Largest error of a right derivative, and largest difference of quotients that agree, as parts of
#: the terms of the derivative.
WRONG_SLOPE, EQUAL_QUOTIENTS = 1e-4, 1e-5
#: Largest change of a function within a step by the slope, in magnitudes of the function.
WITHIN = 100.0


def refuse_wrong_jacobian(system: PiecewiseSystem, character: Character, x: Array) -> None:
    """Refuse a Jacobian that is not the derivative of H next to a point; differences need no check.

    Raises
    ------
    InvalidSystemError
        Naming the row, and the point.
    """
    if _is_inherited(system.jacobian, PiecewiseSystem.jacobian):
        return
    y, direction = _beside(system.differences(float(x[-1])), x)
    given = jacobian_at(system, y[:-1], float(y[-1]), character)

    def residual(y: Array) -> Array:
        return residual_at(system, y[:-1], float(y[-1]), character)

    what = f"jacobian in {system.label(character)}", "residual"
    _refuse(system, what, _wrong_row(residual, given, y, direction), y)


def refuse_wrong_gradients(system: PiecewiseSystem, x: Array) -> None:
    """Refuse gradients that are not the derivatives of the tests next to a point, as for H.

    Raises
    ------
    InvalidSystemError
    """
    if _is_inherited(system.test_jacobian, PiecewiseSystem.test_jacobian):
        return
    y, direction = _beside(system.differences(float(x[-1])), x)
    given = system.test_jacobian(y[:-1], float(y[-1]))

    def tests(y: Array) -> Array:
        return np.array(system.test_functions(y[:-1], float(y[-1])), dtype=float)

    what = "test_jacobian", "test_functions"
    _refuse(system, what, _wrong_row(tests, given, y, direction), y)


def _is_inherited(method: Callable[..., Matrix], default: Callable[..., Matrix]) -> bool:
    """Tell whether a method is the default, not replaced in a class or on the instance."""
    return getattr(method, "__func__", None) is default


def _beside(differences: Differences, x: Array) -> tuple[Array, Array]:
    """Return a point beside x, and a direction in which all steps stay in the interval."""
    direction = differences.scale * generic(len(x))
    y, reach = x + DISTANCE_TO_POINT * direction, max(STEPS) * abs(direction[-1])
    if differences.hi - differences.lo <= 2.0 * reach:
        direction[-1] = 0.0
    else:
        y[-1] = min(max(y[-1], differences.lo + reach), differences.hi - reach)
    return y, direction


def _wrong_row(
    function: Callable[[Array], Array], given: Matrix, x: Array, direction: Array
) -> int | None:
    """Return the row in which a derivative is not the function's; None if there is no such row."""
    slopes, terms = product(given, direction), product(abs(given), np.abs(direction))
    terms[~np.isfinite(terms)] = 0.0  # nan is wrong where the function has a slope
    quotients: list[Array] = []
    wrong = np.ones(len(slopes), dtype=bool)
    for step in STEPS:
        ahead, behind = x + step * direction, x - step * direction
        if (
            np.abs((ahead - behind) / (2.0 * step) - direction)
            > EQUAL_QUOTIENTS * np.abs(direction)
        ).any():
            return None
        after, before = function(ahead), function(behind)
        quotients.append((after - before) / (2.0 * step))
        sizes = terms + np.abs(quotients[0])
        # a function that oscillates within the step has no slope that the step shows
        wrong &= ~(np.abs(slopes) * step > WITHIN * (np.abs(after) + np.abs(before)))
        wrong &= ~(np.abs(quotients[-1] - slopes) <= WRONG_SLOPE * sizes)
        for one, other in pairwise(quotients):
            wrong &= np.abs(one - other) <= EQUAL_QUOTIENTS * sizes
        if not wrong.any():
            return None  # nearly always at once
    return int(np.flatnonzero(wrong)[0])


def _refuse(system: PiecewiseSystem, what: tuple[str, str], row: int | None, x: Array) -> None:
    if row is not None:
        given, function = what
        raise InvalidSystemError(
            f"{type(system).__name__}.{given} is wrong in row {row}: it is not the derivative of "
            f"{function} at {at(x)}; check_system tells by how much"
        )
