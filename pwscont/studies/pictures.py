"""Pictures of a study: a line over one setting, a map over two, several maps over three.

Cases whose graphs are not complete are hollow dots, or hatched: counts of such cases are least
numbers. Failed cases are crosses; cases with nothing to measure are gaps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import ceil, sqrt
from typing import Any, TypeAlias, final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from pwscont import InvalidInputError
from pwscont.scenes.styles import COLORS, number_of, symbol
from pwscont.studies.problem import Setting

#: The name of a column -> a masked array.
Column: TypeAlias = Callable[[str], Any]
#: Most different whole numbers that are drawn with a colour for each number.
FEW = 9
#: Most maps in a single row (more maps stand in a square), and most maps in a picture.
ACROSS, MOST_MAPS = 3, 12
#: Colours of counts: one solution is nearly white, more solutions are darker.
SHADES = "YlGnBu"
NOTHING = "0.88"
CROSS: dict[str, Any] = {"marker": "x", "linestyle": "none", "color": COLORS[1]}
HATCH: dict[str, Any] = {"facecolor": "none", "edgecolor": "0.35", "hatch": "///", "linewidth": 0}
ENDLESS: dict[str, Any] = {"marker": "$∞$", "linestyle": "none", "color": "black", "markersize": 11}
#: Most ticks of an axis for values that are texts.
MOST_WORDS = 12


@final
class Drawing:
    """A measure over the settings that have several values.

    Attributes
    ----------
    name : str
    over : dict of str to tuple
        The values of each setting with several values.
    values, unproven, failed : ndarray
        Arrays with one axis for each setting.
    """

    def __init__(self, name: str, over: Mapping[str, Sequence[Setting]], column: Column) -> None:
        self.name = name
        self.over = {n: values for n, values in over.items() if len(values) > 1}
        shape = tuple(map(len, self.over.values()))
        values = column(name).reshape(shape)
        if values.dtype == object and not values.mask.all():
            raise InvalidInputError(f"{name} cannot be drawn: its values are no numbers")
        self.values: Any = np.ma.masked_array(values.filled(0).astype(float), values.mask)
        failures, proven = column("failure"), column("proven")
        self.failed = np.asarray(failures.filled("") != "").reshape(shape)
        self.unproven = ~np.asarray(proven.filled(True)).astype(bool).reshape(shape) & ~self.failed

    @property
    def levels(self) -> npt.NDArray[np.float64] | None:
        """The different values, if all values are whole or infinite and few differ; else None."""
        found = np.unique(self.values.compressed())
        finite = found[np.isfinite(found)]
        few = len(found) <= FEW and bool((finite == finite.round()).all())
        return found if few and len(found) else None


def draw_study(
    name: str, over: Mapping[str, Sequence[Setting]], column: Column, figure: Figure | None
) -> Figure:
    """Draw a measure, for :meth:`pwscont.StudyResult.plot`.

    Parameters
    ----------
    name : str
    over : mapping of str to sequence
        The values of each setting.
    column : callable
        Name -> column of the table, one axis for each setting, masked.
    figure : matplotlib.figure.Figure or None
        The figure to draw into; None for a new figure of pyplot.
    """
    drawing, draw = Drawing(name, over, column), {1: _lines, 2: _maps, 3: _maps}
    count = len(drawing.over)
    if count not in draw:
        raise InvalidInputError(f"pictures are over one to three settings that vary, not {count}")
    figure = plt.figure() if figure is None else figure
    figure.set_layout_engine("constrained")
    draw[count](drawing, figure)
    return figure


def _lines(drawing: Drawing, figure: Figure) -> None:
    figure.set_size_inches(6.4, 3.8)
    ax = figure.subplots()
    (name, values), y = next(iter(drawing.over.items())), drawing.values
    places = _places(values)
    finite = np.ma.masked_where(~np.isfinite(y.filled(0.0)), y)
    line = "-" if _is_scale(values) else "none"
    for found, face in ((finite, COLORS[0]), (np.ma.masked_where(~drawing.unproven, finite), "w")):
        ax.plot(places, found, "o", color=COLORS[0], markerfacecolor=face, markersize=4, zorder=3)
    ax.plot(places, finite, linestyle=line, color=COLORS[0])
    endless = np.isinf(y.filled(0.0))
    _across_the_top(ax, places[endless], ENDLESS)
    _across_the_top(ax, places[drawing.failed], CROSS)
    if drawing.levels is not None:
        ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    ends = _edges(values)
    ax.set(xlabel=symbol(name), ylabel=drawing.name, xlim=(ends.min(), ends.max()))
    ax.margins(y=0.15)
    _set_ticks(ax.set_xticks, values)
    ax.grid(alpha=0.25)
    _place_legend(figure, _line_marks(drawing))


def _across_the_top(ax: Axes, places: npt.NDArray[np.float64], mark: dict[str, Any]) -> None:
    ax.plot(places, np.full(len(places), 0.96), transform=ax.get_xaxis_transform(), **mark)


def _line_marks(drawing: Drawing) -> list[Any]:
    hollow = {"marker": "o", "linestyle": "none", "color": COLORS[0], "markerfacecolor": "w"}
    marks = [(drawing.unproven, "not proven", hollow), (drawing.failed, "failed", CROSS)]
    return [Line2D([], [], label=words, **mark) for where, words, mark in marks if where.any()]


def _maps(drawing: Drawing, figure: Figure) -> None:
    """Draw a map for each value of the first of three settings, one map for two settings."""
    *outer, y, x = drawing.over
    panels = _spread(len(drawing.over[outer[0]])) if outer else [()]
    columns = len(panels) if len(panels) <= ACROSS else ceil(sqrt(len(panels)))
    rows = -(-len(panels) // columns)
    size = (6.4, 4.6) if not outer else (2.0 + 3.0 * columns, 1.0 + 2.7 * rows)
    figure.set_size_inches(size)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    colours = _colours(drawing)
    for ax, panel in zip(axes.flat, panels, strict=False):
        image = _map(ax, drawing, panel, colours)
        if outer:
            ax.set_title(f"{outer[0]} = {_word(drawing.over[outer[0]][panel])}", fontsize="small")
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
    for place, ax in enumerate(axes.flat[: len(panels)]):
        _label(ax, (x, y), below=place + columns >= len(panels), left=place % columns == 0)
    if drawing.levels is None:
        figure.colorbar(image, ax=axes, label=drawing.name)
    else:
        figure.suptitle(drawing.name, fontsize="medium")
    _place_legend(figure, _map_marks(drawing, colours))


def _spread(count: int) -> list[Any]:
    """Return the places of the values that get a map: all, or ``MOST_MAPS`` evenly spread."""
    places = np.linspace(0, count - 1, min(count, MOST_MAPS)).round().astype(int)
    return [int(place) for place in places]


def _map(ax: Axes, drawing: Drawing, panel: Any, colours: tuple[Colormap, Normalize]) -> Any:
    (_, down), (_, across) = list(drawing.over.items())[-2:]
    edges = _edges(across), _edges(down)
    colormap, norm = colours
    ax.set_facecolor(NOTHING)
    values = drawing.values[panel]
    image = ax.pcolormesh(*edges, _shown(drawing, values), cmap=colormap, norm=norm)
    places = _places(across), _places(down)
    rows, columns = np.nonzero(drawing.failed[panel])
    ax.plot(places[0][columns], places[1][rows], **CROSS)
    for row, column in zip(*np.nonzero(drawing.unproven[panel]), strict=True):
        corner = edges[0][column], edges[1][row]
        size = edges[0][column + 1] - corner[0], edges[1][row + 1] - corner[1]
        ax.add_patch(mpl.patches.Rectangle(corner, *size, **HATCH))
    _set_ticks(ax.set_xticks, across)
    _set_ticks(ax.set_yticks, down)
    return image


def _label(ax: Axes, names: tuple[str, str], below: bool, left: bool) -> None:
    """Write the names of the settings at the left and the lower edge of the picture."""
    ax.set(xlabel=symbol(names[0]) if below else "", ylabel=symbol(names[1]) if left else "")
    ax.tick_params(labelbottom=below)


def _shown(drawing: Drawing, values: Any) -> Any:
    """Return for whole numbers the places among the levels; leave values on a scale unchanged."""
    if drawing.levels is None:
        return np.ma.masked_where(np.isinf(values.filled(0.0)), values)
    return np.ma.masked_array(np.searchsorted(drawing.levels, values.filled(0.0)), values.mask)


def _colours(drawing: Drawing) -> tuple[Colormap, Normalize]:
    """Return a colour for each whole number, or a scale of colours."""
    if (levels := drawing.levels) is None:
        finite = drawing.values.compressed()
        finite = finite[np.isfinite(finite)] if len(finite) else np.zeros(1)
        return mpl.colormaps["viridis"], Normalize(finite.min(), finite.max())
    shades = mpl.colormaps[SHADES](np.linspace(0.04, 0.75, len(levels)))
    return ListedColormap(shades), BoundaryNorm(np.arange(len(levels) + 1) - 0.5, len(levels))


def _map_marks(drawing: Drawing, colours: tuple[Colormap, Normalize]) -> list[Any]:
    marks: list[Any] = []
    levels = [] if drawing.levels is None else drawing.levels.tolist()
    for place, level in enumerate(levels):
        colour = colours[0](colours[1](place))
        words = "∞" if np.isinf(level) else f"{level:g}"
        marks.append(Patch(facecolor=colour, edgecolor="0.6", label=words))
    if (drawing.values.mask & ~drawing.failed).any():
        marks.append(Patch(facecolor=NOTHING, edgecolor="0.6", label="nothing"))
    if drawing.unproven.any():
        marks.append(Patch(**HATCH | {"linewidth": 0.5}, label="not proven"))
    if drawing.failed.any():
        marks.append(Line2D([], [], label="failed", **CROSS))
    return marks


def _is_scale(values: Sequence[Setting]) -> bool:
    return not any(isinstance(value, bool | str) for value in values)


def _places(values: Sequence[Setting]) -> npt.NDArray[np.float64]:
    """Return the places of values on an axis: numbers at the numbers, texts at 0, 1, 2, ..."""
    return np.array(values if _is_scale(values) else range(len(values)), dtype=float)


def _edges(values: Sequence[Setting]) -> npt.NDArray[np.float64]:
    """Return the edges of the cells around values: midway between neighbours."""
    places = _places(values)
    between = [0.5 * (a + b) for a, b in pairwise(places)]
    return np.array([2 * places[0] - between[0], *between, 2 * places[-1] - between[-1]])


def _set_ticks(set_ticks: Any, values: Sequence[Setting]) -> None:
    if not _is_scale(values):
        every = -(-len(values) // MOST_WORDS)
        places = range(0, len(values), every)
        set_ticks(places, [_word(values[place]) for place in places])


def _word(value: Setting) -> str:
    return number_of(value) if isinstance(value, float) else str(value)


def _place_legend(figure: Figure, marks: list[Any]) -> None:
    if marks:
        look: dict[str, Any] = {"ncols": min(len(marks), 6), "fontsize": "small"}
        figure.legend(handles=marks, loc="outside lower center", frameon=False, **look)
