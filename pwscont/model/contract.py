"""Shapes that a system's methods must return, checked once before any work."""

from __future__ import annotations

from typing import Any

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.errors import InvalidSystemError
from pwscont.model.system import PiecewiseSystem


def check_contract(system: PiecewiseSystem, z: Array, alpha: float) -> None:
    """Call every method of a system at a point and check the shapes of what it returns.

    Raises
    ------
    InvalidSystemError
        Naming the method, what it returned and what it should return.
    """
    size = system.size
    tests = system.test_functions(z, alpha)
    _expect(system, "test_functions", tests, (np.size(tests),))
    character = system.character(z, alpha)
    m = len(character.signs)
    _expect(system, "residual", system.residual(z, alpha, character), (size,))
    _expect(system, "jacobian", system.jacobian(z, alpha, character), (size, size + 1))
    _expect(system, "test_jacobian", system.test_jacobian(z, alpha), (m, size + 1))
    beyond = [i for i in system.bounding_tests(character) if not 0 <= i < m]
    if beyond:
        raise InvalidSystemError(
            f"{type(system).__name__}.bounding_tests returned {beyond}, but there are {m} tests"
        )


def checked_size(system: PiecewiseSystem) -> int:
    """Return the number of unknowns, or say that the system has none."""
    size = getattr(system, "size", None)
    if not isinstance(size, int | np.integer) or size < 1:
        raise InvalidSystemError(
            f"{type(system).__name__}.size must be the number of unknowns, got {size!r}"
        )
    return int(size)


def _expect(system: PiecewiseSystem, method: str, value: Any, shape: tuple[int, ...]) -> None:
    got = getattr(value, "shape", None)
    if got != shape:
        what = f"shape {got}" if got is not None else f"{type(value).__name__}"
        raise InvalidSystemError(
            f"{type(system).__name__}.{method} returned {what} where an array of shape {shape} "
            "is expected"
        )
