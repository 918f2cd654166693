"""Points where several test functions vanish: every way on, and nothing else.

Unloaded and symmetric bodies are full of them. Truth is brute force at single loads, the product
of the solutions of uncoupled nodes, or a closed form.
"""

from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from paper_systems import CASES, ONE_NODE
from pwscont_coulomb import AffineLoad, CoulombLoad
from random_bodies import contact_body, load_with_several_solutions, random_body, random_vector
from reference_enumeration import Body, enumerate_solutions, modes_of
from sweeps import swept

from pwscont import (
    AllTransitions,
    Character,
    EndPoints,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    Slices,
    explore,
    trace,
)

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

STEPPERS = pytest.mark.parametrize("stepper", [None, PseudoArclength()], ids=["exact", "arc"])


def affine(body, f0, f1, friction):
    return CoulombLoad(contact_body(body), AffineLoad(f0, f1), friction)


def assert_agrees(graph, alpha, body, load, friction):
    """Solutions at a regular alpha are those of brute force: number, modes, signs and z."""
    expected = {one.modes: one for one in enumerate_solutions(body, load, friction, 1e-15)}
    found = {modes_of(solution.label): solution for solution in graph.solutions(alpha)}
    assert graph.count(alpha) == len(found) == len(expected)
    assert found.keys() == expected.keys()
    for modes, one in expected.items():
        size = 1e-9 * np.abs(one.z).max() + 1e-14
        np.testing.assert_allclose(found[modes].z, one.z, rtol=1e-9, atol=size)
        assert found[modes].det_sign == one.det_sign
    assert graph.balance(alpha) == 1


def gaps(graph, narrowest=0.0):
    """Return the middle of each interval between neighbouring special points."""
    alphas = sorted({*graph.interval, *(point.alpha for point in graph.special_points())})
    return [0.5 * (a + b) for a, b in pairwise(alphas) if b - a > narrowest]


def assert_agrees_everywhere(graph, body, load, friction, narrowest=1e-12):
    """One alpha in every gap between special points, however narrow."""
    for alpha in gaps(graph, narrowest):
        assert_agrees(graph, alpha, body, load(alpha), friction)
    assert graph.is_balanced()


def pieces_of(graph):
    """Return what does not depend on where tracing began."""
    rows = [
        (*np.round(np.sort(piece.interval), 10), piece.label, piece.det_sign)
        for piece in graph.pieces
    ]
    return sorted(rows)


# -- the unloaded body ---------------------------------------------------------------------------

UNLOADED = [
    (p, seed, friction)
    for p, seeds in ((1, 10), (2, 6), (3, 3))
    for seed in range(seeds)
    for friction in (0.3, 1.0, 3.0, 8.0)
]


@cache
def unloaded(p, seed, friction):
    """Return a body and a direction, with several solutions where there is one such in ten."""
    body = random_body(p, seed)
    return body, load_with_several_solutions(body, friction, seed, tries=8)


@cache
def both_directions(p, seed, friction):
    """Return the solutions at alpha = 1 and at alpha = -1."""
    body, f1 = unloaded(p, seed, friction)
    return [enumerate_solutions(body, sign * f1, friction) for sign in (1.0, -1.0)]


def test_directions_with_several_solutions_are_among_them():
    counts = [len(expected) for case in UNLOADED for expected in both_directions(*case)]
    assert sum(count > 1 for count in counts) > 10
    assert max(counts) >= 3


@pytest.mark.parametrize("start", swept(["apex"], ["everywhere", "one side"]))
def test_unloaded_body(start):
    """The problem is homogeneous: the rays at f = 0 are the solutions at alpha = 1 and -1."""
    for p, seed, friction in UNLOADED:
        body, f1 = unloaded(p, seed, friction)
        forth, back = both_directions(p, seed, friction)
        system = affine(body, 0.0 * f1, f1, friction)
        graph = {
            "everywhere": lambda s, z: explore(s, (-2.0, 3.0)),
            "apex": lambda s, z: trace(s, (np.zeros(s.size), 0.0), (-2.0, 3.0)),
            "one side": lambda s, z: trace(s, (z, 1.0), (-2.0, 3.0)),
        }[start](system, forth[-1].z)
        assert len(graph.pieces) == len(forth) + len(back)
        apex = graph.special_points()
        (apex,) = [point for point in apex if point.kind not in ("start", "end")]
        assert abs(apex.alpha) < 1e-14
        assert graph.nx.degree(apex.id) == len(graph.pieces)
        if len(graph.pieces) > 2:
            assert apex.kind == "nonsmooth branch point"
        assert graph.count(0.0) == 1
        for alpha in (-2.0, -1e-6, 1e-6, 1.0):
            assert_agrees(graph, alpha, body, alpha * f1, friction)


