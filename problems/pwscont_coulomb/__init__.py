"""Contact with Coulomb friction, static (Janovsky and Ligursky 2012) and quasi-static."""

from typing import TYPE_CHECKING, Any

from pwscont import LoadHistory
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.frictionless import FromFrictionless
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad, HarmonicLoad

if TYPE_CHECKING:
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
]


def __getattr__(name: str) -> Any:
    """Load what follows histories at first use: static problems need none of that."""
    if name == "QuasiStaticCoulomb":
        from pwscont_coulomb.quasi_static.system import QuasiStaticCoulomb  # noqa: PLC0415

        return QuasiStaticCoulomb
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
