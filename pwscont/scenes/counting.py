"""Number of solutions and balance over the parameter, as step lines.

Meant to stand under a branch diagram with the same horizontal axis.
"""

from __future__ import annotations

from math import isfinite, nan
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from pwscont.graph import BranchGraph

#: The look of the sum of the signs of det(dH/dz); a branch is missing where the sum changes.
BALANCE: dict[str, Any] = {"color": "#D55E00", "linestyle": "--"}
#: The place of the legend: above the axes, clear of the data.
ABOVE: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 0.98), "ncols": 3}


def is_one_number(graph: BranchGraph) -> bool:
    """Tell whether one number of solutions and one balance hold on the whole interval."""
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
        The same axes. Dots are the counts at single values of alpha, such as folds; dotted lines
        mark vertical pieces, where there are infinitely many.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from pwscont import LCP, draw_counts, explore
    >>> graph = explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))
    >>> draw_counts(graph, Figure().subplots()).get_ylabel()
    'number'
    """
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
    ax.set_ylabel("number")
    ax.legend(fontsize="small", frameon=False, columnspacing=1.0, handlelength=1.5, **ABOVE)
    ax.grid(alpha=0.25)
    return ax
