"""Nose curves: voltages against the loading, up to the largest load that the network can carry."""

from __future__ import annotations

from functools import cache

import numpy as np

from pwscont import Panel, Scene
from pwscont_power.flow import PowerFlow
from pwscont_power.networks import ieee14 as ieee14_network
from pwscont_power.networks import ieee118 as ieee118_network
from pwscont_power.networks import three_bus as three_bus_network
from pwscont_power.plane import LimitPlane


def three_bus_flow(Q_max: float) -> PowerFlow:
    """Return the three buses whose load grows while the active generation stays."""
    return _three_bus_flow().with_limits(2, -0.2, Q_max)


@cache
def _three_bus_flow() -> PowerFlow:
    network = three_bus_network()
    return PowerFlow(network, growing=-network.load, fixed=network.generation)


def three_bus(Q_max: float = 0.8, start: float = 0.2) -> Scene:
    """Return three buses: generator 2 meets a limit, then the load at bus 3 meets the nose.

    The lower branch goes on to lambda = 0, where V3 = 0: the end of the model.
    """
    limit = "no limit" if np.isinf(Q_max) else f"Q max = {Q_max:g}"
    return Scene(
        "three-bus",
        f"three buses, generator 2 with {limit}",
        three_bus_flow(Q_max),
        (start, 3.2),
        parameter="lambda",
        at=(1.0,),
        panels=(Panel("V3"), Panel("V2"), Panel("Q2")),
    )


def ieee14() -> Scene:
    """Return the IEEE 14-bus test case, loads and generation growing together."""
    return Scene(
        "ieee14",
        "IEEE 14 buses, loads and generation scaled together",
        PowerFlow(ieee14_network()),
        (0.3, 2.0),
        parameter="lambda",
        at=(1.0,),
        panels=(Panel("V14"), Panel("V3"), Panel("Q2"), Panel("Q6")),
    )


def ieee118() -> Scene:
    """Return the IEEE 118-bus test case: a generator meets a limit at the largest load."""
    return Scene(
        "ieee118",
        "IEEE 118 buses, loads and generation scaled together",
        PowerFlow(ieee118_network()),
        (0.3, 2.3),
        parameter="lambda",
        at=(1.0,),
        panels=(Panel("V76"), Panel("V44"), Panel("V10"), Panel("Q10")),
    )


def three_bus_limits() -> LimitPlane:
    """Return limit and nose of the three buses while Q_max of generator 2 grows."""
    return LimitPlane(
        "three-bus-limits",
        "three buses: limit of generator 2 and nose, while Q max grows",
        three_bus_flow,
        loadings=(0.2, 3.2),
        limits=(0.0, 4.0),
        levels=(0.8, 3.8),
    )
