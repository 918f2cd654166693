"""The part of a Jacobian for z, factorised as it is stored, for solves in its own units.

Failure modes and answers
-------------------------
- The part is singular, as on vertical pieces, or nearly so: a pivot that vanishes to rounding is
  moved off zero. Solutions are huge then, which the caller must look at.
- Rows and columns in different units: both are scaled as in :mod:`pwscont.linear.factorise`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.linear.banded import BandedJacobian
from pwscont.linear.cores import Core, DenseCore, ScaledCore, factorised
from pwscont.linear.equilibration import columns_scaled, largest_in_rows, rows_divided
from pwscont.linear.factor import power_of_two
from pwscont.linear.sparse import split
from pwscont.linear.structured import StructuredJacobian


def inner(jacobian: Matrix, scale: Array) -> Core | None:
    """Factorise the part of J for z; None where it has no factorisation.

    Parameters
    ----------
    jacobian : ndarray, sparse matrix or StructuredJacobian, shape (n, n + 1)
    scale : ndarray, shape (n + 1,)
        Typical magnitudes of the unknowns, powers of two.
    """
    if isinstance(jacobian, StructuredJacobian) and not isinstance(jacobian, BandedJacobian):
        return jacobian.inner(scale)
    if isinstance(jacobian, np.ndarray):
        return _dense(jacobian, scale)
    scaled = columns_scaled(jacobian, scale)
    rows = power_of_two(largest_in_rows(scaled))
    divided = rows_divided(scaled, rows)
    core = _core(divided)
    return core and ScaledCore(core, rows, scale[:-1])


def column(jacobian: Matrix, index: int) -> Array:
    """Return a column of a Jacobian in any storage, shape (n,), an array of its own."""
    if isinstance(jacobian, StructuredJacobian):
        return jacobian.column_at(index)
    if sp.issparse(jacobian):
        return _sparse_column(jacobian, index)
    return np.array(jacobian[:, index], dtype=float)


def _sparse_column(jacobian: Any, index: int) -> Array:
    """Return a column of a sparse matrix; scipy's own way takes ten times as long."""
    by_rows = jacobian.format == "csr"
    stored = jacobian if by_rows else jacobian.tocsc()
    if by_rows:
        entries = np.flatnonzero(stored.indices == index)
        rows = np.searchsorted(stored.indptr, entries, side="right") - 1
    else:
        entries = np.arange(*stored.indptr[index : index + 2])
        rows = stored.indices[entries]
    column: Array = np.bincount(rows, stored.data[entries], jacobian.shape[0]).astype(float)
    return column


def _core(divided: Matrix) -> Core | None:
    return divided.split()[0] if isinstance(divided, BandedJacobian) else split(divided)[0]


def _dense(jacobian: Array, scale: Array) -> Core:
    """Factorise in one array: room for more costs as much as what is done in it."""
    own = np.multiply(jacobian, scale, order="F")
    rows = power_of_two(np.maximum(own.max(axis=1), -own.min(axis=1)))
    own /= rows[:, np.newaxis]
    return ScaledCore(DenseCore(*factorised(own[:, :-1], overwrite=True)), rows, scale[:-1])
