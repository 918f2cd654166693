"""Stiff and extreme cases, each against its closed form or against rational arithmetic."""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from paper_systems import ONE_NODE, TWO_NODES
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import Body, equations, exact_pieces, exact_solve, modes_of, per_node
from sweeps import swept

from pwscont import (
    BranchGraph,
    ExactLinear,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    explore,
    trace,
)
from pwscont.basics.errors import PwscontError

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

EPS = np.finfo(float).eps
COMPLETE = "complete"


# -- load paths against rational arithmetic ----------------------------------------------------


@dataclass(frozen=True)
class Path:
    """A body on an affine load path f0 + alpha f1."""

    body: Body
    f0: Any
    f1: Any
    friction: Any
    interval: tuple[float, float] = (-2.0, 2.0)

    def system(self, r=None):
        load = AffineLoad(self.f0, self.f1)
        return CoulombLoad(contact_body(self.body), load, self.friction, r)

    def exact(self):
        """Return (modes of all nodes, lo, hi, sign of det) of every piece, without rounding."""
        f0, f1 = np.asarray(self.f0, dtype=float), np.asarray(self.f1, dtype=float)
        pieces = exact_pieces(self.body, f0, f1, self.friction, self.interval)
        return sorted((label(p.modes), p.lo, p.hi, p.det_sign) for p in pieces)

    def width(self):
        return self.interval[1] - self.interval[0]


def label(modes):
    if len(modes) == 1:
        return modes[0]
    return ", ".join(f"node {i} {mode}" for i, mode in enumerate(modes, start=1))


def pieces_of(graph):
    return sorted((p.label, *p.interval, p.det_sign) for p in graph.pieces if not p.is_vertical)


def assert_matches(graph, path, tolerance=64.0 * EPS):
    """Every piece is there, no other, and its ends are right relative to the interval."""
    found, expected = pieces_of(graph), path.exact()
    assert [(a[0], a[3]) for a in found] == [(b[0], b[3]) for b in expected]
    for mine, exact in zip(found, expected, strict=True):
        for a, b in zip(mine[1:3], exact[1:3], strict=True):
            assert abs(float(Fraction(a) - b)) <= tolerance * path.width(), (mine, exact)
    assert not graph.special_points("stopped")
    assert graph.guarantee == COMPLETE


def one_node(A=ONE_NODE.A, gap=0.0):
    return Body(np.array(A, dtype=float), ONE_NODE.N, ONE_NODE.T, np.array([gap]))


def two_nodes(stiff=1.0, coupling=0.3, gap=(0.0, 0.0)):
    """Return two copies of the paper's node, the first ``stiff`` times as stiff, coupled."""
    A = np.zeros((4, 4))
    A[:2, :2], A[2:, 2:] = stiff * ONE_NODE.A, ONE_NODE.A
    A[1, 2] = A[2, 1] = -coupling
    A[0, 3] = A[3, 0] = coupling / 2.0
    return Body(A, TWO_NODES.N, TWO_NODES.T, np.array(gap))


LOADED = ([0.25, 0.0, 0.25, 0.1], [0.0, 1.0, 0.2, 1.0])
UNLOADED = ([0.0, 0.0, 0.0, 0.0], [0.5, 1.0, 0.2, -1.0])


# -- nearly incompressible ---------------------------------------------------------------------


def nearly_incompressible(ratio):
    """Return a = (lambda + 3 mu) / 2, b = (lambda + mu) / 2 with mu = 1: a - b = 1 for any."""
    a, b = (ratio + 3.0) / 2.0, (ratio + 1.0) / 2.0
    return np.array([[a, -b], [-b, a]])


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("friction", [0.3, 0.99, 4.0])
@pytest.mark.parametrize("start", [[0.25, 0.0], [0.25, 0.7], [0.0, 0.0]])
@pytest.mark.sweep(4)
def test_nearly_incompressible(ratio, friction, start):
    rate = [0.0, 1.0] if any(start) else [0.4, 1.0]
    path = Path(one_node(nearly_incompressible(ratio)), start, rate, friction)
    assert_matches(explore(path.system(), path.interval), path)


