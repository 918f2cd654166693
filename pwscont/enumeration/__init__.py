"""All solutions of systems that are affine in z, by a search over their cells."""

from pwscont.enumeration.by_parts import Cells, Table, is_regular
from pwscont.enumeration.face import Face
from pwscont.enumeration.options import aside
from pwscont.enumeration.parts import most_cells
from pwscont.enumeration.point import Point, Slice
from pwscont.enumeration.slices import (
    FEW_CELLS,
    cells_to_try,
    det_sign,
    is_in_doubt,
    solve_exactly,
    solve_slice,
)

__all__ = [
    "FEW_CELLS",
    "Cells",
    "Face",
    "Point",
    "Slice",
    "Table",
    "aside",
    "cells_to_try",
    "det_sign",
    "is_in_doubt",
    "is_regular",
    "most_cells",
    "solve_exactly",
    "solve_slice",
]
