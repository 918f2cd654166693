"""Pictures show what the graph says."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from paper_systems import CASES
from picture_parts import collections, legend_words, lines, steps, words_of

from pwscont import (
    InvalidInputError,
    PiecewiseSystem,
    PwscontError,
    Switched,
    draw_counts,
    explore,
    plot,
    trace,
)
from pwscont.scenes.panels import Drawn
from pwscont.scenes.plotting import draw_scene
from pwscont.scenes.registry import load_scene
from pwscont.scenes.strokes import line_of
from pwscont.scenes.styles import COLORS, LINE_STYLES, THIN, WIDTH, styles_of, symbol

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command


mpl.use("Agg")


def test_counts_and_balance_of_the_papers_curve():
    """One solution below alpha = -1 and above -0.5, three between, two at both folds."""
    graph = load_scene("fig7").run()
    ax = draw_counts(graph, Figure().subplots())
    drawn = steps(ax)
    np.testing.assert_allclose(drawn["solutions"].values, [1, 3, 1])
    np.testing.assert_allclose(drawn["solutions"].edges, [-2, -1, -0.5, 2], atol=1e-12)
    np.testing.assert_allclose(drawn["balance (sum of signs)"].values, 1)
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
    drawn = np.concatenate([line[:, 1] for line in lines(ax)])
    quantity = Drawn.of(graph, what).along
    for piece in graph.pieces:
        assert np.abs(drawn - quantity(piece.points)[0]).min() < 1e-12
    plt.close(ax.figure)


def test_a_recorded_quantity_is_no_chord_of_a_straight_piece():
    """z = alpha all along: what is recorded is alpha^2, from 1 over 0 to 1."""
    system = Switched(1, lambda z, t, sw: z - t + sw.min(z + 5.0, 0.0), linear=True)
    graph = explore(system, (-1.0, 1.0), record={"square": lambda z, alpha: float(z[0] ** 2)})
    ax = plot(graph, "square")
    drawn = np.concatenate(lines(ax))
    np.testing.assert_allclose(drawn[:, 1], drawn[:, 0] ** 2, rtol=0, atol=1e-12)
    assert np.abs(drawn[:, 1]).min() < 1e-3
    low, high = ax.get_ylim()
    assert low < 0.0
    assert high > 1.0
    plt.close(ax.figure)


@pytest.mark.parametrize("what", ["u_s", 7, None, 1.5])
def test_what_is_not_there_is_refused(what):
    graph = explore(CASES["fig7"].system, (-2.0, 2.0))
    with pytest.raises(PwscontError, match=r"u_t|there is no unknown 7|must be an index"):
        plot(graph, what)
    assert not plt.get_fignums()


@pytest.mark.parametrize("graph", [3, None, []])
def test_only_graphs_are_drawn(graph):
    with pytest.raises(InvalidInputError, match="graph must be a BranchGraph, got"):
        plot(graph)


# -- colours, styles, widths -----------------------------------------------------------------------


def test_modes_have_one_style_everywhere():
    """Slip in both directions is told apart; ``plot`` and ``run`` draw alike."""
    scene = load_scene("fig7")
    graph = scene.run()
    ax = plot(graph, "u_t")
    drawn = {h.get_label(): h.get_linestyle() for h in ax.get_legend().legend_handles}
    assert drawn["slip+"] != drawn["slip-"]
    assert {drawn[mode] for mode in ("no contact", "stick", "slip-", "slip+")} == {*LINE_STYLES[:4]}
    figure = draw_scene(scene, graph)
    (legend,) = [
        ax.get_legend() for ax in figure.axes if ax.get_legend() and "number" not in ax.get_ylabel()
    ]
    again = {h.get_label(): h.get_linestyle() for h in legend.legend_handles}
    assert again == drawn
    plt.close(ax.figure)


def test_thin_lines_are_those_with_negative_determinant_and_the_legend_says_so():
    graph = load_scene("fig7").run()
    ax = plot(graph, "u_t")
    widths = {
        tuple(np.sort(line[[0, -1], 0]).round(9)): some.get_linewidth()[0]
        for some in collections(ax)
        for line in some.get_segments()
    }
    for piece in graph.pieces:
        assert widths[tuple(np.round(piece.interval, 9))] == (THIN if piece.det_sign < 0 else WIDTH)
    assert sum("det" in word for word in legend_words(ax.get_legend())) == 1
    plt.close(ax.figure)


def many_modes(count):
    """Return a scene of one straight line through so many cells."""

    class Cells(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return alpha - np.arange(1.0, count)

        def residual(self, z, alpha, character):
            return z - alpha

        def label(self, character):
            return f"{sum(character.signs)} of {count} cells behind, and a long word more"

    return trace(Cells(), ([0.5], 0.5), (0.5, count - 0.5))


@pytest.mark.parametrize("count", [3, 39])
def test_legends_of_many_modes_are_short_and_outside(count):
    graph = many_modes(count)
    assert len({piece.label for piece in graph.pieces}) == count
    ax = plot(graph)
    legend = ax.get_legend()
    assert len(legend_words(legend)) <= 12
    assert max(map(len, legend_words(legend))) <= 40
    told = any("39 modes" in word for word in legend_words(legend))
    assert told == (count == 39)
    ax.figure.draw_without_rendering()
    assert not legend.get_window_extent().overlaps(ax.get_window_extent())
    assert ax.get_window_extent().width > 200
    plt.close(ax.figure)


@pytest.mark.slow
def test_pieces_in_one_style_are_one_line():
    """One artist for each piece took half a minute for 546 of them."""
    graph = many_modes(200)
    ax = plot(graph)
    assert len(ax.get_children()) < 30
    (line,) = lines(ax)
    np.testing.assert_allclose(line[[0, -1], 0], graph.interval)
    plt.close(ax.figure)


def test_styles_that_are_wanted_are_kept_and_given_once():
    styles = styles_of(["a", "b", "c", "a"], {"c": "-", "d": "--"})
    assert styles == {"a": "--", "b": "-.", "c": "-"}


# -- branches that coincide ------------------------------------------------------------------------


@pytest.mark.slow
def test_coinciding_branches_stay_visible():
    """All branches of example3 with node 1 open have lambda = 0: each colour shows."""
    scene = load_scene("example3")
    graph = scene.run()
    axes = draw_scene(scene, graph).axes
    at = axes[0].get_ylabel(), axes[0]
    assert "λ" in at[0]
    rails = [
        (to_hex(some.get_color()[0]).upper(), some.get_linewidth()[0])
        for some in collections(at[1])
        for line in some.get_segments()
        if np.abs(line[:, 1]).max() < 1e-9 and line[:, 0].max() > 14.9
    ]
    widths = dict(rails)
    below, above = (widths[color.upper()] for color in COLORS[:2])
    assert below > widths["#FFFFFF"] > above
    words = words_of(axes[0].figure)
    assert {"branch 1", "branch 2", "branch 3"} <= set(words)


def test_a_line_on_another_of_its_style_is_drawn_once():
    """Dashes on dashes would look solid."""
    scene = load_scene("example1")
    graph = scene.run()
    ax = plot(graph, "u_t,2")
    zero = [line for line in lines(ax) if np.abs(line[:, 1]).max() < 1e-9]
    spans = sorted(tuple(line[[0, -1], 0].round(6)) for line in zero)
    assert len(spans) == len(set(spans))
    plt.close(ax.figure)


# -- marks and labels ------------------------------------------------------------------------------


def test_folds_have_their_parameter_beside_them_and_events_their_name():
    graph = explore(
        CASES["fig7"].system, (-2.0, 2.0), events={"half way": lambda z, alpha: z[1] + 0.7}
    )
    ax = plot(graph, "u_t")
    words = {text.get_text() for text in ax.texts}
    assert words == {"−1", "−0.5", "half way"}
    ax.figure.draw_without_rendering()
    frame = ax.get_window_extent()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert all(frame.contains(*corner) for box in boxes for corner in (box.min, box.max))
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    plt.close(ax.figure)


def test_starts_at_the_ends_of_the_interval_are_no_marks():
    at_end = trace(CASES["fig7"].system, (np.zeros(4), -2.0), (-2.0, 2.0))
    within = trace(CASES["fig7"].system, (np.zeros(4), 1.5), (-2.0, 2.0))
    for graph, told in ((at_end, False), (within, True)):
        ax = plot(graph, "u_t")
        assert ("start" in legend_words(ax.get_legend())) == told
        drawn = [x for line in ax.lines for x in np.atleast_1d(line.get_xdata())]
        assert not {-2.0, 2.0} & set(drawn)
        plt.close(ax.figure)


@pytest.mark.slow
def test_a_node_does_not_mark_what_other_nodes_do():
    scene = load_scene("example1")
    graph = scene.run()
    (transition,) = {point.alpha for point in graph.special_points("transition")}
    axes = {(ax.get_title(), ax.get_ylabel()): ax for ax in draw_scene(scene, graph).axes}
    marked = {
        node: any(transition in line.get_xdata() for line in ax.lines)
        for (node, label), ax in axes.items()
        if label.startswith("$u")
    }
    assert marked == {"node 1": True, "node 2": False}


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda z, alpha: np.nan, "not: nan"),
        (lambda z, alpha: np.inf, "not: inf"),
        (lambda z, alpha: "a", "not: TypeError"),
        (lambda z, alpha: [1, 2], "not: ValueError: can only convert an array of size 1"),
        (lambda z, alpha: 1j, "not: TypeError"),
        (lambda z: 1.0, "not: TypeError: .*takes 1 positional argument"),
        (lambda z, alpha: 1.0 / 0.0, "not: ZeroDivisionError"),
    ],
)
def test_what_is_drawn_is_a_finite_number(function, words):
    graph = explore(CASES["fig7"].system, (-2.0, 2.0))
    message = "value, which is drawn, must be a finite number, at alpha = .* it is "
    with pytest.raises(InvalidInputError, match=message + words):
        plot(graph, function, ax=Figure().subplots())
