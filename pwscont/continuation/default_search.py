"""The search that explore uses unless told otherwise: complete where that takes seconds."""

from __future__ import annotations

from math import prod

from pwscont.model.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.search import AllTransitions, EndPoints, MultiStart, Search

#: Cells that can be tried at one alpha in a second or two: ten contact nodes.
MANY_CELLS = 4**10
#: The same for all interfaces of all cells together: eight contact nodes.
MANY_INTERFACES = 2_000_000


def default_search(system: PiecewiseSystem) -> Search:
    """Return the most complete search that takes seconds for a system of this size."""
    if not isinstance(system, SlicewiseLinearSystem):
        return _added_up(EndPoints() + MultiStart(), system)
    blocks = system.blocks()
    cells = prod(len(block.modes) for block in blocks)
    interfaces = cells * sum(len(block.tests) for block in blocks)
    if isinstance(system, PiecewiseLinearSystem) and interfaces <= MANY_INTERFACES:
        return AllTransitions()
    if cells <= MANY_CELLS:
        return EndPoints()
    return _added_up(MultiStart(), system)


def _added_up(search: Search, system: PiecewiseSystem) -> Search:
    for special in system.searches():
        search = special + search
    return search
