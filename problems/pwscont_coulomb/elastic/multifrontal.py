"""Elimination by dense fronts along a nested dissection (multifrontal Cholesky).

Every front owns some unknowns. A front gathers the entries of the own unknowns and the Schur
complements of the children, factorises the own block by LAPACK's Cholesky, and leaves a Schur
complement on the later unknowns that are coupled with the own unknowns (Duff and Reid 1983). The
kept unknowns come last and are never eliminated: the complement left on the kept unknowns is the
result, without a single extra solution. Each factor is stored once.

Failure modes and answers
-------------------------
- The matrix is not positive definite: a pivot block has no Cholesky factor, and an error says so.
- Unknowns of very different stiffness: Cholesky without pivoting is backward stable for symmetric
  positive definite matrices, whatever the scaling by rows and columns.
- Long thin or oddly shaped bodies: the order costs more fill, the result is the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from pwscont import InvalidInputError
from pwscont.extending import Array, Indices, Matrix
from pwscont_coulomb.elastic.dissection import Dissection, dissect
from pwscont_coulomb.elastic.elimination import NOT_DEFINITE, Eliminated, Elimination


@final
@dataclass(frozen=True, slots=True, eq=False)
class Front:
    """The factor of the unknowns that a front eliminates.

    Attributes
    ----------
    start, end : int
        The own unknowns of the front, as a range in the order of elimination.
    later : ndarray of int, shape (l,)
        The later unknowns that are coupled with the own unknowns.
    own : ndarray, shape (e, e)
        Lower triangular Cholesky factor.
    below : ndarray, shape (l, e)
        The rows of the factor that belong to ``later``.
    """

    start: int
    end: int
    later: Indices
    own: Array
    below: Array


@final
@dataclass(frozen=True, slots=True)
class Multifrontal(Elimination):
    """Elimination by dense fronts.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import Multifrontal
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> triangle().build().condensed(Multifrontal()).along_load().size
    4
    """

    def eliminate(self, A: Matrix, kept: Indices, positions: Array) -> Eliminated:
        """Eliminate all unknowns except the kept unknowns; see :class:`Elimination`."""
        interior = np.setdiff1d(np.arange(A.shape[0]), kept)
        plan = dissect(A, interior, positions)
        order = np.concatenate([plan.order, kept])
        return _eliminate(_upper(A, order), order, plan)


def _upper(A: Matrix, order: Indices) -> Matrix:
    """Return the upper triangle of A in another order, rows sorted."""
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order))
    entries = A.tocoo()
    rows, columns = place[entries.row], place[entries.col]
    upper = rows <= columns
    shape = A.shape
    return sp.csr_matrix((entries.data[upper], (rows[upper], columns[upper])), shape=shape)


def _eliminate(upper: Matrix, order: Indices, plan: Dissection) -> MultifrontalFactor:
    """Factorise front after front; a complement is stored until the parent's turn."""
    fronts: list[Front] = []
    waiting: dict[int, list[tuple[Indices, Array]]] = {}
    local = np.empty(len(order), dtype=np.intp)
    for number, start, end in zip(plan.tree, plan.bounds[:-1], plan.bounds[1:], strict=True):
        children = waiting.pop(int(number), [])
        front, left = _front(upper, int(start), int(end), children, local)
        fronts.append(front)
        if len(front.later):
            parent = _parent(int(number), plan, int(front.later[0]))
            waiting.setdefault(parent, []).append((front.later, left))
    m = int(plan.bounds[-1])
    kept = np.arange(m, len(order))
    schur = _assembled(upper, m, len(order), kept[:0], waiting.pop(KEPT, []), local)
    return MultifrontalFactor(fronts, order, m, schur)


#: The parent of fronts whose complements lie on kept unknowns only.
KEPT = 0


