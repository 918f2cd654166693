"""The public names of pwscont; users import them from ``pwscont`` itself."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

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
from pwscont.basics.limits import Limits
from pwscont.continuation import explore, trace
from pwscont.continuation.journal import Journal
from pwscont.continuation.kit import check_detector, check_search, check_stepper
from pwscont.curve.corrector import BorderedNewton, MoorePenrose
from pwscont.curve.predictor import Hermite, Secant, Tangent
from pwscont.curve.step_size import StepSize
from pwscont.graph import BranchGraph
from pwscont.linear.banded import BandedJacobian
from pwscont.scenes.panels import Panel, ParameterPath
from pwscont.scenes.scene import Scene
from pwscont.search import (
    AllTransitions,
    EndPoints,
    MultiStart,
    Search,
    Slices,
    enumerate_solutions,
)
from pwscont.stepping import ExactLinear, NaturalParameter, PseudoArclength, Stepper
from pwscont.system.check import check_system
from pwscont.system.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.transitions import TransitionDetector
from pwscont.transitions.user_event import Stop
from pwscont.two_parameters.fold_locus import FoldLocus
from pwscont.two_parameters.transition_locus import TransitionLocus

if TYPE_CHECKING:
    from pwscont.scenes.counting import draw_counts
    from pwscont.scenes.plotting import plot
    from pwscont.two_parameters.axes import Axes
    from pwscont.two_parameters.scene import PlaneScene

__all__ = [
    "AllTransitions",
    "Axes",
    "BandedJacobian",
    "Block",
    "BorderedNewton",
    "BranchGraph",
    "Character",
    "EndPoints",
    "ExactLinear",
    "FoldLocus",
    "GraphFileError",
    "Hermite",
    "InvalidInputError",
    "InvalidSystemError",
    "Journal",
    "Limits",
    "MissingPackageError",
    "MoorePenrose",
    "MultiStart",
    "NaturalParameter",
    "Panel",
    "ParameterPath",
    "PiecewiseLinearSystem",
    "PiecewiseSystem",
    "PlaneScene",
    "PseudoArclength",
    "PwscontError",
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
    "SystemNeededError",
    "Tangent",
    "TransitionDetector",
    "TransitionLocus",
    "UnknownNameError",
    "check_detector",
    "check_search",
    "check_stepper",
    "check_system",
    "draw_counts",
    "enumerate_solutions",
    "explore",
    "plot",
    "trace",
]


#: Names whose modules are imported when the name is used: they import matplotlib.
LATER = {
    "Axes": "pwscont.two_parameters.axes",
    "PlaneScene": "pwscont.two_parameters.scene",
    "draw_counts": "pwscont.scenes.counting",
    "plot": "pwscont.scenes.plotting",
}


def __getattr__(name: str) -> Any:
    if name in LATER:
        return getattr(import_module(LATER[name]), name)
    raise AttributeError(f"module 'pwscont' has no attribute {name!r}")
