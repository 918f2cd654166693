"""Pictures: insets, and what a scene's picture holds."""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.lines import Line2D
from picture_parts import lines, steps, words_of

from pwscont import (
    PiecewiseSystem,
    explore,
    plot,
)
from pwscont.scenes.answer import FORMATS, Look
from pwscont.scenes.plotting import arrange, draw_scene, place_legend
from pwscont.scenes.registry import load_scene
from pwscont.scenes.scene import Panel, Scene
from pwscont.scenes.styles import number_of, symbol

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command

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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["example1", "example2", "fig7", "fig10", "example3"])
@pytest.mark.sweep(5)
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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig7", "fig12", "example1", "example3", "fig16"])
@pytest.mark.sweep(6)
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
@pytest.mark.sweep(6)
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
