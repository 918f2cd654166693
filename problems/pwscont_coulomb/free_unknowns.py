"""Which unknowns the modes leave free, two for each node, and the others by these.

==========  =============  =============
mode        normal         tangential
==========  =============  =============
no contact  u_nu           u_t
stick       lam_nu         lam_t
slip        lam_nu         u_t
==========  =============  =============

The displacements of the interior are free in all modes.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.extending import Array, Indices
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.contact_algebra import picked
from pwscont_coulomb.modes import Mode

MOVES_NORMALLY = np.array([mode == Mode.NO_CONTACT for mode in Mode])
MOVES_ALONG = np.array([mode != Mode.STICK for mode in Mode])


@final
class FreeUnknowns:
    """The free unknowns of a body.

    Parameters
    ----------
    body : ContactBody
        With N and T that pick single displacements.
    """

    def __init__(self, body: ContactBody) -> None:
        self._n, self._p, self._gap = body.n, body.p, body.gap
        self._normal, self._tangential = picked(body.N), picked(body.T)
        self._all = np.arange(body.n + 2 * body.p)

    def of(self, mode: Indices) -> Indices:
        """Return the free unknowns for one mode of every node, shape (n,)."""
        n, p = self._n, self._p
        free = self._all[:n].copy()
        free[self._normal] = np.where(MOVES_NORMALLY[mode], self._normal, self._all[n : n + p])
        free[self._tangential] = np.where(MOVES_ALONG[mode], self._tangential, self._all[n + p :])
        return free

    def completed(self, values: Array, mode: Indices, ratio: Array) -> Array:
        """Return z, shape (n + 2 p,), from the free unknowns.

        Parameters
        ----------
        values : ndarray, shape (n,)
        mode : ndarray of int, shape (p,)
        ratio : ndarray, shape (p,)
            lam_t by lam_nu of slipping nodes, zero for the others.
        """
        n, p = self._n, self._p
        z = np.zeros(n + 2 * p)
        z[self._normal] = self._gap  # unless it is free
        z[self.of(mode)] = values
        z[n + p :] += ratio * z[n : n + p]
        return z
