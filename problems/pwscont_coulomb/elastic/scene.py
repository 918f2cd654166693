"""A scene of an elastic body, which is built and condensed when the scene runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np

from pwscont import BranchGraph, Journal, Panel, Scene
from pwscont.extending import (
    DEFAULT_LOOK,
    Answer,
    GraphAnswer,
    Look,
    Report,
    Runnable,
    Shown,
    Solution,
    named,
    uninterrupted,
    values_within,
)
from pwscont_coulomb.elastic.body_picture import ElasticPicture
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.elastic.recovery import recover
from pwscont_coulomb.elastic.units import UNITLESS, Units
from pwscont_coulomb.modes import word

#: Most contact nodes for which all unknowns of a solution are printed.
FEW = 3
#: Frames of the animation that a scene writes.
FRAMES = 24


@final
@dataclass(frozen=True, slots=True, repr=False)
class ElasticScene(Runnable):
    """An elastic body under a load path, and the parameters of the solutions to list and draw.

    Attributes
    ----------
    name, title : str
    build : callable
        () -> ElasticBody; called when the scene runs.
    interval : tuple of float
    at : tuple of float
        Parameter values whose solutions are listed and drawn by default.
    parameter : str
    units : Units
        The units of lengths and stresses, for pictures.
    panels : tuple of str
        Unknowns that the branch diagrams show, by name or index; default slip and normal force of
        the first, the middle and the last contact node.
    journal : Journal, optional
        As for :class:`pwscont.Scene`.
    """

    name: str
    title: str
    build: Callable[[], ElasticBody]
    interval: tuple[float, float]
    at: tuple[float, ...] = ()
    parameter: str = "alpha"
    units: Units = UNITLESS
    panels: tuple[str, ...] = ()
    journal: Journal | None = None

    resumable: ClassVar[bool] = True
    has_body: ClassVar[bool] = True

    def with_panels(self, names: Sequence[str]) -> ElasticScene:
        """Return the scene with other panels; only a built body can check the names."""
        return replace(self, panels=tuple(names))

    def with_journal(self, journal: Journal) -> ElasticScene:
        """Return the same scene with a journal."""
        return replace(self, journal=journal)

    def plan(self) -> dict[str, str]:
        """Return the parts of the run in words."""
        return {
            "followed": "the unknowns in contact, to which the body is condensed",
            "recovered": "displacements inside the body, of solutions that are drawn or written",
        }

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return the values of alpha whose solutions are listed; refuse values off the interval."""
        return values_within(self, self.interval, self.at, wanted)

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Build and condense the body, explore the interval, list solutions."""
        problem = self.build().condensed()
        scene = self._scene(problem)
        graph = uninterrupted(scene.run(report))
        return ElasticAnswer(GraphAnswer(scene, graph, tuple(at)), problem, self.units)

    def curve(self) -> Scene:
        """Build and condense the body, and return the scene of the condensed problem."""
        return self._scene(self.build().condensed())

    def _scene(self, problem: ElasticProblem) -> Scene:
        scene = Scene(
            self.name,
            self.title,
            problem.along_load(),
            self.interval,
            parameter=self.parameter,
            at=self.at,
            panels=_panels(problem),
            journal=self.journal,
            body=ElasticPicture(problem, self.units),
        )
        return scene.with_panels(self.panels) if self.panels else scene


def _panels(problem: ElasticProblem) -> tuple[Panel, ...]:
    """Return slip and normal force of the first, the middle and the last contact node."""
    n, p = problem.body.n, problem.body.p
    return tuple(
        Panel(component, partial(word, node), f"contact node {node + 1}" if p > 1 else "")
        for node in sorted({0, p // 2, p - 1})
        for component in (p + node, n + node)
    )


@final
@dataclass(frozen=True, slots=True)
class ElasticAnswer(Answer):
    """The answer of a graph, with pictures and VTU files of the listed solutions."""

    graph: GraphAnswer
    problem: ElasticProblem
    units: Units = UNITLESS

    def __repr__(self) -> str:
        return named(self, self.graph.scene, self.problem)

    def as_text(self) -> str:
        """Return the text of the graph; with many contact nodes, summaries of the solutions."""
        if self.problem.body.p <= FEW:
            return self.graph.as_text()
        lines = [replace(self.graph, at=()).as_text()]
        for alpha in self.graph.at:
            found = self.graph.graph.solutions(alpha)
            count = f"{len(found)} solution{'' if len(found) == 1 else 's'}"
            lines += ["", f"{count} at {self.graph.scene.parameter} = {alpha:.10g}"]
            for i, solution in enumerate(found, start=1):
                lines += [f"  {i}. {solution.label}, det {solution.det_sign:+d}"]
                lines += [f"     {line}" for line in self._summary(solution)]
        return "\n".join(lines)

    def _summary(self, solution: Solution) -> Iterator[str]:
        """Yield force, pressure and displacement of a solution in words."""
        state, contact = recover(self.problem, solution), self.problem.elastic.contact
        force = contact.normals @ state.normal_force + contact.tangents @ state.tangential_force
        most = int(np.argmax(state.pressure))
        largest = np.hypot(*state.displacements.T).max()
        yield f"contact force on the body ({force[0]:.8g}, {force[1]:.8g}) per thickness"
        yield f"largest pressure {state.pressure[most]:.8g} at node {most + 1}"
        yield f"largest displacement {largest:.8g}"

    def as_dict(self) -> dict[str, Any]:
        """Return the graph as plain lists and numbers."""
        return self.graph.as_dict()

    def explored(self) -> tuple[Shown, BranchGraph]:
        """Return the scene, which knows the body, and the branch graph."""
        return self.graph.explored()

    def write(self, directory: Path, look: Look = DEFAULT_LOOK) -> list[Path]:
        """Write diagrams and, where solutions are listed, these solutions on the body.

        A picture for each value of alpha, a VTU file for each solution, and, if asked for, an
        animation along branch 1.
        """
        files = self.graph.write(directory, look)
        for alpha in self.graph.at:
            files += self._write_bodies(directory, look, alpha)
        return files + (self._write_animation(directory, look) if look.animate else [])

    def _write_animation(self, directory: Path, look: Look) -> list[Path]:
        from pwscont_coulomb.elastic.animation import animate  # noqa: PLC0415  where asked for

        branches = self.graph.graph.components()
        if not (branches and branches[0]):
            return []
        file = directory / f"{self.graph.scene.name}-branch1.gif"
        return [animate(self.problem, branches[0], file, FRAMES, scale=look.scale)]

    def _write_bodies(self, directory: Path, look: Look, alpha: float) -> list[Path]:
        from pwscont_coulomb.elastic.pictures import draw_states  # noqa: PLC0415  where asked for
        from pwscont_coulomb.elastic.vtu import write_vtu  # noqa: PLC0415

        elastic, found = self.problem.elastic, self.graph.graph.solutions(alpha)
        states = [recover(self.problem, solution) for solution in found]
        name = f"{self.graph.scene.name}-{alpha:.10g}"
        files = [
            write_vtu(directory / f"{name}-{number}.vtu", elastic, state)
            for number, state in enumerate(states, start=1)
        ]
        if states:
            figure = draw_states(elastic, states, scale=look.scale, units=self.units)
            files.insert(0, look.save(figure, directory, name))
        return files
