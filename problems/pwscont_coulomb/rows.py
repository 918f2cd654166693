"""Rows of dH/dz and of the gradients of the tests, dense or sparse as the body is."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Indices, Matrix, dense
from pwscont_coulomb.body import ContactBody

#: Up to this many rows are taken out of a sparse matrix as dense ones.
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


def some_rows(matrix: Matrix, which: Indices) -> Matrix:
    """Return some rows of a matrix; a few of a sparse one are dense, which takes less time."""
    if not sp.issparse(matrix):
        return matrix[which]
    first, counts = matrix.indptr[which], np.diff(matrix.indptr)[which]
    ends = np.cumsum(counts)
    entries = np.arange(counts.sum()) + np.repeat(first - ends + counts, counts)
    data, columns = matrix.data[entries], matrix.indices[entries]
    shape = (len(which), matrix.shape[1])
    if len(which) > FEW:
        return sp.csr_matrix((data, columns, np.append(0, ends)), shape)
    rows = np.zeros(shape)
    rows[np.repeat(np.arange(len(which)), counts), columns] = data
    return rows


def by_node(first: Array, second: Array, third: Array) -> Array:
    """Interleave three arrays along their first axis."""
    mixed = np.empty((3 * len(first), *first.shape[1:]))
    mixed[0::3], mixed[1::3], mixed[2::3] = first, second, third
    return mixed


def scaled(factors: Array, rows: Matrix) -> Matrix:
    """Return each row multiplied by its factor."""
    return sp.diags(factors) @ rows if sp.issparse(rows) else factors[:, np.newaxis] * rows
