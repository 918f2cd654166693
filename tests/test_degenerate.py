"""Cases where unknowns cancel, equations depend on each other, or pieces meet the ends of alpha."""

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from random_bodies import contact_body, random_body
from rational import SwitchedFamily

from pwscont import (
    LCP,
    InvalidSystemError,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    Switched,
    enumerate_solutions,
    explore,
    trace,
)

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

COUPLED = np.array([[2.0, -1.0], [-1.0, 2.0]])
UNCOUPLED = np.diag([2.0, 2.0])


def one_node(A, f0, f1, friction):
    body = ContactBody(A, [[1.0, 0.0]], [[0.0, 1.0]])
    return CoulombLoad(body, AffineLoad(f0, f1), friction)


class CancellingConstants(PiecewiseLinearSystem):
    """1 + |z_1| / 2 - |z_1 + 1| = 0 has z_1 = 0 and z_1 = -4, whatever alpha.

    z_1 = 0 is the difference of two ones, and lies on an interface.
    """

    size = 2

    def test_functions(self, z, alpha):
        return np.array([z[1], -z[1] - 1.0])

    def residual(self, z, alpha, character):
        first, second = np.where(character.signs, 1.0, -1.0) * self.test_functions(z, alpha)
        rest = -2.0 * z[0] - 2.0 * z[1] + 2.0 + alpha - 0.5 * first
        return np.array([rest, 1.0 + 0.5 * first - second])


@pytest.mark.slow
def test_a_solution_on_an_interface_because_constants_cancel():
    system = CancellingConstants()
    for alpha in np.linspace(-2.0, 3.0, 201):
        found = sorted(solution.z[1] for solution in enumerate_solutions(system, alpha))
        np.testing.assert_allclose(found, [-4.0, 0.0], rtol=0, atol=1e-14)
    for shift in np.random.default_rng(0).random((30, 2)):
        graph = explore(system, (-2.0 + shift[0], 2.0 + shift[1]))
        assert graph.count(0.7) == 2
        assert graph.guarantee == "complete"


@pytest.mark.parametrize("friction", [2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0])
@pytest.mark.parametrize(("size", "ends"), [(0.7, (-3.5, 2.0)), (0.25, (-1.0, 1.0))])
@pytest.mark.sweep(12)
def test_a_load_along_a_sector_boundary_from_rest(friction, size, ends):
    """(u_nu, u_t) = (0, -size alpha) just touches, sticking is the other solution for alpha > 0."""
    system = one_node(COUPLED, [0.0, 0.0], [size, -2.0 * size], friction)
    graph = explore(system, ends)
    (apex,) = graph.special_points("degenerate")
    assert abs(apex.alpha) < 1e-14
    assert len(graph.pieces) == 3
    assert graph.count(1.0) == len(enumerate_solutions(system, 1.0)) == 2
    assert graph.count(-1.0) == 1
    np.testing.assert_allclose(
        sorted(solution.z[1] for solution in graph.solutions(1.0)), [-size, 0.0], atol=1e-15
    )


@pytest.mark.parametrize(("f1", "friction"), [((-1.0, 1.0), 1.0), ((0.0, 1.0), 0.5)])
def test_tests_that_equilibrium_keeps_constant(f1, friction):
    """Without coupling kappa1 is the load whatever the mode: no solution counts twice."""
    graph = explore(one_node(UNCOUPLED, [0.0, 0.0], f1, friction), (-3.5, 2.0))
    assert graph.count(-1.0) == graph.count(1.0) == 1
    assert graph.guarantee == "complete"


def test_an_interface_that_no_piece_meets():
    """The normal load is constant, and with it kappa1: it vanishes nowhere."""
    graph = explore(one_node(UNCOUPLED, [1.0, 0.0], [0.0, 1.0], 0.5), (-1.0, 1.0))
    # lam_nu = 0 and u_nu = 1 / 2 without contact would penetrate: in contact lam_nu = -1
    assert graph.count(0.25) == 1
    assert graph.guarantee == "complete"
    assert sorted(point.alpha for point in graph.special_points("transition")) == [-0.5, 0.5]


class TransitionAtTheEnd(PiecewiseLinearSystem):
    """A transition at alpha = 3 exactly, where rounding meets it before the end."""

    size = 3

    def test_functions(self, z, alpha):
        return np.array([z[0] - z[2] + 1.0, 1.0 - z[0] - z[2]])

    def residual(self, z, alpha, character):
        sizes = np.where(character.signs, 1.0, -1.0) * self.test_functions(z, alpha)
        matrix = np.array([[-2.0, -1.0, -1.0], [2.0, 0.0, 2.0], [-2.0, 1.0, -1.0]])
        rest = matrix @ z - 2.0 + alpha * np.array([1.0, 1.0, -1.0])
        rest[0] += sizes[1]
        return rest


def test_a_transition_at_the_end_of_the_interval():
    graph = explore(TransitionAtTheEnd(), (-2.0, 3.0))
    assert graph.count(3.0) == len(enumerate_solutions(TransitionAtTheEnd(), 3.0)) == 1
    assert all(hi - lo > 0.1 for lo, hi in (piece.interval for piece in graph.pieces))


