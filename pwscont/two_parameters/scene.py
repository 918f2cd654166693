"""Scenes with two parameters, and the answers of such scenes."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, final

from pwscont import InvalidInputError, MissingPackageError, SlicewiseLinearSystem
from pwscont.extending import Report, checked_kind, counted, finite_array, named, silent
from pwscont.scenes.answer import DEFAULT_LOOK, Answer, Look, Runnable
from pwscont.two_parameters.affine import Window, is_affine
from pwscont.two_parameters.axes import Axes, PlaneShown
from pwscont.two_parameters.exact_plane import plane
from pwscont.two_parameters.loci import LocusPart
from pwscont.two_parameters.loci_plane import LociPlane
from pwscont.two_parameters.plane import Plane, Sector
from pwscont.two_parameters.table import report


@final
@dataclass(frozen=True, slots=True)
class PlaneAnswer(Answer):
    """The answer of a two-parameter scene: curves, and the sectors in between."""

    scene: PlaneShown
    plane: Plane

    def __repr__(self) -> str:
        return named(self, self.scene, counted(len(self.plane.sectors), "sector"))

    def as_text(self) -> str:
        """Return loci and sectors as text."""
        return report(self.scene, self.plane)

    def as_dict(self) -> dict[str, Any]:
        """Return loci and sectors as plain lists and numbers.

        The keys include all keys of a one-parameter scene. The parameter is mu, along which the
        loci are followed; states are (z, alpha), as named by ``names`` and ``unknowns``; nodes and
        pieces belong to all loci. A row of ``multiplicity`` holds a range of mu and the largest
        number of solutions at any alpha, None for infinitely many. ``solutions`` has the solutions
        in the middle of every sector.
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
            "multiplicity": [[lo, hi, _finite(n)] for lo, hi, n in plane.most_solutions()],
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
        """Return the graphs of all loci as a single graph, with nodes and pieces renumbered."""
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
            "count": _finite(sector.count),
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
        """Write the picture and the JSON of :meth:`as_dict`, and return the files."""
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


@final
@dataclass(frozen=True, slots=True, repr=False)
class PlaneScene(Runnable):
    """A family of systems, and a window of the plane of the parameters alpha and mu.

    A package offers a plane scene, like a :class:`~pwscont.Scene`, by an entry point of the group
    ``pwscont.scenes``.

    Attributes
    ----------
    name, title : str
    family : callable
        mu -> :class:`~pwscont.SlicewiseLinearSystem`; all systems have equal sizes and the same
        tests.
    alphas, mus : tuple of float
        The window.
    levels : tuple of float
        Values of mu; if loci are followed, only loci that meet a level are found.
    axes : Axes
    sectors : callable, optional
        Labels of the solutions in a region -> the name of the region; default no names.
    lowest_fold : str
        Name of the smallest mu on all folds; default: not reported.

    Examples
    --------
    >>> from pwscont import Axes, LCP, PlaneScene
    >>> def family(mu):
    ...     return LCP([[1, 2], [2, 1]], q=[mu, -1], d=[0, 1])
    >>> scene = PlaneScene("plane", "two loads", family, (-2.0, 2.0), (-2.0, 2.0), (0.0,), Axes())
    >>> sorted(sector.count for sector in scene.run().sectors)
    [1, 1, 1, 3]
    """

    name: str
    title: str
    family: Callable[[float], SlicewiseLinearSystem]
    alphas: tuple[float, float]
    mus: tuple[float, float]
    levels: tuple[float, ...]
    axes: Axes = field(default_factory=Axes)
    sectors: Callable[[tuple[str, ...]], str] | None = None
    lowest_fold: str = ""

    parameter: str = field(init=False)

    def __post_init__(self) -> None:
        if not callable(self.family):
            raise InvalidInputError(f"family must be a function of mu, got {self.family!r}")
        checked_kind("axes", self.axes, Axes, is_needed=True)
        object.__setattr__(self, "parameter", self.axes.mu)

    def run(self, report: Report = silent) -> Plane:
        """Return the exact map if alpha and mu enter affinely, else the plane of the loci.

        The exact map needs Shapely; without Shapely loci are followed, and a remark says so.
        """
        if not self.is_affine:
            return self._by_loci(report)
        try:
            return plane(self.family, self.alphas, self.mus)
        except MissingPackageError as missing:
            return replace(self._by_loci(report), remarks=(f"Loci were followed: {missing}",))

    @property
    def is_affine(self) -> bool:
        """Whether alpha and mu enter the systems affinely."""
        return is_affine(self.family, Window.of(self.alphas, self.mus))

    def _by_loci(self, report: Report) -> LociPlane:
        """Return the plane of the loci, with the solutions of every region."""
        (lo, hi), levels = self.mus, finite_array("levels", self.levels)
        if levels.ndim != 1 or not levels.size or not ((lo <= levels) & (levels <= hi)).all():
            raise InvalidInputError(
                f"levels must be values of mu from {lo} to {hi}, at least one, got {self.levels!r}"
            )
        return LociPlane.between(
            self.family, self.alphas, self.mus, self.levels, parameter=self.axes.mu, report=report
        )

    def sector_name(self, sector: Sector) -> str:
        """Return the name that the scene gives to a sector, empty without a name."""
        return self.sectors(sector.labels) if self.sectors else ""

    def values(self, wanted: Sequence[float] | None) -> tuple[float, ...]:
        """Return nothing: solutions are listed for every region.

        Raises
        ------
        InvalidInputError
            If values were asked for: a number is no point of the plane.
        """
        if wanted is not None:
            raise InvalidInputError(
                f"--at needs a scene with one parameter, and {self.name} has two "
                f"({self.axes.alpha} and {self.axes.mu}); run it without --at: it lists the "
                "solutions of every region"
            )
        return ()

    def plan(self) -> dict[str, str]:
        """Return the parts of the run, {name: words}."""
        if self.is_affine and find_spec("shapely"):
            return {
                "cut": "the polygons over which cells have their solutions, with each other",
                "solved": "every cell, once for the whole plane; no point is sampled",
            }
        return {
            "followed": "loci of transitions, between which modes stay what they are",
            "solved": "one point of each region, in which the number of solutions is one",
        }

    def solve(self, at: Sequence[float], report: Report) -> Answer:
        """Return the answer of the scene."""
        return PlaneAnswer(self, self.run(report))


def _finite(count: int | float) -> int | None:
    """Return a count, None for infinitely many, which JSON cannot say."""
    return None if math.isinf(count) else int(count)
