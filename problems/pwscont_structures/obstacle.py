"""Strings and membranes over an obstacle.

K u + f_0 + alpha f_1 = r: the elastic forces and the load (positive downwards) leave the reaction
r of the obstacle. u >= obstacle, r >= 0, and r is zero where u is above the obstacle. With K
symmetric and positive definite the solution at each alpha is unique (the minimum of a convex
energy; Kinderlehrer and Stampacchia, *An Introduction to Variational Inequalities*, 1980).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont import BandedJacobian, Block, Character, InvalidInputError, PiecewiseLinearSystem
from pwscont.extending import Array, Matrix, finite_array
from pwscont_structures.stretches import stretches

#: Modes of a node: above the obstacle, and in contact.
MODES = ((False,), (True,))


@final
class ObstacleProblem(PiecewiseLinearSystem):
    """The obstacle problem of a stiffness matrix; alpha is the load.

    Parameters
    ----------
    stiffness : array_like or sparse matrix, shape (n, n)
        K, symmetric and positive definite. Solves with a tridiagonal K cost O(n).
    obstacle : array_like, shape (n,)
        The height of the obstacle at each node.
    load : array_like, shape (n,)
        f_1, positive downwards.
    rest : array_like, shape (n,), optional
        f_0, the load at alpha = 0; default none.

    Raises
    ------
    InvalidInputError
        If shapes do not fit, or K is not symmetric with a positive diagonal.

    Examples
    --------
    >>> from pwscont import enumerate_solutions
    >>> from pwscont_structures import ObstacleProblem
    >>> pad = ObstacleProblem([[2.0, -1.0], [-1.0, 2.0]], obstacle=[-0.5, -2.0], load=[-1.0, -1.0])
    >>> enumerate_solutions(pad, 1.0)[0].z.tolist()
    [1.0, 1.0]
    """

    degree = 1
    unique = True

    def __init__(self, stiffness: Any, obstacle: Any, load: Any, rest: Any = None) -> None:
        self.K = _symmetric(stiffness)
        self.size = self.K.shape[0]
        self.obstacle = finite_array("obstacle", obstacle, (self.size,))
        self.load = finite_array("load", load, (self.size,))
        none = np.zeros(self.size)
        self.rest = none if rest is None else finite_array("rest", rest, (self.size,))
        self.diagonal = self.K.diagonal()
        column = self.load[:, np.newaxis]
        self._free = sp.hstack([self.K, column]).tocsr()
        self._held = sp.hstack([sp.diags_array(self.diagonal), 0.0 * column]).tocsr()
        self._bands = _bands(self.K)

    def reaction(self, z: Array, alpha: float) -> Array:
        """Return the force of the obstacle on each node that a place z asks for."""
        reaction: Array = self.K @ z + self.rest + alpha * self.load
        return reaction

    def height(self, z: Array) -> Array:
        """Return K_ii times the height of each node above the obstacle, a force."""
        height: Array = self.diagonal * (z - self.obstacle)
        return height

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return reaction less height of all nodes, positive on the obstacle."""
        return self.reaction(z, alpha) - self.height(z)

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the height of nodes on the obstacle, the reaction of nodes above."""
        return np.where(character.array, self.height(z), self.reaction(z, alpha))

    def jacobian(self, z: Array, alpha: float, character: Character) -> Any:
        """Return rows of K for nodes above the obstacle, of the diagonal for nodes in contact."""
        free = np.where(character.array, 0.0, 1.0)
        if self._bands is not None:
            below, above = self._bands
            bands = [np.append(0.0, above) * np.append(0.0, free[:-1]), self.diagonal]
            bands.append(np.append(below, 0.0) * np.append(free[1:], 0.0))
            return BandedJacobian(np.stack(bands), 1, 1, free * self.load)
        picked = sp.diags_array(free) @ self._free + sp.diags_array(1.0 - free) @ self._held
        return picked.tocsc()

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients of the tests, which are constant."""
        return (self._free - self._held).tocsr()

    def kink(self, before: Character, after: Character, test: int) -> Array:
        """Return c, shape (n,): the row of a node that touches the obstacle loses the test."""
        c = np.zeros(self.size)
        c[test] = -1.0 if after.array[test] else 1.0
        return c

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each node, which is above the obstacle or in contact."""
        return tuple(Block((i,), (i,), MODES) for i in range(self.size))

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return the inequalities height >= 0 and reaction >= 0 of all nodes."""
        rows = sp.vstack([self._held[:, :-1], self._free[:, :-1]]).tocsr()
        load = self.rest + alpha * self.load
        return rows, np.concatenate([-self.diagonal * self.obstacle, load])

    def scale(self, lo: float, hi: float) -> Array:
        """Return the largest height of the obstacle above or below zero."""
        return np.full(self.size, np.abs(self.obstacle).max() or 1.0)

    def names(self) -> tuple[str, ...]:
        """Return u_1, ..., u_n."""
        return tuple(f"u_{i + 1}" for i in range(self.size))

    def describe(self, character: Character) -> str:
        """Return which nodes lie on the obstacle."""
        nodes = np.flatnonzero(character.array) + 1
        return f"on the obstacle: {stretches(nodes)}" if len(nodes) else "above the obstacle"

    def label(self, character: Character) -> str:
        """Return how many nodes lie on the obstacle."""
        count = int(character.array.sum())
        return f"{count} of {self.size} nodes on the obstacle" if count else "above the obstacle"

    def test_name(self, test: int) -> str:
        """Return which node a test is about."""
        return f"contact of node {test + 1}"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return which nodes touch or leave the obstacle."""
        was, now = before.array, after.array
        changes = {"touches": now & ~was, "leaves": was & ~now}
        return ", ".join(
            f"node {stretches(np.flatnonzero(nodes) + 1)} {verb} the obstacle"
            for verb, nodes in changes.items()
            if nodes.any()
        )


def string(
    nodes: int,
    obstacle: Callable[[Array], Any],
    *,
    length: float = 1.0,
    tension: float = 1.0,
    load: float = 1.0,
) -> ObstacleProblem:
    """Return a string between fixed ends over an obstacle, by linear elements.

    Parameters
    ----------
    nodes : int
        The number of equidistant nodes that can move.
    obstacle : callable
        Places x, shape (nodes,) -> heights there; negative below the string at rest.
    length, tension : float
    load : float
        The load per unit of length at alpha = 1, positive downwards.

    Raises
    ------
    InvalidInputError
        If there are no nodes, a number is not positive, or heights are not one for each place.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_structures import string
    >>> table = explore(string(9, lambda x: -0.05), (0.0, 8.0), parameter="load")
    >>> table.guarantee
    "complete (unique by the system's promise)"
    """
    if not callable(obstacle):
        raise InvalidInputError(f"obstacle must be a function of x, got {obstacle!r}")
    sizes = {"length": length, "tension": tension, "load": load}
    length, tension, load = (float(finite_array(name, x, ())) for name, x in sizes.items())
    if not isinstance(nodes, int | np.integer) or nodes < 1 or min(length, tension) <= 0.0:
        raise InvalidInputError(
            "a string needs a whole number of nodes, a positive length and a positive tension"
        )
    h = length / (nodes + 1)
    off = np.full(nodes - 1, -tension / h)
    K = sp.diags_array([off, np.full(nodes, 2.0 * tension / h), off], offsets=[-1, 0, 1])
    places: Array = h * np.arange(1.0, nodes + 1.0)
    heights = finite_array("obstacle(x)", obstacle(places))
    if heights.shape not in ((), (nodes,)):
        raise InvalidInputError(
            f"obstacle(x) must be a height for each of {nodes} places, got shape {heights.shape}"
        )
    return ObstacleProblem(K, np.broadcast_to(heights, (nodes,)), np.full(nodes, load * h))


def _symmetric(stiffness: Any) -> Matrix:
    if not sp.issparse(stiffness):
        stiffness = finite_array("stiffness", stiffness)
        if stiffness.ndim != 2:
            raise InvalidInputError(
                f"stiffness must be a square matrix, shape (n, n), got shape {stiffness.shape}"
            )
    K = sp.csr_array(stiffness)
    if K.shape[0] != K.shape[1] or abs(K - K.T).max() > 1e-10 * abs(K).max():
        raise InvalidInputError("stiffness must be square and symmetric")
    if (K.diagonal() <= 0.0).any():
        raise InvalidInputError("stiffness must have a positive diagonal: it is not definite")
    return K


def _bands(K: Matrix) -> tuple[Array, Array] | None:
    """Return the diagonals next to the main diagonal of a tridiagonal matrix, else None."""
    rows, columns = K.nonzero()
    if (np.abs(rows - columns) > 1).any():
        return None
    return K.diagonal(-1), K.diagonal(1)
