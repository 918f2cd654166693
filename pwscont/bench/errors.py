"""Distances of a computed graph from the true answer, in the metric of the problem.

All distances are Euclidean after dividing each unknown by a typical magnitude and alpha by the
length of the interval. A branch has two errors: the error of the stored points, which comes from
the corrector, and the error of the chords between the stored points, which comes from the step
size.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont import BranchGraph, PiecewiseSystem
from pwscont.bench.truth.known_answer import Cell, TruePiece, Truth
from pwscont.extending import Array, Kind, Piece

#: Most stored points of a graph that are compared, evenly spread.
MOST_POINTS = 200
#: Distance in alpha, as a part of the interval, up to which ends of a piece in the right cell are
#: right.
SAME_PIECE = 1e-4


@final
@dataclass(frozen=True, slots=True)
class Errors:
    """Distances from the truth; NaN for an error with nothing to compare.

    Attributes
    ----------
    branch_max, branch_rms : float
        From true solutions to the chord polygon through the stored points.
    points_max, points_rms : float
        From stored points to the true curve.
    transitions : float
        From true transitions to the nearest special point, the largest.
    folds : float
        From true folds to the nearest turning point, the largest; in alpha only, as a part of the
        interval.
    """

    branch_max: float
    branch_rms: float
    points_max: float
    points_rms: float
    transitions: float
    folds: float


def errors(graph: BranchGraph, truth: Truth, system: PiecewiseSystem) -> Errors:
    """Return the distances of a graph from the truth."""
    cells = [system.cell(piece.character) for piece in graph.pieces]
    branch, points = _branch(graph, cells, truth), _stored(graph, cells, truth)
    nodes = [point for point in graph.special_points() if point.kind != Kind.START]
    places = [np.append(point.z, point.alpha) / truth.scale for point in nodes]
    turning = [x for x, p in zip(places, nodes, strict=True) if _turns(graph, p.id)]
    folds = [x[-1:] / truth.scale[-1] for x in truth.folds]
    return Errors(
        *summary(branch),
        *summary(points),
        farthest([x / truth.scale for x in truth.transitions], places),
        farthest(folds, [x[-1:] for x in turning]),
    )


def _turns(graph: BranchGraph, point: int) -> bool:
    """Tell whether alpha turns at a special point of any kind, as at :attr:`Truth.folds`."""
    signs = [piece.det_sign for piece in graph.pieces_at(point)]
    return len(signs) > 1 and sum(signs) == 0


def summary(distances: Array) -> tuple[float, float]:
    """Return maximum and root mean square of distances; NaN without distances."""
    if not len(distances):
        return np.nan, np.nan
    return float(distances.max()), float(np.sqrt(np.mean(distances**2)))


def farthest(true: Sequence[Array], found: Sequence[Array]) -> float:
    """Return the largest distance from a true point to the nearest found point."""
    if not true:
        return np.nan
    nearest = [min((np.linalg.norm(a - b) for b in found), default=np.inf) for a in true]
    return float(max(nearest))


def _branch(graph: BranchGraph, cells: Sequence[Cell], truth: Truth) -> Array:
    """Return the distances of true solutions from the chords of the graph in the same cell."""
    distances = []
    for piece, samples in zip(truth.pieces, truth.samples, strict=True):
        same = [p for p, cell in zip(graph.pieces, cells, strict=True) if cell == piece.cell]
        distances.append(_from_chords(samples / truth.scale, same, truth.scale))
    return np.concatenate(distances)


def _from_chords(samples: Array, pieces: Iterable[Piece], scale: Array) -> Array:
    nearest = np.full(len(samples), np.inf)
    for piece in pieces:
        nodes = piece.points / scale
        nearest = np.minimum(nearest, from_polygon(samples, nodes))
    return nearest


def from_polygon(samples: Array, nodes: Array) -> Array:
    """Return the distance of each sample from a polygon, without cancelling squares."""
    chords = np.diff(nodes, axis=0)
    lengths = np.maximum((chords**2).sum(axis=1), np.finfo(float).tiny)
    offsets = samples[:, np.newaxis] - nodes[:-1]
    shares = np.clip(np.einsum("skj,kj->sk", offsets, chords) / lengths, 0.0, 1.0)
    # from the nearer end of the chord, so that the rounding of the far end does not enter
    ends = samples[:, np.newaxis] - nodes[1:]
    from_start = offsets - shares[..., np.newaxis] * chords
    from_end = ends + (1.0 - shares)[..., np.newaxis] * chords
    near_start = (shares <= 0.5)[..., np.newaxis]
    gaps = np.where(near_start, from_start, from_end)
    smallest: Array = np.sqrt((gaps**2).sum(axis=2)).min(axis=1)
    return smallest


def _stored(graph: BranchGraph, cells: Sequence[Cell], truth: Truth) -> Array:
    """Return the distances of stored points from the true pieces in the same cell."""
    pairs = [
        (x, cell) for piece, cell in zip(graph.pieces, cells, strict=True) for x in piece.points
    ]
    every = max(1, -(-len(pairs) // MOST_POINTS))
    return np.array([from_true(x, _of(truth, cell), truth.scale) for x, cell in pairs[::every]])


def _of(truth: Truth, cell: Cell) -> list[TruePiece]:
    return [piece for piece in truth.pieces if piece.cell == cell]


def from_true(x: Array, pieces: Sequence[TruePiece], scale: Array) -> float:
    """Return the distance of a point from the nearest true piece."""
    gaps = (np.linalg.norm((x - piece.next_to(x)) / scale) for piece in pieces)
    return float(min(gaps, default=np.inf))


# -- right or wrong ---------------------------------------------------------------------------


def verdict(graph: BranchGraph, truth: Truth, system: PiecewiseSystem) -> str:
    """Return the first mistake of a graph, in words; empty if the graph is right.

    A graph is right if the pieces lie in the same cells with the same signs of the determinant and
    the same ends as the true pieces, the number of solutions is right everywhere, and no branch
    stopped early.
    """
    if stopped := graph.special_points(Kind.STOPPED):
        return f"stopped at alpha = {stopped[0].alpha:.6g}"
    found: Counter[Key] = Counter((system.cell(p.character), p.det_sign) for p in graph.pieces)
    true: Counter[Key] = Counter((p.cell, p.det_sign) for p in truth.pieces)
    if found != true:
        extra, missing = (found - true).total(), (true - found).total()
        return f"{missing} of {true.total()} pieces missing, {extra} that are none"
    for alpha in truth.regular_alphas():
        if graph.count(alpha) != truth.count(alpha):
            return f"{graph.count(alpha)} instead of {truth.count(alpha)} solutions at {alpha:.6g}"
    number = {cell: i for i, cell in enumerate({p.cell: None for p in truth.pieces})}
    ends = [(number[system.cell(p.character)], p.det_sign, *p.interval) for p in graph.pieces]
    off = max(abs(a - b) for a, b in zip(_flat(ends), _flat(_true(truth, number)), strict=True))
    return "" if off <= SAME_PIECE * truth.scale[-1] else "pieces end elsewhere"


Key = tuple[Cell, int]
Ends = tuple[int, int, float, float]


def _true(truth: Truth, number: Mapping[Cell, int]) -> list[Ends]:
    """Return number of the cell, sign, and lower and upper end in alpha of every true piece."""
    return [(number[p.cell], p.det_sign, *p.extent()) for p in truth.pieces]


def _flat(pieces: Iterable[Ends]) -> list[float]:
    """Return the ends of all pieces, in the order of cell, sign and lower end."""
    return [end for _, _, *ends in sorted(pieces) for end in ends]
