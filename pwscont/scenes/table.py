"""The answer of a scene as text.

Each special point has the estimated error of alpha behind a plus-minus sign, each solution the
error of its state relative to typical magnitudes. Fewer than six known digits are pointed out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import isinf

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.kind import Kind
from pwscont.basics.looks import apart
from pwscont.basics.rounding import CONFIDENCE
from pwscont.graph import BranchGraph, Piece, Solution
from pwscont.graph.exports import magnitudes
from pwscont.graph.presentation import DUST, number
from pwscont.graph.records import FEW_DIGITS, SpecialPoint
from pwscont.scenes.panels import Shown

#: Kinds of points whose solutions need no remark: they are like the solutions around them.
UNREMARKABLE = (None, Kind.START, Kind.END, Kind.TRANSITION)
HEADINGS = {1: "positive orientation", -1: "negative orientation"}


def report(scene: Shown, graph: BranchGraph, at: Iterable[float]) -> str:
    """Return branches, transitions, numbers of solutions, and the solutions asked for."""
    lines = [
        f"{scene.name}: {scene.title}",
        f"{scene.parameter} in [{', '.join(apart(*graph.interval))}]",
        *_branches(scene, graph),
        "",
        *_counts(graph),
    ]
    for alpha in at:
        lines += ["", *_solutions(scene, graph, alpha)]
    return "\n".join(lines)


def _branches(scene: Shown, graph: BranchGraph) -> Iterator[str]:
    for i, component in enumerate(graph.components(), start=1):
        for orientation in scene.orientations:
            yield ""
            heading = f", {HEADINGS[orientation]}" if len(scene.orientations) > 1 else ""
            yield f"Branch {i} ({_plural(len(component), 'piece')}{heading})"
            yield from _branch(graph, component, orientation)


def _branch(graph: BranchGraph, component: Sequence[Piece], orientation: int) -> Iterator[str]:
    """Yield special points and pieces in turn."""
    previous = None
    for piece in component[::orientation]:
        first, last = (piece.start, piece.end)[::orientation]
        if first != previous:
            yield _point(graph, first, orientation)
        a, b = (number(alpha) for alpha in (piece.alpha[0], piece.alpha[-1])[::orientation])
        extent = f"{graph.parameter} {a} → {b}" if not piece.is_vertical else "vertical"
        yield f"    piece {piece.id}: {piece.label}, {extent}, det {_sign(piece.det_sign)}"
        yield _point(graph, last, orientation)
        previous = last


def _point(graph: BranchGraph, node: int, orientation: int) -> str:
    point = graph.point(node)
    where = f"{graph.parameter} = {number(point.alpha)}{_plus_minus(point)}"
    message = "" if point.kind in ("start", "end") else point.passed(orientation)
    notes = "; ".join(filter(None, [message, point.events, _few(point.digits)]))
    return f"  {point.kind:<15} {where:<30} {notes}".rstrip()


def _plus_minus(point: SpecialPoint) -> str:
    return f" ± {point.error[-1]:.0e}" if len(point.error) else ""


def _few(digits: float) -> str:
    return f"only {_plural(int(digits), 'digit')} known" if digits < FEW_DIGITS else ""


def _counts(graph: BranchGraph) -> Iterator[str]:
    least = "" if graph.is_complete else ", at least"
    yield f"Number of solutions by {graph.parameter}{least}"
    previous = None
    for stretch in (row for row in graph.multiplicity() if row[0] < row[1]):
        if previous is not None and not (previous.hi_closed or stretch.lo_closed):
            yield f"  {number(stretch[0])}: {_between(graph, stretch[0])}"
        yield f"  {stretch.ends}: {'infinitely many' if isinf(stretch[2]) else stretch[2]}"
        previous = stretch
    yield from _vertical_pieces(graph)
    yield f"Searched: {graph.searched.what}"
    yield f"Guarantee: {graph.guarantee} ({_balance(graph)})"


def _between(graph: BranchGraph, alpha: float) -> str:
    """Return the number of solutions at one alpha between two stretches."""
    count = graph.count(alpha)
    return "infinitely many" if isinf(count) else f"{count}, counting a double one once"


def _vertical_pieces(graph: BranchGraph) -> Iterator[str]:
    for alpha in sorted({p.interval[0] for p in graph.pieces if p.is_vertical}):
        yield f"  {number(alpha)}: infinitely many, a vertical piece"


def _balance(graph: BranchGraph) -> str:
    """Return the balance; one value is necessary for completeness, but not sufficient."""
    values = graph.balance_values()
    if len(values) == 1:
        return f"balance: the signs of det(dH/dz) sum to {values[0]:+d} throughout"
    return f"no balance: the signs of det(dH/dz) sum to {' or '.join(f'{v:+d}' for v in values)}"


def _solutions(scene: Shown, graph: BranchGraph, alpha: float) -> Iterator[str]:
    found = graph.solutions(alpha)
    largest = magnitudes(graph)[:-1] if graph.pieces else 0.0
    given = number(alpha) if float(number(alpha)) == alpha else repr(float(alpha))
    yield f"{_plural(len(found), 'solution')} at {graph.parameter} = {given}"
    for i, solution in enumerate(found, start=1):
        kind = f", {solution.kind}" if solution.kind not in UNREMARKABLE else ""
        yield f"  {i}. {solution.label}, det {_sign(solution.det_sign)}{kind}{_error(solution)}"
        yield f"     {_state(scene, solution, largest)}"


def _error(solution: Solution) -> str:
    if not len(solution.error):
        return ""
    few = _few(solution.digits)
    return f", error {10.0**-solution.digits:.0e}{few and f', {few}'}"


def _state(scene: Shown, solution: Solution, largest: Array | float) -> str:
    # each unknown by its own: one in metres beside one in pascals is no dust
    error = solution.error[:-1] if len(solution.error) else 0.0
    dust = np.maximum(DUST * largest, CONFIDENCE * error)
    z = np.where(np.abs(solution.z) <= dust, 0.0, solution.z)
    pairs = zip(scene.system.names(), z, strict=True)
    return ", ".join(f"{name} = {number(float(value))}" for name, value in pairs)


def _sign(sign: int) -> str:
    return f"{sign:+d}" if sign else "0"


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
