"""Pieces along which several tests vanish count with their index, so that graphs balance.

Truth is the sum of signs of all solutions just beside: the load is changed a little, in a direction
that has nothing to do with it, and brute force lists the solutions close to the path.
"""

from itertools import product

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import enumerate_solutions

from pwscont import PiecewiseLinearSystem, explore, trace

FRICTIONS = (0.3, 1.0, 3.0, 8.0)
BESIDE, CLOSE = 1e-7, 1e-3


def system_under(body, f0, f1, friction):
    return CoulombLoad(contact_body(body), AffineLoad(f0, f1), friction)


def sum_of_signs_beside(body, load, friction, z, seed):
    """Return the index of a solution: the signs of the solutions near it, for another load."""
    changed = load + BESIDE * random_vector(body.n, [seed, 7])
    found = enumerate_solutions(body, changed, friction, 1e-15)
    return sum(one.det_sign for one in found if np.abs(one.z - z).max() < CLOSE)


def state_of(body, friction, nodes):
    """Return (u, lam_nu, lam_t) with u = 0 at every node, and the load that holds it there.

    Each node sticks, is about to slip to either side, or touches without any force.
    """
    forces = {"stick": (-1.0, 0.1), "+": (-1.0, -friction), "-": (-1.0, friction), "0": (0.0, 0.0)}
    lam_nu, lam_t = np.transpose([forces[node] for node in nodes])
    load = -body.N.T @ lam_nu - body.T.T @ lam_t
    return np.concatenate([np.zeros(body.n), lam_nu, lam_t]), load


RIDING = [
    ("+",),
    ("0",),
    ("+", "stick"),
    ("+", "-"),
    ("+", "+"),
    ("0", "+"),
    ("0", "stick"),
    ("0", "0"),
    ("+", "-", "+"),
    ("0", "+", "-"),
    ("0", "stick", "0"),
]


@pytest.mark.parametrize("nodes", RIDING, ids="/".join)
@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.sweep(42)
def test_a_path_along_interfaces_has_the_index_of_what_is_beside(nodes, friction):
    for seed in range(6 if len(nodes) < 3 else 2):
        body = random_body(len(nodes), seed, inner=0)
        z, load = state_of(body, friction, nodes)
        system = system_under(body, 0.0 * load, load, friction)
        graph = trace(system, (2.0 * z, 2.0), (1.0, 3.0))
        (riding,) = [
            p for p in graph.pieces if np.abs(p.points[0, :-1] - p.alpha[0] * z).max() < 1e-9
        ]
        expected = {sum_of_signs_beside(body, 2.0 * load, friction, 2.0 * z, s) for s in range(3)}
        assert {riding.det_sign} == expected
        assert sorted(riding.interval) == [1.0, 3.0]


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.sweep(6)
def test_a_path_along_interfaces_balances(friction):
    """With all other solutions the sum is the degree, +1."""
    for nodes, seed in product([("+",), ("+", "-"), ("0", "+")], range(3)):
        body = random_body(len(nodes), seed, inner=0)
        _, load = state_of(body, friction, nodes)
        graph = explore(system_under(body, 0.0 * load, load, friction), (1.0, 3.0))
        assert graph.guarantee == "complete"
        assert graph.balance(2.3) == 1


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.sweep(6)
def test_a_load_that_is_zero(p, friction):
    """Rest is a solution whose index is +1 where it is the only one."""
    for seed in range(3):
        body = random_body(p, seed)
        nothing = np.zeros(body.n)
        graph = explore(system_under(body, nothing, nothing, friction), (0.0, 1.0))
        beside = sum_of_signs_beside(body, nothing, friction, np.zeros(body.n + 2 * p), seed)
        assert [piece.det_sign for piece in graph.pieces] == [beside] == [1]
        assert graph.guarantee == "complete"
        assert graph.count(0.5) == 1


class Winding(PiecewiseLinearSystem):
    """The plane wound ``turns`` times around the origin; z = 0 solves it for every alpha.

    Each of the 8 sectors between multiples of pi / 4 is mapped on one that begins ``turns``
    quarters later than the one before, linearly; ``turns`` 1 wraps it once.
    """

    size = 2

    def __init__(self, quarters):
        self.quarters = quarters  # how far the image turns within a quarter, +-1 or 3 for three

    def test_functions(self, z, alpha):
        return np.array([z[0], z[1], z[0] - z[1], z[0] + z[1]])

    def residual(self, z, alpha, character):
        return self.matrix(character) @ z

    def jacobian(self, z, alpha, character):
        return np.column_stack([self.matrix(character), np.zeros(2)])

    def matrix(self, character):
        right, up, below, above = (1.0 if sign else -1.0 for sign in character.signs)
        corners = {
            (1, 1, 1, 1): 0,
            (1, 1, -1, 1): 1,
            (-1, 1, -1, 1): 2,
            (-1, 1, -1, -1): 3,
            (-1, -1, -1, -1): 4,
            (-1, -1, 1, -1): 5,
            (1, -1, 1, -1): 6,
            (1, -1, 1, 1): 7,
        }
        k = corners.get((right, up, below, above), 0)
        angles = np.pi / 4 * np.array([k, k + 1])
        before = np.array([np.cos(angles), np.sin(angles)])
        images = np.array([np.cos(self.quarters * angles), np.sin(self.quarters * angles)])
        return images @ np.linalg.inv(before)

    def cells(self):
        seen = {}
        for angle in np.pi / 4 * (np.arange(8) + 0.5):
            character = self.character(np.array([np.cos(angle), np.sin(angle)]), 0.0)
            seen[character] = None
        yield from seen


@pytest.mark.parametrize("turns", [1, 2, 3, -1, -2, -3])
@pytest.mark.sweep(2)
def test_the_index_counts_how_often_the_plane_is_wound_around(turns):
    graph = trace(Winding(turns), (np.zeros(2), 0.5), (0.0, 1.0))
    (piece,) = graph.pieces
    assert piece.det_sign == turns
    assert graph.balance(0.3) == turns
