"""The ends of the lines of all cells, against the ends of pieces in rational arithmetic."""

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import exact_pieces

from pwscont import InvalidSystemError, PiecewiseLinearSystem, explore
from pwscont.bench.calls import counted
from pwscont.curve.curve import Curve
from pwscont.curve.error_samples import magnitude
from pwscont.curve.metric import Metric
from pwscont.curve.newton import newton, uncertainty
from pwscont.linear.factorise import last_unit
from pwscont.search.all_transitions import Lines
from pwscont.system.selection import Selection

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

INTERVAL = (-2.0, 2.0)


def path(p, seed, *, gap=False):
    """Return a random body, a path of its load, and a friction coefficient."""
    body = random_body(p, seed, gap=gap)
    f0, f1 = (random_vector(body.n, [seed, i]) for i in range(2))
    return body, f0, f1, float(np.random.default_rng(seed).uniform(0.1, 6.0))


def problem(body, f0, f1, friction):
    return CoulombLoad(contact_body(body), AffineLoad(f0, f1), friction)


def lines(system):
    return Lines(system, Metric.of(system, INTERVAL), INTERVAL)


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.sweep(20)
def test_all_solutions_at_the_lower_end_are_found(p, seed, gap):
    parts = path(p, seed, gap=gap)
    exact = [p for p in exact_pieces(*parts, INTERVAL) if p.lo <= INTERVAL[0] <= p.hi]
    system = problem(*parts)
    found = lines(system).solutions()
    assert len(found) == len(exact)
    for x, error in found:
        assert x[-1] == INTERVAL[0]
        residual = system.residual(x[:-1], x[-1], system.character(x[:-1], x[-1]))
        assert np.abs(residual).max() <= 1e-12 * (1.0 + np.abs(x).max())
        assert np.abs(error).max() <= 1e-10 * np.abs(x).max()


@pytest.mark.parametrize("seed", range(8))
def test_errors_are_those_of_a_newton_iteration_by_itself(seed):
    system = problem(*path(2, seed))
    metric = Metric.of(system, INTERVAL)
    for x, error in lines(system).solutions():
        selection = Selection(system, system.character(x[:-1], x[-1]))
        row = last_unit(len(x))
        root = newton(Curve(selection, metric), lambda y, row=row: (y[-1] - INTERVAL[0], row), x, 3)
        found, expected = (magnitude(x, e) for e in (error, uncertainty(root)))
        # of unknowns that are zero it is that of the last correction
        np.testing.assert_allclose(found, expected, rtol=1e-2, atol=1e-3 * expected.max())


def test_a_jump_between_cells_is_refused():
    class Jumps(PiecewiseLinearSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z

        def residual(self, z, alpha, character):
            return z - alpha + (0.5 if character.signs[0] else 0.0)

    with pytest.raises(InvalidSystemError, match=r"residual jumps by 0\.5 in row 0"):
        explore(Jumps(), INTERVAL)


def test_a_selection_that_is_bent_in_one_cell_is_refused():
    class Bent(PiecewiseLinearSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z

        def residual(self, z, alpha, character):
            return z - alpha + (z**3 if character.signs[0] else 0.0 * z)

        def jacobian(self, z, alpha, character):
            return np.array([[1.0, -1.0]])

    class BentBelow(Bent):
        def residual(self, z, alpha, character):
            return super().residual(z, alpha, character.flip(0))

    for system in (Bent(), BentBelow()):
        with pytest.raises(InvalidSystemError, match="is not affine in"):
            explore(system, INTERVAL)


def test_solutions_in_doubt_are_left_to_exact_arithmetic():
    """At no load at all the only solution lies on every interface."""
    body, _, f1, friction = path(2, 0)
    assert lines(problem(body, 2.0 * f1, f1, friction)).solutions() is None


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.sweep(20)
def test_the_ends_of_all_pieces_are_found(p, seed, gap):
    parts = path(p, seed, gap=gap)
    ends = {end for piece in exact_pieces(*parts, INTERVAL) for end in (piece.lo, piece.hi)}
    inside = sorted(float(end) for end in ends if INTERVAL[0] < end < INTERVAL[1])
    system = problem(*parts)
    found = list(lines(system).transitions())
    alphas = sorted(x[-1] for _, (x, _) in found if INTERVAL[0] <= x[-1] <= INTERVAL[1])
    np.testing.assert_allclose(alphas, inside, rtol=0, atol=1e-10)
    for test, (x, error) in found:
        assert abs(system.test_functions(x[:-1], x[-1])[test]) <= 1e-12 * np.abs(x).max()
        assert np.abs(error).max() <= 1e-10 * np.abs(x).max()


def test_one_jacobian_for_each_cell_and_one_for_each_point(monkeypatch):
    system = problem(*path(2, 1))
    found = list(lines(system).transitions())
    with counted(system) as calls:
        list(lines(system).transitions())
    points = len({float(x[-1]) for _, (x, _) in found})
    assert calls["jacobian"] <= 16 + 2 * points
    assert calls["test_jacobian"] <= 3 + 5 * points


class IllConditionedBelow(PiecewiseLinearSystem):
    """A z + a alpha + a0 + C |K z + k alpha + k0| = 0: singular cells meet the lower end.

    But for 1e-11, z is (7 / 6 - 11 alpha / 8, 13 / 8 - 2 alpha) from alpha = -6 / 17 to 8 / 39.
    Rounding does not tell whether a singular cell has a solution at the lower end, of which nothing
    is known then.
    """

    size = 2
    A, a, a0 = np.array([[5.0, 5.0], [1.0, -1.0]]), np.array([3.0, 4.0]), np.array([-2.0, -4.0])
    C = np.array([[4.0, -5.0, -3.0, -4.0], [4.0, -3.0, 1.0, 0.0]])
    K = np.array([[4.0, -5.0], [-2.0, 1.0], [-3.0, 2.0], [3.0, -4.0]])
    k, k0 = np.array([0.0, 3.0, 2.0, 1.0]), np.array([-1.0, -4.0, 1.00000000002, 2.0])

    def test_functions(self, z, alpha):
        return self.K @ z + self.k * alpha + self.k0

    def residual(self, z, alpha, character):
        signs = np.where(character.array, 1.0, -1.0)
        kinks = self.C @ (signs * self.test_functions(z, alpha))
        return self.A @ z + self.a * alpha + self.a0 + kinks


def test_a_start_of_which_nothing_is_known_hides_no_others():
    graph = explore(IllConditionedBelow(), (-2.99999999998, 3.00000000001))
    for alpha in (-0.3, -0.1, 0.1):
        (solution,) = graph.solutions(alpha)
        true = 7.0 / 6.0 - 1.375 * alpha, 1.625 - 2.0 * alpha
        np.testing.assert_allclose(solution.z, true, rtol=1e-10)
    assert "complete" not in graph.guarantee
