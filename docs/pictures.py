"""The manual's pictures: drawn when it is built, from the data of reports and from scenes."""

from __future__ import annotations

import json
from pathlib import Path

from pwscont_coulomb.elastic import recover
from pwscont_coulomb.elastic.pictures import draw_states
from pwscont_coulomb.elastic.scenes import block, wedge

from pwscont import explore
from pwscont.bench.picture import draw
from pwscont.bench.report import rows_of

DATA = Path(__file__).parent / "data"


def draw_report(name: str, into: Path) -> None:
    """Draw errors over times of a stored report."""
    data = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    problems = [problem["name"] for problem in data["problems"]]
    draw(problems, rows_of(data)).savefig(into / f"{name}.png", dpi=110)


def draw_body(scene, alpha: float, into: Path) -> None:
    """Draw the body of a scene in all its equilibria at one load."""
    problem = scene.build().condensed()
    graph = explore(problem.along_load(), scene.interval)
    states = [recover(problem, solution) for solution in graph.solutions(alpha)]
    draw_states(problem.elastic, states).savefig(into / f"{scene.name}.png", dpi=90)


def draw_all(into: Path) -> None:
    """Draw everything."""
    into.mkdir(exist_ok=True)
    for name in ("bench", "peers"):
        draw_report(name, into)
    draw_body(block(), 0.7, into)
    draw_body(wedge(), 0.07, into)
