"""Folds and branch points of smooth curves, on systems with closed forms, by public names."""

import math

import numpy as np
import pytest
from smooth_parts import LOCATED, Smooth

from pwscont import (
    BranchGraph,
    PiecewiseSystem,
    PseudoArclength,
    Switched,
    explore,
    trace,
)
from pwscont.basics.outcome import Remark
from pwscont.curve.corrector import MoorePenrose
from pwscont.curve.pseudo_arclength import Secant
from pwscont.curve.stepper import StepSize

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


INTERVAL = (-1.0, 1.3)


class NormalForm(Smooth):
    """h(y, beta) = 0 and w = y beta, turned, sheared and scaled so that no axis is special.

    (y, w) = Q (z - z0) / unit with Q not orthogonal, and beta = alpha - alpha0 + tilt y.
    """

    size = 2
    Q = np.array([[0.8, 0.5], [-0.3, 1.1]])
    z0 = np.array([0.7, -0.4])

    def __init__(self, h, gradient=None, *, alpha0=0.1, tilt=0.3, unit=1.0):
        self.h, self.gradient = h, gradient
        self.alpha0, self.tilt, self.unit = alpha0, tilt, unit

    def scale(self, lo, hi):
        return np.full(2, self.unit)

    def normal(self, z, alpha):
        y, w = self.Q @ (z / self.unit - self.z0)
        return y, w, alpha - self.alpha0 + self.tilt * y

    def state(self, y, beta):
        """Return (z, alpha) of a point of the normal form."""
        z = (self.z0 + np.linalg.solve(self.Q, [y, y * beta])) * self.unit
        return z, beta - self.tilt * y + self.alpha0

    def residual(self, z, alpha, character):
        y, w, beta = self.normal(z, alpha)
        return np.array([self.h(y, beta), w - y * beta])

    def jacobian(self, z, alpha, character):
        if self.gradient is None:
            return super().jacobian(z, alpha, character)
        y, _, beta = self.normal(z, alpha)
        by_y, by_beta = self.gradient(y, beta)
        rows = np.array([[by_y, 0.0, by_beta], [-beta, 1.0, -y]])
        inner = np.zeros((3, 3))
        inner[:2, :2] = self.Q / self.unit
        inner[2, :2] = self.tilt * self.Q[0] / self.unit
        inner[2, 2] = 1.0
        return rows @ inner


def transcritical(y, beta):
    return y * (y - beta), (2.0 * y - beta, -y)


def pitchfork(y, beta):
    return y**3 - beta * y, (3.0 * y * y - beta, -y)


def make(form, *, exact=True, **more):
    gradient = (lambda y, beta: form(y, beta)[1]) if exact else None
    return NormalForm(lambda y, beta: form(y, beta)[0], gradient, **more)


VARIANTS = [
    PseudoArclength(),
    PseudoArclength(predictor=Secant()),
    PseudoArclength(corrector=MoorePenrose()),
    PseudoArclength(step_size=StepSize(first=1e-3, largest=0.02)),
    PseudoArclength(step_size=StepSize(first=0.3, largest=0.5)),
]


IDS = ["default", "secant", "moore-penrose", "short", "long"]


STEPPERS = pytest.mark.parametrize("stepper", VARIANTS, ids=IDS)


# -- transcritical: y = 0 and y = beta -----------------------------------------------------------


def transcritical_ys(system, alpha):
    """Return y on both lines at alpha: beta = alpha - alpha0 + tilt y."""
    beta = alpha - system.alpha0
    return [0.0, beta / (1.0 - system.tilt)]


def transcritical_states(system, alpha):
    found = []
    for y in transcritical_ys(system, alpha):
        beta = alpha - system.alpha0 + system.tilt * y
        z, at = system.state(y, beta)
        assert at == pytest.approx(alpha, abs=1e-14)
        found.append((z, y, beta))
    return found


STARTS = [(0, -0.8), (1, -0.8), (0, 1.2), (1, 1.2)]


def transcritical_graph(system, start=(0, -0.8), **options):
    line, alpha = start
    z = transcritical_states(system, alpha)[line][0]
    return trace(system, (z, alpha), INTERVAL, **options)


