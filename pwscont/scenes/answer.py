"""Answers of scenes, and the look of the files that answers write."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from pwscont import BranchGraph, InvalidInputError, Journal
from pwscont.extending import Report, card, finite_array, named, short
from pwscont.scenes.panels import Shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "pdf", "svg")


@final
@dataclass(frozen=True, slots=True)
class Look:
    """Format and resolution of pictures, and the display of bodies.

    Attributes
    ----------
    format : str
        ``png``, ``pdf`` or ``svg``.
    dpi : int
        Dots per inch.
    scale : float or None
        Factor by which displacements of bodies are enlarged; default a factor that makes
        displacements visible.
    animate : bool
        Whether moving pictures are written, too.
    """

    format: str = "png"
    dpi: int = 150
    scale: float | None = None
    animate: bool = False

    def save(self, figure: Figure, directory: Path, name: str) -> Path:
        """Write a figure into an existing directory, and return the path of the file."""
        path = directory / f"{name}.{self.format}"
        figure.savefig(path, dpi=self.dpi)
        return path


DEFAULT_LOOK = Look()


class Answer(ABC):
    """The result of a scene."""

    @abstractmethod
    def as_text(self) -> str:
        """Return the text that a user reads."""

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """Return the answer as plain lists and numbers, without computing time."""

    @abstractmethod
    def write(self, directory: Path, look: Look = DEFAULT_LOOK) -> list[Path]:
        """Write picture and data into an existing directory; return the files."""

    def in_full(self) -> Answer:
        """Return the answer whose text has no shortened lines; default the same answer."""
        return self

    def explored(self) -> tuple[Shown, BranchGraph] | None:
        """Return the scene and the branch graph, for a view; None without a graph."""
        return None

    def viewed(self) -> tuple[Any, str | int, str] | None:
        """Return another graph with a page, the quantity shown first, and a title; default None."""
        return None


class Runnable(ABC):
    """A named problem, ready to run from the command line.

    A package offers a scene by an entry point of the group ``pwscont.scenes`` whose value is a
    function that returns the scene. The parameters of the function, all with defaults, are the
    settings.

    Attributes
    ----------
    name, title : str
    parameter : str
        The name of the parameter in the line of progress.
    """

    name: str
    title: str
    parameter: str

    #: Whether an interrupted run can go on; such a scene overrides with_journal.
    resumable: ClassVar[bool] = False
    #: Whether the pictures of the scene show a body, with displacements.
    has_body: ClassVar[bool] = False
    #: Whether the answer of the scene has a page for a browser though the scene has no branches.
    has_view: ClassVar[bool] = False

    def __repr__(self) -> str:
        return named(self, f"{self.name}: {short(self.title)}")

    def _repr_html_(self) -> str:
        rows = [("title", self.title), ("parameter", self.parameter)]
        return card(f"{type(self).__name__} {self.name}", rows)

    def with_journal(self, journal: Journal) -> Runnable:
        """Return the scene with a journal that stores every finished piece."""
        raise NotImplementedError

    def with_panels(self, names: Sequence[str]) -> Runnable:
        """Return the scene with diagrams of the named unknowns or recorded quantities instead.

        Raises
        ------
        InvalidInputError
            If a name is not known, or if the scene draws no quantity over a parameter.
        """
        raise InvalidInputError(f"--panels: scene {self.name} draws no quantity over a parameter")

    def curve(self) -> Runnable | None:
        """Return the one-parameter scene, built; None for a scene of another kind."""
        return None

    @abstractmethod
    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return the parameter values whose solutions are listed, before any work.

        Parameters
        ----------
        wanted : sequence of float or None
            The values that the user asked for; None for the scene's own choice.

        Raises
        ------
        InvalidInputError
            If the scene cannot list solutions at a value.
        """

    def plan(self) -> Mapping[str, str]:
        """Return the parts of the run, {name: words}; default nothing."""
        return {}

    @abstractmethod
    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Compute the scene.

        Parameters
        ----------
        at : sequence of float
            From :meth:`values`.
        report : callable
            Called with the number of pieces and the parameter value reached.
        """


def values_within(
    scene: Runnable,
    interval: tuple[float, float],
    own: Sequence[float],
    wanted: Sequence[float] | None,
) -> tuple[float, ...]:
    """Return the wanted values of alpha, default the scene's own, for ``Runnable.values``.

    Raises
    ------
    InvalidInputError
        If a value lies outside the interval, or the scene's own values are not several numbers.
    """
    lo, hi = interval
    for alpha in finite_array(f"at of scene {scene.name}", own).ravel().tolist():
        if not lo <= alpha <= hi:
            words = f"{alpha} lies outside the interval [{lo}, {hi}]"
            raise InvalidInputError(f"at of scene {scene.name}: {words}")
    if np.ndim(own) != 1:
        words = f"must be several numbers, as in (0.5,), got {own!r}"
        raise InvalidInputError(f"at of scene {scene.name} {words}")
    for alpha in wanted or ():
        if not lo <= alpha <= hi:
            words = f"lies outside the interval [{lo}, {hi}] of scene {scene.name}"
            raise InvalidInputError(f"--at {alpha} {words}")
    return tuple(own if wanted is None else wanted)
