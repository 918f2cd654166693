"""Contact with Coulomb friction, static (Janovsky and Ligursky 2012) and quasi-static."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.frictionless import FromFrictionless
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad, HarmonicLoad

if TYPE_CHECKING:
    from pwscont import LoadHistory
    from pwscont_coulomb.matrices import read_matrices
    from pwscont_coulomb.quasi_static.pictures import draw_contact, draw_zones
    from pwscont_coulomb.quasi_static.system import QuasiStaticCoulomb

__all__ = [
    "AffineLoad",
    "ContactBody",
    "CoulombFriction",
    "CoulombLoad",
    "FromFrictionless",
    "HarmonicLoad",
    "LoadHistory",
    "QuasiStaticCoulomb",
    "draw_contact",
    "draw_zones",
    "read_matrices",
]


#: Names whose modules are imported at first use: static problems need none of these modules.
LATER = {
    "LoadHistory": "pwscont",
    "QuasiStaticCoulomb": "pwscont_coulomb.quasi_static.system",
    "draw_contact": "pwscont_coulomb.quasi_static.pictures",
    "draw_zones": "pwscont_coulomb.quasi_static.pictures",
    "read_matrices": "pwscont_coulomb.matrices",
}


def __getattr__(name: str) -> Any:
    if name in LATER:
        return getattr(import_module(LATER[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
