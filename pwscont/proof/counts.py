"""What is proved of the solutions of a formula in a box, counted between folds.

Theorem (the page "Proofs" of the manual): between groups of open boxes every solution in the
box lies in a tube and inside the boundary of the box, so that the number of solutions in the box is
constant on every stretch of alpha between groups; the number is counted at one alpha of the
stretch.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.graph.proved import BoxProof, Corners, CountedStretch, Range
from pwscont.graph.structure import connected
from pwscont.proof.boxes import evaluated, inverse_of, with_slopes
from pwscont.proof.groups import grouped
from pwscont.proof.interval import FUNCTION_ULPS, Interval, chosen, together
from pwscont.proof.search import FINEST_ALPHA, ROOM, Tubes, polished, proved, slack
from pwscont.proof.tape import Tape

#: Places, as parts of a stretch between groups, where solutions are counted one after the other,
#: until counts are certain.
PLACES = (0.5, 0.381966, 0.61803, 0.26, 0.74)
#: How many of these counts have to agree.
AGREEING = 2
ASSUMED = (
    "assumed: a formula without state, the same for numbers and for the tape; arithmetic of "
    f"IEEE 754 to nearest; elementary functions of numpy within {FUNCTION_ULPS:g} units in "
    "the last place"
)
#: Assumed of classes besides.
AGREEING_SELECTIONS = "; selections of a class that agree where tests vanish"


def counted_proof(
    tape: Tape,
    box: Interval,
    scale: Array,
    tubes: Tubes | None,
    open_boxes: Interval,
    boxes: int,
    *,
    is_whole: bool = False,
) -> BoxProof:
    """Return what tubes and open boxes, with all solutions in a box (n + 1,), prove.

    ``scale``: the magnitudes of (z, alpha); ``boxes``: how many boxes were looked at; ``is_whole``:
    whether a proof of a part is of no use, so that nothing is counted where a box is open.
    """
    hulls, passed, turns = grouped(tape, open_boxes, box, scale)
    unsaid = _united(hulls[-1], FINEST_ALPHA * float(scale[-1]))
    interval = float(box.lo[-1]), float(box.hi[-1])
    ends = [interval[0], *(end for each in unsaid for end in each), interval[1]]
    pairs = zip(ends[::2], ends[1::2], strict=True) if passed.all() or not is_whole else ()
    return BoxProof(
        (box.lo[:-1], box.hi[:-1]),
        interval,
        [_counted(tape, box, tubes, each) for each in pairs if each[0] < each[1]],
        [(*each, _turn_of(turns, hulls[-1], *each)) for each in unsaid],
        list(zip(hulls.lo.T[~passed], hulls.hi.T[~passed], strict=True)),
        boxes,
        ASSUMED + (AGREEING_SELECTIONS if any(s.name == "select" for s in tape.steps) else ""),
    )


def _turn_of(turns: Array, alphas: Interval, lo: float, hi: float) -> float:
    """Return the turn of all groups within a range of alpha together."""
    own = turns[(alphas.lo >= lo) & (alphas.hi <= hi)]
    least, largest = float(own.min()), float(own.max())
    return float(np.sign(least + largest)) if least * largest >= 0.0 else np.nan


def _united(ranges: Interval, apart: float) -> list[Range]:
    """Return the union of ranges; ranges closer together than ``apart`` become one range."""
    united: list[Range] = []
    for lo, hi in sorted(zip(ranges.lo.tolist(), ranges.hi.tolist(), strict=True)):
        if united and lo <= united[-1][1] + apart:
            united[-1] = (united[-1][0], max(hi, united[-1][1]))
        else:
            united.append((lo, hi))
    return united


def _counted(tape: Tape, box: Interval, tubes: Tubes | None, stretch: Range) -> CountedStretch:
    """Return a stretch with the solutions, whose numbers at several places agree."""
    lo, hi = stretch
    known: dict[float, list[Corners]] = {}
    for alpha in (lo + (hi - lo) * part for part in PLACES):
        found = _solutions(tape, box, tubes, alpha) if lo < alpha < hi else None
        if found is not None:
            known[alpha] = found
        if len(known) == AGREEING:
            break
    if len({len(found) for found in known.values()}) != 1:
        return CountedStretch(lo, hi, 0.5 * (lo + hi), None)
    return CountedStretch(lo, hi, *next(iter(known.items())))


@np.errstate(all="ignore")
def _solutions(
    tape: Tape, box: Interval, tubes: Tubes | None, alpha: float
) -> list[Corners] | None:
    """Return an enclosure (least, largest) of every solution in the box at alpha, off all groups.

    None where solutions are not told apart for certain.
    """
    if tubes is None:
        return []
    tubes = tubes.only((tubes.first <= alpha) & (alpha <= tubes.last))
    found, whole = _enclosed(tape, tubes, alpha), box[:-1, np.newaxis]
    outside = np.any((found.hi < whole.lo) | (found.lo > whole.hi), axis=0)
    tubes, found = tubes.only(~outside), found[:, ~outside]
    groups = _distinct(tubes, found, alpha) if found.is_within(whole).all() else None
    return None if groups is None else [(found.lo[:, i], found.hi[:, i]) for i in groups]


def _enclosed(tape: Tape, tubes: Tubes, alpha: float) -> Interval:
    """Return narrow enclosures of the solutions in tubes at one alpha, shape (n, k)."""
    point = Interval(np.full(len(tubes.first), alpha))
    known = tubes.at(point, tubes.image)
    slopes = with_slopes(tape.slopes, together(np.vstack, known, point))[1]
    matrix = inverse_of(slopes.middle()[:, :-1])
    centre = polished(tape, np.vstack([known.middle(), point.lo]), matrix)
    value = evaluated(tape, Interval(np.vstack([centre, point.lo])))
    far = np.einsum("ijb,jb->ib", np.abs(matrix), value.reach())
    radius = ROOM * far + slack(centre) + slack(tubes.radius)
    thin = Tubes(point.lo, point.lo, point.lo, centre, np.zeros_like(centre), radius, radius)
    thin, is_proved = proved(tape, thin, radius, matrix)
    found = thin.at(point, thin.image)
    return chosen(is_proved & tubes.hold(found, point), found, known)


def _distinct(tubes: Tubes, found: Interval, alpha: float) -> list[int] | None:
    """Return one tube for every different solution, None where two are not told apart.

    Solutions whose enclosures do not meet are different. Two enclosures that lie in one tube hold
    the same solution.
    """
    count, pairs = len(tubes.first), []
    for i in range(count):
        others = np.arange(i + 1, count)
        apart = (found.lo[:, others] > found.hi[:, [i]]) | (found.hi[:, others] < found.lo[:, [i]])
        others = others[~apart.any(axis=0)]
        mine, point = np.full(len(others), i), Interval(np.full(len(others), alpha))
        is_same = tubes.only(mine).hold(found[:, others], point)
        if not (is_same | tubes.only(others).hold(found[:, mine], point)).all():
            return None
        pairs += [(i, int(j)) for j in others]
    return [min(group) for group in connected(range(count), pairs)]
