"""What a user's methods return: values of the right shape, copied, and nan outside the domain.

Trial points lie anywhere: an error as of math.exp(1000) means the same as nan, that H is not
defined at the point. Other errors, such as a ValueError for shapes that do not fit, are mistakes.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix, generic
from pwscont.basics.errors import InvalidSystemError

#: Kinds of numbers that are real: floats, integers, booleans.
REAL = "fiub"
#: Kinds that are computed with like numbers: booleans are not.
NUMBERS = "fiu"
FLOAT = np.dtype(float)


def broken(system: object, what: str, words: str) -> InvalidSystemError:
    """Return the error for a method or attribute of a system that breaks the contract."""
    return InvalidSystemError(f"{type(system).__name__}.{what} {words}")


def own_array(system: object, method: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a copy of a value, as the value's owner may reuse the array."""
    return checked_array(system, method, value, shape).copy()


def checked_array(system: object, method: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a value of this shape itself, for use before the next value, or refuse the value."""
    if type(value) is np.ndarray and value.dtype is FLOAT and value.shape == shape:
        return value  # nearly always
    expect(system, method, value, shape)
    if value.dtype.kind not in REAL:
        words = f"returned numbers of type {value.dtype} where real ones are expected"
        raise broken(system, method, words)
    return np.array(value, dtype=float)


def own_matrix(matrix: Matrix) -> Matrix:
    """Return a copy of a dense or sparse matrix, as the matrix's owner may reuse the memory."""
    return matrix.copy() if isinstance(matrix, np.ndarray) or sp.issparse(matrix) else matrix


def expect(system: object, method: str, value: Any, shape: tuple[int, ...]) -> None:
    """Refuse a value of another shape."""
    got = getattr(value, "shape", None)
    if got != shape:
        what = f"shape {got}" if got is not None else f"{type(value).__name__}"
        hint = ": numpy.array makes one" if isinstance(value, list | tuple) else ""
        words = f"returned {what} where an array of shape {shape} is expected{hint}"
        raise broken(system, method, words)


def refuse_unusual(system: object, method: str, matrix: Matrix) -> None:
    """Refuse a matrix that is not computed with like an array, or whose entries are no numbers."""
    kind, dtype = type(matrix), getattr(matrix, "dtype", FLOAT)
    is_other = isinstance(matrix, np.ndarray) and kind is not np.ndarray
    if is_other or dtype.kind not in NUMBERS or has_scalar_products(matrix):
        words = f"returned a {kind.__module__}.{kind.__qualname__} of {dtype}"
        what = "return an array, or a sparse matrix by rows (tocsr), of floats"
        raise broken(system, method, f"{words}: {what}")


def has_scalar_products(matrix: Matrix) -> bool:
    """Tell whether scipy mistakes the products of a matrix of a single row for scalars."""
    return isinstance(matrix, sp.coo_array) and matrix.shape[0] == 1


def refuse_infinite(
    system: object, what: str, matrix: Matrix, why: str = "linear pieces have finite derivatives"
) -> None:
    """Refuse derivatives that are not finite where finite derivatives are due."""
    lost = np.flatnonzero(~np.isfinite(abs(matrix) @ np.ones(matrix.shape[1])))
    if len(lost):
        words = f"returned numbers that are not finite in row {lost[0]}, and {why}"
        raise broken(system, what, words)


#: The guarded methods: methods of (z, alpha) that return numbers.
GUARDED = ("test_functions", "residual", "jacobian", "test_jacobian")
#: Messages of functions of math about an argument outside the domain, in all versions of Python.
OUTSIDE = re.compile(r"math domain error|math range error|expected an? .* (input|argument)")
#: Most points at which tests are counted if the tests are not defined at the first points.
PROBES = 8


def guard(method: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a method that returns nan where the method is not defined."""

    @wraps(method)
    def guarded(self: Any, *args: Any, **named: Any) -> Any:
        try:
            return method(self, *args, **named)
        except (ArithmeticError, ValueError) as error:
            is_of_arithmetic = isinstance(error, ArithmeticError | np.linalg.LinAlgError)
            if not (is_of_arithmetic or OUTSIDE.search(str(error))):
                raise
            is_test, n = name.startswith("test"), self.size
            rows = _number_of_tests(self, args, error) if is_test else n
            return np.full((rows, n + 1) if name.endswith("jacobian") else (rows,), np.nan)

    return guarded


def _number_of_tests(system: Any, args: tuple[Any, ...], error: Exception) -> int:
    """Return the number of test functions, from the first point where the tests are defined."""
    tests, alpha = type(system).test_functions, args[1] if len(args) > 1 else system.somewhere
    tests = getattr(tests, "__wrapped__", tests)
    for shift in range(PROBES):
        try:
            return len(tests(system, generic(system.size, float(shift)), alpha))
        except (ArithmeticError, ValueError):  # the method is not defined there either
            continue
    words = f"raises {type(error).__name__}: {error}, at all points that were tried"
    what = f"at alpha = {alpha:.10g}: let it return nan where it is undefined"
    raise broken(system, "test_functions", f"{words} {what}") from error
