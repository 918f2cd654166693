"""Intervals of alpha far from zero or very short, and paths that begin small."""

from itertools import product

import numpy as np
import pytest

from pwscont import LCP, InvalidInputError, Switched, explore, trace


class Epidemic:
    """a x (1 - 3 x) - x - min(2 x, 0.1) + seed = 0 with a = (t - zero) / unit; calls counted."""

    def __init__(self, zero=0.0, unit=1.0, seed=1e-4):
        self.zero, self.unit, self.seed, self.calls = zero, unit, seed, 0

    def __call__(self, x, t, sw):
        self.calls += 1
        a = (t - self.zero) / self.unit
        return a * x * (1.0 - 3.0 * x) - x - sw.min(2.0 * x, 0.1) + self.seed

    def ill(self, a):
        few = np.roots([-3.0 * a, a - 3.0, self.seed])
        many = np.roots([-3.0 * a, a - 1.0, self.seed - 0.1])
        kept = [*few[few < 0.05], *many[np.isreal(many) & (many.real >= 0.05)].real]
        return np.sort(np.real(kept))

    def check(self):
        at = self.zero + self.unit * np.array([0.3, 8.0])
        graph = explore(Switched(1, self), tuple(at))
        for a in (0.4, 2.5, 3.0, 3.3, 5.0, 7.0):
            t = self.zero + a * self.unit
            found = [s.z[0] for s in graph.solutions(t)]
            exact = self.ill((t - self.zero) / self.unit)
            np.testing.assert_allclose(sorted(found), exact, rtol=1e-6)
        return self.calls


@pytest.mark.slow
def test_a_path_that_begins_small_soon_has_its_own_magnitude():
    assert Epidemic().check() <= 40_000


@pytest.mark.slow
def test_rounding_of_alpha_far_from_zero_is_no_hidden_fold():
    own = Epidemic(seed=1e-3).check()
    assert Epidemic(1e6, 1e-4, seed=1e-3).check() <= 1.5 * own


def test_straight_pieces_whose_constants_cancel_far_from_zero_are_straight():
    # x = clip(a + x / 2 - 2, 0, 1) with a = (t - 1e6) 3333.3, at rest until a = 2, full from 2.5
    def payment(x, t, sw):
        return x - sw.clip((t - 1e6) * 3333.3 + 0.5 * x - 2.0, 0.0, 1.0)

    system, lo, hi = Switched(1, payment, linear=True), 1e6, 1e6 + 1e-3
    for part in np.linspace(0.0, 0.5, 9):
        graph = trace(system, ([0.0], lo + part * (hi - lo)), (lo, hi))
        rests, half, full = (graph.solutions(lo + a / 3333.3)[0].z[0] for a in (1.0, 2.25, 3.0))
        np.testing.assert_allclose([rests, half, full], [0.0, 0.5, 1.0], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "width"), [(1.0, 1e-9), (1e3, 1e-7)])
def test_a_short_interval_does_not_make_unknowns_tiny(unit, width):
    # two pumps with a hump and a check valve each, against the same pressure
    lift, hump, loss = np.array([1.5, 1.2]), np.array([1.0, 1.4]), np.array([1.0, 0.8])

    def pumps(q, p, sw):
        q = q / unit
        return sw.min(q, p - lift - hump * q**2 + loss * q**3)

    def flows(i, p):
        roots = np.roots([loss[i], -hump[i], 0.0, p - lift[i]])
        real = roots[abs(roots.imag) < 1e-9].real
        return [*real[real > 0.0], *([0.0] if p > lift[i] else [])]

    for p in (0.4, 1.58):
        interval, states = (p, p + width), list(product(flows(0, p), flows(1, p)))
        assert explore(Switched(2, pumps), interval).count(p + 0.5 * width) == len(states)
        for state in states:
            near = unit * (np.array(state) + 1e-3)
            [found] = trace(Switched(2, pumps), (near, p), interval).solutions(p)
            np.testing.assert_allclose(found.z / unit, state, atol=1e-6)


def test_an_interval_of_rounding_is_refused():
    """Of three solutions two or none were found, "complete", over a few numbers of alpha."""
    problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    for hi in (np.nextafter(0.2, 1.0), 0.2 + 1e-15, 0.2 + 1e-13):
        with pytest.raises(InvalidInputError, match="rounding hides"):
            explore(problem, (0.2, hi))
    graph = explore(problem, (0.2, 0.2 + 1e-12))
    assert [graph.count(alpha) for alpha in graph.interval] == [3, 3]
    assert explore(problem, (0.0, 1e-100)).count(0.5e-100) == 3
    with pytest.raises(InvalidInputError, match="finite lo < hi"):
        explore(problem, (-1e308, 1e308))
