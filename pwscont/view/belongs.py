"""Tells whether a graph read from a file belongs to the scene that is built anew."""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import dense
from pwscont.basics.errors import InvalidInputError
from pwscont.graph import BranchGraph, Piece
from pwscont.system.hidden import completed_point
from pwscont.system.selection import Selection

#: A residual that is larger than this part of its terms is no rounding, and this part of the
#: largest terms of other rows.
OFF, OFF_OTHERS = 1e-6, 1e-12
#: Most pieces that are looked at.
MOST = 20


def check_belongs(graph: BranchGraph, scene: str) -> None:
    """Refuse a graph whose points do not solve the system that it was read with.

    Raises
    ------
    InvalidInputError
        If the residual at an end of one of some pieces is larger than rounding allows.
    """
    some = graph.pieces[:: 1 + len(graph.pieces) // MOST]
    if graph.system is None or all(_solves(graph, piece) for piece in some):
        return
    raise InvalidInputError(
        f"the graph does not solve the scene {scene} as it is built now: the scene has changed"
    )


def _solves(graph: BranchGraph, piece: Piece) -> bool:
    """Tell whether the ends of a piece solve its selection, row by row."""
    assert graph.system is not None
    selection = Selection(graph.system, piece.character)
    for x in (piece.track.start.x, piece.track.end.x):
        whole = completed_point(graph.system, x)
        size = np.abs(dense(selection.jacobian(whole))) @ np.abs(whole)
        if (np.abs(selection.residual(whole)) > OFF * size + OFF_OTHERS * size.max()).any():
            return False
    return True
