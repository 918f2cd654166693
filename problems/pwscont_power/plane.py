"""The scene of a loading and a reactive limit, with table and picture."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from pwscont import InvalidInputError
from pwscont.extending import DEFAULT_LOOK, Answer, Look, Report, Runnable
from pwscont_power.loci import Crossing, Family, Loci, Part, Range, follow_loci

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES: dict[Crossing, dict[str, Any]] = {
    Crossing.LIMIT: {"color": "0.25", "linewidth": 1.2},
    Crossing.LIMIT_NOSE: {"color": "#CC79A7", "linewidth": 2.8},
    Crossing.NOSE: {"color": "#D55E00", "linewidth": 2.2},
}
SEARCHED = "limits and noses at Q_max = {}, from a few starts, and followed"
GUARANTEE = "no promise: loci that meet none of these values, or no start leads to, are missing"


@final
@dataclass(frozen=True, slots=True, repr=False)
class LimitPlane(Runnable):
    """A network whose loading and a reactive limit vary.

    Attributes
    ----------
    name, title : str
    family : callable
        Q_max -> PowerFlow.
    loadings, limits : tuple of float
        The window of loading and Q_max.
    levels : tuple of float
        Values of Q_max at which limits and noses are looked for.
    """

    name: str
    title: str
    family: Family
    loadings: Range
    limits: Range
    levels: tuple[float, ...]
    parameter: str = field(default="Q_max", init=False)

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return nothing: loci are listed, not solutions.

        Raises
        ------
        InvalidInputError
            If values were asked for.
        """
        if wanted is not None:
            raise InvalidInputError(
                f"--at needs a scene with one parameter, and {self.name} has two; run three-bus "
                "with -s Q_max=... for the solutions at one of them"
            )
        return ()

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Follow the loci."""
        found = follow_loci(self.family, self.loadings, self.limits, self.levels, report)
        return LimitPlaneAnswer(self, found)


@final
@dataclass(frozen=True, slots=True)
class LimitPlaneAnswer(Answer):
    """The loci of limits and noses, and where noses meet limits."""

    scene: LimitPlane
    loci: Loci

    @property
    def searched(self) -> str:
        """The search for loci in words."""
        return SEARCHED.format(", ".join(f"{level:g}" for level in self.scene.levels))

    def as_text(self) -> str:
        """Return loci and meetings."""
        ranges = zip(("Q_max", "lambda"), (self.scene.limits, self.scene.loadings), strict=True)
        window = ", ".join(f"{name} in [{lo:g}, {hi:g}]" for name, (lo, hi) in ranges)
        return "\n".join([f"{self.scene.name}: {self.scene.title}", window, "", *self._lines()])

    def _lines(self) -> Iterator[str]:
        yield f"{'locus':26}{'Q_max':>22}{'lambda':>24}  modes"
        for part in self.loci.parts:
            (lo, first), (hi, last) = part.plane[[0, -1]]
            spans = f"{first:10.6g} to {last:8.6g}{lo:12.6g} to {hi:8.6g}"
            yield f"{part.crossing:26}{spans}  {part.label}"
        yield ""
        for loading, limit in self.loci.meetings:
            yield f"limit and nose meet at Q_max = {limit:.9g}, lambda = {loading:.9g}"
        yield from ("", f"searched: {self.searched}", f"guarantee: {GUARANTEE}")

    def as_dict(self) -> dict[str, Any]:
        """Return the same as plain lists and numbers, with the keys of all scenes."""
        graphs = [graph.to_dict() for graph in self.loci.graphs]
        names = [*self.scene.family(self.scene.levels[0]).names(), "lambda"]
        return {
            "scene": self.scene.name,
            "parameter": _range("Q_max", self.scene.limits),
            "second_parameter": _range("lambda", self.scene.loadings),
            "names": names,
            "components": sum(graph["components"] for graph in graphs),
            **_joined(graphs),
            "multiplicity": [],
            "balance": {"value": None, "constant": False},
            "solutions": [],
            "loci": [_part(part) for part in self.loci.parts],
            "meetings": self.loci.meetings.tolist(),
            "searched": self.searched,
            "guarantee": GUARANTEE,
        }

    def write(self, directory: Path, look: Look = DEFAULT_LOOK) -> list[Path]:
        """Write the picture, and what ``--json`` prints."""
        picture = look.save(draw(self), directory, self.scene.name)
        file = directory / f"{self.scene.name}.json"
        file.write_text(json.dumps(self.as_dict(), ensure_ascii=False) + "\n", encoding="utf-8")
        return [picture, file]


def _range(name: str, ends: Range) -> dict[str, Any]:
    return {"name": name, "lo": ends[0], "hi": ends[1]}


def _part(part: Part) -> dict[str, Any]:
    return {"crossing": str(part.crossing), "label": part.label, "points": part.plane.tolist()}


def _joined(graphs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return nodes and pieces of several graphs, renumbered."""
    nodes: list[dict[str, Any]] = []
    pieces: list[dict[str, Any]] = []
    for number, graph in enumerate(graphs):
        first, before = len(nodes), {"locus": number, "component": number}
        for piece in graph["pieces"]:
            ends = {end: first + piece[end] for end in ("start", "end")}
            pieces.append(piece | before | ends | {"id": len(pieces)})
        nodes += [node | {"locus": number, "id": first + node["id"]} for node in graph["nodes"]]
    return {"nodes": nodes, "pieces": pieces}


def draw(answer: LimitPlaneAnswer) -> Figure:
    """Draw the loci, and mark where limit and nose meet."""
    from matplotlib.figure import Figure  # noqa: PLC0415  only where asked for

    figure = Figure(figsize=(6.8, 5.0), layout="constrained")
    ax = figure.subplots()
    drawn = set()
    for part in answer.loci.parts:
        label = None if part.crossing in drawn else str(part.crossing)
        ax.plot(*part.plane.T, label=label, **STYLES[part.crossing])
        drawn.add(part.crossing)
    if len(answer.loci.meetings):
        ax.plot(*answer.loci.meetings.T, "ko", markersize=5, label="limit and nose meet")
    for loading, limit in answer.loci.meetings:
        words = f"λ = {loading:.5f}, Q max = {limit:.5f} "
        ax.annotate(words, (loading, limit), (-6, 4), textcoords="offset points", ha="right")
    ax.set(xlabel="loading λ", ylabel="Q max", ylim=answer.scene.limits)
    ax.margins(x=0.08)
    ax.grid(alpha=0.3)
    ax.set_title(answer.scene.title, fontsize="medium")
    figure.legend(loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    return figure