@pytest.mark.slow
def test_unloaded_body_with_many_nodes():
    """21 tests vanish at the apex, in whose closure lie 4^7 cells: all of them are tried."""
    body = random_body(7, 3, inner=0)
    f1 = random_vector(body.n, 3)
    graph = explore(affine(body, 0.0 * f1, f1, 8.0), (-1.0, 1.0))
    assert graph.guarantee == "complete"
    for alpha in (-1.0, 1.0):
        assert_agrees(graph, alpha, body, alpha * f1, 8.0)


def test_unloaded_body_step_by_step():
    for p, seed, friction in UNLOADED[::5]:
        body, f1 = unloaded(p, seed, friction)
        system = affine(body, 0.0 * f1, f1, friction)
        graph = explore(system, (-2.0, 3.0), stepper=PseudoArclength())
        for alpha in (-1.0, -1e-6, 1e-6, 3.0):
            assert_agrees(graph, alpha, body, alpha * f1, friction)


@pytest.mark.parametrize("start", ["everywhere", "apex", "loaded"])
def test_unloaded_body_at_the_end_of_the_interval(start):
    """Load paths begin at f = 0, where all branches meet: they are one component."""
    for p, seed, friction in UNLOADED[::3]:
        body, f1 = unloaded(p, seed, friction)
        forth, _ = both_directions(p, seed, friction)
        system = affine(body, 0.0 * f1, f1, friction)
        graph = {
            "everywhere": lambda s, z: explore(s, (0.0, 2.0)),
            "apex": lambda s, z: trace(s, (np.zeros(s.size), 0.0), (0.0, 2.0)),
            "loaded": lambda s, z: trace(s, (z, 1.0), (0.0, 2.0)),
        }[start](system, forth[-1].z)
        assert graph.count(0.0) == 1
        assert len(graph.components()) == 1
        assert_agrees(graph, 1.0, body, f1, friction)


# -- through the apex of the cones, and close by -------------------------------------------------

PASSING = [(p, seed, (0.3, 1.0, 3.0, 8.0)[seed % 4]) for p in (1, 2, 3) for seed in range(6)]


def test_through_the_apex():
    for p, seed, friction in PASSING:
        body, f1 = unloaded(p, seed, friction)
        system = affine(body, -0.7 * f1, f1, friction)
        graph = explore(system, (-2.0, 3.0))
        for alpha in (-2.0, 0.7 - 1e-6, 0.7 + 1e-6, 3.0):
            assert_agrees(graph, alpha, body, (alpha - 0.7) * f1, friction)
        assert graph.count(0.7) == 1


@pytest.mark.parametrize("distance", swept([], [1e-3, 1e-6, 1e-9]))
def test_past_the_apex(distance):
    """The corner dissolves into transitions that far apart, and all of them are found."""
    for p, seed, friction in PASSING:
        body, f1 = unloaded(p, seed, friction)
        f0 = -0.7 * f1 + distance * random_vector(body.n, seed + 5)
        graph = explore(affine(body, f0, f1, friction), (-2.0, 3.0))
        assert_agrees_everywhere(graph, body, lambda a, f0=f0, f1=f1: f0 + a * f1, friction)
        assert graph.guarantee == "complete"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(3)
def test_past_the_apex_within_rounding(seed):
    """Which tests count as zero is a matter of rounding here; it must not lose a branch.

    The misses are so small that the nodes may be one or several, but away from the apex the
    number of solutions is that of brute force.
    """
    rng = np.random.default_rng(seed)
    for _ in range(12):
        friction, number = rng.choice([1.0, 3.0, 8.0]), int(rng.integers(100))
        body = random_body(1 + seed % 2, number)
        f1 = load_with_several_solutions(body, friction, number, tries=10)
        miss = 10.0 ** rng.uniform(-16.0, -12.0) * random_vector(body.n, number + 5)
        graph = explore(affine(body, miss - 0.7 * f1, f1, friction), (-2.0, 3.0))
        for alpha in (-1.0, 0.69, 0.71, 2.0):
            assert_agrees(graph, alpha, body, (alpha - 0.7) * f1 + miss, friction)


