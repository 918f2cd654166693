"""The branch graph, its queries and its file."""

from pwscont.graph.branch_graph import BranchGraph
from pwscont.graph.records import Piece, Solution, SpecialPoint

__all__ = ["BranchGraph", "Piece", "Solution", "SpecialPoint"]
