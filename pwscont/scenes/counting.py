"""Number of solutions and balance over the parameter, as step lines.

Meant to stand under a branch diagram with the same horizontal axis.
"""

from __future__ import annotations

from math import isfinite

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from pwscont.graph import BranchGraph


def draw_counts(graph: BranchGraph, ax: Axes) -> Axes:
    """Draw the number of solutions and the sum of signs of det(dH/dz).

    Parameters
    ----------
    graph : BranchGraph
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
        The same axes. Dots are the counts at single values of alpha, such as folds; dotted lines
        mark vertical pieces, where there are infinitely many.
    """
    edges = [graph.interval[0], *(hi for _, hi, _ in graph.multiplicity())]
    counts = [count for _, _, count in graph.multiplicity()]
    ax.stairs(counts, edges, baseline=None, color="black", label="solutions")
    single = [alpha for alpha in edges[1:-1] if isfinite(graph.count(alpha))]
    ax.plot(single, [graph.count(alpha) for alpha in single], "o", color="black", markersize=4)
    breaks = graph.breaks()
    ax.stairs(graph.balances(), breaks, baseline=None, color="C3", linestyle="--", label="balance")
    for alpha in {piece.interval[0] for piece in graph.pieces if piece.is_vertical}:
        ax.axvline(alpha, color="black", linestyle=":", linewidth=1.0)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    ax.set_ylabel("number")
    ax.legend(fontsize="small")
    ax.grid(alpha=0.25)
    return ax
