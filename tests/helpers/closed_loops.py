"""Systems with closed loops that reach no end of the interval."""

import numpy as np

from pwscont import PiecewiseLinearSystem


class Diamond(PiecewiseLinearSystem):
    """|z| + |alpha| = 1, by one sign each."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha])

    def residual(self, z, alpha, character):
        s, t = (1.0 if sign else -1.0 for sign in character.signs)
        return np.array([s * z[0] + t * alpha - 1.0])


class DiamondAndLine(PiecewiseLinearSystem):
    """min(z, w) = 0 with w = |z - 4| + |alpha - a| - 1: the line z = 0, and a diamond."""

    size = 2

    def __init__(self, centre):
        self.centre = centre

    def test_functions(self, z, alpha):
        return np.array([z[0] - 4.0, alpha - self.centre, z[1] - z[0]])

    def residual(self, z, alpha, character):
        s, t = (1.0 if sign else -1.0 for sign in character.signs[:2])
        w = s * (z[0] - 4.0) + t * (alpha - self.centre) - 1.0
        return np.array([z[1] - w, z[0] if character.signs[2] else z[1]])
