"""The door to proofs from exact data, and the number of solutions at one alpha."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from pwscont.basics.arrays import finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.printing import counted
from pwscont.graph.branch_graph import BranchGraph
from pwscont.graph.proved import are_matched, with_slack
from pwscont.graph.records import Solution
from pwscont.proof.cells import MOST_CELLS, Choice, ExactCells, Point, segment_of
from pwscont.proof.certificate import ASSUMED, Certificate, certified_rates
from pwscont.proof.interval import Interval
from pwscont.proof.pieces import certified_pieces
from pwscont.search.enumeration import Solutions
from pwscont.system.abilities import ExactData, ExactRates, shown_size


def prove(given: Any, alpha: float | None = None) -> Certificate:
    """Prove how many solutions a system of linear pieces has at one alpha, or all of a graph.

    For an evolution of ``QuasiStaticCoulomb``, prove that no other evolution exists.

    Every cell gets a certificate: floating point with bounds of all rounding, or rational numbers
    where the bounds decide nothing. The data of the system count as exact (docs/proofs).

    Parameters
    ----------
    given : BranchGraph, Solutions or EvolutionGraph
        The answer to be proved: a graph, or what :func:`pwscont.enumerate_solutions` returned. The
        system must be a :class:`~pwscont.extending.ExactData`: contact with Coulomb friction, and
        formulas with ``linear=True`` such as :func:`pwscont.LCP`.
    alpha : float, optional
        The value at which solutions of a graph are counted. Without alpha every piece and
        transition of the graph is proved; if cells are few, also that nothing is missing.

    Returns
    -------
    Certificate
        With ``holds``, ``statements`` and ``open``, and ``count`` or ``is_complete``.

    Raises
    ------
    InvalidInputError
        If ``given`` is something else, the system hands over no exact data, or
        has too many cells.

    Examples
    --------
    >>> from pwscont import LCP, enumerate_solutions, explore, prove
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[0, 0])
    >>> prove(enumerate_solutions(problem, 0.0)).statements[0]
    'exactly 3 solutions at alpha = 0, proved'
    >>> prove(explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))).statements[0]
    'complete, proved: 3 pieces and 2 transitions'
    """
    system: Any = getattr(given, "system", None)
    if isinstance(system, ExactRates):
        return certified_rates(given)
    is_graph = isinstance(given, BranchGraph)
    if not is_graph and (not isinstance(given, Solutions) or given.alpha is None):
        raise InvalidInputError(
            f"prove takes a graph or what enumerate_solutions returned, got {type(given).__name__}"
        )
    if not isinstance(system, ExactData):
        raise InvalidInputError(
            f"{type(system).__name__} hands over no exact data: prove takes contact problems and "
            "formulas with linear=True; formulas of curved systems are proved by Everywhere"
        )
    if not is_graph:
        return _certified_count(system, given.alpha, given, len(given))
    if alpha is not None:
        alpha = float(finite_array("alpha", alpha, ()))
        return _certified_count(system, alpha, given.solutions(alpha), given.count(alpha))
    rows = system.exact_lines()
    if rows is None:
        raise InvalidInputError(
            f"the data of {type(system).__name__} are not affine in alpha: "
            "prove(graph, alpha) needs the alpha at which to count"
        )
    return certified_pieces(given, rows)


def _certified_count(
    system: Any, alpha: float, known: Sequence[Solution], number: float
) -> Certificate:
    """Return what is proved of all solutions at alpha, and of the known ones, ``number`` in all."""
    cells, size = ExactCells(*system.exact_rows(alpha)), shown_size(system)
    if cells.number > MOST_CELLS:
        raise InvalidInputError(
            f"{cells.number} cells are too many: at most {MOST_CELLS} are proved"
        )
    boxes, points, undecided = proved_solutions(cells, alpha)
    centres = [each.middle()[:size] for each in boxes.values()]
    centres += [np.array(point[:size], dtype=float) for point in points]
    count = None if undecided else len(centres)
    found = [with_slack(each, np.abs(each.z).max(initial=0.0)) for each in known]
    holds = count == number and are_matched([(x, x) for x in centres], found)
    words = f"exactly {counted(len(centres), 'solution')} at alpha = {alpha:.8g}, proved"
    if not holds:
        given = "infinitely many" if number == inf else number
        words += f"; the {given} given are not these"
    if undecided:
        words = f"not proved: {counted(len(undecided), 'cell')} undecided at alpha = {alpha:.8g}"
    return Certificate(holds, (words, ASSUMED.format("the data")), undecided, count)


@np.errstate(all="ignore")
def proved_solutions(
    cells: ExactCells, alpha: float
) -> tuple[dict[Choice, Interval], set[Point], list[Choice]]:
    """Return enclosures of solutions by cells, all other solutions, and cells that are undecided.

    A cell off all its inequalities has one solution in floating point. Rational numbers decide all
    other cells that may have solutions, and cells whose solution may be that of another cell.
    """
    at = np.array([alpha])
    found = [
        (choice, cells.unknowns(line, at)[:, 0], is_decided)
        for choice, line, is_decided in cells.left((alpha, alpha))
    ]
    lo, hi = (np.array([getattr(box, end) for _, box, _ in found]) for end in ("lo", "hi"))
    boxes, points, undecided = dict[Choice, Interval](), set[Point](), list[Choice]()
    for choice, box, is_decided in found:
        if is_decided and ((lo > box.hi) | (hi < box.lo)).any(axis=1).sum() == len(found) - 1:
            boxes[choice] = box
            continue
        ends = segment_of(*cells.of(choice), (alpha, alpha))
        if ends is not None and len(ends) == 2 and ends[0] == ends[1]:
            points.add(ends[0][:-1])
        elif ends is not None:
            undecided.append(choice)
    return boxes, points, undecided
