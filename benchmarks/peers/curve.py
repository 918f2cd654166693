"""A curve as another program returns it, and its row in the bench's report.

Other programs know neither cells nor pieces. Their points are one polygon, compared with all true
pieces at once, and right means what is left of the bench's demands: the curve reaches an end of the
interval, no part of it is missing, no point is off it, all folds are reported, and none elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.bench.cases import Case
from pwscont.bench.errors import MOST_POINTS, Errors, farthest, from_polygon, from_true, summary
from pwscont.bench.measure import Row
from pwscont.bench.truth.known_answer import Truth

#: Runs that are timed.
RUNS = 3
#: A peer is right within this part of the scale: smoothing may move a curve and its folds. A part
#: that is missed on these problems is ten times as long.
NEAR = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """What one run of a peer at one setting returned.

    Attributes
    ----------
    peer, setting : str
        One line in the picture has one name; the setting in words.
    numbers : mapping
        The setting's numbers under the peer's own names.
    seconds : tuple of float
        Of every timed run.
    points : ndarray, shape (k, n + 1)
        (z, alpha) in the order of the curve; of size 0 if the peer gave none.
    folds : tuple of float
        Values of alpha that the peer called folds (limit points).
    """

    peer: str
    setting: str
    numbers: Mapping[str, float]
    seconds: tuple[float, ...]
    points: Array
    folds: tuple[float, ...]


def row_of(case: Case, curve: Curve) -> Row:
    """Return a row as the bench makes them; a peer's calls and pieces are not known."""
    found = _errors(curve, case.truth)
    return Row(
        case=case.name,
        stepper=curve.peer,
        setting=curve.setting,
        step_size=curve.numbers,
        seconds=curve.seconds,
        calls={},
        points=len(curve.points) if curve.points.size else 0,
        pieces=0,
        errors=found,
        wrong=_stopped(curve.points, case.truth) or _verdict(found, curve.folds, case.truth),
    )


def within(points: Array, interval: tuple[float, float]) -> Array:
    """Return the first stretch inside the interval, with its outer chords cut off at the ends."""
    if not points.size:
        return points
    lo, hi = interval
    inside = np.append((points[:, -1] >= lo) & (points[:, -1] <= hi), False)
    first = int(np.argmax(inside))
    last = first + int(np.argmin(inside[first:]))  # the first one that is outside again
    kept = points[first:last]
    if len(kept) and first > 0:
        kept = np.vstack([_cut(kept[0], points[first - 1], interval), kept])
    if len(kept) and last < len(points):
        kept = np.vstack([kept, _cut(kept[-1], points[last], interval)])
    return kept


def _cut(inside: Array, outside: Array, interval: tuple[float, float]) -> Array:
    """Return where the chord between two points leaves the interval."""
    end = interval[0] if outside[-1] < interval[0] else interval[1]
    share = (end - inside[-1]) / (outside[-1] - inside[-1])
    cut: Array = inside + share * (outside - inside)
    return cut


def _errors(curve: Curve, truth: Truth) -> Errors:
    """Compare a polygon with the truth; transitions are not among what peers report."""
    cut, folds = within(curve.points, truth.interval), _fold_error(curve.folds, truth)
    if len(cut) < 2:
        return Errors(np.inf, np.inf, np.nan, np.nan, np.nan, folds)
    nodes = cut / truth.scale
    branch = np.concatenate([from_polygon(s / truth.scale, nodes) for s in truth.samples])
    stored = _stored(curve.points, truth)
    return Errors(*summary(branch), *summary(stored), np.nan, folds)


def _stored(points: Array, truth: Truth) -> Array:
    """Return the distances of stored points inside the interval from the true curve."""
    lo, hi = truth.interval
    inside = points[(points[:, -1] >= lo) & (points[:, -1] <= hi)]
    every = max(1, -(-len(inside) // MOST_POINTS))
    return np.array([from_true(x, truth.pieces, truth.scale) for x in inside[::every]])


def _fold_error(folds: tuple[float, ...], truth: Truth) -> float:
    """Return the largest distance of a true fold from the nearest one reported."""
    length = truth.scale[-1]
    found = [np.array([alpha]) / length for alpha in folds]
    return farthest([x[-1:] / length for x in truth.folds], found)


def _are_folds(folds: tuple[float, ...], truth: Truth) -> bool:
    """Whether each reported fold is at a true one, and each true one is the nearest of some."""
    true = np.array([x[-1] for x in truth.folds])
    gaps = np.abs(np.subtract.outer(folds, true)) / truth.scale[-1]
    if not gaps.size:
        return len(folds) == len(true)
    return gaps.min(axis=1).max() <= NEAR and len(set(gaps.argmin(axis=1))) == len(true)


def _stopped(points: Array, truth: Truth) -> str:
    """Return what is wrong with the end of a curve, whose start is at an end of the interval."""
    if points.size <= points.shape[-1]:
        return "no curve"
    lo, hi = truth.interval
    last = float(points[-1, -1])
    if lo < last < hi:
        return f"stopped at alpha = {last:.6g}"
    cut = within(points, truth.interval) / truth.scale
    back = len(cut) > 1 and np.linalg.norm(cut[-1] - cut[0]) < NEAR
    return "turned back and came to its start" if back else ""


def _verdict(found: Errors, folds: tuple[float, ...], truth: Truth) -> str:
    """Return what is wrong with a curve that reaches an end; empty if it is right."""
    if found.branch_max > NEAR:
        return f"a part of the curve is missing, as far as {found.branch_max:.1g} away"
    if found.points_max > NEAR:
        return f"leaves the curve by {found.points_max:.1g}"
    if not _are_folds(folds, truth):
        places = ", ".join(f"{alpha:.6g}" for alpha in folds) or "none"
        return f"{len(truth.folds)} folds, reported: {places}"
    return ""
