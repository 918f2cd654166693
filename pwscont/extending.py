"""What whoever writes a detector, a stepper or a search imports: all types in their signatures.

A *detector* (:class:`TransitionDetector`) reads functions along a piece and makes special points
where they fall to zero; ``detectors=`` of :func:`pwscont.trace` and :func:`pwscont.explore` adds it
to the default ones. A *stepper* (:class:`Stepper`) owns one step along the curve of one selection.
A *search* (:class:`Search`) yields starts.
"""

from pwscont.basics.arrays import Array, Matrix
from pwscont.basics.guarantee import Guarantee, SearchScope
from pwscont.basics.kind import Kind
from pwscont.basics.outcome import Failure, FailureReason
from pwscont.curve.corrector import Corrected, Corrector
from pwscont.curve.curve import Curve, State
from pwscont.curve.metric import Metric
from pwscont.curve.newton import newton
from pwscont.curve.predictor import Predictor
from pwscont.curve.semismooth import semismooth_newton
from pwscont.search import Search
from pwscont.stepping import Stepper
from pwscont.stepping.acceptance import accepted
from pwscont.stepping.landing import land_on, land_on_end
from pwscont.stepping.stepper import CurvedSegment, Segment, StraightSegment
from pwscont.system.selection import Selection
from pwscont.transitions import TransitionDetector
from pwscont.transitions.detector import Reading, SpecialPointFound
from pwscont.transitions.location import locate_point, locate_sign_change, locate_zero
from pwscont.transitions.rays import Ray

__all__ = [
    "Array",
    "Corrected",
    "Corrector",
    "Curve",
    "CurvedSegment",
    "Failure",
    "FailureReason",
    "Guarantee",
    "Kind",
    "Matrix",
    "Metric",
    "Predictor",
    "Ray",
    "Reading",
    "Search",
    "SearchScope",
    "Segment",
    "Selection",
    "SpecialPointFound",
    "State",
    "Stepper",
    "StraightSegment",
    "TransitionDetector",
    "accepted",
    "land_on",
    "land_on_end",
    "locate_point",
    "locate_sign_change",
    "locate_zero",
    "newton",
    "semismooth_newton",
]
