"""Scenes with a loading history."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pwscont import EvolutionGraph, EvolutionScene, InvalidInputError, LoadHistory, evolve
from pwscont.extending import CONVERGED, Array, Look
from pwscont_coulomb.quasi_static.half_plane import FAR, half_plane
from pwscont_coulomb.quasi_static.system import QuasiStaticCoulomb
from pwscont_coulomb.scenes import one_node, two_nodes

if TYPE_CHECKING:
    from pwscont_coulomb.elastic import ElasticProblem

#: Preloads for which the damping of the block is drawn, and the largest by that of the scene.
PRELOADS, PRELOADS_UP_TO = 24, 1.5
#: Frames of the moving picture of a body.
FRAMES = 48
#: Strips, half of their width, radius, modulus and approach of the round body.
HALF_WIDTH, RADIUS, MODULUS, APPROACH = 1.25, 20.0, 1.0, 0.275
#: Times at which the contact of the round body is drawn, where none are asked for.
DRAWN = (1.6, 2.0, 2.6, 3.0)


def hysteresis(friction: float = 4.0) -> EvolutionScene:
    """Return one node that is loaded and unloaded; at F = 4 four evolutions are possible."""
    history = LoadHistory([[0.0, 0.0], [0.5, -1.5], [0.0, 2.0]])
    return EvolutionScene(
        "hysteresis",
        f"one node, loaded and unloaded, F = {friction:g}",
        QuasiStaticCoulomb(one_node(), history, friction),
        history.interval,
        at=(0.5, 1.5),
        panels=(("u_t", "t"), ("λ_t", "u_t")),
    )


def shakedown(slip: float = 1.0, friction: float = 0.5, cycles: int = 4) -> EvolutionScene:
    """Return two nodes under a cyclic load: the outcome depends on the slip at the beginning.

    Starting with a slip of 1 at node 1, slip ceases; starting without slip, slip never ceases.
    """
    _at_least_two(cycles)
    middle, amplitude = np.array([4.0, 0.0, 1.5, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    history = LoadHistory([middle, *[middle + amplitude, middle - amplitude] * cycles])
    return EvolutionScene(
        "shakedown",
        f"two nodes, cyclic load, slip {slip:g} at the beginning, F = {friction:g}",
        QuasiStaticCoulomb(two_nodes(), history, friction, [slip, 0.0]),
        history.interval,
        at=(2.0 * cycles,),
        record={"friction used at node 2": partial(_used_friction, friction)},
        panels=(("u_t,2", "t"), ("friction used at node 2", "t")),
        period=2.0,
    )


def cattaneo(
    nodes: int = 200, friction: float = 0.5, shift: float = 0.06, cycles: int = 2
) -> EvolutionScene:
    """Return a round body, pressed and then sheared to and fro (Cattaneo 1938, Mindlin 1949)."""
    _at_least_two(cycles)
    if nodes < 1:
        raise InvalidInputError(f"nodes must be at least 1, got {nodes}")
    body = half_plane(nodes, HALF_WIDTH, RADIUS, MODULUS)
    ways = [(0.0, 0.0), (APPROACH, 0.0), (APPROACH, shift)]
    ways += [(APPROACH, -shift), (APPROACH, shift)] * cycles
    moved = [np.repeat(way, nodes) for way in ways]
    history = LoadHistory(np.array(moved) @ body.A)

    shifts = [way[1] for way in ways]
    record = {
        "force": partial(_force, nodes),
        "shift": partial(_shift, nodes, history.times, shifts),
        "stick zone": partial(_stick_zone, nodes, friction),
    }
    system = QuasiStaticCoulomb(body, history, friction)
    return EvolutionScene(
        "cattaneo",
        f"a round body, pressed and sheared to and fro, {nodes} strips, F = {friction:g}",
        system,
        history.interval,
        record=record,
        panels=(("force", "shift"), ("stick zone", "t")),
        period=2.0,
        pictures=partial(_draw_strips, system),
    )


def _draw_strips(
    system: QuasiStaticCoulomb,
    graph: EvolutionGraph,
    at: Sequence[float],
    directory: Path,
    look: Look,
) -> list[Path]:
    """Write the tractions of the strips at some times, and the zones of the strips over time."""
    from pwscont_coulomb.quasi_static.pictures import draw_contact, draw_zones  # noqa: PLC0415

    path, p = graph.paths()[0], system.body.p
    width = 2.0 * HALF_WIDTH / p
    places = -HALF_WIDTH + width * (np.arange(p) + 0.5)
    states = [path.state(t) for t in at or DRAWN]
    forces = draw_contact(system, states, at=places, areas=np.full(p, width))
    zones = draw_zones(system, path, at=places)
    return [
        look.save(forces, directory, "cattaneo-contact"),
        look.save(zones, directory, "cattaneo-zones"),
    ]


def _force(nodes: int, z: Array, t: float) -> float:
    return float(-z[-nodes:].sum())


def _moved(times: Array, shifts: list[float], z: Array, t: float) -> float:
    return float(np.interp(t, times, shifts))


def _shift(nodes: int, times: Array, shifts: list[float], z: Array, t: float) -> float:
    far = FAR / (np.pi * MODULUS) * _force(nodes, z, t)  # the compliance far away is left out
    return _moved(times, shifts, z, t) - far


def _used_friction(friction: float, z: Array, t: float) -> float:
    """Return the part of the friction bound that the last node uses: 1 where the node may slip."""
    bound = friction * abs(float(z[-3]))
    return abs(float(z[-1])) / bound if bound else 0.0


def _stick_zone(nodes: int, friction: float, z: Array, t: float) -> float:
    bound = -friction * z[-2 * nodes : -nodes]
    sticks = np.abs(z[-nodes:]) < bound * (1.0 - CONVERGED)
    in_contact = np.count_nonzero(bound)
    return float(sticks.sum() / in_contact) if in_contact else 1.0


def block_cycle(
    nodes: int = 12, friction: float = 0.3, pressed: float = 1.0, shear: float = 1.0
) -> EvolutionScene:
    """Return a block from a mesh, pressed and then sheared in cycles, with its damping.

    Parameters
    ----------
    nodes : int
        Number of contact nodes.
    friction : float
    pressed : float
        How far the top is pressed down, in percent of the height: the preload.
    shear : float
        How far the top is moved to and fro, in percent of the height.
    """
    from pwscont_coulomb.elastic.scenes import block_body  # noqa: PLC0415  it needs scikit-fem

    problem = block_body(nodes, friction).condensed()
    system = _sheared(problem, pressed, shear)
    history = system.history
    return EvolutionScene(
        "block-cycle",
        f"a block, pressed and sheared in cycles, {nodes} contact nodes, F = {friction:g}",
        system,
        history.interval,
        at=(1.0, 1.6, 3.0),
        record={
            "force": partial(_force, nodes),
            "shift": partial(_moved, history.times, [0.0, 0.0, *[shear, -shear] * 3]),
        },
        panels=(("force", "shift"), ("u_t,1", "t")),
        period=2.0,
        pictures=partial(_draw_block, problem, system, pressed, shear),
    )


def _sheared(problem: ElasticProblem, pressed: float, shear: float) -> QuasiStaticCoulomb:
    """Return the block, pressed and then sheared to and fro in three cycles."""
    press, side = pressed * problem.load.f0, shear * problem.load.f1
    history = LoadHistory([0.0 * press, press, *[press + side, press - side] * 3])
    return QuasiStaticCoulomb(problem.body, history, problem.friction)


def _damping(problem: ElasticProblem, preloads: Array, shear: float) -> Array:
    """Return what friction takes in the last cycle, by preload; nan where evolutions are several.

    Per unit of thickness and of Young's modulus, as the forces.
    """
    energies = np.full(len(preloads), np.nan)
    for i, pressed in enumerate(preloads.tolist()):
        system = _sheared(problem, pressed, shear)
        end = system.history.interval[1]
        paths = evolve(system, system.history.interval).paths()
        if paths.number == 1 and paths[0].end == end:
            energies[i] = paths[0].dissipated(end - 2.0, end)
    return energies


def _draw_block(
    problem: ElasticProblem,
    system: QuasiStaticCoulomb,
    pressed: float,
    shear: float,
    graph: EvolutionGraph,
    at: Sequence[float],
    directory: Path,
    look: Look,
) -> list[Path]:
    """Write the damping by preload, the body at some times, and the zones over time."""
    from pwscont_coulomb.quasi_static.pictures import draw_damping  # noqa: PLC0415

    files = _draw_body(problem, system, graph, at, directory, look)
    if not pressed > 0.0:
        return files
    preloads = np.linspace(0.0, PRELOADS_UP_TO * pressed, PRELOADS + 1)[1:]
    figure = draw_damping(preloads, _damping(problem, preloads, shear), pressed)
    return [*files, look.save(figure, directory, "block-cycle-damping")]


def _draw_body(
    problem: ElasticProblem,
    system: QuasiStaticCoulomb,
    graph: EvolutionGraph,
    at: Sequence[float],
    directory: Path,
    look: Look,
) -> list[Path]:
    """Write the body at some times, and the zones of the contact nodes over time."""
    from pwscont_coulomb.elastic import animation, recover  # noqa: PLC0415
    from pwscont_coulomb.elastic.pictures import draw_states  # noqa: PLC0415
    from pwscont_coulomb.quasi_static.pictures import draw_zones  # noqa: PLC0415

    path, elastic = graph.paths()[0], problem.elastic
    zones = draw_zones(system, path, at=elastic.contact.arc)
    files = [look.save(zones, directory, "block-cycle-zones")]
    if at:
        states = [recover(problem, path.state(t)) for t in at]
        files.append(
            look.save(draw_states(elastic, states, scale=look.scale), directory, "block-cycle-body")
        )
    if look.animate:
        states = animation.over_time(problem, path, FRAMES)
        file = directory / "block-cycle-body.gif"
        files.append(animation.animate_states(elastic, states, file, scale=look.scale))
    return files


def _at_least_two(cycles: int) -> None:
    if cycles < 2:
        raise InvalidInputError(f"cycles must be at least 2, got {cycles}")
