"""Companion pictures: two quantities along the parameter, such as a load path."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from pwscont.basics.arrays import Array
from pwscont.graph import BranchGraph
from pwscont.scenes.labels import LETTERS
from pwscont.scenes.panels import ParameterPath
from pwscont.scenes.symbols import number_of, symbol

POINTS = 201
#: A path shorter than this part of its size is a point.
AT_REST = 1e-9


def points_of(graph: BranchGraph, path: ParameterPath) -> Array:
    """Return points along a path, shape (k, 2)."""
    alphas = np.linspace(*graph.interval, POINTS)
    return np.array([path.curve(float(alpha)) for alpha in alphas])


def is_at_rest(graph: BranchGraph, path: ParameterPath) -> bool:
    """Tell whether a path is a point."""
    points = points_of(graph, path)
    return bool(np.ptp(points, axis=0).max() <= AT_REST * np.abs(points).max())


def draw_path(ax: Axes, graph: BranchGraph, path: ParameterPath) -> None:
    """Draw a path with its direction and the parameter at both ends."""
    points = points_of(graph, path)
    ax.plot(*points.T, color="black", linewidth=1.5)
    middle = points[len(points) // 3 : len(points) // 3 + 2]
    arrow = {"arrowstyle": "-|>", "color": "black", "mutation_scale": 14}
    ax.annotate("", middle[1], middle[0], arrowprops=arrow)
    for at, words in _ends(graph, points):
        ax.plot(*at, "o", color="black", markersize=4)
        inward = -1 if at[0] > points[:, 0].mean() + 1e-9 * np.ptp(points) else 1
        ax.annotate(
            words,
            at,
            (6 * inward, 0),
            textcoords="offset points",
            fontsize=LETTERS,
            ha="left" if inward > 0 else "right",
            va="center",
        )
    ax.set(xlabel=path.labels[0], ylabel=path.labels[1])
    ax.set_title(path.title, fontsize="medium")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.15)
    ax.grid(alpha=0.25)


def _ends(graph: BranchGraph, points: Array) -> list[tuple[tuple[float, float], str]]:
    """Return the ends of a path with their labels; one end and label for a closed path."""
    (first, last), name = map(number_of, graph.interval), symbol(graph.parameter)
    begin, end = (tuple(map(float, points[i])) for i in (0, -1))
    if np.abs(points[0] - points[-1]).max() <= AT_REST * np.abs(points).max():
        return [((begin[0], begin[1]), f"{name} = {first} and {last}")]
    ends = [(begin, f"{name} = {first}"), (end, f"{name} = {last}")]
    return [((at[0], at[1]), words) for at, words in ends]
