"""A zero of a function on the curve of one selection, by Newton from a guess.

Failure modes and answers
-------------------------
- The curve is tangent to the zero set: the bordered matrix is singular and the answer is a
  :class:`~pwscont.basics.outcome.Failure`, not a point.
- The curve is nearly tangent to the zero set: at the angle d, a correction c is followed by one of
  about c^2 / d, which need not be rounding where c is small. Newton goes on until its corrections
  are rounding; where they never are, the last correction counts as an error.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.corrector import Corrected
from pwscont.curve.curve import Curve, State
from pwscont.curve.newton import MOST_CHORDS, Border, again, direction, newton
from pwscont.curve.root import Root
from pwscont.curve.uncertainty import is_within, uncertainty, unseen_rounding

MOST_NEWTON = 8


def zero(curve: Curve, border: Border, x: Array) -> Corrected | Failure:
    """Return the state next to ``x`` at which ``border`` vanishes, and falls along the tangent.

    Parameters
    ----------
    curve : Curve
    border : callable
        x -> (value, gradient).
    x : ndarray, shape (n + 1,)
        Where Newton begins.
    """
    root = newton(curve, border, x, MOST_NEWTON)
    if isinstance(root, Failure):
        return root
    if root.factor.is_singular():
        return Failure(FailureReason.SINGULAR)
    if curve.selection.is_straight:
        return falling(curve, root, uncertainty(root))
    return falling(curve, *_polished(curve, border, root))


def falling(curve: Curve, root: Root, error: Array) -> Corrected | Failure:
    """Return the state at a root, whose tangent points to where the border falls."""
    factor, rising = direction(curve, root)
    if factor.failed:
        return Failure(FailureReason.SINGULAR)
    state = State(root.x, -rising, error, -factor.sign, located_by=factor)
    return Corrected(state, root.iterations, factor, root.contraction)


def _polished(curve: Curve, border: Border, root: Root) -> tuple[Root, Array]:
    """Return the root once its corrections are rounding, and its uncertainty.

    Rounding is all that is left of nearly every root after a few corrections more with the
    factorisation that it has; another one is made where these do not shrink.
    """
    settled = again(curve, border, root)
    unseen = unseen_rounding(curve, settled, lambda y: border(y)[0])
    error = uncertainty(settled, unseen)  # that of a few corrections more differs by rounding
    for _ in range(MOST_CHORDS):
        if is_within(settled, error) and curve.metric.admits(settled.x):
            return settled, error
        settled = again(curve, border, settled)
    for _ in range(MOST_NEWTON):
        found = newton(curve, border, root.x, MOST_NEWTON)
        if isinstance(found, Failure):
            break
        root, error = found, uncertainty(found, unseen)
        if is_within(root, error):
            return root, error
    return root, np.vstack([uncertainty(root, unseen), root.error])
