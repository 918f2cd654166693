"""Scenes of parametric optimisation, games and fixed points."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from pwscont import (
    LCP,
    Character,
    Complementarity,
    EndPoints,
    InvalidInputError,
    MultiStart,
    Panel,
    Scene,
    Slices,
)
from pwscont.extending import Array
from pwscont_optimisation.diabetes import FEATURES, PRODUCTS, correlations
from pwscont_optimisation.fixed_points import BestReplies, ReluLayer
from pwscont_optimisation.lasso import Lasso
from pwscont_optimisation.quadratic_program import QuadraticProgram


def lasso() -> Scene:
    """Return the LASSO path of the diabetes data (Efron et al. 2004, Fig. 1)."""
    system = Lasso.from_products(correlations(), PRODUCTS, FEATURES)
    drawn = ("bmi", "s5", "s1", "s3")
    return Scene(
        "lasso",
        "LASSO path of the diabetes data",
        system,
        (0.0, 1000.0),
        parameter="lambda",
        at=(100.0,),
        orientations=(-1,),
        record={"|b|_1": _one_norm},
        panels=tuple(Panel(name, partial(_of_feature, system, name)) for name in drawn),
        styles={"positive": "-", "negative": "--", "zero": ":"},
    )


def _of_feature(system: Lasso, name: str, character: Character) -> str:
    """Say how a feature is active."""
    signs = [part[-1] for part in system.active_set(character) if part[:-1] == name]
    return {"+": "positive", "-": "negative"}[signs[0]] if signs else "zero"


def parametric_qp() -> Scene:
    """Return the first two moves of a controller (Bemporad, Morari, Dua, Pistikopoulos 2002).

    The plant 2 / (s^2 + 3 s + 2) is sampled every 0.1 s; |u| <= 2. The initial state is
    (alpha, 0.5 - 0.3 alpha), a line through the regions of the paper's Fig. 2.
    """
    H = [[1.5064, 0.4838], [0.4838, 1.5258]]
    F = np.array([[9.6652, 5.2115], [7.0732, -7.0879]])
    state, along = np.array([0.0, 0.5]), np.array([1.0, -0.3])
    system = QuadraticProgram(
        H,
        F.T @ state,
        [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]],
        [2.0] * 4,
        F.T @ along,
        names=("u_0", "u_1"),
        constraints=("u_0 max", "u_0 min", "u_1 max", "u_1 min"),
    )
    title = "explicit model predictive control along a line of states"
    return Scene(
        "parametric-qp", title, system, (-1.5, 1.5), at=(0.5,), panels=(Panel(0), Panel(1))
    )


#: A random matrix of more unknowns has more modes than a search can visit.
MOST_UNKNOWNS = 1000


def lcp(n: int = 5, seed: int = 1) -> Scene:
    """Return a linear complementarity problem with a random matrix."""
    if not 1 <= n <= MOST_UNKNOWNS:
        raise InvalidInputError(f"n must be from 1 to {MOST_UNKNOWNS}, got {n}")
    rng = _random(seed)
    M = rng.normal(size=(n, n)) + np.eye(n)
    names = [f"z_{i + 1}" for i in range(n)]
    system = LCP(M, rng.normal(size=n), rng.normal(size=n), names=names)
    title = f"linear complementarity, {n} unknowns"
    return Scene("lcp", title, system, (-3.0, 3.0), at=(0.0,), panels=(Panel(1), Panel(2)))


def _random(seed: int) -> np.random.Generator:
    if seed < 0:
        raise InvalidInputError(f"seed must not be negative, got {seed}")
    return np.random.default_rng(seed)


def kojima_shindo() -> Scene:
    """Return the complementarity problem of Kojima and Shindo (1986), with first row + t.

    With the constants of Josephy (1979) t = 0 has one regular solution. A Newton iteration in each
    active set, and a few from elsewhere, find all solutions.
    """
    names = [f"z_{i + 1}" for i in range(4)]
    return Scene(
        "kojima-shindo",
        "nonlinear complementarity problem of Kojima and Shindo",
        Complementarity(kojima_shindo_function, n=4, names=names),
        (-1.0, 2.5),
        parameter="t",
        at=(0.0, 2.2),
        search=EndPoints() + MultiStart(count=4),
        panels=(Panel(0, partial(_support, names)), Panel(1, partial(_support, names))),
    )


def _support(names: Sequence[str], character: Character) -> str:
    """Return which unknowns are positive."""
    positive = [name for name, sign in zip(names, character.signs, strict=True) if sign]
    return f"positive: {', '.join(positive) or 'none'}"


def kojima_shindo_function(z: Any, t: Any) -> Any:
    """Return the four functions of the problem."""
    a, b, c, d = z
    return np.array(
        [
            3.0 * a**2 + 2.0 * a * b + 2.0 * b**2 + c + 3.0 * d - 6.0 + t,
            2.0 * a**2 + a + b**2 + 3.0 * c + 2.0 * d - 2.0,
            3.0 * a**2 + a * b + 2.0 * b**2 + 2.0 * c + 3.0 * d - 1.0,
            a**2 + 3.0 * b**2 + 2.0 * c + 3.0 * d - 3.0,
        ]
    )


#: The adjacency matrix of four players on a circle.
CIRCLE = np.array([[0.0, 1, 0, 1], [1, 0, 1, 0], [0, 1, 0, 1], [1, 0, 1, 0]])
#: The gain of each of the four players from acting, added to alpha.
GAINS = np.array([0.0, 0.06, 0.11, -0.05])


def game(delta: float = 0.9) -> Scene:
    """Return four players on a circle; the action of a player replaces actions of the neighbours.

    x_i = clip(alpha + gain_i - delta (sum of x over the neighbours), 0, 1). After Bramoullé,
    Kranton and D'Amours (2014) the equilibrium is unique at every alpha, whatever the gains, if
    delta is below 1 / |the smallest eigenvalue of the graph| = 1/2.
    """
    system = BestReplies(-delta * CIRCLE, GAINS, np.ones(4))
    title = f"four players on a circle, strategic substitutes, delta = {delta:g}"
    panels = tuple(Panel(i, partial(_action, i), f"player {i + 1}") for i in (0, 1))
    return Scene("game", title, system, (-0.5, 3.5), at=(1.5,), panels=panels)


def _action(player: int, character: Character) -> str:
    """Return whether an action is at a bound, and at which."""
    between = np.reshape(character.signs, (2, -1)).sum(axis=0)
    return ("at 0", "between", "at 1")[between[player]]


#: How many units excite themselves, and how many see the parameter; more units are bystanders.
EXCITED, SENSORS = 4, 2


def relu_fixed_points(units: int = 20, seed: int = 0) -> Scene:
    """Return a layer with four units that excite themselves, W_kk = 1.6.

    Each of the four is driven below zero while |alpha| is small, and then may be on or off: two
    states, 2^4 = 16 together. At larger |alpha| two units that see alpha drive the four units above
    zero, and no fixed point is left: all solutions lie on closed loops. Each loop crosses
    alpha = 0, so that a single slice near zero finds all loops.

    Raises
    ------
    InvalidInputError
        If there are fewer than six units.
    """
    if units < EXCITED + SENSORS:
        raise InvalidInputError(f"units must be at least {EXCITED + SENSORS}, got {units}")
    return Scene(
        "relu-fixed-points",
        f"ReLU layer of {units} units, four excite themselves",
        ReluLayer(*layer(units, seed)),
        (-1.0, 1.0),
        at=(0.0,),
        record={"activity": _activity},
        search=Slices((0.03,)),
        panels=(Panel("activity", _first),),
    )


def _first(character: Character) -> str:
    return "unit 1 on" if character.signs[0] else "unit 1 off"


def layer(units: int, seed: int) -> tuple[Array, Array, Array]:
    """Return W, b and c of the layer."""
    rng = _random(seed)
    excited, sensors = np.arange(EXCITED), np.arange(EXCITED, EXCITED + SENSORS)
    W = 0.3 * rng.normal(size=(units, units)) / np.sqrt(units)
    b, c = 0.5 * rng.normal(size=units), rng.normal(size=units)
    W[range(units), range(units)] = 0.0
    W[excited] *= 0.2
    W[sensors] = 0.0
    W[excited, excited] = 1.6
    b[excited], c[excited] = -(0.5**excited), 0.0
    W[np.ix_(excited, sensors)] = -b[excited, np.newaxis] / np.array([[0.6], [0.7], [0.8], [0.9]])
    b[sensors], c[sensors] = -0.1, [1.0, -1.0]
    return W, b, c


def _one_norm(b: Array, penalty: float) -> float:
    return float(np.abs(b).sum())


def _activity(z: Array, alpha: float) -> float:
    return float(z[:EXCITED].sum())
