"""Scenes of structures."""

from __future__ import annotations

from functools import partial

import numpy as np

from pwscont import (
    Character,
    EvolutionScene,
    InvalidInputError,
    LoadHistory,
    Panel,
    Scene,
)
from pwscont.extending import Array
from pwscont_structures.obstacle import ObstacleProblem, string
from pwscont_structures.plastic import PlasticTruss
from pwscont_structures.softening import SofteningBar
from pwscont_structures.strut import Strut, Support
from pwscont_structures.truss import TrussChain

#: Most trusses of a chain: 10,000 trusses already take more than a minute.
MOST_TRUSSES = 10_000


def truss_stop(place: float = 0.9, stiffness: float = 20.0) -> Scene:
    """Return two trusses, a stop under the second: 1, 3 or 9 equilibria."""
    system = TrussChain([1.0, 1.1], {2: (place, stiffness)})
    return Scene(
        "truss-stop",
        f"two von Mises trusses, a stop at u_2 = {place:g}",
        system,
        (-0.6, 0.8),
        parameter="load",
        at=(0.2,),
        panels=(Panel("u_1"), Panel("u_2")),
    )


def truss_chain(trusses: int = 3, spread: float = 0.1) -> Scene:
    """Return K trusses in series, with ascending stiffness: 3^K equilibria at no load."""
    if not 1 <= trusses <= MOST_TRUSSES:
        raise InvalidInputError(f"trusses must be from 1 to {MOST_TRUSSES}, got {trusses}")
    stiffness: Array = 1.0 + spread * np.arange(float(trusses))
    system = TrussChain(stiffness)
    reach = 0.5 * float(system.k.max())
    return Scene(
        "truss-chain",
        f"{trusses} von Mises trusses in series",
        system,
        (-reach, reach),
        parameter="load",
        at=(0.0,),
        panels=(Panel("u_1"),) if trusses < 3 else (Panel("u_1"), Panel(f"u_{trusses - 1}")),
    )


def softening_bar(elements: int = 1, spring: float = 0.5, weaker: float = 0.05) -> Scene:
    """Return a softening bar: snap-back, and with several elements localisation."""
    if elements < 1:
        raise InvalidInputError(f"elements must be at least 1, got {elements}")
    strength = 1.0 + weaker * np.arange(elements)
    remaining = 0.05 if elements > 1 else 0.0
    system = SofteningBar(spring, strength.tolist(), remaining=remaining)
    return Scene(
        "softening-bar",
        f"softening bar of {elements} element{'s' * (elements > 1)} and a spring",
        system,
        (0.0, 3.0 + 2.0 * elements),
        parameter="displacement",
        at=(1.5 + elements,),
        record={"force": system.force},
        panels=(Panel("force"), Panel("e_1")),
        styles={"elastic": "-", "softening": "--", "broken": ":"} if elements == 1 else {},
    )


def waves(x: Array) -> Array:
    """Return an obstacle of three waves, slightly uneven so that no two nodes touch at once."""
    uneven = 0.02 * np.sin(37.0 * x + 1.0) ** 2 + 0.01 * x
    return -(0.05 + 0.1 * np.sin(3.0 * np.pi * x) ** 2 + uneven)


def obstacle(nodes: int = 50) -> Scene:
    """Return a string over three waves."""
    system = string(nodes, waves)
    x = np.arange(1, nodes + 1) / (nodes + 1)
    first = int(np.argmin(-system.obstacle / (x * (1.0 - x))))  # the parabola touches there
    return Scene(
        "obstacle",
        f"string of {nodes} nodes over an obstacle",
        system,
        (0.0, 8.0),
        parameter="load",
        at=(4.0,),
        record={
            "nodes on obstacle": partial(_touching, system),
            "reaction": partial(_reaction, system),
        },
        panels=(
            Panel(first, partial(_at_node, first)),
            Panel("reaction", _anywhere),
        ),
        styles={"above the obstacle": "-", "on the obstacle": "--"},
    )


def _at_node(node: int, character: Character) -> str:
    return _place(character.signs[node])


def _anywhere(character: Character) -> str:
    return _place(any(character.signs))


def _place(touches: bool) -> str:
    return "on the obstacle" if touches else "above the obstacle"


def _touching(system: ObstacleProblem, z: Array, load: float) -> float:
    return float((system.test_functions(z, load) >= 0.0).sum())


def _reaction(system: ObstacleProblem, z: Array, load: float) -> float:
    on = system.test_functions(z, load) >= 0.0
    return float(system.reaction(z, load)[on].sum())


def strut_supports(elements: int = 8, gap: float = 0.1, bow: float = 0.01) -> Scene:
    """Return a slightly bent strut with supports above and below the middle."""
    if elements % 2:
        raise InvalidInputError(f"elements of strut-supports must be even, got {elements}")
    supports = [Support(0.5, gap), Support(0.5, -gap)]
    system = Strut(elements, supports, [bow, 0.4 * bow])
    return Scene(
        "strut-supports",
        "strut between supports above and below its middle",
        system,
        (1.0, 44.0),
        parameter="P",
        at=(20.0, 43.0),
        record={
            "w(0.25)": partial(_deflection, system, 0.25),
            "w(0.5)": partial(_deflection, system, 0.5),
            "shortening": partial(_shortening, system),
        },
        panels=(Panel("w(0.25)"), Panel("shortening")),
        styles={"free": "-", "support 1": "--", "support 2": ":"},
    )


def _deflection(system: Strut, place: float, z: Array, load: float) -> float:
    return system.deflection(z, place)


def _shortening(system: Strut, z: Array, load: float) -> float:
    return system.shortening(z)


def play(springs: int = 5, hardening: float = 0.2) -> EvolutionScene:
    """Return elastic-plastic springs in parallel (Prandtl and Ishlinskii), loaded to and fro."""
    if springs < 1:
        raise InvalidInputError(f"springs must be at least 1, got {springs}")
    if hardening < 0.0:
        raise InvalidInputError(f"hardening must not be negative, got {hardening}")
    loads = [[0.0], [1.2], [-0.6], [0.9], [-1.2], [1.2], [-1.2]]
    history, one = LoadHistory(loads), np.ones((springs, 1))
    strength = np.linspace(0.4, 1.6, springs) / springs
    system = PlasticTruss(one, history, 1.0 / springs, strength, hardening / springs)

    return EvolutionScene(
        "play",
        f"{springs} elastic-plastic springs in parallel",
        system,
        history.interval,
        record={"load": partial(_load, history)},
        at=(1.0, 2.0),
        panels=(("load", "u_1"),),
        period=2.0,
    )


def _load(history: LoadHistory, z: Array, t: float) -> float:
    return float(history(t)[0])
