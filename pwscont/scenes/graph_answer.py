"""The answer of a one-parameter scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

from pwscont import BranchGraph
from pwscont.extending import Solution, attempted, counted, named
from pwscont.scenes.answer import DEFAULT_LOOK, Answer, Look
from pwscont.scenes.panels import Shown
from pwscont.scenes.table import report


@final
@dataclass(frozen=True, slots=True)
class GraphAnswer(Answer):
    """A branch graph, and the solutions at some parameter values."""

    scene: Shown
    graph: BranchGraph
    at: tuple[float, ...]
    #: Whether the text has wide states and long labels in full.
    full: bool = False

    def __repr__(self) -> str:
        return named(self, self.scene, counted(len(self.graph.pieces), "piece"))

    def as_text(self) -> str:
        """Return branches, transitions, numbers of solutions, and the solutions asked for."""
        return report(self.scene, self.graph, self.at, self.full)

    def in_full(self) -> GraphAnswer:
        """Return the answer whose text has no shortened lines."""
        return replace(self, full=True)

    def as_dict(self) -> dict[str, Any]:
        """Return the graph and the solutions asked for."""
        found = [solution for alpha in self.at for solution in self.graph.solutions(alpha)]
        attempts = [attempted(solution) for solution in found]
        solutions = [_solution(*pair) for pair in zip(found, attempts, strict=True)]
        answer = {"scene": self.scene.name} | self.graph.to_dict() | {"solutions": solutions}
        failed = [why for one in attempts for why in one.values() if isinstance(why, str)]
        if failed:
            answer["not_recorded"] = answer.get("not_recorded", []) + failed
        return answer

    def explored(self) -> tuple[Shown, BranchGraph]:
        """Return the scene and the branch graph."""
        return self.scene, self.graph

    def write(self, directory: Path, look: Look = DEFAULT_LOOK) -> list[Path]:
        """Write the branch diagrams and the branch graph."""
        from pwscont.scenes.plotting import draw_scene  # noqa: PLC0415  only where asked for

        name = self.scene.name
        picture = look.save(draw_scene(self.scene, self.graph), directory, name)
        file = directory / f"{name}.npz"
        self.graph.save(file)
        return [picture, file]


def _solution(solution: Solution, attempt: Mapping[str, float | str]) -> dict[str, Any]:
    return {
        "alpha": solution.alpha,
        "z": solution.z.tolist(),
        "recorded": {k: None if isinstance(v, str) else v for k, v in attempt.items()},
        "label": solution.label,
        "det_sign": solution.det_sign,
        "kind": solution.kind and str(solution.kind),
        "error": solution.error.tolist(),
        "digits": solution.digits,
    }
