"""The mathematical facts that the method rests on, on random bodies with one to three nodes.

F1, continuity and F2 hold at every point of an interface, solution or not, so they are tested at
random points; F3 and F4 hold for whole graphs, compared with an independent enumeration.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pwscont_coulomb import AffineLoad, CoulombFriction, CoulombLoad
from random_bodies import (
    contact_body,
    load_with_several_solutions,
    random_body,
    random_vector,
)
from reference_enumeration import (
    det_sign,
    enumerate_solutions,
    exact_pieces,
    modes_of,
)

from pwscont import ExactLinear, PseudoArclength, explore

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

SEEDS = st.integers(0, 10**6)
NODES = st.integers(1, 3)
FRICTIONS = st.sampled_from([0.3, 1.0, 4.0, 10.0])
INTERVAL = (-2.0, 2.0)


def prop(examples):
    return settings(max_examples=examples, derandomize=True, deadline=None)


def load_system(p, seed, friction, gap=False):
    body = random_body(p, seed, gap=gap)
    f0 = load_with_several_solutions(body, friction, seed)
    f1 = random_vector(body.n, seed + 1)
    return body, CoulombLoad(contact_body(body), AffineLoad(f0, f1), friction)


def friction_system(p, seed, gap=False):
    body = random_body(p, seed, gap=gap)
    force = load_with_several_solutions(body, 6.0, seed)
    return body, CoulombFriction(contact_body(body), force)


# -- F1, F2 and continuity at random points of every interface ----------------------------------


def system_of(kind, p, seed):
    if kind == "load":
        return load_system(p, seed, 0.5 + seed % 4, gap=True)[1]
    return friction_system(p, seed, gap=True)[1]


def point_on_interface(system, seed, test):
    """Return random (z, alpha) with kappa_test = 0; the tests are affine in z."""
    rng = np.random.default_rng([seed, test])
    z, alpha = 3.0 * rng.normal(size=system.size), float(rng.uniform(0.2, 5.0))
    row = system.test_jacobian(z, alpha)[test, :-1]
    for _ in range(2):  # the second time removes the rounding of the first
        z = z - system.test_functions(z, alpha)[test] / (row @ row) * row
    return z, alpha


def both_sides(system, z, alpha, test):
    """Return the characters on both sides of an interface that bounds both cells, or None."""
    tests = system.test_functions(z, alpha)
    others = np.delete(np.abs(tests), test)
    assume(others.min() > 1e-6)
    here = system.character(z, alpha)
    sides = here.with_sign(test, True), here.with_sign(test, False)
    bounds = [test in system.bounding_tests(side) for side in sides]
    return sides if all(bounds) else None


KINDS = pytest.mark.parametrize("kind", ["load", "friction"])


@KINDS
@prop(20)
@given(p=NODES, seed=SEEDS)
def test_f1_jacobians_differ_by_rank_one_along_the_gradient(kind, p, seed):
    system, crossed = system_of(kind, p, seed), 0
    for test in range(3 * p):
        z, alpha = point_on_interface(system, seed, test)
        sides = both_sides(system, z, alpha, test)
        if sides is None:
            continue
        crossed += 1
        first, second = (system.jacobian(z, alpha, side) for side in sides)
        jump, g = second - first, system.test_jacobian(z, alpha)[test]
        c = jump @ g / (g @ g)
        scale = np.abs(first).max()
        assert np.abs(c).max() > 1e-8 * scale  # there is a jump to speak of
        np.testing.assert_allclose(jump, np.outer(c, g), rtol=0, atol=1e-11 * scale)
    assume(crossed)


@KINDS
@prop(20)
@given(p=NODES, seed=SEEDS)
def test_f2_bordered_determinants_agree(kind, p, seed):
    system, crossed = system_of(kind, p, seed), 0
    for test in range(3 * p):
        z, alpha = point_on_interface(system, seed, test)
        sides = both_sides(system, z, alpha, test)
        if sides is None:
            continue
        g = system.test_jacobian(z, alpha)[test]
        M = [np.vstack([system.jacobian(z, alpha, side), g]) for side in sides]
        if np.linalg.cond(M[0]) > 1e9:
            continue  # no crossing: F does not move what neither sticks nor slips
        crossed += 1
        dets = [np.linalg.slogdet(m) for m in M]
        assert dets[0].sign == dets[1].sign
        assert dets[0].logabsdet == pytest.approx(dets[1].logabsdet, abs=1e-6)
    assume(crossed)


@KINDS
@prop(20)
@given(p=NODES, seed=SEEDS)
def test_residual_is_continuous_across_every_interface(kind, p, seed):
    """Also where the test bounds neither cell: then both characters name one selection."""
    system = system_of(kind, p, seed)
    for test in range(3 * p):
        z, alpha = point_on_interface(system, seed, test)
        here = system.character(z, alpha)
        first, second = (system.residual(z, alpha, here.with_sign(test, s)) for s in (True, False))
        scale = 1.0 + np.abs(first).max()
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-11 * scale)


@KINDS
@prop(10)
@given(p=st.integers(1, 2), seed=SEEDS)
def test_bounding_tests_alone_name_the_selection(kind, p, seed):
    """Two points that agree on the tests that bound the cell of one have one selection."""
    system = system_of(kind, p, seed)
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, system.size))
    characters = [system.character(z, 1.5) for z in points]
    pairs = [(a, b) for a in characters for b in characters if a != b]
    agreeing = [(a, b) for a, b in pairs if agree(a, b, system.bounding_tests(a))]
    assert agreeing
    for a, b in agreeing:
        assert system.cell(a) == system.cell(b)
        jacobians = [system.jacobian(points[0], 1.5, character) for character in (a, b)]
        np.testing.assert_array_equal(*jacobians)


def agree(a, b, tests):
    return all(a.signs[i] == b.signs[i] for i in tests)


@KINDS
@prop(15)
@given(p=NODES, seed=SEEDS)
def test_jacobians_are_the_derivatives(kind, p, seed):
    system = system_of(kind, p, seed)
    rng = np.random.default_rng(seed)
    x, h = np.append(rng.normal(size=system.size), 1.5), 1e-4
    character = system.character(x[:-1], x[-1])
    steps = h * np.eye(len(x))

    def slope(function):
        # all are at most quadratic in x: central differences are exact but for rounding
        columns = [(function(x + s) - function(x - s)) / (2.0 * h) for s in steps]
        return np.stack(columns, axis=1)

    residual = slope(lambda x: system.residual(x[:-1], x[-1], character))
    np.testing.assert_allclose(
        system.jacobian(x[:-1], x[-1], character), residual, rtol=1e-8, atol=1e-8
    )
    tests = slope(lambda x: system.test_functions(x[:-1], x[-1]))
    np.testing.assert_allclose(system.test_jacobian(x[:-1], x[-1]), tests, rtol=1e-8, atol=1e-8)


@prop(20)
@given(p=NODES, seed=SEEDS, friction=FRICTIONS)
def test_enumerated_solutions_have_zero_residual(p, seed, friction):
    """The selections solve the Coulomb problem, not another one."""
    body, system = load_system(p, seed, friction, gap=True)
    for found in enumerate_solutions(body, system.load_at(0.7), friction):
        character = system.character(found.z, 0.7)
        assume(found.margin > 1e-8)
        assert modes_of(system.label(character)) == found.modes
        residual = system.residual(found.z, 0.7, character)
        np.testing.assert_allclose(residual, 0.0, rtol=0, atol=1e-9 * np.abs(found.z).max())


# -- F3 and F4 on whole graphs -------------------------------------------------------------------


def regular_alphas(graph, seed, count=5):
    lo, hi = graph.interval
    tried = np.random.default_rng(seed).uniform(lo, hi, count)
    nodes = np.array([point.alpha for point in graph.special_points()])
    return [float(a) for a in tried if np.abs(nodes - a).min(initial=1.0) > 1e-5 * (hi - lo)]


def assert_direction_is_determinant(graph, body, friction_at):
    for piece in graph.pieces:
        rise = np.sign(piece.alpha[-1] - piece.alpha[0])
        middle = 0.5 * sum(piece.interval)
        expected = det_sign(body, friction_at(middle), modes_of(piece.label))
        assert rise == piece.det_sign == expected
        assert (np.sign(np.diff(piece.alpha)) == rise).all()


def assert_balances_and_agrees(graph, alpha, expected):
    """Every solution is a true one; what is missing, on a loop, sums to zero."""
    if min(found.margin for found in expected) < 1e-7:
        return
    missing = {found.modes: found for found in expected}
    assert graph.balance(alpha) == sum(found.det_sign for found in expected) == 1
    for solution in graph.solutions(alpha):
        match = missing.pop(modes_of(solution.label))
        np.testing.assert_allclose(solution.z, match.z, rtol=1e-8, atol=1e-8)
        assert solution.det_sign == match.det_sign
    assert sum(found.det_sign for found in missing.values()) == 0


@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arc"])
@prop(15)
@given(p=NODES, seed=SEEDS, friction=FRICTIONS, gap=st.booleans())
def test_f3_f4_load_path(stepper, p, seed, friction, gap):
    body, system = load_system(p, seed, friction, gap)
    graph = explore(system, INTERVAL, stepper=stepper)
    assert_direction_is_determinant(graph, body, lambda alpha: friction)
    for alpha in regular_alphas(graph, seed):
        expected = enumerate_solutions(body, system.load_at(alpha), friction)
        assert_balances_and_agrees(graph, alpha, expected)
    assert graph.balances() == [1] * len(graph.balances())


def check_friction(p, seed, gap):
    body, system = friction_system(p, seed, gap)
    graph = explore(system, (0.0, 12.0))
    assert_direction_is_determinant(graph, body, lambda alpha: alpha)
    for alpha in regular_alphas(graph, seed):
        expected = enumerate_solutions(body, system.force, alpha)
        assert_balances_and_agrees(graph, alpha, expected)


@prop(5)
@given(p=NODES, seed=SEEDS, gap=st.booleans())
def test_f3_f4_friction_of_a_few(p, seed, gap):
    check_friction(p, seed, gap)


@pytest.mark.slow
@prop(20)
@given(p=NODES, seed=SEEDS, gap=st.booleans())
def test_f3_f4_friction(p, seed, gap):
    check_friction(p, seed, gap)


def check_curved_load_path(p, seed):
    body = random_body(p, seed)
    f0 = load_with_several_solutions(body, 4.0, seed)
    f1, f2 = (random_vector(body.n, seed + i) for i in (1, 2))

    def load(alpha):
        return f0 + np.cos(alpha) * f1 + np.sin(2.0 * alpha) * f2

    system = CoulombLoad(contact_body(body), load, 4.0)
    graph = explore(system, (0.0, 6.0))
    assert_direction_is_determinant(graph, body, lambda alpha: 4.0)
    for alpha in regular_alphas(graph, seed):
        assert_balances_and_agrees(graph, alpha, enumerate_solutions(body, load(alpha), 4.0))


@pytest.mark.slow
@prop(4)
@given(p=NODES, seed=SEEDS)
def test_f3_f4_curved_load_path_of_a_few(p, seed):
    check_curved_load_path(p, seed)


@pytest.mark.slow
@prop(8)
@given(p=NODES, seed=SEEDS)
def test_f3_f4_curved_load_path(p, seed):
    check_curved_load_path(p, seed)


def check_pieces_against_rational_arithmetic(p, seed, friction):
    """Every piece, with its ends, against an enumeration without rounding."""
    body, system = load_system(p, seed, friction)
    graph = explore(system, INTERVAL)
    exact = exact_pieces(body, system.load.f0, system.load.f1, friction, INTERVAL)
    rest = {(piece.modes, piece.det_sign): piece for piece in exact}
    assert len(rest) == len(exact)  # an affine mode has one interval
    for piece in graph.pieces:
        match = rest.pop((modes_of(piece.label), piece.det_sign))
        ends = float(match.lo), float(match.hi)
        np.testing.assert_allclose(piece.interval, ends, rtol=1e-11, atol=1e-11)
    assert all(INTERVAL[0] < piece.lo < piece.hi < INTERVAL[1] for piece in rest.values())
    assert is_union_of_loops(list(rest.values()))


@pytest.mark.slow
@prop(8)
@given(p=NODES, seed=SEEDS, friction=FRICTIONS)
def test_pieces_of_a_few_bodies_against_rational_arithmetic(p, seed, friction):
    check_pieces_against_rational_arithmetic(p, seed, friction)


@pytest.mark.slow
@prop(20)
@given(p=NODES, seed=SEEDS, friction=FRICTIONS)
def test_pieces_of_random_bodies_against_rational_arithmetic(p, seed, friction):
    check_pieces_against_rational_arithmetic(p, seed, friction)


def is_union_of_loops(pieces):
    """Tell whether every end of these pieces is the end of exactly one other."""
    ends = sorted(end for piece in pieces for end in (piece.lo, piece.hi))
    return all(a == b for a, b in zip(ends[::2], ends[1::2], strict=True))


@pytest.mark.slow
@prop(15)
@given(p=NODES, seed=SEEDS)
def test_every_component_ends_on_the_interval(p, seed):
    """F5: what is not a loop has two ends, both at an end of the interval."""
    _, system = load_system(p, seed, 4.0)
    graph = explore(system, INTERVAL)
    for component in graph.components():
        nodes = graph.itinerary(component)
        assert {abs(nodes[0].alpha), abs(nodes[-1].alpha)} == {2.0}
        assert all(abs(node.alpha) < 2.0 for node in nodes[1:-1])
