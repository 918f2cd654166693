"""Scenes with two parameters: Figs. 4 to 6 of the paper, and Example 1 in two planes.

The sectors of the load plane have closed forms for a single node (stiffness a, coupling b):

=======  =========================================  ====================  ==============
sector   where                                      contact mode          exists for
=======  =========================================  ====================  ==============
sigma_1  a f_nu + b f_t <= 0                        no contact            all F
sigma_2  abs(f_t) <= F f_nu                         stick                 all F
sigma_3  f_t >= F f_nu, a f_nu + b f_t >= 0         slip+                 all F
sigma_4  f_t <= -F f_nu, a f_nu + b f_t >= 0        slip-                 F < a/b
sigma_5  -F f_nu <= f_t <= -(a/b) f_nu              slip- (and 1 and 2)   F > a/b
=======  =========================================  ====================  ==============

At F = a/b slip- exists on the ray f_t = -(a/b) f_nu only, with a segment of solutions on the ray.
"""

from __future__ import annotations

from functools import partial

from pwscont import Axes, PlaneScene
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad
from pwscont_coulomb.scenes import one_node, two_nodes

SECTORS = {
    ("no contact",): "σ₁",
    ("stick",): "σ₂",
    ("slip+",): "σ₃",
    ("slip-",): "σ₄",
    ("no contact", "slip-", "stick"): "σ₅ = σ₁ ∩ σ₂",
}


def load_plane(friction: float, f_t: float) -> CoulombLoad:
    """Return the one-node body at tangential load f_t; the parameter is f_nu."""
    return CoulombLoad(one_node(), AffineLoad([0.0, f_t], [1.0, 0.0]), friction)


def example1_at(body: ContactBody, friction: float) -> CoulombLoad:
    """Return Example 1 with another coefficient of friction."""
    return CoulombLoad(body, AffineLoad([0.4, 0.0, 1.8, 0.0], [0.0, 1.0, 0.2, 1.0]), friction)


def example1_loads(body: ContactBody, friction: float, f_nu: float) -> CoulombLoad:
    """Return Example 1 with another normal load on the first node, where the paper has 0.4."""
    return CoulombLoad(body, AffineLoad([f_nu, 0.0, 1.8, 0.0], [0.0, 1.0, 0.2, 1.0]), friction)


def _sector(labels: tuple[str, ...]) -> str:
    return SECTORS.get(tuple(sorted(labels)), "")


def _load_plane(name: str, case: str, friction: float) -> PlaneScene:
    return PlaneScene(
        name,
        f"one node, sectors of the load plane, F = {friction:g} {case} a/b",
        partial(load_plane, friction),
        alphas=(-1.0, 1.0),
        mus=(-1.0, 1.0),
        levels=(-0.5, 0.5),
        axes=Axes("f_ν", "f_t", to_the_left=True, equal=True),
        sectors=_sector,
    )


def fig4() -> PlaneScene:
    """Return Fig. 4: F = 0.7 < a/b, four sectors without overlap."""
    return _load_plane("fig4", "<", 0.7)


def fig5() -> PlaneScene:
    """Return Fig. 5: F = 4 > a/b, where sigma_1 and sigma_2 overlap in sigma_5."""
    return _load_plane("fig5", ">", 4.0)


def fig6() -> PlaneScene:
    """Return Fig. 6: F = 2 = a/b, where a whole ray has infinitely many solutions."""
    return _load_plane("fig6", "=", 2.0)


def example1_load_plane() -> PlaneScene:
    """Return Example 1 in the plane of alpha and the load f_ν of node 1, 0.4 in the paper."""
    return PlaneScene(
        "example1-load-plane",
        "two nodes, f = (f_ν, alpha, 1.8 + 0.2 alpha, alpha), F = 4",
        partial(example1_loads, two_nodes(), 4.0),
        alphas=(-8.0, 2.0),
        mus=(-2.0, 3.0),
        levels=(-1.0, 0.4, 2.0),
        axes=Axes("alpha", "f_ν"),
    )


def critical_friction() -> PlaneScene:
    """Return the fold curves of Example 1 in the plane of alpha and F."""
    return PlaneScene(
        "example1-critical-friction",
        "two nodes, f = (0.4, alpha, 1.8 + 0.2 alpha, alpha), while F varies",
        partial(example1_at, two_nodes()),
        alphas=(-8.0, 2.0),
        mus=(0.5, 4.0),
        levels=(4.0,),
        axes=Axes("alpha", "F"),
        lowest_fold="critical F",
    )
