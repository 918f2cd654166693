"""The search that explore uses by default: complete if completeness takes seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

from pwscont.basics.arrays import Array
from pwscont.curve.metric import Metric
from pwscont.enumeration.slices import cells_to_try
from pwscont.search.all_transitions import AllTransitions
from pwscont.search.enumeration import EndPoints, Slices
from pwscont.search.multi_start import MultiStart, Throughout, affordable_starts
from pwscont.search.search import Search
from pwscont.system.abilities import BringsSearches
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
#: Most cells of a curved system in which Newton is tried, in a second or two.
MANY_NEWTONS = 2**11
#: Least and most random starts at each end if no other search is affordable.
LEAST_STARTS, MOST_STARTS = 4, 20
#: Most unknowns of a curved system that is searched inside of the interval as well.
MOST_UNKNOWNS_INSIDE = 200
#: Least and most slices between the ends, to find loops, and the most cells of all slices if there
#: are more slices than the least.
FEW_SLICES, MANY_SLICES, MANY_CELLS_BETWEEN = 2, 8, 100_000


def default_search(
    system: PiecewiseSystem, interval: tuple[float, float], around: Sequence[Array] = ()
) -> Search:
    """Return the most complete search that takes seconds; Newton starts ``around`` states, too."""
    search = _most_complete(system, interval, around)
    is_costly = isinstance(system, SlicewiseLinearSystem) and not isinstance(search, MultiStart)
    return _from_many(around) + search if system.unique and is_costly else search


def _most_complete(
    system: PiecewiseSystem, interval: tuple[float, float], around: Sequence[Array]
) -> Search:
    some = replace(_from_many(around), count=affordable_starts(system, LEAST_STARTS, MOST_STARTS))
    if not isinstance(system, SlicewiseLinearSystem):
        is_small = system.size <= MOST_UNKNOWNS_INSIDE
        many: Search = Throughout.affordable(system, _from_many(around)) if is_small else some
        if not has_too_many_tests(system):
            few = len(list(islice(system.cells(), MANY_NEWTONS + 1))) <= MANY_NEWTONS
            many = EndPoints() + many if few else many
        return _added_up(many, system)
    if type(system).blocks is SlicewiseLinearSystem.blocks and has_too_many_tests(system):
        return _added_up(some, system)
    blocks = system.blocks()
    cells = number_of_cells(blocks)
    interfaces = cells * sum(len(block.tests) for block in blocks)
    if isinstance(system, PiecewiseLinearSystem) and interfaces <= MANY_INTERFACES:
        return AllTransitions()
    if cells > MANY_CELLS:
        cells = cells_to_try(system, Metric.of(system, interval), interval[0])
    if cells <= MANY_CELLS:
        slices = min(MANY_SLICES, max(FEW_SLICES, MANY_CELLS_BETWEEN // cells))
        return EndPoints() + Slices.spread(slices, interval)
    return _added_up(some, system)


def _from_many(around: Sequence[Array]) -> MultiStart:
    return MultiStart(around=tuple(tuple(z.tolist()) for z in around))


def _added_up(search: Search, system: PiecewiseSystem) -> Search:
    if isinstance(system, BringsSearches):
        for special in system.searches():
            search = special + search
    return search
