"""Pictures of contact along a history; imported when a user asks for a picture.

A zone is a range of contact nodes in one mode. Zones have colours that colour-blind readers tell
apart, and stand in a legend.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from pwscont import InvalidInputError
from pwscont.extending import (
    Array,
    EvolutionPath,
    EvolutionState,
    Indices,
    checked_kind,
    finite_array,
)
from pwscont_coulomb.modes import Mode, modes_in
from pwscont_coulomb.quasi_static.system import QuasiStaticCoulomb

#: The colour of the zone of each mode.
COLORS = {
    Mode.NO_CONTACT: "#DDDDDD",
    Mode.STICK: "#0072B2",
    Mode.SLIP_PLUS: "#D55E00",
    Mode.SLIP_MINUS: "#E69F00",
}
PRESSURE, SHEAR, BOUND = "black", "#CC79A7", "0.4"
#: Width of a panel in inches, height of the strip of zones as a part of the panel.
WIDTH, STRIP = 4.6, 0.07


def draw_contact(
    system: QuasiStaticCoulomb,
    states: Sequence[EvolutionState],
    *,
    at: Any = None,
    areas: Any = None,
) -> Figure:
    """Draw pressure, shear, friction bound and zones of states side by side, in one scale.

    Parameters
    ----------
    system : QuasiStaticCoulomb
    states : sequence of EvolutionState
        From ``evolution.states(t)`` or ``path.state(t)``.
    at : array_like, shape (p,), optional
        The place of each contact node along the boundary, growing; default the node's number.
    areas : array_like, shape (p,), optional
        The area of each contact node, for forces per area; default 1, for forces.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InvalidInputError
        If there is no state, or places or areas do not fit.

    Examples
    --------
    >>> from pwscont import evolve
    >>> from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb, draw_contact
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> system = QuasiStaticCoulomb(body, LoadHistory([[1, 0], [1, 3]]), 0.5)
    >>> evolution = evolve(system, (0.0, 1.0))
    >>> draw_contact(system, evolution.states(0.5)).savefig("contact.png")  # doctest: +SKIP
    """
    for state in states if isinstance(states, Sequence) else [states]:
        checked_kind("each of states", state, EvolutionState, is_needed=True)
    if not states:
        raise InvalidInputError("there is no state to draw")
    places, p = _places(system, at), system.body.p
    size = np.ones(p) if areas is None else finite_array("areas", areas, (p,))
    figure = Figure(figsize=(WIDTH * len(states) + 0.6, 3.6), layout="constrained")
    all_axes = figure.subplots(1, len(states), squeeze=False, sharey=True)[0]
    for axes, state in zip(all_axes, states, strict=True):
        _draw_forces(axes, system, state, places, size)
        _draw_strip(axes, places, modes_in(state.label, p))
        axes.set_title(f"t = {state.t:.6g}", fontsize="medium", pad=22.0)
        _name_places(axes.xaxis, at)
    all_axes[0].set_ylabel("force" if areas is None else "force per area")
    lines = all_axes[0].get_legend_handles_labels()[0]
    handles = [*lines, *_zones_of(*(modes_in(state.label, p) for state in states))]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize="small")
    return figure


def draw_zones(system: QuasiStaticCoulomb, path: EvolutionPath, *, at: Any = None) -> Figure:
    """Draw in which mode each contact node is over time, along one evolution.

    Parameters
    ----------
    system : QuasiStaticCoulomb
    path : EvolutionPath
        From ``evolution.paths()``.
    at : array_like, shape (p,), optional
        As for :func:`draw_contact`.

    Returns
    -------
    matplotlib.figure.Figure

    Examples
    --------
    >>> from pwscont import evolve
    >>> from pwscont_coulomb import ContactBody, LoadHistory, QuasiStaticCoulomb, draw_zones
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> system = QuasiStaticCoulomb(body, LoadHistory([[1, 0], [1, 3]]), 0.5)
    >>> evolution = evolve(system, (0.0, 1.0))
    >>> draw_zones(system, evolution.paths()[0]).savefig("zones.png")  # doctest: +SKIP
    """
    checked_kind("path", path, EvolutionPath, is_needed=True)
    edges = _edges(_places(system, at))
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes, shown = figure.subplots(), list[Indices]()
    for begin, end in path.stretches(path.start, path.end):
        modes = modes_in(end.label, system.body.p)
        _fill(axes, edges, modes, (begin.t, end.t), turned=True)
        shown.append(modes)
    axes.set(xlim=(path.start, path.end), ylim=(edges[0], edges[-1]), xlabel="$t$")
    _name_places(axes.yaxis, at)
    figure.legend(handles=_zones_of(*shown), loc="outside lower center", ncols=4, fontsize="small")
    return figure


def _places(system: QuasiStaticCoulomb, at: Any) -> Array:
    checked_kind("system", system, QuasiStaticCoulomb, is_needed=True)
    p = system.body.p
    places = np.arange(1.0, p + 1.0) if at is None else finite_array("at", at, (p,))
    if (np.diff(places) <= 0.0).any():
        raise InvalidInputError("at must grow from node to node; order the nodes before")
    return places


def _name_places(axis: Axis, at: Any) -> None:
    axis.set_label_text("contact node" if at is None else "place along the boundary")
    if at is None:
        axis.set_major_locator(MaxNLocator(integer=True))


def _edges(places: Array) -> Array:
    """Return the ends of the zones of single nodes, shape (p + 1,)."""
    middle = 0.5 * (places[1:] + places[:-1])
    half = 0.5 if len(places) == 1 else 0.5 * float(np.diff(places).mean())
    return np.concatenate([[places[0] - half], middle, [places[-1] + half]])


def _draw_forces(
    axes: Axes, system: QuasiStaticCoulomb, state: EvolutionState, places: Array, size: Array
) -> None:
    p = system.body.p
    pressure, shear = -state.z[-2 * p : -p] / size, state.z[-p:] / size
    bound = system.friction * pressure
    line: dict[str, Any] = {"color": BOUND, "linewidth": 1.0, "linestyle": "--"}
    line["marker"] = "_" if p == 1 else ""
    dots: dict[str, Any] = {"markersize": 3.5 if p <= 60 else 0.0}
    axes.plot(places, pressure, "-o", color=PRESSURE, label="pressure", **dots)
    axes.plot(places, shear, "-s", color=SHEAR, label="shear", **dots)
    axes.plot(places, bound, label="friction bound", **line)
    axes.plot(places, -bound, **line)
    axes.grid(alpha=0.25)
    axes.margins(y=0.1)


def _draw_strip(axes: Axes, places: Array, modes: Indices) -> None:
    """Draw the zones as a strip above the curves."""
    edges = _edges(places)
    strip = axes.inset_axes((0.0, 1.01, 1.0, STRIP))
    axes.set_xlim(edges[0], edges[-1])
    strip.set(xlim=(edges[0], edges[-1]), ylim=(0.0, 1.0))
    strip.set_axis_off()
    _fill(strip, edges, modes, (0.0, 1.0), turned=False)


def _fill(
    axes: Axes, edges: Array, modes: Indices, ends: tuple[float, float], *, turned: bool
) -> None:
    """Fill a rectangle for each node in the colour of the node's mode."""
    lo, hi = ends
    corners = [[(a, lo), (b, lo), (b, hi), (a, hi)] for a, b in pairwise(edges)]
    shapes = np.array(corners)[:, :, ::-1] if turned else np.array(corners)
    colors = [COLORS[Mode(mode)] for mode in modes.tolist()]
    axes.add_collection(PolyCollection(list(shapes), facecolors=colors, edgecolors="face"))


def _zones_of(*shown: Indices) -> list[Patch]:
    """Return the legend of the modes that are shown."""
    found = {int(mode) for modes in shown for mode in modes}
    return [Patch(color=color, label=mode.word) for mode, color in COLORS.items() if mode in found]


def draw_damping(preloads: Array, energies: Array, marked: float) -> Figure:
    """Draw what friction takes in one cycle of a load over the preload.

    Parameters
    ----------
    preloads, energies : ndarray, shape (k,)
    marked : float
        The preload of the scene, marked by a line.
    """
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(preloads, energies, color=COLORS[Mode.STICK], marker=".")
    axes.axvline(marked, color=BOUND, linestyle="--", linewidth=1.0, label="preload of this scene")
    axes.set(xlabel="preload, percent of the height", ylabel="energy dissipated per cycle")
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    return figure
