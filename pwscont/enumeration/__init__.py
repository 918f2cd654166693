"""All solutions of systems that are affine in z, by a search over their cells."""

from pwscont.enumeration.face import Face
from pwscont.enumeration.slices import Point, Slice, det_sign, solve_exactly, solve_slice

__all__ = ["Face", "Point", "Slice", "det_sign", "solve_exactly", "solve_slice"]
