"""The networks of the scenes."""

from __future__ import annotations

from pathlib import Path

from pwscont_power.network import Branch, Generator, Network
from pwscont_power.read import from_matpower

DATA = Path(__file__).parent / "data"


def three_bus(Q_max: float = 0.8) -> Network:
    """Return three buses in a ring: slack 1, generator 2 and load 3."""
    return Network(
        buses=(1, 2, 3),
        branches=(
            Branch(1, 2, 0.02, 0.2),
            Branch(2, 3, 0.02, 0.15),
            Branch(1, 3, 0.04, 0.4),
        ),
        generators=(Generator(1, 1.03), Generator(2, 1.02, -0.2, Q_max)),
        slack=1,
        load=[0.0, 0.0, 1.0 + 0.35j],
        generation=[0.0, 0.4, 0.0],
    )


def ieee14() -> Network:
    """Return the IEEE 14-bus test case."""
    return from_matpower(DATA / "case14.m")


def ieee118() -> Network:
    """Return the IEEE 118-bus test case."""
    return from_matpower(DATA / "case118.m")
