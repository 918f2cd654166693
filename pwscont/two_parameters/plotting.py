"""Pictures of the plane of two parameters.

Shades stand for the number of solutions. Thick lines are folds, across which this number changes;
thin lines are transitions; points of double lines have infinitely many solutions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.patheffects import Normal, Stroke

from pwscont.extending import Array, number
from pwscont.scenes.styles import in_notation, symbol
from pwscont.two_parameters.axes import PlaneShown
from pwscont.two_parameters.loci import Passing
from pwscont.two_parameters.plane import Meeting, Plane, Region, Sector, area_and_centre
from pwscont.two_parameters.table import how_many

SHADES = {0: "#f4e3d7", 1: "#ffffff", 2: "#e6eef5", 3: "#cfe0ee", 4: "#b5d0e6", 5: "#94bcdb"}
DARKEST, FOLD = "#6fa3cc", "#D55E00"
LINES: dict[Passing, dict[str, Any]] = {
    Passing.FOLD: {"color": FOLD, "linewidth": 2.2, "zorder": 4},
    Passing.TRANSITION: {"color": "0.25", "linewidth": 1.0, "zorder": 3},
    Passing.VERTICAL: {
        "color": "white",
        "linewidth": 1.2,
        "zorder": 4,
        "path_effects": [Stroke(linewidth=3.4, foreground=FOLD), Normal()],
    },
}


DOT: dict[str, Any] = {"marker": "o", "linestyle": "none", "color": "black", "markersize": 4}
MEETINGS = {Meeting.OF_SEVERAL: DOT, Meeting.KINK: DOT | {"markerfacecolor": "white"}}
NAMES = {
    Passing.FOLD: "fold",
    Passing.TRANSITION: "transition",
    Passing.VERTICAL: "infinitely many solutions",
}
#: Least area of a sector's largest region, as a part of the window, for which the sector gets a
#: label.
ROOM = 0.003
#: A named sector with less area than the first part of the window has the label beside the sector,
#: at a distance of the second part of the width.
NARROW, ASIDE = 0.08, 0.22
OFF = 0.05  # least distance of a number from the line at the lowest fold, as a part of the height
MARGIN = 0.12  # left and right of the loci, as a part of the range of the loci
#: More meeting points than this are drawn smaller.
MANY = 20


def draw_plane(scene: PlaneShown, plane: Plane) -> Figure:
    """Return the picture of a plane: sectors with numbers of solutions, and loci in between."""
    figure = Figure(figsize=(6.0, 5.6) if scene.axes.equal else (6.8, 5.0), layout="constrained")
    ax = figure.subplots()
    window = (plane.alphas if scene.axes.equal else _view(plane)), plane.mus
    for sector in plane.sectors:
        for region in sector.regions:
            # the edge hides the seam to the next region of the same shade
            ax.fill(*region.polygon.T, color=_shade(sector), linewidth=0.8, zorder=1)
    for part in (s for some in plane.parts for s in some):
        ax.plot(*part.plane.T, **LINES[part.crossing])
    _mark_meetings(ax, plane)
    _write_names(ax, scene, plane, window)
    _mark_lowest_fold(ax, scene, plane)
    _set_axes(ax, scene, window)
    ax.set_title(f"Guarantee: {plane.guarantee}", fontsize="x-small", wrap=True)
    figure.suptitle(in_notation(scene.title), fontsize="medium")
    handles = _legend(plane)
    columns = len(handles) if len(handles) < 5 else -(-len(handles) // 2)
    style: dict[str, Any] = {"loc": "outside lower center", "fontsize": "small", "frameon": False}
    figure.legend(handles=handles, ncols=columns, **style)
    return figure


def _view(plane: Plane) -> tuple[float, float]:
    """Return the range of alpha in which there are loci, with a margin."""
    parts = [s.plane for some in plane.parts for s in some]
    if not parts:
        return plane.alphas
    points = np.vstack(parts)
    lo, hi = points[:, 0].min(), points[:, 0].max()
    margin = MARGIN * (hi - lo)
    return max(lo - margin, plane.alphas[0]), min(hi + margin, plane.alphas[1])


def _shade(sector: Sector) -> str:
    return SHADES.get(int(sector.count), DARKEST) if np.isfinite(sector.count) else DARKEST


def _mark_meetings(ax: Axes, plane: Plane) -> None:
    found = list(plane.meetings())
    smaller = {"markersize": 2.5} if len(found) > MANY else {}
    for meeting, point in found:
        ax.plot(*point, zorder=5, **MEETINGS[meeting] | smaller)


def _write_names(
    ax: Axes, scene: PlaneShown, plane: Plane, window: tuple[tuple[float, float], ...]
) -> None:
    """Write name, cells and number of solutions into each sector, or beside a narrow sector."""
    width, height = np.ptp(window, axis=1)
    for sector in plane.sectors:
        polygons = [_clipped(region.polygon, window[0]) for region in sector.regions]
        sizes = [area_and_centre(polygon) for polygon in polygons]
        if max(area for area, _ in sizes) < ROOM * width * height:
            continue
        largest = int(np.argmax([area for area, _ in sizes]))
        at = _centre(sizes) if scene.sectors else _within(sector.regions[largest], sizes[largest])
        narrow = scene.sectors and sum(area for area, _ in sizes) < NARROW * width * height
        if scene.lowest_fold and plane.lowest_folds:
            at = _off_line(at, float(plane.lowest_folds[0][-1]), OFF * height, sector.regions)
        caption = _caption(scene, sector, "\n" if narrow else " / ")
        _write(ax, caption, at, ASIDE * width if narrow else 0.0, _shade(sector))


def _write(ax: Axes, text: str, at: Array, aside: float, shade: str) -> None:
    """Write a text over the lines at a point, or beside the point with a line to the point."""
    box = {"facecolor": shade, "edgecolor": "none", "pad": 0.8}
    line = {"arrowstyle": "-", "linewidth": 0.7, "shrinkA": 2, "shrinkB": 0}
    ax.annotate(
        text,
        (at[0], at[1]),
        (at[0] + aside, at[1]),
        arrowprops=line if aside else None,
        ha="center",
        va="center",
        fontsize="small",
        bbox=None if aside else box,
        zorder=6,
    )


def _clipped(polygon: Array, alphas: tuple[float, float]) -> Array:
    """Return a polygon with alphas clipped to the view, exact enough for a polygon of curves."""
    return np.column_stack([polygon[:, 0].clip(*alphas), polygon[:, 1]])


def _within(region: Region, size: tuple[float, Array]) -> Array:
    """Return the centre of a region, or a point in the widest part if the centre lies outside."""
    _, centre = size
    contains = Path(region.polygon).contains_points(centre[np.newaxis])[0]
    return centre if contains else region.inside


def _off_line(at: Array, mu: float, apart: float, regions: Sequence[Region]) -> Array:
    """Return a place in the same sector, below or above the line at mu, if a place is too near."""
    if abs(at[1] - mu) >= apart:
        return at
    places = np.array([[at[0], mu - apart], [at[0], mu + 2.0 * apart]])  # words stand above
    inside = [Path(region.polygon).contains_points(places) for region in regions]
    return next((p for p, is_in in zip(places, np.any(inside, axis=0), strict=True) if is_in), at)


def _centre(sizes: list[tuple[float, Array]]) -> Array:
    """Return the common centre of several polygons."""
    areas, centres = zip(*sizes, strict=True)
    return np.average(centres, axis=0, weights=areas)


def _caption(scene: PlaneShown, sector: Sector, between: str) -> str:
    name = scene.sector_name(sector)
    if not name:
        return number(sector.count)
    return f"{name}\n{between.join(sector.labels)}\n{how_many(sector)}"


def _mark_lowest_fold(ax: Axes, scene: PlaneShown, plane: Plane) -> None:
    """Draw a line at the smallest mu on all folds, and a dot where folds begin."""
    if not scene.lowest_fold or not plane.lowest_folds:
        return
    mu = float(plane.lowest_folds[0][-1])
    ax.axhline(mu, color="0.25", linestyle=(0, (4, 3)), linewidth=0.8, zorder=2)
    for tip in plane.lowest_folds:
        ax.plot(*tip[-2:], "o", color=FOLD, markersize=6, zorder=5)
    ax.annotate(
        f"{scene.lowest_fold} = {number(mu)}",
        (0.985, mu),
        (0, 4),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        fontsize="small",
    )


def _set_axes(ax: Axes, scene: PlaneShown, window: tuple[tuple[float, float], ...]) -> None:
    axes = scene.axes
    ax.set_xlim(*(window[0][::-1] if axes.to_the_left else window[0]))
    ax.set_ylim(*window[1])
    ax.set_xlabel(symbol(axes.alpha))
    ax.set_ylabel(symbol(axes.mu), rotation=0 if len(axes.mu) < 4 else 90)
    if axes.equal:
        ax.set_aspect("equal")


def _legend(plane: Plane) -> list[Any]:
    """Return a handle for each kind of line and point, and each number of solutions."""
    crossings = {s.crossing for some in plane.parts for s in some}
    lines = [Line2D([], [], label=NAMES[c], **LINES[c]) for c in Passing if c in crossings]
    shades = {sector.count: sector for sector in plane.sectors}
    patches = [
        Patch(facecolor=_shade(shades[n]), edgecolor="0.6", label=how_many(shades[n]))
        for n in sorted(shades)
    ]
    found = {meeting for meeting, _ in plane.meetings()}
    dots = [Line2D([], [], label=m.value, **MEETINGS[m]) for m in Meeting if m in found]
    return [*lines, *dots, *patches]
