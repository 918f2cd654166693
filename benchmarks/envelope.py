"""How far stiff and extreme cases can be driven before they break, and what is said then.

    python benchmarks/envelope.py

Each family makes one number more extreme until the answer is no longer right: all pieces in their
cells with their signs, every end within ten times its estimated error. The truth is a closed
form, or the system solved in rational arithmetic, every float taken as the number that it is.
Prints what was tried, the largest error of an end (relative to the interval) while it was right,
and what happened at the first value where it was not. Nothing is random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

from pwscont import (
    BranchGraph,
    Character,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    explore,
    trace,
)
from pwscont.basics.arrays import Array
from pwscont.basics.errors import PwscontError
from pwscont.bench.truth.known_answer import TruePiece
from pwscont.bench.truth.rational import straight_pieces

INTERVAL = (-2.0, 2.0)
NODE = np.array([[2.0, -1.0], [-1.0, 2.0]])
EPS = np.finfo(float).eps
#: Longest message that is shown.
SHOWN = 88


class EndedError(Exception):
    """The answer is not right; the text says how one can tell."""


@dataclass(frozen=True)
class Family:
    """What is made extreme, by which values, and the error of the answer at one of them."""

    what: str
    values: Sequence[float]
    error: Callable[[float], float]

    def row(self) -> tuple[str, str, str, str, str]:
        """Return what was tried, until where it was right, the largest error, and the end."""
        good, worst, end = "none", 0.0, "right throughout"
        for value in self.values:
            try:
                worst = max(worst, self.error(value))
            except (EndedError, PwscontError) as ended:
                end = f"{value:g}: {str(ended)[:SHOWN]}"
                break
            good = f"{value:g}"
        tried = f"{self.values[0]:g} to {self.values[-1]:g}"
        return self.what, tried, good, f"{worst:.0e}", end


# -- right or not ------------------------------------------------------------------------------


def right(graph: BranchGraph, pairs: Iterator[tuple[float, float, float]]) -> float:
    """Return the largest relative error of (found, true, estimate), or say what is not right."""
    for point in graph.special_points("stopped"):
        raise EndedError(f"stopped: {point.message.rpartition('; ')[2] or point.message}")
    if not all(np.isfinite(piece.points).all() for piece in graph.pieces):
        raise EndedError("not finite")
    worst, (lo, hi) = 0.0, graph.interval
    for found, true, estimate in pairs:
        off = abs(found - true)
        if off > 10.0 * estimate + EPS * abs(true):
            raise EndedError(f"off by {off:.0e} where the estimate is {estimate:.0e}")
        worst = max(worst, off / (hi - lo))
    return worst


def straight(system: Any, interval: tuple[float, float] = INTERVAL) -> float:
    """Return the largest error of the ends of all pieces against rational arithmetic."""
    graph = explore(system, interval)
    return right(graph, _ends(system, graph, straight_pieces(system, interval)))


def _ends(
    system: Any, graph: BranchGraph, expected: list[TruePiece]
) -> Iterator[tuple[float, float, float]]:
    true: dict[Any, TruePiece] = {piece.cell: piece for piece in expected}
    found = {system.cell(piece.character): piece for piece in graph.pieces}
    for cell in sorted(true.keys() ^ found.keys()):
        lo, hi = true[cell].span if cell in true else found[cell].interval
        wrong = f"a piece of length {hi - lo:.0e} is {'missing' if cell in true else 'invented'}"
        raise EndedError(f"{wrong}, the graph is called {graph.guarantee!r}")
    for cell, piece in found.items():
        if piece.det_sign != true[cell].det_sign:
            lo, hi = true[cell].span
            what = "vertical" if piece.is_vertical else f"of sign {piece.det_sign}"
            raise EndedError(f"a piece that spans {hi - lo:.0e} of alpha is called {what}")
    for cell, piece in found.items():
        ends = sorted((graph.point(i) for i in (piece.start, piece.end)), key=lambda p: p.alpha)
        for end, alpha in zip(ends, true[cell].span, strict=True):
            yield end.alpha, alpha, float(end.error[-1])


def at(graph: BranchGraph, alphas: list[float]) -> float:
    """Return the largest error of the special points within the interval, at known places."""
    kinds = ("transition", "nonsmooth fold")
    points = sorted((p for k in kinds for p in graph.special_points(k)), key=lambda p: p.alpha)
    if len(points) != len(alphas) and not graph.special_points("stopped"):
        raise EndedError(f"{len(points)} special points instead of {len(alphas)}")
    pairs = zip(points, sorted(alphas), strict=False)
    return right(graph, ((p.alpha, a, float(p.error[-1])) for p, a in pairs))


# -- bodies and curves -------------------------------------------------------------------------


def body(blocks: list[Array], coupling: float = 0.0, gap: Array | None = None) -> ContactBody:
    """Return nodes with these stiffnesses, the first two coupled by their displacements."""
    size = 2 * len(blocks)
    A = np.zeros((size, size))
    for i, block in enumerate(blocks):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    if coupling:
        A[1, 2] = A[2, 1] = -coupling
        A[0, 3] = A[3, 0] = coupling / 2.0
    return ContactBody(A, np.eye(size)[::2], np.eye(size)[1::2], gap)


def pressed(it: ContactBody, friction: Any = 4.0, load: float = 1.0, r: Any = None) -> CoulombLoad:
    """Return every node pressed on the obstacle, while it is dragged to and fro."""
    rate = np.where(np.arange(it.n) % 2, 1.0, 0.1)
    f0 = np.where(np.arange(it.n) % 2, 0.05 * np.arange(it.n), 0.25)
    return CoulombLoad(it, AffineLoad(load * f0, load * rate), friction, r)


def incompressible(ratio: float) -> Array:
    """Return a = (lambda + 3 mu) / 2 and b = (lambda + mu) / 2 for mu = 1."""
    a, b = (ratio + 3.0) / 2.0, (ratio + 1.0) / 2.0
    return np.array([[a, -b], [-b, a]])


class Along(PiecewiseLinearSystem):
    """z1 = alpha, z2 = z1 + slope (z1 - 1/4): nearly along the interface z2 = z1."""

    size = 2

    def __init__(self, slope: float) -> None:
        self.slope = slope

    def test_functions(self, z: Array, alpha: float) -> Array:
        return np.array([z[1] - z[0]])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        bend = 0.5 * (z[1] - z[0]) if character.signs[0] else 0.0
        return np.array([z[0] - alpha, z[1] - z[0] - self.slope * (z[0] - 0.25) - bend])


class Touching(PiecewiseSystem):
    """y = level + x^2 under the interface y = level + depth^2, with a kink in x there."""

    size = 2

    def __init__(self, depth: float, level: float) -> None:
        self.level, self.top = level, level + depth**2

    def test_functions(self, z: Array, alpha: float) -> Array:
        return np.array([z[1] - self.top])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        bend = 0.0 if character.signs[0] else 0.3 * (z[1] - self.top)
        return np.array([z[1] - z[0] ** 2 - self.level, z[0] + bend - alpha])

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        bend = 0.0 if character.signs[0] else 0.3
        return np.array([[-2.0 * z[0], 1.0, 0.0], [1.0, bend, -1.0]])


def touching(depth: float, level: float) -> float:
    """Return the error of the places where a parabola passes an interface it nearly touches."""
    system = Touching(depth, level)
    true = float(Fraction(system.top) - Fraction(level)) ** 0.5
    graph = trace(system, ([-0.9, 0.81 + level], -0.9), (-1.0, 1.0))
    return at(graph, [-true, true])


class Sawtooth(PiecewiseLinearSystem):
    """alpha rises by 0.15 and falls by 0.05 in turn while z rises by 0.1: a fold at each kink."""

    size = 1

    def __init__(self, folds: int) -> None:
        steps = np.arange(folds + 2)
        self.z, self.alpha = 0.1 * steps, 0.05 * steps + 0.1 * (steps % 2)
        self.slopes = np.diff(self.alpha) / np.diff(self.z)
        self.gradients = np.column_stack([np.ones(folds), np.zeros(folds)])

    def test_functions(self, z: Array, alpha: float) -> Array:
        return np.asarray(z[0] - self.z[1:-1])

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        return self.gradients

    def bounding_tests(self, character: Character) -> list[int]:
        k = sum(character.signs)
        return [i for i in (k - 1, k) if 0 <= i < len(self.gradients)]

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        k = sum(character.signs)
        return np.array([self.alpha[k] + self.slopes[k] * (z[0] - self.z[k]) - alpha])

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        return np.array([[self.slopes[sum(character.signs)], -1.0]])


def many(folds: float) -> float:
    """Return the largest error of that many folds in a row."""
    system = Sawtooth(int(folds))
    graph = trace(system, ([-1.0], -1.5), (-1.5, 0.05 * folds + 2.0))
    return at(graph, list(system.alpha[1:-1]))


# -- the families ------------------------------------------------------------------------------


def powers(*exponents: float) -> list[float]:
    """Return powers of ten."""
    return [float(f"1e{e}") for e in exponents]


RISING = powers(0, 3, 6, 9, 10, 11, 12, 13, 14, 15, 16, 18)
FALLING = powers(-3, -6, -7, -8, -9, -10, -11, -12, -13, -14, -15, -16)
LARGE = powers(0, 12, 50, 100, 110, 120, 150, 200, 300)
SMALL = powers(0, -12, -50, -100, -110, -120, -150, -200, -300)
ONE, TWO = [NODE], [NODE, NODE]


def close(depth: float) -> float:
    """Return the error where a gap sets the transitions of equal nodes apart."""
    return straight(pressed(body(TWO, 0.3, np.array([0.0, depth]))))


FAMILIES = [
    Family("lambda / mu", RISING, lambda v: straight(pressed(body([incompressible(v)])))),
    Family("unit of stiffness, large", LARGE, lambda v: straight(pressed(body([v * NODE] * 2)))),
    Family("unit of stiffness, small", SMALL, lambda v: straight(pressed(body([v * NODE] * 2)))),
    Family("unit of load, large", LARGE, lambda v: straight(pressed(body(TWO, 0.3), load=v))),
    Family("unit of load, small", SMALL, lambda v: straight(pressed(body(TWO, 0.3), load=v))),
    Family(
        "stiffness of a node over its neighbour's",
        RISING,
        lambda v: straight(pressed(body([v * NODE, NODE], 0.3))),
    ),
    Family("F", RISING, lambda v: straight(pressed(body(TWO, 0.3), v))),
    Family(
        "F / (a / b) - 1, above", FALLING, lambda v: straight(pressed(body(ONE), 2.0 + 2.0 * v))
    ),
    Family(
        "F / (a / b) - 1, below", FALLING, lambda v: straight(pressed(body(ONE), 2.0 - 2.0 * v))
    ),
    Family(
        "F of one node over its neighbour's",
        RISING,
        lambda v: straight(pressed(body(TWO, 0.3), np.array([4.0 * v, 4.0]))),
    ),
    Family("r, large", RISING, lambda v: straight(pressed(body(TWO, 0.3), r=v))),
    Family("r, small", FALLING, lambda v: straight(pressed(body(TWO, 0.3), r=v))),
    Family("transitions of equal nodes apart by a gap of", FALLING, close),
    Family("gap of one node, large", LARGE, close),
    Family("gap of one node, small", SMALL, close),
    Family(
        "slope of a straight path over an interface",
        FALLING,
        lambda v: at(trace(Along(v), ([-1.0, -1.0 - 1.25 * v], -1.0), (-1.0, 1.0)), [0.25]),
    ),
    Family("half width of a parabola's dip, at y = 0", FALLING, lambda v: touching(v, 0.0)),
    Family("half width of a parabola's dip, at y = 1", FALLING, lambda v: touching(v, 1.0)),
    Family("folds in a row", [1e2, 3e2, 1e3, 3e3], many),
]


def main() -> None:
    """Print one row per family."""
    rows = [("what", "tried", "right up to", "error", "then")]
    rows += [family.row() for family in FAMILIES]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(map(str.ljust, row, widths)).rstrip())


if __name__ == "__main__":
    main()
