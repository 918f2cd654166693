"""pwscont: continuation of piecewise-smooth systems through kinks and folds."""

from typing import Any

from pwscont.continuation import explore, trace
from pwscont.foundation.character import Character
from pwscont.graph import BranchGraph
from pwscont.interface.scene import Panel, ParameterPath, Scene
from pwscont.model.check import check_system
from pwscont.model.system import (
    Block,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
)
from pwscont.stepping import ExactLinear, NaturalParameter, PseudoArclength, Stepper
from pwscont.transitions import TransitionDetector

__version__ = "0.1.0"

__all__ = [
    "Block",
    "BranchGraph",
    "Character",
    "ExactLinear",
    "NaturalParameter",
    "Panel",
    "ParameterPath",
    "PiecewiseLinearSystem",
    "PiecewiseSystem",
    "PseudoArclength",
    "Scene",
    "SlicewiseLinearSystem",
    "Stepper",
    "TransitionDetector",
    "check_system",
    "explore",
    "plot",
    "trace",
]


def __getattr__(name: str) -> Any:
    """Import matplotlib only when a picture is asked for."""
    if name == "plot":
        from pwscont.interface.plotting import plot  # noqa: PLC0415

        return plot
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
