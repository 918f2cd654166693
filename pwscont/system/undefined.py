"""A user's function that raises an error outside the domain, as math.exp(1000) does.

NumPy returns inf or nan, where math and plain Python raise. Trial points lie anywhere: such an
error means the same as nan, that H is not defined at the point.

Failure modes and answers
-------------------------
- A mistake of the user raises a ValueError as well, for shapes that do not fit: only errors of
  arithmetic and errors that functions of math raise are taken for nan.
- The number of test functions is not known where the tests raise: the tests are called elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from inspect import isfunction
from typing import Any

import numpy as np

from pwscont.basics.arrays import generic
from pwscont.basics.errors import InvalidSystemError

#: The guarded methods: methods of (z, alpha) that return numbers.
GUARDED = ("test_functions", "residual", "jacobian", "test_jacobian")
#: Messages of functions of math about an argument outside the domain, in all versions of Python.
OUTSIDE = re.compile(r"math domain error|math range error|expected an? .* (input|argument)")
#: Most points at which tests are counted if the tests are not defined at the first points.
PROBES = 8


class Undefined:
    """Lets the methods of subclasses return nan where a method is not defined."""

    __slots__ = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """Guard the methods that a subclass defines."""
        super().__init_subclass__(**options)
        for name in GUARDED:
            method = vars(cls).get(name)
            if isfunction(method) and not hasattr(method, "__isabstractmethod__"):
                setattr(cls, name, _guarded(method, name))


def _guarded(method: Callable[..., Any], name: str) -> Callable[..., Any]:
    @wraps(method)
    def guarded(self: Any, *args: Any, **named: Any) -> Any:
        try:
            return method(self, *args, **named)
        except (ArithmeticError, ValueError) as error:
            if not _is_of_arithmetic(error):
                raise
            return np.full(_shape(self, name, args, error), np.nan)

    return guarded


def _is_of_arithmetic(error: Exception) -> bool:
    """Tell whether an error says that numbers are outside of the domain of a function."""
    return isinstance(error, ArithmeticError | np.linalg.LinAlgError) or bool(
        OUTSIDE.search(str(error))
    )


def _shape(system: Any, name: str, args: tuple[Any, ...], error: Exception) -> tuple[int, ...]:
    """Return the shape of a method's value elsewhere."""
    rows = _number_of_tests(system, args, error) if name.startswith("test") else system.size
    return (rows, system.size + 1) if name.endswith("jacobian") else (rows,)


def _number_of_tests(system: Any, args: tuple[Any, ...], error: Exception) -> int:
    """Return the number of test functions, from the first point where the tests are defined."""
    tests, alpha = type(system).test_functions, args[1] if len(args) > 1 else system.somewhere
    tests = getattr(tests, "__wrapped__", tests)
    for shift in range(PROBES):
        try:
            return len(tests(system, generic(system.size, float(shift)), alpha))
        except (ArithmeticError, ValueError):  # the method is not defined there either
            continue
    raise InvalidSystemError(
        f"{type(system).__name__}.test_functions raises {type(error).__name__}: {error}, at all "
        f"points that were tried at alpha = {alpha:.10g}: let it return nan where it is undefined"
    ) from error
