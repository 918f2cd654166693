"""Static contact with Coulomb friction (Janovsky and Ligursky 2012), a plug-in of pwscont."""

from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.frictionless import FromFrictionless
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad, HarmonicLoad

__all__ = [
    "AffineLoad",
    "ContactBody",
    "CoulombFriction",
    "CoulombLoad",
    "FromFrictionless",
    "HarmonicLoad",
]
