"""What a reader of a picture must be able to tell: colours, names, entries of legends, numbers."""

from itertools import combinations

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from pwscont_circuits import Circuit, Resistor, TunnelDiode, VoltageSource

from pwscont import (
    LCP,
    InvalidInputError,
    Switched,
    UnknownNameError,
    draw_counts,
    explore,
    plot,
)
from pwscont.scenes.plotting import arrange, draw_scene, place_legend, told_apart
from pwscont.scenes.registry import load_scene
from pwscont.scenes.styles import COLORS, color_of, in_letters, in_notation, symbol
from pwscont.two_parameters.plane import Region
from pwscont.two_parameters.plotting import _off_line, draw_plane


@pytest.fixture(autouse=True)
def headless():
    """Draw without a display."""
    matplotlib.use("Agg")
    yield
    import matplotlib.pyplot as plt  # noqa: PLC0415  after the backend is chosen

    plt.close("all")


@pytest.fixture(scope="module")
def graph():
    return explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))


def test_branches_have_colours_of_their_own():
    assert len(set(map(color_of, range(12)))) == 12
    apart = [np.abs(np.subtract(*map(to_rgb, pair))).max() for pair in combinations(COLORS, 2)]
    assert min(apart) > 0.1


@pytest.mark.parametrize(
    ("name", "drawn"),
    [
        ("mu", "$μ$"),
        ("lambda", "$λ$"),
        ("lambda_nu,1", "$λ_{ν,1}$"),
        ("theta1", "θ1"),
        ("alphabet", "alphabet"),
        ("load", "load"),
    ],
)
def test_greek_names_are_letters(name, drawn):
    assert symbol(name) == drawn


def test_greek_letters_in_titles_and_legends():
    assert in_letters("players, delta = 0.9, phi") == "players, δ = 0.9, φ"
    assert in_notation("positive: z_1, z_4") == "positive: $z_{1}$, $z_{4}$"


LONG = [f"{'node 1 stick, ' * 4}node {k} slips, and all other nodes are free" for k in range(3)]


@pytest.mark.parametrize(
    "words", [LONG, [word[::-1] for word in LONG], ["on", "off"], [*LONG, LONG[0] + " today"]]
)
def test_entries_of_a_legend_differ(words):
    labels = told_apart(words)
    assert len(set(labels)) == len(words)
    assert max(len(line) for label in labels for line in label.splitlines()) <= 40


def test_entries_of_a_legend_lose_whole_clauses_only():
    words = ["low: p, q", "low: p; free: q", "high: p; free: q"]
    assert told_apart(words) == words
    long = [f"{word}; {'other, ' * 8}" for word in words]
    assert told_apart(long) == [f"{word} …" for word in words]


def test_equal_labels_at_one_place_are_written_once():
    diodes = [
        TunnelDiode(name, *ends, 1.0, 1.0, 2.0, 0.5, 1.0)
        for name, ends in {"T1": ("a", "b"), "T2": ("b", "0")}.items()
    ]
    supply = VoltageSource("E", "in", "0", 0.0), Resistor("R", "in", "a", 2.0)
    twins = explore(Circuit([*supply, *diodes]).sweep("E"), (0.0, 12.0))
    folds = [p for p in twins.special_points("nonsmooth fold") if round(p["I(T1)"], 9) == 1.0]
    assert len(folds) == 2  # both diodes carry the same current
    ax = plot(twins, "I(T1)")
    written = [(text.get_text(), *np.round(text.xy, 9)) for text in ax.texts]
    assert len(set(written)) == len(written) > 0


def test_a_picture_without_solutions_shows_the_interval_and_says_so():
    nothing = explore(Switched(1, lambda z, t, sw: sw.abs(z) + 1.0 + t), (2.0, 3.0))
    ax = plot(nothing)
    assert ax.get_title() == "no solution found"
    assert ax.get_xlim() == (2.0, 3.0)


def test_counts_name_the_parameter(graph):
    assert draw_counts(graph, FigureCanvasAgg(Figure()).figure.subplots()).get_xlabel() == "$α$"


def test_what_cannot_be_drawn_is_refused_in_words(graph):
    with pytest.raises(InvalidInputError, match="what and y are both the vertical axis"):
        plot(graph, 1, y=1)
    named = explore(LCP([[1]], [-1], [1], names=["λ_t,1"]), (-1.0, 2.0))
    with pytest.raises(UnknownNameError, match="did you mean λ_t,1"):
        plot(named, "lambda_t")


