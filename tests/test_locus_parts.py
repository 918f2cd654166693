"""Where the parts of a locus end, and how well that is known."""

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from sweeps import swept

from pwscont import Axes, InvalidInputError, PlaneScene
from pwscont.two_parameters.loci import follow_transitions, parts_of


def chain(seed):
    """Return a family of bodies of three nodes in a chain, the friction being mu."""
    rng = np.random.default_rng(seed)
    A = 2.0 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    A[0, 0] = rng.uniform(1.2, 1.9)
    body = ContactBody(A, N=np.eye(6)[0::2], T=np.eye(6)[1::2])
    load = AffineLoad([0.4, 0, 1.2, 0, 0.8, 0], [0, 1, 0, 1, 0, 1])
    return lambda friction: CoulombLoad(body, load, friction)


def determinant(locus, part, mu, place):
    """Return det(dH/dz) of both sides, next to a point of a part."""
    x = part.points[place]
    character = next(p.character for p in locus.graph.pieces if p.label == part.label)
    sides = locus.system.sides(character)
    system = locus.system.at(mu)
    jacobians = (system.jacobian(x[:-2], x[-2], side)[:, :-1] for side in sides)
    return np.array([np.linalg.det(jacobian) for jacobian in jacobians])


@pytest.mark.parametrize("level", swept([3.9], [3.0, 2.5, 2.2, 1.5]))
@pytest.mark.parametrize("seed", swept([0], range(1, 4)))
@pytest.mark.slow
def test_folds_end_where_a_determinant_changes_its_sign(seed, level):
    """Also where another one only touches zero there, so that their product is flat.

    det(dH/dz) of a cell depends on friction alone, as a polynomial of degree three at most: its
    zero is known from its values away from the end.
    """
    compared = 0
    for locus in follow_transitions(chain(seed), (-6.0, 6.0), (0.5, 4.0), [level], parameter="F"):
        for part in parts_of(locus):
            assert part.error.shape == (2, part.points.shape[1])
            for place in (0, -1):
                end = part.points[place, -1]
                if min(abs(end - 0.5), abs(end - 4.0)) < 0.1 or len(part.points) < 6:
                    continue
                mus = end + np.linspace(-0.3, 0.3, 7)
                values = np.array([determinant(locus, part, mu, place) for mu in mus])
                roots = [np.roots(np.polyfit(mus - end, v, 3)) for v in values.T]
                near = min(abs(root) for r in roots for root in r if abs(root.imag) < 1e-3)
                message = [p.message for p in locus.graph.special_points() if p.alpha == end]
                if not message:  # not the end of a piece
                    assert near <= max(1e-9, 10.0 * part.error[place, -1])
                    assert part.error[place, -1] < 1e-11
                    compared += 1
    assert compared >= 4


@pytest.mark.slow
def test_a_locus_along_which_friction_stays_the_same():
    """Node 2 is loaded with (2, 3) (1 + alpha): while node 1 sticks, node 2 slips below F = 1.5."""
    A = [[10, -1, -3, 4], [-1, 4, -3, -5], [-3, -3, 10, 4], [4, -5, 4, 10]]
    body = ContactBody(A, N=np.eye(4)[0::2], T=np.eye(4)[1::2])
    load = AffineLoad([1, 1, 2, 3], [2, -1, 2, 3])
    window, axes = ((-2.0, 2.0), (1.2, 2.0), (1.8,)), Axes(alpha="load", mu="F")
    plane = PlaneScene("p", "p", lambda F: CoulombLoad(body, load, F), *window, axes).run()
    (level,) = [p.plane for group in plane.parts for p in group if not np.ptp(p.plane[:, 1])]
    # lambda_t of node 1 is F lambda_nu at alpha = -1 / 8
    assert np.sort(level[[0, -1], 0]) == pytest.approx([-0.125, 2.0], rel=1e-12)
    assert level[:, 1] == pytest.approx(1.5, rel=1e-12)
    assert plane.guarantee.startswith("balanced; 10 of 10 regions of ")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"levels": ()}, r"levels must be values of mu from 0.5 to 4.0, at least one, got \(\)"),
        ({"levels": (9.0,)}, "levels must be values of mu from 0.5 to 4.0"),
        ({"levels": 1.5}, "levels must be values of mu from 0.5 to 4.0"),
        ({"axes": "F"}, "axes must be an Axes, got 'F'"),
        ({"family": 3.0}, "family must be a function of mu, got 3.0"),
    ],
)
def test_wrong_parts_of_a_plane_are_refused_in_words(wrong, words):
    given = {"family": chain(1), "levels": (2.0,)} | wrong
    with pytest.raises(InvalidInputError, match=words):
        PlaneScene("p", "p", alphas=(-2.0, 2.0), mus=(0.5, 4.0), **given).run()
