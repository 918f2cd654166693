"""Columns and rows of a Jacobian brought to a magnitude of about one, in any storage.

Failure modes and answers
-------------------------
- Entries of a sparse matrix that are stored in parts: they are added up before they are measured.
- A row of zeros has no magnitude: it is given as zero, and the caller decides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Matrix
from pwscont.linear.banded import BandedJacobian
from pwscont.linear.structured import StructuredJacobian


def columns_scaled(jacobian: Matrix, scale: Array) -> Matrix:
    """Return a new matrix with columns multiplied by ``scale``: dense, CSC or banded."""
    if isinstance(jacobian, StructuredJacobian):
        return jacobian.scaled(scale)
    if sp.issparse(jacobian):
        csc = _canonical(jacobian)
        return _like(csc, csc.data * np.repeat(scale, np.diff(csc.indptr)))
    return jacobian * scale


def rows_divided(jacobian: Matrix, rows: Array) -> Matrix:
    """Return a new matrix with the rows of one from :func:`columns_scaled` divided."""
    if isinstance(jacobian, BandedJacobian):
        return jacobian.divided(rows)
    if sp.issparse(jacobian):
        return _like(jacobian, jacobian.data / rows[jacobian.indices])
    return jacobian / rows[:, np.newaxis]


def largest_in_rows(jacobian: Matrix) -> Array:
    """Return the largest magnitude in each row of a matrix from :func:`columns_scaled`."""
    if isinstance(jacobian, BandedJacobian):
        return jacobian.largest_in_rows()
    if sp.issparse(jacobian):
        largest = np.zeros(jacobian.shape[0])
        np.maximum.at(largest, jacobian.indices, np.abs(jacobian.data))
        return largest
    dense: Array = np.abs(jacobian).max(axis=1)
    return dense


def _canonical(jacobian: Any) -> Any:
    """Return a CSC matrix without duplicate entries."""
    csc = jacobian.tocsc()
    if not csc.has_canonical_format:
        csc = csc.copy()
        csc.sum_duplicates()
    return csc


def _like(csc: Any, data: Array) -> Any:
    """Return a matrix with the pattern of another."""
    return sp.csc_matrix((data, csc.indices, csc.indptr), shape=csc.shape)
