"""The forces of a body by the displacements of its nodes in contact, kept from event to event.

With the flexibility C of the contact unknowns (u = g + C lam), the forces at the active unknowns
are lam = K (u - g), K the inverse of the active part of C. From one event to the next few unknowns
change: each changes K by a matrix of rank one.

Failure modes and answers
-------------------------
- Rounding errors of many changes add: K is computed afresh after some changes.
"""

from __future__ import annotations

from typing import final

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from pwscont.extending import Array

Flags = npt.NDArray[np.bool_]
#: Largest number of changes of rank one before the inverse is computed afresh.
MOST_CHANGES = 24


@final
class ActiveInverse:
    """The inverse of the active part of a symmetric positive definite matrix.

    Parameters
    ----------
    flexibility : ndarray, shape (m, m)
    """

    def __init__(self, flexibility: Array) -> None:
        self._C = flexibility
        self._active: Flags = np.zeros(len(flexibility), dtype=bool)
        self._K = np.zeros_like(flexibility)
        self._changes = 0

    def at(self, active: Flags) -> Array:
        """Return K, with zeros at unknowns that are not active; not to be written to.

        Parameters
        ----------
        active : ndarray of bool, shape (m,)
        """
        changed = np.flatnonzero(active != self._active)
        self._changes += len(changed)
        if self._changes > MOST_CHANGES:
            self._afresh(active)
            return self._K
        for j in changed.tolist():
            self._drop(j) if self._active[j] else self._take(j)
        return self._K

    def _afresh(self, active: Flags) -> None:
        self._changes, self._active = 0, active.copy()
        self._K = np.zeros_like(self._C)
        which = np.flatnonzero(active)
        if len(which):
            lower = lapack.dpotrf(self._C[np.ix_(which, which)], lower=1)[0]
            inverse = lapack.dpotri(lower, lower=1)[0]
            self._K[np.ix_(which, which)] = np.tril(inverse) + np.tril(inverse, -1).T

    def _take(self, j: int) -> None:
        """Make an unknown active."""
        column = self._K @ self._C[j]
        pivot = self._C[j, j] - float(self._C[j] @ column)
        column[j] = -1.0
        self._K += np.multiply.outer(column / pivot, column)
        self._active[j] = True

    def _drop(self, j: int) -> None:
        """Make an unknown passive."""
        column = self._K[j].copy()
        self._K -= np.multiply.outer(column / column[j], column)
        self._K[j] = self._K[:, j] = 0.0
        self._active[j] = False
