"""Rows of dH/dz and of the gradients of the tests, dense or sparse as the body is."""

from __future__ import annotations

from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix, dense
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.fixed import protected

#: Most rows that are taken out of a sparse matrix as a dense array, which is faster.
FEW = 8


def without_contact(body: ContactBody) -> Matrix:
    """Return dH/dz without any contact: equilibrium, lam_nu = 0, lam_t = 0."""
    if not body.is_sparse:
        matrix = np.eye(body.n + 2 * body.p)
        matrix[: body.n] = np.hstack([body.A, -dense(body.N).T, -dense(body.T).T])
        return matrix
    one, N, T = sp.identity(body.p), sp.csr_matrix(body.N), sp.csr_matrix(body.T)
    blocks = [[body.A, -N.T, -T.T], [None, one, None], [None, None, one]]
    return sp.bmat(blocks, format="csr")


def rows_of_tests(body: ContactBody, r: Array, is_sparse: bool) -> tuple[Matrix, Matrix]:
    """Return the gradients by z of kappa1 and x, each of shape (p, n + 2 p)."""
    slides = np.where(body.guided, 0.0, 1.0)
    if not is_sparse:
        one, none = np.eye(body.p), np.zeros((body.p, body.p))
        N, T = -r[:, np.newaxis] * dense(body.N), -r[:, np.newaxis] * dense(body.T)
        return np.hstack([N, one, none]), slides[:, np.newaxis] * np.hstack([T, none, one])
    one, none = sp.identity(body.p), sp.csr_matrix((body.p, body.p))
    N, T = -sp.diags(r) @ sp.csr_matrix(body.N), -sp.diags(r) @ sp.csr_matrix(body.T)
    x = sp.diags(slides) @ sp.hstack([T, none, one])
    return sp.hstack([N, one, none]).tocsr(), x.tocsr()


@final
class GradientRows(sp.csr_matrix):  # type: ignore[misc]
    """Sparse rows, read-only; a few rows at a time are taken again and again.

    A few rows are returned as a dense array: any operation of scipy on a sparse matrix takes
    longer.
    """

    def __getitem__(self, key: Any) -> Matrix:
        """Return rows by number; for other keys the same as scipy's matrices."""
        if not isinstance(key, np.ndarray) or key.dtype.kind != "i":
            return super().__getitem__(key)
        entries, counts = _entries(self.indptr, key)
        return _taken(self.data[entries], self.indices[entries], counts, self.shape[1])

    def __abs__(self) -> Matrix:
        """Return the magnitudes, which are remembered."""
        if not hasattr(self, "_magnitudes"):
            self._magnitudes = super().__abs__()
        return self._magnitudes


def _entries(starts: Indices, rows: Indices) -> tuple[Indices, Indices]:
    """Return where the entries of some rows are stored, and how many there are in each."""
    first, counts = starts[rows], starts[rows + 1] - starts[rows]
    before = np.cumsum(counts) - counts
    return np.arange(counts.sum()) + np.repeat(first - before, counts), counts


def _taken(data: Array, columns: Indices, counts: Indices, width: int) -> Matrix:
    """Return rows from entries, columns and entries per row; few rows are dense."""
    if len(counts) > FEW:
        starts = np.append(0, np.cumsum(counts))
        return GradientRows((data, columns, starts), (len(counts), width))
    rows = np.zeros((len(counts), width))
    rows[np.repeat(np.arange(len(counts)), counts), columns] = data
    return rows


@final
class SparseGradients:
    """The gradients of all tests of a sparse body; the pattern does not depend on friction.

    Parameters
    ----------
    kappa1, x : sparse matrix, shape (p, n + 2 p)
        The gradients by z of kappa1 and x.
    """

    def __init__(self, kappa1: Matrix, x: Matrix) -> None:
        by_node = np.arange(3 * kappa1.shape[0]).reshape(3, -1).T.ravel()
        fixed = sp.vstack([kappa1, x, x]).tocsr()[by_node]
        slopes = sp.vstack([0.0 * kappa1, -kappa1, kappa1]).tocsr()[by_node]
        pattern = sp.hstack([abs(fixed) + abs(slopes), np.ones((len(by_node), 1))]).tocsr()
        pattern.eliminate_zeros()
        pattern.sort_indices()
        rows, columns = pattern.nonzero()
        self._last = columns == kappa1.shape[1]
        inner = rows[~self._last], columns[~self._last]
        self._fixed, self._slopes = np.zeros(len(rows)), np.zeros(len(rows))
        self._fixed[~self._last] = np.asarray(fixed[inner]).ravel()
        self._slopes[~self._last] = np.asarray(slopes[inner]).ravel()
        self._pattern, self._node = pattern, rows // 3

    def at(self, friction: Array, by_alpha: Array) -> GradientRows:
        """Return the gradients, shape (3 p, n + 2 p + 1), node by node.

        Parameters
        ----------
        friction : ndarray, shape (p,)
        by_alpha : ndarray, shape (3 p,)
            Derivatives of the tests by alpha.
        """
        data = self._fixed + friction[self._node] * self._slopes
        data[self._last] = by_alpha
        pattern = self._pattern
        return GradientRows((protected(data), pattern.indices, pattern.indptr), pattern.shape)

    def some(self, which: Indices, friction: Array, by_alpha: Array) -> Matrix:
        """Return only some rows; no other rows are computed."""
        pattern = self._pattern
        entries, counts = _entries(pattern.indptr, which)
        data = self._fixed[entries] + friction[self._node[entries]] * self._slopes[entries]
        data[self._last[entries]] = by_alpha[which]
        return _taken(data, pattern.indices[entries], counts, pattern.shape[1])


@final
class DenseGradients:
    """The gradients of all tests of a dense body, as :class:`SparseGradients` of a sparse body."""

    def __init__(self, kappa1: Array, x: Array) -> None:
        self._kappa1 = kappa1
        self._fixed = np.column_stack([by_node(kappa1, x, x), np.zeros(3 * len(x))])

    def at(self, friction: Array, by_alpha: Array) -> Array:
        """Return the gradients, shape (3 p, n + 2 p + 1), node by node."""
        rows, bound = self._fixed.copy(), friction[:, np.newaxis] * self._kappa1
        rows[1::3, :-1] -= bound
        rows[2::3, :-1] += bound
        rows[:, -1] = by_alpha
        return rows

    def some(self, which: Indices, friction: Array, by_alpha: Array) -> Matrix:
        """Return only some rows."""
        rows: Matrix = self.at(friction, by_alpha)[which]
        return rows


def by_node(first: Array, second: Array, third: Array) -> Array:
    """Interleave three arrays along the first axis."""
    mixed = np.empty((3 * len(first), *first.shape[1:]))
    mixed[0::3], mixed[1::3], mixed[2::3] = first, second, third
    return mixed
