"""The public names of pwscont; users import them from ``pwscont`` itself."""

from typing import Any

from pwscont.continuation import explore, trace
from pwscont.continuation.journal import Journal
from pwscont.continuation.kit import check_detector, check_search, check_stepper
from pwscont.foundation.character import Character
from pwscont.foundation.errors import (
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
from pwscont.foundation.limits import Limits
from pwscont.graph import BranchGraph
from pwscont.interface.scene import Panel, ParameterPath, Scene
from pwscont.model.check import check_system
from pwscont.model.fold_locus import FoldLocus
from pwscont.model.locus import TransitionLocus
from pwscont.model.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.numerics.banded import BandedJacobian
from pwscont.numerics.corrector import BorderedNewton, MoorePenrose
from pwscont.numerics.predictor import Hermite, Secant, Tangent
from pwscont.numerics.step_size import StepSize
from pwscont.search import (
    AllTransitions,
    EndPoints,
    MultiStart,
    Search,
    Slices,
    enumerate_solutions,
)
from pwscont.stepping import ExactLinear, NaturalParameter, PseudoArclength, Stepper
from pwscont.transitions import TransitionDetector
from pwscont.transitions.events import Stop

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
        from pwscont.interface.plotting import plot  # noqa: PLC0415

        return plot
    if name == "draw_counts":
        from pwscont.interface.counting import draw_counts  # noqa: PLC0415

        return draw_counts
    raise AttributeError(f"module 'pwscont' has no attribute {name!r}")
