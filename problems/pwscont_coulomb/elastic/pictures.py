"""Pictures of solutions on the body. Imported only where a picture is asked for.

Above, the deformed body: displacements and gaps are magnified alike, so that closed nodes lie on
the drawn obstacle. A disc is a node that sticks, an arrow one that slips (in the direction in
which the body has moved), a ring an open one. Below, pressure and shear along the boundary:
where the shear meets the dashed friction bound, the node slips or is about to.
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
from pwscont.extending import Array, Indices
from pwscont_coulomb.elastic.contact_boundary import ContactNodes
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.elastic.recovery import BodyState
from pwscont_coulomb.modes import Mode

#: The largest displacement is drawn as this part of the size of the body.
DRAWN = 0.08
#: Meshes with more elements are drawn without the lines between them.
MANY = 1500
COLUMN, CURVE_ROW = 4.6, 2.6  # inches
BLACK, SLIP, SHEAR = "black", "tab:red", "tab:orange"


def draw_states(
    body: ElasticBody, states: Sequence[BodyState], titles: Sequence[str] = ()
) -> Figure:
    """Draw one or several solutions side by side, in the same scales.

    Parameters
    ----------
    body : ElasticBody
    states : sequence of BodyState
    titles : sequence of str, optional
        One per state; default the parameter and how many nodes are in which mode.

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
    factor, norm = magnification(body, states), Normalize(0.0, _strongest(states))
    for column, (state, title) in enumerate(zip(states, names, strict=True)):
        draw_body(axes[0, column], body, state, factor, norm)
        draw_boundary(axes[1, column], body, state)
        axes[0, column].set_title(title, fontsize="medium")
        axes[1, column].label_outer()
    figure.colorbar(
        ScalarMappable(norm, "Blues"), ax=axes[0].tolist(), label="largest shear stress"
    )
    axes[1, 0].legend(fontsize="small")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=4, fontsize="small")
    figure.suptitle(f"displacements drawn {factor:.3g}-fold", fontsize="small")
    return figure


def _body_row(body: ElasticBody) -> float:
    """Return the height for a body of this shape (inches)."""
    wide, high = np.ptp(body.positions, axis=1)
    return float(np.clip(COLUMN * (high / wide + 0.15), 1.5, 1.2 * COLUMN))


def summary(state: BodyState) -> str:
    """Return parameter and number of nodes in each mode, such as ``alpha = 1: 12 stick, ...``."""
    counts = {mode.word: int(np.count_nonzero(state.modes == mode)) for mode in Mode}
    found = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return f"α = {state.alpha:.6g}: {found}"


def magnification(body: ElasticBody, states: Sequence[BodyState]) -> float:
    """Return the factor by which displacements are drawn: 1, 2 or 5 times a power of ten."""
    largest = max(float(np.abs(state.displacements).max()) for state in states)
    if largest == 0.0:
        return 1.0
    wanted = DRAWN * float(np.ptp(body.positions, axis=1).max()) / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _strongest(states: Sequence[BodyState]) -> float:
    return max(float(largest_shear(state.stresses).max()) for state in states) or 1.0


def largest_shear(stresses: Array) -> Array:
    """Return the largest shear stress in the plane of each element."""
    xx, yy, xy = stresses
    shear: Array = np.hypot(0.5 * (xx - yy), xy)
    return shear


def draw_body(
    ax: Axes, body: ElasticBody, state: BodyState, factor: float, norm: Normalize
) -> None:
    """Draw the deformed body, coloured by shear stress, with contact states and obstacle."""
    mesh, contact = body.space.mesh, body.contact
    moved = body.positions + factor * state.displacements.T
    corners = moved.T[body.space.element_nodes[: mesh.t.shape[0]].T]
    lines = 0.3 if mesh.nelements <= MANY else 0.0
    elements = PolyCollection(
        list(corners), cmap="Blues", norm=norm, edgecolor="0.45", linewidth=lines
    )
    elements.set_array(largest_shear(state.stresses))
    ax.add_collection(elements)
    obstacle = contact.positions + factor * contact.gap * contact.normals
    for nodes in _parts(contact):
        depth = 0.02 * float(np.ptp(body.positions))
        _draw_obstacle(ax, obstacle[:, nodes], contact.normals[:, nodes], depth)
    held = body.held // 2
    clamped = np.intersect1d(held[body.held % 2 == 0], held[body.held % 2 == 1])
    ax.plot(*moved[:, clamped], "s", color="0.35", markersize=2.5)
    _draw_modes(ax, moved[:, contact.nodes], contact.tangents, state)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_axis_off()


def _parts(contact: ContactNodes) -> list[Indices]:
    """Return the nodes of each connected part of the contact boundary."""
    return [np.flatnonzero(contact.part == part) for part in np.unique(contact.part)]


def _draw_obstacle(ax: Axes, line: Array, normals: Array, depth: float) -> None:
    below = line + depth * normals
    if line.shape[1] == 1:  # a single node: a short piece of the tangent
        along = 4.0 * depth * np.array([[-1.0, 1.0]]) * np.stack([-normals[1], normals[0]])
        line, below = line + along, below + along
    outline = np.hstack([line, below[:, ::-1]])
    ax.fill(*outline, facecolor="0.8", edgecolor="none", zorder=0)
    ax.plot(*line, color="0.3", linewidth=1.0, zorder=1)


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


def draw_boundary(ax: Axes, body: ElasticBody, state: BodyState) -> None:
    """Draw pressure, shear and friction bound along the boundary."""
    contact = body.contact
    bound = contact.friction * state.pressure
    for i, nodes in enumerate(_parts(contact)):
        names = ("pressure", "shear", "friction bound") if i == 0 else ("_", "_", "_")
        at, mark = contact.arc[nodes], "_" if len(nodes) == 1 else None
        line: dict[str, Any] = {"color": "0.4", "linewidth": 1.0, "marker": mark}
        pressure, shear = state.pressure[nodes], state.shear[nodes]
        ax.plot(at, pressure, "-o", color="tab:blue", markersize=3, label=names[0])
        ax.plot(at, shear, "-s", color=SHEAR, markersize=3, label=names[1])
        ax.plot(at, bound[nodes], "--", label=names[2], **line)
        ax.plot(at, -bound[nodes], "--", **line)
    ax.set_xlabel("length along the boundary")
    ax.set_ylabel("force per area")
    ax.grid(alpha=0.25)
    ax.margins(0.05)


def _legend() -> list[Line2D]:
    return [
        _mark("stick", marker="o", color=BLACK, markersize=5),
        _mark("slip", marker="$→$", color=SLIP, markersize=10),
        _mark("open", marker="o", color=BLACK, markersize=5, markerfacecolor="white"),
        _mark("clamped", marker="s", color="0.35", markersize=3),
    ]


def _mark(label: str, **style: Any) -> Line2D:
    return Line2D([], [], linestyle="none", label=label, **style)
