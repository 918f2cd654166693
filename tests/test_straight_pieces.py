"""Straight pieces from cell to cell by one solve (docs/theory, F11), against what is known."""

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.modes import Mode, modes
from random_bodies import contact_body, random_body

from pwscont import InvalidSystemError, PiecewiseLinearSystem, trace
from pwscont.basics.rounding import CONFIDENCE

# -- stated errors ---------------------------------------------------------------------------------


def pressed(p, seed):
    """Return a random body, and a load that presses it on the obstacle and drags it."""
    body, rng = contact_body(random_body(p, seed, inner=2, gap=True)), np.random.default_rng(seed)
    f0, f1 = rng.normal(size=(2, body.n))
    return CoulombLoad(body, AffineLoad(f0 + 2.0 * body.N.T.sum(axis=1), f1), 2.5)


@pytest.mark.parametrize("seed", [9, 16, 18])
def test_forces_of_free_nodes_are_zero_within_their_stated_errors(seed):
    system = pressed(23, seed)
    graph = trace(system, (np.zeros(system.size), -4.0), (-4.0, 4.0))
    points = {point.id: point.place for point in graph.special_points()}
    n, checked = system.body.n, 0
    for piece in graph.pieces:
        free = np.flatnonzero(modes(piece.character) == Mode.NO_CONTACT)
        forces = np.r_[n + free, n + system.body.p + free]
        for place in (points[piece.start], points[piece.end]):
            assert (np.abs(place.x[forces]) <= CONFIDENCE * place.error[forces]).all()
            checked += len(forces)
    assert checked > 500


# -- wrong systems ---------------------------------------------------------------------------------


class Torn(PiecewiseLinearSystem):
    """z_i = alpha, but beyond z_0 = 1/2 a row changes that agrees at z_2 = 1/2 only."""

    size = 70

    def test_functions(self, z, alpha):
        return z[:1] - np.array([0.25, 0.5, 0.75])

    def residual(self, z, alpha, character):
        rest, beyond = z - alpha, np.maximum(0.0, character.signs)
        rest[1] += beyond[0] * (z[0] - 0.25)
        rest[1] += beyond[1] * (z[2] - 0.5)
        return rest


def test_selections_that_agree_at_one_point_of_their_interface_are_refused():
    system = Torn()
    with pytest.raises(InvalidSystemError, match=r"disagree in row 1 .* all of their interface"):
        trace(system, (np.zeros(system.size), 0.0), (0.0, 1.0))
