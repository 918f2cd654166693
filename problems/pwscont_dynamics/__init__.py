"""Equilibria of Filippov systems and periodic points of maps, a plug-in of pwscont."""

from pwscont_dynamics.filippov import FilippovEquilibria
from pwscont_dynamics.maps import AffinePeriodicPoints, PeriodicPoints

__all__ = ["AffinePeriodicPoints", "FilippovEquilibria", "PeriodicPoints"]
