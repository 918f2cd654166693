"""Values of a user's methods: copied, and checked for their shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.errors import InvalidSystemError

#: Kinds of numbers that are real: floats, integers, booleans.
REAL = "fiub"
FLOAT = np.dtype(float)


def own_array(system: object, method: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a copy of a value: its owner may use the same array for the next one.

    Raises
    ------
    InvalidSystemError
        If the value is no array of that shape, even if earlier values were.
    """
    return checked_array(system, method, value, shape).copy()


def checked_array(system: object, method: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a value itself where it is an array of that shape, to be copied or used up at once.

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
    """Return a copy of a matrix, dense or sparse: its owner may use the same one for the next."""
    return matrix.copy() if isinstance(matrix, np.ndarray) or sp.issparse(matrix) else matrix


def checked_matrix(system: object, method: str, matrix: Matrix, shape: tuple[int, ...]) -> Matrix:
    """Return a matrix itself where it is one of that shape, to be used up at once.

    Raises
    ------
    InvalidSystemError
        If it is no matrix of that shape, even if earlier ones were.
    """
    if type(matrix) is np.ndarray and matrix.dtype is FLOAT and matrix.shape == shape:
        return matrix  # nearly always
    expect(system, method, matrix, shape)
    return np.array(matrix, dtype=float) if isinstance(matrix, np.ndarray) else matrix


def expect(system: object, method: str, value: Any, shape: tuple[int, ...]) -> None:
    """Refuse a value of another shape."""
    got = getattr(value, "shape", None)
    if got != shape:
        what = f"shape {got}" if got is not None else f"{type(value).__name__}"
        raise InvalidSystemError(
            f"{type(system).__name__}.{method} returned {what} where an array of shape {shape} "
            "is expected"
        )


def refuse_infinite(
    system: object, what: str, matrix: Matrix, why: str = "linear pieces have finite derivatives"
) -> None:
    """Refuse derivatives that are not finite where they must be, as those of linear pieces.

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
