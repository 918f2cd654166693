"""Steppers, each of which owns one step along a curve."""

from pwscont.stepping.exact_linear import ExactLinear
from pwscont.stepping.looks import gap_of
from pwscont.stepping.natural_parameter import NaturalParameter
from pwscont.stepping.pseudo_arclength import PseudoArclength
from pwscont.stepping.stepper import Segment, Stepper

__all__ = ["ExactLinear", "NaturalParameter", "PseudoArclength", "Segment", "Stepper", "gap_of"]
