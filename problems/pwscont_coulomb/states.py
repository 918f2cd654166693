"""dH/dz of bodies without the elimination by hand, by the modes of the nodes.

Rows of contact nodes are rows of the body without contact minus multiples of the gradients of
kappa1 and x. Only rows of nodes that slip depend on friction.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix, dense
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.modes import STICKS, TOUCHES
from pwscont_coulomb.rows import without_contact

#: Factors of the gradients of kappa1 and of x that are subtracted from a node's rows in each mode.
IN_CONTACT, HELD = TOUCHES.astype(float), STICKS.astype(float)
#: Factor of F kappa1 in the tangential row of a node in each mode.
SLIPS = np.array([0.0, 0.0, -1.0, 1.0])


class States(ABC):
    """dH/dz of a body.

    Parameters
    ----------
    body : ContactBody
    kappa1, x : ndarray or sparse matrix, shape (p, n + 2 p)
        The gradients by z of kappa1 and x.
    """

    def __init__(self, body: ContactBody, kappa1: Matrix, x: Matrix) -> None:
        self._kappa1, self._x, self._n = kappa1, x, body.n
        self._free = without_contact(body)
        self._slides = ~body.guided

    @cached_property
    def _rows(self) -> Matrix:
        """The rows without contact, and below the normal and the tangential rows of nodes held."""
        held = -sp.vstack([sp.csr_matrix(self._kappa1), sp.csr_matrix(self._x)]).tocsr()
        held = held[:, : self._n]  # by displacements only
        held.resize(held.shape[0], self._free.shape[1])
        if sp.issparse(self._free):
            return sp.vstack([self._free, held]).tocsr()
        return np.vstack([self._free, dense(held)])

    @abstractmethod
    def at(self, mode: Indices, friction: Array) -> Matrix:
        """Return dH/dz, shape (n + 2 p, n + 2 p)."""

    def product(self, z: Array, mode: Indices, friction: Array) -> Array:
        """Return dH/dz z, shape (n + 2 p,), by the meaning of each row: no terms cancel."""
        size, p, parts = len(z), len(mode), self._rows @ z
        product: Array = parts[:size]
        push, drag = parts[size:].reshape(2, p)
        normal, tangential = product[-2 * p :].reshape(2, p)
        tangential += SLIPS.take(mode) * friction * (normal - push)
        np.copyto(normal, push, where=TOUCHES.take(mode))
        np.copyto(tangential, drag, where=STICKS.take(mode) & self._slides)
        return product


@final
class DenseStates(States):
    """dH/dz of a dense body; dH/dz without friction is kept, for F varies within a cell."""

    _last: tuple[bytes, Array] | None = None

    def at(self, mode: Indices, friction: Array) -> Array:
        """Return dH/dz."""
        matrix = self._without_friction(mode).copy()
        matrix[-len(mode) :] += (SLIPS[mode] * friction)[:, np.newaxis] * self._kappa1
        return matrix

    def _without_friction(self, mode: Indices) -> Array:
        """Return dH/dz with F = 0."""
        key = mode.tobytes()
        if self._last is None or self._last[0] != key:
            matrix, p = self._free.copy(), len(mode)
            matrix[-2 * p : -p] -= IN_CONTACT[mode][:, np.newaxis] * self._kappa1
            matrix[-p:] -= HELD[mode][:, np.newaxis] * self._x
            self._last = key, matrix
        return self._last[1]


@final
class SparseStates(States):
    """dH/dz of a sparse body."""

    def at(self, mode: Indices, friction: Array) -> Matrix:
        """Return dH/dz."""
        normal = sp.diags(IN_CONTACT[mode]) @ self._kappa1
        slip = sp.diags(SLIPS[mode] * friction) @ self._kappa1
        tangential = sp.diags(HELD[mode]) @ self._x - slip
        none = sp.csr_matrix((self._free.shape[0] - 2 * len(mode), self._free.shape[1]))
        return (self._free - sp.vstack([none, normal, tangential])).tocsr()