def _parent(number: int, plan: Dissection, first: int) -> int:
    """Return the front that eliminates the first unknown of a front's complement."""
    if first >= plan.bounds[-1]:
        return KEPT
    return int(plan.tree[np.searchsorted(plan.bounds, first, side="right") - 1])


def _front(
    upper: Matrix, start: int, end: int, children: list[tuple[Indices, Array]], local: Indices
) -> tuple[Front, Array]:
    """Return a front's factor, and the Schur complement on later unknowns."""
    coupled = upper.indices[upper.indptr[start] : upper.indptr[end]]
    later = np.unique(np.concatenate([coupled, *(unknowns for unknowns, _ in children)]))
    later = later[np.searchsorted(later, end) :].astype(np.intp)
    matrix, e = _assembled(upper, start, end, later, children, local), end - start
    own, info = lapack.dpotrf(matrix[:e, :e], lower=1, clean=1)
    if info:
        raise InvalidInputError(NOT_DEFINITE)
    below = blas.dtrsm(1.0, own, matrix[e:, :e], side=1, lower=1, trans_a=1)
    left = blas.dsyrk(-1.0, below, beta=1.0, c=matrix[e:, e:], lower=1)
    return Front(start, end, later, own, below), left


def _assembled(
    upper: Matrix,
    start: int,
    end: int,
    later: Indices,
    children: list[tuple[Indices, Array]],
    local: Indices,
) -> Array:
    """Return the lower triangle of a front: own unknowns, then later unknowns, F-ordered."""
    e = end - start
    local[start:end], local[later] = np.arange(e), np.arange(e, e + len(later))
    transposed = np.zeros((e + len(later), e + len(later)))
    first, last = upper.indptr[start], upper.indptr[end]
    rows = np.repeat(np.arange(e), np.diff(upper.indptr[start : end + 1]))
    transposed[rows, local[upper.indices[first:last]]] = upper.data[first:last]
    while children:  # a complement is freed as soon as gathered
        unknowns, left = children.pop()
        at = local[unknowns]
        transposed[at[:, np.newaxis], at] += left.T
    return transposed.T


@final
class MultifrontalFactor(Eliminated):
    """The fronts of an elimination, and the Schur complement on the kept unknowns.

    Parameters
    ----------
    fronts : list of Front
        Children before parents.
    order : ndarray of int, shape (n,)
        All unknowns in the order of elimination, the kept unknowns last.
    interior : int
        Number of eliminated unknowns.
    lower : ndarray, shape (k, k)
        Lower triangle of the Schur complement; completed in place.
    """

    def __init__(self, fronts: list[Front], order: Indices, interior: int, lower: Array) -> None:
        self.fronts = fronts
        self._order, self._interior = order, interior
        above = np.triu_indices(len(lower), 1)
        lower[above] = lower.T[above]
        self._schur = lower

    @property
    def schur(self) -> Array:
        """The Schur complement, shape (k, k)."""
        return self._schur

    @property
    def stored(self) -> int:
        """Number of entries of all factors."""
        return sum(front.own.size + front.below.size for front in self.fronts)

    def reduce(self, f: Array) -> Array:
        """Return the condensed load, shape (k,)."""
        return self._forward(f)[self._interior :]

    def recover(self, f: Array, kept: Array) -> Array:
        """Return all unknowns, shape (n,)."""
        x = self._forward(f)
        x[self._interior :] = kept
        for front in reversed(self.fronts):
            rhs = x[front.start : front.end] - front.below.T @ x[front.later]
            x[front.start : front.end] = lapack.dtrtrs(front.own, rhs, lower=1, trans=1)[0]
        found = np.empty(len(x))
        found[self._order] = x
        return found

    def _forward(self, f: Array) -> Array:
        x: Array = f[self._order].astype(float)
        for front in self.fronts:
            part = lapack.dtrtrs(front.own, x[front.start : front.end], lower=1)[0]
            x[front.start : front.end] = part
            x[front.later] -= front.below @ part
        return x
