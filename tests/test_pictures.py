"""Pictures show what the graph says."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import StepPatch
from paper_systems import CASES

from pwscont import PiecewiseSystem, PwscontError, draw_counts, explore, plot, trace
from pwscont.scenes.drawn import Drawn
from pwscont.scenes.plotting import draw_scene, line_of, symbol
from pwscont.scenes.registry import load_scene

mpl.use("Agg")


def steps(ax):
    """Return the step lines by their labels: values and edges."""
    patches = [patch for patch in ax.patches if isinstance(patch, StepPatch)]
    return {patch.get_label(): patch.get_data() for patch in patches}


def test_counts_and_balance_of_the_papers_curve():
    """One solution below alpha = -1 and above -0.5, three between, two at both folds."""
    graph = load_scene("fig7").run()
    ax = draw_counts(graph, Figure().subplots())
    drawn = steps(ax)
    np.testing.assert_allclose(drawn["solutions"].values, [1, 3, 1])
    np.testing.assert_allclose(drawn["solutions"].edges, [-2, -1, -0.5, 2], atol=1e-12)
    np.testing.assert_allclose(drawn["balance"].values, 1)
    dots = next(line for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_allclose(dots.get_xydata(), [[-1, 2], [-0.5, 2]], atol=1e-12)


@pytest.mark.parametrize("name", ["fig7", "example3"])
def test_counts_stand_below_the_branch_diagram_with_the_same_axis(name):
    scene = load_scene(name)
    axes = draw_scene(scene, scene.run()).axes
    counted = [ax for ax in axes if "solutions" in steps(ax)]
    assert len(counted) == 1
    assert counted[0].get_xlim() == axes[0].get_xlim()
    assert counted[0].get_position().y1 < axes[0].get_position().y0


def test_vertical_pieces_are_marked_where_solutions_are_infinitely_many():
    graph = load_scene("fig12").run()
    vertical = {piece.interval[0] for piece in graph.pieces if piece.is_vertical}
    ax = draw_counts(graph, Figure().subplots())
    dotted = {line.get_xdata()[0] for line in ax.lines if line.get_linestyle() == ":"}
    assert len(vertical) == 2
    assert dotted == vertical


class Circle(PiecewiseSystem):
    """z_0^2 + alpha^2 = 1 with z_1 = 1: smooth, with folds at alpha = 1 and -1."""

    size = 2

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return np.array([z[0] ** 2 + alpha**2 - 1.0, z[1] - 1.0])


def test_curved_pieces_are_drawn_as_smooth_curves():
    """The line passes through the stored points, stays among them, and is closer to the truth."""
    graph = trace(Circle(), ([1.0, 1.0], 0.0), (-2.0, 2.0))
    for piece in graph.pieces:
        alpha, z = line_of(piece, lambda points: points[:, 0])
        assert len(alpha) > 4 * len(piece.points)
        nearest = [
            np.hypot(alpha - a, z - b).min()
            for a, b in zip(*piece.points[:, [-1, 0]].T, strict=True)
        ]
        assert max(nearest) < 1e-5
        assert np.abs(alpha).max() <= np.abs(piece.alpha).max() + 1e-12
        middles = 0.5 * (piece.points[1:, [-1, 0]] + piece.points[:-1, [-1, 0]])
        polygon = np.abs(np.hypot(*middles.T) - 1.0).max()
        assert np.abs(np.hypot(alpha, z) - 1.0).max() < 0.5 * polygon
        constant = line_of(piece, lambda points: points[:, 1])[1]
        np.testing.assert_allclose(constant, 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("what", "label"),
    [(1, "u_t"), ("u_t", "u_t"), ("work", "work"), (lambda z, alpha: z[0] * alpha, "value")],
)
def test_whatever_has_a_value_is_drawn(what, label):
    graph = explore(
        CASES["fig7"].system, (-2.0, 2.0), record={"work": lambda z, alpha: float(z[1] * alpha)}
    )
    ax = plot(graph, what)
    assert ax.get_ylabel() == symbol(label)
    drawn = np.concatenate([line.get_ydata() for line in ax.lines]).astype(float)
    quantity = Drawn.of(graph, what).along
    for piece in graph.pieces:
        assert np.abs(drawn - quantity(piece.points)[0]).min() < 1e-12
    plt.close(ax.figure)


@pytest.mark.parametrize("what", ["u_s", 7, None, 1.5])
def test_what_is_not_there_is_refused(what):
    graph = explore(CASES["fig7"].system, (-2.0, 2.0))
    with pytest.raises(PwscontError, match=r"u_t|there is no unknown 7|must be an index"):
        plot(graph, what)
    assert not plt.get_fignums()
