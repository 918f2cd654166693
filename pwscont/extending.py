"""All types in the signatures of the base classes by which users extend pwscont.

A *detector* (:class:`TransitionDetector`) reads functions along a piece and makes special points
where the functions fall to zero; ``detectors=`` of :func:`pwscont.trace` and
:func:`pwscont.explore` adds detectors to the default detectors. A *stepper* (:class:`Stepper`) owns
one step along the curve of one selection. A *search* (:class:`Search`) yields starts.

A *system* may do more than :class:`pwscont.PiecewiseSystem` asks for: leave out parts that provably
stay in one mode (:class:`Reducible`), end its curves at some interfaces (:class:`Ending`), hide
unknowns (:class:`HidesUnknowns`), bring searches of its kind (:class:`BringsSearches`), and return
a Jacobian that is factorised in its own way (:class:`StructuredJacobian`). Nothing asks a
:class:`Compact` system for its essential unknowns any more.

A new kind of *scene* is a :class:`Runnable` that returns an :class:`Answer`. A scene whose
solutions are states of a body draws the states on the body by a :class:`BodyPicture`.
"""

from pwscont.basics.arrays import Array, Indices, Matrix, dense, finite_array
from pwscont.basics.budget import check_budget
from pwscont.basics.looks import card, counted, named
from pwscont.basics.outcome import Failure, FailureReason, Guarantee, Kind, SearchScope
from pwscont.basics.rounding import CONVERGED, EPS, GUARD
from pwscont.continuation.plan import Report, uninterrupted
from pwscont.curve.corrector import Corrected, Corrector
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.newton import Border, newton
from pwscont.curve.predictor import Predictor
from pwscont.curve.pseudo_arclength import accepted, land_on, land_on_end, land_on_zero
from pwscont.curve.semismooth import semismooth_newton
from pwscont.curve.stepper import CurvedSegment, Segment, Stepper, StraightSegment
from pwscont.evolution.states import EvolutionState
from pwscont.evolution.ways import Evolver, Moment, Moments, Way, WaysOn
from pwscont.graph.proved import Proof
from pwscont.graph.records import Piece, Solution, SpecialPoint
from pwscont.linear.bordered import BorderedFactor, Interior, row_scale
from pwscont.linear.factor import Factor, ScaledFactor, power_of_two
from pwscont.linear.jacobian import StructuredJacobian
from pwscont.linear.updates import RowMatrix, RowSolver, Updating, drifted
from pwscont.scenes.answer import DEFAULT_LOOK, Answer, Look, Runnable, values_within
from pwscont.scenes.graph_answer import GraphAnswer
from pwscont.scenes.panels import BodyPicture, Shapes, Shown
from pwscont.search.search import KnownBranches, Search
from pwscont.system.abilities import (
    BringsSearches,
    Compact,
    DecidesCorners,
    Ending,
    ExactData,
    ExactMode,
    HidesUnknowns,
    Recovery,
    Reducible,
    Reduction,
)
from pwscont.system.contract import checked_magnitudes
from pwscont.system.selection import Selection
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.location import locate_point, locate_sign_change, locate_zero
from pwscont.transitions.rays import Ray

#: Other names of two classes, for whoever factorises a part of a matrix.
Core, ScaledCore = Factor, ScaledFactor

__all__ = [
    "CONVERGED",
    "DEFAULT_LOOK",
    "EPS",
    "GUARD",
    "Answer",
    "Array",
    "BodyPicture",
    "Border",
    "BorderedFactor",
    "BringsSearches",
    "Compact",
    "Core",
    "Corrected",
    "Corrector",
    "Curve",
    "CurvedSegment",
    "DecidesCorners",
    "Ending",
    "EvolutionState",
    "Evolver",
    "ExactData",
    "ExactMode",
    "Factor",
    "Failure",
    "FailureReason",
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
    "Predictor",
    "Proof",
    "Ray",
    "Reading",
    "Recovery",
    "Reducible",
    "Reduction",
    "Report",
    "RowMatrix",
    "RowSolver",
    "Runnable",
    "ScaledCore",
    "ScaledFactor",
    "Search",
    "SearchScope",
    "Segment",
    "Selection",
    "Shapes",
    "Shown",
    "Solution",
    "SpecialPoint",
    "SpecialPointFound",
    "State",
    "Stepper",
    "StraightSegment",
    "StructuredJacobian",
    "TransitionDetector",
    "Updating",
    "Way",
    "WaysOn",
    "accepted",
    "card",
    "check_budget",
    "checked_magnitudes",
    "counted",
    "dense",
    "drifted",
    "finite_array",
    "land_on",
    "land_on_end",
    "land_on_zero",
    "locate_point",
    "locate_sign_change",
    "locate_zero",
    "named",
    "newton",
    "power_of_two",
    "row_scale",
    "semismooth_newton",
    "uninterrupted",
    "values_within",
]
