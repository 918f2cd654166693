"""All types in the signatures of the base classes by which users extend pwscont.

A *detector* (:class:`TransitionDetector`) reads functions along a piece and makes special points
where the functions fall to zero; ``detectors=`` of :func:`pwscont.trace` and
:func:`pwscont.explore` adds detectors to the default detectors. A *stepper* (:class:`Stepper`) owns
one step along the curve of one selection. A *search* (:class:`Search`) yields starts.

A *system* may do more than :class:`pwscont.PiecewiseSystem` asks for: leave out parts that provably
stay in one mode (:class:`Reducible`), end its curves at some interfaces (:class:`Ending`), hide
unknowns (:class:`HidesUnknowns`), bring searches of its kind (:class:`BringsSearches`), hand over
what proofs need (:class:`ExactData`, :class:`ExactRates`, :class:`GivesFormula`), and return a
Jacobian that is factorised in its own way (:class:`StructuredJacobian`). :class:`Compact` is kept
for old systems: nothing asks for essential unknowns any more.

A new kind of *scene* is a :class:`Runnable` that returns an :class:`Answer`. A scene whose
solutions are states of a body draws the states on the body by a :class:`BodyPicture`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pwscont.basics.arguments import checked_kind
from pwscont.basics.arrays import (
    Array,
    Indices,
    Matrix,
    Signs,
    dense,
    finite_array,
    generic,
    power_of_two,
)
from pwscont.basics.budget import check_budget
from pwscont.basics.files import write_file
from pwscont.basics.outcome import Failure, FailureReason, Guarantee, Kind, SearchScope
from pwscont.basics.printing import apart, card, counted, named, number, short, with_article
from pwscont.basics.quantities import Function, Quantities, as_written, spelled
from pwscont.basics.rounding import CONFIDENCE, CONVERGED, EPS, GUARD, SAME_ALPHA
from pwscont.continuation.plan import Report, checked_interval, plan_in_words, silent
from pwscont.continuation.run import uninterrupted
from pwscont.curve.corrector import Corrected, Corrector
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Border, newton
from pwscont.curve.pseudo_arclength import Predictor, accepted, land_on, land_on_end, land_on_zero
from pwscont.curve.semismooth import semismooth_newton
from pwscont.curve.stepper import CurvedSegment, Segment, Stepper, StraightSegment
from pwscont.enumeration.options import affine_forms
from pwscont.enumeration.polyhedron import Polyhedron
from pwscont.enumeration.tree import AffineCells, enumerate_cells
from pwscont.graph.branch_graph import DUST
from pwscont.graph.proved import Proof
from pwscont.graph.queries import fine_points
from pwscont.graph.records import FEW_DIGITS, Piece, Solution, SpecialPoint, attempted
from pwscont.linear.factor import (
    SMALL_PIVOT,
    BorderedFactor,
    DenseLU,
    Factor,
    Interior,
    ScaledFactor,
    row_scale,
)
from pwscont.linear.factorise import balanced
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.linear.threads import THREADS, one_thread
from pwscont.search.search import KnownBranches, Search
from pwscont.system.abilities import (
    BringsSearches,
    Compact,
    DecidesCorners,
    Ending,
    ExactData,
    ExactMode,
    ExactRates,
    GivesFormula,
    HidesUnknowns,
    Recovery,
    Reducible,
    Reduction,
    all_names,
    completed,
    shown_size,
)
from pwscont.system.box import Box
from pwscont.system.contract import checked_magnitudes, jacobian_at, residual_at
from pwscont.system.differences import Differences
from pwscont.system.selection import Selection
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.rays import Ray
from pwscont.transitions.zeros import locate_point, locate_sign_change, locate_zero

if TYPE_CHECKING:
    from pwscont.evolution.memory import Evolver, Moment, Moments, Way, WaysOn
    from pwscont.evolution.paths import EvolutionPath
    from pwscont.evolution.states import EvolutionState
    from pwscont.scenes.answer import DEFAULT_LOOK, Answer, Look, Runnable, values_within
    from pwscont.scenes.graph_answer import GraphAnswer
    from pwscont.scenes.panels import BodyPicture, Shapes, Shown

#: Other names of two classes, for whoever factorises a part of a matrix.
Core, ScaledCore = Factor, ScaledFactor

__all__ = [
    "CONFIDENCE",
    "CONVERGED",
    "DEFAULT_LOOK",
    "DUST",
    "EPS",
    "FEW_DIGITS",
    "GUARD",
    "SAME_ALPHA",
    "SMALL_PIVOT",
    "THREADS",
    "AffineCells",
    "Answer",
    "Array",
    "BodyPicture",
    "Border",
    "BorderedFactor",
    "Box",
    "BringsSearches",
    "Compact",
    "Core",
    "Corrected",
    "Corrector",
    "Curve",
    "CurvedSegment",
    "DecidesCorners",
    "DenseLU",
    "Differences",
    "Ending",
    "EvolutionPath",
    "EvolutionState",
    "Evolver",
    "ExactData",
    "ExactMode",
    "ExactRates",
    "Factor",
    "Failure",
    "FailureReason",
    "Function",
    "GivesFormula",
    "GraphAnswer",
    "Guarantee",
    "HidesUnknowns",
    "Indices",
    "Interior",
    "Kind",
    "KnownBranches",
    "Look",
    "Matrix",
    "Metric",
    "Moment",
    "Moments",
    "Piece",
    "Polyhedron",
    "Predictor",
    "Proof",
    "Quantities",
    "Ray",
    "Reading",
    "Recovery",
    "Reducible",
    "Reduction",
    "Report",
    "Runnable",
    "ScaledCore",
    "ScaledFactor",
    "Search",
    "SearchScope",
    "Segment",
    "Selection",
    "Shapes",
    "Shown",
    "Signs",
    "Solution",
    "SpecialPoint",
    "SpecialPointFound",
    "State",
    "Stepper",
    "StraightSegment",
    "StructuredJacobian",
    "TransitionDetector",
    "Way",
    "WaysOn",
    "accepted",
    "affine_forms",
    "all_names",
    "apart",
    "as_written",
    "attempted",
    "balanced",
    "card",
    "check_budget",
    "checked_interval",
    "checked_kind",
    "checked_magnitudes",
    "completed",
    "counted",
    "dense",
    "enumerate_cells",
    "fine_points",
    "finite_array",
    "generic",
    "jacobian_at",
    "land_on",
    "land_on_end",
    "land_on_zero",
    "locate_point",
    "locate_sign_change",
    "locate_zero",
    "named",
    "newton",
    "number",
    "one_thread",
    "plan_in_words",
    "power_of_two",
    "residual_at",
    "row_scale",
    "semismooth_newton",
    "short",
    "shown_size",
    "silent",
    "spelled",
    "uninterrupted",
    "values_within",
    "with_article",
    "write_file",
]


#: Names whose modules are imported at first use: the core needs no scene, and static problems have
#: no evolutions.
LATER = {
    "Answer": "pwscont.scenes.answer",
    "BodyPicture": "pwscont.scenes.panels",
    "DEFAULT_LOOK": "pwscont.scenes.answer",
    "EvolutionPath": "pwscont.evolution.paths",
    "EvolutionState": "pwscont.evolution.states",
    "GraphAnswer": "pwscont.scenes.graph_answer",
    "Look": "pwscont.scenes.answer",
    "Runnable": "pwscont.scenes.answer",
    "Shapes": "pwscont.scenes.panels",
    "Shown": "pwscont.scenes.panels",
    "values_within": "pwscont.scenes.answer",
    **dict.fromkeys(("Evolver", "Moment", "Moments", "Way", "WaysOn"), "pwscont.evolution.memory"),
}


def __getattr__(name: str) -> Any:
    if name in LATER:
        return getattr(import_module(LATER[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
