"""All solutions of systems that are affine in z, by a search over all cells."""

from pwscont.enumeration.by_parts import Cells, is_regular, most_cells, parts_of_table
from pwscont.enumeration.exact import solve_exactly
from pwscont.enumeration.filled import Filled, filled
from pwscont.enumeration.options import Table
from pwscont.enumeration.polyhedron import Face, Point, Slice
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
    "cells_to_try",
    "det_sign",
    "filled",
    "is_in_doubt",
    "is_regular",
    "lone_point",
    "most_cells",
    "parts_of_table",
    "solve_exactly",
    "solve_slice",
]
