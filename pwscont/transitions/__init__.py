"""Special points: the ends of smooth pieces, and the rays that leave from there."""

from pwscont.transitions.bounding import BoundingTests
from pwscont.transitions.branch_points import SmoothBranchPoints
from pwscont.transitions.detector import TransitionDetector
from pwscont.transitions.ends import IntervalEnds
from pwscont.transitions.smooth_folds import SmoothFolds
from pwscont.transitions.straight import StraightTests

__all__ = [
    "BoundingTests",
    "IntervalEnds",
    "SmoothBranchPoints",
    "SmoothFolds",
    "StraightTests",
    "TransitionDetector",
]
