"""Equations that wave: magnitudes of unknowns, against counted changes of sign."""

import numpy as np
import pytest

from pwscont import Switched, explore
from pwscont.curve.magnitudes import rough_magnitudes

INTERVAL = (0.1, 1.5)


def waves(unit):
    """No term of H tells the unit at z = 0, which solves H for all alpha; sin(z) bends often."""

    def equations(z, a, sw):
        return [np.sin(z[0] / unit) - a * z[1], z[1] + 0.3 * sw.relu(z[1]) - z[0] / unit]

    return Switched(2, equations)


@pytest.mark.parametrize("unit", [1e6, 1e-6, 1e-20, 1e20])
def test_a_wave_beside_a_solution_that_stays_is_measured_in_its_unit(unit):
    sizes = rough_magnitudes(waves(unit).within(*INTERVAL), INTERVAL, np.zeros(2))
    assert 0.1 < sizes[0] / unit < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e6, 1.0, 1e-6])
def test_a_wave_beside_a_solution_that_stays_is_followed_in_its_unit(unit):
    graph = explore(waves(unit), INTERVAL)
    y = np.linspace(-20.0, 20.0, 100_000)  # without 0
    for alpha in (0.13, 0.2, 0.9):
        signs = np.sign(np.sin(y) - alpha * (y - 0.3 / 1.3 * np.maximum(y, 0.0)))
        assert graph.count(alpha) == np.count_nonzero(np.diff(signs))
