"""Fixed points of clipped and rectified maps: games with bounded actions, and ReLU layers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pwscont import Complementarity, InvalidInputError, PiecewiseSystem, Switched
from pwscont.extending import Array, finite_array
from pwscont_optimisation.numbered import numbered


def BestReplies(  # noqa: N802  used like a class
    B: Any,
    a: Any,
    c: Any,
    *,
    lower: Any = 0.0,
    upper: Any = 1.0,
    players: Sequence[str] | None = None,
    **given: Any,
) -> PiecewiseSystem:
    """Return the Nash equilibria x_i = clip((B x + a + alpha c)_i, lower_i, upper_i).

    The reply of player i to all other players is the best reply if the payoff is
    -x_i^2 / 2 + x_i (B x + a + alpha c)_i with B_ii = 0: any game with quadratic payoffs, each
    concave in the player's own action, can be written in this form.

    Parameters
    ----------
    B : array_like, shape (N, N)
    a, c : array_like, shape (N,)
    lower, upper : array_like, optional
        Bounds of the actions, broadcastable to (N,), infinite where there are none.
    players : sequence of str, length N, optional
        Default player 1, player 2, ...
    **given
        As for :func:`pwscont.Switched`: ``names``, ``degree``, ``unique``, ...

    Returns
    -------
    PiecewiseLinearSystem

    Raises
    ------
    InvalidInputError
        If shapes do not fit.
    InvalidSystemError
        If a lower bound is above the upper bound.

    Examples
    --------
    >>> from pwscont import enumerate_solutions
    >>> from pwscont_optimisation import BestReplies
    >>> game = BestReplies([[0.0, -2.0], [-2.0, 0.0]], [1.0, 1.0], [1.0, 1.0])
    >>> sorted(s.z.round(6).tolist() for s in enumerate_solutions(game, 0.0))
    [[0.0, 1.0], [0.333333, 0.333333], [1.0, 0.0]]
    """
    matrix, a, c = _affine(B=B, a=a, c=c)
    n = len(a)
    low, high = _bounds(lower, upper, n)

    def f(x: Any, alpha: Any, sw: Any) -> Any:
        return x - sw.clip(matrix @ x + a + alpha * c, low, high)

    return Switched(n, f, linear=True, **_named("player", players, "x", n) | given)


def Game(  # noqa: N802  used like a class
    marginal: Callable[[Any, Any], Any],
    *,
    lower: Any = 0.0,
    upper: Any = 1.0,
    n: int | None = None,
    **given: Any,
) -> PiecewiseSystem:
    """Return the Nash equilibria of a game, each player's payoff concave in the own action.

    Parameters
    ----------
    marginal : callable
        (x, alpha) -> the derivative of each player's payoff by that player's action, shape (N,),
        smooth. At an equilibrium the derivative is zero between the bounds, not positive at the
        lower bound and not negative at the upper bound.
    lower, upper : array_like, optional
        Bounds of the actions.
    n : int, optional
        The number of players, needed if the bounds are single numbers.
    **given
        As for :func:`pwscont.Complementarity`.

    Returns
    -------
    PiecewiseSystem

    Raises
    ------
    InvalidInputError, InvalidSystemError
        As for :func:`pwscont.Complementarity`.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_optimisation import Game
    >>> game = Game(lambda x, alpha: alpha - x - 0.5 * x[::-1], n=2)
    >>> [s.z.round(6).tolist() for s in explore(game, (0.0, 2.0)).solutions(0.75)]
    [[0.5, 0.5]]
    """
    if not callable(marginal):
        raise InvalidInputError(f"marginal must be a function of (x, alpha), got {marginal!r}")
    return Complementarity(lambda x, t: -marginal(x, t), lower, upper, n=n, **given)


def ReluLayer(  # noqa: N802  used like a class
    W: Any, b: Any, c: Any, *, units: Sequence[str] | None = None, **given: Any
) -> PiecewiseSystem:
    """Return the fixed points z = max(0, W z + b + alpha c) of a layer that feeds back to itself.

    The fixed points are the states of an implicit or equilibrium layer, and the rest states of a
    threshold-linear network.

    Parameters
    ----------
    W : array_like, shape (n, n)
    b, c : array_like, shape (n,)
    units : sequence of str, length n, optional
        Default unit 1, unit 2, ...
    **given
        As for :func:`pwscont.Switched`: ``names``, ``degree``, ``unique``, ...

    Returns
    -------
    PiecewiseLinearSystem

    Raises
    ------
    InvalidInputError
        If shapes do not fit.

    Examples
    --------
    >>> from pwscont import enumerate_solutions
    >>> from pwscont_optimisation import ReluLayer
    >>> layer = ReluLayer([[2.0]], [-0.5], [0.0])  # z = relu(W z + b + alpha c)
    >>> sorted(s.z.tolist() for s in enumerate_solutions(layer, 0.0))
    [[0.0], [0.5]]
    """
    matrix, b, c = _affine(W=W, b=b, c=c)

    def f(z: Any, alpha: Any, sw: Any) -> Any:
        return z - sw.relu(matrix @ z + b + alpha * c)

    return Switched(len(b), f, linear=True, **_named("unit", units, "z", len(b)) | given)


def _affine(**terms: Any) -> tuple[Array, Array, Array]:
    """Return matrix, constant and slope of an affine map, given by name in this order."""
    matrix, constant, slope = terms
    constants = finite_array(constant, terms[constant]).ravel()
    n = len(constants)
    return (
        finite_array(matrix, terms[matrix], (n, n)),
        constants,
        finite_array(slope, terms[slope], (n,)),
    )


def _bounds(lower: Any, upper: Any, n: int) -> tuple[Array, Array]:
    try:
        low, high = (
            np.broadcast_to(np.asarray(each, dtype=float), (n,)) for each in (lower, upper)
        )
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"lower and upper must be numbers, one or {n}: {error}") from error
    return low, high


def _named(word: str, given: Sequence[str] | None, letter: str, n: int) -> dict[str, Any]:
    """Return the names of the switches and of the unknowns."""
    switches = numbered(f"{word}s", given, f"{word} ", n)
    return {"switches": switches, "names": numbered("names", None, letter, n)}
