"""Cells that a mesh lists more than once, and that would be assembled more than once."""

from __future__ import annotations

import numpy as np

from pwscont.extending import Indices

#: Advice for making a mesh that lists each cell once.
ONCE = (
    "list each once; Gmsh writes a copy for every physical group into MSH 2.2, but none into "
    "MSH 4.1 (gmsh -format msh41)"
)


def repeated(corners: Indices) -> Indices:
    """Return which cells have the same corners, in any order, as an earlier cell.

    Parameters
    ----------
    corners : ndarray of int, shape (corners per cell, cells)
    """
    rows = np.sort(corners, axis=0)
    order = np.lexsort(rows)  # a stable sort: the first of equal cells stays first
    same = (np.diff(rows[:, order], axis=1) == 0).all(axis=0)
    return np.sort(order[1:][same])


def copies(corners: Indices, cell: int) -> Indices:
    """Return all cells with the corners of a given cell, included; see :func:`repeated`."""
    rows = np.sort(corners, axis=0)
    return np.flatnonzero((rows == rows[:, [cell]]).all(axis=0))


def in_words(names: list[str]) -> str:
    """Return ``" (in 'a' and 'b')"`` for the groups in which copies are, nothing if unknown."""
    return f" (in {' and '.join(map(repr, sorted(names)))})" if names else ""
