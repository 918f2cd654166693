"""Pictures of solutions on the body; imported when a user asks for a picture.

Above, the deformed body, with displacements and gaps magnified alike. A disc is a node that sticks,
an arrow a node that slips (in the direction in which the body has moved), a ring an open node.
Below, pressure and shear along the boundary: where the shear meets the dashed friction bound, the
node slips or is about to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pwscont import InvalidInputError
from pwscont.extending import Array
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.placement import Placement, magnification, parts_of
from pwscont_coulomb.elastic.recovery import BodyState
from pwscont_coulomb.elastic.units import UNITLESS, Units
from pwscont_coulomb.modes import Mode

#: Most elements of a mesh that is drawn with the lines between elements.
MANY = 1500
COLUMN, CURVE_ROW = 4.6, 2.6  # inches
CURVES = ("pressure", "shear", "friction bound")
BLACK, SLIP, PRESSURE, SHEAR, BOUND = "black", "#D55E00", "#0072B2", "#E69F00", "0.4"


def draw_states(
    body: DiscretisedBody,
    states: Sequence[BodyState],
    titles: Sequence[str] = (),
    *,
    scale: float | None = None,
    units: Units = UNITLESS,
) -> Figure:
    """Draw solutions side by side, in the same scales.

    Parameters
    ----------
    body : DiscretisedBody
    states : sequence of BodyState
    titles : sequence of str, optional
        The title of each state; default the parameter and how many nodes are in which mode.
    scale : float, optional
        Factor by which displacements are enlarged; the default makes small displacements visible.
    units : Units, optional
        The units of lengths and stresses.

    Returns
    -------
    matplotlib.figure.Figure
        ``figure.savefig(...)`` writes the picture.

    Raises
    ------
    InvalidInputError
        If there is no state, or another number of titles.
    """
    if not states:
        raise InvalidInputError("there is no solution to draw")
    names = list(titles) or [summary(state) for state in states]
    if len(names) != len(states):
        raise InvalidInputError(f"{len(names)} titles for {len(states)} states")
    rows, width = [_body_row(body), CURVE_ROW], COLUMN * len(states) + 0.8
    figure = Figure(figsize=(width, sum(rows) + 0.5), layout="constrained")
    axes = figure.subplots(
        2, len(states), squeeze=False, sharex="row", sharey="row", height_ratios=rows
    )
    norm = Normalize(0.0, strongest(states))
    placement = Placement.of(body, scale or magnification(body, states))
    for column, (state, title) in enumerate(zip(states, names, strict=True)):
        draw_body(axes[0, column], placement, state, norm)
        draw_boundary(axes[1, column], body, state, units)
        axes[0, column].set_title(title, fontsize="medium")
        axes[1, column].label_outer()
    label = units.with_stress("largest shear stress")
    figure.colorbar(ScalarMappable(norm, "Blues"), ax=axes[0].tolist(), label=label, aspect=30)
    figure.legend(handles=legend(), loc="outside lower center", ncols=4, fontsize="small")
    figure.suptitle(placement.words(), fontsize="medium")
    return figure


def _body_row(body: DiscretisedBody) -> float:
    """Return the height for a body of this shape (inches)."""
    wide, high = np.ptp(body.positions, axis=1)
    return float(np.clip(COLUMN * (high / wide + 0.15), 1.5, 1.2 * COLUMN))


def summary(state: BodyState) -> str:
    """Return parameter and number of nodes in each mode, such as ``α = 1: 12 stick, ...``."""
    counts = {mode.word: int(np.count_nonzero(state.modes == mode)) for mode in Mode}
    found = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    name = "α" if state.parameter == "alpha" else state.parameter
    return f"{name} = {state.alpha:.6g}: {found}"


def strongest(states: Sequence[BodyState]) -> float:
    """Return the largest shear stress in several states; 1 where there is none."""
    return max(float(largest_shear(state.stresses).max()) for state in states) or 1.0


def largest_shear(stresses: Array) -> Array:
    """Return the largest shear stress in the plane of each element."""
    xx, yy, xy = stresses
    shear: Array = np.hypot(0.5 * (xx - yy), xy)
    return shear


def draw_body(ax: Axes, placement: Placement, state: BodyState, norm: Normalize) -> None:
    """Draw the deformed body, coloured by shear stress, with contact states and obstacle."""
    body, moved = placement.body, placement.moved(state)
    mesh, contact = body.space.mesh, body.contact
    corners = moved.T[body.space.element_nodes[: mesh.t.shape[0]].T]
    lines = 0.3 if mesh.nelements <= MANY else 0.0
    elements = PolyCollection(
        list(corners), cmap="Blues", norm=norm, edgecolor="0.45", linewidth=lines
    )
    elements.set_array(largest_shear(state.stresses))
    ax.add_collection(elements)
    for line, outline in placement.outlines():
        ax.fill(*outline, facecolor="0.8", edgecolor="none", zorder=0)
        ax.plot(*line, color="0.3", linewidth=1.0, zorder=1)
    ax.plot(*moved[:, body.clamped], "s", color="0.35", markersize=2.5)
    _draw_modes(ax, moved[:, contact.nodes], contact.tangents, state)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_axis_off()


def _draw_modes(ax: Axes, x: Array, tangents: Array, state: BodyState) -> None:
    stick, open_ = state.modes == Mode.STICK, state.modes == Mode.NO_CONTACT
    slips, room = ~(stick | open_), COLUMN / max(len(state.modes), 10)  # inches per node
    size = float(np.clip(20.0 * room, 1.5, 4.5))
    ax.plot(*x[:, stick], "o", color=BLACK, markersize=size, zorder=4)
    ax.plot(*x[:, open_], "o", color=BLACK, markerfacecolor="white", markersize=size, zorder=4)
    way = np.where(state.modes == Mode.SLIP_PLUS, 1.0, -1.0) * tangents
    ax.quiver(
        *x[:, slips],
        *way[:, slips],
        color=SLIP,
        pivot="mid",
        scale_units="inches",
        scale=1.0 / float(np.clip(0.7 * room, 0.06, 0.2)),
        width=0.006,
        headwidth=4.5,
        zorder=5,
    )


def draw_boundary(
    ax: Axes, body: DiscretisedBody, state: BodyState, units: Units = UNITLESS
) -> None:
    """Draw pressure, shear and friction bound along the boundary."""
    contact = body.contact
    bound = contact.friction * state.pressure
    for i, nodes in enumerate(parts_of(contact)):
        names = CURVES if i == 0 else ("_", "_", "_")
        at, mark = contact.arc[nodes], "_" if len(nodes) == 1 else None
        line: dict[str, Any] = {"color": BOUND, "linewidth": 1.0, "marker": mark}
        pressure, shear = state.pressure[nodes], state.shear[nodes]
        ax.plot(at, pressure, "-o", color=PRESSURE, markersize=3, label=names[0])
        ax.plot(at, shear, "-s", color=SHEAR, markersize=3, label=names[1])
        ax.plot(at, bound[nodes], "--", label=names[2], **line)
        ax.plot(at, -bound[nodes], "--", **line)
    if contact.count == 1:
        ax.set_xticks(contact.arc)
    ax.set_xlabel(units.with_length("length along the boundary"))
    ax.set_ylabel(units.with_stress("force per area"))
    ax.grid(alpha=0.25)
    ax.margins(0.06)


def legend() -> list[Line2D]:
    """Return handles for contact states and curves, to stand outside the axes."""
    return [
        _mark("stick", marker="o", color=BLACK, markersize=5),
        _mark("slip", marker="$→$", color=SLIP, markersize=10),
        _mark(Mode.NO_CONTACT.word, marker="o", color=BLACK, markersize=5, markerfacecolor="white"),
        _mark("clamped", marker="s", color="0.35", markersize=3),
        Line2D([], [], color=PRESSURE, marker="o", markersize=3, label=CURVES[0]),
        Line2D([], [], color=SHEAR, marker="s", markersize=3, label=CURVES[1]),
        Line2D([], [], color=BOUND, linewidth=1.0, linestyle="--", label=CURVES[2]),
    ]


def _mark(label: str, **style: Any) -> Line2D:
    return Line2D([], [], linestyle="none", label=label, **style)
