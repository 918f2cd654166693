"""Eliminating unknowns from a sparse symmetric positive definite system, once.

With the unknowns split into interior I and kept C,

    S = A_CC - A_CI A_II^-1 A_IC,    g = f_C - A_CI A_II^-1 f_I,    A_II u_I = f_I - A_IC u_C

(Schur complement, condensed load, recovery).
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from pwscont.extending import Array, Indices, Matrix

#: The message when a factorisation fails.
NOT_DEFINITE = (
    "the stiffness matrix is not positive definite; is the body clamped well enough, and are all "
    "elements and materials sound?"
)


class Eliminated(ABC):
    """A system whose interior has been eliminated."""

    @property
    @abstractmethod
    def schur(self) -> Array:
        """The Schur complement S, shape (k, k), in the order of the kept unknowns."""

    @abstractmethod
    def reduce(self, f: Array) -> Array:
        """Return the condensed load g, shape (k,), of a load f, shape (n,)."""

    @abstractmethod
    def recover(self, f: Array, kept: Array) -> Array:
        """Return all unknowns, shape (n,), from a load, shape (n,), and the kept unknowns, (k,)."""


class Elimination(ABC):
    """A way to eliminate interior unknowns; all implementations are interchangeable.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Elimination, Multifrontal, SuperLU
    >>> [isinstance(way, Elimination) for way in (Multifrontal(), SuperLU())]
    [True, True]
    """

    @abstractmethod
    def eliminate(self, A: Matrix, kept: Indices, positions: Array) -> Eliminated:
        """Eliminate all unknowns except the kept unknowns.

        Parameters
        ----------
        A : scipy.sparse, shape (n, n)
            Symmetric positive definite.
        kept : ndarray of int, shape (k,)
        positions : ndarray, shape (2, n)
            The place of each unknown in the plane, which may guide the order of elimination.

        Raises
        ------
        InvalidInputError
            If A is not positive definite.
        """