@pytest.mark.parametrize(
    ("seed", "friction", "side", "distance"),
    [
        (53, 8.0, -1.0, 5.2764014772302914e-14),
        (72, 1.0, 1.0, 3.565735781486537e-13),
        (73, 8.0, 1.0, 2.1195200386494907e-13),
        (74, 8.0, -1.0, 2.4254737431773238e-14),
        (74, 8.0, -1.0, 1.5280431793761622e-14),
    ],
)
def test_past_the_apex_where_a_test_bounds_one_side_only(seed, friction, side, distance):
    """Signs read off so close to the apex name a cell that the crossed test does not bound."""
    body = random_body(2, seed)
    f1 = side * random_vector(body.n, seed)
    miss = distance * random_vector(body.n, seed + 5)
    graph = explore(affine(body, -0.7 * f1 + miss, f1, friction), (-2.0, 3.0))
    for alpha in (-1.0, 0.69, 0.71, 2.0):
        assert_agrees(graph, alpha, body, (alpha - 0.7) * f1 + miss, friction)


# -- along the boundary between two modes --------------------------------------------------------


class Polygon(PiecewiseLinearSystem):
    """Coulomb friction under a load path of straight parts, whose kinks are test functions."""

    degree = 1

    def __init__(self, body, alphas, loads, friction):
        self.kinks = np.array(alphas[1:-1])
        self.parts = []
        for (a, b), (f, g) in zip(pairwise(alphas), pairwise(loads), strict=True):
            rate = (g - f) / (b - a)
            self.parts.append(affine(body, f - a * rate, rate, friction))
        self.size = self.parts[0].size

    def part(self, character):
        return self.parts[sum(character.signs[: len(self.kinks)])]

    def inner(self, character):
        return Character(character.signs[len(self.kinks) :])

    def test_functions(self, z, alpha):
        return np.append(alpha - self.kinks, self.parts[0].test_functions(z, alpha))

    def residual(self, z, alpha, character):
        return self.part(character).residual(z, alpha, self.inner(character))

    def bounding_tests(self, character):
        k = len(self.kinks)
        bounding = np.asarray(self.parts[0].bounding_tests(self.inner(character)))
        return [*range(k), *(k + bounding)]

    def label(self, character):
        return self.parts[0].label(self.inner(character))

    def describe(self, character):
        return f"part {sum(character.signs[: len(self.kinks)])}, {self.label(character)}"

    def cells(self):
        k = len(self.kinks)
        for character in self.parts[0].cells():
            for part in range(k + 1):
                yield Character((*(i < part for i in range(k)), *character.signs))


def boundary(friction, side):
    """Return a load on the boundary of stick to slip+ (side 1) or slip- (side -1): u = 0."""
    return 0.25 * np.array([1.0, side * friction])


def riding_path(friction, side, before, after):
    """Return the loads of a path that reaches the boundary at 1, follows it, leaves it at 2."""
    on, off = boundary(friction, side), np.array([0.0, 0.3])
    return [on + before * off, 1.3 * on, 1.6 * on, 1.9 * on + after * off]


def distinct(body, load, friction):
    """Return the solutions of brute force, those on a common boundary once."""
    found = []
    for one in enumerate_solutions(body, load, friction, 1e-12):
        if not any(np.abs(one.z - other).max() < 1e-9 for other in found):
            found.append(one.z)
    return sorted(z.tolist() for z in found)


def assert_states(graph, alpha, expected):
    assert graph.count(alpha) == len(expected)
    found = sorted(np.round(solution.z, 9).tolist() for solution in graph.solutions(alpha))
    expected = sorted(np.round(z, 9).tolist() for z in expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-9)


SIDES = (1, -1)
RIDES = [
    pytest.param(friction, *signs, id=f"F={friction}{signs}")
    for friction in (1.0, 4.0)
    for signs in product(SIDES, SIDES, SIDES)
]
SEARCHES = [
    None,
    EndPoints() + Slices((1.5,)),
    Slices((1.0, 1.5, 2.0)),
    EndPoints() + Slices((1.2, 1.5)) + AllTransitions(),
]
ALPHAS = (0.0, 0.5, 0.999, 1.0, 1.001, 1.5, 1.999, 2.0, 2.001, 2.5, 3.0)


