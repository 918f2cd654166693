"""The work-precision picture: error over time, a panel per problem, a line per stepper.

A wrong answer is a cross: the error of a wrong answer says nothing about the stepper's accuracy.
Rows of further programs are lines, too, named after the programs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pwscont.bench.contestants import NAMES
from pwscont.bench.errors import Errors
from pwscont.bench.measure import Row
from pwscont.bench.report import FLOOR

WIDTH, HEIGHT, MOST_COLUMNS = 3.3, 2.7, 4  # inches; panels in a row
MOST_LABELLED = 200.0  # largest ratio of the shown times with room for labels at 3, 30
LEGEND, LEGEND_ROW, LEGEND_COLUMNS = 0.3, 0.22, 3  # inches, inches a row, and number
LEAST_WIDTH = 10.0  # inches, for the three columns of the legend
COLOURS = [*(f"C{i}" for i in range(7)), *map(to_hex, colormaps["Dark2"](np.arange(7)))]
#: Looks by the place of a name in ``NAMES``, so that a stepper always has the same look; further
#: programs take looks that are free.
LOOKS = [{"color": c, "marker": m} for c, m in zip(COLOURS, "*opsD^vP<>hd8H", strict=True)]
Kind = Callable[[Errors], float]
Look = dict[str, Any]


def branch(errors: Errors) -> float:
    """Return the error of the branch between the stored points."""
    return errors.branch_max


def special(errors: Errors) -> float:
    """Return the larger error of transitions and folds; NaN without transitions and folds."""
    return float(np.fmax(errors.transitions, errors.folds))


def draw(problems: Sequence[str], rows: Sequence[Row], columns: int = MOST_COLUMNS) -> Figure:
    """Return the picture of errors over the median time, a panel for each problem."""
    across = min(columns, len(problems))
    down = -(-len(problems) // across)
    looks, handles = _looks(rows), _legend(rows)
    legend = LEGEND + LEGEND_ROW * -(-len(handles) // LEGEND_COLUMNS)
    size = (max(WIDTH * across, LEAST_WIDTH), HEIGHT * down + legend)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(down, across, squeeze=False, sharey=True)
    for ax, name in zip(grid.flat, problems, strict=False):
        _panel(ax, name, [row for row in rows if row.case == name], looks)
    for ax in grid.flat[len(problems) :]:
        ax.set_axis_off()
    for ax in grid[:, 0]:
        ax.set_ylabel("error (part of scale)")
    where: dict[str, Any] = {"loc": "outside lower center", "ncols": LEGEND_COLUMNS}
    figure.legend(handles=handles, fontsize="small", **where)
    return figure


def _panel(ax: Axes, title: str, rows: Sequence[Row], looks: Mapping[str, Look]) -> None:
    for name, look in looks.items():
        mine = [row for row in rows if row.stepper == name]
        _line(ax, mine, branch, linestyle="-", markersize=5, **look)
        _line(ax, mine, special, linestyle=":", markersize=4, markerfacecolor="w", **look)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(0.2 * FLOOR, 5.0)
    ax.xaxis.set_major_locator(LogLocator(subs=_labelled(*ax.get_xlim())))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(axis="x", labelsize="small")
    ax.set_xlabel("time (ms)")
    ax.set_title(title, fontsize="medium")
    ax.grid(alpha=0.25)


def _labelled(low: float, high: float) -> tuple[float, ...]:
    """Return the multiples of powers of ten that get labels between two times, without overlap."""
    return (1.0, 3.0) if high < MOST_LABELLED * low else (1.0,)


def _looks(rows: Sequence[Row]) -> dict[str, Look]:
    """Return colour and marker of every name that occurs, steppers first."""
    found = dict.fromkeys(row.stepper for row in rows)
    own = {name: look for name, look in zip(NAMES, LOOKS, strict=False) if name in found}
    free = [look for look in LOOKS if look not in own.values()]
    others = [name for name in found if name not in own]
    return own | dict(zip(others, cycle(free), strict=False))


def _line(ax: Axes, rows: Sequence[Row], kind: Kind, **look: Any) -> None:
    """Draw right answers as a line with the spread of the time, wrong answers as crosses."""
    shown = [row for row in rows if not math.isnan(kind(row.errors))]
    right = sorted((row for row in shown if not row.wrong), key=lambda row: row.median)
    wrong = [row for row in shown if row.wrong]
    times, low, high = _times(right)
    ax.errorbar(times, _clipped(right, kind), xerr=(low, high), elinewidth=0.7, **look)
    if kind is branch:
        cross = look | {"marker": "x", "linestyle": "none", "markersize": 7}
        ax.plot(_times(wrong)[0], _clipped(wrong, kind), **cross)


def _times(rows: Sequence[Row]) -> tuple[list[float], list[float], list[float]]:
    """Return the medians in milliseconds, and the distances of the fastest and slowest run."""
    low = [1e3 * (row.median - min(row.seconds)) for row in rows]
    high = [1e3 * (max(row.seconds) - row.median) for row in rows]
    return [1e3 * row.median for row in rows], low, high


def _clipped(rows: Sequence[Row], kind: Kind) -> list[float]:
    """Return errors clipped to the range of the picture; a missing branch has the error 1."""
    found = (kind(row.errors) for row in rows)
    return [min(max(e, FLOOR), 1.0) for e in found]


def _legend(rows: Sequence[Row]) -> list[Line2D]:
    looks = _looks(rows).items()
    lines = [Line2D([], [], label=name, markersize=5, **look) for name, look in looks]
    black: dict[str, Any] = {"color": "black", "marker": "o"}
    notes = [
        Line2D([], [], markersize=5, label="filled: branch between stored points", **black),
        Line2D(
            [],
            [],
            linestyle=":",
            markersize=4,
            markerfacecolor="w",
            label=f"hollow: transitions and folds (at least {FLOOR:.0e})",
            **black,
        ),
        Line2D([], [], color="black", marker="x", linestyle="none", label="wrong answer"),
    ]
    return [*lines, *notes]