def on_circle(alpha):
    angle = 2.0 * np.pi * alpha - 0.45
    return np.array([0.9 * np.cos(angle) + 1.0, 0.9 * np.sin(angle) - 1.0])


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e4, 1e8, 1e12])
def test_nearly_incompressible_on_a_circle_of_loads(ratio):
    """Contact opens and closes where a f_nu + b f_t = 0: a cos + b sin = (b - a) / 0.9.

    The soft direction moves ``ratio`` times as far as the stiff one. That may cost digits, but
    not steps.
    """
    (a, minus_b), _ = A = nearly_incompressible(ratio)
    b = -minus_b
    graph = explore(CoulombLoad(ContactBody(A, ONE_NODE.N, ONE_NODE.T), on_circle, 4.0), (0.0, 1.0))
    half = np.arccos((b - a) / 0.9 / np.hypot(a, b))
    angles = np.arctan2(b, a) + np.array([-half, half])
    expected = sorted((angles + 0.45) / (2.0 * np.pi) % 1.0)
    (free,) = [piece for piece in graph.pieces if piece.label == "no contact"]
    np.testing.assert_allclose(sorted(free.interval), expected, rtol=1e-11)
    assert graph.is_balanced()
    assert sum(len(piece.points) for piece in graph.pieces) < 500


# -- units -------------------------------------------------------------------------------------

SCALES = [1e-12, 1e-6, 1.0, 1e6, 1e12]


@pytest.mark.parametrize(("stiffness", "force"), list(product(SCALES, SCALES)))
@pytest.mark.sweep(4)
def test_any_unit_of_stiffness_and_load(stiffness, force):
    body = Body(stiffness * TWO_NODES.A, TWO_NODES.N, TWO_NODES.T, TWO_NODES.gap)
    f0, f1 = force * np.array([0.4, 0.0, 1.8, 0.0]), force * np.array([0.0, 1.0, 0.2, 1.0])
    path = Path(body, f0, f1, 4.0)
    assert_matches(explore(path.system(), path.interval), path, tolerance=256.0 * EPS)


@pytest.mark.parametrize("power", [-40, -10, 10, 40])
def test_digits_do_not_depend_on_units(power):
    """Powers of two change no rounding, so that digits must be the very same."""
    path = Path(one_node(), [0.25, 0.0], [0.7, 1.0], 4.0)
    scaled = replace(path, body=one_node(2.0**power * ONE_NODE.A))
    graphs = [explore(p.system(), p.interval) for p in (path, scaled)]
    digits = [[point.digits for point in graph.special_points()] for graph in graphs]
    np.testing.assert_allclose(digits[1], digits[0], atol=0.5)
    digits = [[s.digits for s in graph.solutions(-0.4)] for graph in graphs]
    np.testing.assert_allclose(digits[1], digits[0], atol=0.5)


class BentCircle(PiecewiseSystem):
    """z^2 + alpha^2 = 1, pressed flat beyond z = 0.3 a little, watched in any unit."""

    size = 1

    def __init__(self, unit):
        self.unit = unit

    def test_functions(self, z, alpha):
        return self.unit * (z - 0.3)

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0 + 0.2 * character.array * (z - 0.3)


