"""The examples of Janovsky and Ligursky (2012) as scenes.

Figures 7 and 10 to 16 have a single contact node, examples 1 to 3 have two. The caption of Fig. 16
says f = (1, -10), but the printed starting point solves f = (1, 10), which is used here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pwscont import Panel, ParameterPath, Scene
from pwscont.extending import Array
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad, HarmonicLoad
from pwscont_coulomb.modes import word


def one_node() -> ContactBody:
    """Return the paper's body with a single contact node (section 3: a = 2, b = 1)."""
    return ContactBody([[2.0, -1.0], [-1.0, 2.0]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])


def two_nodes() -> ContactBody:
    """Return the paper's body with two contact nodes (section 4: a = 2, b = 1)."""
    A = [
        [1.0, -1.0, 0.0, 0.0],
        [-1.0, 2.0, -1.0, 0.0],
        [0.0, -1.0, 2.0, -1.0],
        [0.0, 0.0, -1.0, 2.0],
    ]
    picks = np.eye(4)
    return ContactBody(A, N=picks[[0, 2]], T=picks[[1, 3]])


def circular_path() -> HarmonicLoad:
    """Return the load of Figs. 10 to 12, once around a circle for alpha in [0, 1]."""
    return HarmonicLoad([1.0, -1.0], [0.9, 0.0], [0.0, 0.9], w=2.0 * np.pi, phase=-0.45)


def periodic_path() -> HarmonicLoad:
    """Return the load of Example 2 on the hypersphere, with psi = theta = 0."""
    R, phi0, psi0, theta0 = 2.5729, 3.9615, 1.4147, 0.9395
    middle = [R * np.cos(psi0), R * np.cos(theta0) * np.sin(psi0), 0.0, 0.0]
    around = R * np.sin(theta0) * np.sin(psi0)
    return HarmonicLoad(middle, [0.0, 0.0, around, 0.0], [0.0, 0.0, 0.0, around], phase=phi0)


def _panels(body: ContactBody) -> tuple[Panel, ...]:
    """Return tangential displacement and normal multiplier of each node."""
    u_t = [int(np.flatnonzero(row)[0]) for row in body.T]
    titles = [f"node {node + 1}" if body.p > 1 else "" for node in range(body.p)]
    return tuple(
        Panel(component, partial(word, node), titles[node])
        for node in range(body.p)
        for component in (body.n + node, u_t[node])
    )


def _load_paths(body: ContactBody, load: Callable[[float], Array]) -> tuple[ParameterPath, ...]:
    """Return the load path of each node, in the plane of normal and tangential load."""
    axes = ("$f_ν$", "$f_t$")
    return tuple(
        ParameterPath(partial(_load_on, body, load, node), axes, f"load path{_of(node, body.p)}")
        for node in range(body.p)
    )


def _load_on(
    body: ContactBody, load: Callable[[float], Array], node: int, alpha: float
) -> tuple[float, float]:
    f = load(alpha)
    return float((body.N @ f)[node]), float((body.T @ f)[node])


def _of(node: int, p: int) -> str:
    return f", node {node + 1}" if p > 1 else ""


def _along_load(
    name: str,
    title: str,
    body: ContactBody,
    load: Any,
    friction: float,
    interval: tuple[float, float],
    **more: Any,
) -> Scene:
    return Scene(
        name,
        title,
        CoulombLoad(body, load, friction),
        interval,
        panels=_panels(body),
        paths=_load_paths(body, load),
        **more,
    )


def _along_friction(name: str, title: str, body: ContactBody, force: Any) -> Scene:
    return Scene(
        name,
        title,
        CoulombFriction(body, force),
        (0.001, 15.0),
        parameter="F",
        at=(4.0,),
        panels=_panels(body),
    )


def fig7() -> Scene:
    """Return Fig. 7: a straight load path, F = 4."""
    load = AffineLoad([0.25, 0.0], [0.0, 1.0])
    return _along_load(
        "fig7",
        "one node, f = (0.25, alpha), F = 4",
        one_node(),
        load,
        4.0,
        (-2.0, 2.0),
        at=(-0.75,),
        orientations=(-1,),
    )


def _circle(name: str, friction: float) -> Scene:
    title = f"one node, circular load path, F = {friction:g}"
    return _along_load(name, title, one_node(), circular_path(), friction, (0.0, 1.0))


def fig10() -> Scene:
    """Return Fig. 10: a circular load path, F = 4 > a/b."""
    return _circle("fig10", 4.0)


def fig11() -> Scene:
    """Return Fig. 11: a circular load path, F = 0.7 < a/b."""
    return _circle("fig11", 0.7)


def fig12() -> Scene:
    """Return Fig. 12: a circular load path, F = 2 = a/b, where slip pieces are vertical."""
    return _circle("fig12", 2.0)


def fig13() -> Scene:
    """Return Fig. 13: F varies, f = (1, -3)."""
    return _along_friction("fig13", "one node, f = (1, -3)", one_node(), [1.0, -3.0])


def fig14() -> Scene:
    """Return Fig. 14: F varies, f = (0.2, -1.6)."""
    return _along_friction("fig14", "one node, f = (0.2, -1.6)", one_node(), [0.2, -1.6])


def fig15() -> Scene:
    """Return Fig. 15: F varies, f = (1, -1)."""
    return _along_friction("fig15", "one node, f = (1, -1)", one_node(), [1.0, -1.0])


def fig16() -> Scene:
    """Return Fig. 16: F varies, f = (1, 10)."""
    return _along_friction("fig16", "one node, f = (1, 10)", one_node(), [1.0, 10.0])


def example1() -> Scene:
    """Return Example 1: two nodes, a straight load path, F = 4."""
    load = AffineLoad([0.4, 0.0, 1.8, 0.0], [0.0, 1.0, 0.2, 1.0])
    title = "two nodes, f = (0.4, alpha, 1.8 + 0.2 alpha, alpha), F = 4"
    return _along_load("example1", title, two_nodes(), load, 4.0, (-8.0, 2.0), at=(-1.4,))


def example2() -> Scene:
    """Return Example 2: two nodes, a periodic load path, F = 4."""
    return _along_load(
        "example2",
        "two nodes, periodic load path on a sphere, F = 4",
        two_nodes(),
        periodic_path(),
        4.0,
        (0.0, 2.0 * np.pi),
        parameter="phi",
    )


def example3() -> Scene:
    """Return Example 3: two nodes, F varies."""
    force = [0.4, -1.4, 1.5, -1.5]
    return _along_friction("example3", "two nodes, f = (0.4, -1.4, 1.5, -1.5)", two_nodes(), force)
