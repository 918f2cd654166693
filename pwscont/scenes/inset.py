"""An inset that enlarges crowded folds, which fill a small part of the axis."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from pwscont.basics.arrays import Array
from pwscont.basics.kind import Kind
from pwscont.scenes.diagram import Diagram
from pwscont.scenes.labels import LETTERS, label_marks
from pwscont.scenes.marks import Window
from pwscont.scenes.room import Room

FOLDS = (Kind.FOLD, Kind.NONSMOOTH_FOLD)
#: Folds that fill less than the first part of the axis are enlarged, if two of them are closer to
#: each other than the second part of the picture.
SMALL, CROWDED = 0.12, 0.05
#: A branch that fills less than this part of the axis is a stub, and enlarged.
STUB = 0.06
#: Margins of an inset beside the folds, and above and below the lines, where labels have room: as
#: parts of their extent.
MARGIN, ABOVE = 0.25, 0.5
#: Sizes of an inset, and the room of its numbers to the left and below, as parts of the axes.
SIZES = ((0.62, 0.56), (0.56, 0.5), (0.5, 0.45), (0.45, 0.4), (0.45, 0.33), (0.6, 0.28))
NUMBERS = 0.13, 0.11
POINTS = 101
#: The colour of the frames around the inset and around the part that it enlarges.
FRAME = "0.55"


def draw_inset(ax: Axes, diagram: Diagram, room: Room) -> Window | None:
    """Enlarge crowded folds and short branches of a diagram, if the diagram has room.

    Returns
    -------
    tuple or None
        Limits of the parameter and of the quantity in the inset.
    """
    window = None if diagram.across else _window(ax, diagram, room)
    box = room.largest(SIZES) if window else None
    if window is None or box is None:
        return None
    room.take(box)
    left, bottom, width, height = box
    aside, below = NUMBERS
    inset = ax.inset_axes((left + aside, bottom + below, width - aside - 0.02, height - below))
    diagram.draw(inset)
    inset.set(xlim=window[0], ylim=window[1])
    inset.tick_params(labelsize=LETTERS - 1.0, length=2.0, pad=1.5)
    inset.locator_params(nbins=4)
    inset.grid(alpha=0.25)
    inset.spines[:].set_color(FRAME)
    (lo, hi), (bottom, top) = window
    ax.indicate_inset((lo, bottom, hi - lo, top - bottom), edgecolor=FRAME, alpha=1.0)
    enlarged = [mark for mark in diagram.marks if mark.is_within(window)]
    label_marks(inset, enlarged, diagram.room(inset))
    return window


def _window(ax: Axes, diagram: Diagram, room: Room) -> Window | None:
    """Return the limits around the crowded folds of a branch; None where there are none."""
    for branch in dict.fromkeys(mark.branch for mark in diagram.marks):
        marks = [mark for mark in diagram.marks if mark.branch == branch and mark.kind in FOLDS]
        folds = np.array([mark.at for mark in marks]).reshape(-1, 2)
        if _are_crowded(room.part(folds)):
            return _around(ax, diagram, folds[:, 0])
    return _around_stubs(ax, diagram, room)


def _around_stubs(ax: Axes, diagram: Diagram, room: Room) -> Window | None:
    """Return the limits around branches that are too short to be seen; None without any."""
    found: dict[int, list[Array]] = {}
    for stroke in diagram.strokes:
        found.setdefault(stroke.branch, []).append(stroke.points)
    extents = [_extent(np.concatenate(points)) for points in found.values()]
    lo, hi = np.array(ax.get_xlim())
    stubs = [alphas for alphas in extents if np.ptp(alphas) < STUB * (hi - lo)]
    if not stubs or np.ptp(np.concatenate(stubs)) > SMALL * (hi - lo):
        return None
    return _around(ax, diagram, np.concatenate(stubs))


def _extent(points: Array) -> Array:
    return np.array([points[:, 0].min(), points[:, 0].max()])


def _are_crowded(parts: Array) -> bool:
    """Tell whether folds, in parts of the picture, are hard to tell apart."""
    if len(parts) < 2 or np.ptp(parts[:, 0]) > SMALL:
        return False
    distances = np.linalg.norm(parts[:, np.newaxis] - parts, axis=2)
    return bool(distances[np.triu_indices(len(parts), 1)].min() < CROWDED)


def _around(ax: Axes, diagram: Diagram, alphas: Array) -> Window | None:
    """Return the limits around folds at these values of the parameter, within the picture."""
    margin = MARGIN * float(np.ptp(alphas))
    left, right = ax.get_xlim()
    lo, hi = max(float(alphas.min()) - margin, left), min(float(alphas.max()) + margin, right)
    found = np.concatenate([_values_within(s.points, lo, hi) for s in diagram.strokes])
    extent, (bottom, top) = float(np.ptp(found)), ax.get_ylim()
    low, high = float(found.min()) - ABOVE * extent, float(found.max()) + ABOVE * extent
    return ((lo, hi), (max(low, bottom), min(high, top))) if margin and extent else None


def _values_within(points: Array, lo: float, hi: float) -> Array:
    """Return the values of a line where its parameter lies in an interval."""
    t = np.linspace(0.0, len(points) - 1.0, POINTS * (len(points) - 1) + 1)
    alpha, values = (np.interp(t, np.arange(len(points)), column) for column in points.T)
    within: Array = values[(alpha >= lo) & (alpha <= hi)]
    return within
