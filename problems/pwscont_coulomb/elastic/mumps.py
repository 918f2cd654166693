"""Elimination by MUMPS, whose factor is spread over the ranks of an MPI run.

MUMPS factorises the interior (Amestoy, Duff, L'Excellent and Koster 2001; Users' Guide 5.5) along
the nested dissection of :class:`~pwscont_coulomb.elastic.Multifrontal`, the contact unknowns last,
and leaves the Schur complement on rank 0. Rank 0 holds the mesh, the matrix and the contact
problem; each rank holds a part of the factor. All ranks take part in a solution with the interior,
which condenses a load or recovers a field.

Failure modes and answers
-------------------------
- The matrix is not positive definite: MUMPS, which takes the user's word, only counts negative
  pivots; any negative pivot is refused. Pivots of a part that can move are zero up to rounding of
  either sign, so two steps of inverse iteration estimate the smallest eigenvalue of the interior,
  scaled to a unit diagonal; an eigenvalue below rounding is refused.
- The workspace that MUMPS estimated is too small: the workspace is enlarged, up to eightfold.
- A rank has no memory left: an error says so, and what MUMPS expected to need.
- Several hundred million unknowns: pymumps counts entries in 32 bits; more are refused.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont import InvalidInputError
from pwscont.extending import EPS, GUARD, Array, Indices, Matrix
from pwscont_coulomb.elastic.dissection import dissect
from pwscont_coulomb.elastic.elimination import NOT_DEFINITE, Eliminated, Elimination
from pwscont_coulomb.elastic.ranks import ANALYSE, FACTORISE, SOLVE, ranks
from pwscont_coulomb.elastic.solved_interior import SolvedInterior

#: Positions of controls in ICNTL.
ORDERING, RELAXATION, SCHUR = 7, 14, 19
#: Percentages by which the workspace exceeds the estimate: the default, then further attempts.
RELAXATIONS = (20, 50, 100, 700)
#: Values of INFOG(1): the matrix is singular; workspace or buffers, memory are too small.
SINGULAR, WORKSPACE, MEMORY = {-6, -10, -40}, {-8, -9, -11, -14, -15, -17, -20}, {-5, -7, -13, -19}
#: Most entries of a matrix: pymumps counts entries in 32 bits.
MOST_ENTRIES = 2**31 - 1


@final
@dataclass(frozen=True, slots=True)
class Mumps(Elimination):
    """Elimination by MUMPS, in this process or on all ranks of an MPI run.

    Under MPI, ``mpiexec -n 4 python -m pwscont_coulomb.mpi SCRIPT`` runs the script on rank 0; the
    other ranks serve. Needs MUMPS and pymumps (the extra ``mumps``).

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Mumps
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> problem = triangle().build().condensed(Mumps())  # doctest: +SKIP
    """

    def eliminate(self, A: Matrix, kept: Indices, positions: Array) -> Eliminated:
        """Eliminate all unknowns except the kept unknowns; see :class:`Elimination`.

        Raises
        ------
        MissingPackageError
            If MUMPS or pymumps is not installed.
        InvalidInputError
            If A is not positive definite or does not fit into memory, or there are several ranks
            and none serves.
        """
        ranks()
        A = A.tocsr()
        interior = np.setdiff1d(np.arange(A.shape[0]), kept)
        if not len(interior):
            return SolvedInterior(A, kept, interior, np.zeros_like, A[kept][:, kept].toarray())
        factor = factorised(A, kept, interior, positions)
        return SolvedInterior(A, kept, interior, factor.solve, factor.schur)


def factorised(A: Matrix, kept: Indices, interior: Indices, positions: Array) -> MumpsFactor:
    """Return the factor of the interior of a matrix; arguments as for ``eliminate``."""
    scale = A.diagonal()[interior]
    if not (scale > 0.0).all():
        raise InvalidInputError(NOT_DEFINITE)
    order = np.concatenate([dissect(A, interior, positions).order, kept])
    factor = MumpsFactor(sp.tril(A, format="coo"), kept, interior, order)
    if not _definite(factor, np.sqrt(scale)):
        raise InvalidInputError(NOT_DEFINITE)
    return factor


def _definite(factor: MumpsFactor, scale: Array) -> bool:
    """Tell whether the smallest eigenvalue of a scaled interior is positive beyond rounding."""
    x = np.random.default_rng(0).standard_normal(len(scale))
    size = np.inf
    for _ in range(2):
        x = scale * factor.solve(scale * (x / np.linalg.norm(x)))
        size = float(np.linalg.norm(x))
        if not np.isfinite(size):
            return False
    return size * GUARD * EPS < 1.0


@final
class MumpsFactor:
    """The factor of an interior, spread over all ranks, and the Schur complement.

    Parameters
    ----------
    lower : scipy.sparse coo, shape (n, n)
        The lower triangle of the matrix.
    kept : ndarray of int, shape (k,)
    interior : ndarray of int, shape (n - k,)
    order : ndarray of int, shape (n,)
        All unknowns in the order of elimination, the kept unknowns last.

    Attributes
    ----------
    schur : ndarray, shape (k, k)
    entries : int
        Entries of the factor, on all ranks together.
    megabytes : tuple of int
        Memory that MUMPS used for factorising: the most on a single rank, and on all ranks.
    """

    def __init__(self, lower: Matrix, kept: Indices, interior: Indices, order: Indices) -> None:
        if lower.nnz > MOST_ENTRIES:
            raise InvalidInputError(
                f"the stiffness matrix has {lower.nnz} entries in its lower triangle; pymumps can "
                f"count {MOST_ENTRIES}, those of about 220 million unknowns"
            )
        self._n, self._interior = lower.shape[0], interior
        self._ranks = ranks()
        self._number = self._ranks.begin()
        weakref.finalize(self, self._ranks.release, self._number)
        self._solver = self._ranks.solver(self._number)
        self.schur = self._factorise(lower, kept, order)
        self.entries = _counted(self._solver.get_infog(9))
        self.megabytes = self._solver.get_infog(21), self._solver.get_infog(22)

    def __reduce__(self) -> Any:
        raise InvalidInputError(
            "a problem condensed by Mumps cannot be copied or sent to another process: its factor "
            "is spread over the ranks of this run"
        )

    def _factorise(self, lower: Matrix, kept: Indices, order: Indices) -> Array:
        """Hand all to MUMPS and return the Schur complement; nothing handed over is needed later.

        MUMPS fills the lower triangle of the Schur complement, row after row.
        """
        place, schur = np.empty(self._n, dtype=np.int32), np.zeros((len(kept), len(kept)))
        place[order] = np.arange(1, self._n + 1)
        self._solver.set_shape(self._n)
        self._solver.id.nz, self._solver.id.size_schur = lower.nnz, len(kept)
        rows, columns, listed = (_numbered(x) for x in (lower.row, lower.col, kept))
        values = np.asarray(lower.data, dtype=float)
        self._hand(irn=rows, jcn=columns, a=values, perm_in=place)
        self._hand(listvar_schur=listed, schur=schur)
        self._solver.set_icntl(ORDERING, 1)  # the order given
        self._solver.set_icntl(SCHUR, 1)  # on rank 0
        self._run(ANALYSE)
        self._run(FACTORISE)
        if self._solver.get_infog(12):  # negative pivots
            raise InvalidInputError(NOT_DEFINITE)
        return np.tril(schur) + np.tril(schur, -1).T

    def solve(self, b: Array) -> Array:
        """Return x with A_II x = b, where x and b have shape (n - k,)."""
        both = np.zeros(self._n)
        both[self._interior] = b
        self._hand(rhs=both)
        self._run(SOLVE)
        found: Array = both[self._interior]
        return found

    def _hand(self, **arrays: Any) -> None:
        """Tell MUMPS where arrays are; the caller keeps the arrays alive."""
        for name, array in arrays.items():
            setattr(self._solver.id, name, self._solver.cast_array(array))

    def _run(self, job: int) -> None:
        """Do a job on all ranks, with more workspace while the workspace is too small."""
        for relaxation in RELAXATIONS:
            self._solver.set_icntl(RELAXATION, relaxation)
            self._ranks.run(self._number, job)
            if self._solver.get_infog(1) not in WORKSPACE:
                break
        if self._solver.get_infog(1) < 0:
            raise InvalidInputError(_words(self._solver, self._ranks.size))


def _numbered(positions: Indices) -> Indices:
    """Return positions counted from 1, as MUMPS does."""
    return (positions + 1).astype(np.int32)


def _counted(entries: int) -> int:
    """Return a number from INFOG, which counts large numbers in millions, with a minus sign."""
    return entries if entries >= 0 else -1_000_000 * entries


def _words(solver: Any, size: int) -> str:
    """Return the meaning of a failure of MUMPS, in words."""
    code, detail = solver.get_infog(1), solver.get_infog(2)
    if code in SINGULAR:
        return NOT_DEFINITE
    if code in MEMORY | WORKSPACE:
        return (
            f"the body does not fit into the memory of {size} rank{'s' * (size > 1)}: MUMPS "
            f"expected {solver.get_infog(16)} MB on one of them and {solver.get_infog(17)} MB in "
            f"all (INFOG(1) = {code}, INFOG(2) = {detail}); take more ranks on more machines"
        )
    return f"MUMPS failed with INFOG(1) = {code}, INFOG(2) = {detail}: see its Users' Guide"
