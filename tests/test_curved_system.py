"""Systems that are not Coulomb's, with curves in closed form, by public names only."""

from functools import cache

import numpy as np
import pytest

from pwscont import (
    ExactLinear,
    NaturalParameter,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    explore,
    trace,
)
from pwscont.curve.corrector import BorderedNewton, MoorePenrose
from pwscont.curve.pseudo_arclength import Secant, Tangent
from pwscont.curve.stepper import StepSize
from pwscont.search import Search

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

VARIANTS = [
    PseudoArclength(),
    PseudoArclength(predictor=Secant()),
    PseudoArclength(corrector=MoorePenrose()),
    PseudoArclength(predictor=Secant(), corrector=MoorePenrose()),
    PseudoArclength(Tangent(), BorderedNewton(), StepSize(first=1e-3, largest=0.02)),
    PseudoArclength(Tangent(), BorderedNewton(), StepSize(first=0.3, largest=1.0)),
]
IDS = ["default", "secant", "moore-penrose", "secant-moore-penrose", "short", "long"]
ALL_VARIANTS = pytest.mark.parametrize("stepper", VARIANTS, ids=IDS)
LOCATED = 1e-10


def assert_alphas(points, expected):
    found = sorted(point.alpha for point in points)
    np.testing.assert_allclose(found, sorted(expected), rtol=0, atol=LOCATED)


def states(graph, alpha):
    return sorted(solution.z.tolist() for solution in graph.solutions(alpha))


# -- two curved pieces with a fold each, meeting at a non-smooth fold ----------------------------


class TwoCurves(PiecewiseSystem):
    """alpha = z^2 + 2 z below z = 0 and z^3 - z above, without any Jacobian.

    Smooth folds at z = -1 (alpha = -1) and z = 1/sqrt(3); alpha turns at the kink z = 0, too.
    """

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return (z**3 - z if character.signs[0] else z**2 + 2.0 * z) - alpha


@cache
def two_curves(stepper):
    return trace(TwoCurves(), ([-2.0], 0.3), (-2.0, 2.0), stepper=stepper)


UPPER_FOLD = (3.0**-0.5, -2.0 / 27.0**0.5)


def two_curves_roots(alpha):
    """Return all z in closed form, each checked against its own side of the kink."""
    below = np.roots([1.0, 2.0, -alpha])
    above = np.roots([1.0, 0.0, -1.0, -alpha])
    real = [r.real for r in below if abs(r.imag) < 1e-12 and r.real < 0.0]
    return sorted(real + [r.real for r in above if abs(r.imag) < 1e-12 and r.real >= 0.0])


@ALL_VARIANTS
def test_two_curves_special_points(stepper):
    graph = two_curves(stepper)
    assert_alphas(graph.special_points("fold"), [-1.0, UPPER_FOLD[1]])
    assert_alphas(graph.special_points("nonsmooth fold"), [0.0])
    assert_alphas(graph.special_points("end"), [2.0, 2.0])
    assert not graph.special_points("transition")
    assert [len(component) for component in graph.components()] == [4]


@ALL_VARIANTS
def test_two_curves_folds_are_located_in_z(stepper):
    """Alpha is flat at a fold: z is known to half the digits of alpha."""
    graph = two_curves(stepper)
    found = sorted(point.z[0] for point in graph.special_points("fold"))
    np.testing.assert_allclose(found, [-1.0, UPPER_FOLD[0]], rtol=0, atol=1e-7)


@ALL_VARIANTS
@pytest.mark.parametrize("alpha", [-1.5, -0.99, -0.7, -0.3, -1e-6, 1e-6, 0.9, 1.999])
def test_two_curves_solutions(stepper, alpha):
    graph = two_curves(stepper)
    expected = two_curves_roots(alpha)
    assert graph.count(alpha) == len(expected)
    np.testing.assert_allclose(np.ravel(states(graph, alpha)), expected, rtol=0, atol=LOCATED)
    assert graph.balance(alpha) == 0


def test_two_curves_multiplicity():
    graph = trace(TwoCurves(), ([-2.0], 0.3), (-2.0, 2.0))
    table = graph.multiplicity()
    assert [count for _, _, count in table] == [0, 2, 4, 2]
    np.testing.assert_allclose(
        [lo for lo, _, _ in table], [-2.0, -1.0, UPPER_FOLD[1], 0.0], rtol=0, atol=LOCATED
    )