@STEPPERS
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.sweep(10)
def test_transcritical_is_found_from_each_half_branch(stepper, start):
    system = make(transcritical)
    graph = transcritical_graph(system, start, stepper=stepper)
    (point,) = graph.special_points("branch point")
    z, alpha = system.state(0.0, 0.0)
    np.testing.assert_allclose(point.z, z, rtol=0, atol=1e-12)
    assert point.alpha == pytest.approx(alpha, abs=1e-12)
    assert len(graph.pieces) == 4
    assert graph.nx.degree(point.id) == 4
    assert len(graph.special_points("end")) == 4
    assert not graph.special_points("fold")
    assert not graph.special_points("stopped")


@STEPPERS
@pytest.mark.parametrize("alpha", [-0.99, -0.3, 0.0999, 0.1001, 0.5, 1.29])
@pytest.mark.sweep(10)
def test_transcritical_solutions(stepper, alpha):
    system = make(transcritical)
    graph = transcritical_graph(system, stepper=stepper)
    expected = sorted(z.tolist() for z, _, _ in transcritical_states(system, alpha))
    assert graph.count(alpha) == 2
    found = sorted(solution.z.tolist() for solution in graph.solutions(alpha))
    np.testing.assert_allclose(found, expected, rtol=0, atol=LOCATED)
    assert graph.balance(alpha) == 0


