"""All solutions of systems that are affine in z, by a search over their cells."""

from pwscont.enumeration.by_parts import Cells, Table, is_regular
from pwscont.enumeration.exactly import solve_exactly
from pwscont.enumeration.face import Face
from pwscont.enumeration.filled import Filled, filled
from pwscont.enumeration.options import aside
from pwscont.enumeration.parts import most_cells
from pwscont.enumeration.point import Point, Slice
from pwscont.enumeration.slices import (
    ALONE,
    FEW_CELLS,
    cells_to_try,
    det_sign,
    is_in_doubt,
    lone_point,
    solve_slice,
)

__all__ = [
    "ALONE",
    "FEW_CELLS",
    "Cells",
    "Face",
    "Filled",
    "Point",
    "Slice",
    "Table",
    "aside",
    "cells_to_try",
    "det_sign",
    "filled",
    "is_in_doubt",
    "is_regular",
    "lone_point",
    "most_cells",
    "solve_exactly",
    "solve_slice",
]
