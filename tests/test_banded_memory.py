"""Banded Jacobians of many unknowns stay bands: no dense matrix of their size is made."""

import tracemalloc

import numpy as np
from scipy import sparse

from pwscont import BandedJacobian, PiecewiseSystem, trace


class StringOnASpring(PiecewiseSystem):
    """A string of 1,500 nodes with a cubic bedding and a stop in the middle."""

    size = 1500

    def test_functions(self, z, alpha):
        return z[self.size // 2 : self.size // 2 + 1] - 0.05

    def test_jacobian(self, z, alpha):
        return sparse.csr_matrix(([1.0], ([0], [self.size // 2])), (1, self.size + 1))

    def residual(self, z, alpha, character):
        h, padded = 1.0 / (self.size + 1), np.pad(z, 1)
        rows = -np.diff(padded, 2) / h + h * z**3 - 10.0 * alpha * h
        if character.signs[0]:
            rows[self.size // 2] += 50.0 * (z[self.size // 2] - 0.05)
        return rows

    def jacobian(self, z, alpha, character):
        h = 1.0 / (self.size + 1)
        diagonal, beside = 2.0 / h + 3.0 * h * z**2, np.full(self.size, -1.0 / h)
        if character.signs[0]:
            diagonal[self.size // 2] += 50.0
        return BandedJacobian(np.vstack([beside, diagonal, beside]), 1, 1, 0.0 * z - 10.0 * h)


def test_a_band_stays_a_band():
    system = StringOnASpring()
    tracemalloc.start()
    graph = trace(system, (np.zeros(system.size), 0.0), (0.0, 1.0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(graph.special_points("transition")) == 1
    assert peak < 4 * system.size**2  # half of one dense matrix
