"""The manual's pictures: drawn when it is built, from the data of reports and from scenes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pwscont_coulomb.elastic import recover
from pwscont_coulomb.elastic.pictures import draw_states
from pwscont_coulomb.elastic.scenes import block, wedge

from pwscont import PiecewiseSystem, View, explore, plot
from pwscont.bench.picture import draw
from pwscont.bench.report import rows_of
from pwscont.scenes.styles import COLORS

DATA = Path(__file__).parent / "data"


#: The problems of the report on accuracy that the manual shows: more panels could not be read.
SHOWN = ("fig7", "fig10", "example3", "circle", "bratu", "two-curves")


def draw_report(name: str, into: Path) -> None:
    """Draw errors over times of a stored report."""
    data = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    problems = [problem["name"] for problem in data["problems"]]
    if name == "bench":
        problems = [problem for problem in SHOWN if problem in problems]
    rows = [row for row in rows_of(data) if row.case in problems]
    draw(problems, rows, columns=3).savefig(into / f"{name}.png", dpi=110)


def draw_body(scene, alpha: float, into: Path) -> None:
    """Draw the body of a scene in all its equilibria at one load."""
    problem = scene.build().condensed()
    graph = explore(problem.along_load(), scene.interval)
    states = [recover(problem, solution) for solution in graph.solutions(alpha)]
    draw_states(problem.elastic, states).savefig(into / f"{scene.name}.png", dpi=90)


class ArchOverStop(PiecewiseSystem):
    """The system of the page "Getting started"."""

    size = 1

    def test_functions(self, z, alpha):
        """Return where the arch touches the stop."""
        return z - 1.0

    def residual(self, z, alpha, character):
        """Return the force that is missing."""
        stop = 5.0 * (z - 1.0) if character.signs[0] else 0.0
        return z * (z - 1.0) * (z - 2.0) + stop - alpha


def draw_arch(into: Path) -> None:
    """Draw the branch of the page "Getting started"."""
    graph = explore(ArchOverStop(), (-0.5, 1.0), parameter="load")
    plot(graph, 0).figure.savefig(into / "arch.png", dpi=110)


#: Path, way, line, color and words of each line over the sizes.
LINES = (
    ("strip", "trace", "D-", COLORS[0], "strip: trace"),
    ("strip", "bare", "v-", COLORS[1], "strip: bare loop"),
    ("strip", "pass", "--", "k", "strip: one pass over the matrix"),
    ("string, banded", "trace", "D:", COLORS[0], "string: trace"),
    ("string, banded", "by hand", "v:", COLORS[1], "string: loop by hand"),
    ("LASSO", "trace", "*", COLORS[0], "LASSO: trace"),
    ("LASSO", "bare", "P", COLORS[1], "LASSO: lars_path"),
)
STAGES = ("assembly", "condensation", "tracing", "recovery")


def draw_scale(into: Path) -> None:
    """Draw the time of each stage, and that of one transition, over the contact nodes."""
    data = json.loads((DATA / "scale.json").read_text(encoding="utf-8"))
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    stages, each = figure.subplots(1, 2)
    for name, marker, color in zip(STAGES, "soD*", COLORS[:4], strict=True):
        stages.loglog(*_series(data["block"], name), marker=marker, color=color, label=name)
    for name, marker, color in (("block", "D", COLORS[0]), ("strip", "v", COLORS[1])):
        each.loglog(*_series(data[name], "ms each"), marker=marker, color=color, label=name)
    last = data["block"][-1]
    guide = np.array([300.0, last["p"]])
    each.loglog(guide, last["ms each"] * (guide / last["p"]) ** 2, "k--", label="$p^2$")
    for ax, words in ((stages, "seconds"), (each, "ms per transition")):
        ax.set(xlabel="contact nodes p", ylabel=words)
        ax.grid(alpha=0.3)
        ax.legend()
    figure.savefig(into / "scale.png", dpi=110)


def draw_straight(into: Path) -> None:
    """Draw the time of one transition of each path by each way, over the sizes."""
    data = json.loads((DATA / "scale.json").read_text(encoding="utf-8"))
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    ax = figure.subplots()
    rows = [row | {"p": row["size"]} for row in data["straight"]]
    for path, way, line, color, words in LINES:
        ax.loglog(
            *_series([row for row in rows if row["path"] == path], way),
            line,
            color=color,
            label=words,
        )
    sizes = sorted({row["p"] for row in rows} - {250})  # too near to 200
    ax.set_xticks([], minor=True)
    ax.set_xticks(sizes, [f"{p:,}" for p in sizes])
    ax.set(xlabel="contact nodes, nodes of the string, coefficients", ylabel="ms per transition")
    ax.grid(alpha=0.3)
    figure.legend(loc="outside right center")
    figure.savefig(into / "straight.png", dpi=110)


def draw_increments(into: Path) -> None:
    """Draw the errors of increments over their number and over time, beside evolutions."""
    data = json.loads((DATA / "increments.json").read_text(encoding="utf-8"))
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    by_number, by_time = figure.subplots(1, 2, sharey=True)
    for case, marker, color in zip(data, "sDo", COLORS[:3], strict=True):
        rows = case["increments"]
        errors = [row["error"] for row in rows]
        line = {"marker": marker, "color": color, "markersize": 4, "label": case["name"]}
        by_number.loglog([row["steps"] for row in rows], errors, **line)
        by_time.loglog([row["seconds"] for row in rows], errors, **line)
        by_time.axvline(case["evolve"], color=color, linestyle="--", linewidth=1.2)
    by_time.plot([], [], "k--", linewidth=1.2, label="evolve: all events, to rounding")
    by_number.set(xlabel="increments for each line of the load", ylabel="error of contact forces")
    by_time.set(xlabel="seconds")
    for ax in (by_number, by_time):
        ax.grid(alpha=0.3)
    figure.legend(*by_time.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.savefig(into / "increments.png", dpi=110)


def _series(rows, name: str):
    """Return p and the figures of those rows that have them."""
    pairs = [(row["p"], row[name]) for row in rows if row.get(name)]
    return tuple(zip(*pairs, strict=True)) if pairs else ((), ())


def write_views(into: Path) -> None:
    """Write the pages that the tutorial on views frames."""
    into.mkdir(exist_ok=True, parents=True)
    scene = wedge().curve()
    View.of(scene, scene.run()).save(into / "wedge.html")


def draw_all(into: Path) -> None:
    """Draw everything."""
    into.mkdir(exist_ok=True)
    for name in ("bench", "peers"):
        draw_report(name, into)
    draw_arch(into)
    draw_scale(into)
    draw_straight(into)
    draw_increments(into)
    draw_body(block(), 0.7, into)
    draw_body(wedge(), 0.07, into)
