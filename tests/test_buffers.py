"""Systems whose methods return one array again and again give what those with new arrays give."""

import numpy as np
import pytest

from pwscont import PiecewiseLinearSystem, check_system, explore, trace


class Switches(PiecewiseLinearSystem):
    """A z + C |z - k| = a + alpha b, with a new array for every value."""

    def __init__(self, A, C, k, a, b):
        self.A, self.C, self.k, self.a, self.b = A, C, k, a, b
        self.size = len(k)

    def given(self, name, value):
        return value

    def test_functions(self, z, alpha):
        return self.given("tests", z - self.k)

    def residual(self, z, alpha, character):
        signs = np.where(character.array, 1.0, -1.0)
        kinks = self.C @ (signs * self.test_functions(z, alpha))
        return self.given("residual", self.A @ z + kinks - self.a - alpha * self.b)

    def jacobian(self, z, alpha, character):
        square = self.A + self.C * np.where(character.array, 1.0, -1.0)
        return self.given("jacobian", np.column_stack([square, -self.b]))

    def test_jacobian(self, z, alpha):
        return self.given("gradients", np.eye(self.size, self.size + 1))


class Buffered(Switches):
    """The same with one array for all values of a method."""

    def given(self, name, value):
        buffers = self.__dict__.setdefault("buffers", {})
        buffer = buffers.setdefault(name, np.zeros(value.shape))
        buffer[:] = value
        return buffer


class BufferedWithDifferences(Buffered):
    """The same, with derivatives by differences."""

    jacobian, test_jacobian = PiecewiseLinearSystem.jacobian, PiecewiseLinearSystem.test_jacobian


def given(n, seed):
    rng = np.random.default_rng([n, seed])
    A = 2.0 * np.eye(n) + 0.3 * rng.normal(size=(n, n)) / np.sqrt(n)
    C = 0.9 * rng.normal(size=(n, n)) / np.sqrt(n)
    return A, C, 0.3 * rng.normal(size=n), rng.normal(size=n), rng.normal(size=n)


def marks(graph):
    return sorted((round(point.alpha, 8), str(point.kind)) for point in graph.special_points())


@pytest.mark.parametrize("kind", [Buffered, BufferedWithDifferences])
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.sweep(5)
def test_everything_is_found_with_buffers(kind, seed):
    parts = given(1 + seed % 3, seed)
    true, found = (explore(each(*parts), (-2.0, 2.0)) for each in (Switches, kind))
    assert true.guarantee == found.guarantee
    assert marks(found) == marks(true)


@pytest.mark.parametrize("kind", [Buffered, BufferedWithDifferences])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.sweep(5)
def test_long_paths_with_buffers(kind, seed):
    A, _, k, a, b = given(70, seed)
    graphs = [
        trace(each(A, 0.9 * np.eye(70), k, a, b), (np.zeros(70), -2.0), (-2.0, 2.0))
        for each in (Switches, kind)
    ]
    assert len(graphs[0].pieces) > 20
    assert marks(graphs[1]) == marks(graphs[0])


def test_a_singular_cell_by_differences_has_no_solution_far_away():
    """-z + |2 z - 1 + ...| has a cell where z cancels: 0 z = const has no solution at all."""

    class Cancels(PiecewiseLinearSystem):
        size = 1

        def test_functions(self, z, alpha):
            return np.array([z[0] - 0.1 * alpha])

        def residual(self, z, alpha, character):
            slope = 1.0 if character.array[0] else -1.0
            return z - 3.7 * alpha + slope * (z - 0.1 * alpha) + 0.3

    lo = 1.125 + 1e-15
    graph = explore(Cancels(), (lo, lo + 1.0))
    # z >= alpha / 10: 2 z = 3.8 alpha - 0.3; else 0 = 3.6 alpha - 0.3, never here
    for alpha in (1.2, 1.5, 2.0):
        (solution,) = graph.solutions(alpha)
        assert solution.z[0] == pytest.approx(1.9 * alpha - 0.15)


class Ties(Switches):
    """A z - C1 |z - k| = a + alpha b, with whole numbers: tests vanish together at corners."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        n = 1 + seed % 3
        A = 3.0 * np.eye(n) + rng.integers(-1, 2, (n, n))
        C = np.diag(rng.integers(-1, 2, n)).astype(float)
        super().__init__(A, C, np.zeros(n), np.zeros(n), rng.integers(-2, 3, n).astype(float))


class BufferedTies(Ties, Buffered):
    """The same with buffers."""


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.sweep(10)
def test_corners_with_buffers(seed):
    true, found = (explore(kind(seed), (-1.0, 1.0)) for kind in (Ties, BufferedTies))
    assert true.guarantee == found.guarantee
    assert marks(found) == marks(true)
    assert found.multiplicity() == true.multiplicity()


def test_corner_along_an_interface_with_buffers():
    """z = 0 solves the equation for alpha <= -1; both Jacobians are needed at one corner."""

    class Rides(Buffered):
        size = 1

        def __init__(self):
            pass

        def test_functions(self, z, alpha):
            tests = np.array([alpha + 1.0 - z[0], alpha - z[0], z[0], -alpha - 1.0])
            return self.given("tests", tests)

        def residual(self, z, alpha, character):
            g = np.where(character.array, 1.0, -1.0)
            row = -3.0 * z[0] - alpha - 1.0 - g[0] * (alpha + 1.0 - z[0]) - g[2] * z[0]
            return self.given("residual", np.array([row]))

        def jacobian(self, z, alpha, character):
            g = np.where(character.array, 1.0, -1.0)
            return self.given("jacobian", np.array([[g[0] - g[2] - 3.0, -1.0 - g[0]]]))

        test_jacobian = PiecewiseLinearSystem.test_jacobian

    graph = explore(Rides(), (-1.5, -0.5))
    assert graph.guarantee == "complete"
    for alpha in (-1.3, -1.1, -0.9, -0.6):
        (solution,) = graph.solutions(alpha)
        assert solution.z[0] == pytest.approx(min(0.0, -2.0 * (alpha + 1.0)), abs=1e-14)


def test_check_system_sees_jumps_with_buffers():
    class Jumps(Buffered):
        def residual(self, z, alpha, character):
            whole = Switches.residual(self, z, alpha, character) + 0.5 * character.array[0]
            return self.given("residual", whole)

    system = Jumps(*given(2, 0))
    assert "H jumps" in str(check_system(system, [(system.k + np.array([0.1, 0.2]), 0.3)]))
