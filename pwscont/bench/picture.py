"""The work-precision picture: error over time, a panel per problem, a line per stepper.

A wrong answer is a cross: its error says nothing about the stepper's accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pwscont.bench.cases import Case
from pwscont.bench.contestants import NAMES
from pwscont.bench.errors import Errors
from pwscont.bench.measure import Row
from pwscont.bench.report import FLOOR

WIDTH, HEIGHT, LEGEND, MOST_COLUMNS = 3.3, 2.7, 1.2, 4  # inches; panels in a row
SHAPES = dict(zip(NAMES, "*opsD^v", strict=True))
Kind = Callable[[Errors], float]


def branch(errors: Errors) -> float:
    """Return the error of the branch between its stored points."""
    return errors.branch_max


def special(errors: Errors) -> float:
    """Return the larger error of transitions and folds; NaN where there are none."""
    return float(np.fmax(errors.transitions, errors.folds))


def draw(cases: Sequence[Case], rows: Sequence[Row]) -> Figure:
    """Draw errors of branches and of special points over the median time."""
    across = min(MOST_COLUMNS, len(cases))
    down = -(-len(cases) // across)
    size = (max(WIDTH * across, 2.5 * WIDTH), HEIGHT * down + LEGEND)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(down, across, squeeze=False, sharey=True)
    for ax, case in zip(grid.flat, cases, strict=False):
        _panel(ax, case.name, [row for row in rows if row.case == case.name])
    for ax in grid.flat[len(cases) :]:
        ax.set_axis_off()
    for ax in grid[:, 0]:
        ax.set_ylabel("error (part of scale)")
    handles = _legend(rows)
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize="small")
    return figure


def _panel(ax: Axes, title: str, rows: Sequence[Row]) -> None:
    for name in NAMES:
        mine = [row for row in rows if row.stepper == name]
        _line(ax, mine, branch, linestyle="-", markersize=5, **_look(name))
        _line(ax, mine, special, linestyle=":", markersize=4, markerfacecolor="w", **_look(name))
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(0.2 * FLOOR, 5.0)
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("time (ms)")
    ax.set_title(title, fontsize="medium")
    ax.grid(alpha=0.25)


def _look(name: str) -> dict[str, Any]:
    return {"color": f"C{NAMES.index(name)}", "marker": SHAPES[name]}


def _line(ax: Axes, rows: Sequence[Row], kind: Kind, **look: Any) -> None:
    """Draw right answers as a line with the spread of the time, wrong ones as crosses."""
    shown = [row for row in rows if not math.isnan(kind(row.errors))]
    right = [row for row in shown if not row.wrong]
    wrong = [row for row in shown if row.wrong]
    times, low, high = _times(right)
    ax.errorbar(times, _clipped(right, kind), xerr=(low, high), elinewidth=0.7, **look)
    if kind is branch:
        cross = look | {"marker": "x", "linestyle": "none", "markersize": 7}
        ax.plot(_times(wrong)[0], _clipped(wrong, kind), **cross)


def _times(rows: Sequence[Row]) -> tuple[list[float], list[float], list[float]]:
    """Return the medians in milliseconds and how far the other runs reach below and above."""
    low = [1e3 * (row.median - min(row.seconds)) for row in rows]
    high = [1e3 * (max(row.seconds) - row.median) for row in rows]
    return [1e3 * row.median for row in rows], low, high


def _clipped(rows: Sequence[Row], kind: Kind) -> list[float]:
    """Return errors within what is drawn; a branch that is missing has the error one."""
    found = (kind(row.errors) for row in rows)
    return [min(max(e, FLOOR), 1.0) for e in found]


def _legend(rows: Sequence[Row]) -> list[Line2D]:
    used = [name for name in NAMES if any(row.stepper == name for row in rows)]
    lines = [Line2D([], [], label=name, markersize=5, **_look(name)) for name in used]
    black: dict[str, Any] = {"color": "black", "marker": "o"}
    notes = [
        Line2D([], [], markersize=5, label="filled: branch between stored points", **black),
        Line2D(
            [],
            [],
            linestyle=":",
            markersize=4,
            markerfacecolor="w",
            label=f"hollow: transitions and folds; below {FLOOR:.0e} drawn there",
            **black,
        ),
        Line2D([], [], color="black", marker="x", linestyle="none", label="wrong answer"),
    ]
    return [*lines, *notes]
