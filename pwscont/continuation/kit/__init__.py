"""Checks that a user's own stepper, detector or search keeps its contract.

Each is tried on small systems whose curves are known: a circle with a kink that changes nothing, a
cubic in two unknowns of different size, and a straight line. A report lists the defects with their
places, as that of :func:`pwscont.check_system` does.
"""

from pwscont.continuation.kit.detectors import check_detector
from pwscont.continuation.kit.searches import check_search
from pwscont.continuation.kit.steppers import check_stepper

__all__ = ["check_detector", "check_search", "check_stepper"]
