"""What an adapter needs to know of a problem of the bench."""

from __future__ import annotations

from pwscont_coulomb import AffineLoad, CoulombLoad

from pwscont.basics.arrays import Array
from pwscont.bench.cases import Case

#: Scale of the augmented multipliers, about the stiffness of the bodies here.
SCALE = 1.0


def start(case: Case) -> Array:
    """Return the true point (z, alpha) at the lower end of the interval; peers go up from it."""
    ends = [end for piece in case.truth.pieces for end in piece.ends()]
    return min(ends, key=lambda x: abs(x[-1] - case.interval[0]))


def contact(case: Case) -> dict[str, object] | None:
    """Return matrices, load and friction of a contact problem; None if it is no such problem."""
    system = case.system
    if not isinstance(system, CoulombLoad) or not isinstance(system.load, AffineLoad):
        return None
    body, load = system.body, system.load
    arrays = {"A": body.A, "N": body.N, "T": body.T, "f0": load.f0, "f1": load.f1}
    found = {name: array.tolist() for name, array in arrays.items()}
    return found | {"F": system.friction.tolist(), "r": SCALE}
