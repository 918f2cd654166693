"""Switches with double zeros, such as relu(z)**2 - alpha**2: at a corner slopes tell no cell."""

import numpy as np
import pytest

from pwscont import Switched, explore


class Plain:
    """The switches for plain numbers."""

    abs, max, min = staticmethod(np.abs), staticmethod(np.maximum), staticmethod(np.minimum)

    @staticmethod
    def relu(x):
        return np.maximum(x, 0.0)


FORMULAS = {
    "a square beside a square": lambda z, t, sw: z + sw.abs(0.7 * z**2 - sw.relu(t) ** 2) - 0.9 * t,
    "a square that changes sign": lambda z, t, sw: (
        z + sw.min(0.3 * z, sw.max(sw.abs(z) * z - sw.relu(t) ** 2, 0.0)) - 0.9 * t
    ),
    "two sides of a square": lambda z, t, sw: (
        0.5 * z
        + sw.min(np.sin(0.53 * np.sin(0.55 * z)), sw.max(sw.abs(z) * z - sw.relu(t) ** 2, 0.0))
        - 0.9 * t
    ),
    "a product": lambda z, t, sw: z + sw.abs(0.4 * z * t - 0.7 * sw.relu(z) ** 2) - 0.9 * t,
    "a cube": lambda z, t, sw: z + sw.max(0.7 * z**3 - sw.abs(t) * t, 0.0) - t,
}


def number_of_zeros(formula, t):
    """Count sign changes on a grid with no node at a zero."""
    values = formula(np.linspace(-40.0123, 40.0, 400_001), t, Plain)
    return int((values[1:] * values[:-1] < 0.0).sum())


@pytest.mark.parametrize("name", FORMULAS)
@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.sweep(10)
def test_curves_go_on_into_the_right_cell(name, n):
    formula, u = FORMULAS[name], np.array([[0.8, -0.6], [0.6, 0.8]])

    def residual(z, t, sw):
        return [formula(z @ u[0], t, sw), z @ u[1] - np.sin(z @ u[0])]

    system = Switched(n, residual if n == 2 else formula)
    graph = explore(system, (-1.0, 1.3))
    assert "stopped" not in graph.guarantee
    assert "not complete" not in graph.guarantee
    for t in (-0.77, -0.213, 0.31, 0.9):
        assert graph.count(t) == number_of_zeros(formula, t)
