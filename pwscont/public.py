"""The public names of pwscont; users import them from ``pwscont`` itself."""

from typing import Any

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
from pwscont.scenes.scene import Panel, ParameterPath, Scene
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
from pwscont.transitions.events import Stop
from pwscont.two_parameters.fold_locus import FoldLocus
from pwscont.two_parameters.transition_locus import TransitionLocus

__all__ = [
    "AllTransitions",
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
    "draw_counts",  # noqa: F822  by __getattr__
    "enumerate_solutions",
    "explore",
    "plot",  # noqa: F822  by __getattr__
    "trace",
]


def __getattr__(name: str) -> Any:
    """Import matplotlib only when a picture is asked for."""
    if name == "plot":
        from pwscont.scenes.plotting import plot  # noqa: PLC0415

        return plot
    if name == "draw_counts":
        from pwscont.scenes.counting import draw_counts  # noqa: PLC0415

        return draw_counts
    raise AttributeError(f"module 'pwscont' has no attribute {name!r}")
