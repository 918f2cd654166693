"""A scene: a named problem, ready to run, with the choice of what is reported and drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, final

from pwscont import (
    BranchGraph,
    InvalidInputError,
    Journal,
    PiecewiseSystem,
    Search,
    Stepper,
    Stop,
    TransitionDetector,
    explore,
)
from pwscont.extending import (
    Function,
    Report,
    checked_interval,
    checked_kind,
    plan_in_words,
    silent,
    uninterrupted,
)
from pwscont.scenes.answer import Answer, Runnable, values_within
from pwscont.scenes.graph_answer import GraphAnswer
from pwscont.scenes.panels import BodyPicture, Panel, ParameterPath, check_drawn, quantity_named


@final
@dataclass(frozen=True, slots=True, repr=False)
class Scene(Runnable):
    """A system, an interval of the parameter, and the choice of what is reported and drawn.

    A package offers a scene by an entry point of the group ``pwscont.scenes`` whose value is a
    function that returns the scene; the parameters of the function, all with defaults, are
    settings.

    Attributes
    ----------
    name, title : str
    system : PiecewiseSystem
    interval : tuple of float
    parameter : str
        Name of alpha.
    at : tuple of float
        Parameter values whose solutions are listed unless the user asks for other values.
    orientations : tuple of int
        Directions, +1 or -1 (paper, Definition 1); the table reads every branch in the first
        direction.
    search, stepper, detectors, events, record : optional
        As for :func:`pwscont.explore`.
    panels, paths, styles
        The pictures, and the line style for each mode.
    journal : Journal, optional
        The journal that stores every finished piece at once.
    body : BodyPicture, optional
        The picture of the body, for a view in the browser.

    Examples
    --------
    >>> from pwscont import LCP, Panel, Scene
    >>> problem = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])
    >>> scene = Scene("two", "two unknowns", problem, (-1.0, 2.0), panels=(Panel("z[1]"),))
    >>> scene.run().count(0.0)
    3
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
    detectors: tuple[TransitionDetector, ...] = ()
    events: Mapping[str, Function | Stop] = field(default_factory=dict)
    record: Mapping[str, Function] = field(default_factory=dict)
    panels: tuple[Panel, ...] = (Panel(0),)
    paths: tuple[ParameterPath, ...] = ()
    styles: Mapping[str, Any] = field(default_factory=dict)
    journal: Journal | None = None
    body: BodyPicture | None = None

    resumable: ClassVar[bool] = True

    def with_journal(self, journal: Journal) -> Scene:
        """Return the scene with a journal."""
        return replace(self, journal=journal)

    def with_panels(self, names: Sequence[str]) -> Scene:
        """Return the scene with diagrams of the named unknowns or recorded quantities instead.

        Raises
        ------
        UnknownNameError
            If a name is not known; the message lists similar names.
        """
        unknowns = self.system.names()
        own = {
            unknowns[p.component] if isinstance(p.component, int) else p.component: p
            for p in self.panels
        }
        asked = [quantity_named(name, unknowns, self.record) for name in names]
        return replace(self, panels=tuple(own.get(name, Panel(name)) for name in asked))

    def curve(self) -> Scene:
        """Return the scene itself."""
        return self

    def run(self, report: Report = silent) -> BranchGraph:
        """Return the branch graph of the scene on the interval.

        Raises
        ------
        InvalidInputError, UnknownNameError
            Before any work if a panel, or a value of ``at``, does not fit.
        """
        self.values(None)
        return explore(
            self.system,
            self.interval,
            search=self.search,
            stepper=self.stepper,
            detectors=self.detectors,
            events=self.events,
            record=self.record,
            parameter=self.parameter,
            report=report,
            journal=self.journal,
        )

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return the values of alpha whose solutions are listed; refuse values off the interval."""
        interval = checked_interval(self.system, self.interval)
        self._check_panels()
        return values_within(self, interval, self.at, wanted)

    def _check_panels(self) -> None:
        if not isinstance(self.panels, tuple | list):
            raise InvalidInputError(f"panels of scene {self.name} must be a tuple of Panel")
        unknowns = self.system.names()
        for panel in self.panels:
            checked_kind(f"each of the panels of scene {self.name}", panel, Panel)
            check_drawn(panel.component, unknowns, self.record)

    def plan(self) -> dict[str, str]:
        """Return the parts of the run, {name: words}, without following a branch."""
        return plan_in_words(
            self.system,
            self.interval,
            stepper=self.stepper,
            detectors=self.detectors,
            events=self.events,
            search=self.search,
        )

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Return the branch graph of the interval, and the solutions at values of alpha."""
        return GraphAnswer(self, uninterrupted(self.run(report)), tuple(at))
