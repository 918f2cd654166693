"""The answer of a scene with two parameters."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from pwscont.basics.looks import counted, named
from pwscont.graph.presentation import finite
from pwscont.scenes.answer import Answer
from pwscont.scenes.look import DEFAULT_LOOK, Look
from pwscont.two_parameters.axes import PlaneShown
from pwscont.two_parameters.loci import LocusPart
from pwscont.two_parameters.plane import Plane, Sector
from pwscont.two_parameters.table import report


@final
@dataclass(frozen=True, slots=True)
class PlaneAnswer(Answer):
    """Loci of transitions, and the sectors between them."""

    scene: PlaneShown
    plane: Plane

    def __repr__(self) -> str:
        return named(self, self.scene, counted(len(self.plane.sectors), "sector"))

    def as_text(self) -> str:
        """Return loci and sectors."""
        return report(self.scene, self.plane)

    def as_dict(self) -> dict[str, Any]:
        """Return loci and sectors as plain lists and numbers.

        The keys are those of a scene with one parameter. The parameter is mu, along which the
        loci are followed; states are (z, alpha), as named by ``names`` and ``unknowns``; nodes and
        pieces are those of all loci. A row of ``multiplicity`` holds the most solutions that an
        alpha has for mu in between, None for infinitely many. ``solutions`` are those in the
        middle of every sector.
        """
        scene, plane = self.scene, self.plane
        balances = set(plane.balances())
        names = [*scene.family(plane.mus[1]).names(), scene.axes.alpha]
        return {
            "scene": scene.name,
            "parameter": _range(scene.axes.mu, plane.mus),
            "second_parameter": _range(scene.axes.alpha, plane.alphas),
            "unknowns": names,
            "names": names,
            **self._graphs(),
            "multiplicity": [[lo, hi, finite(n)] for lo, hi, n in plane.most_solutions()],
            "balance": {
                "value": next(iter(balances)) if len(balances) == 1 else None,
                "constant": len(balances) <= 1,
            },
            "solutions": [s for sector in plane.sectors for s in _solutions(sector)],
            "loci": [[_part(part) for part in some] for some in plane.parts],
            "sectors": [self._sector(sector) for sector in plane.sectors],
            "searched": plane.searched,
            "guarantee": plane.guarantee,
            "mixed": [point.tolist() for point in plane.mixed],
            **self._lowest_folds(),
        }

    def _graphs(self) -> dict[str, Any]:
        """Return the graphs of all loci as one, with nodes and pieces renumbered."""
        nodes: list[dict[str, Any]] = []
        pieces: list[dict[str, Any]] = []
        components = 0
        for number, locus in enumerate(self.plane.loci):
            graph, first, mark = locus.graph.to_dict(), len(nodes), {"locus": number}
            pieces += [
                piece
                | mark
                | {
                    "id": len(pieces) + i,
                    "component": components + piece["component"],
                    "start": first + piece["start"],
                    "end": first + piece["end"],
                }
                for i, piece in enumerate(graph["pieces"])
            ]
            nodes += [node | mark | {"id": first + node["id"]} for node in graph["nodes"]]
            components += graph["components"]
        return {"components": components, "nodes": nodes, "pieces": pieces}

    def _sector(self, sector: Sector) -> dict[str, Any]:
        return {
            "name": self.scene.sector_name(sector),
            "count": finite(sector.count),
            "labels": list(sector.labels),
            "polygons": [region.polygon.tolist() for region in sector.regions],
            "proofs": [self.plane.proof(region) for region in sector.regions],
        }

    def _lowest_folds(self) -> dict[str, Any]:
        if not self.scene.lowest_fold:
            return {}
        tips = self.plane.lowest_folds
        return {"lowest_folds": [{"alpha": float(x[-1]), "z": x[:-1].tolist()} for x in tips]}

    def write(self, directory: Path, look: Look = DEFAULT_LOOK) -> list[Path]:
        """Write the picture, and what ``--json`` prints."""
        from pwscont.two_parameters.plotting import draw_plane  # noqa: PLC0415  where asked for

        name = self.scene.name
        picture = look.save(draw_plane(self.scene, self.plane), directory, name)
        file = directory / f"{name}.json"
        text = json.dumps(self.as_dict(), ensure_ascii=False, allow_nan=False)
        file.write_text(text + "\n", encoding="utf-8")
        return [picture, file]


def _range(name: str, ends: tuple[float, float]) -> dict[str, Any]:
    return {"name": name, "lo": ends[0], "hi": ends[1]}


def _part(part: LocusPart) -> dict[str, Any]:
    return {
        "crossing": str(part.crossing),
        "label": part.label,
        "points": part.plane.tolist(),
    }


def _solutions(sector: Sector) -> list[dict[str, Any]]:
    alpha, mu = map(float, sector.regions[0].inside)
    return [
        {
            "alpha": mu,
            "z": [*found.z.tolist(), alpha],
            "label": found.label,
            "det_sign": found.det_sign,
        }
        for found in sector.solutions
    ]
