"""A detector that tests of readings share."""

import numpy as np

from pwscont import (
    TransitionDetector,
)
from pwscont.extending import (
    Ray,
    Reading,
    SpecialPointFound,
    locate_sign_change,
)


class At(TransitionDetector):
    """Marks where the first unknown passes -1/2, with slopes or without."""

    def __init__(self, locate=locate_sign_change, slopes=1.0):
        self.located, self.slopes = locate, slopes

    def read(self, curve, state):
        g, t = state.x[0] + 0.5, self.slopes * state.tangent[0]
        g = 0.0 if abs(g) < 1e-12 else g
        return Reading(np.array([g, -g]), np.array([t, -t]))

    def locate(self, segment, index, bracket):
        return self.located(segment, lambda state: state.x[0] + 0.5, bracket)

    def arrive(self, curve, state, index):
        forth = Ray(curve, state)
        return SpecialPointFound("at", state.x, "z is -1/2", (forth.reversed(), forth))
