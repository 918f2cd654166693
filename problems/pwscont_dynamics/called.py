"""Calls of a user's functions, with error messages that name the function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, final

import numpy as np

from pwscont import InvalidInputError, InvalidSystemError
from pwscont.extending import Array

#: (x, alpha) -> numbers.
Function: TypeAlias = Callable[[Array, float], Any]


@final
class Called:
    """A user's function of (x, alpha) that is to return some real numbers.

    Parameters
    ----------
    name : str
        The name of the function in messages.
    function : callable
    size : int
        How many numbers the function is to return.

    Raises
    ------
    InvalidInputError
        If the function cannot be called.
    """

    def __init__(self, name: str, function: Function, size: int) -> None:
        if not callable(function):
            raise InvalidInputError(f"{name} must be a function of (x, alpha), got {function!r}")
        self._name, self._function, self._size = name, function, size

    def __call__(self, x: Array, alpha: float) -> Array:
        """Return the numbers, shape (size,).

        Raises
        ------
        InvalidSystemError
            If the function fails, or does not return ``size`` numbers; the message names the
            function.
        """
        try:
            value = np.array(self._function(x.copy(), alpha), dtype=float).reshape(-1)
        except Exception as error:
            raise InvalidSystemError(
                f"{self._name} fails at x = {x.tolist()}, alpha = {alpha:.8g}: "
                f"{type(error).__name__}: {error}"
            ) from error
        if len(value) != self._size:
            raise InvalidSystemError(
                f"{self._name} must return {self._size} real numbers, and returns {len(value)}"
            )
        return value


def positive_whole(name: str, value: object) -> int:
    """Return a value as a positive whole number, or refuse the value by name."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise InvalidInputError(f"{name} must be a positive whole number, got {value!r}")
    return int(value)


def affine(A: Array, b: Array, c: Array, x: Array, alpha: float) -> Array:
    """Return A x + b + alpha c."""
    value: Array = A @ x + b + alpha * c
    return value


def first_coordinate(x: Array, alpha: float) -> float:
    """Return x_1."""
    return float(x[0])
