"""Shapes that a system's methods must return: all before any work, those of values always."""

from __future__ import annotations

import numpy as np

from pwscont.foundation.arrays import Array
from pwscont.foundation.character import Character
from pwscont.foundation.errors import InvalidSystemError
from pwscont.model.shapes import expect, own_array
from pwscont.model.system import PiecewiseSystem


def check_contract(system: PiecewiseSystem, z: Array, alpha: float) -> None:
    """Call every method of a system at a point and check the shapes of what it returns.

    Raises
    ------
    InvalidSystemError
        Naming the method, what it returned and what it should return.
    """
    size, given = system.size, z.copy()
    tests = system.test_functions(z, alpha)
    expect(system, "test_functions", tests, (np.size(tests),))
    character = system.character(z, alpha)
    m = len(character.signs)
    expect(system, "residual", system.residual(z, alpha, character), (size,))
    expect(system, "jacobian", system.jacobian(z, alpha, character), (size, size + 1))
    expect(system, "test_jacobian", system.test_jacobian(z, alpha), (m, size + 1))
    beyond = [i for i in system.bounding_tests(character) if not 0 <= i < m]
    if beyond:
        raise InvalidSystemError(
            f"{type(system).__name__}.bounding_tests returned {beyond}, but there are {m} tests"
        )
    if not np.array_equal(z, given):
        raise InvalidSystemError(
            f"a method of {type(system).__name__} writes to its argument z; let it work on a copy"
        )


def checked_size(system: PiecewiseSystem) -> int:
    """Return the number of unknowns, or say that the system has none."""
    size = getattr(system, "size", None)
    if not isinstance(size, int | np.integer) or size < 1:
        raise InvalidSystemError(
            f"{type(system).__name__}.size must be the number of unknowns, got {size!r}"
        )
    return int(size)


def residual_at(system: PiecewiseSystem, z: Array, alpha: float, character: Character) -> Array:
    """Return H_chi(z, alpha), shape (n,), in an array of its own.

    Raises
    ------
    InvalidSystemError
        If it has another shape, which it need not have had before.
    """
    value = system.residual(z, alpha, character)
    return own_array(system, "residual", value, (system.size,))
