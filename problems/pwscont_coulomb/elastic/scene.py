"""A scene whose system comes from an elastic body, built and condensed when it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np

from pwscont import Character, Journal, Panel, Scene
from pwscont.extending import (
    Answer,
    GraphAnswer,
    Omission,
    Report,
    Runnable,
    Solution,
    named,
    uninterrupted,
    values_within,
)
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.elastic.recovery import recover
from pwscont_coulomb.modes import Mode, modes

#: Up to so many contact nodes all unknowns of a solution are printed.
FEW = 3
#: Frames of the animation that a scene writes.
FRAMES = 24
STYLES = {"no contact": "-", "stick": "--", "slip": "-."}


@final
@dataclass(frozen=True, slots=True, repr=False)
class ElasticScene(Runnable):
    """An elastic body under a load path, and where its solutions are listed and drawn.

    Attributes
    ----------
    name, title : str
    build : callable
        () -> ElasticBody; called when the scene runs.
    interval : tuple of float
    at : tuple of float
        Parameter values whose solutions are listed and drawn unless the user asks for others.
    parameter : str
    journal : Journal, optional
        As for :class:`pwscont.Scene`.
    """

    name: str
    title: str
    build: Callable[[], ElasticBody]
    interval: tuple[float, float]
    at: tuple[float, ...] = ()
    parameter: str = "alpha"
    journal: Journal | None = None

    resumable: ClassVar[bool] = True

    def with_journal(self, journal: Journal) -> ElasticScene:
        """Return the same scene with a journal."""
        return replace(self, journal=journal)

    def omissions(self) -> tuple[Omission, ...]:
        """Return what is left out, and why; the rest is known when the body has been built."""
        return (
            Omission("displacements inside the body", "they follow from those in contact"),
            Omission("their recovery", "only made for solutions that are drawn or written"),
        )

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return the values of alpha whose solutions are listed, all of the interval."""
        return values_within(self, self.interval, self.at, wanted)

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Build and condense the body, explore the interval, list solutions."""
        problem = self.build().condensed()
        scene = self._scene(problem)
        graph = uninterrupted(scene.run(report))
        return ElasticAnswer(GraphAnswer(scene, graph, tuple(at)), problem)

    def curve(self) -> Scene:
        """Build and condense the body, and return its scene."""
        return self._scene(self.build().condensed())

    def _scene(self, problem: ElasticProblem) -> Scene:
        return Scene(
            self.name,
            self.title,
            problem.along_load(),
            self.interval,
            parameter=self.parameter,
            at=self.at,
            panels=_panels(problem),
            styles=STYLES,
            journal=self.journal,
        )


def _panels(problem: ElasticProblem) -> tuple[Panel, ...]:
    """Return slip and normal force of the first, the middle and the last contact node."""
    n, p = problem.body.n, problem.body.p
    return tuple(
        Panel(component, partial(_word, node), f"contact node {node + 1}" if p > 1 else "")
        for node in sorted({0, p // 2, p - 1})
        for component in (p + node, n + node)
    )


def _word(node: int, character: Character) -> str:
    return Mode(modes(character)[node]).word.rstrip("+-")


@final
@dataclass(frozen=True, slots=True)
class ElasticAnswer(Answer):
    """The answer of a graph, with pictures and VTU files of the listed solutions."""

    graph: GraphAnswer
    problem: ElasticProblem

    def __repr__(self) -> str:
        return named(self, self.graph.scene, self.problem)

    def as_text(self) -> str:
        """Return what the graph says; of a body with many contact nodes, solutions in sum."""
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
        """Return what the graph says, as plain lists and numbers."""
        return self.graph.as_dict()

    def write(self, directory: Path) -> list[Path]:
        """Write diagrams and, where solutions are listed, what shows them on the body.

        These are a picture for each value of alpha, a VTU file for each solution, and an
        animation along branch 1.
        """
        from pwscont_coulomb.elastic.animation import animate  # noqa: PLC0415  where asked for

        files = self.graph.write(directory)
        for alpha in self.graph.at:
            files += self._write_bodies(directory, alpha)
        branches = self.graph.graph.components()
        if self.graph.at and branches and branches[0]:
            file = directory / f"{self.graph.scene.name}-branch1.gif"
            files.append(animate(self.problem, branches[0], file, FRAMES))
        return files

    def _write_bodies(self, directory: Path, alpha: float) -> list[Path]:
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
            picture = directory / f"{name}.png"
            draw_states(elastic, states).savefig(picture, dpi=150)
            files.insert(0, picture)
        return files
