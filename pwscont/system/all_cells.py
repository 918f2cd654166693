"""All solutions at one alpha by trying every cell: slow, plain, and independent of the searches."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, Indices, dense
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS
from pwscont.system.blocks import characters, number_of_cells
from pwscont.system.system import SlicewiseLinearSystem

#: Most cells that are tried.
MOST_CELLS = 4096
#: A test that is smaller than this part of its terms has no certain sign.
UNCERTAIN = EPS**0.5


def signs_of_solutions(system: SlicewiseLinearSystem, alpha: float) -> list[int] | None:
    """Return the signs of det(dH/dz) of all solutions at one alpha.

    None where there are too many cells, or where a matrix is singular or a solution so close to an
    interface that its cell is not certain.
    """
    blocks = system.blocks()
    if number_of_cells(blocks) > MOST_CELLS:
        return None
    signs = []
    tests = 1 + max((max(block.tests, default=-1) for block in blocks), default=-1)
    for character in characters(blocks, tests):
        sign = _sign_in_cell(system, alpha, character)
        if sign is None:
            return None
        signs += [sign] if sign else []
    return signs


def _sign_in_cell(system: SlicewiseLinearSystem, alpha: float, character: Character) -> int | None:
    """Return sign det(dH/dz) at the solution in a cell, 0 without one, None where in doubt."""
    zero = np.zeros(system.size)
    matrix = dense(system.jacobian(zero, alpha, character))[:, :-1]
    rest = np.array(system.residual(zero, alpha, character), dtype=float)
    scale = np.abs(matrix).max(axis=1, initial=0.0)
    if not scale.all() or np.linalg.cond(matrix / scale[:, np.newaxis]) * UNCERTAIN > 1.0:
        return None
    z = -np.linalg.solve(matrix, rest)
    bounds = np.array(list(system.bounding_tests(character)), dtype=np.intp)
    side = np.where(np.array(character.signs, dtype=bool)[bounds], 1.0, -1.0)
    values = side * system.test_functions(z, alpha)[bounds]
    doubt = _doubt(system, z, alpha, bounds)
    if (values < -doubt).any():
        return 0
    if (values <= doubt).any():
        return None
    return int(np.linalg.slogdet(matrix)[0])


def _doubt(system: SlicewiseLinearSystem, z: Array, alpha: float, which: Indices) -> Array:
    """Return by how much the tests may be off, shape (len(which),)."""
    gradients = np.abs(dense(system.test_jacobian(z, alpha)))[which]
    scale = np.abs(np.append(z, alpha)).max() + 1.0
    doubt: Array = UNCERTAIN * scale * gradients.sum(axis=1)
    return doubt