@pytest.mark.parametrize("quantity", [0, "z[0]", lambda z, alpha: z[0]])
def test_any_quantity_over_any_other(graph, quantity):
    ax = plot(graph, x=quantity, y="z[1]")
    drawn = np.concatenate([path.vertices for some in ax.collections for path in some.get_paths()])
    ends = np.concatenate([piece.z for piece in graph.pieces])
    for point in ends:
        assert np.abs(drawn - point).max(axis=1).min() < 1e-9
    # the pieces of this problem are straight, and so are their pictures
    assert np.ptp(drawn[:, 0]) == pytest.approx(np.ptp(ends[:, 0]))


def test_the_parameter_across_is_the_default(graph):
    plain, named = plot(graph, 1), plot(graph, y=1, x="alpha")
    assert plain.get_xlabel() == named.get_xlabel() == "$α$"
    assert plain.get_xlim() == named.get_xlim()


def test_a_curve_that_bends_back_over_another_unknown():
    circle = Switched(2, lambda z, t, sw: [z[0] - sw.abs(t), z[1] - t**2 + 1])
    found = explore(circle, (-1.0, 1.0))
    ax = plot(found, x="z[0]", y="z[1]")
    drawn = np.concatenate([path.vertices for some in ax.collections for path in some.get_paths()])
    assert np.abs(drawn[:, 0] ** 2 - 1.0 - drawn[:, 1]).max() < 1e-2


def test_labels_stand_clear_of_the_frame():
    scene = load_scene("border-collision")
    figure = draw_scene(scene, scene.run())
    figure.canvas.draw()
    for ax in figure.axes:
        frame = ax.get_window_extent()
        for text in ax.texts:
            box = text.get_window_extent()
            assert frame.x0 + 1 < box.x0 < box.x1 < frame.x1 - 1


@pytest.mark.parametrize("longest", ["G2 at Q max", "G2, G3, G6, G8 at Q max, too", "stick, " * 5])
def test_no_word_of_a_legend_is_cut(longest):
    figure, axes = arrange(2, 2, counted=True)
    for ax in axes.flat:
        ax.set(ylabel="V14", ylim=(0.7, 0.75))
    words = ["G2, G3 at Q max"] * 5 + [longest] * 5
    place_legend(figure, axes[-1, 1:], [Line2D([], [], label=word) for word in words])
    FigureCanvasAgg(figure).draw()
    (legend,) = [*figure.legends, *filter(None, [axes[-1, 1].get_legend()])]
    assert max(text.get_window_extent().x1 for text in legend.get_texts()) <= figure.bbox.x1


def test_a_number_stands_apart_from_a_line_across_the_plane_and_in_its_region():
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
    triangle = Region(corners, corners.mean(axis=0), corners)
    near, far = np.array([1.0, 1.1]), np.array([1.0, 0.3])
    assert _off_line(near, 1.0, 0.5, [triangle]).tolist() == [1.0, 0.5]
    assert _off_line(near, 0.4, 0.8, [triangle]).tolist() == [1.0, 2.0]  # below lies no region
    assert _off_line(near, 2.0, 3.0, [triangle]).tolist() == near.tolist()  # nor above
    assert _off_line(far, 1.0, 0.5, [triangle]) is far


@pytest.mark.slow
def test_branches_too_short_to_be_seen_are_enlarged():
    scene = load_scene("strut-supports")
    figure = draw_scene(scene, scene.run())
    for ax in figure.axes[:2]:
        (inset,) = ax.child_axes
        lo, hi = inset.get_xlim()
        assert lo < 42.5
        assert hi > 44.0 - 1e-9
        assert hi - lo < 0.1 * np.ptp(ax.get_xlim())


@pytest.mark.parametrize(
    "name", ["fig5", pytest.param("example1-critical-friction", marks=pytest.mark.slow)]
)
def test_numbers_in_a_plane_are_not_struck_through(name):
    """Every number in a region stands on a patch of its shade, above all lines."""
    scene = load_scene(name)
    (ax,) = draw_plane(scene, scene.run()).axes
    for text in ax.texts:
        if text.get_text().isdigit():
            assert text.get_bbox_patch() is not None
            assert text.get_zorder() > max(line.get_zorder() for line in ax.lines)
