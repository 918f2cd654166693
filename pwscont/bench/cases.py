"""The problems of the bench: scenes with a known answer, and a few further problems."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import final

import numpy as np

from pwscont import (
    ExactLinear,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    enumerate_solutions,
    explore,
)
from pwscont.bench.truth.exact_path import verified_path
from pwscont.bench.truth.known_answer import TruePiece, Truth, UnknownAnswerError
from pwscont.bench.truth.problems import (
    Bratu,
    Circle,
    TwoCurves,
    bratu_pieces,
    circle_pieces,
    two_curves_pieces,
)
from pwscont.bench.truth.rational import straight_pieces
from pwscont.bench.truth.slicewise import cellwise_pieces
from pwscont.extending import Array, Metric, Reducible, uninterrupted
from pwscont.scenes.answer import Runnable
from pwscont.scenes.registry import load_scene, scene_names
from pwscont.scenes.scene import Scene

#: Number of values of alpha at which the answer is compared with an enumeration.
CHECKS = 37
#: Most cells of a system for which the answer is computed in every cell: more cells take too long.
MOST_CELLS = 64
#: Most unknowns of a system whose exact path is verified: then verification and all settings of the
#: steppers take half a minute.
MOST_UNKNOWNS = 200
AGREES = 1e-9  # largest difference of two answers, in typical magnitudes


@final
@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A problem and the true answer."""

    name: str
    system: PiecewiseSystem
    interval: tuple[float, float]
    truth: Truth

    @property
    def is_straight(self) -> bool:
        """Whether all pieces are straight, so that ExactLinear applies."""
        return isinstance(self.system, PiecewiseLinearSystem)


def case_names() -> list[str]:
    """Return the names of all problems and scenes, with or without known answer."""
    return [*OWN, *scene_names()]


def load_case(name: str, settings: Mapping[str, str] | None = None) -> Case:
    """Return the problem or scene of a name, with the answer; only scenes take settings."""
    return OWN[name]() if name in OWN else case_of(load_scene(name, settings))


def case_of(runnable: Runnable) -> Case:
    """Return the case of a scene, with the true answer."""
    scene = runnable.curve()
    if not isinstance(scene, Scene):
        raise UnknownAnswerError("it has two parameters")
    system, interval = scene.system, scene.interval
    if not isinstance(system, SlicewiseLinearSystem):
        raise UnknownAnswerError("its system is not affine in z, and no closed form is known")
    if isinstance(system, Reducible) and system.reduction(*interval):
        raise UnknownAnswerError("parts of its system are left out while it is followed")
    cells = prod(len(block.modes) for block in system.blocks())
    if cells <= MOST_CELLS:
        return _few_cells(scene.name, system, interval)
    if not isinstance(system, PiecewiseLinearSystem):
        raise UnknownAnswerError(f"its curved pieces are in {cells} cells, more than {MOST_CELLS}")
    return _too_many_cells(scene, system)


def _few_cells(name: str, system: SlicewiseLinearSystem, interval: tuple[float, float]) -> Case:
    if isinstance(system, PiecewiseLinearSystem):
        pieces, known_by = straight_pieces(system, interval), "rational arithmetic"
    else:
        pieces, known_by = cellwise_pieces(system, interval), "a solve per cell and alpha"
    case = _case(name, system, interval, pieces, known_by)
    _compare_with_enumeration(system, case.truth)
    return case


def _too_many_cells(scene: Scene, system: PiecewiseLinearSystem) -> Case:
    if system.size > MOST_UNKNOWNS:
        raise UnknownAnswerError(
            f"its system has {system.size} unknowns, more than the {MOST_UNKNOWNS} up to which its "
            "exact path is verified and followed with short steps in reasonable time"
        )
    interval, scale = scene.interval, Metric.of(system, scene.interval).scale
    search, stepper = scene.search, ExactLinear()
    found = uninterrupted(explore(system, interval, search=search, stepper=stepper))
    truth = verified_path(system, interval, scale, found.pieces)
    return Case(scene.name, system, interval, truth)


def _case(
    name: str,
    system: PiecewiseSystem,
    interval: tuple[float, float],
    pieces: Sequence[TruePiece],
    known_by: str,
) -> Case:
    scale = Metric.of(system, interval).scale
    return Case(name, system, interval, Truth(pieces, interval, scale, known_by))


def _compare_with_enumeration(system: SlicewiseLinearSystem, truth: Truth) -> None:
    lo, hi = truth.interval
    for share in (np.arange(CHECKS) + 1.0 / np.pi) / CHECKS:
        alpha = float(lo + share * (hi - lo))
        listed = [solution.z / truth.scale[:-1] for solution in enumerate_solutions(system, alpha)]
        on = [p.at(alpha)[:-1] / truth.scale[:-1] for p in truth.pieces if _over(p, alpha)]
        if len(listed) != len(on) or any(_off(z, listed) > AGREES for z in on):
            raise UnknownAnswerError(f"two ways to its answer disagree at alpha = {alpha}")


def _over(piece: TruePiece, alpha: float) -> bool:
    return piece.span[0] < alpha < piece.span[1]


def _off(z: Array, others: Sequence[Array]) -> float:
    return min(float(np.abs(z - other).max()) for other in others)


def _circle() -> Case:
    return _case("circle", Circle(), (-2.0, 2.0), circle_pieces(), "closed form")


def _two_curves() -> Case:
    return _case("two-curves", TwoCurves(), (-2.0, 2.0), two_curves_pieces(), "closed form")


def _bratu() -> Case:
    system = Bratu()
    pieces = bratu_pieces(system, 0.5)
    return _case("bratu", system, (0.5, 4.0), pieces, "Newton at given heights; extended system")


#: Problems that are no scenes.
OWN: dict[str, Callable[[], Case]] = {
    "circle": _circle,
    "two-curves": _two_curves,
    "bratu": _bratu,
}
