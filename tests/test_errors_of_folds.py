"""Where smooth folds are, and what is said of their errors, against closed forms."""

import numpy as np
import pytest
from sweeps import swept

from pwscont import PiecewiseSystem, PseudoArclength, StepSize, Switched, explore, trace

pytestmark = pytest.mark.sweep(6)  # the others take too long for the README's command


class Turned(PiecewiseSystem):
    """alpha = a u^2 + b u^3 with u = y_0 - c, y_i = cos(w_i u) and y = M z: a fold at u = 0."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.size = n = int(rng.integers(1, 4))
        self.a, self.b, self.c = rng.uniform(0.2, 3.0), *rng.uniform(-1.0, 1.0, 2)
        self.M, self.w = np.eye(n) + 0.3 * rng.normal(size=(n, n)), rng.normal(size=n)

    def at(self, u):
        """Return z and alpha at u."""
        y = np.cos(self.w * u)
        y[0] = self.c + u
        return np.linalg.solve(self.M, y), self.a * u**2 + self.b * u**3

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        y = self.M @ z
        u = y[0] - self.c
        rest = y - np.cos(self.w * u)
        rest[0] = alpha - self.a * u**2 - self.b * u**3
        return rest


class WithJacobian(Turned):
    """The same, with its Jacobian."""

    def jacobian(self, z, alpha, character):
        u = (self.M @ z)[0] - self.c
        by_y = np.eye(self.size)
        by_y[:, 0] += self.w * np.sin(self.w * u)
        by_y[0], by_y[0, 0] = 0.0, -2.0 * self.a * u - 3.0 * self.b * u**2
        by_alpha = np.zeros(self.size)
        by_alpha[0] = 1.0
        return np.column_stack([by_y @ self.M, by_alpha])


@pytest.mark.parametrize(("kind", "close"), [(WithJacobian, 1e-11), (Turned, 1e-10)])
@pytest.mark.parametrize("largest", [0.3, 0.1, 0.02])
@pytest.mark.parametrize("seeds", swept([range(6)], [range(6, 20)]))
def test_folds_are_within_their_stated_errors(kind, close, largest, seeds):
    steps, off = PseudoArclength(step_size=StepSize(largest=largest)), []
    for seed in seeds:
        system = kind(seed)
        graph = trace(system, system.at(0.3), (-0.5, 0.5), stepper=steps)
        (fold,) = (p for p in graph.special_points("fold") if abs(p.alpha) < 1e-3)
        error = np.abs(fold.z - system.at(0.0)[0])
        assert error.max() <= close
        off.append((error / fold.error[:-1]).max())
    assert max(off) <= 10.0
    assert np.median(off) > 1e-3  # nor are they stated far too large


@pytest.mark.parametrize("power", [2, 3, 4, 5])
def test_the_error_of_a_tangential_kink_covers_its_distance(power):
    """z = (a - 0.3)^k reaches z = 0 at a = 0.3, where Newton's method converges by a factor."""
    curve = Switched(1, lambda z, a, sw: z - (a - 0.3) ** power + 0.5 * sw.relu(z))
    for point in explore(curve, (-1.0, 1.0)).special_points():
        if point.kind not in ("start", "end"):
            assert abs(point.alpha - 0.3) <= 3.0 * point.error[-1] + 1e-15


class SmallLoop(PiecewiseSystem):
    """An ellipse of y_0 and alpha, a thousandth of the interval wide, with y_i = sin(y_0 + i)."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.size = n = int(rng.integers(1, 5))
        self.c, self.d = rng.normal(), rng.uniform(0.2, 0.8)
        self.wide = 10.0 ** rng.uniform(-3.5, -2.5)
        self.Q = np.linalg.qr(rng.normal(size=(n, n)))[0]

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        y = z @ self.Q
        rest = y - 0.4 * np.sin(y[0] + np.arange(self.size))
        rest[0] = (2.0 * (y[0] - self.c)) ** 2 + ((alpha - self.d) / self.wide) ** 2 - 1.0
        return rest

    def top(self):
        """Return the solution with the largest y_0."""
        y = 0.4 * np.sin(self.c + 0.5 + np.arange(self.size))
        y[0] = self.c + 0.5
        return self.Q @ y, self.d


@pytest.mark.parametrize("seed", swept(range(3), range(3, 12)))
def test_folds_of_a_small_loop_are_found_once_and_well(seed):
    """Differences tell the slope of alpha far better than the rest of the tangent here."""
    system = SmallLoop(seed)
    graph = trace(system, system.top(), (0.0, 1.0))
    folds = graph.special_points("fold")
    assert len(folds) == 2
    assert graph.count(system.d) == 2
    for fold in folds:
        off = abs((fold.z @ system.Q)[0] - system.c)
        assert off <= max(fold.error) < 1e-8
        assert abs(abs(fold.alpha - system.d) - system.wide) <= 1e-12
