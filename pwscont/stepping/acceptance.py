"""When a corrected point lies on the curve that the step began on (docs/theory, F14).

Failure modes and answers
-------------------------
- The corrector converges far from the prediction, on another part of the curve: the correction
  is measured against the step.
- The corrector converges on a neighbouring sheet of the same selection: the prediction was off by
  as much as the sheets are apart, so Newton is not in its quadratic regime, and the ratio of its
  first two corrections is not small (Deuflhard 2011, chapter 5).
- Both measures accept by chance, where the sheets are much closer than the step: the cubic between
  the two points, which the graph interpolates, then leads from one sheet to the other, and inside
  the step the cubic is off by the part of the sheets' distance that it has crossed there.
- Ill-conditioned curves are known to few digits: where a step fails, the error that rounding makes
  of its point is estimated, and measures no larger than that error tell nothing.
- The check itself must be cheap: a point inside costs one residual and one solution with the
  factorisation that the corrector leaves. One point is enough if it is well chosen: where the cubic
  has crossed a golden section of the distance between the sheets, of all parts the one whose
  multiples stay farthest from whole numbers, so that no sheet between passes for the curve.
- A jump over many sheets at once may pass even so: for Fibonacci numbers the golden multiple is
  nearly whole. Such a jump needs a large correction: there a second point is looked at, and the
  larger the correction, the closer the cubic must be.

What stays unseen: sheets that are closer than about a thousandth of a step.
"""

from __future__ import annotations

import math

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.basics.rounding import CONFIDENCE, EPS
from pwscont.curve.corrector import Corrected
from pwscont.curve.curve import Curve, State
from pwscont.curve.error_samples import magnitude
from pwscont.curve.predictor import arc
from pwscont.curve.root import Root
from pwscont.curve.step_size import StepSize
from pwscont.curve.uncertainty import uncertainty
from pwscont.linear.vectors import dot
from pwscont.stepping.looks import farthest_off
from pwscont.stepping.stepper import BESIDE, CurvedSegment

#: Largest correction, as a part of the step.
FARTHEST = 0.1
#: Largest ratio of the first two corrections.
SLOWEST = 0.1
#: Largest distance of the cubic between both points from the curve, as a part of the step.
OFF = 0.1 * BESIDE
#: Where the correction is a larger part of the step than this, the cubic is looked at twice.
SURE = 3e-3
#: Where the correction is larger than this part, the cubic must be the closer to the curve.
CLOSE = 1e-2
#: Where the cubic is looked at in the second place: at sqrt(3) - 1 of the distance between sheets.
SECOND = 0.6602
#: The cubic may be off by so much, in the metric, however short the step is: tangents from
#: differences are no better, and points this close are not told apart anyway.
NEGLIGIBLE: float = EPS**0.5


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
    cosine = dot(curve.metric.covector(state.tangent), end.tangent)
    if not step_size.accepts(cosine):
        return Failure(FailureReason.JUMP)
    segment = CurvedSegment.between(curve, state, end, length)
    correction = curve.metric.norm(end.x - predicted)
    measured = correction, _off(segment, corrected, is_sure=correction <= SURE * length)
    strain = _strain(*measured, corrected.contraction, length, NEGLIGIBLE)
    if not strain <= 1.0 and math.isfinite(measured[1]):
        strain = _strain(*measured, corrected.contraction, length, _noise(curve, corrected))
    if strain <= 1.0:
        inside = farthest_off(segment, corrected.factor, step_size.gap, OFF * length)
        strain = max(strain, inside / (OFF * length + NEGLIGIBLE))
        if 1.0 < strain < math.inf:
            strain = inside / (OFF * length + _noise(curve, corrected))
    if not strain <= 1.0:
        return Failure(FailureReason.JUMP)
    segment.suggestion = step_size.after(length, strain, cosine)
    end.comes_from(state, arc(segment.length, cosine))
    return segment


def _strain(
    correction: float, off: float, contraction: float, length: float, noise: float
) -> float:
    """Return what a step makes of its tolerances, more than 1 where it must not be taken.

    A correction that is no larger than the noise, and a cubic that is off by no more, tell nothing.
    """
    by_contraction = contraction / SLOWEST if correction > noise else 0.0
    by_correction = correction / (FARTHEST * length + noise)
    allowed = OFF * length * min(1.0, CLOSE * length / max(correction, noise))
    return max(by_contraction, by_correction, off / (allowed + noise))


def _noise(curve: Curve, corrected: Corrected) -> float:
    """Return how far a corrected point may be off because of rounding."""
    state, metric = corrected.state, curve.metric
    jacobian, row = curve.selection.jacobian(state.x), metric.covector(state.tangent)
    root = Root(state.x, state.error[0], jacobian, row, corrected.factor, metric.scale, 0)
    return NEGLIGIBLE + CONFIDENCE * metric.norm(magnitude(state.x, uncertainty(root)))


def _off(segment: CurvedSegment, corrected: Corrected, is_sure: bool) -> float:
    """Return how far the cubic of a segment is from the curve, infinite outside the interval.

    It is looked at in a second point where the prediction was not sure enough. A straight line
    through two of its points is the curve.
    """
    if segment.curve.selection.is_straight:
        return 0.0
    off = _off_at(segment.inside, segment, corrected)
    if is_sure or not math.isfinite(off):
        return off
    return max(off, _off_at(segment.near(SECOND * segment.length), segment, corrected))


def _off_at(x: Array, segment: CurvedSegment, corrected: Corrected) -> float:
    curve = segment.curve
    if not curve.metric.admits(x):
        return math.inf
    return curve.metric.norm(corrected.factor.solve(curve.selection.residual_and(x, 0.0)))