def polygon(friction, side, before, after):
    loads = riding_path(friction, side, before, after)
    system = Polygon(ONE_NODE, [0.0, 1.0, 2.0, 3.0], loads, friction)
    columns = np.transpose(loads)

    def load(alpha):
        return np.array([np.interp(alpha, [0.0, 1.0, 2.0, 3.0], column) for column in columns])

    return system, load


@pytest.mark.parametrize("stepper", [None, PseudoArclength()], ids=["exact", "arc"])
@pytest.mark.parametrize(("friction", "side", "before", "after"), RIDES)
@pytest.mark.sweep(5)
def test_onto_a_boundary_along_it_and_off_it(stepper, friction, side, before, after):
    system, load = polygon(friction, side, before, after)
    graph = explore(system, (0.0, 3.0), stepper=stepper)
    for alpha in ALPHAS:
        assert_states(graph, alpha, distinct(ONE_NODE, load(alpha), friction))


@pytest.mark.parametrize("search", SEARCHES[1:], ids=["ends", "slices", "all"])
@pytest.mark.parametrize("friction", [1.0, 4.0])
@pytest.mark.sweep(4)
def test_a_piece_along_a_boundary_is_drawn_once(search, friction):
    for signs in product(SIDES, SIDES, SIDES):
        system, load = polygon(friction, *signs)
        graph = explore(system, (0.0, 3.0), search=search)
        for alpha in (1.001, 1.3, 1.5, 1.999):
            assert_states(graph, alpha, distinct(ONE_NODE, load(alpha), friction))


@pytest.mark.parametrize(("friction", "side", "before", "after"), RIDES)
@pytest.mark.sweep(5)
def test_along_a_boundary_nothing_is_missing(friction, side, before, after):
    """The sum of signs is +1 on the boundary too: a double solution on a fold counts zero."""
    system, _ = polygon(friction, side, before, after)
    graph = explore(system, (0.0, 3.0))
    assert graph.is_balanced()
    assert graph.guarantee == "complete"


@pytest.mark.parametrize(("friction", "side", "before", "after"), RIDES)
@pytest.mark.sweep(5)
def test_along_a_boundary_is_reported_as_degenerate(friction, side, before, after):
    """Where the path reaches the boundary and leaves it; no selection is blamed for it."""
    system, _ = polygon(friction, side, before, after)
    graph = explore(system, (0.0, 3.0))
    on_boundary = [
        point
        for point in graph.special_points()
        if min(abs(point.alpha - 1.0), abs(point.alpha - 2.0)) < 1e-12
        and np.abs(point.z[:2]).max() < 1e-12
    ]
    assert [point.kind for point in on_boundary] == ["degenerate"] * 2


@STEPPERS
@pytest.mark.parametrize("search", SEARCHES, ids=["default", "ends", "slices", "all"])
@pytest.mark.sweep(3)
def test_on_a_boundary_from_end_to_end(stepper, search):
    for friction, side in product((1.0, 4.0), SIDES):
        on = boundary(friction, side)
        system = affine(ONE_NODE, 0.0 * on, on, friction)
        graph = explore(system, (1.0, 3.0), search=search, stepper=stepper)
        for alpha in (1.1, 1.4, 1.9, 2.5):
            assert_states(graph, alpha, distinct(ONE_NODE, alpha * on, friction))


@STEPPERS
@pytest.mark.parametrize("side", SIDES)
def test_a_start_on_a_boundary_is_within_its_piece(stepper, side):
    """The unloaded end is left out; between 1 and 3 there is one piece from end to end."""
    on = boundary(1.0, side)
    system = affine(ONE_NODE, 0.0 * on, on, 1.0)
    graph = trace(system, ([0.0, 0.0, -0.5, -0.5 * side], 2.0), (1.0, 3.0), stepper=stepper)
    assert sum(np.diff(sorted(piece.interval))[0] for piece in graph.pieces) == pytest.approx(2.0)
    for alpha in (1.0, 1.5, 2.5, 3.0):
        assert_states(graph, alpha, distinct(ONE_NODE, alpha * on, 1.0))


