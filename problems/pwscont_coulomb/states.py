"""dH/dz of bodies that need no elimination of their own, by the modes of their nodes.

Rows of contact nodes are those of the body without contact minus multiples of the gradients of
kappa1 and x. Only rows of nodes that slip depend on friction.
"""

from __future__ import annotations

from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.rows import without_contact

IN_CONTACT = np.array([0.0, 1.0, 1.0, 1.0])
STICKS = np.array([0.0, 1.0, 0.0, 0.0])
SLIPS = np.array([0.0, 0.0, -1.0, 1.0])  # factor of F kappa1 in the tangential row


@final
class DenseStates:
    """dH/dz of a dense body.

    Parameters
    ----------
    body : ContactBody
    kappa1, x : ndarray, shape (p, n + 2 p)
        The gradients by z of kappa1 and x.
    """

    def __init__(self, body: ContactBody, kappa1: Array, x: Array) -> None:
        self._kappa1, self._x = kappa1, x
        #: dH/dz where no node touches.
        self.free: Array = without_contact(body)
        self._last: tuple[bytes, Array] | None = None

    def at(self, mode: Indices, friction: Array) -> Array:
        """Return dH/dz, shape (n + 2 p, n + 2 p)."""
        matrix = self._without_friction(mode).copy()
        matrix[-len(mode) :] += (SLIPS[mode] * friction)[:, np.newaxis] * self._kappa1
        return matrix

    def _without_friction(self, mode: Indices) -> Array:
        """Return dH/dz with F = 0; the last one is kept, for F varies along one cell."""
        key = mode.tobytes()
        if self._last is None or self._last[0] != key:
            matrix, p = self.free.copy(), len(mode)
            matrix[-2 * p : -p] -= IN_CONTACT[mode][:, np.newaxis] * self._kappa1
            matrix[-p:] -= STICKS[mode][:, np.newaxis] * self._x
            self._last = key, matrix
        return self._last[1]


@final
class SparseStates:
    """What :class:`DenseStates` is, of a sparse body."""

    def __init__(self, body: ContactBody, kappa1: Matrix, x: Matrix) -> None:
        self._kappa1, self._x = kappa1, x
        #: dH/dz where no node touches.
        self.free = without_contact(body)
        self._equilibrium = sp.csr_matrix((body.n, self.free.shape[1]))

    def at(self, mode: Indices, friction: Array) -> Matrix:
        """Return dH/dz, shape (n + 2 p, n + 2 p)."""
        normal = sp.diags(IN_CONTACT[mode]) @ self._kappa1
        slip = sp.diags(SLIPS[mode] * friction) @ self._kappa1
        tangential = sp.diags(STICKS[mode]) @ self._x - slip
        return (self.free - sp.vstack([self._equilibrium, normal, tangential])).tocsr()
