"""Networks that tests of power flow share."""

from pwscont import trace


def from_flat(system, lo, hi):
    """Return the graph through the solution near equal voltages."""
    flat = [1.0 if name.startswith("V") else 0.0 for name in system.names()]
    return trace(system, (flat, lo), (lo, hi), parameter="lambda")
