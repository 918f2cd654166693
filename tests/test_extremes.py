"""Stiff and extreme cases, each against its closed form or against rational arithmetic."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
from extreme_parts import (
    COMPLETE,
    EPS,
    LOADED,
    Path,
    assert_matches,
    label,
    one_node,
    two_nodes,
)
from paper_systems import ONE_NODE, TWO_NODES
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import Body, equations, exact_pieces, exact_solve, modes_of, per_node

from pwscont import (
    ExactLinear,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    explore,
    trace,
)

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


UNLOADED = ([0.0, 0.0, 0.0, 0.0], [0.5, 1.0, 0.2, -1.0])


# -- nearly incompressible ---------------------------------------------------------------------


def nearly_incompressible(ratio):
    """Return a = (lambda + 3 mu) / 2, b = (lambda + mu) / 2 with mu = 1: a - b = 1 for any."""
    a, b = (ratio + 3.0) / 2.0, (ratio + 1.0) / 2.0
    return np.array([[a, -b], [-b, a]])


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("friction", [0.3, 0.99, 4.0])
@pytest.mark.parametrize("start", [[0.25, 0.0], [0.25, 0.7], [0.0, 0.0]])
@pytest.mark.sweep(12)
def test_nearly_incompressible(ratio, friction, start):
    rate = [0.0, 1.0] if any(start) else [0.4, 1.0]
    path = Path(one_node(nearly_incompressible(ratio)), start, rate, friction)
    assert_matches(explore(path.system(), path.interval), path)


def on_circle(alpha):
    angle = 2.0 * np.pi * alpha - 0.45
    return np.array([0.9 * np.cos(angle) + 1.0, 0.9 * np.sin(angle) - 1.0])


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e4, 1e8, 1e12])
@pytest.mark.sweep(8)
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
@pytest.mark.sweep(12)
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
@pytest.mark.sweep(8)
def test_any_unit_of_a_test_of_curved_pieces(power):
    """A direction along which such a test rises by one has a length whose square is no number."""
    graph = trace(BentCircle(10.0**power), ([0.9], 0.0), (-2.0, 2.0))
    kinds = [point.kind for point in graph.special_points() if point.kind != "start"]
    assert sorted(kinds) == ["fold", "fold", "transition", "transition"]
    crossed = sorted(point.alpha for point in graph.special_points("transition"))
    np.testing.assert_allclose(crossed, np.sqrt(0.91) * np.array([-1.0, 1.0]), rtol=1e-14)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.sweep(6)
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
@pytest.mark.sweep(12)
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
@pytest.mark.sweep(16)
def test_friction_as_parameter_in_any_unit(stiffness, force):
    body = Body(stiffness * TWO_NODES.A, TWO_NODES.N, TWO_NODES.T, TWO_NODES.gap)
    assert_right_over_friction(body, force * FIVE)


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("force", [(1.0, -3.0), (0.2, -1.6), (1.0, -1.0)])
@pytest.mark.sweep(12)
def test_friction_as_parameter_of_a_nearly_incompressible_body(ratio, force):
    """Displacements are known to few digits, but each branch is there once."""
    assert_right_over_friction(one_node(nearly_incompressible(ratio)), force)


@pytest.mark.parametrize("stiff", [1e-10, 1e-5, 1e5, 1e10])
@pytest.mark.parametrize("coupling", [0.0, 0.3])
@pytest.mark.parametrize("force", [FIVE, [1.0, -3.0, 1.0, -2.6]], ids=["five", "nine"])
@pytest.mark.sweep(30)
def test_friction_as_parameter_of_nodes_of_different_stiffness(stiff, coupling, force):
    assert_right_over_friction(two_nodes(stiff, coupling * min(1.0, stiff)), np.array(force))


@pytest.mark.parametrize("r", [1e-8, 1e-4, 1.0, 1e4, 1e8])
@pytest.mark.sweep(6)
def test_friction_as_parameter_with_any_scale_of_the_multipliers(r):
    assert_right_over_friction(TWO_NODES, FIVE, r=r)


@pytest.mark.parametrize("gap", [1e-300, 1e-12, 1e-6, 1e6, 1e12, 1e100])
@pytest.mark.sweep(8)
def test_friction_as_parameter_with_any_gap(gap):
    assert_right_over_friction(two_nodes(gap=(gap, 0.0)), FIVE)


@pytest.mark.parametrize("hi", [1.0, 1e3, 1e6])
@pytest.mark.sweep(4)
def test_friction_of_two_nodes_up_to_a_million(hi):
    assert_right_over_friction(TWO_NODES, FIVE, hi)


# -- friction ----------------------------------------------------------------------------------


CRITICAL = 2.0  # a / b of the paper's node


@pytest.mark.parametrize("friction", [0.0, 1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("start", [[0.25, 0.0], [0.0, 0.0]])
@pytest.mark.parametrize("rate", [[0.0, 1.0], [0.7, 1.0]])
@pytest.mark.sweep(6)
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
@pytest.mark.sweep(6)
def test_friction_close_to_the_critical_one(relative, start, rate):
    """The slip piece is nearly vertical; it spans as little of alpha as ``relative``."""
    path = Path(one_node(), start, rate, CRITICAL * (1.0 + relative))
    assert_matches(explore(path.system(), path.interval), path)


@pytest.mark.parametrize("force", [(1.0, -3.0), (0.2, -1.6), (1.0, -1.0), (1.0, 10.0)])
@pytest.mark.parametrize("hi", [20.0, 1e3, 1e6])
@pytest.mark.sweep(6)
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
@pytest.mark.sweep(4)
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
@pytest.mark.sweep(24)
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


# -- large friction ------------------------------------------------------------------------------


def body_of(A, gap=0.0):
    """Return a body whose nodes have two displacements each, normal and tangential."""
    A = np.array(A, dtype=float)
    picks = np.eye(len(A))
    return Body(A, picks[::2], picks[1::2], np.full(len(A) // 2, gap))


EQUAL_NODES = [[14, 9, -6, 4], [9, 15, -4, 2], [-6, -4, 14, -9], [4, 2, -9, 15]]
THREE_NODES = [
    [4, 2, -3, 2, 2, 3],
    [2, 22, -4, -3, -6, 1],
    [-3, -4, 11, -1, 1, 2],
    [2, -3, -1, 12, -2, 2],
    [2, -6, 1, -2, 11, 3],
    [3, 1, 2, 2, 3, 15],
]
#: Body, f0 and f1. The normal load vanishes at an end, inside, together with all load, and of one
#: node of two; in each, F lam_nu is far larger than the typical force times rounding.
LARGE_FRICTION = {
    "equal nodes": (EQUAL_NODES, [-3, -1, -3, 1], [-1, 2, -1, -2]),
    "only a tangential load": ([[7, 1], [1, 4]], [0, -3], [0, 3]),
    "no normal load inside": ([[7, 1], [1, 4]], [1, -3], [-2, 1]),
    "no normal load at the end": ([[5, -2], [-2, 3]], [3, 1], [1, 2]),
    "two nodes": (EQUAL_NODES, [-3, -1, 2, 1], [-1, 2, 1, 1]),
    "three nodes": (THREE_NODES, [-1, -1, 0, 3, -2, -1], [2, -1, 1, -1, 1, -2]),
}
MANY = [(F, name) for F in (2e7, 2.0**40) for name in LARGE_FRICTION]


def slippery(name, friction, unit=1.0):
    A, f0, f1 = LARGE_FRICTION[name]
    loads = unit * np.array(f0, dtype=float), unit * np.array(f1, dtype=float)
    return Path(body_of(unit * np.array(A)), *loads, friction, (-3.0, 3.0))


@pytest.mark.parametrize(("friction", "name"), MANY)
def test_large_friction(friction, name):
    path = slippery(name, friction)
    graph = explore(path.system(), path.interval)
    assert_matches(graph, path, 1e-12)  # a fold may lie 5e-12 beside the end of the interval
    assert len(graph.solutions(-2.703125)) == graph.count(-2.703125)


@pytest.mark.parametrize("friction", [1e6, 6.7e7, 1e9, 2.0**36, 1e12])
@pytest.mark.parametrize("name", LARGE_FRICTION)
def test_large_friction_in_another_unit(friction, name):
    path = slippery(name, friction, unit=2.0**-29)
    assert_matches(explore(path.system(), path.interval), path, 1e-12)


@pytest.mark.parametrize("friction", [1e14, 1e15, 1e16, 1e18])
@pytest.mark.parametrize("name", ["equal nodes", "only a tangential load"])
def test_friction_too_large_for_rounding_is_no_complete_graph(friction, name):
    path = slippery(name, friction)
    graph = explore(path.system(), path.interval)
    assert graph.guarantee.startswith(("balanced; the model seems to end", "not balanced: "))
    for lo, hi, count, *_ in graph.multiplicity():
        assert count in (1, 0) or graph.guarantee.startswith("not balanced"), (lo, hi)
