"""The numbers that Janovsky and Ligursky (2012) print, in their units and signs (r = 1)."""

import numpy as np
import pytest
from paper_systems import CASES, ONE_NODE, TWO_NODES, contact_body
from pwscont_coulomb import AffineLoad, CoulombFriction, CoulombLoad

from pwscont import explore, trace

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

HALF_DIGIT = 5.001e-5  # four digits are printed
ALPHA_44 = -0.62514  # printed as -0.6251; this one rounds to all printed digits
NEGATIVE = -1
SLIP, FREE = "slip-", "no contact"


@pytest.fixture(scope="module")
def fig7():
    load = AffineLoad([0.25, 0.0], [0.0, 1.0])
    system = CoulombLoad(contact_body(ONE_NODE), load, 4.0, r=1.0)
    graph = explore(system, (-2.0, 2.0))
    assert len(graph.components()) == 1
    return graph


def solution(graph, alpha, label):
    (found,) = [s for s in graph.solutions(alpha) if s.label == label]
    return found


def piece(graph, label):
    (found,) = [p for p in graph.pieces if p.label == label]
    return found


def oriented_tangent(system, z, alpha, character, orientation):
    """Return the unit null vector t of J with sign det[J; t] = orientation (Definition 1)."""
    jacobian = system.jacobian(z, alpha, character)
    t = np.linalg.svd(jacobian)[2][-1]
    return t * orientation * np.sign(np.linalg.det(np.vstack([jacobian, t])))


def chord(piece, orientation):
    difference = orientation * (piece.points[-1] - piece.points[0])
    return difference / np.linalg.norm(difference)


def assert_prints_as(values, printed):
    np.testing.assert_allclose(values, printed, rtol=0, atol=HALF_DIGIT)


def test_point_44(fig7):
    found = solution(fig7, ALPHA_44, SLIP)
    assert_prints_as(found.z, [0.0, -0.1874, -0.0626, 0.2503])
    assert_prints_as(found.alpha, -0.6251)


def test_test_functions_at_point_44(fig7):
    found = solution(fig7, ALPHA_44, SLIP)
    kappa = fig7.system.test_functions(found.z, ALPHA_44)
    assert_prints_as(kappa, [-0.0626, 0.6880, 0.1874])
    assert fig7.system.triples(found.z, ALPHA_44) == [(1, 1, 0)]
    assert "(1, 1, 0)" in fig7.system.describe(found.character)


def test_tangent_on_the_slip_piece(fig7):
    printed = [0.0, -0.2132, 0.2132, -0.8528, 0.4264]
    found = solution(fig7, ALPHA_44, SLIP)
    arguments = (fig7.system, found.z, ALPHA_44, found.character)
    assert_prints_as(oriented_tangent(*arguments, NEGATIVE), printed)
    assert_prints_as(chord(piece(fig7, SLIP), NEGATIVE), printed)


def test_point_55(fig7):
    (point,) = [p for p in fig7.special_points("nonsmooth fold") if abs(p.alpha + 0.5) < 1e-12]
    assert_prints_as(point.z, [0.0, -0.25, 0.0, 0.0])
    assert_prints_as(fig7.system.test_functions(point.z, point.alpha), [0.0, 0.25, 0.25])
    np.testing.assert_allclose(point.z, [0.0, -0.25, 0.0, 0.0], rtol=0, atol=1e-14)


def test_tangent_after_point_55(fig7):
    printed = [-0.2673, -0.5345, 0.0, 0.0, -0.8018]
    free = piece(fig7, FREE)
    arguments = (fig7.system, free.z[-1], -0.5, free.character)
    assert_prints_as(oriented_tangent(*arguments, NEGATIVE), printed)
    assert_prints_as(chord(free, NEGATIVE), printed)


def test_messages_in_negative_orientation(fig7):
    (component,) = fig7.components()
    nodes = fig7.itinerary(component, NEGATIVE)
    assert [round(node.alpha, 12) for node in nodes] == [2.0, 1.0, -1.0, -0.5, -2.0]
    assert [node.passed(NEGATIVE) for node in nodes[1:-1]] == [
        "contact-slip → contact-stick",
        "contact-stick → contact-slip",
        "contact-slip → no contact",
    ]


def test_messages_in_positive_orientation(fig7):
    (component,) = fig7.components()
    nodes = fig7.itinerary(component, 1)
    assert [node.passed(1) for node in nodes[1:-1]] == [
        "no contact → contact-slip",
        "contact-slip → contact-stick",
        "contact-stick → contact-slip",
    ]


