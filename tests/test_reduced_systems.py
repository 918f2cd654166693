"""Systems that an equation in a single unknown decides: genes, firms, populations, in any unit."""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, explore


def zeros(function, lo, hi):
    """Return where a function of one unknown changes its sign, by bisection."""
    places = np.linspace(lo, hi, 200_001)
    values = function(places)
    i = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    a, b, sign = places[i], places[i + 1], np.sign(values[i])
    for _ in range(60):
        middle = 0.5 * (a + b)
        is_left = np.sign(function(middle)) == sign
        a, b = np.where(is_left, middle, a), np.where(is_left, b, middle)
    return 0.5 * (a + b)


class GeneRing:
    """Four genes, each switched by the gene before; the last is off while the third is on."""

    threshold = np.array([0.75, 0.47, 0.79, 0.68])
    slope = np.array([46.0, 41.6, 34.9, -21.2])
    most = np.array([1.76, 0.93, 1.89, 1.44])

    def made(self, i, x):
        return self.most[i] * (0.5 + 0.5 * np.tanh(self.slope[i] * (x - self.threshold[i]) / 2.0))

    def rows(self, x, alpha, sw):
        return [x[i] - self.made(i, x[i - 1]) - (alpha if i == 0 else 0.0) for i in range(4)]

    def numbers(self, alpha):
        """Return the first unknown of all solutions: the others follow one after another."""

        def round_trip(x):
            last = self.made(3, self.made(2, self.made(1, x)))
            return x - self.made(0, last) - alpha

        return zeros(round_trip, -4.0, 5.0)


@pytest.mark.slow
def test_genes_that_are_off_at_the_starts_are_not_measured_by_their_traces():
    """Genes that are off make 1e-12: measured by that, the genes took over 2,000 points."""
    ring = GeneRing()
    graph = explore(Switched(4, ring.rows), (-1.2, 1.2))
    for alpha in (-1.0, -0.9, 0.0, 0.3, 0.6):
        found = sorted(s.z[0] for s in graph.solutions(alpha))
        np.testing.assert_allclose(found, ring.numbers(alpha), atol=1e-7)
    assert sum(len(piece.alpha) for piece in graph.pieces) <= 1000


class Spillovers(PiecewiseSystem):
    """Firms that invest if all together invest: x = (1 + alpha) cap S^2 / (k^2 + S^2).

    Nobody invests at all, for any alpha: H has no terms there, and only bends show the units.
    """

    size = 3
    cap, k = np.array([0.9, 1.3, 1.1]), np.array([0.3, 0.6, 0.4])

    def __init__(self, unit):
        self.unit = unit

    def answers(self, S, alpha):
        return (1.0 + alpha) * self.cap * S**2 / (self.k**2 + S**2)

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        x = z / self.unit
        return x - self.answers(np.mean(x), alpha)

    def numbers(self, alpha):
        return zeros(lambda S: self.answers(S[:, np.newaxis], alpha).mean(axis=1) - S, -1.001, 3.0)


@pytest.mark.sweep(2)
@pytest.mark.parametrize("unit", [[1.0, 1.0, 1.0], [1e4, 0.1, 20.0], [1e6, 1e-6, 1e-3]])
def test_products_alone_tell_no_unit(unit):
    system = Spillovers(np.array(unit))
    graph = explore(system, (0.0, 1.2))
    for alpha in (0.1, 0.5, 0.7, 1.1):
        found = sorted(np.mean(s.z / system.unit) for s in graph.solutions(alpha))
        np.testing.assert_allclose(found, system.numbers(alpha), atol=1e-7)


class Patches(PiecewiseSystem):
    """Three patches in a row with an Allee effect, harvest above a threshold, and a predator.

    Each equation gives the population of the next patch, so that the first population decides.
    """

    size, moves = 3, 0.1627
    most, least = np.array([1.2039, 1.4774, 1.4178]), np.array([0.2903, 0.1866, 0.3973])
    threshold, harvest = np.array([0.5758, 0.527, 0.3278]), np.array([0.2871, 0.4265, 0.1606])
    unit = np.array([2.68e-4, 0.304, 1.05e-3])

    def growth(self, i, x, alpha, is_high):
        own = 0.5 * x * (1.0 - x / self.most[i]) * (x / self.least[i] - 1.0)
        predator = alpha * x / (x * x + 0.2) if i == 0 else 0.0
        return own - self.harvest[i] * is_high * (x - self.threshold[i]) - predator

    def test_functions(self, z, alpha):
        return z / self.unit - self.threshold

    def residual(self, z, alpha, character):
        x = z / self.unit
        own = [self.growth(i, x[i], alpha, character.signs[i]) for i in range(3)]
        return np.array(own) + self.moves * np.diff(x[[0, 0, 1, 2, 2]], 2)

    def numbers(self, alpha):
        def rest(x):
            before, here = x, x
            for i in range(3):
                own = self.growth(i, here, alpha, here > self.threshold[i])
                before, here = here, 2.0 * here - before - own / self.moves
            return here - before

        return zeros(rest, -1.0, 2.0)


@pytest.mark.slow
def test_populations_in_far_units():
    """Starts alone missed one branch, "balanced"; a side path leads there from another."""
    system = Patches()
    graph = explore(system, (0.0, 0.3))
    for alpha in (0.03, 0.07, 0.15, 0.2, 0.23):
        found = sorted(s.z[0] / system.unit[0] for s in graph.solutions(alpha))
        np.testing.assert_allclose(found, system.numbers(alpha), atol=1e-7)
