"""The tolerances, each named once and derived from the unit roundoff.

Every tolerance is relative; what it multiplies is said where the tolerance is used.
"""

from __future__ import annotations

import sys

#: Unit roundoff of IEEE double precision.
EPS = sys.float_info.epsilon

#: Newton has converged when its last correction is below this times the size of the point.
#: The next correction would be of the order of its square, which is below rounding.
CONVERGED = 1e-11

#: A quantity is zero when it is below this many times the rounding error of its own terms.
#: A dot product of k terms errs by at most k EPS; the solves before it add a few digits.
GUARD = 64.0

#: A quantity is zero when it is below this many times its estimated error. The estimate is the root
#: of the sum of squares of a few samples, or of all columns of the inverse where these are few; the
#: chance that the true error is ten times as large is negligible.
CONFIDENCE = 10.0

#: Parameter values closer than this times their scale are one value.
SAME_ALPHA = 64.0 * EPS
