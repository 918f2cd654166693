"""pwscont: continuation of piecewise-smooth systems through kinks and folds."""

from pwscont.continuation import explore, trace
from pwscont.foundation.character import Character
from pwscont.graph import BranchGraph
from pwscont.model.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.stepping import ExactLinear, NaturalParameter, PseudoArclength, Stepper
from pwscont.transitions import TransitionDetector

__version__ = "0.1.0"

__all__ = [
    "BranchGraph",
    "Character",
    "ExactLinear",
    "NaturalParameter",
    "PiecewiseLinearSystem",
    "PiecewiseSystem",
    "PseudoArclength",
    "SlicewiseLinearSystem",
    "Stepper",
    "TransitionDetector",
    "explore",
    "trace",
]
