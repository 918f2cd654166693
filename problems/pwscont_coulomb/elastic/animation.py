"""A moving picture of the body along a branch; imported when a user asks for an animation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from pwscont import InvalidInputError
from pwscont.extending import Array, EvolutionPath, Piece
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.pictures import draw_body, draw_boundary, legend, strongest, summary
from pwscont_coulomb.elastic.placement import Placement, magnification
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.elastic.recovery import BodyState, recover, state_at


def along(problem: ElasticProblem, pieces: Sequence[Piece], frames: int) -> list[BodyState]:
    """Return states at equal distances along pieces that follow each other.

    Distance is measured in u, multipliers and alpha, each by the largest magnitude on the pieces;
    between the stored points of a piece states are interpolated, which is exact on straight pieces.

    Parameters
    ----------
    problem : ElasticProblem
    pieces : sequence of Piece
        Such as a component from ``graph.components()``.
    frames : int
        At least 2.

    Raises
    ------
    InvalidInputError
        If there is no piece, or fewer than 2 frames.
    """
    if frames < 2 or not pieces:
        raise InvalidInputError(f"need pieces and 2 frames, got {len(pieces)} and {frames}")
    points = np.vstack([piece.points for piece in pieces])
    owner = np.repeat(np.arange(len(pieces)), [len(piece.points) for piece in pieces])
    scale = _scale(points, problem.body.n)
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0) / scale, axis=1)))
    states = []
    for wanted in np.linspace(0.0, length[-1], frames):
        i = min(int(np.searchsorted(length, wanted, side="right")), len(length) - 1)
        t = (wanted - length[i - 1]) / ((length[i] - length[i - 1]) or 1.0)
        point = (1.0 - t) * points[i - 1] + t * points[i]
        character = pieces[owner[i]].character
        states.append(state_at(problem, point[:-1], float(point[-1]), character))
    return states


def over_time(problem: ElasticProblem, path: EvolutionPath, frames: int) -> list[BodyState]:
    """Return states at equal steps in time along an evolution.

    Parameters
    ----------
    problem : ElasticProblem
    path : EvolutionPath
        Such as ``evolution.paths()[0]``.
    frames : int
        At least 2.

    Raises
    ------
    InvalidInputError
        If there are fewer than 2 frames; further errors as of
        :func:`~pwscont_coulomb.elastic.recover`.
    """
    if frames < 2:
        raise InvalidInputError(f"need 2 frames, got {frames}")
    times = np.linspace(path.start, path.end, frames).tolist()
    return [recover(problem, path.state(t)) for t in times]


def _scale(points: Array, n: int) -> Array:
    """Return typical magnitudes of all coordinates: of displacements, forces and alpha."""
    sizes = [np.abs(part).max(initial=0.0) for part in (points[:, :n], points[:, n:-1])]
    sizes.append(np.ptp(points[:, -1]))
    counts = [n, points.shape[1] - 1 - n, 1]
    return np.repeat([float(size) or 1.0 for size in sizes], counts)


def animate(
    problem: ElasticProblem,
    pieces: Sequence[Piece],
    path: Path,
    frames: int = 60,
    fps: int = 12,
    *,
    scale: float | None = None,
) -> Path:
    """Write an animated GIF of the body along pieces that follow each other.

    Parameters
    ----------
    problem, pieces, frames
        As for :func:`along`.
    path : path
        Ending in ``.gif``.
    fps : int
        Frames per second.
    scale : float, optional
        Factor by which displacements are enlarged; the default makes small displacements visible.
    """
    return animate_states(problem.elastic, along(problem, pieces, frames), path, fps, scale=scale)


def animate_states(
    body: DiscretisedBody,
    states: Sequence[BodyState],
    path: Path,
    fps: int = 12,
    *,
    scale: float | None = None,
) -> Path:
    """Write an animated GIF of the body in one state after the other.

    Parameters
    ----------
    body : DiscretisedBody
    states : sequence of BodyState
        Such as from :func:`over_time`.
    path, fps, scale
        As for :func:`animate`.
    """
    placement = Placement.of(body, scale or magnification(body, states))
    norm, box = Normalize(0.0, strongest(states)), _box(placement, states)
    limits = _limits(body, states)
    figure, axes = _figure(placement)
    writer = PillowWriter(fps=fps)
    with writer.saving(figure, str(path), dpi=80):
        for state in states:
            axes[0].clear()
            axes[1].clear()
            draw_body(axes[0], placement, state, norm)
            draw_boundary(axes[1], body, state)
            axes[0].set(xlim=box[0], ylim=box[1], title=summary(state))
            axes[1].set_ylim(*limits)
            writer.grab_frame()
            figure.set_layout_engine("none")  # the layout of the first frame: nothing jumps
    return path


def _figure(placement: Placement) -> tuple[Figure, Any]:
    """Return a figure with a legend, and two axes: for the body and for the boundary."""
    figure = Figure(figsize=(6.4, 6.4), layout="constrained")
    figure.legend(handles=legend(), loc="outside lower center", ncols=4, fontsize="small")
    figure.suptitle(placement.words(), fontsize="medium")
    return figure, figure.subplots(2, 1)


def _limits(body: DiscretisedBody, states: Sequence[BodyState]) -> tuple[float, float]:
    """Return limits that hold pressure, shear and friction bound in every state."""
    pressure = np.array([state.pressure for state in states])
    bound = np.abs(body.contact.friction * pressure).max()
    shear = np.abs([state.shear for state in states]).max()
    low, high = -max(bound, shear), max(pressure.max(), bound, shear)
    margin = 0.06 * (high - low) or 1.0
    return float(low - margin), float(high + margin)


def _box(placement: Placement, states: Sequence[BodyState]) -> Array:
    """Return the limits (2, 2) that hold body and obstacle in every state."""
    drawn = np.hstack([placement.obstacle, *(placement.moved(state) for state in states)])
    lo, hi = drawn.min(axis=1), drawn.max(axis=1)
    margin = 0.06 * (hi - lo).max()
    return np.column_stack([lo - margin, hi + margin])
