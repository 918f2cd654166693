"""The tolerances, each named once and derived from the unit roundoff.

Every tolerance is relative; the place of use says what the tolerance multiplies.
"""

from __future__ import annotations

import sys

#: Unit roundoff of IEEE double precision.
EPS = sys.float_info.epsilon

#: Half of the digits: values that differ by no more than this part of their terms may be equal
#: where derivatives by differences, a double zero or an ill-conditioned solve lose the other half.
HALF_DIGITS = EPS**0.5

#: Least normal number, as a divisor in place of zero.
TINY = sys.float_info.min

#: Newton has converged when the last correction is below CONVERGED times the size of the point. The
#: next correction would be of the order of the square of the last, which is below rounding.
CONVERGED = 1e-11

#: A quantity is zero if below GUARD times the rounding error of the quantity's own terms. A
#: dot product of k terms errs by at most k EPS; the solves before the product add a few digits.
GUARD = 64.0

#: A quantity is zero if below CONFIDENCE times the quantity's estimated error. The estimate
#: is the root of the sum of squares of a few samples, or of all columns of an inverse with few
#: columns; the chance that the true error is ten times as large is negligible.
CONFIDENCE = 10.0

#: Parameter values closer than SAME_ALPHA times the scale of the parameter are the same value.
SAME_ALPHA = 64.0 * EPS

#: States of two evolutions are one state when they differ by less than SAME_STATE times their size:
#: the rounding errors of some thousand events, each of GUARD units, add up to less.
SAME_STATE = 2.0**10 * GUARD * EPS
