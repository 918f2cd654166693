"""Scenes of equilibria and periodic points."""

from __future__ import annotations

from functools import partial

import numpy as np

from pwscont import Character, Panel, Scene
from pwscont.extending import Array
from pwscont_dynamics.called import affine, first_coordinate
from pwscont_dynamics.filippov import FilippovEquilibria
from pwscont_dynamics.maps import AffinePeriodicPoints


def boundary_equilibrium(c1: float = 1.0, c2: float = 0.3) -> Scene:
    """Return a focus that meets the border x1 = 0, beyond which the field is constant, (c1, c2)."""
    A, b = np.array([[-1.0, 1.0], [-0.3, -0.5]]), np.array([1.0, 0.2])
    c = np.array([c1, c2])
    nothing = np.zeros(2)
    plus, minus = partial(affine, A, nothing, b), partial(affine, np.zeros((2, 2)), c, nothing)
    system = FilippovEquilibria(plus, minus, first_coordinate, 2)
    return Scene(
        "boundary-equilibrium",
        f"boundary equilibrium of a Filippov system, field ({c1:g}, {c2:g}) where x1 < 0",
        system,
        (-1.0, 1.0),
        parameter="mu",
        at=(-0.5, 0.5),
        record={"share": system.share, "growth": system.growth, "pull": system.pull},
        panels=(Panel("x1"), Panel("x2")),
    )


def normal_form(tau: float, delta: float) -> Array:
    """Return the matrix with trace tau and determinant delta of the normal form."""
    return np.array([[tau, 1.0], [-delta, 0.0]])


def border_collision(
    period: int = 4,
    tau_left: float = 1.6,
    delta_left: float = 0.4,
    tau_right: float = -2.2,
    delta_right: float = 0.5,
) -> Scene:
    """Return the border-collision normal form in the plane (Nusse and Yorke 1992)."""
    left, right = normal_form(tau_left, delta_left), normal_form(tau_right, delta_right)
    system = AffinePeriodicPoints(left, right, [1.0, 0.0], period=period)
    return Scene(
        "border-collision",
        f"border-collision normal form, points of period {period}",
        system,
        (-1.0, 1.0),
        parameter="mu",
        at=(0.5,),
        record={"|multiplier|": system.largest_multiplier, "period": system.least_period},
        panels=tuple(Panel(i, partial(_period, system)) for i in (0, 1)),
    )


def _period(system: AffinePeriodicPoints, character: Character) -> str:
    """Return the least period of a word, at most the number of letters."""
    word = system.word(character)
    return f"period {(word + word).index(word, 1)}"
