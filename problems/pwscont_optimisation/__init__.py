"""Parametric optimisation, games and fixed points, a plug-in of pwscont."""

from pwscont_optimisation.fixed_points import BestReplies, Game, ReluLayer
from pwscont_optimisation.lasso import Lasso
from pwscont_optimisation.quadratic_program import QuadraticProgram

__all__ = ["BestReplies", "Game", "Lasso", "QuadraticProgram", "ReluLayer"]