class Callable:
    """The same path as a plain callable: |alpha - 1|^power off the boundary, then along it."""

    def __init__(self, friction, side, before, after, power):
        self.on, self.off = boundary(friction, side), np.array([0.0, 0.3])
        self.before, self.after, self.power = before, after, power

    def __call__(self, alpha):
        away = self.before * max(0.0, 1.0 - alpha) ** self.power
        away += self.after * max(0.0, alpha - 2.0) ** self.power
        return (1.0 + 0.3 * alpha) * self.on + away * self.off


CALLABLES = [
    pytest.param(side, before, after, id=f"{side}{before}{after}")
    for side, before, after in product(SIDES, SIDES, SIDES)
]


@pytest.mark.parametrize(("side", "before", "after"), CALLABLES)
@pytest.mark.parametrize("power", [2, 3])
@pytest.mark.sweep(5)
def test_a_smooth_path_onto_a_boundary_along_it_and_off_it(side, before, after, power):
    load = Callable(1.0, side, before, after, power)
    system = CoulombLoad(contact_body(ONE_NODE), load, 1.0)
    graph = explore(system, (0.0, 3.0), stepper=PseudoArclength())
    for alpha in (0.0, 0.5, 0.9, 1.1, 1.5, 1.9, 2.1, 2.5, 3.0):
        assert_states(graph, alpha, distinct(ONE_NODE, load(alpha), 1.0))


# -- two nodes that change mode together ---------------------------------------------------------


def twins(coupling=0.0):
    """Return two of the paper's one-node bodies side by side."""
    A = np.kron(np.eye(2), ONE_NODE.A)
    A[:2, 2:] = coupling * np.array([[1.0, 0.5], [0.5, -1.0]])
    A[2:, :2] = A[:2, 2:].T
    return Body(A, np.eye(4)[[0, 2]], np.eye(4)[[1, 3]], np.zeros(2))


F0, F1 = np.array([0.25, 0.0, 0.25, 0.0]), np.array([0.0, 1.0, 0.0, 1.0])
TWIN = (-2.0, 2.0)


def twin_load(alpha):
    return F0 + alpha * F1


def product_states(alpha, friction=4.0):
    """Return all pairs of solutions of the single node, as states (u, lam_nu, lam_t)."""
    single = [one.z for one in enumerate_solutions(ONE_NODE, twin_load(alpha)[:2], friction)]
    order = [0, 1, 4, 5, 2, 6, 3, 7]
    return [np.concatenate([a, b])[order] for a, b in product(single, single)]


@STEPPERS
def test_identical_nodes_have_the_product_of_their_solutions(stepper):
    """One, nine, one: at both folds four pieces leave to one side and none to the other."""
    graph = explore(affine(twins(), F0, F1, 4.0), TWIN, stepper=stepper)
    table = graph.multiplicity()
    expected = [(-2.0, -1.0, 1), (-1.0, -0.5, 9), (-0.5, 2.0, 1)]
    np.testing.assert_allclose(table, expected, rtol=0, atol=1e-12)
    for alpha in (-1.7, -1.0 + 1e-6, -0.8, -0.6, -0.5 - 1e-6, 0.3, 1.5):
        assert_states(graph, alpha, product_states(alpha))
        assert_agrees(graph, alpha, twins(), twin_load(alpha), 4.0)
    assert graph.guarantee == "complete"


def test_number_of_solutions_where_identical_nodes_change_together():
    """At a fold each node has two solutions, one of them double: four pairs."""
    graph = explore(affine(twins(), F0, F1, 4.0), TWIN)
    assert [graph.count(alpha) for alpha in (-1.0, -0.5, 1.0)] == [4, 4, 1]
    assert [graph.balance(alpha) for alpha in (-1.0, -0.5, 1.0)] == [1, 1, 1]
    assert len(graph.components()) == 1


