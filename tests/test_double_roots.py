"""Curves on which H vanishes twice, and curves of equations that nearly agree."""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, explore, trace

#: Equations that vanish twice on a curve, and the numbers of solutions at three alphas.
DOUBLE = {
    "a line": (lambda z, a, sw: (z - a) ** 2, [1, 1, 1]),
    "a level line beside a line": (lambda z, a, sw: (z - 0.3) ** 2 * (z + 0.5), [2, 2, 2]),
    "a level line that a line crosses": (
        lambda z, a, sw: (z - 0.3) ** 2 * (z + 0.5 - a),
        [2, 2, 2],
    ),
    "a line that a line crosses": (lambda z, a, sw: (z - a) ** 2 * (z + a), [2, 2, 2]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DOUBLE)
def test_a_straight_curve_of_double_roots_is_followed(name):
    """The sign of det[J; t^T] is rounding all along the curve, and tells of no branch point."""
    function, counts = DOUBLE[name]
    graph = explore(Switched(1, function), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.7, 0.2, 0.9)] == counts
    assert sum(len(piece.points) for piece in graph.pieces) < 300


@pytest.mark.parametrize("apart", [1e-3, 1e-5, 1e-7, 1e-8])
@pytest.mark.parametrize("begin", [-1.0, 0.5])
def test_equations_that_nearly_agree_are_no_double_curve(apart, begin):
    """J nearly loses rank all along the curve, but its determinant keeps its sign across.

    Of rows that agree to seven digits, rounding decides whether the branch point is found.
    """

    def equations(z, a, sw):
        first, second = z[0] * (z[0] ** 2 - a), z[1] - 0.3 * z[0] + 0.1 * a
        return [first + second, first + (1.0 + apart) * second]

    z0 = max(begin, 0.0) ** 0.5
    start = [z0, 0.3 * z0 - 0.1 * begin]
    graph = trace(Switched(2, equations), (start, begin), (-1.0, 1.0))
    is_right = [graph.count(alpha) for alpha in (-0.6, 0.2, 0.7)] == [1, 3, 3]
    assert (is_right and graph.is_balanced()) or (
        apart < 1e-6 and "not balanced" in graph.guarantee
    )


@pytest.mark.slow
@pytest.mark.parametrize("turn", [1e-3, 1e-5, 1e-6, 1e-8])
def test_two_lines_at_a_small_angle_are_two_or_named(turn):
    """Beside the crossing the lines are one to rounding, and farther away they are not."""
    graph = explore(
        Switched(1, lambda z, a, sw: (z - 0.4 * a) * (z - (0.4 + turn) * a - 0.3 * turn)),
        (-1.0, 1.0),
    )
    right = [graph.count(alpha) for alpha in (-0.8, 0.1, 0.8)] == [2, 2, 2]
    assert right or "two curves may be taken for one on the piece" in graph.guarantee


@pytest.mark.slow
def test_a_parabola_of_double_roots_is_followed_or_named():
    graph = explore(Switched(1, lambda z, a, sw: (z**2 - a) ** 2), (-1.0, 2.0))
    right = [graph.count(alpha) for alpha in (-0.5, 0.7, 1.6)] == [0, 2, 2]
    assert right or graph.guarantee.startswith("not balanced")
    assert sum(len(piece.points) for piece in graph.pieces) < 3000


class DoubleCurves(PiecewiseSystem):
    """The product of squares, which vanish on curves, and of other factors."""

    size = 1

    def __init__(self, *squares, others=()):
        self.squares, self.others = squares, others

    def test_functions(self, z, alpha):
        return z - 0.3

    def residual(self, z, alpha, character):
        factors = [*(z - f(alpha) for f in self.squares for _ in range(2))]
        return np.prod([*factors, *(z - f(alpha) for f in self.others)], axis=0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "squares",
    [
        (np.sin,),
        (np.sin, lambda a: 2.0 + np.cos(a), lambda a: -3.0 - a),
        (np.exp, lambda a: -np.exp(a)),
    ],
)
def test_paths_along_curves_of_double_roots_are_given_up_soon(squares):
    """Rounding makes folds without end, and every start leads to the same curves."""
    graph = explore(DoubleCurves(*squares), (-2.0, 2.0))
    right = [graph.count(alpha) for alpha in (-1.3, 0.2, 1.7)] == [len(squares)] * 3
    assert right or "not followed, for the Jacobian loses rank" in graph.guarantee
    assert sum(len(piece.points) for piece in graph.pieces) < 3000


@pytest.mark.slow
def test_other_branches_beside_a_curve_of_double_roots_are_found():
    lines = (lambda a: -3.0 - 0.5 * a, lambda a: 5.0 - a**2)
    graph = explore(DoubleCurves(np.sin, others=lines), (-2.0, 2.0))
    for alpha in (-1.6, -0.4, 0.8, 1.9):
        found = [solution.z[0] for solution in graph.solutions(alpha)]
        for line in lines:
            assert np.min(np.abs(np.array(found) - line(alpha))) < 1e-9
