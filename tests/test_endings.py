"""Where a system ends its curves, whatever side they are reached from, and whatever is a start."""

import numpy as np
import pytest
from searches import Nothing

from pwscont import PiecewiseLinearSystem, explore, trace
from pwscont.extending import Ending


class Fuse(PiecewiseLinearSystem, Ending):
    """z = 2 alpha, until its fuse blows at z = 1; ``asked`` are the cells that say so."""

    size = 1

    def __init__(self, asked):
        self.asked = asked

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        return z - 2.0 * alpha

    def end(self, character, tests):
        return "the fuse blows" if character.signs[0] in self.asked else None


class Crossing(PiecewiseLinearSystem, Ending):
    """|z| = |alpha|: four rays meet at zero, and that with z and alpha positive ends there."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha])

    def residual(self, z, alpha, character):
        right, late = character.signs
        return (z if right else -z) - (alpha if late else -alpha)

    def end(self, character, tests):
        return "here" if all(character.signs) and tests == {0, 1} else None


@pytest.mark.parametrize("asked", [(False,), (True,), (False, True)], ids=str)
@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_a_curve_ends_from_either_side(asked, alpha):
    graph = trace(Fuse(asked), ([2.0 * alpha], alpha), (0.0, 1.0))
    assert len(graph.pieces) == 1
    assert [graph.count(alpha), graph.count(1.0 - alpha)] == [1, 0]
    assert "a branch ends on purpose at alpha = 0.5" in graph.guarantee


@pytest.mark.parametrize(
    "starts",
    [
        [([1.0], 0.5)],
        [([0.0], 0.0), ([2.0], 1.0)],
        [([2.0], 1.0), ([1.0], 0.5), ([0.0], 0.0)],
    ],
    ids=str,
)
@pytest.mark.parametrize("search", [None, Nothing()], ids=["default", "nowhere"])
def test_no_curve_goes_on_as_another_from_any_start(starts, search):
    graph = explore(Fuse((False, True)), (0.0, 1.0), starts=starts, search=search)
    (point,) = (p for p in graph.special_points() if p.alpha == 0.5)
    assert (point.kind, point.message) == ("end", "the fuse blows")
    assert [graph.count(alpha) for alpha in (0.25, 0.5, 0.75)] == [1, 1, 1]


@pytest.mark.parametrize("z", [-1.0, 1.0])
@pytest.mark.parametrize("alpha", [-1.0, 1.0])
def test_a_corner_that_ends_one_curve_ends_all(z, alpha):
    graph = trace(Crossing(), ([z], alpha), (-1.0, 1.0))
    assert len(graph.pieces) == 1
    assert [p.message for p in graph.special_points("end") if p.alpha == 0.0] == ["here"]


@pytest.mark.parametrize("starts", [[(0.0, 0.0)], [(1.0, -1.0), (-1.0, 1.0), (0.0, 0.0)]], ids=str)
def test_a_corner_is_one_end_whatever_is_found_first(starts):
    graph = explore(Crossing(), (-1.0, 1.0), starts=[([z], alpha) for z, alpha in starts])
    assert [p.message for p in graph.special_points() if p.alpha == 0.0] == ["here"]
    assert [graph.count(alpha) for alpha in (-0.5, 0.0, 0.5)] == [2, 1, 2]
    assert len(graph.pieces) == 4
    assert graph.is_balanced()
