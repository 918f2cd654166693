"""The number of solutions of a system of linear pieces at one alpha, proved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast, final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import counted
from pwscont.basics.rounding import CONFIDENCE
from pwscont.graph.branch_graph import BranchGraph
from pwscont.graph.records import Solution
from pwscont.proof.cells import MOST_CELLS, Choice, ExactCells, Ranges
from pwscont.proof.interval import Interval
from pwscont.proof.pieces import PiecesProof
from pwscont.proof.rates import RatesProof
from pwscont.proof.rational import Point, segment_of
from pwscont.search.enumeration import Solutions
from pwscont.system.abilities import ExactData, ExactRates, shown_size
from pwscont.system.system import PiecewiseSystem

#: A solution is the proved solution if closer than this part of the largest unknown, or than
#: errors.
CLOSE = 1e-6
ASSUMED = "assumed: arithmetic of IEEE 754 to nearest; the data count as the doubles that they are"


@final
class CountProof:
    """What is proved of the solutions at one alpha; made by :func:`pwscont.prove`.

    Attributes
    ----------
    holds : bool
        Whether the number of solutions is proved, and the given solutions are these solutions.
    count : int or None
        The proved number of solutions; None where a cell is not decided.
    statements : tuple of str
        A sentence for what is proved, and a sentence for the data of the proof.
    open : list of tuple of int
        The cells that are not decided: for every part of the system, the number of a mode.
    """

    def __init__(self, cells: ExactCells, alpha: float, known: Sequence[Solution], n: int) -> None:
        boxes, points, self.open = proved_solutions(cells, alpha)
        centres = [each.middle() for each in boxes.values()]
        centres += [np.array(point, dtype=float) for point in points]
        found = counted(len(centres), "solution")
        self.count = None if self.open else len(centres)
        self.holds = self.count == len(known) and _are_matched([x[:n] for x in centres], known)
        words = f"exactly {found} at alpha = {alpha:.8g}, proved"
        if not self.holds:
            words += f"; the {len(known)} given are not these"
        if self.open:
            words = (
                f"not proved: {counted(len(self.open), 'cell')} undecided at alpha = {alpha:.8g}"
            )
        self.statements = (words, ASSUMED)

    def __repr__(self) -> str:
        return f"CountProof({self.statements[0]})"


def proved_solutions(
    cells: ExactCells, alpha: float
) -> tuple[dict[Choice, Interval], set[Point], list[Choice]]:
    """Return enclosures of solutions by cells, all other solutions, and cells that are undecided.

    A cell off all its inequalities has one solution in floating point; if that may be the solution
    of another cell, or if floating point does not decide a cell, rational numbers decide.
    """
    boxes, points, open_cells = dict[Choice, Interval](), set[Point](), list[Choice]()
    rest: list[Choice] = []
    for choices in cells.choices():
        x, sides = cells.lines(choices)
        ranges = Ranges.of((x, sides), (alpha, alpha))
        for i in np.flatnonzero(~ranges.empty):
            choice = tuple(choices[i].tolist())
            if ranges.decided[i]:
                boxes[choice] = cells.unknowns(x[i], np.array([alpha]))[:, 0]
            else:
                rest.append(choice)
    while rest:
        for choice in rest:
            ends = segment_of(*cells.of(choice), (alpha, alpha))
            if ends is not None and len(set(ends)) == 1:
                points.add(ends[0][:-1])
            elif ends is not None:
                open_cells.append(choice)
        rest = _meeting(boxes, points)
        for choice in rest:
            del boxes[choice]
    return boxes, points, open_cells


def _meeting(boxes: dict[Choice, Interval], points: set[Point]) -> list[Choice]:
    """Return the cells with solutions that may be the solution of another cell, or a point."""
    exact = (np.array(point, dtype=float) for point in points)
    known = [*boxes.values(), *(Interval.rounded(x, x) for x in exact)]
    return [
        choice
        for choice, x in boxes.items()
        if any(y is not x and ((x.lo <= y.hi) & (y.lo <= x.hi)).all() for y in known)
    ]


def prove(given: Any, alpha: float | None = None) -> CountProof | PiecesProof | RatesProof:
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
    CountProof, PiecesProof or RatesProof
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
    if isinstance(getattr(given, "system", None), ExactRates):
        return RatesProof(given)
    system, alpha, known = _given(given, alpha)
    if not isinstance(system, ExactData):
        raise InvalidInputError(
            f"{type(system).__name__} hands over no exact data: prove takes contact problems and "
            "formulas with linear=True; formulas of curved systems are proved by Everywhere"
        )
    if alpha is None:
        rows = system.exact_lines()
        if rows is None:
            raise InvalidInputError(
                f"the data of {type(system).__name__} are not affine in alpha: "
                "prove(graph, alpha) needs the alpha at which to count"
            )
        return PiecesProof(given, rows)
    cells = ExactCells(*system.exact_rows(alpha))
    if cells.number > MOST_CELLS:
        raise InvalidInputError(
            f"{cells.number} cells are too many: at most {MOST_CELLS} are proved"
        )
    return CountProof(cells, alpha, known, shown_size(cast(PiecewiseSystem, system)))


def _given(given: Any, alpha: float | None) -> tuple[Any, float | None, Sequence[Solution]]:
    """Return the system, alpha and the solutions to be proved."""
    if isinstance(given, BranchGraph):
        if alpha is None:
            return given.system, None, []
        alpha = float(finite_array("alpha", alpha, ()))
        return given.system, alpha, given.solutions(alpha)
    if not isinstance(given, Solutions) or given.alpha is None:
        raise InvalidInputError(
            f"prove takes a graph or what enumerate_solutions returned, got {type(given).__name__}"
        )
    return given.system, given.alpha, given


def _are_matched(centres: Sequence[Array], known: Sequence[Solution]) -> bool:
    """Tell whether every proved solution is one of the given solutions, and the reverse."""
    close = np.zeros((len(centres), len(known)), dtype=bool)
    for i, x in enumerate(centres):
        for j, solution in enumerate(known):
            error = solution.error[: len(x)] if len(solution.error) else 0.0
            slack = CONFIDENCE * error + CLOSE * np.abs(x).max(initial=0.0)
            close[i, j] = (np.abs(x - solution.z) <= slack).all()
    return bool(close.any(axis=1).all() and close.any(axis=0).all())
