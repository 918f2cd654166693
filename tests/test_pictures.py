"""Pictures show what the graph says."""

from itertools import combinations

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import StepPatch
from paper_systems import CASES

from pwscont import (
    PiecewiseSystem,
    PwscontError,
    Switched,
    draw_counts,
    explore,
    plot,
    trace,
)
from pwscont.scenes.answer import FORMATS, Look
from pwscont.scenes.panels import Drawn
from pwscont.scenes.plotting import arrange, draw_scene, place_legend
from pwscont.scenes.registry import load_scene
from pwscont.scenes.scene import Panel, Scene
from pwscont.scenes.strokes import line_of
from pwscont.scenes.styles import COLORS, LINE_STYLES, THIN, WIDTH, number_of, styles_of, symbol

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command

mpl.use("Agg")


def steps(ax):
    """Return the step lines by their labels: values and edges."""
    patches = [patch for patch in ax.patches if isinstance(patch, StepPatch)]
    return {patch.get_label(): patch.get_data() for patch in patches}


def lines(ax):
    """Return the points of all lines of branches."""
    return [line for some in collections(ax) for line in some.get_segments()]


def collections(ax):
    return [some for some in ax.collections if isinstance(some, LineCollection)]


def legend_words(legend):
    return [text.get_text() for text in legend.get_texts()]


def words_of(figure):
    """Return the words of all legends of a figure."""
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes)]
    return [word for legend in legends if legend for word in legend_words(legend)]


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


# -- insets ----------------------------------------------------------------------------------------


def insets(ax):
    return [child for child in ax.child_axes if child.get_children()]


def test_crowded_folds_are_enlarged_where_nothing_is_drawn():
    graph = load_scene("example1").run()
    ax = plot(graph, "u_t,1")
    (inset,) = insets(ax)
    (lo, hi), (low, high) = inset.get_xlim(), inset.get_ylim()
    folds = graph.special_points("nonsmooth fold")
    assert len(folds) == 4
    assert all(lo < fold.alpha < hi and low < fold["u_t,1"] < high for fold in folds)
    scales = [
        box.get_window_extent().width / np.ptp(box.get_xlim()) for box in (inset, ax)
    ]  # pixels for each unit of the parameter
    assert scales[0] > 2.0 * scales[1]
    ax.figure.draw_without_rendering()
    box = inset.get_window_extent()
    inside = [
        box.contains(*ax.transData.transform((a, v)))
        for line in lines(ax)
        for a, v in zip(
            *(np.interp(np.linspace(0, len(line) - 1, 99), range(len(line)), c) for c in line.T),
            strict=True,
        )
    ]
    assert not any(inside)
    plt.close(ax.figure)


def texts(ax):
    """Return what is written in a diagram and its insets, with the boxes, in pixels."""
    parts = [ax, *insets(ax)]
    return [(text.get_text(), text) for part in parts for text in part.texts]


@pytest.mark.parametrize("name", ["example1", "example2", "fig7", "fig10", "example3"])
@pytest.mark.sweep(3)
def test_every_fold_has_its_label_in_every_diagram(name):
    graph = load_scene(name).run()
    folds = sorted(number_of(fold.alpha) for fold in graph.special_points("nonsmooth fold"))
    assert folds
    for quantity in graph.names:
        ax = plot(graph, quantity)
        assert sorted(text for text, _ in texts(ax)) == folds
        ax.figure.draw_without_rendering()
        boxes = [text.get_window_extent() for _, text in texts(ax)]
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
        plt.close(ax.figure)


@pytest.mark.parametrize("name", ["example1", "example2"])
def test_every_fold_has_its_label_in_every_panel_of_a_scene(name):
    scene = load_scene(name)
    graph = scene.run()
    folds = sorted(number_of(fold.alpha) for fold in graph.special_points("nonsmooth fold"))
    panels = [
        ax for ax in draw_scene(scene, graph).axes if ax.get_ylabel().startswith(("$u", "$λ"))
    ]
    assert panels
    for ax in panels:
        assert sorted(text for text, _ in texts(ax)) == folds


@pytest.mark.parametrize("name", ["fig7", "fig10", "example3"])
def test_folds_that_can_be_told_apart_are_not_enlarged(name):
    scene = load_scene(name)
    assert not any(insets(ax) for ax in draw_scene(scene, scene.run()).axes)


# -- what a scene's picture holds ------------------------------------------------------------------