@pytest.mark.parametrize("power", [-300, -170, -100, 100, 170, 300])
def test_any_unit_of_a_test_of_curved_pieces(power):
    """A direction along which such a test rises by one has a length whose square is no number."""
    graph = trace(BentCircle(10.0**power), ([0.9], 0.0), (-2.0, 2.0))
    kinds = [point.kind for point in graph.special_points() if point.kind != "start"]
    assert sorted(kinds) == ["fold", "fold", "transition", "transition"]
    crossed = sorted(point.alpha for point in graph.special_points("transition"))
    np.testing.assert_allclose(crossed, np.sqrt(0.91) * np.array([-1.0, 1.0]), rtol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_the_unloaded_body_is_known_to_all_digits(seed):
    """z = 0 at alpha = 0, but for rounding of unknowns of the order of one."""
    body = random_body(1, seed)
    path = Path(body, np.zeros(body.n), random_vector(body.n, seed), 0.7, (-2.0, 3.0))
    graph = explore(path.system(), path.interval)
    assert min(point.digits for point in graph.special_points()) > 8.0


# -- contrasts between nodes -------------------------------------------------------------------


@pytest.mark.parametrize("stiff", [1e-10, 1e-5, 1.0, 1e5, 1e10])
@pytest.mark.parametrize("coupling", [0.0, 0.3])
@pytest.mark.parametrize("friction", [0.7, 4.0])
@pytest.mark.parametrize("load", [LOADED, UNLOADED], ids=["loaded", "unloaded"])
@pytest.mark.sweep(4)
def test_one_node_much_stiffer_than_its_neighbour(stiff, coupling, friction, load):
    body = two_nodes(stiff, coupling * min(1.0, stiff))
    path = Path(body, *load, friction)
    assert_matches(explore(path.system(), path.interval), path)


@pytest.mark.parametrize(
    "friction", [(1e-3, 1e3), (1e3, 1e-3), (4.0, 4e6), (1e6, 1.0), (1e-6, 1.0), (0.0, 4.0)]
)
@pytest.mark.parametrize("load", [LOADED, UNLOADED], ids=["loaded", "unloaded"])
def test_friction_different_per_node(friction, load):
    path = Path(two_nodes(), *load, np.array(friction))
    assert_matches(explore(path.system(), path.interval), path)


# -- friction as the parameter, against rational arithmetic at fixed F ---------------------------


def exact_solutions(body, force, friction):
    """Return {modes: z} of all solutions at one load and friction, without rounding."""
    still, tiny = np.zeros(body.n), (0.0, 1.0)
    found = {}
    for piece in exact_pieces(body, np.asarray(force), still, friction, tiny):
        matrix, rhs = equations(body, per_node(friction, body.p), piece.modes)
        rhs[: body.n] += force
        found[piece.modes] = np.array(exact_solve(matrix, [rhs])[0][0], dtype=object)
    return found


def assert_right_over_friction(body, force, hi=15.0, r=None):
    """Number and states are right at some F, and the errors cover what is not."""
    graph = explore(CoulombFriction(contact_body(body), force, r=r), (hi * 1e-4, hi))
    for at in hi * np.array([0.011, 0.13, 0.31, 0.57, 0.93]):
        expected, found = exact_solutions(body, force, at), graph.solutions(at)
        assert sorted(map(label, expected)) == sorted(s.label for s in found)
        for solution in found:
            exact = expected[modes_of(solution.label)]
            pairs = zip(solution.z, exact, strict=True)
            off = np.array([abs(float(Fraction(a) - b)) for a, b in pairs])
            assert (off <= 10.0 * solution.error[:-1]).all()
    assert not graph.special_points("stopped")
    assert graph.is_balanced()


FIVE = np.array([0.4, -1.4, 1.5, -1.5])  # up to five solutions on the paper's two nodes


@pytest.mark.parametrize(("stiffness", "force"), list(product([1e-12, 1.0, 1e12], repeat=2)))
@pytest.mark.sweep(4)
def test_friction_as_parameter_in_any_unit(stiffness, force):
    body = Body(stiffness * TWO_NODES.A, TWO_NODES.N, TWO_NODES.T, TWO_NODES.gap)
    assert_right_over_friction(body, force * FIVE)


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("force", [(1.0, -3.0), (0.2, -1.6), (1.0, -1.0)])
@pytest.mark.sweep(4)
def test_friction_as_parameter_of_a_nearly_incompressible_body(ratio, force):
    """Displacements are known to few digits, but each branch is there once."""
    assert_right_over_friction(one_node(nearly_incompressible(ratio)), force)


@pytest.mark.parametrize("stiff", [1e-10, 1e-5, 1e5, 1e10])
@pytest.mark.parametrize("coupling", [0.0, 0.3])
@pytest.mark.parametrize("force", [FIVE, [1.0, -3.0, 1.0, -2.6]], ids=["five", "nine"])
@pytest.mark.sweep(5)
def test_friction_as_parameter_of_nodes_of_different_stiffness(stiff, coupling, force):
    assert_right_over_friction(two_nodes(stiff, coupling * min(1.0, stiff)), np.array(force))


@pytest.mark.parametrize("r", [1e-8, 1e-4, 1.0, 1e4, 1e8])
@pytest.mark.sweep(3)
def test_friction_as_parameter_with_any_scale_of_the_multipliers(r):
    assert_right_over_friction(TWO_NODES, FIVE, r=r)


@pytest.mark.parametrize("gap", [1e-300, 1e-12, 1e-6, 1e6, 1e12, 1e100])
@pytest.mark.sweep(4)
def test_friction_as_parameter_with_any_gap(gap):
    assert_right_over_friction(two_nodes(gap=(gap, 0.0)), FIVE)


@pytest.mark.parametrize("hi", [1.0, 1e3, 1e6])
def test_friction_of_two_nodes_up_to_a_million(hi):
    assert_right_over_friction(TWO_NODES, FIVE, hi)


# -- friction ----------------------------------------------------------------------------------

CRITICAL = 2.0  # a / b of the paper's node


@pytest.mark.parametrize("friction", [0.0, 1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("start", [[0.25, 0.0], [0.0, 0.0]])
@pytest.mark.parametrize("rate", [[0.0, 1.0], [0.7, 1.0]])
def test_any_coefficient_of_friction(friction, start, rate):
    path = Path(one_node(), start, rate, friction)
    if friction == 0.0 or (not any(start) and not rate[0]):
        pytest.skip("stick is one point, or the path runs along an interface")
    assert_matches(explore(path.system(), path.interval), path)


@pytest.mark.parametrize("rate", [[0.3, 1.0], [-0.3, 1.0], [0.7, -1.0]])
def test_no_friction(rate):
    """Without friction u_t never matters: contact closes where a f_nu + b f_t = 0."""
    system = CoulombLoad(contact_body(one_node()), AffineLoad([0.25, 0.0], rate), 0.0)
    graph = explore(system, (-2.0, 2.0))
    alpha = -0.5 / (2.0 * rate[0] + rate[1])
    assert [count for _, _, count in graph.multiplicity()] == [1]
    assert min(abs(p.alpha - alpha) for p in graph.special_points()) <= 8.0 * EPS
    assert graph.guarantee == COMPLETE
    for at in (-1.7, -0.1, 0.1, 1.3):
        (solution,) = graph.solutions(at)
        f = np.array([0.25, 0.0]) + at * np.array(rate)
        contact = 2.0 * f[0] + f[1] > 0.0
        u = np.array([0.0, f[1] / 2.0]) if contact else np.linalg.solve(ONE_NODE.A, f)
        np.testing.assert_allclose(solution.z[:2], u, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("relative", [1e-3, 1e-6, 1e-9, 1e-12, -1e-3, -1e-6, -1e-9, -1e-12])
@pytest.mark.parametrize(("start", "rate"), [([0.25, 0.0], [0.0, 1.0]), ([0.25, 0.0], [0.7, 1.0])])
def test_friction_close_to_the_critical_one(relative, start, rate):
    """The slip piece is nearly vertical; it spans as little of alpha as ``relative``."""
    path = Path(one_node(), start, rate, CRITICAL * (1.0 + relative))
    assert_matches(explore(path.system(), path.interval), path)


@pytest.mark.parametrize("force", [(1.0, -3.0), (0.2, -1.6), (1.0, -1.0), (1.0, 10.0)])
@pytest.mark.parametrize("hi", [20.0, 1e3, 1e6])
def test_friction_up_to_a_million_as_parameter(force, hi):
    """Slip begins and ends where F f_nu = |f_t|, but for F = a / b nothing else happens."""
    f_nu, f_t = force
    graph = explore(CoulombFriction(contact_body(one_node()), force), (0.0, hi))
    touches = 2.0 * f_nu + f_t > 0.0  # does the body touch at F = 0?
    kind = "transition" if touches else "nonsmooth fold"
    (point,) = graph.special_points(kind)
    assert point.alpha == pytest.approx(abs(f_t) / f_nu, rel=max(1e-14, 16.0 * EPS * hi))
    expected = [1] if touches else [1, 3]
    assert [count for _, _, count in graph.multiplicity()] == expected
    assert graph.is_balanced()


# -- scale of the augmented multipliers --------------------------------------------------------


@pytest.mark.parametrize("r", [1e-8, 1e-4, 1.0, 1e4, 1e8])
@pytest.mark.parametrize("nodes", [1, 2])
def test_any_scale_of_the_augmented_multipliers(r, nodes):
    """A small r costs digits, as many as it is smaller than the stiffness."""
    path = (
        Path(one_node(), [0.25, 0.0], [0.0, 1.0], 4.0)
        if nodes == 1
        else Path(two_nodes(), *LOADED, 4.0)
    )
    graph = explore(path.system(r), path.interval)
    assert_matches(graph, path, tolerance=256.0 * EPS * max(1.0, 1.0 / r))


# -- close together ----------------------------------------------------------------------------


class ThinCell(PiecewiseLinearSystem):
    """alpha = z + c (max(z - 1, 0) - max(z - 1 - width, 0)): slope 1 + c on a thin cell."""

    size = 1

    def __init__(self, c, width):
        self.c, self.width = c, width

    def test_functions(self, z, alpha):
        return np.array([z[0] - 1.0, z[0] - 1.0 - self.width])

    def residual(self, z, alpha, character):
        first, second = self.test_functions(z, alpha)
        above, beyond = character.signs
        return np.array([z[0] + self.c * (above * first - beyond * second) - alpha])


@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arclength"])
@pytest.mark.parametrize("width", [2.0**-30, 2.0**-40, 2.0**-43])
@pytest.mark.parametrize("c", [1.0, -3.0, 2.0**20, -(2.0**20)])
def test_transitions_and_folds_a_trillionth_apart(stepper, width, c):
    graph = trace(ThinCell(c, width), ([0.0], 0.0), (0.0, 2.0), stepper=stepper)
    nodes = graph.special_points("nonsmooth fold" if c < -1.0 else "transition")
    assert [node.z[0] for node in nodes] == [1.0, 1.0 + width]
    expected = [1.0, 1.0 + width * (1.0 + c)]
    slack = 8.0 * EPS * (1.0 + abs(c))
    np.testing.assert_allclose([node.alpha for node in nodes], expected, rtol=0, atol=slack)
    assert [piece.det_sign for piece in graph.pieces] == [1, 1 if c > -1.0 else -1, 1]
    assert graph.is_balanced()


def nearly_identical_nodes(seed):
    """Return two equal nodes, coupled or not, but for one datum in its 12th to 15th digit."""
    rng = np.random.default_rng([2012, seed])
    small = 10.0 ** rng.uniform(-15.5, -11.5)
    root, turned = rng.normal(size=(4, 4)), np.eye(4)[[2, 3, 0, 1]]
    A = root @ root.T + 0.05 * np.eye(4)
    A = (A + turned @ A @ turned) / 2.0
    if seed % 2:
        A[:2, 2:] = A[2:, :2] = 0.0
    f0, f1 = np.tile(rng.normal(size=2), 2), np.tile(rng.normal(size=2), 2)
    gap, friction = np.zeros(2), np.full(2, rng.choice([0.5, 2.5, 4.0, 10.0]))
    target = (f0, gap, friction)[seed % 3]
    target[-1] += small
    return Path(Body(A, TWO_NODES.N, TWO_NODES.T, gap), f0, f1, friction)


def away_from(ends):
    """Return the middles between ends of pieces that are not the same within rounding."""
    ends = sorted(map(float, ends))
    return [0.5 * (a + b) for a, b in pairwise(ends) if b - a > 1e-9]


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.sweep(4)
def test_nodes_that_differ_by_rounding(seed):
    """Their transitions are 1e-15 to 1e-12 apart: one corner or two points, balanced anyway."""
    path = nearly_identical_nodes(seed)
    graph, exact = explore(path.system(), path.interval), path.exact()
    assert graph.guarantee == COMPLETE
    assert graph.balance_values() == [1]
    assert not graph.special_points("stopped")
    for at in away_from({end for piece in exact for end in piece[1:3]}):
        assert graph.count(at) == sum(lo < at < hi for _, lo, hi, _ in exact)
    for piece in graph.pieces:
        for node, x in zip((piece.start, piece.end), piece.points[[0, -1]], strict=True):
            point = graph.point(node)
            assert abs(x[-1] - point.alpha) <= 10.0 * point.error[-1] + 1e-15


# -- transversality lost -----------------------------------------------------------------------


class Grazing(PiecewiseLinearSystem):
    """The path z1 = alpha, z2 = z1 + slope (z1 - 1/4) meets the interface z2 = z1 at alpha = 1/4.

    Beyond it z2 rises by ``bend`` times the distance from the interface more.
    """

    size = 2

    def __init__(self, slope, bend):
        self.slope, self.bend = slope, bend

    def test_functions(self, z, alpha):
        return np.array([z[1] - z[0]])

    def residual(self, z, alpha, character):
        beyond = self.bend * (z[1] - z[0]) if character.signs[0] else 0.0
        return np.array([z[0] - alpha, z[1] - z[0] - self.slope * (z[0] - 0.25) - beyond])


@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arclength"])
@pytest.mark.parametrize("slope", [1e-4, 1e-8, 1e-10])
@pytest.mark.parametrize("bend", [0.5, -3.0, 3.0])
def test_a_path_nearly_along_an_interface(stepper, slope, bend):
    """Alpha is known to EPS / slope there, and the error says so; the way on is not lost."""
    graph = trace(Grazing(slope, bend), ([-1.0, -1.0], -1.0), (-1.0, 1.0), stepper=stepper)
    (point,) = graph.special_points("transition" if bend < 1.0 else "nonsmooth fold")
    off = abs(point.alpha - 0.25)
    assert off <= 16.0 * EPS / slope
    assert off <= 10.0 * point.error[-1]
    assert point.error[-1] <= 1e3 * EPS / slope
    assert len(graph.pieces) == 2
    last = graph.pieces[-1].points[-1]
    assert last[1] - last[0] == pytest.approx(
        slope * (last[2] - 0.25) / (1.0 - bend), rel=1e-3 if slope > 1e-9 else 0.1
    )


class Parabola(PiecewiseSystem):
    """y = x^2 and x + m min(y - d^2, 0) = alpha: tangent to the interface y = 0 as d falls."""

    size = 2

    def __init__(self, depth, m):
        self.depth, self.m = depth, m

    def test_functions(self, z, alpha):
        return np.array([z[1] - self.depth**2])

    def test_jacobian(self, z, alpha):
        return np.array([[0.0, 1.0, 0.0]])

    def residual(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m * (z[1] - self.depth**2)
        return np.array([z[1] - z[0] ** 2, z[0] + bend - alpha])

    def jacobian(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m
        return np.array([[-2.0 * z[0], 1.0, 0.0], [1.0, bend, -1.0]])


@pytest.mark.parametrize("m", [0.3, -0.9, 5.0])
@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-8, 1e-10, 1e-12])
def test_a_curved_path_nearly_tangent_to_an_interface(depth, m):
    """x^2 is known to all its digits next to zero, and so are both transitions."""
    graph = trace(Parabola(depth, m), ([-0.9, 0.81], -0.9), (-1.0, 1.0))
    transitions = graph.special_points("transition")
    np.testing.assert_allclose(sorted(p.alpha for p in transitions), [-depth, depth], rtol=1e-12)
    for point in transitions:
        assert abs(abs(point.alpha) - depth) <= 10.0 * point.error[-1] <= 1e-5 * depth
    assert not graph.special_points("stopped")
    for at in (-0.5, 0.5):
        (solution,) = graph.solutions(at)
        np.testing.assert_allclose(solution.z, [at, at**2], rtol=1e-14)


class RaisedParabola(Parabola):
    """The same with the interface at y = level + depth^2: rounding of y blurs where they meet."""

    def __init__(self, level, depth, m):
        super().__init__(depth, m)
        self.level = level
        self.interface = level + depth**2

    def test_functions(self, z, alpha):
        return np.array([z[1] - self.interface])

    def residual(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m * (z[1] - self.interface)
        return np.array([z[1] - z[0] ** 2 - self.level, z[0] + bend - alpha])


@pytest.mark.parametrize("m", [0.3, -0.9, 5.0])
@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-7, 3e-8, 1e-8, 1e-10, 0.0])
@pytest.mark.parametrize("level", [1.0, 0.3, 1e3])
@pytest.mark.sweep(5)
def test_a_curved_path_tangent_to_an_interface_within_rounding(level, depth, m):
    """x^2 = d^2 within EPS is x = d within EPS / d. Where d is rounding, the message says so."""
    system = RaisedParabola(level, depth, m)
    true = float(Fraction(system.interface) - Fraction(level)) ** 0.5
    graph = trace(system, ([-0.9, 0.81 + level], -0.9), (-1.0, 1.0))
    found = [*graph.special_points("transition"), *graph.special_points("stopped")]
    for point in found:
        assert abs(abs(point.alpha) - true) <= 10.0 * point.error[-1]
    if true**2 >= 4.0 * EPS * level:
        assert [point.kind for point in found] == ["transition", "transition"]
    elif graph.special_points("stopped"):
        assert "tangent to the interface" in found[-1].message
        assert graph.guarantee != COMPLETE


# -- gaps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [1e-300, 1e-15, 1e-12, 1e-6, 1e6, 1e12, 1e100])
def test_any_gap(gap):
    path = Path(one_node(gap=gap), [0.25, 0.0], [0.0, 1.0], 4.0)
    assert_matches(explore(path.system(), path.interval), path)
    if gap < 1e50:
        path = Path(one_node(gap=gap), [0.25, 0.0], [0.0, gap], 4.0, (-10.0, 10.0))
        assert_matches(explore(path.system(), path.interval), path)


@pytest.mark.parametrize("far", [1e3, 1e8, 1e12, 1e16, 1e100])
@pytest.mark.parametrize("near", [0.0, 1e-12, 1e-3])
@pytest.mark.sweep(4)
def test_a_node_that_never_touches(far, near):
    """The gap of one node says nothing of the accuracy that the other one needs."""
    path = Path(two_nodes(gap=(near, far)), *LOADED, 4.0)
    graph = explore(path.system(), path.interval)
    assert_matches(graph, path)
    traced = trace(path.system(), (np.zeros(8), -2.0), path.interval)
    assert {p.label for p in traced.pieces} <= {piece[0] for piece in path.exact()}


# -- the range of floating-point numbers -------------------------------------------------------


def graphs_at(load):
    """Yield explored graphs, as (alphas in units of the interval, counts), at a scale of load."""
    body = contact_body(one_node())
    loads = CoulombLoad(body, AffineLoad([0.25 * load, 0.0], [0.0, load]), 4.0)
    yield lambda stepper: explore(loads, (-2.0, 2.0), stepper=stepper), 1.0
    inverse = CoulombLoad(body, AffineLoad([0.25 * load, 0.0], [0.0, 1.0]), 4.0)
    yield lambda stepper: explore(inverse, (-2.0 * load, 2.0 * load), stepper=stepper), load
    start = (np.array([0.0, 0.0, -0.25 * load, 0.0]), 0.0)
    yield lambda stepper: trace(loads, start, (-2.0, 2.0), stepper=stepper), 1.0


def graph_unless_refused(make, load):
    """Return the graph; None where the load is refused because of its units, as it may be."""
    if 1e-100 <= load <= 1e100:
        return make()
    try:
        return make()
    except PwscontError as refused:
        message = str(refused)
    assert "units" in message
    return None


@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arclength"])
@pytest.mark.parametrize(
    "load", [1e-307, 1e-300, 1e-200, 1e-150, 1e-100, 1e100, 1e150, 1e200, 1e300]
)
def test_loads_near_the_ends_of_the_range_of_numbers(load, stepper):
    """Either everything is right, or it is refused in words that say what to do."""
    for make, unit in graphs_at(load):
        graph = graph_unless_refused(lambda make=make: make(stepper), load)
        if graph is None:
            continue
        folds = sorted(point.alpha / unit for point in graph.special_points("nonsmooth fold"))
        np.testing.assert_allclose(folds, [-1.0, -0.5], rtol=1e-12)
        assert [count for _, _, count in graph.multiplicity()] == [1, 3, 1]
        assert all(np.isfinite(piece.points).all() for piece in graph.pieces)


@pytest.mark.parametrize("load", [1e-300, 1e-200, 1e-100, 1e100, 1e200, 1e300])
def test_friction_under_loads_near_the_ends_of_the_range_of_numbers(load):
    system = CoulombFriction(contact_body(one_node()), [load, -3.0 * load])
    graph = graph_unless_refused(lambda: explore(system, (0.0, 5.0)), load)
    if graph is None:
        return
    (fold,) = graph.special_points("nonsmooth fold")
    assert fold.alpha == pytest.approx(3.0, rel=1e-14)


# -- the unloaded body -------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.3, 0.7, 4.0])
@pytest.mark.parametrize(("p", "seeds"), [(1, 24), (2, 6)])
@pytest.mark.sweep(4)
def test_a_path_through_the_unloaded_body(p, seeds, friction):
    """All tests vanish at alpha = 0. The path arrives there with rounding, and must see that."""
    for seed in range(seeds):
        body = random_body(p, seed)
        f1 = random_vector(body.n, [seed, 7])
        path = Path(body, np.zeros(body.n), f1, friction, (-2.0, 3.0))
        assert_matches(explore(path.system(), path.interval), path)


# -- ten thousand transitions ------------------------------------------------------------------


class NestedSawteeth(PiecewiseLinearSystem):
    """z1 = S(z0), z2 = W(z1), alpha = z0 + z2 with two sawteeth S and W.

    S has the values ``v`` at the whole numbers and is straight between them, so does W with
    ``w``. Each tooth of S crosses all kinks of W; alpha turns back at each of these. A cell is
    bounded by four tests, its neighbours on both saws, however many there are.
    """

    size = 3

    def __init__(self, teeth, kinks):
        self.first = -(teeth // 2)
        self.v = np.where(np.arange(teeth + 1) % 2, kinks + 0.7, 0.3)
        self.w = np.where(np.arange(kinks + 2) % 2, 2.1 / kinks, 0.1 / kinks)
        self.turns = self.first + np.arange(1.0, teeth)
        self.kinks = np.arange(1.0, kinks + 1.0)

    def test_functions(self, z, alpha):
        return np.concatenate([z[0] - self.turns, z[1] - self.kinks])

    def test_jacobian(self, z, alpha):
        return self._gradients

    @property
    def _gradients(self):
        rows = np.zeros((len(self.turns) + len(self.kinks), 4))
        rows[: len(self.turns), 0] = rows[len(self.turns) :, 1] = 1.0
        return rows

    def place(self, character):
        """Return the numbers of the tooth of S and of the stretch of W."""
        turns = len(self.turns)
        return sum(character.signs[:turns]), sum(character.signs[turns:])

    def bounding_tests(self, character):
        (i, j), turns, kinks = self.place(character), len(self.turns), len(self.kinks)
        own = [k for k in (i - 1, i) if 0 <= k < turns]
        return own + [turns + k for k in (j - 1, j) if 0 <= k < kinks]

    def slopes(self, i, j):
        return self.v[i + 1] - self.v[i], self.w[j + 1] - self.w[j]

    def residual(self, z, alpha, character):
        i, j = self.place(character)
        steep, flat = self.slopes(i, j)
        first = z[1] - self.v[i] - steep * (z[0] - self.first - i)
        return np.array([first, z[2] - self.w[j] - flat * (z[1] - j), z[0] + z[2] - alpha])

    def jacobian(self, z, alpha, character):
        steep, flat = self.slopes(*self.place(character))
        return np.array([[-steep, 1.0, 0, 0], [0, -flat, 1.0, 0], [1.0, 0, 1.0, -1.0]])

    def scale(self, lo, hi):
        return np.array([hi - lo, len(self.kinks), 1.0])

    def exact_alphas(self):
        """Return alpha at every kink in the order of the path, as rational numbers."""
        v, w = [Fraction(float(x)) for x in self.v], [Fraction(float(x)) for x in self.w]
        alphas, kinks = [], range(1, len(w) - 1)
        for i in range(len(v) - 1):
            if i:
                j = int(v[i])
                alphas.append(self.first + i + w[j] + (w[j + 1] - w[j]) * (v[i] - j))
            order = kinks if v[i + 1] > v[i] else reversed(kinks)
            alphas += [self.first + i + (j - v[i]) / (v[i + 1] - v[i]) + w[j] for j in order]
        return alphas


@pytest.mark.parametrize(
    ("stepper", "teeth"),
    swept(
        [(ExactLinear(), 21)],
        [(PseudoArclength(), 5), (ExactLinear(), 101), (PseudoArclength(), 11)],
    ),
    ids=lambda value: str(value) if isinstance(value, int) else type(value).__name__,
)
def test_thousands_of_transitions_without_drift(stepper, teeth):
    system = NestedSawteeth(teeth, kinks=100)
    lo, hi = system.first - 1.0, system.first + teeth + 1.0
    graph = trace(system, ([lo - 1.0, -50.0, -1.0], lo), (lo, hi), stepper=stepper)
    expected = system.exact_alphas()
    (component,) = graph.components()
    found = [point.alpha for point in graph.itinerary(component)[1:-1]]
    assert len(found) == len(expected) == 101 * teeth - 1
    errors = [abs(float(Fraction(a) - b)) for a, b in zip(found, expected, strict=True)]
    first, last = max(errors[:100]), max(errors[-100:])
    assert last <= 100.0 * first
    assert max(errors) <= 64.0 * EPS * (hi - lo)
    assert len(graph.special_points("nonsmooth fold")) == len(expected)
    if len(expected) < 2000:
        assert set(graph.balances()) == {1}


# -- what must not matter ----------------------------------------------------------------------


def mirrored(label):
    return label.translate(str.maketrans("+-", "-+"))


def swapped(label):
    first, second = (part.split(" ", 2)[2] for part in label.split(", "))
    return f"node 1 {second}, node 2 {first}"


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("load", [True, False], ids=["load", "friction"])
@pytest.mark.sweep(3)
class TestInvariance:
    """The same body described otherwise has the same branches."""

    def systems(self, seed, load, order=(0, 1), side=1.0, turn=1.0):
        body = random_body(2, seed, gap=bool(seed % 2))
        order = list(order)
        same = ContactBody(body.A, body.N[order], side * body.T[order], body.gap[order])
        f0, f1 = random_vector(body.n, [seed, 1]), random_vector(body.n, [seed, 2])
        if load:
            return CoulombLoad(same, AffineLoad(f0, turn * f1), np.array([3.0, 5.0])[order])
        return CoulombFriction(same, 3.0 * f0, profile=np.array([1.0, 1.5])[order])

    def graph(self, seed, load, **how):
        system = self.systems(seed, load, **how)
        return explore(system, (-2.0, 2.0) if load else (0.0, 3.0))

    def assert_same(self, graph, other, rename=str, turn=1.0):
        ends = [sorted((turn * p.interval[0], turn * p.interval[1])) for p in other.pieces]
        found = sorted(
            (rename(p.label), *e, p.det_sign) for p, e in zip(other.pieces, ends, strict=True)
        )
        expected = pieces_of(graph)
        assert [(a[0], a[3]) for a in found] == [(b[0], b[3]) for b in expected]
        np.testing.assert_allclose(
            [a[1:3] for a in found], [b[1:3] for b in expected], rtol=1e-11, atol=1e-11
        )

    def test_order_of_the_nodes(self, seed, load):
        other = self.graph(seed, load, order=(1, 0))
        self.assert_same(self.graph(seed, load), other, rename=swapped)

    def test_sign_of_the_tangent_direction(self, seed, load):
        self.assert_same(self.graph(seed, load), self.graph(seed, load, side=-1.0), rename=mirrored)

    def test_sign_of_the_parameter(self, seed, load):
        if not load:
            pytest.skip("a coefficient of friction has no other sign")
        other = self.graph(seed, load, turn=-1.0)
        self.assert_same(self.graph(seed, load), other, turn=-1.0)

    def test_direction_in_which_a_component_is_followed(self, seed, load):
        system, graph = self.systems(seed, load), self.graph(seed, load)
        lo, hi = graph.interval
        for component in graph.components():
            ends = {piece.start for piece in component} ^ {piece.end for piece in component}
            traced = [
                trace(system, (graph.point(i).z, graph.point(i).alpha), (lo, hi)) for i in ends
            ]
            for one in traced:
                expected = BranchGraph(graph.special_points(), component, (lo, hi))
                self.assert_same(expected, one)
