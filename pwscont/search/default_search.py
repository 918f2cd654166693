"""The search that explore uses by default: complete if completeness takes seconds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

from pwscont.basics.arrays import Array
from pwscont.curve.metric import Metric, Range
from pwscont.enumeration.slices import cells_to_try
from pwscont.search.all_transitions import AllTransitions, turns_nowhere
from pwscont.search.enumeration import EndPoints, Slices
from pwscont.search.multi_start import MultiStart, States, Throughout, affordable_starts
from pwscont.search.search import Search
from pwscont.system.abilities import BringsSearches
from pwscont.system.box import Box
from pwscont.system.system import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    has_too_many_tests,
    number_of_cells,
)

#: Most cells tried at each alpha, in a second or two: the cells of ten contact nodes.
MANY_CELLS = 4**10
#: Most interfaces of cells tried, in a second or two: the interfaces of eight contact nodes.
MANY_INTERFACES = 2_000_000
#: Most cells of a curved system in which Newton is tried, in a second or two where H is slow.
MANY_NEWTONS = 2**7
#: Least and most random starts at each end if no other search is affordable.
LEAST_STARTS, MOST_STARTS = 4, 20
#: Most unknowns of a curved system that is searched inside of the interval as well.
MOST_UNKNOWNS_INSIDE = 200
#: Least and most slices between the ends, to find loops, and the most cells of all slices if there
#: are more slices than the least.
FEW_SLICES, MANY_SLICES, MANY_CELLS_BETWEEN = 2, 8, 100_000


def default_search(
    system: PiecewiseSystem, interval: Range, around: Sequence[Array] = ()
) -> Search:
    """Return the most complete search that takes seconds; Newton starts ``around`` states, too."""
    states = tuple(tuple(z.tolist()) for z in around)
    search = _in_all_cells(system, interval) or _from_some(system, states)
    is_costly = isinstance(system, SlicewiseLinearSystem) and not isinstance(search, MultiStart)
    return MultiStart(around=states) + search if system.unique and is_costly else search


def _in_all_cells(system: PiecewiseSystem, interval: Range) -> Search | None:
    """Return a search in all cells, None for curved systems and if the search takes too long."""
    if not isinstance(system, SlicewiseLinearSystem):
        return None
    if type(system).blocks is SlicewiseLinearSystem.blocks and has_too_many_tests(system):
        return None
    blocks = system.blocks()
    cells = number_of_cells(blocks)
    interfaces = cells * sum(len(block.tests) for block in blocks)
    are_few = isinstance(system, PiecewiseLinearSystem) and interfaces <= MANY_INTERFACES
    if are_few or turns_nowhere(system):
        if not Box.of(system).is_bounded:
            return AllTransitions()
        # a branch from bound to bound, or to the upper end, may be without a transition
        return AllTransitions() + EndPoints() + Slices.spread(MANY_SLICES, interval)
    if cells > MANY_CELLS:
        cells = cells_to_try(system, Metric.of(system, interval), interval[0])
    if cells > MANY_CELLS:
        return None
    slices = min(MANY_SLICES, max(FEW_SLICES, MANY_CELLS_BETWEEN // cells))
    return EndPoints() + Slices.spread(slices, interval)


def _from_some(system: PiecewiseSystem, around: States) -> Search:
    """Return a search by Newton from some starts, after the searches that the system brings."""
    is_curved = not isinstance(system, SlicewiseLinearSystem)
    in_cells = is_curved and not has_too_many_tests(system)
    in_cells = in_cells and len(list(islice(system.cells(), MANY_NEWTONS + 1))) <= MANY_NEWTONS
    search: Search
    if is_curved and system.size <= MOST_UNKNOWNS_INSIDE:
        search = Throughout.affordable(system, around, in_cells)
    else:
        count = affordable_starts(system, LEAST_STARTS, MOST_STARTS)
        search = MultiStart(count=count, around=around)
        search = EndPoints() + search if in_cells else search
    for special in system.searches() if isinstance(system, BringsSearches) else ():
        search = special + search
    return search