def test_constant_panels_are_said_not_drawn():
    scene = load_scene("example2")
    figure = draw_scene(scene, scene.run())
    titles = {ax.get_title() for ax in figure.axes}
    assert "node 2" in titles
    assert not any("node 1" in title for title in titles)
    assert "constant: $λ_{ν,1}$ = −0.4, $u_{t,1}$ = 0" in figure.get_suptitle()


def test_a_quantity_in_small_units_is_not_constant():
    class Small(PiecewiseSystem):
        size = 2

        def test_functions(self, z, alpha):
            return np.zeros(0)

        def residual(self, z, alpha, character):
            return np.array([1e11 * z[0] - alpha, z[1] - 5.0 - alpha])

        def scale(self, lo, hi):
            return np.array([1e-11, 5.0])

    scene = Scene("small", "two units", Small(), (0.0, 1.0), panels=(Panel(0), Panel(1)))
    figure = draw_scene(scene, scene.run())
    assert len([ax for ax in figure.axes if ax.get_ylabel()]) == 2
    low, high = figure.axes[0].get_ylim()
    assert high - low < 2e-11


def test_one_panel_fills_its_figure():
    scene = load_scene("fig7").with_panels(["u_t"])
    figure = draw_scene(
        Scene("one", "one panel", scene.system, (-2.0, 2.0), panels=scene.panels), scene.run()
    )
    figure.draw_without_rendering()
    assert len(figure.axes) == 2  # the panel, and the counts below it
    assert all(ax.axison for ax in figure.axes)
    width = figure.axes[0].get_position().width
    assert width > 0.8
    assert "balance (sum of signs)" in words_of(figure)


def test_one_solution_throughout_is_said_not_drawn():
    scene = load_scene("fig16")
    figure = draw_scene(scene, scene.run())
    assert not any(steps(ax) for ax in figure.axes)
    assert "1 solution throughout" in figure.get_suptitle()


@pytest.mark.parametrize("name", ["fig7", "fig12", "example1", "example3", "fig16"])
def test_no_legend_lies_on_data(name):
    scene = load_scene(name)
    figure = draw_scene(scene, scene.run())
    figure.draw_without_rendering()
    shown = [ax for ax in figure.axes if ax.axison]
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
    assert legends
    for legend in legends:
        box = legend.get_window_extent()
        assert not any(box.shrunk(0.98, 0.9).overlaps(ax.get_window_extent()) for ax in shown)


@pytest.mark.parametrize("count", [3, 12, 13, 20])
def test_legends_leave_room_for_diagrams(count):
    figure, axes = arrange(2, 1, counted=True)
    handles = [Line2D([], [], label="a mode with some words") for _ in range(count)]
    place_legend(figure, axes[-1, 1:], handles)
    figure.draw_without_rendering()
    assert all(ax.get_position().width > 0.35 for ax in axes[0])


class Nowhere(PiecewiseSystem):
    """z^2 + 1 = 0, or z^2 = alpha^2: no solution, or two lines that cross at a branch point."""

    size = 1

    def __init__(self, lift):
        self.lift = lift

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return z**2 + self.lift - (1.0 - self.lift) * alpha**2


def test_a_graph_without_pieces_is_drawn():
    scene = Scene("nowhere", "no solution", Nowhere(1.0), (-1.0, 1.0))
    graph = scene.run()
    assert not graph.pieces
    assert not lines(plot(graph))
    assert "0 solutions throughout" in draw_scene(scene, graph).get_suptitle()
    plt.close("all")


def test_branch_points_have_their_parameter_beside_them():
    graph = explore(Nowhere(0.0), (-1.0, 1.0))
    (point,) = graph.special_points("branch point")
    ax = plot(graph)
    assert point.alpha == pytest.approx(0.0, abs=1e-9)
    assert [text.get_text() for text in ax.texts] == ["0"]
    plt.close(ax.figure)


@pytest.mark.parametrize("kind", FORMATS)
def test_formats(kind, tmp_path):
    scene = load_scene("fig7")
    answer = scene.solve((), lambda *_: None)
    picture, data = answer.write(tmp_path, Look(format=kind, dpi=40))
    assert (picture.name, data.name) == (f"fig7.{kind}", "fig7.npz")
    begin = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind]
    assert picture.read_bytes().startswith(begin)


@pytest.mark.parametrize(
    ("name", "drawn"),
    [
        ("alpha", "$α$"),
        ("u_t,1", "$u_{t,1}$"),
        ("F", "$F$"),
        ("u_t [mm]", "$u_{t}$ [mm]"),
        ("load [kN]", "load [kN]"),
    ],
)
def test_names_and_units(name, drawn):
    assert symbol(name) == drawn
