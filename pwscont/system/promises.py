"""The promises of a system, and the errors of a run about broken promises.

A function that is promised to be affine is compared with an affine model away from the point of the
matrix. The difference is measured by the terms, so that units and conditioning raise no alarm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import chain

import numpy as np

from pwscont.basics import arrays
from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.printing import at, short
from pwscont.basics.rounding import CONFIDENCE, EPS, GUARD
from pwscont.system import contract
from pwscont.system.box import Box
from pwscont.system.contract import Values
from pwscont.system.selection import Selection
from pwscont.system.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.system.values import broken, expect, refuse_infinite

#: Largest magnitude whose square, and whose inverse's square, are normal numbers.
LARGEST_TO_SQUARE = 1e150
#: Smallest terms of H whose sum loses no digits to underflow.
LEAST_TERMS = float(np.finfo(float).tiny) / EPS
#: Largest difference of a function promised to be affine from an affine model, as a part of the
#: function's terms: far more than rounding, far less than a curved function does over typical
#: magnitudes.
AFFINE_DEFECT = EPS**0.5
#: Largest value, as a part of the test's terms, of tests that may vanish at the same corner.
AT_CORNER = EPS**0.5
#: Least jump before a run, as a part of the terms: constants that cancel leave less by rounding.
GROSS = 1e-3
#: Number of points at which H is evaluated if a search found nothing.
PROBES = 8
#: Number of cells in which the size of a row is asked for.
CELLS = 8


def check_start(
    system: PiecewiseSystem, interval: tuple[float, float], z: Array, alpha: float
) -> None:
    """Refuse a system, fitted to the interval, that breaks contract or promises at a start."""
    values = contract.check_contract(system, z, alpha)
    character, tests, _, residual, jacobian = values
    terms = np.abs(residual) + arrays.product(abs(jacobian), system.differences(alpha).scale)
    small = np.flatnonzero((terms > 0.0) & (terms < LEAST_TERMS))
    if len(small):
        raise InvalidSystemError(
            f"row {small[0]} of {type(system).__name__}.residual is typically "
            f"{terms[small[0]]:.3g}, less than {LEAST_TERMS:.3g}, where numbers lose digits: "
            "multiply it by a constant"
        )
    x = arrays.joined(z, alpha)
    check_promises(system, interval, x, values)
    if not isinstance(system, PiecewiseLinearSystem):
        with np.errstate(all="ignore"):
            contract.refuse_wrong_jacobian(system, character, x)
            contract.refuse_wrong_gradients(system, x)
            _refuse_wrong_periods(system, x)
            if not isinstance(system, SlicewiseLinearSystem) and (tests == 0.0).any():
                _refuse_jump_beside(system, x)


def _refuse_jump_beside(system: PiecewiseSystem, x: Array) -> None:
    """Refuse a jump of H at a point where tests vanish, as at z = 0: Newton finds nothing."""
    scale = system.differences(float(x[-1])).scale
    aside = (EPS**0.5 * scale * arrays.generic(len(x)))[:-1]
    near = (system.character(x[:-1] + way, float(x[-1])) for way in (aside, -aside))
    one, other = (Selection(system, character) for character in near)
    here = one.residual(x)
    terms = np.abs(here) + arrays.product(abs(one.jacobian(x)), scale)
    if (np.abs(other.residual(x) - here) > GROSS * terms).any():  # never of one cell
        refuse_jump(one, other, x, np.zeros(len(x)), scale)


def _refuse_wrong_periods(system: PiecewiseSystem, x: Array) -> None:
    """Refuse a period of an unknown over which H changes, at a generic point."""
    period, alpha = Box.of(system).period, float(x[-1])
    scale = np.minimum(system.differences(alpha).scale, np.append(period, np.inf))
    z = (x + scale * arrays.generic(len(scale)))[:-1]
    for j in np.flatnonzero(np.isfinite(period)).tolist():
        here, there = (
            contract.residual_at(system, y, alpha, system.character(y, alpha))
            for y in (z, z + period[j] * (np.arange(len(z)) == j))
        )
        slopes = abs(contract.jacobian_at(system, z, alpha, system.character(z, alpha)))
        terms = np.abs(here) + np.abs(there) + arrays.product(slopes, scale)
        if (wrong := np.abs(there - here) > AFFINE_DEFECT * terms).any():
            row = int(np.flatnonzero(wrong)[0])
            words = f"gives {period[j]:.10g} for unknown {j}, but row {row} of H changes from "
            words += f"{here[row]:.6g} to {there[row]:.6g} over that period at alpha = {alpha:.6g}"
            raise broken(system, "periods()", words)


def check_promises(
    system: PiecewiseSystem, interval: tuple[float, float], x: Array, values: Values
) -> None:
    """Compare a system, fitted to the interval, with its promises at a point and a far point."""
    if not isinstance(system, SlicewiseLinearSystem):
        return
    character, tests, gradients, residual, jacobian = values
    if type(system).blocks is not SlicewiseLinearSystem.blocks:
        check_blocks(system, len(tests))
    dx = system.differences(float(x[-1])).scale * np.abs(arrays.generic(len(x)))
    lo, hi = interval
    is_straight = isinstance(system, PiecewiseLinearSystem)
    dx[-1] *= is_straight * ((hi - x[-1]) or (lo - x[-1])) / (hi - lo)
    if not arrays.are_finite(residual):
        words = f"returned {residual} at {at(x)}, where linear pieces are finite"
        raise broken(system, f"residual in {system.label(character)}", words)
    refuse_bent(system, character, x, dx, residual, jacobian)
    refuse_bent_tests(system, x, dx, tests, gradients)


def refuse_bent(
    system: PiecewiseSystem,
    character: Character,
    x: Array,
    dx: Array,
    residual: Array,
    jacobian: Matrix,
) -> None:
    """Refuse a selection whose value at ``x + dx`` is not what value and Jacobian at ``x`` say."""
    there = x + dx
    value = contract.residual_at(system, there[:-1], float(there[-1]), character)
    terms = arrays.product(abs(jacobian), np.abs(dx))
    excess = _bend(value, residual, arrays.product(jacobian, dx), terms)
    if arrays.is_everywhere(excess <= 0.0):
        return  # nearly always
    refuse_infinite(system, f"jacobian in {system.label(character)}", jacobian)
    # the size of each row over several cells: in a single cell terms may cancel
    cells = (Character.of(arrays.generic(len(character.array), shift)) for shift in range(CELLS))
    rows = [contract.residual_at(system, there[:-1], float(there[-1]), cell) for cell in cells]
    if (excess > GUARD * EPS * np.abs(rows).max(axis=0)).any():
        raise _bent(system, f"residual in {system.label(character)}", dx)


def refuse_bent_tests(
    system: PiecewiseSystem, x: Array, dx: Array, tests: Array, gradients: Matrix
) -> None:
    """Refuse test functions that are not affine, or whose changes have no normal squares."""
    there = system.test_functions((x + dx)[:-1], float(x[-1] + dx[-1]))
    expect(system, "test_functions", there, tests.shape)
    if not len(tests):
        return
    changes, least = arrays.product(abs(gradients), np.abs(dx)), 1.0 / LARGEST_TO_SQUARE
    bad = np.flatnonzero((changes > LARGEST_TO_SQUARE) | ((changes < least) & (changes > 0.0)))
    if len(bad):
        raise InvalidSystemError(
            f"{system.test_name(int(bad[0]))} of {type(system).__name__} typically changes by "
            f"{changes[bad[0]]:.3g}, outside the range [{least:g}, {LARGEST_TO_SQUARE:g}] in which "
            "squares can be computed: multiply the test function by a constant"
        )
    excess = _bend(there, tests, arrays.product(gradients, dx), changes)
    if arrays.is_everywhere(excess <= 0.0):
        return
    refuse_infinite(system, "test_jacobian", gradients)
    excess -= GUARD * EPS * arrays.product(abs(gradients), np.abs(x))  # far from the origin
    if (excess > 0.0).any():
        raise _bent(system, "test_functions", dx)


def _bend(value: Array, origin: Array, change: Array, terms: Array) -> Array:
    """Return how far ``value`` is off ``origin + change``, beyond a part of all terms."""
    terms = np.abs(value) + np.abs(origin) + terms
    return np.abs(value - origin - change) - AFFINE_DEFECT * terms


def _bent(system: PiecewiseSystem, what: str, dx: Array) -> InvalidSystemError:
    promise = next(b for b in type(system).__mro__ if b.__module__ == PiecewiseSystem.__module__)
    where = "(z, alpha)" if dx[-1] else "z at fixed alpha"
    return InvalidSystemError(
        f"{type(system).__name__} is a {promise.__name__}, but {what} is not affine in {where}, or "
        "its Jacobian is wrong: derive from PiecewiseSystem, or run check_system; rounding of "
        "large constants that cancel looks like a bend, too: move the origin of alpha or z"
    )


def refuse_wrong_ray(selection: Selection, x: Array, dx: Array, scale: Array) -> None:
    """Refuse a ray from ``x`` to ``x + dx`` on which the selection bends, or on which H changes.

    A ray that was found from the cell before (docs/theory, F11) shows a wrong Jacobian so.
    """
    # an error of the direction changes no second difference
    start, middle, end = (selection.residual(x + part * dx) for part in (0.0, 0.5, 1.0))
    sizes, length = abs(selection.jacobian(x)), float(np.abs(dx / scale).max())
    of_point, typical = sizes @ (np.abs(x) + np.abs(dx)), sizes @ scale
    terms = of_point + np.abs(start) + np.abs(middle) + np.abs(end)
    if (np.abs(start - 2.0 * middle + end) > AFFINE_DEFECT * terms + GUARD * EPS * typical).any():
        raise _bent(selection.system, f"residual in {selection.label}", dx)
    excess = np.abs(end - start) - AFFINE_DEFECT * (of_point + length * typical)
    if excess[row := int(np.argmax(excess))] > 0.0:
        raise InvalidSystemError(
            f"{type(selection.system).__name__}.residual and jacobian disagree in row {row} in "
            f"{selection.label}, reached at alpha = {x[-1]:.10g}: a Jacobian is wrong, or this "
            "selection and the one before do not agree on all of their interface; run check_system"
        )


def refuse_jump(one: Selection, other: Selection, x: Array, error: Array, scale: Array) -> None:
    """Refuse selections that differ by more than rounding at a point that both cells touch."""
    jump = np.abs(other.residual(x) - one.residual(x))
    uncertain = GUARD * EPS * (np.abs(x) + scale) + CONFIDENCE * error
    slopes = abs(one.jacobian(x)), abs(other.jacobian(x))
    excess = jump - sum(each @ uncertain for each in slopes)
    typical, near = np.abs(x) + scale, set[int]()
    aside = np.append((arrays.generic(len(x)) * scale)[:-1], 0.0)
    for side in (one, other) if (excess > 0.0).any() else ():
        sizes = abs(side.test_gradients(x)) @ typical
        near |= set(side.bounding[np.abs(side.tests(x)) <= AT_CORNER * sizes].tolist())
        # slopes may vanish together at the point, and be huge on one side, as of exp
        terms = np.fmin(*(abs(side.jacobian(y)) @ typical for y in (x - aside, x + aside)))
        excess -= GUARD * EPS * np.nan_to_num(terms, posinf=0.0)
    if len(near) > 1:  # the signs of these tests may name a cell across a corner
        excess -= AT_CORNER * (jump + sum(each @ typical for each in slopes))
    row = int(np.argmax(excess))
    if excess[row] > 0.0 and _meet((one, other), x, uncertain, scale):
        name, size = type(one.system).__name__, float(jump[row])
        raise InvalidSystemError(
            f"{name}.residual jumps by {size:.3g} in row {row} where {one.label} and {other.label} "
            f"meet, at alpha = {x[-1]:.10g}, z = {np.array2string(x[:-1], threshold=6)}: H must be "
            "continuous, so both selections must agree there, and the test function needs a slope "
            "where it is zero; run check_system; rounding beside a huge coefficient and a lower "
            "bound of sw.clip above the upper bound look like a jump, too"
        )


def _meet(sides: tuple[Selection, Selection], x: Array, uncertain: Array, scale: Array) -> bool:
    """Tell whether the tests let a point lie in the closed cells of two selections."""
    for side in sides:
        gradients = np.abs(arrays.dense(side.test_gradients(x)))
        terms = gradients * (np.abs(x) + scale)
        least = np.where(terms > 0.0, terms, np.inf).min(axis=1, initial=np.inf)
        if (GUARD * EPS * terms.sum(axis=1) > least).any():
            return False  # rounding of a term hides another term, as with friction of 1e13
        if (side.tests(x) < -(gradients @ uncertain)).any():
            return False
    return True


def refuse_undefined(system: PiecewiseSystem, interval: tuple[float, float]) -> None:
    """Refuse a system whose H is finite, or other than zero, at no point tried around zero."""
    lo, hi = interval
    scale, values = system.differences(lo).scale[:-1], []
    guesses = [np.zeros(len(scale))]
    guesses += [scale * arrays.generic(len(scale), k) for k in range(1, PROBES)]
    probes = [(z.copy(), alpha) for alpha in (lo, 0.5 * (lo + hi), hi) for z in guesses]
    for z, alpha in probes:
        with np.errstate(all="ignore"):
            tests = system.test_functions(z, alpha)
            residual = np.array(system.residual(z, alpha, Character.of(tests)), dtype=float)
        if np.isfinite(tests).all() and np.isfinite(residual).all():
            values.append(residual)
    if not values:
        words = f"is finite at none of {len(probes)} points, such as z = 0 at alpha = {lo:.6g}"
        words += " (1 / 0 counts as infinite): trace() from a point where H is defined, or mend H"
        raise broken(system, "residual or test_functions", words)
    if len(values) == len(probes) and not np.any(values):
        words = f"is zero at all of {len(probes)} points that were tried: every z is a solution"
        raise broken(system, "residual", words)


def check_blocks(system: SlicewiseLinearSystem, tests: int) -> None:
    """Refuse blocks that do not fit the system, or claim the same rows or tests."""
    blocks = system.blocks()
    if not isinstance(blocks, Sequence) or not all(isinstance(block, Block) for block in blocks):
        raise broken(system, "blocks()", f"must return Blocks, got {short(repr(blocks))}")
    _check_owners(system, "row", system.size, [block.rows for block in blocks])
    _check_owners(system, "test function", tests, [block.tests for block in blocks])
    for number, block in enumerate(blocks):
        if set(map(len, block.modes)) != {len(block.tests)}:
            words = f"every mode of block {number} needs {len(block.tests)} signs"
            raise broken(system, "blocks():", f"{words}, one for each of its tests")


def checked_necessary(system: SlicewiseLinearSystem, alpha: float) -> tuple[Array, Array]:
    """Return A and b, dense, of the inequalities A z + b >= 0 that all solutions fulfil."""
    necessary = system.necessary(alpha)
    if not (isinstance(necessary, tuple | list) and len(necessary) == 2):
        raise broken(system, "necessary()", f"must return (A, b), got {short(repr(necessary))}")
    A, b = arrays.dense(necessary[0]), np.asarray(necessary[1])
    if b.ndim != 1 or A.shape != (len(b), system.size):
        words = f"must return A of shape (l, {system.size}) and b of shape (l,), got shapes"
        raise broken(system, "necessary()", f"{words} {A.shape} and {b.shape}")
    return A, b


def _check_owners(
    system: SlicewiseLinearSystem, what: str, limit: int, claims: list[tuple[int, ...]]
) -> None:
    """Refuse rows or tests that do not exist, or that several blocks claim."""
    for index, times in Counter(chain.from_iterable(claims)).items():
        if not 0 <= index < limit:
            words = f"there is no {what} {index}, only 0 to {limit - 1}"
            raise broken(system, "blocks():", words)
        if times > 1:
            words = f"{what} {index} is claimed {times} times, but blocks choose their modes"
            how = "join these blocks, or make each switch an unknown of its own"
            row = "y = max(a, b) with the row y - a or y - b"
            raise broken(system, "blocks():", f"{words} independently; {how}: {row}")