def test_three_solutions_between_the_folds(fig7):
    table = [(round(lo, 12), round(hi, 12), count) for lo, hi, count in fig7.multiplicity()]
    assert table == [(-2.0, -1.0, 1), (-1.0, -0.5, 3), (-0.5, 2.0, 1)]


# -- section 3.2 --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "start", "label"),
    [
        ("fig13", (0.0, -0.5, -0.5, 2.0), "slip-"),
        ("fig13", (-1 / 3, -5 / 3, 0.0, 0.0), "no contact"),
        ("fig14", (-0.4, -1.0, 0.0, 0.0), "no contact"),
        ("fig15", (0.0, 0.0, -1.0, 1.0), "stick"),
        ("fig16", (0.0, 1.0, -2.0, -8.0), "slip+"),
    ],
)
def test_printed_initial_conditions_are_solutions(name, start, label):
    """The paper's initial conditions at F = 4; Figure 16's belongs to f = (1, 10)."""
    case = CASES[name]
    found = solution(trace(case.system, (start, 4.0), case.interval), 4.0, label)
    np.testing.assert_allclose(found.z, start, rtol=0, atol=1e-12)


def test_second_branch_of_fig14_from_its_transition_point():
    """The paper finds this branch by starting on the transition itself."""
    case = CASES["fig14"]
    graph = trace(case.system, ((0.0, 0.0, -0.2, 1.6), 8.0), case.interval)
    assert sorted(p.label for p in graph.pieces) == ["slip-", "stick"]
    (fold,) = [p for p in graph.special_points() if abs(p.alpha - 8.0) < 1e-9]
    np.testing.assert_allclose(fold.z, [0.0, 0.0, -0.2, 1.6], rtol=0, atol=1e-12)
    assert {fold.message, fold.backward} == {
        "contact-slip → contact-stick",
        "contact-stick → contact-slip",
    }
    assert graph.multiplicity()[-1][2] == 2


# -- section 4, Example 3 -----------------------------------------------------------------------

EXAMPLE3 = [
    ((-1.1, -1.5, -0.5, -1.0, 0, 0, 0, 0), ((0, 1, 0), (0, 1, 0)), ("free", "free")),
    ((-0.6, -1.0, 0, -0.25, 0, -0.25, 0, 1.0), ((0, 1, 0), (1, 1, 0)), ("free", "slip-")),
    ((-0.6, -1.0, 0, 0, 0, -0.5, 0, 1.5), ((0, 1, 0), (1, 1, 1)), ("free", "stick")),
    ((0, -0.1, 0, 0, -0.3, -1.4, 1.2, 1.5), ((1, 1, 0), (1, 1, 1)), ("slip-", "stick")),
    ((0, 0, 0, 0, -0.4, -1.5, 1.4, 1.5), ((1, 1, 1), (1, 1, 1)), ("stick", "stick")),
]


@pytest.fixture(scope="module")
def example3():
    system = CoulombFriction(contact_body(TWO_NODES), [0.4, -1.4, 1.5, -1.5], r=1.0)
    return explore(system, (0.001, 15.0))


def nearest(graph, z):
    return min(graph.solutions(4.0), key=lambda found: np.abs(found.z - z).max())


def test_example3_has_three_branches_and_five_solutions(example3):
    assert len(example3.components()) == 3
    assert example3.count(4.0) == len(example3.solutions(4.0)) == 5


@pytest.mark.parametrize(("z", "triples", "words"), EXAMPLE3, ids=range(1, 6))
def test_example3_solutions(example3, z, triples, words):
    found = nearest(example3, z)
    np.testing.assert_allclose(found.z, z, rtol=0, atol=1e-12)
    label = ", ".join(f"node {i} {word}" for i, word in enumerate(words, start=1))
    assert found.label == label.replace("free", "no contact")


@pytest.mark.parametrize(("z", "triples", "words"), EXAMPLE3, ids=range(1, 6))
def test_example3_characters(example3, z, triples, words):
    found = nearest(example3, z)
    assert tuple(example3.system.triples(found.z, 4.0)) == triples


@pytest.mark.parametrize(("a", "b"), [(1, 1), (2, 3), (4, 5)])
def test_example3_branches_hold_the_printed_roots(example3, a, b):
    """Roots 2 and 3 lie on one branch, 4 and 5 on one, 1 on its own."""
    component = {p.id: c for c, pieces in enumerate(example3.components()) for p in pieces}
    branch = [component[nearest(example3, row[0]).piece] for row in EXAMPLE3]
    together = [i + 1 for i in range(5) if branch[i] == branch[a - 1]]
    assert together == sorted({a, b})