def test_pieces_at_a_double_fold():
    graph = explore(affine(twins(), F0, F1, 4.0), TWIN)
    points = [point for point in graph.special_points() if abs(point.alpha + 1.0) < 1e-12]
    assert sorted(graph.nx.degree(point.id) for point in points) == [2, 2, 4]
    (both,) = [point for point in points if graph.nx.degree(point.id) == 4]
    assert both.kind == "nonsmooth branch point"
    np.testing.assert_allclose(both.z[:4], 0.0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(both.z[4:], [-0.25, -0.25, 1.0, 1.0], rtol=0, atol=1e-13)


@pytest.mark.parametrize("coupling", [1e-2, 1e-3, 1e-6, 1e-9])
def test_weakly_coupled_nodes(coupling):
    body = twins(coupling)
    graph = explore(affine(body, F0, F1, 4.0), TWIN)
    assert_agrees_everywhere(graph, body, twin_load, 4.0)
    assert max(count for _, _, count in graph.multiplicity()) == 9
    assert graph.guarantee == "complete"


@pytest.mark.parametrize("shift", [1e-2, 1e-6, 1e-9])
@pytest.mark.parametrize("unknown", [2, 3], ids=["normal", "tangential"])
def test_transitions_almost_together(shift, unknown):
    """The second node is loaded a little differently: all its transitions move by that."""
    f0 = F0 + shift * np.eye(4)[unknown]
    graph = explore(affine(twins(), f0, F1, 4.0), TWIN)
    assert_agrees_everywhere(graph, twins(), lambda alpha: f0 + alpha * F1, 4.0)
    counts = [count for _, _, count in graph.multiplicity()]
    assert counts == [1, 3, 9, 3, 1]
    assert len(graph.pieces) == 11
    assert graph.guarantee == "complete"


@pytest.mark.parametrize("unknown", [2, 3], ids=["normal", "tangential"])
@pytest.mark.sweep(2)
def test_transitions_together_but_for_rounding(unknown):
    """Nodes may be one or two here, but on the long stretches nothing is lost or doubled."""
    for shift in np.geomspace(1e-16, 1e-12, 17):
        f0 = F0 + shift * np.eye(4)[unknown]
        graph = explore(affine(twins(), f0, F1, 4.0), TWIN)
        for alpha in (-1.5, -0.75, 0.5, 1.5):
            assert_agrees(graph, alpha, twins(), f0 + alpha * F1, 4.0)


@pytest.mark.parametrize("start", ["apex", "everywhere"])
def test_unloaded_twins(start):
    f1 = np.array([0.25, -0.75, 0.25, -0.75])
    system = affine(twins(), 0.0 * f1, f1, 4.0)
    graph = {
        "apex": lambda: trace(system, (np.zeros(8), 0.0), TWIN),
        "everywhere": lambda: explore(system, TWIN),
    }[start]()
    counts = [len(enumerate_solutions(ONE_NODE, sign * f1[:2], 4.0)) for sign in (1, -1)]
    assert counts == [3, 1]
    assert [graph.count(alpha) for alpha in (1.0, -1.0)] == [9, 1]
    for alpha in (-1.0, 1e-6, 1.0):
        assert_agrees(graph, alpha, twins(), alpha * f1, 4.0)


# -- starts at special points --------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fig7", "example1", "twins"])
def test_a_start_exactly_at_a_special_point(name):
    """From every node the same graph follows as from the ends."""
    if name == "twins":
        system, interval = affine(twins(), F0, F1, 4.0), TWIN
    else:
        system, interval = CASES[name].system, CASES[name].interval
    graph = explore(system, interval)
    component = {piece.id: c for c, pieces in enumerate(graph.components()) for piece in pieces}
    for point in graph.special_points():
        (index,) = {component[key] for *_, key in graph.nx.edges(point.id, keys=True)}
        expected = [piece.id for piece in graph.components()[index]]
        traced = trace(system, (point.z, point.alpha), interval)
        rows = pieces_of(graph)
        assert len(traced.pieces) == len(expected)
        assert set(pieces_of(traced)) <= set(rows)
        assert traced.nx.number_of_nodes() == len(
            {n for piece in graph.components()[index] for n in (piece.start, piece.end)}
        )


# -- corners of other systems --------------------------------------------------------------------


class Cross(PiecewiseLinearSystem):
    """|z| = |alpha|: four rays."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha])

    def residual(self, z, alpha, character):
        s, t = (1.0 if sign else -1.0 for sign in character.signs)
        return np.array([s * z[0] - t * alpha])


@STEPPERS
@pytest.mark.parametrize("start", [(0.0, 0.0), (1.0, 1.0), (-0.4, 0.4), (0.3, -0.3)])
def test_four_rays(stepper, start):
    graph = trace(Cross(), ([start[0]], start[1]), (-1.0, 1.0), stepper=stepper)
    (corner,) = graph.special_points("nonsmooth branch point")
    assert len(graph.pieces) == graph.nx.degree(corner.id) == 4
    assert corner.alpha == pytest.approx(0.0, abs=1e-14)
    for alpha in (-1.0, -0.3, 1e-9, 0.7):
        assert_states(graph, alpha, [[-abs(alpha)], [abs(alpha)]])
        assert graph.balance(alpha) == 0
    assert graph.count(0.0) == 1


class Quadrant(PiecewiseLinearSystem):
    """max(z, 0) = max(alpha, 0): a ray z = alpha and all of z <= 0, alpha <= 0."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha])

    def residual(self, z, alpha, character):
        above, right = character.signs
        return np.array([(z[0] if above else 0.0) - (alpha if right else 0.0)])


class Wedge(PiecewiseLinearSystem):
    """max(|z| - |alpha|, 0) = max(alpha, 0), wherever the solutions fill a wedge of alpha < 0."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0], z[0] - alpha, z[0] + alpha, alpha])

    def residual(self, z, alpha, character):
        up, above, below, right = character.signs
        if right:  # |z| = 2 alpha
            return np.array([(z[0] if up else -z[0]) - 2.0 * alpha])
        excess = below_line = 0.0
        if above and below and up:
            excess = z[0] + alpha
        if not above and not below and not up:
            below_line = -z[0] + alpha
        return np.array([excess + below_line])


@pytest.mark.parametrize("system", [Quadrant(), Wedge()], ids=["quadrant", "wedge"])
def test_a_face_of_rays_is_reported_as_degenerate(system):
    graph = trace(system, ([0.0], 0.0), (-1.0, 1.0))
    kinds = [point.kind for point in graph.special_points() if abs(point.alpha) < 1e-12]
    assert "degenerate" in kinds
    assert any("dimension 2" in point.message for point in graph.special_points("degenerate"))
    expected = {Quadrant: [[0.5]], Wedge: [[-1.0], [1.0]]}[type(system)]
    assert_states(graph, 0.5, expected)


# -- tangency ------------------------------------------------------------------------------------


class Touch(PiecewiseSystem):
    """z = alpha^2 - d above z = 0 and 2 z = alpha^2 - d below: it touches z = 0 for d = 0."""

    size = 1

    def __init__(self, d):
        self.d = d

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return (z if character.signs[0] else 2.0 * z) - alpha**2 + self.d

    def state(self, alpha):
        value = alpha**2 - self.d
        return [value if value >= 0.0 else 0.5 * value]


class Kiss(PiecewiseSystem):
    """A circle whose right fold touches the interface alpha = 1; beyond it another curve."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([alpha - 1.0])

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0 + (3.0 * (alpha - 1.0) if character.signs[0] else 0.0)


@pytest.mark.parametrize("d", [0.0, 1e-3, -1e-3, 1e-9, -1e-9, 1e-14, -1e-14])
def test_a_curve_tangent_to_an_interface(d):
    system = Touch(d)
    graph = trace(system, (system.state(-0.9), -0.9), (-1.0, 1.0))
    assert [count for _, _, count in graph.multiplicity()] == [1]
    # a touch to rounding may be a node of the graph, or not
    assert len(graph.pieces) in ((1, 2) if d == 0.0 else (3,) if d > 0.0 else (1,))
    for alpha in (-1.0, -0.5, -1e-3, 0.0, 1e-2, 1.0):
        (solution,) = graph.solutions(alpha)
        np.testing.assert_allclose(solution.z, system.state(alpha), rtol=0, atol=1e-9)


def test_a_start_where_a_curve_touches_an_interface():
    graph = trace(Touch(0.0), ([0.0], 0.0), (-1.0, 1.0))
    for alpha in (-0.7, 0.7):
        assert_states(graph, alpha, [[alpha**2]])


@pytest.mark.parametrize("start", [([1.0], 0.0), ([0.0], 1.0), ([0.0], -1.0)])
@pytest.mark.sweep(2)
def test_a_fold_tangent_to_an_interface(start):
    graph = trace(Kiss(), start, (-2.0, 2.0))
    for alpha in (-0.9, 0.0, 0.5, 0.999):
        root = (1.0 - alpha**2) ** 0.5
        assert_states(graph, alpha, [[-root], [root]])
    for alpha in (-1.5, 1.001, 1.5):
        assert graph.count(alpha) == 0
