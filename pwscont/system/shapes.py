"""Values of a user's methods: copied, with a check of the shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.errors import InvalidSystemError

#: Kinds of numbers that are real: floats, integers, booleans.
REAL = "fiub"
#: Kinds that are computed with like numbers: booleans are not.
NUMBERS = "fiu"
FLOAT = np.dtype(float)


def own_array(system: object, method: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a copy of a value, as the value's owner may reuse the array.

    Raises
    ------
    InvalidSystemError
        If the value is no array of that shape, even if earlier values were.
    """
    return checked_array(system, method, value, shape).copy()


def checked_array(system: object, method: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a value of the given shape itself, for use before the next value.

    Raises
    ------
    InvalidSystemError
        If the value is no array of that shape, even if earlier values were.
    """
    if type(value) is np.ndarray and value.dtype is FLOAT and value.shape == shape:
        return value  # nearly always
    expect(system, method, value, shape)
    if value.dtype.kind not in REAL:
        raise InvalidSystemError(
            f"{type(system).__name__}.{method} returned numbers of type {value.dtype} where real "
            "ones are expected"
        )
    return np.array(value, dtype=float)


def own_matrix(matrix: Matrix) -> Matrix:
    """Return a copy of a dense or sparse matrix, as the matrix's owner may reuse the memory."""
    return matrix.copy() if isinstance(matrix, np.ndarray) or sp.issparse(matrix) else matrix


def checked_matrix(system: object, method: str, matrix: Matrix, shape: tuple[int, ...]) -> Matrix:
    """Return a matrix of the given shape itself, for use before the next value.

    Raises
    ------
    InvalidSystemError
        If the value is no matrix of that shape, even if earlier values were.
    """
    if type(matrix) is np.ndarray and matrix.dtype is FLOAT and matrix.shape == shape:
        return matrix  # nearly always
    expect(system, method, matrix, shape)
    if isinstance(matrix, np.ndarray):
        return np.array(matrix, dtype=float)
    return matrix.tocsr() if _has_scalar_products(matrix) else matrix


def expect(system: object, method: str, value: Any, shape: tuple[int, ...]) -> None:
    """Refuse a value of another shape."""
    got = getattr(value, "shape", None)
    if got != shape:
        what = f"shape {got}" if got is not None else f"{type(value).__name__}"
        raise InvalidSystemError(
            f"{type(system).__name__}.{method} returned {what} where an array of shape {shape} "
            "is expected"
        )


def refuse_unusual(system: object, method: str, matrix: Matrix) -> None:
    """Refuse a matrix that is not computed with like an array, or whose entries are no numbers.

    Raises
    ------
    InvalidSystemError
    """
    kind, dtype = type(matrix), getattr(matrix, "dtype", FLOAT)
    is_other = isinstance(matrix, np.ndarray) and kind is not np.ndarray
    if is_other or dtype.kind not in NUMBERS or _has_scalar_products(matrix):
        raise InvalidSystemError(
            f"{type(system).__name__}.{method} returned a {kind.__module__}.{kind.__qualname__} of "
            f"{dtype}: return an array, or a sparse matrix by rows (tocsr), of floats"
        )


def _has_scalar_products(matrix: Matrix) -> bool:
    """Tell whether scipy mistakes the products of a matrix of a single row for scalars."""
    return isinstance(matrix, sp.coo_array) and matrix.shape[0] == 1


def refuse_infinite(
    system: object, what: str, matrix: Matrix, why: str = "linear pieces have finite derivatives"
) -> None:
    """Refuse derivatives that are not finite where finite derivatives are due, as in linear pieces.

    Raises
    ------
    InvalidSystemError
    """
    lost = np.flatnonzero(~np.isfinite(abs(matrix) @ np.ones(matrix.shape[1])))
    if len(lost):
        raise InvalidSystemError(
            f"{type(system).__name__}.{what} returned numbers that are not finite in row "
            f"{lost[0]}, and {why}"
        )
