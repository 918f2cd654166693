"""Bordered solves with sparse Jacobians, which the border does not fill.

Failure modes and answers
-------------------------
- SuperLU gives up where a pivot of the part for z vanishes exactly: there is no factorisation
  then, and the caller factorises the whole bordered matrix.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.linear.bordered import BorderedFactor, Interior, row_scale
from pwscont.linear.cores import Core, SparseCore, superlu
from pwscont.linear.equilibration import columns_scaled, largest_in_rows, rows_divided
from pwscont.linear.factor import Factor


def bordered_sparse(jacobian: Matrix, row: Array, scale: Array) -> Factor | None:
    """Factorise [J; row] for a sparse J by its part for z.

    None where there is no LU of that part; ``scale`` is that of
    :func:`pwscont.linear.factorise.bordered`.
    """
    scaled, row = columns_scaled(jacobian, scale), row * scale
    rows = row_scale(largest_in_rows(scaled), row)
    core, column = split(rows_divided(scaled, rows[:-1]))
    if core is None:
        return None
    return BorderedFactor(Interior(core, column), row / rows[-1], rows, scale)


def split(jacobian: Matrix) -> tuple[Core | None, Array]:
    """Return an LU of the part for z, and the column for alpha.

    Parameters
    ----------
    jacobian : CSC matrix, shape (n, n + 1)
        With entries of about one.
    """
    n, end = jacobian.shape[0], jacobian.indptr[-2]
    column = np.zeros(n)
    column[jacobian.indices[end:]] = jacobian.data[end:]
    parts = jacobian.data[:end], jacobian.indices[:end], jacobian.indptr[:-1]
    lu = superlu(sp.csc_matrix(parts, shape=(n, n)))
    return (SparseCore(lu) if lu is not None else None), column