@ALL_VARIANTS
def test_pieces_follow_the_sign_of_the_determinant(stepper):
    graph = two_curves(stepper)
    for piece in graph.pieces:
        z = piece.z[len(piece.z) // 2, 0]
        slope = 3.0 * z * z - 1.0 if z > 0.0 else 2.0 * z + 2.0  # dH/dz in closed form
        assert piece.det_sign == np.sign(slope) == np.sign(piece.alpha[-1] - piece.alpha[0])
        assert (np.diff(piece.alpha) * piece.det_sign > 0.0).all()


def test_what_explore_finds_of_a_nonlinear_system_is_true():
    """Its search for starts may miss some here; what it returns must be solutions."""
    graph = explore(TwoCurves(), (-2.0, 0.5))
    for alpha in (-0.9, -0.2, 0.4):
        roots = np.array(two_curves_roots(alpha))
        assert all(np.abs(roots - s.z[0]).min() < LOCATED for s in graph.solutions(alpha))
    traced = trace(TwoCurves(), ([-2.4], 0.5), (-2.0, 0.5))
    assert len(graph.pieces) in (0, len(traced.pieces))  # the whole component or nothing


def test_natural_parameter_stops_at_a_smooth_fold_and_says_so():
    graph = trace(TwoCurves(), ([-2.0], 0.3), (-2.0, 2.0), stepper=NaturalParameter())
    stopped = graph.special_points("stopped")
    assert len(stopped) == 1
    assert stopped[0].alpha == pytest.approx(-1.0, abs=1e-3)
    assert "PseudoArclength" in stopped[0].message


# -- a closed loop with kinks --------------------------------------------------------------------


class Loop(PiecewiseSystem):
    """z^2 + alpha^2 = 1 below z = 0.3 and z^2 - z + alpha^2 = 0.7 above: a closed loop.

    Smooth folds at (0, +-1) and (0.5, +-sqrt(0.95)), non-smooth ones at (0.3, +-sqrt(0.91)).
    """

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.3

    def residual(self, z, alpha, character):
        bend = z - 0.3 if character.signs[0] else 0.0
        return z**2 + alpha**2 - 1.0 - bend


def loop_roots(alpha):
    lower = np.roots([1.0, 0.0, alpha**2 - 1.0])
    upper = np.roots([1.0, -1.0, alpha**2 - 0.7])
    real = [r.real for r in lower if abs(r.imag) < 1e-12 and r.real < 0.3]
    return sorted(real + [r.real for r in upper if abs(r.imag) < 1e-12 and r.real >= 0.3])


@cache
def loop(stepper):
    return trace(Loop(), ([-1.0], 0.0), (-1.5, 1.5), stepper=stepper)


LOOP_STARTS = [([-1.0], 0.0), ([1.5], 0.2), ([0.01], 0.99), ([0.45], -0.96)]


@ALL_VARIANTS
@pytest.mark.parametrize("start", LOOP_STARTS, ids=["bottom", "top", "near fold", "rough"])
@pytest.mark.sweep(10)
def test_loop_closes(stepper, start):
    graph = trace(Loop(), start, (-1.5, 1.5), stepper=stepper)
    (component,) = graph.components()
    assert len(component) == graph.nx.number_of_nodes() == 6
    assert all(degree == 2 for _, degree in graph.nx.degree())
    assert [p.end for p in component] == [p.start for p in component[1:] + component[:1]]
    assert_alphas(graph.special_points("fold"), [-1.0, -(0.95**0.5), 0.95**0.5, 1.0])
    assert_alphas(graph.special_points("nonsmooth fold"), [-(0.91**0.5), 0.91**0.5])
    assert not graph.special_points("end")


@ALL_VARIANTS
@pytest.mark.parametrize("alpha", [-1.2, -0.99, -0.96, -0.5, 0.0, 0.94, 0.97, 0.9999, 1.0001])
@pytest.mark.sweep(12)
def test_loop_solutions(stepper, alpha):
    graph = loop(stepper)
    expected = loop_roots(alpha)
    assert graph.count(alpha) == len(expected)
    np.testing.assert_allclose(np.ravel(states(graph, alpha)), expected, rtol=0, atol=LOCATED)
    assert graph.balance(alpha) == 0


def test_loop_multiplicity():
    graph = trace(Loop(), ([-1.0], 0.0), (-1.5, 1.5))
    assert [count for _, _, count in graph.multiplicity()] == [0, 2, 4, 2, 4, 2, 0]


def test_loop_cut_by_the_interval():
    """Within (-0.5, 0.6) the loop is two arcs, each from end to end."""
    traced = [trace(Loop(), ([z], 0.0), (-0.5, 0.6)) for z in (-1.0, 1.4)]
    assert [len(one.pieces) for one in traced] == [1, 1]
    assert [one.pieces[0].det_sign for one in traced] == [-1, 1]
    assert all(len(one.special_points("end")) == 2 for one in traced)


def test_start_is_reported_within_its_piece():
    graph = trace(Loop(), ([-1.1], 0.1), (-1.5, 1.5))
    (start,) = graph.special_points("start")
    assert start.alpha == 0.1
    assert start.z[0] == pytest.approx(-(0.99**0.5), abs=1e-12)


# -- starts at special points --------------------------------------------------------------------


@pytest.mark.parametrize(
    "start",
    [([-1.0], -1.0), ([UPPER_FOLD[0]], UPPER_FOLD[1]), ([0.0], 0.0), ([-1.0 - 3.0**0.5], 2.0)],
    ids=["fold", "upper fold", "nonsmooth fold", "end"],
)
def test_start_at_a_special_point(start):
    """Wherever the trace starts, the curve is the same: four pieces, three turns."""
    graph = trace(TwoCurves(), start, (-2.0, 2.0))
    assert len(graph.pieces) == 4
    assert [count for _, _, count in graph.multiplicity()] == [0, 2, 4, 2]
    assert_alphas(graph.special_points("fold"), [-1.0, UPPER_FOLD[1]])
    assert_alphas(graph.special_points("nonsmooth fold"), [0.0])


@pytest.mark.parametrize(
    "start",
    [([0.0], 1.0), ([0.0], -1.0), ([0.3], 0.91**0.5), ([0.3], -(0.91**0.5))],
    ids=["fold", "lower fold", "nonsmooth fold", "lower nonsmooth fold"],
)
def test_start_at_a_special_point_of_a_loop(start):
    graph = trace(Loop(), start, (-1.5, 1.5))
    assert len(graph.pieces) == 6
    assert [count for _, _, count in graph.multiplicity()] == [0, 2, 4, 2, 4, 2, 0]
    assert_alphas(graph.special_points("fold"), [-1.0, -(0.95**0.5), 0.95**0.5, 1.0])


# -- two unknowns, three cells, scaled units -----------------------------------------------------


class Scaled(PiecewiseSystem):
    """The two curves with z in units of ``unit`` beside a slave unknown w = z^2."""

    size = 2

    def __init__(self, unit):
        self.unit = unit

    def scale(self, lo, hi):
        return np.array([self.unit, self.unit**2])

    def test_functions(self, z, alpha):
        return z[:1].copy()

    def residual(self, z, alpha, character):
        x, w = z[0] / self.unit, z[1] / self.unit**2
        curve = x * w - x if character.signs[0] else w + 2.0 * x
        return np.array([w - x * x, curve - alpha])

    def jacobian(self, z, alpha, character):
        x, w = z[0] / self.unit, z[1] / self.unit**2
        dx, dw = (w - 1.0, x) if character.signs[0] else (2.0, 1.0)
        rows = np.array([[-2.0 * x, 1.0, 0.0], [dx, dw, -1.0]])
        return rows / np.array([self.unit, self.unit**2, 1.0])

    def test_jacobian(self, z, alpha):
        return np.array([[1.0, 0.0, 0.0]])


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_units_do_not_matter(unit):
    start = ([-2.0 * unit, 4.0 * unit**2], 0.3)
    graph = trace(Scaled(unit), start, (-2.0, 2.0))
    assert_alphas(graph.special_points("fold"), [-1.0, UPPER_FOLD[1]])
    assert_alphas(graph.special_points("nonsmooth fold"), [0.0])
    for alpha in (-0.8, -0.2, 1.1):
        found = sorted(s.z[0] / unit for s in graph.solutions(alpha))
        np.testing.assert_allclose(found, two_curves_roots(alpha), rtol=0, atol=LOCATED)


# -- a polygon without any Jacobian --------------------------------------------------------------


class Sawtooth(PiecewiseLinearSystem):
    """alpha = z, then -2 z from z = 0, then z - 3 from z = 1; w = 5 z - alpha beside it."""

    size = 2

    def test_functions(self, z, alpha):
        return np.array([z[0], z[0] - 1.0])

    def residual(self, z, alpha, character):
        first, second = character.signs
        height = z[0] - 3.0 * first * z[0] + 3.0 * second * (z[0] - 1.0)
        return np.array([height - alpha, z[1] - 5.0 * z[0] + alpha])


def sawtooth_roots(alpha):
    roots = [alpha] if alpha < 0.0 else []
    roots += [-alpha / 2.0] if -2.0 <= alpha <= 0.0 else []
    return roots + ([alpha + 3.0] if alpha > -2.0 else [])


@pytest.mark.parametrize("stepper", [None, ExactLinear(), PseudoArclength()])
def test_sawtooth(stepper):
    graph = explore(Sawtooth(), (-4.0, 3.0), stepper=stepper)
    expected = [(-4.0, -2.0, 1), (-2.0, 0.0, 3), (0.0, 3.0, 1)]
    np.testing.assert_allclose(graph.multiplicity(), expected, rtol=0, atol=1e-13)
    assert_alphas(graph.special_points("nonsmooth fold"), [-2.0, 0.0])
    for alpha in (-3.3, -1.7, -0.1, 2.2):
        expected = sorted([z, 5.0 * z - alpha] for z in sawtooth_roots(alpha))
        np.testing.assert_allclose(states(graph, alpha), expected, rtol=0, atol=1e-13)
        assert graph.balance(alpha) == 1


def test_differences_of_affine_functions_are_exact():
    system = Sawtooth()
    z, alpha = np.array([0.5, 7.0]), 0.25
    character = system.character(z, alpha)
    expected = [[-2.0, 0.0, -1.0], [-5.0, 1.0, 1.0]]
    np.testing.assert_array_equal(system.jacobian(z, alpha, character), expected)
    np.testing.assert_array_equal(system.test_jacobian(z, alpha), [[1, 0, 0], [1, 0, 0]])


def test_exact_pieces_have_two_points():
    graph = explore(Sawtooth(), (-4.0, 3.0))
    assert [len(piece.points) for piece in graph.pieces] == [2, 2, 2]
    ends = [piece.points[[0, -1], 0].tolist() for piece in graph.pieces]
    np.testing.assert_allclose(ends, [[-4.0, 0.0], [0.0, 1.0], [1.0, 6.0]], rtol=0, atol=1e-14)


# -- close neighbours ----------------------------------------------------------------------------


class Parallel(PiecewiseSystem):
    """(z - alpha) (z - alpha - d) = 0: two branches at a distance d in one cell."""

    size = 1

    def __init__(self, distance):
        self.distance = distance

    def test_functions(self, z, alpha):
        return np.array([10.0])

    def residual(self, z, alpha, character):
        return (z - alpha) * (z - alpha - self.distance)

    def jacobian(self, z, alpha, character):
        slope = 2.0 * (z[0] - alpha) - self.distance
        return np.array([[slope, -slope]])


class BothBranches(Search):
    """Starts on both branches, twice on each."""

    def starts(self, system, metric, interval):
        for alpha in interval:
            for z in (alpha, alpha + system.distance):
                yield np.array([z, alpha]), np.zeros(2)


@pytest.mark.parametrize("distance", [1.0, 1e-2, 1e-4])
def test_branches_close_together_stay_apart(distance):
    graph = explore(Parallel(distance), (0.0, 1.0), search=BothBranches())
    assert len(graph.components()) == len(graph.pieces) == 2
    assert graph.balance(0.5) == 0
    found = np.ravel(states(graph, 0.5))
    np.testing.assert_allclose(found, [0.5, 0.5 + distance], rtol=0, atol=1e-11)
