"""Bodies with rigid motions: masses without any spring, loads that nothing carries, curved loads.

The truth is equilibrium by hand: a mass on the floor sticks while the load lies inside of the cone
of friction, slides at any place where the load lies on the cone, and has no equilibrium elsewhere.
"""

import numpy as np
import pytest
from helpers.reference_enumeration import Body
from helpers.reference_enumeration import enumerate_solutions as all_modes
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad

from pwscont import enumerate_solutions, explore

FLOOR, ALONG = [[0.0, 1.0]], [[1.0, 0.0]]
NOTHING = np.zeros((2, 2))


@pytest.mark.parametrize("force", [1e-9, 3e-5, 1.0, 1e9])
@pytest.mark.parametrize("gap", [0.7, 1e-6, 1e3])
def test_a_mass_without_springs_in_all_units(force, gap):
    """The gap and the load tell how long and how strong typical lengths and forces are."""
    body = ContactBody(NOTHING, FLOOR, ALONG, [gap])
    pressed = CoulombLoad(body, AffineLoad([0.0, 0.0], [0.25 * force, force]), 0.5)
    graph = explore(pressed, (-2.0, 2.0))
    assert [graph.count(alpha) for alpha in (-2.0, -0.3, 0.0, 0.3, 2.0)] == [0, 0, np.inf, 1, 1]
    (found,) = graph.solutions(2.0)
    np.testing.assert_allclose(found.z[:2], [0.0, gap], atol=1e-12 * gap)
    np.testing.assert_allclose(found.z[2:], [-2.0 * force, -0.5 * force], rtol=1e-12)
    graph = explore(CoulombFriction(body, [force, 2.0 * force]), (0.0, 2.0))
    assert [graph.count(F) for F in (0.0, 0.3, 0.5, 0.7, 2.0)] == [0, 0, np.inf, 1, 1]


def test_a_load_that_nothing_carries_has_no_solution():
    """The load turns three masses in a triangle; rounding gave a line of solutions at 5e14."""
    A = np.array(
        [
            [10, 4, -2, 0, -8, -4],
            [4, 2, 0, 0, -4, -2],
            [-2, 0, 3, 0, -1, 0],
            [0, 0, 0, 1, 0, -1],
            [-8, -4, -1, 0, 9, 4],
            [-4, -2, 0, -1, 4, 3],
        ]
    )
    picks = np.eye(6)
    body, load = Body(A, picks[[1]], picks[[0]], np.zeros(1)), np.array([-1, -1, -1, 0, 0, 1])
    near = [each for each in all_modes(body, load, 2.0, 1e-6) if np.abs(each.z).max() < 1e6]
    system = CoulombLoad(
        ContactBody(A, body.N, body.T), AffineLoad(load, [-1, -1, 2, 1, 1, 1]), 2.0
    )
    found = enumerate_solutions(system, 0.0)
    assert (list(found), near, found.is_finite) == ([], [], True)


def test_no_node_pulls_where_friction_is_zero():
    """Without friction a node that sticks by chance was held down by the floor."""
    system = CoulombFriction(ContactBody(np.diag([1.0, 0.0]), FLOOR, ALONG, [0.5]), [0.0, -2.0])
    assert not enumerate_solutions(system, 0.0)
    graph = explore(system, (0.0, 4.0))
    assert [graph.count(F) for F in (0.0, 0.5, 4.0)] == [0, 0, 0]


def test_infinitely_many_solutions_in_the_middle_alone():
    """The mass is pulled off the floor except where the load vanishes: there any height will do."""
    body = ContactBody(np.diag([1.0, 0.0]), FLOOR, ALONG)
    graph = explore(CoulombLoad(body, lambda alpha: np.array([0.0, -(alpha**2)]), 0.5), (-2.0, 2.0))
    assert [graph.count(alpha) for alpha in (-2.0, -0.1, 0.0, 0.1, 2.0)] == [0, 0, np.inf, 0, 0]


def test_a_mass_that_slides_without_end_where_rounding_moves_alpha():
    """On a slope the mass sticks up to alpha = 3 - sqrt(3), where it slides to any place."""
    body = ContactBody(NOTHING, [[1.0, 1.0]], [[1.0, -1.0]])
    system = CoulombLoad(body, lambda alpha: np.array([alpha**2, 2.0 - 2.0 * alpha]), 2.0)
    graph = explore(system, (-2.0, 2.0))
    assert [graph.count(alpha) for alpha in (-2.0, 1.26, 1.27, 2.0)] == [1, 1, 0, 0]
    assert "infinitely many solutions at alpha = 1.2679492" in graph.guarantee


@pytest.mark.slow
def test_a_body_that_floats_freely():
    """Without load any place off the floor is a solution, for every friction."""
    A = [
        [7, 4, -3, 0, -4, -4],
        [4, 7, 0, -3, -4, -4],
        [-3, 0, 6, 0, -3, 0],
        [0, -3, 0, 7, 0, -4],
        [-4, -4, -3, 0, 7, 4],
        [-4, -4, 0, -4, 4, 8],
    ]
    N, T = [[1, 1, 0, 0, 0, 0], [0, 0, -1, 1, 0, 0]], [[1, -1, 0, 0, 0, 0], [0, 0, 1, 1, 0, 0]]
    graph = explore(CoulombFriction(ContactBody(A, N, T, [0.25, 0.5]), np.zeros(6)), (0.0, 4.0))
    assert [graph.count(F) for F in (0.0, 0.5, 4.0)] == [np.inf] * 3


@pytest.mark.parametrize("force", [[2.0, 3.0], [-1.0, 0.3]])
def test_a_mass_that_friction_holds_from_a_pole_on_misses_no_branch(force):
    """The plane that a mass slides along is turned by 45 degrees: no equilibrium below the pole."""
    body = ContactBody(NOTHING, [[1.0, 1.0]], [[1.0, -1.0]], [0.25])
    normal, tangential = force[0] + force[1], abs(force[0] - force[1])
    graph = explore(CoulombFriction(body, force), (0.0, 4.0))
    pole = tangential / normal if normal > 0.0 else np.inf
    for F in (0.1, 0.5 * pole, 2.0 * pole, 3.0):
        if 0.0 <= F <= 4.0:
            assert graph.count(F) == (1 if pole < F else 0)
    assert "missing" not in graph.guarantee
