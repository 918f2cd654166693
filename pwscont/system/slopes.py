"""Whether derivatives that a user gives are those of the user's functions.

A Jacobian that is wrong in one number sends every step astray, or turns the wrong way at a fold,
without a word. One generic direction shows a wrong number in its row, at the cost of two values.

Failure modes and answers
-------------------------
- A function may change within less than a step: the quotients by steps of other lengths then differ
  among themselves, and say nothing. Rounding, and noise of the function, show in the same way.
- At special points, as z = 0, wrong terms vanish: derivatives are compared next to the point.
- Beside the point the function may not be defined: what is not finite says nothing.
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

#: How far beside a point derivatives are compared, in typical magnitudes.
ASIDE = 0.01
#: Lengths of steps, the first of which nearly always confirms the derivative.
STEPS = (1e-5, 1e-4, 1e-6)
#: By what part of its terms a derivative may be off, and quotients may differ from each other.
WRONG, ALIKE = 1e-4, 1e-5


def refuse_wrong_jacobian(system: PiecewiseSystem, character: Character, x: Array) -> None:
    """Refuse a Jacobian that is not that of H next to a point; one by differences always is.

    Raises
    ------
    InvalidSystemError
        Naming the row, and the point.
    """
    if type(system).jacobian is PiecewiseSystem.jacobian:
        return
    y, direction = _beside(system.differences(float(x[-1])), x)
    given = jacobian_at(system, y[:-1], float(y[-1]), character)

    def residual(y: Array) -> Array:
        return residual_at(system, y[:-1], float(y[-1]), character)

    what = f"jacobian in {system.label(character)}", "residual"
    _refuse(system, what, _wrong_row(residual, given, y, direction), y)


def refuse_wrong_gradients(system: PiecewiseSystem, x: Array) -> None:
    """Refuse gradients that are not those of the tests next to a point, as for H.

    Raises
    ------
    InvalidSystemError
    """
    if type(system).test_jacobian is PiecewiseSystem.test_jacobian:
        return
    y, direction = _beside(system.differences(float(x[-1])), x)
    given = system.test_jacobian(y[:-1], float(y[-1]))

    def tests(y: Array) -> Array:
        return np.array(system.test_functions(y[:-1], float(y[-1])), dtype=float)

    what = "test_jacobian", "test_functions"
    _refuse(system, what, _wrong_row(tests, given, y, direction), y)


def _beside(differences: Differences, x: Array) -> tuple[Array, Array]:
    """Return a point beside x, and a direction in which all steps stay in the interval."""
    direction = differences.scale * generic(len(x))
    y, reach = x + ASIDE * direction, max(STEPS) * abs(direction[-1])
    if differences.hi - differences.lo <= 2.0 * reach:
        direction[-1] = 0.0
    else:
        y[-1] = min(max(y[-1], differences.lo + reach), differences.hi - reach)
    return y, direction


def _wrong_row(
    function: Callable[[Array], Array], given: Matrix, x: Array, direction: Array
) -> int | None:
    """Return the row in which a derivative is not that of a function, None where it is."""
    slopes, terms = product(given, direction), product(abs(given), np.abs(direction))
    quotients: list[Array] = []
    wrong = np.ones(len(slopes), dtype=bool)
    for step in STEPS:
        forth, back = function(x + step * direction), function(x - step * direction)
        quotients.append((forth - back) / (2.0 * step))
        sizes = terms + np.abs(quotients[0])
        wrong &= np.abs(quotients[-1] - slopes) > WRONG * sizes
        for one, other in pairwise(quotients):
            wrong &= np.abs(one - other) <= ALIKE * sizes
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
