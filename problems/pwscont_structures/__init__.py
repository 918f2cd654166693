"""Structures that snap, soften, touch and buckle, a plug-in of pwscont."""

from pwscont_structures.membrane import membrane
from pwscont_structures.obstacle import ObstacleProblem, string
from pwscont_structures.plastic import PlasticTruss
from pwscont_structures.softening import SofteningBar
from pwscont_structures.strut import Strut, Support
from pwscont_structures.truss import TrussChain
from pwscont_structures.truss_search import AllEquilibria

__all__ = [
    "AllEquilibria",
    "ObstacleProblem",
    "PlasticTruss",
    "SofteningBar",
    "Strut",
    "Support",
    "TrussChain",
    "membrane",
    "string",
]
