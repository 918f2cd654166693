"""Corners of two nodes and of other systems, starts at special points, tangency."""

from itertools import product

import numpy as np
import pytest
from corner_parts import STEPPERS, affine, assert_agrees, assert_agrees_everywhere, assert_states
from paper_systems import CASES, ONE_NODE
from reference_enumeration import Body, enumerate_solutions

from pwscont import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    explore,
    trace,
)


def pieces_of(graph):
    """Return what does not depend on where tracing began."""
    rows = [
        (*np.round(np.sort(piece.interval), 10), piece.label, piece.det_sign)
        for piece in graph.pieces
    ]
    return sorted(rows)


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
@pytest.mark.sweep(2)
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
@pytest.mark.sweep(3)
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
