"""Scenes with a loading history, and their answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar, final

import networkx as nx
import numpy as np

from pwscont.basics.errors import SystemNeededError
from pwscont.basics.printing import counted, named, short, state
from pwscont.basics.quantities import Function
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import Report, silent
from pwscont.evolution.evolve import evolve
from pwscont.evolution.graph import EvolutionGraph
from pwscont.evolution.memory import SystemWithMemory
from pwscont.evolution.paths import cycle_of
from pwscont.evolution.rays import ByRays
from pwscont.evolution.states import EvolutionState
from pwscont.graph.branch_graph import DUST
from pwscont.scenes.answer import DEFAULT_LOOK, Answer, Look, Runnable, values_within
from pwscont.scenes.panels import quantity_named

#: (graph, times, directory, look) -> files
Pictures = Callable[[EvolutionGraph, Sequence[float], Path, Look], Sequence[Path]]
#: Largest number of evolutions that a table tells singly.
MOST_TOLD = 8


@final
@dataclass(frozen=True, slots=True)
class EvolutionAnswer(Answer):
    """A graph of evolutions, and the states at some times."""

    scene: EvolutionScene
    graph: EvolutionGraph
    at: tuple[float, ...]

    def __repr__(self) -> str:
        return named(self, self.scene.name, counted(len(self.graph.pieces), "piece"))

    def as_text(self) -> str:
        """Return the evolutions, the number of states over time, and the states asked for."""
        graph = self.graph
        number = graph.paths().number
        lo, hi = graph.interval
        lines = [f"{self.scene.name}: {self.scene.title}", f"t in [{lo:g}, {hi:g}]"]
        lines += ["", f"{counted(number, 'evolution')}; {graph.guarantee}"]
        for i in range(min(number, MOST_TOLD)):
            lines += ["", f"Evolution {i + 1}", *self._told(i)]
        lines += ["", "Number of solutions by t, on all evolutions together"]
        lines += [f"  [{lo:g}, {hi:g}]: {count}" for lo, hi, count in self.graph.multiplicity()]
        for t in self.at:
            lines += ["", f"States at t = {t:g}", *map(self._line, graph.states(t))]
        return "\n".join([*lines, *self._cycles()])

    def _told(self, number: int) -> list[str]:
        path = self.graph.paths()[number]
        ends = [f"  t = {e.t:.8g} {e.kind}{f' {e.name}' * bool(e.name)}" for e in path.events]
        pieces = [f"    {short(label)}" for label in path.labels]
        return [line for pair in zip(ends, [*pieces, ""], strict=True) for line in pair if line]

    def _line(self, found: EvolutionState) -> str:
        z = np.where(np.abs(found.z) > DUST * np.abs(found.z).max(initial=0.0), found.z, 0.0)
        return f"  {short(found.label)}: {state(self.graph.names, z)}"

    def _cycles(self) -> list[str]:
        if self.scene.period is None:
            return []
        paths, lost = islice(self.graph.paths(), MOST_TOLD), self._dissipated()
        found = [cycle_of(path, self.graph.interval[1], self.scene.period) for path in paths]
        words = (f"Evolution {i + 1}: {cycle.kind}" for i, cycle in enumerate(found))
        return ["", *map("".join, zip(words, lost, strict=False))]

    def _dissipated(self) -> list[str]:
        """Return in words what each evolution dissipates in the last period, if that is known."""
        end, period = self.graph.interval[1], self.scene.period or 0.0
        try:
            paths = islice(self.graph.paths(), MOST_TOLD)
            found = [path.dissipated(end - period, end) for path in paths]
        except SystemNeededError:
            return [""] * MOST_TOLD
        return [f", {energy:.6g} dissipated in the last period" for energy in found]

    def as_dict(self) -> dict[str, Any]:
        """Return graph and states as plain lists and numbers; the parameter is t."""
        graph, whole = self.graph, self.graph.to_dict()
        components = list(nx.weakly_connected_components(graph.nx))
        number = {node: i for i, nodes in enumerate(components) for node in nodes}
        for piece in whole["pieces"]:
            piece["component"] = number[piece["start"]]
        states = [found for t in self.at for found in graph.states(t)]
        return {
            "scene": self.scene.name,
            **whole,
            "components": len(components),
            "multiplicity": [list(row) for row in self.graph.multiplicity()],
            "balance": {"value": None, "constant": True},
            "solutions": [
                {"alpha": s.t, "z": s.z.tolist(), "label": s.label, "det_sign": 0} for s in states
            ],
        }

    def viewed(self) -> tuple[EvolutionGraph, str | int, str]:
        """Return the graph, the quantity that is drawn, and the title, for a view."""
        what = self.scene.panels[0][0] if self.scene.panels else 0
        return self.graph, what, f"{self.scene.name}: {self.scene.title}"

    def write(self, directory: Path, look: Look = DEFAULT_LOOK) -> list[Path]:
        """Write the pictures and the graph, and a moving picture if asked for."""
        from pwscont.evolution.plotting import draw  # noqa: PLC0415  only where asked for

        name, graph = self.scene.name, self.graph
        files = [look.save(draw(graph, self.scene.panels), directory, name)]
        graph.save(directory / f"{name}.npz")
        files.append(directory / f"{name}.npz")
        if look.animate:
            files.append(graph.animate(directory / f"{name}.gif", *self.scene.panels[0]))
        draw_more = self.scene.pictures
        return files + (list(draw_more(graph, self.at, directory, look)) if draw_more else [])


@final
@dataclass(frozen=True, slots=True, repr=False)
class EvolutionScene(Runnable):
    """A system with memory, an interval of time, and what to report and draw.

    Offered by an entry point of the group ``pwscont.scenes``, as a :class:`~pwscont.Scene` is.

    Attributes
    ----------
    name, title : str
    system : SystemWithMemory
    interval : tuple of float
    start, jumps, record : optional
        As for :func:`pwscont.evolve`.
    at : tuple of float
        Times whose states are listed unless the user asks for others.
    panels : tuple of (str or int, str or int)
        Pairs of quantities (y, x) to draw, by name or place; "t" is the time.
    period : float, optional
        The period of the load, to tell shakedown from cyclic slip.
    pictures : callable, optional
        Writes more pictures, such as those of a body: called with the graph, the times whose states
        are listed, the directory and the :class:`~pwscont.extending.Look`; returns the files.
    journal : Journal, optional

    Examples
    --------
    >>> from pwscont import EvolutionScene, LoadHistory
    >>> from pwscont_structures import PlasticTruss
    >>> spring = PlasticTruss([[1.0]], LoadHistory([[0.0], [2.0], [0.0]]), 1.0, 1.0, 1.0)
    >>> EvolutionScene("spring", "one spring", spring, (0.0, 2.0)).run().count(1.5)
    1
    """

    name: str
    title: str
    system: SystemWithMemory
    interval: tuple[float, float]
    start: Any = None
    jumps: Any = None
    record: Mapping[str, Function] = field(default_factory=dict)
    at: tuple[float, ...] = ()
    panels: tuple[tuple[str | int, str | int], ...] = ((0, "t"),)
    period: float | None = None
    pictures: Pictures | None = None
    journal: Journal | None = None

    parameter: str = field(init=False, default="t")
    resumable: ClassVar[bool] = True
    has_body: ClassVar[bool] = True
    has_view: ClassVar[bool] = True

    def with_panels(self, names: Sequence[str]) -> EvolutionScene:
        """Return the scene with pictures of the named quantities over t instead."""
        known = self.system.evolver(self.interval) or ByRays(self.system, self.interval)
        found = [quantity_named(name, known.names(), self.record) for name in names]
        return replace(self, panels=tuple((name, "t") for name in found))

    def with_journal(self, journal: Journal) -> EvolutionScene:
        """Return the same scene with a journal."""
        return replace(self, journal=journal)

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return the times whose states are listed; refuse times off the interval."""
        return values_within(self, self.interval, self.at, wanted)

    def plan(self) -> dict[str, str]:
        """Return the parts of the run in words."""
        evolver = self.system.evolver(self.interval)
        kind = "rays of the cone problem" if evolver is None else type(evolver).__name__
        plan = {"ways on": kind, "after a loss": str(self.jumps or "nothing")}
        if evolver and (own := len(evolver.sizes())) != (shown := len(evolver.names())):
            plan["unknowns"] = f"{own} in place of {shown}, all others recovered at the end"
        return plan

    def run(self, report: Report = silent) -> EvolutionGraph:
        """Follow all evolutions."""
        return evolve(
            self.system,
            self.interval,
            self.start,
            jumps=self.jumps,
            record=self.record,
            journal=self.journal,
            report=report,
        )

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Follow all evolutions and list the states at some times."""
        return EvolutionAnswer(self, self.run(report), tuple(at))
