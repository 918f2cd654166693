"""Do a stepper, a detector, a search of one's own keep their contracts? For implementers.

Each is tried on small systems whose curves are known: a circle with a kink that changes nothing, a
cubic in two unknowns of different size, and a straight line. What is wrong is a defect with its
place, as for :func:`pwscont.check_system`.
"""

from pwscont.continuation.kit.detectors import check_detector
from pwscont.continuation.kit.searches import check_search
from pwscont.continuation.kit.steppers import check_stepper

__all__ = ["check_detector", "check_search", "check_stepper"]
