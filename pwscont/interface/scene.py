"""A scene: a named problem, ready to run, and what of it a user wants to see."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

from pwscont.continuation import explore
from pwscont.continuation.preparation import Report, silent
from pwscont.foundation.character import Character
from pwscont.graph import BranchGraph
from pwscont.model.system import PiecewiseSystem
from pwscont.search import Search
from pwscont.stepping import Stepper


@final
@dataclass(frozen=True, slots=True)
class Panel:
    """One diagram: a component of z against the parameter.

    Attributes
    ----------
    component : int
        Index into z.
    mode : callable, optional
        Character -> the word that chooses the line style; default the system's description.
    title : str
    """

    component: int
    mode: Callable[[Character], str] | None = None
    title: str = ""


@final
@dataclass(frozen=True, slots=True)
class ParameterPath:
    """A companion picture: two quantities along the parameter, such as a load path.

    Attributes
    ----------
    curve : callable
        alpha -> (horizontal, vertical).
    labels : tuple of str
        Names of both axes.
    title : str
    """

    curve: Callable[[float], tuple[float, float]]
    labels: tuple[str, str]
    title: str = ""


@final
@dataclass(frozen=True, slots=True)
class Scene:
    """A system, an interval of its parameter, and what to report and draw.

    A package offers a scene by an entry point of the group ``pwscont.scenes`` whose value is a
    function without arguments that returns the scene.

    Attributes
    ----------
    name, title : str
    system : PiecewiseSystem
    interval : tuple of float
    parameter : str
        Name of alpha.
    at : tuple of float
        Parameter values whose solutions are listed unless the user asks for others.
    orientations : tuple of int
        Directions in which transitions are read out: +1, -1 (paper, Definition 1).
    search, stepper : optional
        As for :func:`pwscont.explore`.
    panels, paths, styles
        The pictures, and the line style for each mode.
    """

    name: str
    title: str
    system: PiecewiseSystem
    interval: tuple[float, float]
    parameter: str = "alpha"
    at: tuple[float, ...] = ()
    orientations: tuple[int, ...] = (1,)
    search: Search | None = None
    stepper: Stepper | None = None
    panels: tuple[Panel, ...] = (Panel(0),)
    paths: tuple[ParameterPath, ...] = ()
    styles: Mapping[str, Any] = field(default_factory=dict)

    def run(self, report: Report = silent) -> BranchGraph:
        """Explore the scene's interval."""
        return explore(
            self.system,
            self.interval,
            search=self.search,
            stepper=self.stepper,
            parameter=self.parameter,
            report=report,
        )
