"""The public names of pwscont; users import these names from ``pwscont`` itself."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pwscont.basics.budget import Limits
from pwscont.basics.character import Character
from pwscont.basics.errors import (
    GraphFileError,
    InvalidInputError,
    InvalidSystemError,
    MissingPackageError,
    PwscontError,
    SceneNotFoundError,
    StartNotFoundError,
    SystemNeededError,
    UnknownNameError,
)
from pwscont.continuation import explore, trace
from pwscont.continuation.journal import Journal
from pwscont.curve.corrector import BorderedNewton, MoorePenrose
from pwscont.curve.pseudo_arclength import (
    Hermite,
    NaturalParameter,
    PseudoArclength,
    Secant,
    Tangent,
)
from pwscont.curve.stepper import ExactLinear, Stepper, StepSize
from pwscont.graph import BranchGraph
from pwscont.linear.jacobian import BandedJacobian
from pwscont.search import (
    AllTransitions,
    EndPoints,
    MultiStart,
    Search,
    Slices,
    enumerate_solutions,
)
from pwscont.system.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.transitions import TransitionDetector

if TYPE_CHECKING:
    from pwscont.events.user_event import Stop
    from pwscont.evolution.evolve import evolve
    from pwscont.evolution.graph import EvolutionGraph
    from pwscont.evolution.history import LoadHistory
    from pwscont.evolution.memory import SystemWithMemory
    from pwscont.evolution.scene import EvolutionScene
    from pwscont.kit.seams import check_detector, check_search, check_stepper
    from pwscont.kit.system import check_system
    from pwscont.notation.problems import LCP, AbsNormal, Complementarity
    from pwscont.notation.switched import Switched
    from pwscont.proof.everywhere import Everywhere
    from pwscont.proof.prove import prove
    from pwscont.scenes.panels import Panel, ParameterPath
    from pwscont.scenes.paths import draw_counts
    from pwscont.scenes.plotting import plot
    from pwscont.scenes.scene import Scene
    from pwscont.studies.measures import (
        CountAt,
        CriticalValue,
        FirstFold,
        MaxCount,
        Measure,
        NonUnique,
        NonUniqueLength,
        QuantityAt,
    )
    from pwscont.studies.result import StudyResult
    from pwscont.studies.study import Study
    from pwscont.two_parameters.axes import Axes
    from pwscont.two_parameters.exact_plane import plane
    from pwscont.two_parameters.locus import FoldLocus, TransitionLocus
    from pwscont.two_parameters.scene import PlaneScene
    from pwscont.view.view import View

__all__ = [
    "LCP",
    "AbsNormal",
    "AllTransitions",
    "Axes",
    "BandedJacobian",
    "Block",
    "BorderedNewton",
    "BranchGraph",
    "Character",
    "Complementarity",
    "CountAt",
    "CriticalValue",
    "EndPoints",
    "Everywhere",
    "EvolutionGraph",
    "EvolutionScene",
    "ExactLinear",
    "FirstFold",
    "FoldLocus",
    "GraphFileError",
    "Hermite",
    "InvalidInputError",
    "InvalidSystemError",
    "Journal",
    "Limits",
    "LoadHistory",
    "MaxCount",
    "Measure",
    "MissingPackageError",
    "MoorePenrose",
    "MultiStart",
    "NaturalParameter",
    "NonUnique",
    "NonUniqueLength",
    "Panel",
    "ParameterPath",
    "PiecewiseLinearSystem",
    "PiecewiseSystem",
    "PlaneScene",
    "PseudoArclength",
    "PwscontError",
    "QuantityAt",
    "Scene",
    "SceneNotFoundError",
    "Search",
    "Secant",
    "Slices",
    "SlicewiseLinearSystem",
    "StartNotFoundError",
    "StepSize",
    "Stepper",
    "Stop",
    "Study",
    "StudyResult",
    "Switched",
    "SystemNeededError",
    "SystemWithMemory",
    "Tangent",
    "TransitionDetector",
    "TransitionLocus",
    "UnknownNameError",
    "View",
    "check_detector",
    "check_search",
    "check_stepper",
    "check_system",
    "draw_counts",
    "enumerate_solutions",
    "evolve",
    "explore",
    "plane",
    "plot",
    "prove",
    "trace",
]


#: Names whose modules are imported at first use: a trace needs none of these modules.
LATER = {
    "AbsNormal": "pwscont.notation.problems",
    "Axes": "pwscont.two_parameters.axes",
    "Complementarity": "pwscont.notation.problems",
    "CountAt": "pwscont.studies.measures",
    "CriticalValue": "pwscont.studies.measures",
    "EvolutionGraph": "pwscont.evolution.graph",
    "EvolutionScene": "pwscont.evolution.scene",
    "Everywhere": "pwscont.proof.everywhere",
    "FirstFold": "pwscont.studies.measures",
    "FoldLocus": "pwscont.two_parameters.locus",
    "LCP": "pwscont.notation.problems",
    "LoadHistory": "pwscont.evolution.history",
    "MaxCount": "pwscont.studies.measures",
    "Measure": "pwscont.studies.measures",
    "NonUnique": "pwscont.studies.measures",
    "NonUniqueLength": "pwscont.studies.measures",
    "Panel": "pwscont.scenes.panels",
    "ParameterPath": "pwscont.scenes.panels",
    "PlaneScene": "pwscont.two_parameters.scene",
    "QuantityAt": "pwscont.studies.measures",
    "Scene": "pwscont.scenes.scene",
    "Stop": "pwscont.events.user_event",
    "Study": "pwscont.studies.study",
    "StudyResult": "pwscont.studies.result",
    "Switched": "pwscont.notation.switched",
    "SystemWithMemory": "pwscont.evolution.memory",
    "TransitionLocus": "pwscont.two_parameters.locus",
    "View": "pwscont.view.view",
    "check_detector": "pwscont.kit.seams",
    "check_search": "pwscont.kit.seams",
    "check_stepper": "pwscont.kit.seams",
    "check_system": "pwscont.kit.system",
    "draw_counts": "pwscont.scenes.paths",
    "evolve": "pwscont.evolution.evolve",
    "plane": "pwscont.two_parameters.exact_plane",
    "plot": "pwscont.scenes.plotting",
    "prove": "pwscont.proof.prove",
}


def __getattr__(name: str) -> Any:
    if name in LATER:
        return getattr(import_module(LATER[name]), name)
    raise AttributeError(f"module 'pwscont' has no attribute {name!r}")
