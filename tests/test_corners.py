"""Points where several test functions vanish: every way on, and nothing else.

Unloaded and symmetric bodies are full of them. Truth is brute force at single loads, the product
of the solutions of uncoupled nodes, or a closed form.
"""

from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from corner_parts import (
    STEPPERS,
    affine,
    assert_agrees,
    assert_agrees_everywhere,
    assert_states,
)
from paper_systems import ONE_NODE
from pwscont_coulomb import CoulombLoad
from random_bodies import contact_body, load_with_several_solutions, random_body, random_vector
from reference_enumeration import enumerate_solutions
from sweeps import swept

from pwscont import (
    AllTransitions,
    Character,
    EndPoints,
    PiecewiseLinearSystem,
    PseudoArclength,
    Slices,
    explore,
    trace,
)

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("start", ["everywhere", "apex", "loaded"])
@pytest.mark.sweep(4)
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


@pytest.mark.slow
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
@pytest.mark.sweep(6)
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


@pytest.mark.parametrize("miss", 5.6e-14 * 2.0 ** (np.arange(-7, 4) / 3.0))
@pytest.mark.sweep(6)
def test_transitions_beside_the_apex_are_as_uncertain_as_they_are_apart(miss):
    """One piece ends where some of the tests vanish, another one where the others do: one node."""
    body = random_body(2, 63)
    f1 = load_with_several_solutions(body, 1.0, 63, tries=10)
    aside = miss * random_vector(body.n, 68)
    graph = explore(affine(body, aside - 0.7 * f1, f1, 1.0), (-2.0, 3.0))
    assert graph.guarantee == "complete"
    for alpha in (0.69, 2.0):
        assert_agrees(graph, alpha, body, (alpha - 0.7) * f1 + aside, 1.0)


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
@pytest.mark.sweep(4)
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
@pytest.mark.sweep(30)
def test_onto_a_boundary_along_it_and_off_it(stepper, friction, side, before, after):
    system, load = polygon(friction, side, before, after)
    graph = explore(system, (0.0, 3.0), stepper=stepper)
    for alpha in ALPHAS:
        assert_states(graph, alpha, distinct(ONE_NODE, load(alpha), friction))


@pytest.mark.slow
@pytest.mark.parametrize("search", SEARCHES[1:], ids=["ends", "slices", "all"])
@pytest.mark.parametrize("friction", [1.0, 4.0])
@pytest.mark.sweep(8)
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
@pytest.mark.sweep(6)
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
@pytest.mark.sweep(15)
def test_a_smooth_path_onto_a_boundary_along_it_and_off_it(side, before, after, power):
    load = Callable(1.0, side, before, after, power)
    system = CoulombLoad(contact_body(ONE_NODE), load, 1.0)
    graph = explore(system, (0.0, 3.0), stepper=PseudoArclength())
    for alpha in (0.0, 0.5, 0.9, 1.1, 1.5, 1.9, 2.1, 2.5, 3.0):
        assert_states(graph, alpha, distinct(ONE_NODE, load(alpha), 1.0))
