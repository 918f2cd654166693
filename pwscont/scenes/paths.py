"""Companion pictures: load paths, and numbers of solutions.

The diagram of numbers stands under a branch diagram with the same horizontal axis.
"""

from __future__ import annotations

from math import isfinite, nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from pwscont import BranchGraph
from pwscont.extending import Array, checked_kind
from pwscont.scenes.labels import LETTERS
from pwscont.scenes.panels import ParameterPath
from pwscont.scenes.styles import number_of, symbol

POINTS = 201  # of a drawn path
#: A path whose extent is less than this part of the largest coordinate is a point.
AT_REST = 1e-9


def points_of(graph: BranchGraph, path: ParameterPath) -> Array:
    """Return points along a path, shape (k, 2)."""
    alphas = np.linspace(*graph.interval, POINTS)
    return np.array([path.curve(float(alpha)) for alpha in alphas])


def is_at_rest(graph: BranchGraph, path: ParameterPath) -> bool:
    """Tell whether a path stays at a point over the whole interval."""
    points = points_of(graph, path)
    return bool(np.ptp(points, axis=0).max() <= AT_REST * np.abs(points).max())


def draw_path(ax: Axes, graph: BranchGraph, path: ParameterPath) -> None:
    """Draw a path with an arrow for the direction, and the parameter at the ends."""
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
    """Return the ends of a path, each with a label; a single end and label for a closed path."""
    first, last = (number_of(end, graph.interval) for end in graph.interval)
    name = symbol(graph.parameter)
    begin, end = (tuple(map(float, points[i])) for i in (0, -1))
    if np.abs(points[0] - points[-1]).max() <= AT_REST * np.abs(points).max():
        return [((begin[0], begin[1]), f"{name} = {first} and {last}")]
    ends = [(begin, f"{name} = {first}"), (end, f"{name} = {last}")]
    return [((at[0], at[1]), words) for at, words in ends]


#: The look of the sum of the signs of det(dH/dz); a branch is missing where the sum changes.
BALANCE: dict[str, Any] = {"color": "#D55E00", "linestyle": "--"}
#: The place of the legend: above the axes, clear of the data.
ABOVE: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 0.98), "ncols": 3}


def is_one_number(graph: BranchGraph) -> bool:
    """Tell whether the number of solutions and the balance are constant on the interval."""
    vertical = any(piece.is_vertical for piece in graph.pieces)
    return len(graph.multiplicity()) == 1 and len(graph.balance_values()) == 1 and not vertical


def draw_counts(graph: BranchGraph, ax: Axes) -> Axes:
    """Draw the number of solutions and the sum of signs of det(dH/dz).

    Parameters
    ----------
    graph : BranchGraph
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
        The given axes. Dots are the counts at single values of alpha, such as folds; dotted lines
        mark vertical pieces, which have infinitely many solutions at one alpha.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from pwscont import LCP, draw_counts, explore
    >>> graph = explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))
    >>> draw_counts(graph, Figure().subplots()).get_ylabel()
    'number'
    """
    checked_kind("graph", graph, BranchGraph, is_needed=True)
    checked_kind("ax", ax, Axes, is_needed=True)
    stretches = [stretch for stretch in graph.multiplicity() if stretch[0] < stretch[1]]
    edges = [graph.interval[0], *(hi for _, hi, _ in stretches)]
    counts = [count if isfinite(count) else nan for _, _, count in stretches]
    ax.stairs(counts, edges, baseline=None, color="black", label="solutions")
    single = [alpha for alpha in edges[1:-1] if isfinite(graph.count(alpha))]
    ax.plot(single, [graph.count(alpha) for alpha in single], "o", color="black", markersize=4)
    breaks = graph.breaks()
    ax.stairs(graph.balances(), breaks, baseline=None, label="balance (sum of signs)", **BALANCE)
    vertical = {piece.interval[0] for piece in graph.pieces if piece.is_vertical}
    for alpha, words in zip(vertical, ["∞", *["_"] * len(vertical)], strict=False):
        ax.axvline(alpha, color="black", linestyle=":", linewidth=1.0, label=words)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    ax.set(xlabel=symbol(graph.parameter), ylabel="number")
    ax.legend(fontsize="small", frameon=False, columnspacing=1.0, handlelength=1.5, **ABOVE)
    ax.grid(alpha=0.25)
    return ax
