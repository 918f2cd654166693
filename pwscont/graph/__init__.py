"""Floor 5: the branch graph, its queries and its file."""

from pwscont.foundation.records import Piece, Solution, SpecialPoint
from pwscont.graph.branch_graph import BranchGraph

__all__ = ["BranchGraph", "Piece", "Solution", "SpecialPoint"]
