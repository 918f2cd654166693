"""Shapes of values that a system returns: all checked before any work, shapes of H always."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from inspect import isfunction, signature
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import (
    Array,
    Indices,
    Matrix,
    finite_array,
    indices,
    is_everywhere,
    joined,
    product,
)
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.basics.looks import short
from pwscont.basics.quantities import checked_names
from pwscont.basics.rounding import EPS
from pwscont.system.abilities import check_abilities, shown_size
from pwscont.system.shapes import (
    checked_array,
    checked_matrix,
    expect,
    own_array,
    own_matrix,
    refuse_unusual,
)
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem

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


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """The values that a system returned at a point.

    Attributes
    ----------
    x : ndarray, shape (n + 1,)
    character : Character
    tests, residual : ndarray, shapes (m,) and (n,)
    gradients, jacobian : ndarray or sparse matrix, shapes (m, n + 1) and (n, n + 1)
    """

    x: Array
    character: Character
    tests: Array
    gradients: Matrix
    residual: Array
    jacobian: Matrix


def check_contract(system: PiecewiseSystem, z: Array, alpha: float) -> Sample:
    """Call every method of a system at a point and check the shapes of all values.

    Returns
    -------
    Sample

    Raises
    ------
    InvalidSystemError
        The message names the method, the value returned and the value expected.
    """
    given, tests = z.copy(), system.test_functions(z, alpha)
    tests = own_array(system, "test_functions", tests, (np.size(tests),))
    character, m = Character.of(tests), len(tests)
    residual = residual_at(system, z, alpha, character)
    jacobian = jacobian_at(system, z, alpha, character)
    gradients = system.test_jacobian(z, alpha)
    expect(system, "test_jacobian", gradients, (m, system.size + 1))
    refuse_unusual(system, "test_jacobian", gradients)
    if not isinstance(label := system.label(character), str):
        raise InvalidSystemError(f"{type(system).__name__}.label must return a text, got {label!r}")
    bounding = _bounding(system, character)
    if beyond := bounding[(bounding < 0) | (bounding >= m)].tolist():
        raise InvalidSystemError(
            f"{type(system).__name__}.bounding_tests returned {beyond}, but there are {m} tests"
        )
    if not is_everywhere(z == given):
        raise InvalidSystemError(
            f"a method of {type(system).__name__} writes to its argument z; let it work on a copy"
        )
    if not isinstance(system, PiecewiseLinearSystem):  # a promise that is checked says more
        terms = product(abs(jacobian), np.abs(joined(z, alpha)))
        _refuse_chance(system, residual, _again(system, given, alpha, character), terms)
    return Sample(joined(z, alpha), character, tests, gradients, residual, jacobian)


def _again(system: PiecewiseSystem, z: Array, alpha: float, character: Character) -> Array:
    """Return the residual at a state that cannot be written to."""
    z.setflags(write=False)
    try:
        return residual_at(system, z, alpha, character)
    except ValueError as error:
        if "read-only" not in str(error):
            raise
        raise InvalidSystemError(
            f"{type(system).__name__}.residual writes to its argument z; let it work on a copy"
        ) from error


def _refuse_chance(system: PiecewiseSystem, first: Array, second: Array, terms: Array) -> None:
    """Refuse a residual with two values at the same point, which no curve belongs to.

    Sums of the terms in another order, as threads make, are no reason.
    """
    if np.array_equal(first, second, equal_nan=True):
        return
    apart = np.abs(second - first)
    if (apart > MOST_ROUNDING * (np.abs(first) + np.abs(second) + terms)).any():
        i = int(np.argmax(apart))
        raise InvalidSystemError(
            f"{type(system).__name__}.residual returned {first[i]} and then {second[i]} in row {i} "
            "at the same point: H must depend on (z, alpha) only, and not on chance"
        )


def _bounding(system: PiecewiseSystem, character: Character) -> Indices:
    """Return the tests that bound a cell, or refuse indices that are no numbers of tests."""
    found = system.bounding_tests(character)
    if isinstance(found, range | list | tuple | np.ndarray):
        numbers = indices(found)
        if numbers.ndim == 1:
            return numbers
    raise InvalidSystemError(
        f"{type(system).__name__}.bounding_tests must return a sequence of the numbers of tests, "
        f"got {short(repr(found))}"
    )


def check_declaration(system: PiecewiseSystem) -> None:
    """Refuse attributes, names or methods of a system that do not fit, before any method is used.

    Raises
    ------
    InvalidSystemError
    """
    check_attributes(system)
    check_names(system)
    check_abilities(system)


def check_attributes(system: PiecewiseSystem) -> None:
    """Refuse a value where a method belongs, a method where a value does, and a wrong size.

    Raises
    ------
    InvalidSystemError
    """
    _check_size(system)
    kind = type(system).__name__
    if not _has_methods(system):
        for name, arguments in METHODS.items():
            if not callable(given := getattr(system, name, _check_size)):
                what = f"must be a method, def {name}({arguments}), got {short(repr(given))}"
                raise InvalidSystemError(f"{kind}.{name} {what}")
    for name in VALUES:
        if callable(getattr(system, name)):
            raise InvalidSystemError(f"{kind}.{name} must be a value, not a method: {name} = ...")


def _has_methods(system: PiecewiseSystem) -> bool:
    """Tell whether all methods are functions of the class, as nearly always."""
    kind = type(system)
    given = [getattr(kind, name, _check_size) for name in METHODS]
    return all(map(callable, given)) and METHODS.keys().isdisjoint(vars(system))


def _check_size(system: PiecewiseSystem) -> None:
    """Refuse a system without a number of unknowns."""
    size = getattr(system, "size", None)
    if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
        raise InvalidSystemError(
            f"{type(system).__name__}.size must be the number of unknowns, got {size!r}"
        )
    if size > MOST_UNKNOWNS:
        raise InvalidSystemError(
            f"{type(system).__name__}.size is {size}; more than {MOST_UNKNOWNS} unknowns do not "
            "fit into the memory of a computer"
        )


def checked_scale(system: PiecewiseSystem, magnitudes: Any) -> Array:
    """Return the typical magnitudes that a system gives, shape (n,).

    Raises
    ------
    InvalidInputError, InvalidSystemError
        If there are not as many positive numbers as unknowns.
    """
    scale = finite_array(f"{type(system).__name__}.scale()", magnitudes)
    if scale.shape != (system.size,) or not is_everywhere(scale > 0.0):
        raise InvalidSystemError(
            f"{type(system).__name__}.scale() must return {system.size} positive numbers"
        )
    return scale


def checked_magnitudes(magnitudes: Any, size: int) -> Array | None:
    """Return typical magnitudes that a caller gives, shape (size,), None where there are none.

    Raises
    ------
    InvalidInputError
        If the numbers are not positive or cannot be broadcast to that shape.
    """
    if magnitudes is None:
        return None
    scale = finite_array("scale", magnitudes)
    if scale.shape not in ((), (1,), (size,)) or not (scale > 0.0).all():
        raise InvalidInputError(f"scale must be {size} positive numbers, got {magnitudes!r}")
    return np.broadcast_to(scale, (size,)).copy()


def check_names(system: PiecewiseSystem) -> None:
    """Refuse names unless there is a text for each unknown and all names differ.

    Raises
    ------
    InvalidSystemError
    """
    if type(system).names is PiecewiseSystem.names:
        return
    method = f"{type(system).__name__}.names()"
    given = system.names()
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InvalidSystemError(f"{method} must return {shown_size(system)} texts, got {given!r}")
    names = checked_names(tuple(given), shown_size(system))
    if len(set(names)) < len(names):
        twice = next(name for name, number in Counter(names).items() if number > 1)
        raise InvalidSystemError(f"{method} gives several unknowns the name {twice!r}")


def check_parameter(parameter: Any) -> None:
    """Refuse a name of the parameter that is no text.

    Raises
    ------
    InvalidInputError
    """
    if not (isinstance(parameter, str) and parameter):
        raise InvalidInputError(f"parameter must be a text, got {parameter!r}")


def residual_at(system: PiecewiseSystem, z: Array, alpha: float, character: Character) -> Array:
    """Return H_chi(z, alpha), shape (n,), in a new array.

    Raises
    ------
    InvalidSystemError
        If the shape is wrong at this point, even if the shape was right at other points.
    """
    value = system.residual(z, alpha, character)
    return own_array(system, "residual", value, (system.size,))


def kink_at(system: PiecewiseLinearSystem, before: Character, after: Character, test: int) -> Array:
    """Return c of ``H_after - H_before = c kappa_test``, shape (n,), as stated by the system.

    The system may reuse the array for the next value.

    Raises
    ------
    InvalidSystemError
        If the value is no vector of that length.
    """
    return checked_array(system, "kink", system.kink(before, after, test), (system.size,))


def jacobian_at(system: PiecewiseSystem, z: Array, alpha: float, character: Character) -> Matrix:
    """Return dH_chi / d(z, alpha), shape (n, n + 1), as a dense or sparse copy.

    Raises
    ------
    InvalidSystemError
        If the shape is wrong at this point, even if the shape was right at other points.
    """
    return own_matrix(lent_jacobian_at(system, z, alpha, character))


def lent_jacobian_at(
    system: PiecewiseSystem, z: Array, alpha: float, character: Character
) -> Matrix:
    """Return dH_chi / d(z, alpha) without a copy, for use before the next value."""
    jacobian = system.jacobian(z, alpha, character)
    return checked_matrix(system, "jacobian", jacobian, (system.size, system.size + 1))
