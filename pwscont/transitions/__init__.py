"""Special points: the ends of smooth pieces, and the rays that leave from there."""

from pwscont.transitions.bounding import BoundingTests
from pwscont.transitions.branch_point import SmoothBranchPoints
from pwscont.transitions.detector import Reading, SpecialPointFound, TransitionDetector
from pwscont.transitions.fold import SmoothFolds
from pwscont.transitions.interval import IntervalEnds
from pwscont.transitions.rays import Ray
from pwscont.transitions.straight import StraightTests

__all__ = [
    "BoundingTests",
    "IntervalEnds",
    "Ray",
    "Reading",
    "SmoothBranchPoints",
    "SmoothFolds",
    "SpecialPointFound",
    "StraightTests",
    "TransitionDetector",
]
