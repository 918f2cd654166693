"""The contract of a system, checked before any work: shapes of all values, and derivatives.

Derivatives that a user gives are compared with differences of the user's functions along a generic
direction, beside the point, because wrong terms may vanish at special points, such as z = 0.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from inspect import isfunction, ismethod, signature
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from pwscont.basics import arrays
from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.basics.printing import at, short
from pwscont.basics.quantities import checked_names
from pwscont.basics.rounding import EPS, GUARD
from pwscont.system import values
from pwscont.system.abilities import check_abilities, shown_size
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.system.values import broken

#: The methods that a system may override -> the arguments in words.
METHODS = {
    name: ", ".join(signature(method).parameters)
    for kind in (PiecewiseSystem, SlicewiseLinearSystem, PiecewiseLinearSystem)
    for name, method in vars(kind).items()
    if isfunction(method) and not name.startswith("_")
}
#: The attributes of a system that are no methods.
VALUES = ("domain", "degree", "unique", "line_styles")
#: Most unknowns of a system: a larger number is a slip of the pen.
MOST_UNKNOWNS = 10**7
#: Largest difference of two values at the same point, relative to the terms: threads sum in another
#: order.
MOST_ROUNDING = EPS**0.75

#: What is said of values that differ at one point.
NOT_ON_CHANCE = "H must depend on (z, alpha) only, not on chance or on earlier points"
#: Character, tests, gradients, residual and Jacobian of a system at a point.
Values: TypeAlias = tuple[Character, Array, Matrix, Array, Matrix]


def check_contract(system: PiecewiseSystem, z: Array, alpha: float) -> Values:
    """Return the values of all methods of a system at a point, or refuse values that do not fit."""
    given, tests = z.copy(), system.test_functions(z, alpha)
    tests = values.own_array(system, "test_functions", tests, (np.size(tests),))
    character, m = Character.of(tests), len(tests)
    residual = _residual_of_kept(system, given.copy(), alpha, character)
    is_linear = isinstance(system, PiecewiseLinearSystem)  # a promise that is checked says more
    again = residual if is_linear else residual_at(system, z, alpha, character)
    jacobian = jacobian_at(system, z, alpha, character)
    gradients = system.test_jacobian(z, alpha)
    values.expect(system, "test_jacobian", gradients, (m, system.size + 1))
    values.refuse_unusual(system, "test_jacobian", gradients)
    if not isinstance(label := system.label(character), str):
        raise broken(system, "label", f"must return a text, got {label!r}")
    found = system.bounding_tests(character)
    is_listed = isinstance(found, range | list | tuple | np.ndarray)
    if not is_listed or (bounding := arrays.indices(found)).ndim != 1:
        words = f"must return a sequence of the numbers of tests, got {short(repr(found))}"
        raise broken(system, "bounding_tests", words)
    if beyond := bounding[(bounding < 0) | (bounding >= m)].tolist():
        raise broken(system, "bounding_tests", f"returned {beyond}, but there are {m} tests")
    if not arrays.is_everywhere(z == given):
        raise InvalidSystemError(
            f"a method of {type(system).__name__} writes to its argument z; let it work on a copy"
        )
    if not np.array_equal(residual, again, equal_nan=True):
        apart = np.abs(again - residual)
        terms = arrays.product(abs(jacobian), np.abs(arrays.joined(z, alpha)))
        # sums in another order are the same value
        if (apart > MOST_ROUNDING * (np.abs(residual) + np.abs(again) + terms)).any():
            i = int(np.argmax(apart))
            words = f"returned {residual[i]} and then {again[i]} in row {i} at the same point"
            raise broken(system, "residual", f"{words}: {NOT_ON_CHANCE}")
    return character, tests, gradients, residual, jacobian


def _residual_of_kept(
    system: PiecewiseSystem, z: Array, alpha: float, character: Character
) -> Array:
    """Return the residual at a state that cannot be written to."""
    z.setflags(write=False)
    try:
        return residual_at(system, z, alpha, character)
    except ValueError as error:
        if "read-only" not in str(error):
            raise
        words = "writes to its argument z; let it work on a copy"
        raise broken(system, "residual", words) from error


def check_in_domain(system: PiecewiseSystem, alpha: float) -> None:
    """Refuse an alpha for which a system makes no sense."""
    low, high = system.domain
    if not low <= alpha <= high:
        where = f"the domain [{low}, {high}] of {type(system).__name__}"
        raise InvalidInputError(f"alpha = {alpha} is outside {where}")


def check_declaration(system: PiecewiseSystem) -> None:
    """Refuse attributes, names or methods that do not fit, before any method is used."""
    check_attributes(system)
    if type(system).names is not PiecewiseSystem.names:
        found, size = system.names(), shown_size(system)
        if isinstance(found, str) or not isinstance(found, Iterable):
            raise broken(system, "names()", f"must return {size} texts, got {found!r}")
        for name, number in Counter(checked_names(tuple(found), size)).items():
            if number > 1:
                raise broken(system, "names()", f"gives several unknowns the name {name!r}")
    check_abilities(system)


def check_cells(system: PiecewiseSystem) -> None:
    """Refuse cells() that yields no characters; cells() may ask for tests within the interval."""
    if getattr(system.cells, "__func__", None) is not PiecewiseSystem.cells:
        cells = system.cells()
        first = next(iter(cells), Character([])) if isinstance(cells, Iterable) else cells
        if not isinstance(first, Character):
            raise broken(system, "cells()", f"must yield a Character for each cell, got {first!r}")


def check_attributes(system: PiecewiseSystem) -> None:
    """Refuse a value where a method belongs, a method where a value does, and a wrong size."""
    size = getattr(system, "size", None)
    if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
        raise broken(system, "size", f"must be an int, the number of unknowns, got {size!r}")
    if size > MOST_UNKNOWNS:
        words = f"is {size}; more than {MOST_UNKNOWNS} do not fit into the memory of a computer"
        raise broken(system, "size", words)
    for name, arguments in METHODS.items():
        if not callable(found := getattr(system, name, len)):  # another kind has no such method
            words = f"must be a method, def {name}({arguments}), got {short(repr(found))}"
            raise broken(system, name, words)
        if ismethod(found) and not str(found.__module__).startswith("pwscont."):
            _check_arguments(found.__func__, name, arguments)
    for name in VALUES:
        if callable(getattr(system, name)):
            raise broken(system, name, f"must be a value, not a method: {name} = ...")
    if not isinstance(degree := system.degree, int | np.integer | None):
        raise broken(system, "degree", f"must be a whole number or None, got {degree!r}")


@lru_cache(maxsize=1024)  # signatures cost more than all other checks
def _check_arguments(method: Callable[..., Any], name: str, arguments: str) -> None:
    """Refuse a method that does not take the arguments that a run gives."""
    try:
        signature(method).bind(*arguments.split(", "))
    except TypeError:
        words = f"must be def {name}({arguments}), but takes {signature(method)}"
        raise InvalidSystemError(f"{method.__qualname__} {words}") from None


def checked_scale(system: PiecewiseSystem, magnitudes: Any) -> Array:
    """Return typical magnitudes, shape (n,), or refuse other than n positive numbers."""
    scale = arrays.finite_array(f"{type(system).__name__}.scale()", magnitudes)
    if scale.shape != (system.size,) or not arrays.is_everywhere(scale > 0.0):
        raise broken(system, "scale()", f"must return {system.size} positive numbers")
    return scale


def checked_magnitudes(magnitudes: Any, size: int) -> Array | None:
    """Return typical magnitudes that a caller gives, shape (size,), or refuse other numbers."""
    if magnitudes is None:
        return None
    scale = arrays.finite_array("scale", magnitudes)
    if scale.shape not in ((), (1,), (size,)) or not (scale > 0.0).all():
        raise InvalidInputError(f"scale must be {size} positive numbers, got {magnitudes!r}")
    return np.broadcast_to(scale, (size,)).copy()


def residual_at(system: PiecewiseSystem, z: Array, alpha: float, character: Character) -> Array:
    """Return H_chi(z, alpha), shape (n,), in a new array, or refuse another shape."""
    found = system.residual(z, alpha, character)
    return values.own_array(system, "residual", found, (system.size,))


def jacobian_at(system: PiecewiseSystem, z: Array, alpha: float, character: Character) -> Matrix:
    """Return dH_chi / d(z, alpha), shape (n, n + 1), as a copy, or refuse another shape."""
    jacobian = system.jacobian(z, alpha, character)
    values.expect(system, "jacobian", jacobian, (system.size, system.size + 1))
    if isinstance(jacobian, np.ndarray):
        return np.array(jacobian, dtype=float, order="C")  # rounding of sums depends on the order
    return values.own_matrix(jacobian.tocsr() if values.has_scalar_products(jacobian) else jacobian)


def equations_in_magnitudes(
    system: PiecewiseSystem, z: Array, alpha: float, scale: Array, cell: Character | None = None
) -> tuple[Array, Array, Array] | None:
    """Return scaled H and dH/dz, or dH/d(z, alpha), and the divisors of rows; None if infinite."""
    character = cell or system.character(z, alpha)
    residual = residual_at(system, z, alpha, character)
    jacobian = arrays.dense(jacobian_at(system, z, alpha, character))[:, : len(scale)] * scale
    rows = np.abs(jacobian).max(axis=1)
    rows[rows == 0.0] = 1.0
    if not np.isfinite(rows).all():
        return None
    residual, jacobian = residual / rows, jacobian / rows[:, np.newaxis]
    return (residual, jacobian, rows) if arrays.are_finite(residual) else None


#: Distance from a point at which derivatives are compared, in typical magnitudes.
DISTANCE_TO_POINT = 0.01
#: Lengths of steps, in typical magnitudes; the first length nearly always confirms the derivative.
STEPS = (1e-5, 1e-4, 1e-6)
#: Still shorter steps, tried before a derivative is called wrong: magnitudes may be far too large.
FINEST = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
#: Largest error of a right derivative, and largest difference of quotients that agree, as parts of
#: the terms of the derivative.
WRONG_SLOPE, EQUAL_QUOTIENTS = 1e-4, 1e-5
#: Largest change of a function within a step by the slope, in magnitudes of the function.
WITHIN = 100.0


def refuse_wrong_jacobian(system: PiecewiseSystem, character: Character, x: Array) -> None:
    """Refuse a Jacobian that is not the derivative of H next to a point."""
    if system.knows_jacobian:  # differences need no check

        def residual(y: Array) -> Array:
            return residual_at(system, y[:-1], float(y[-1]), character)

        jacobian = partial(jacobian_at, system, character=character)
        what = f"jacobian in {system.label(character)}"
        _refuse_wrong_derivative(system, what, jacobian, residual, x)


def refuse_wrong_gradients(system: PiecewiseSystem, x: Array) -> None:
    """Refuse gradients that are not the derivatives of the tests next to a point, as for H."""
    if getattr(system.test_jacobian, "__func__", None) is not PiecewiseSystem.test_jacobian:

        def test_functions(y: Array) -> Array:
            return np.array(system.test_functions(y[:-1], float(y[-1])), dtype=float)

        _refuse_wrong_derivative(system, "test_jacobian", system.test_jacobian, test_functions, x)


def _refuse_wrong_derivative(
    system: PiecewiseSystem,
    what: str,
    derivative: Callable[[Array, float], Matrix],
    function: Callable[[Array], Array],
    at_point: Array,
) -> None:
    """Refuse a derivative with a row that is not the function's, along a direction by a point.

    Quotients by steps of several lengths that differ among themselves say nothing, nor do values
    that are not finite, or steps that are lost in the rounding of the point.
    """
    differences = system.differences(float(at_point[-1]))
    direction = differences.scale * arrays.generic(len(at_point))
    x, reach = at_point + DISTANCE_TO_POINT * direction, max(STEPS) * abs(direction[-1])
    if differences.hi - differences.lo <= 2.0 * reach:
        direction[-1] = 0.0
    else:  # all steps stay in the interval
        x[-1] = min(max(x[-1], differences.lo + reach), differences.hi - reach)
    matrix = derivative(x[:-1], float(x[-1]))
    slopes = arrays.product(matrix, direction)
    terms = arrays.product(abs(matrix), np.abs(direction))
    terms[~np.isfinite(terms)] = 0.0  # nan is wrong where the function has a slope
    quotients: list[Array] = []
    wrong = np.ones(len(slopes), dtype=bool)
    for step in STEPS:
        ahead, behind = x + step * direction, x - step * direction
        lost = np.abs((ahead - behind) / (2.0 * step) - direction)
        if (lost > EQUAL_QUOTIENTS * np.abs(direction)).any():
            return
        after, before = function(ahead), function(behind)
        quotients.append((after - before) / (2.0 * step))
        sizes = terms + np.abs(quotients[0])
        rounding = GUARD * EPS * (np.abs(after) + np.abs(before)) / step
        # a function that oscillates within the step has no slope that the step shows
        wrong &= ~(np.abs(slopes) * step > WITHIN * (np.abs(after) + np.abs(before)))
        wrong &= ~(np.abs(quotients[-1] - slopes) <= WRONG_SLOPE * sizes + rounding)
        for one, other in pairwise(quotients):
            wrong &= np.abs(one - other) <= EQUAL_QUOTIENTS * sizes
        if not wrong.any():
            return  # nearly always at once
    # terms that cancel may be far larger than their sum: tanh(z) + tanh(z - 1) + 1e-10 z
    for far in (x + direction, x - direction):
        rounding = np.fmax(rounding, GUARD * EPS * np.abs(function(far)) / min(STEPS))
    wrong &= ~(np.abs(quotients[-1] - slopes) <= rounding)
    for step in FINEST if wrong.any() else ():  # H may oscillate within all other steps
        ahead, behind = x + step * direction, x - step * direction
        apart = np.abs(function(ahead) - function(behind) - arrays.product(matrix, ahead - behind))
        wrong &= ~(apart < WRONG_SLOPE * arrays.product(abs(matrix), np.abs(ahead - behind)))
    if not wrong.any():
        return
    words = f"is wrong in row {np.flatnonzero(wrong)[0]}: it is not the derivative of"
    there = f"{function.__name__} at {at(x)}; check_system tells by how much"
    raise broken(system, what, f"{words} {there}")
