"""Searches for starts: solutions from which components can be traced."""

from pwscont.search.all_transitions import AllTransitions
from pwscont.search.enumeration import EndPoints, Slices, enumerate_solutions
from pwscont.search.multi_start import MultiStart
from pwscont.search.search import Search

__all__ = ["AllTransitions", "EndPoints", "MultiStart", "Search", "Slices", "enumerate_solutions"]
