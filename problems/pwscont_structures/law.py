"""The force of a von Mises truss, with or without a stop."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, final

import numpy as np
from scipy.optimize import brentq

from pwscont.extending import EPS, Array

#: Compressions at which p(d) = d (d - 1)(d - 2) has a local maximum and a local minimum.
LIMITS = (1.0 - 3.0**-0.5, 1.0 + 3.0**-0.5)


@final
class SnapLaw:
    """The force k d (d - 1)(d - 2) + stiffness max(0, d - place).

    Parameters
    ----------
    k : float or ndarray
    place, stiffness : float
        Place and stiffness of the stop; the defaults stand for no stop.
    """

    def __init__(self, k: Any, place: float = np.inf, stiffness: float = 0.0) -> None:
        self.k, self.place, self.stiffness = k, place, stiffness

    def __call__(self, d: Any) -> Any:
        """Return the force at a compression d."""
        bare = self.k * d * (d - 1.0) * (d - 2.0)
        return bare + self.stiffness * np.maximum(0.0, d - self.place) if self.stiffness else bare

    def slope(self, d: Any) -> Any:
        """Return the derivative of the force without the stop."""
        return self.k * (3.0 * d * (d - 2.0) + 2.0)

    def turns(self) -> Array:
        """Return where the force may turn: the stationary points and the kink, ascending."""
        if not self.stiffness:
            return np.array(LIMITS)
        inside = 1.0 - self.stiffness / self.k  # of 3 (d - 1)^2 = 1 - stiffness / k
        beyond = 1.0 + np.sqrt(inside / 3.0) * np.array([-1.0, 1.0]) if inside > 0.0 else ()
        turns = [d for d in LIMITS if d < self.place] + [d for d in beyond if d > self.place]
        return np.sort([*turns, self.place])

    def compressions(self, force: float) -> list[float]:
        """Return all compressions at which the force has a given value, ascending."""
        pushed = self.stiffness * max(-self.place, 0.0)  # by a stop that touches at d = 0
        far = 3.0 + np.cbrt((abs(force) + pushed) / self.k)  # beyond, |p| is larger
        knots = [-far, *(d for d in self.turns() if abs(d) < far), far]

        def excess(d: float) -> float:
            return float(self(d) - force)

        roots = [
            brentq(excess, a, b, xtol=EPS, rtol=4.0 * EPS)
            for a, b in pairwise(knots)
            if excess(a) * excess(b) <= 0.0
        ]
        return sorted(set(roots))
