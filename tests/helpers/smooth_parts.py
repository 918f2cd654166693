"""What tests of smooth special points share."""

import numpy as np

from pwscont import (
    PiecewiseSystem,
)

LOCATED = 1e-10


class Smooth(PiecewiseSystem):
    """A system of one cell."""

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def test_jacobian(self, z, alpha):
        return np.zeros((0, self.size + 1))
