"""The answer of a scene as text.

Each special point has the estimated error of the parameter behind a plus-minus sign; no sign
stands behind a value that is exact. Each solution is printed with the error of the state relative
to typical magnitudes. Fewer than six known digits are pointed out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import isinf
from textwrap import wrap

import numpy as np

from pwscont import BranchGraph
from pwscont.extending import (
    CONFIDENCE,
    DUST,
    FEW_DIGITS,
    Array,
    Kind,
    Piece,
    Solution,
    SpecialPoint,
    apart,
    counted,
    number,
)
from pwscont.scenes.panels import Shown

#: Kinds of points whose solutions are like the solutions around them, and need no remark.
UNREMARKABLE = (None, Kind.START, Kind.END, Kind.TRANSITION)
HEADINGS = {1: "", -1: ", negative orientation"}
#: Most unknowns of a state and most letters of a label that are printed, and the number of unknowns
#: at either end of a shortened state.
MOST_UNKNOWNS, MOST_LETTERS, AT_EITHER_END = 12, 90, 3
#: Letters in a line of the words on the search.
WIDTH = 100
HINT = "Long lines are shortened: pwscont run --full prints them in full."

#: Returns the text that is printed for a label.
Shortening = Callable[[str], str]


def report(scene: Shown, graph: BranchGraph, at: Iterable[float], full: bool = False) -> str:
    """Return branches, transitions, numbers of solutions, and the solutions asked for.

    Parameters
    ----------
    scene, graph
    at : iterable of float
        The values of the parameter whose solutions are listed.
    full : bool
        Whether wide states and long labels are printed in full.
    """
    short = str if full else _shortened
    lines = [
        f"{scene.name}: {scene.title}",
        f"{scene.parameter} in [{', '.join(apart(*graph.interval))}]",
        *_branches(scene, graph, short),
        "",
        *_counts(graph),
    ]
    for alpha in at:
        lines += ["", *_solutions(scene, graph, alpha, full)]
    if any("..." in line for line in lines[2:]) and not full:
        lines += ["", HINT]
    return "\n".join(lines)


def _shortened(label: str) -> str:
    return middle_cut(label)


def _named(graph: BranchGraph, words: str) -> str:
    """Return words about alpha with the name of the parameter in place of ``alpha``."""
    return re.sub(r"\balpha\b", lambda _: graph.parameter, words)


def _branches(scene: Shown, graph: BranchGraph, short: Shortening) -> Iterator[str]:
    """Yield the lines of every branch, read in the first orientation that the scene names."""
    orientation = next(iter(scene.orientations), 1)
    for i, component in enumerate(graph.components(), start=1):
        yield ""
        yield f"Branch {i} ({counted(len(component), 'piece')}{HEADINGS[orientation]})"
        yield from _branch(graph, component, orientation, short)


def _branch(
    graph: BranchGraph, component: Sequence[Piece], orientation: int, short: Shortening
) -> Iterator[str]:
    """Yield the lines of a branch, special points and pieces in turn."""
    previous = None
    for piece in component[::orientation]:
        first, last = (piece.start, piece.end)[::orientation]
        if first != previous:
            yield _point(graph, first, orientation)
        ends = (piece.alpha[0], piece.alpha[-1])[::orientation]
        a, b = (number(alpha, graph.interval) for alpha in ends)
        extent = f"{graph.parameter} {a} → {b}" if not piece.is_vertical else "vertical"
        yield f"    piece {piece.id}: {short(piece.label)}, {extent}, det {_sign(piece.det_sign)}"
        yield _point(graph, last, orientation)
        previous = last


def _point(graph: BranchGraph, node: int, orientation: int) -> str:
    point = graph.point(node)
    where = f"{graph.parameter} = {number(point.alpha, graph.interval)}{_plus_minus(point)}"
    message = "" if point.kind in ("start", "end") else point.passed(orientation)
    notes = "; ".join(filter(None, [_named(graph, message), point.events, _few(point.digits)]))
    return f"  {point.kind:<15} {where:<30} {notes}".rstrip()


def _plus_minus(point: SpecialPoint) -> str:
    return f" ± {point.error[-1]:.0e}" if len(point.error) and point.error[-1] else ""


def _few(digits: float) -> str:
    return f"only {counted(int(digits), 'digit')} known" if digits < FEW_DIGITS else ""


def _counts(graph: BranchGraph) -> Iterator[str]:
    found = "" if graph.pieces else ": none was found"
    least = "" if graph.is_complete else found or ", at least"
    yield f"Number of solutions by {graph.parameter}{least}"
    previous = None
    for stretch in (row for row in graph.multiplicity() if row[0] < row[1]):
        if previous is not None and not (previous.hi_closed or stretch.lo_closed):
            yield f"  {number(stretch[0], graph.interval)}: {_between(graph, stretch[0])}"
        yield f"  {stretch.ends}: {'infinitely many' if isinf(stretch[2]) else stretch[2]}"
        previous = stretch
    yield from _vertical_pieces(graph)
    searched = f"Searched: {_named(graph, graph.searched.what)}"
    yield from wrap(searched, WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    if graph.searched.unseen:
        yield f"May be passed over: {graph.searched.unseen}"
    yield f"Guarantee: {_named(graph, graph.guarantee)} ({_balance(graph)})"


def _between(graph: BranchGraph, alpha: float) -> str:
    """Return the number of solutions, in words, at the alpha between two stretches."""
    count = graph.count(alpha)
    return "infinitely many" if isinf(count) else f"{count}, counting a double one once"


def _vertical_pieces(graph: BranchGraph) -> Iterator[str]:
    for alpha in sorted({p.interval[0] for p in graph.pieces if p.is_vertical}):
        yield f"  {number(alpha, graph.interval)}: infinitely many, a vertical piece"


def _balance(graph: BranchGraph) -> str:
    """Return the balance in words; a single value is necessary for completeness, not sufficient."""
    values = graph.balance_values()
    if len(values) == 1:
        return f"balance: the signs of det(dH/dz) sum to {_sign(values[0])} throughout"
    return f"no balance: the signs of det(dH/dz) sum to {' or '.join(map(_sign, values))}"


def _solutions(scene: Shown, graph: BranchGraph, alpha: float, full: bool) -> Iterator[str]:
    found = graph.solutions(alpha)
    sizes = [np.abs(piece.z).max(axis=0) for piece in graph.pieces]
    largest = np.max(sizes, axis=0) if sizes else 0.0
    given = number(alpha) if float(number(alpha)) == alpha else repr(float(alpha))
    yield f"{counted(len(found), 'solution')} at {graph.parameter} = {given}"
    for i, solution in enumerate(found, start=1):
        kind = f", {solution.kind}" if solution.kind not in UNREMARKABLE else ""
        label = solution.label if full else _shortened(solution.label)
        yield f"  {i}. {label}, det {_sign(solution.det_sign)}{kind}{_error(solution)}"
        yield f"     {', '.join(_shown(_values(scene, solution, largest), full))}"


def _error(solution: Solution) -> str:
    if not len(solution.error):
        return ""
    few = _few(solution.digits)
    return f", error {10.0**-solution.digits:.0e}{few and f', {few}'}"


def _shown(values: list[str], full: bool) -> list[str]:
    """Return the values of a state; of a wide state only the first and the last values."""
    if full or len(values) <= MOST_UNKNOWNS:
        return values
    count = f"({len(values)} unknowns)"
    *last, end = values[-AT_EITHER_END:]
    return [*values[:AT_EITHER_END], "...", *last, f"{end} {count}"]


def _values(scene: Shown, solution: Solution, largest: Array | float) -> list[str]:
    """Return "name = value" for the unknowns of a solution; values within rounding read as zero."""
    # rounding is relative to each unknown's own magnitude: metres stand beside pascals
    error = solution.error[:-1] if len(solution.error) else 0.0
    dust = np.maximum(DUST * largest, CONFIDENCE * error)
    z = np.where(np.abs(solution.z) <= dust, 0.0, solution.z)
    pairs = zip(scene.system.names(), z, strict=True)
    return [f"{name} = {number(float(value))}" for name, value in pairs]


def _sign(sign: int) -> str:
    return f"{sign:+d}" if sign else "0"


def middle_cut(words: str, most: int = MOST_LETTERS) -> str:
    """Return words cut to ``most`` letters; an ellipsis stands for the middle."""
    if len(words) <= most:
        return words
    half = (most - 7) // 2
    head, tail = words[:half], words[-half:]
    gap = next((gap for gap in (", ", " ") if gap in head and gap in tail), "")
    return f"{head[: head.rfind(gap)]}{gap}...{gap}{tail[tail.find(gap) + len(gap) :]}"