class ThinFold(PiecewiseSystem):
    """z = sin 3 alpha +- eps sqrt(1 - alpha), for eps = 1e-4: both curves fold at alpha = 1."""

    size = 1
    thinness = 1e-4

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return ((z - np.sin(3.0 * alpha)) / self.thinness) ** 2 - (1.0 - alpha)

    def jacobian(self, z, alpha, character):
        slope = 2.0 * (z[0] - np.sin(3.0 * alpha)) / self.thinness**2
        return np.array([[slope, 1.0 - 3.0 * slope * np.cos(3.0 * alpha)]])


def test_a_thin_fold_is_passed_or_said_to_stop():
    lo = -0.4
    start = np.sin(3.0 * lo) + 1e-4 * np.sqrt(1.0 - lo)
    graph = trace(ThinFold(), ([start], lo), (lo, 2.0))
    assert graph.count(0.5) == 2 or graph.special_points("stopped")


class Blocked(PiecewiseLinearSystem):
    """A diode that carries no current: every z <= 0 solves H = max(z, 0) = 0 at every alpha."""

    size = 1

    def test_functions(self, z, alpha):
        return -z

    def residual(self, z, alpha, character):
        return 0.0 * z if character.signs[0] else z


class Floating(PiecewiseLinearSystem):
    """z_1 solves at alpha = 0 only, and z_0 is whatever one likes."""

    size = 2

    def test_functions(self, z, alpha):
        return z[1:]

    def residual(self, z, alpha, character):
        return np.array([3.0 * z[1] if character.signs[0] else z[1], 2.0 * z[1] + alpha])


class BlockedTwice(Blocked):
    """The same, and two tests that vanish together."""

    def test_functions(self, z, alpha):
        return np.array([-z[0], z[0]])


@pytest.mark.parametrize("system", [Blocked(), BlockedTwice()])
def test_an_area_of_solutions_is_no_complete_graph_of_curves(system):
    graph = explore(system, (-1.0, 1.0))
    assert graph.guarantee.startswith("balanced; infinitely many solutions for alpha in [-1, ")


