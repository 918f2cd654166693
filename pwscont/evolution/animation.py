"""A moving picture of evolutions: the states at each time on the curves of all evolutions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import counted
from pwscont.evolution.plotting import Curves, Quantity, draw

if TYPE_CHECKING:
    from pwscont.evolution.structure import EvolutionStructure

DPI, STATE_SIZE = 90, 90


def animate(
    graph: EvolutionStructure, path: Path, panel: tuple[Quantity, Quantity], frames: int, fps: int
) -> Path:
    """Write an animated GIF, for :meth:`EvolutionGraph.animate`."""
    from matplotlib.animation import PillowWriter  # noqa: PLC0415  only where asked for

    check_animation(path, frames, fps)
    figure = draw(graph, [panel])
    curves, axes = Curves(graph, panel[1], panel[0]), figure.axes[0]
    dots = axes.scatter([], [], STATE_SIZE, facecolor="none", edgecolor="black", linewidth=2)
    dots.set_zorder(6)
    writer = PillowWriter(fps=fps)
    try:
        with writer.saving(figure, str(path), dpi=DPI):
            for t in np.linspace(*graph.interval, frames).tolist():
                states = graph.states(t)
                points = np.array([curves.point(state) for state in states]).reshape(-1, 2)
                dots.set_offsets(points)
                axes.set_title(f"t = {t:.4g}: {counted(len(states), 'state')}")
                writer.grab_frame()
                figure.set_layout_engine("none")  # the layout of the first frame: nothing jumps
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def check_animation(path: Path, frames: int, fps: int) -> None:
    """Refuse a moving picture that cannot be written.

    Raises
    ------
    InvalidInputError
    """
    if path.suffix.lower() != ".gif":
        raise InvalidInputError(f"an animation is a file that ends in .gif, got {str(path)!r}")
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"cannot write {path}: there is no directory {path.parent}")
    if frames < 2 or fps < 1:
        raise InvalidInputError(
            f"an animation needs 2 frames and 1 frame per second, got {frames} and {fps}"
        )
