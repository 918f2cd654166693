"""What whoever writes a detector, a stepper or a search imports: all types in their signatures.

A *detector* (:class:`TransitionDetector`) reads functions along a piece and makes special points
where they fall to zero; ``detectors=`` of :func:`pwscont.trace` and :func:`pwscont.explore` adds it
to the default ones. A *stepper* (:class:`Stepper`) owns one step along the curve of one selection.
A *search* (:class:`Search`) yields starts.
"""

from pwscont.foundation.arrays import Array, Matrix
from pwscont.foundation.guarantee import Promise, Searched
from pwscont.foundation.kind import Kind
from pwscont.foundation.outcome import Failure, Trouble
from pwscont.model.selection import Selection
from pwscont.numerics.corrector import Corrected, Corrector
from pwscont.numerics.curve import Curve, State
from pwscont.numerics.metric import Metric
from pwscont.numerics.newton import newton
from pwscont.numerics.predictor import Predictor
from pwscont.numerics.semismooth import semismooth_newton
from pwscont.search import Search
from pwscont.stepping import Stepper
from pwscont.stepping.acceptance import accepted
from pwscont.stepping.landing import land_on, land_on_end
from pwscont.stepping.stepper import CurvedSegment, Segment, StraightSegment
from pwscont.transitions import TransitionDetector
from pwscont.transitions.detector import Arrival, Reading
from pwscont.transitions.location import locate_point, locate_sign_change, locate_zero
from pwscont.transitions.rays import Ray

__all__ = [
    "Array",
    "Arrival",
    "Corrected",
    "Corrector",
    "Curve",
    "CurvedSegment",
    "Failure",
    "Kind",
    "Matrix",
    "Metric",
    "Predictor",
    "Promise",
    "Ray",
    "Reading",
    "Search",
    "Searched",
    "Segment",
    "Selection",
    "State",
    "Stepper",
    "StraightSegment",
    "TransitionDetector",
    "Trouble",
    "accepted",
    "land_on",
    "land_on_end",
    "locate_point",
    "locate_sign_change",
    "locate_zero",
    "newton",
    "semismooth_newton",
]