class FreeUnknown(PiecewiseLinearSystem):
    """H = alpha, whatever z is."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([alpha - 0.5])

    def residual(self, z, alpha, character):
        return np.array([alpha])


@pytest.mark.parametrize("system", [Floating(), FreeUnknown()])
def test_a_line_of_solutions_without_a_corner_is_not_passed_over(system):
    assert "complete" not in explore(system, (-1.0, 1.0)).guarantee


class EndlessRay(PiecewiseLinearSystem):
    """Integers all over; at alpha = 4/3 a vertical ray runs to infinity, beside interfaces."""

    size = 2
    A = np.array([[1.0, -1.0], [0.0, -1.0]])
    B = np.array([[1.0, -1.0, -2.0, 0.0], [0.0, 1.0, 1.0, -2.0]])
    C = np.array([[1.0, 2.0], [-2.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    d, e = np.array([1.0, 0.0, 1.0, 0.0]), np.array([2.0, 0.0, 2.0, 0.0])

    def test_functions(self, z, alpha):
        return self.C @ z + self.d * alpha + self.e

    def residual(self, z, alpha, character):
        switched = self.B @ (self.test_functions(z, alpha) * character.signs)
        return self.A @ z + switched + np.array([2.0, 0.0]) * alpha - 2.0


@pytest.mark.parametrize("interval", [(-2.0, 2.0), (-1.9, 2.1)])
def test_a_ray_beside_interfaces_never_meets_them_by_rounding(interval):
    guarantee = explore(EndlessRay(), interval).guarantee
    assert "infinitely many solutions at alpha = 1.3333333 (the branch runs to inf" in guarantee


@pytest.mark.parametrize("hi", [2.9, 3.0])
def test_slopes_that_are_rounding_are_zero(hi):
    """The only solution is z = (0, 0, 1 + alpha), for alpha >= 0, in two cells all along."""
    system = LCP([[-1, -1, 0], [0, 0, 1], [-1, 0, -1]], [0, -1, 1], [0, 0, 1])
    graphs = explore(system, (-2.0, hi)), trace(system, ([0.0, 0.0, 2.0], 1.0), (-2.0, hi))
    for graph in graphs:
        assert [graph.count(alpha) for alpha in (-1.0, 0.5, 2.0)] == [0, 1, 1]


@pytest.mark.parametrize(
    ("B", "c", "d", "lower", "upper"),
    [
        ([[1, 1], [1, 1]], [0, -1], [-1, -1], [0, 0], [2, 1]),
        ([[-1, -1, 0], [0, 0, 1], [1, 1, 0]], [1, 1, -1], [1, 0, 1], [-1, -1, -2], [0, 0, -1]),
    ],
)
def test_a_vertical_piece_whose_ends_differ_by_rounding_is_vertical(B, c, d, lower, upper):
    """x = clip(B x + c + alpha d, lower, upper) with a segment of solutions at alpha = 0."""
    B, c, d, lower, upper = (np.array(part, dtype=float) for part in (B, c, d, lower, upper))
    system = Switched(
        len(c), lambda x, t, sw: x - sw.clip(B @ x + c + t * d, lower, upper), linear=True
    )
    graph = explore(system, (-2.0, 3.0))
    assert graph.count(0.0) == np.inf


def test_a_direction_along_an_interface_of_a_singular_cell_is_said():
    graph = explore(SwitchedFamily(np.random.default_rng([6, 69])).system(0.0), (-2.0, 3.0))
    assert "stopped" in graph.guarantee


class AlongInterface(PiecewiseSystem):
    """Of t = z1 - z2 sin(alpha) / 3, t or 2 t is zero, and z2 = 3 + cos(alpha).

    The tests are t, and z2 - 5 if there is a second one, in any units.
    """

    size = 2

    def __init__(self, *units):
        self.units = np.array(units)

    def test_functions(self, z, alpha):
        tests = np.array([z[0] - z[1] * np.sin(alpha) / 3.0, z[1] - 5.0])
        return self.units * tests[: len(self.units)]

    def residual(self, z, alpha, character):
        t = self.test_functions(z, alpha)[0] / self.units[0]
        return np.array([t if character.signs[0] else 2.0 * t, z[1] - 3.0 - np.cos(alpha)])


@pytest.mark.parametrize("units", [(1.0,), (1e-6,), (1.0, 1.0), (1e6, 1e-6), (1e-6, 1e6)])
@pytest.mark.parametrize("lo", [0.0, 0.1])
@pytest.mark.sweep(6)
def test_a_curved_path_along_an_interface_in_any_units(units, lo):
    z2 = 3.0 + np.cos(lo)
    graph = trace(AlongInterface(*units), ([z2 * np.sin(lo) / 3.0, z2], lo), (lo, 2.0))
    assert not graph.special_points("stopped")
    assert [count for _, _, count in graph.multiplicity()] == [1]
    (solution,) = graph.solutions(1.0)
    np.testing.assert_allclose(solution.z[1], 3.0 + np.cos(1.0), rtol=1e-12)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.sweep(40)
def test_no_load_with_friction_as_parameter(p, seed):
    """All tests vanish all along z = 0, and every number there is rounding."""
    body = random_body(p, seed, inner=0)
    graph = explore(CoulombFriction(contact_body(body), np.zeros(body.n)), (0.0, 2.0))
    assert graph.guarantee == "complete but for closed loops"
    assert [count for _, _, count in graph.multiplicity()] == [1]


@pytest.mark.parametrize(("force", "counts"), [((-1.0, 2.0), (1, 1, 1)), ((1.0, -2.0), (1, 1, 2))])
def test_a_body_that_grazes_the_floor_has_one_solution_along_interfaces(force, counts):
    """By the four modes: the second body sticks as well, from F = 2 on."""
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    graph = explore(CoulombFriction(body, np.array(force)), (0.0, 10.0))
    assert tuple(graph.count(F) for F in (0.5, 1.0, 5.0)) == counts


@pytest.mark.slow
def test_a_residual_that_is_zero_everywhere_is_refused():
    with pytest.raises(InvalidSystemError, match="every z is a solution"):
        explore(Switched(2, lambda z, alpha, sw: 0.0 * z), (-1.0, 1.0))


@pytest.mark.slow
def test_many_branch_points_at_one_point_end_in_words():
    """Three pitchforks meet in one point: 27 branches leave to the right.

    The signs of the 27 branches sum to (1 - 1 - 1)^3 = -1, as the sign of the branch on the left.
    """
    graph = explore(Switched(3, lambda z, alpha, sw: alpha * z - z**3), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.5, 0.3)] == [1, 27]
    assert graph.guarantee.startswith("balanced; ")
    assert "curves touch, or more than two cross, at alpha = " in graph.guarantee


@pytest.mark.slow
def test_a_root_of_another_cell_is_no_start():
    """At alpha = -1 two pieces end at the kink z_3 = 0, which no solution near alpha > -1 has."""
    matrix = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    system = Switched(3, lambda z, a, sw: matrix @ z + z**3 - 3.0 * sw.abs(z) - a)
    graph = explore(system, (-1.0, 1.0))
    assert len(graph.components()) == 4
    assert graph.count(-0.5) == 5
    assert graph.count(0.5) == 1


@pytest.mark.slow
def test_a_curve_along_a_kink_is_one_solution():
    """z_1 = 0 all along a branch, on the interface of two cells, in a system of integers."""
    matrix, of_abs = np.array([[3, 0], [-3, 1]]), np.array([[1, -2], [0, -1]])

    def rows(z, a, sw):
        return matrix @ z + of_abs @ np.array([sw.abs(x) for x in z]) - a + 2.0

    graph = explore(Switched(2, rows), (-2.0, 2.0))
    assert [graph.count(alpha) for alpha in (-1.0, 0.0, 1.0, 1.5)] == [2, 2, 2, 2]