def test_transcritical_signs():
    """The sign of det(dH/dz) changes on both curves at the branch point."""
    system = make(transcritical)
    graph = transcritical_graph(system)
    character = system.character(np.zeros(2), 0.0)
    for piece in graph.pieces:
        z, alpha = piece.z[len(piece.z) // 2], piece.alpha[len(piece.z) // 2]
        determinant = np.linalg.det(system.jacobian(z, alpha, character)[:, :-1])
        assert piece.det_sign == np.sign(determinant) == np.sign(piece.alpha[-1] - piece.alpha[0])
        assert (np.diff(piece.alpha) * piece.det_sign > 0.0).all()
    assert sorted(piece.det_sign for piece in graph.pieces) == [-1, -1, 1, 1]


def test_transcritical_without_a_jacobian():
    """Differences of differences still give the point; H itself is exact."""
    system = make(transcritical, exact=False)
    graph = transcritical_graph(system)
    (point,) = graph.special_points("branch point")
    z, alpha = system.state(0.0, 0.0)
    np.testing.assert_allclose(point.z, z, rtol=0, atol=1e-8)
    assert point.alpha == pytest.approx(alpha, abs=1e-8)
    assert [count for _, _, count in graph.multiplicity()] == [2, 1, 2]
    assert len(graph.pieces) == 4


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_do_not_matter(unit):
    system = make(transcritical, unit=unit)
    graph = transcritical_graph(system)
    (point,) = graph.special_points("branch point")
    np.testing.assert_allclose(point.z / unit, system.z0, rtol=0, atol=1e-12)
    assert len(graph.pieces) == 4


@pytest.mark.parametrize("tilt", [0.9, -5.0, -20.0])
def test_curves_at_a_small_angle(tilt):
    system = make(transcritical, tilt=tilt)
    graph = trace(system, (system.state(0.0, -0.9)[0], -0.8), INTERVAL)
    (point,) = graph.special_points("branch point")
    assert point.alpha == pytest.approx(0.1, abs=1e-12)
    assert len(graph.pieces) == 4
    assert graph.balances() == [0, 0]


def test_a_start_at_the_branch_point():
    system = make(transcritical)
    graph = trace(system, system.state(0.0, 0.0), INTERVAL)
    assert len(graph.special_points("branch point")) == 1
    assert len(graph.pieces) == 4
    assert graph.balances() == [0, 0]


def test_a_curve_that_another_touches_while_crossing_goes_on():
    """y (y - beta^3) = 0: the sign flips, but there are no two directions to go on."""

    def form(y, beta):
        return y * (y - beta**3), (2.0 * y - beta**3, -3.0 * beta**2 * y)

    system = make(form)
    graph = trace(system, (system.state(0.0, -0.9)[0], -0.8), INTERVAL)
    (touched,) = graph.special_points("degenerate")
    assert abs(touched.alpha - 0.1) <= 1e-3
    assert touched.message == Remark.TOUCH
    assert not graph.special_points("branch point")
    assert not graph.special_points("stopped")
    for alpha in (-0.9, 0.0, 0.2, 1.2):
        assert [system.state(0.0, alpha - 0.1)[0]] == [
            pytest.approx(solution.z, abs=1e-9) for solution in graph.solutions(alpha)
        ]


def test_a_branch_point_is_kept_in_a_file(tmp_path):
    graph = transcritical_graph(make(transcritical))
    graph.save(tmp_path / "graph.npz")
    again = BranchGraph.load(tmp_path / "graph.npz")
    assert len(again.special_points("branch point")) == 1


# -- pitchfork: y = 0 and beta = y^2 -------------------------------------------------------------


def pitchfork_count(alpha, tilt):
    """Return the number of real solutions: y = 0 and alpha - alpha0 + tilt y = y^2."""
    discriminant = tilt**2 + 4.0 * (alpha - 0.1)
    return 1 if discriminant < 0.0 else 3


@STEPPERS
@pytest.mark.parametrize("tilt", [0.0, 0.3, 1e-3])
@pytest.mark.parametrize("y", [0.0, 0.9, -0.9], ids=["trivial", "upper", "lower"])
@pytest.mark.sweep(20)
def test_pitchfork(stepper, tilt, y):
    """With tilt 0 the second curve is vertical where it begins, else it turns close by."""
    system = make(pitchfork, tilt=tilt)
    beta = y * y if y else -0.8
    z, alpha = system.state(y, beta)
    graph = trace(system, (z, alpha), INTERVAL, stepper=stepper)
    (point,) = graph.special_points("branch point")
    np.testing.assert_allclose(point.z, system.state(0.0, 0.0)[0], rtol=0, atol=1e-11)
    assert point.alpha == pytest.approx(0.1, abs=1e-11)
    folds = [fold.alpha for fold in graph.special_points("fold")]
    np.testing.assert_allclose(folds, [0.1 - tilt**2 / 4.0] if tilt else [], atol=1e-10)
    assert not graph.special_points("stopped")
    assert graph.nx.degree(point.id) == 4
    for alpha in (-0.9, 0.1 - tilt**2 / 4.0 - 1e-7, 0.1 + 1e-6, 1.2):
        assert graph.count(alpha) == pitchfork_count(alpha, tilt)
        assert graph.balance(alpha) == 1
    assert graph.is_balanced()


def test_a_start_at_the_pitchfork():
    system = make(pitchfork, tilt=0.0)
    graph = trace(system, system.state(0.0, 0.0), INTERVAL)
    assert [count for _, _, count in graph.multiplicity()] == [1, 3]
    assert graph.balances() == [1, 1]


@STEPPERS
@pytest.mark.parametrize("imperfection", [1e-2, 1e-5, 1e-8, 1e-10])
@pytest.mark.sweep(20)
def test_imperfect_pitchfork_has_a_fold_and_no_branch_point(stepper, imperfection):
    """y^3 - beta y + e = 0 falls apart; its fold is at beta = 3 (e / 2)^(2/3)."""

    def form(y, beta):
        h, gradient = pitchfork(y, beta)
        return h + imperfection, gradient

    system = make(form, tilt=0.0)
    guess = system.state(1.0, 1.0)
    graph = trace(system, guess, INTERVAL, stepper=stepper)
    assert not graph.special_points("branch point")
    assert not graph.special_points("stopped")
    (fold,) = graph.special_points("fold")
    expected = 0.1 + 3.0 * (imperfection / 2.0) ** (2.0 / 3.0)
    assert fold.alpha == pytest.approx(expected, abs=LOCATED)
    assert len(graph.pieces) == 2
    other = trace(system, system.state(-1.0, 1.0), INTERVAL, stepper=stepper)
    assert [len(other.pieces), len(other.special_points("end"))] == [1, 2]
    assert not other.special_points("branch point")


# -- several branch points, loops ----------------------------------------------------------------


def circle_and_line(y, beta):
    """Return the circle y^2 + beta^2 = 1/4 cut by the line y = 0.3."""
    circle, line = y * y + beta * beta - 0.25, y - 0.3
    return circle * line, (2.0 * y * line + circle, 2.0 * beta * line)


@STEPPERS
@pytest.mark.parametrize("start", [(-0.5, 0.0), (0.3, -0.9), (0.5, 0.0), (0.3, 0.1)])
@pytest.mark.sweep(8)
def test_circle_cut_by_a_line(stepper, start):
    """Two branch points at beta = +-0.4, and folds of the circle at beta = +-0.5."""
    system = make(circle_and_line, tilt=0.0)
    graph = trace(system, system.state(*start), INTERVAL, stepper=stepper)
    found = sorted(point.alpha for point in graph.special_points("branch point"))
    np.testing.assert_allclose(found, [-0.3, 0.5], rtol=0, atol=1e-11)
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    np.testing.assert_allclose(folds, [-0.4, 0.6], rtol=0, atol=LOCATED)
    assert len(graph.components()) == 1
    # three pieces of the line, one arc above it and three below, cut at the folds
    assert len(graph.pieces) == 3 + 1 + 3
    assert [count for _, _, count in graph.multiplicity()] == [1, 3, 2, 3, 2, 3, 1]
    assert len(set(graph.balances())) == 1


def lemniscate(y, beta):
    """Return (beta^2 + y^2)^2 = (beta^2 - y^2) / 4: a figure eight that crosses itself."""
    square = beta * beta + y * y
    value = square**2 - 0.25 * (beta * beta - y * y)
    return value, (4.0 * y * square + 0.5 * y, 4.0 * beta * square - 0.5 * beta)


@STEPPERS
@pytest.mark.parametrize("beta", [0.3, -0.3])
@pytest.mark.sweep(4)
def test_figure_eight(stepper, beta):
    """Both lobes begin and end at one branch point, and each has a fold at its tip."""
    system = make(lemniscate, tilt=0.0)
    # y^4 + (2 beta^2 + 1/4) y^2 + beta^4 - beta^2 / 4 = 0
    p, q = 2.0 * beta**2 + 0.25, beta**4 - 0.25 * beta**2
    y = math.sqrt(-p / 2.0 + math.sqrt(p * p / 4.0 - q))
    graph = trace(system, system.state(y, beta), INTERVAL, stepper=stepper)
    (point,) = graph.special_points("branch point")
    np.testing.assert_allclose(point.z, system.state(0.0, 0.0)[0], rtol=0, atol=1e-11)
    folds = sorted(fold.alpha for fold in graph.special_points("fold"))
    np.testing.assert_allclose(folds, [-0.4, 0.6], rtol=0, atol=LOCATED)
    assert len(graph.pieces) == 4
    assert graph.nx.degree(point.id) == 4
    assert graph.balances() == [0] * len(graph.balances())


def isola(y, beta):
    value = (beta - 0.2) ** 2 + 2.0 * y * y + 0.5 * y * (beta - 0.2) - 0.3
    return value, (4.0 * y + 0.5 * (beta - 0.2), 2.0 * (beta - 0.2) + 0.5 * y)


@STEPPERS
def test_isola(stepper):
    """A smooth loop: two folds, where y = -(beta - 0.2) / 8, and nothing else."""
    system = make(isola, tilt=0.0)
    y = math.sqrt(0.15)
    graph = trace(system, system.state(y, 0.2), INTERVAL, stepper=stepper)
    reach = math.sqrt(0.3 / (1.0 - 1.0 / 32.0))
    folds = sorted(fold.alpha for fold in graph.special_points("fold"))
    np.testing.assert_allclose(folds, [0.3 - reach, 0.3 + reach], rtol=0, atol=LOCATED)
    assert len(graph.pieces) == graph.nx.number_of_nodes() == 2
    assert graph.balance(0.3) == 0


# -- a kink and a branch point -------------------------------------------------------------------


class KinkedTranscritical(PiecewiseSystem):
    """(y - beta) k = 0 with k = y for alpha below 0.5, bent by (alpha - 0.5) above."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([alpha - 0.5])

    def residual(self, z, alpha, character):
        bend = alpha - 0.5 if character.signs[0] else 0.0
        return (z - alpha) * (z - 2.0 * bend)


@STEPPERS
@pytest.mark.parametrize("start", [(0.0, -0.8), (-0.8, -0.8), (1.2, 1.2), (1.4, 1.2)])
@pytest.mark.sweep(10)
def test_a_kink_and_branch_points_in_two_cells(stepper, start):
    """The line z = alpha meets z = 0 at alpha = 0 and z = 2 (alpha - 0.5) at alpha = 1."""
    z, alpha = start
    graph = trace(KinkedTranscritical(), ([z], alpha), INTERVAL, stepper=stepper)
    found = sorted(point.alpha for point in graph.special_points("branch point"))
    np.testing.assert_allclose(found, [0.0, 1.0], rtol=0, atol=1e-9)
    kinks = [(point.alpha, point.z[0]) for point in graph.special_points("transition")]
    np.testing.assert_allclose(sorted(kinks), [(0.5, 0.0), (0.5, 0.5)], rtol=0, atol=LOCATED)
    assert len(graph.pieces) == 8
    assert graph.balances() == [0] * len(graph.balances())
    for alpha in (-0.5, 0.3, 0.7, 1.2):
        expected = sorted([alpha, 2.0 * max(alpha - 0.5, 0.0)])
        found = sorted(solution.z[0] for solution in graph.solutions(alpha))
        np.testing.assert_allclose(found, expected, rtol=0, atol=LOCATED)


# -- curves that touch, and curves of double roots -------------------------------------------------


@pytest.mark.parametrize("order", [3, 2])
@pytest.mark.parametrize("lift", [0.0, 0.1])
@pytest.mark.sweep(9)
def test_curves_that_touch_are_both_followed(order, lift):
    """z = lift and z = lift + alpha^order: for odd orders the sign of det[J; t^T] flips."""
    curves = Switched(1, lambda z, a, sw: (z - lift) * (z - lift - a**order))
    graph = explore(curves, (-1.0, 1.2))
    for alpha in (-0.9, -0.31, 0.27, 0.8, 1.1):
        found = sorted(solution.z[0] for solution in graph.solutions(alpha))
        np.testing.assert_allclose(found, sorted([lift, lift + alpha**order]), atol=1e-9)
    touching = [
        point for point in graph.special_points("degenerate") if Remark.TOUCH in point.message
    ]
    assert touching or order % 2 == 0  # without a flip the magnitude may tell
    assert all(abs(point.alpha) < 1e-2 for point in touching)
    assert ("touch" in graph.guarantee) == bool(touching)


@pytest.mark.slow
def test_curves_that_touch_to_third_order_are_followed_or_named():
    """z = 0 and z = alpha^4 agree to rounding over a tenth of the interval."""
    graph = explore(Switched(1, lambda z, a, sw: z * (z - a**4)), (-1.0, 1.2))
    alphas = (-0.9, -0.31, 0.27, 0.8, 1.1)
    right = [graph.count(alpha) for alpha in alphas] == [2] * len(alphas)
    assert right or graph.guarantee.startswith("not balanced")


#: Equations whose path z = c lies on a kink, c, and the other solutions at an alpha.
PITCHFORKS = {
    "two sides": (lambda z, t, sw: z * (sw.abs(z) - t), 0.0, lambda t: [t, -t] if t > 0.0 else []),
    "shifted": (
        lambda z, t, sw: (z - 0.3) * (sw.abs(z - 0.3) - t + 0.1),
        0.3,
        lambda t: [0.2 + t, 0.4 - t] if t > 0.1 else [],
    ),
    "with a cube": (
        lambda z, t, sw: z**3 - t * z + 0.2 * z * sw.abs(z),
        0.0,
        lambda t: [s * (np.sqrt(0.01 + t) - 0.1) for s in (1.0, -1.0)] if t > 0.0 else [],
    ),
    "one side steeper": (
        lambda z, t, sw: z * (z + sw.relu(z) - t),
        0.0,
        lambda t: [0.5 * t if t > 0.0 else t],
    ),
}


@pytest.mark.parametrize("begin", ["explore", "trace from a cell"])
@pytest.mark.parametrize("name", PITCHFORKS)
@pytest.mark.sweep(3)
def test_curves_that_cross_a_path_on_a_kink(name, begin):
    """The nonsmooth pitchfork, z (|z| - alpha): each cell next to the path has its own curve."""
    f, c, others = PITCHFORKS[name]
    system = Switched(1, f)
    if begin == "explore":
        graph = explore(system, (-1.0, 1.0))
    else:
        graph = trace(system, ([others(0.7)[0]], 0.7), (-1.0, 1.0))
    for alpha in (-0.9, -0.01, 0.2, 0.95):
        found = sorted(float(solution.z[0]) for solution in graph.solutions(alpha))
        assert found == pytest.approx(sorted([c, *others(alpha)]), abs=1e-9)
    assert len(graph.special_points("branch point")) == 1
    assert graph.is_balanced()
