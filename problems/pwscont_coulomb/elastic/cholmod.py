"""Elimination by CHOLMOD, where scikit-sparse is installed: ``pip install scikit-sparse``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.elastic.elimination import NOT_DEFINITE, Eliminated, Elimination
from pwscont_coulomb.elastic.superlu import SolvedInterior


@final
@dataclass(frozen=True, slots=True)
class Cholmod(Elimination):
    """Elimination by CHOLMOD and one solution per kept unknown.

    Raises
    ------
    InvalidInputError
        When used, if scikit-sparse is not installed.
    """

    def eliminate(self, A: Matrix, kept: Indices, positions: Array) -> Eliminated:
        """Eliminate all but the kept unknowns; see :class:`Elimination`."""
        return SolvedInterior(A, kept, _solver)


def _solver(interior: Matrix) -> Callable[[Array], Array]:
    try:
        from sksparse.cholmod import (  # noqa: PLC0415  an optional library
            CholmodNotPositiveDefiniteError,
            cholesky,
        )
    except ImportError as error:
        raise InvalidInputError(
            "Cholmod needs scikit-sparse (and SuiteSparse): pip install 'pwscont[cholmod]'"
        ) from error
    try:
        # supernodal: L L^T, which unlike L D L^T exists for positive definite matrices only
        return cholesky(interior.tocsc(), mode="supernodal")  # type: ignore[no-any-return]
    except CholmodNotPositiveDefiniteError as error:
        raise InvalidInputError(NOT_DEFINITE) from error
