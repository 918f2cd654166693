"""Steps that end where a test vanishes."""

import numpy as np
import pytest
from pwscont_coulomb.elastic.scenes import block_body

from pwscont import PiecewiseSystem, PseudoArclength, Stepper, trace
from pwscont.bench.calls import FACTORISATIONS, counted

FRICTIONS = (0.1, 2.0)


class WithoutAim(Stepper):
    """Steps beyond every transition."""

    def step(self, *given):
        return PseudoArclength().step(*given)


@pytest.fixture(scope="module")
def friction():
    return block_body(16).condensed().along_friction(1.0)


def along(system, stepper=None):
    start = np.zeros(system.size), FRICTIONS[0]
    return trace(system, start, FRICTIONS, stepper=stepper or PseudoArclength())


def test_the_same_transitions_as_by_steps_beyond_them(friction):
    aimed, beyond = along(friction), along(friction, WithoutAim())
    assert [p.kind for p in aimed.special_points()] == [p.kind for p in beyond.special_points()]
    pairs = zip(aimed.special_points(), beyond.special_points(), strict=True)
    for one, other in pairs:
        assert abs(one.alpha - other.alpha) <= 10.0 * (one.error[-1] + other.error[-1])


def test_one_factorisation_for_each_step_and_each_piece(friction):
    """The step that ends at a transition locates the transition; a piece begins with another."""
    with counted(friction) as calls:
        graph = along(friction)
    steps = sum(len(piece.alpha) - 1 for piece in graph.pieces)
    assert len(graph.pieces) > 15
    # a start is corrected, and left in two directions
    assert calls[FACTORISATIONS] <= steps + len(graph.pieces) + 3


class Corner(PiecewiseSystem):
    """On y = bend(alpha) two seams are crossed, the first of them hidden from the tangent.

    y = 4 s^2 with s = alpha, seams at y = 0.5 and at alpha = 0.4: the tangent at alpha = 0 meets
    the second only, but y is 0.5 at alpha = 8^-1/2 < 0.4.
    """

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0] - 0.5, alpha - 0.4])

    def residual(self, z, alpha, character):
        return z - 4.0 * alpha**2


def test_a_transition_that_the_tangent_does_not_see_comes_first():
    graph = trace(Corner(), ([0.0], 0.0), (0.0, 1.0))
    found = [point.alpha for point in graph.special_points("transition")]
    np.testing.assert_allclose(sorted(found), [8.0**-0.5, 0.4], rtol=1e-13)


class Disagreeing(PiecewiseSystem):
    """Selections that agree at one point of the seam x = 0 only: the second row is y or -y."""

    size = 2

    def test_functions(self, z, alpha):
        return z[:1]

    def residual(self, z, alpha, character):
        x, y = z
        return np.array([x - alpha - alpha**3, y if character.signs[0] else -y])


def test_selections_that_disagree_along_the_interface_make_a_corner():
    """Their determinants have other signs, so that the point is no plain transition (F2)."""
    graph = trace(Disagreeing(), ([-0.625, 0.0], -0.5), (-0.5, 0.5))
    assert [str(point.kind) for point in graph.special_points()] == ["corner", "start", "end"]
