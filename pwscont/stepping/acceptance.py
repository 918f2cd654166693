"""When a corrected point lies on the curve that the step began on (docs/theory, F14).

Failure modes and answers
-------------------------
- The corrector converges far from the prediction, on another part of the curve: the correction
  is measured against the step.
- It converges on a neighbouring sheet of the same selection: the prediction was off by as much as
  the sheets are apart, so Newton is not in its quadratic regime, and the ratio of its first two
  corrections is not small (Deuflhard 2011, chapter 5).
- Both accept by chance, where the sheets are much closer than the step: the cubic between the two
  points, which the graph interpolates, then leads from one sheet to the other, and at points inside
  the step it is off by the part of their distance that it has crossed there.
- The check itself must be cheap: a point inside costs one residual and one solution with the
  factorisation that the corrector leaves. One point is enough if it is well chosen: where the cubic
  has crossed a golden section of the distance between the sheets, of all parts the one whose
  multiples stay farthest from whole numbers, so that no sheet between passes for the curve.

What stays unseen: sheets that are closer than about a thousandth of a step.
"""

from __future__ import annotations

import math

from pwscont.foundation.arrays import Array
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.foundation.rounding import EPS
from pwscont.numerics.corrector import Corrected
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.root import joined
from pwscont.numerics.step_size import StepSize
from pwscont.stepping.stepper import BESIDE, CurvedSegment

#: Largest correction, as a part of the step.
FARTHEST = 0.1
#: Largest ratio of the first two corrections.
SLOWEST = 0.1
#: Largest distance of the cubic between both points from the curve, as a part of the step.
OFF = 0.1 * BESIDE
#: What is not told apart anyway, in the metric: by so much it may be off however short the step is,
#: where tangents from differences are no better.
NEGLIGIBLE = EPS**0.5
#: Where the cubic is looked at, as a part u of the step: 3 u^2 - 2 u^3 is the golden section there.
INSIDE = 0.4209


def accepted(
    curve: Curve,
    state: State,
    predicted: Array,
    corrected: Corrected,
    length: float,
    step_size: StepSize,
) -> CurvedSegment | Failure:
    """Return the segment from a state to a corrected prediction, if the step is true.

    Parameters
    ----------
    curve : Curve
    state : State
        Where the step begins.
    predicted : ndarray, shape (n + 1,)
    corrected : Corrected
    length : float
        Length of the step, in the metric.
    step_size : StepSize
        Judges the turn, and suggests the length of the next step.
    """
    end = corrected.state
    cosine = float(curve.metric.covector(state.tangent).dot(end.tangent))
    off = curve.metric.norm(end.x - predicted)
    strain = max(off / (FARTHEST * length), corrected.contraction / SLOWEST)
    if not (strain <= 1.0 and step_size.accepts(cosine)):
        return Failure(Trouble.JUMP)
    segment = CurvedSegment.between(curve, state, end, length)
    strain = max(strain, _off(segment, corrected) / (OFF * length + NEGLIGIBLE))
    if not strain <= 1.0:
        return Failure(Trouble.JUMP)
    return segment.suggesting(step_size.after(length, strain, cosine))


def _off(segment: CurvedSegment, corrected: Corrected) -> float:
    """Return how far the cubic of a segment is from the curve, infinite outside the interval."""
    curve, x = segment.curve, segment.near(INSIDE * segment.length)
    if not curve.metric.admits(x):
        return math.inf
    return curve.metric.norm(corrected.factor.solve(joined(curve.selection.residual(x), 0.0)))
