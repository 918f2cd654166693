"""Von Mises trusses in series, with stops.

Two bars that meet in a shallow roof snap through under a load on the ridge. With the rise as the
unit of length the force is p(d) = k d (d - 1)(d - 2) for shallow roofs: d = 0 is the unloaded roof,
d = 1 the flat roof, d = 2 the roof turned inside out (von Mises, *Ueber die Stabilitaetsprobleme
der Elastizitaetstheorie*, ZAMM 3, 1923). The first of K trusses carries the load, and each stands
on the next; the last stands on the ground.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import final

import numpy as np

from pwscont import Character, InvalidInputError, PiecewiseSystem
from pwscont.extending import Array, BringsSearches, finite_array
from pwscont_structures.law import SnapLaw
from pwscont_structures.truss_search import AllEquilibria

#: Node -> place and stiffness of the node's stop.
Stops = Mapping[int, tuple[float, float]]


@final
class TrussChain(PiecewiseSystem, BringsSearches):
    """K von Mises trusses in series under a load on the first; alpha is the load.

    The unknowns are the displacements u_1, ..., u_K of the ridges, positive in the direction of the
    load; truss i is compressed by d_i = u_i - u_(i+1). A stop at node i pushes back with stiffness
    (u_i - place) where u_i exceeds the place. Give the trusses different stiffnesses: equal trusses
    snap at the same load, and where three or more trusses snap, branches stop.

    Parameters
    ----------
    stiffness : sequence of float, shape (K,)
        k_1, ..., k_K, in units of load.
    stops : mapping of int to (float, float), optional
        Number of a node, from 1 -> place and stiffness of the node's stop.

    Raises
    ------
    InvalidInputError
        If a stiffness is not positive, or a stop is at no node.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_structures import TrussChain
    >>> explore(TrussChain([1.0]), (-0.6, 0.6), parameter="load").count(0.0)
    3
    """

    degree = 1  # the gradient of an energy that grows beyond all bounds

    def __init__(
        self, stiffness: Sequence[float] | Array, stops: Stops = MappingProxyType({})
    ) -> None:
        self.k = _positive("stiffness of trusses", stiffness)
        self.size = len(self.k)
        self.nodes = np.array([_node(number, self.size) for number in stops], dtype=int)
        pairs = finite_array("place and stiffness of stops", list(stops.values()) or [(0.0, 1.0)])
        if pairs.shape[1:] != (2,):
            raise InvalidInputError("a stop is a pair of place and stiffness: stops={2: (0.9, 20)}")
        self.places = pairs[: len(stops), 0]
        self.stiffness = _positive("stiffness of stops", pairs[:, 1])[: len(stops)]

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return how far the nodes with stops are beyond the stops."""
        beyond: Array = z[self.nodes] - self.places
        return beyond

    def test_jacobian(self, z: Array, alpha: float) -> Array:
        """Return the gradients of the tests, which are constant."""
        gradients: Array = np.eye(self.size, self.size + 1)[self.nodes]
        return gradients

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the balance of forces at the nodes."""
        force = SnapLaw(self.k)(self.compressions(z))
        balance: Array = force - np.append(alpha, force[:-1])
        balance[self.nodes] += character.array * self.stiffness * (z[self.nodes] - self.places)
        return balance

    def jacobian(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the tangent stiffness, and the derivative by the load as last column."""
        slope = SnapLaw(self.k).slope(self.compressions(z))
        jacobian = np.zeros((self.size, self.size + 1))
        on, below = np.arange(self.size), np.arange(1, self.size)
        jacobian[on, on] = slope + np.append(0.0, slope[:-1])
        jacobian[below, below - 1] = jacobian[below - 1, below] = -slope[:-1]
        jacobian[self.nodes, self.nodes] += character.array * self.stiffness
        jacobian[0, -1] = -1.0
        return jacobian

    def compressions(self, z: Array) -> Array:
        """Return d_1, ..., d_K."""
        compressions: Array = z - np.append(z[1:], 0.0)
        return compressions

    def scale(self, lo: float, hi: float) -> Array:
        """Return how far the nodes move when all trusses snap through."""
        return np.arange(2.0 * self.size, 0.0, -2.0)

    def searches(self) -> Sequence[AllEquilibria]:
        """Return the search that finds everything, if the only stop is at the last node."""
        return [AllEquilibria()] if self.is_decoupled else []

    @property
    def is_decoupled(self) -> bool:
        """Whether every truss carries the whole load, as without stops above the last node."""
        return set(self.nodes) <= {self.size - 1}

    def laws(self) -> list[SnapLaw]:
        """Return the force laws of decoupled trusses, including a stop at the last node."""
        stops = dict(zip(self.nodes, zip(self.places, self.stiffness, strict=True), strict=True))
        return [SnapLaw(k, *stops.get(i, ())) for i, k in enumerate(self.k)]

    def names(self) -> tuple[str, ...]:
        """Return u_1, ..., u_K."""
        return tuple(f"u_{i + 1}" for i in range(self.size))

    def describe(self, character: Character) -> str:
        """Return which nodes are on stops."""
        on = [
            f"node {node + 1}"
            for node, beyond in zip(self.nodes, character.signs, strict=True)
            if beyond
        ]
        return f"{', '.join(on)} on stop" if on else "free"

    def test_name(self, test: int) -> str:
        """Return which stop a test is about."""
        return f"stop at node {self.nodes[test] + 1}"

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return which nodes reach or leave stops."""
        changes = zip(self.nodes, before.signs, after.signs, strict=True)
        return ", ".join(
            f"node {node + 1} {'reaches' if now else 'leaves'} its stop"
            for node, was, now in changes
            if was != now
        )


def _positive(what: str, values: Sequence[float] | Array) -> Array:
    array = finite_array(what, values)
    if array.ndim != 1 or not len(array) or (array <= 0.0).any():
        raise InvalidInputError(f"{what} must be positive numbers, at least one, got {values}")
    return array


def _node(number: int, count: int) -> int:
    if number not in range(1, count + 1):
        raise InvalidInputError(f"stops: no node {number}; there are nodes 1 to {count}")
    return int(number) - 1
