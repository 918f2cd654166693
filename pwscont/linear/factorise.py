"""Factorisations of matrices in every storage: the functions that the other rooms call.

A full row and a full column would fill a sparse factorisation: rows and columns are added in turn
to an LU of B, the part of J for z. Where B has no LU, and where B lacks two ranks because two
vertical curves cross, the bordered matrix is factorised as a whole, at whatever cost.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from math import prod
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Indices, Matrix, dense, power_of_two
from pwscont.linear.factor import (
    BorderedFactor,
    DenseLU,
    Factor,
    Interior,
    ScaledFactor,
    row_divisors,
    row_maxima,
)
from pwscont.linear.jacobian import SparseJacobian, SparseLU, StoredJacobian, StructuredJacobian


def bordered(jacobian: Matrix, row: Any, scale: Array) -> Factor:
    """Factorise [J; row], shape (n + 1, n + 1).

    ``scale``, shape (n + 1,): typical magnitudes of the unknowns, powers of two.
    """
    row = row if isinstance(row, np.ndarray) else dense(row).ravel()
    if isinstance(jacobian, np.ndarray):
        n = len(jacobian)
        matrix = np.empty((n + 1, n + 1), order="F")
        matrix[:n] = jacobian
        matrix[n] = row
        return factor(matrix, scale, overwrite=True)
    structured = _structured(jacobian)
    if by_parts := structured.bordered(row, scale):
        return by_parts
    if isinstance(structured, StoredJacobian):
        return factor(sp.vstack([structured.tocsc(), sp.csr_matrix(row)]), scale)
    return bordered(dense(jacobian), row, scale)


def inner(jacobian: Matrix, scale: Array) -> Factor | None:
    """Factorise B, the part of J for z, in the units of H and z; None if B has no factorisation.

    B may be nearly singular, as on vertical pieces: the caller must look at the size of solutions.
    """
    if not isinstance(jacobian, np.ndarray):
        return _structured(jacobian).inner(scale)
    own = np.multiply(jacobian, scale, order="F")  # work in place: new room costs as much
    rows = row_divisors(own)
    own /= rows[:, np.newaxis]
    return ScaledFactor(DenseLU(own[:, :-1], overwrite=True), rows, scale[:-1])


def factor(matrix: Matrix, scale: Array, *, overwrite: bool = False) -> ScaledFactor:
    """Factorise a square matrix in any units, dense or sparse, shape (k, k).

    ``overwrite``: whether a dense matrix, in Fortran order, is worked on in place.
    """
    lu: Factor
    if isinstance(matrix, np.ndarray):
        matrix = matrix if overwrite else np.array(matrix, dtype=float, order="F")
        matrix *= scale
        rows = row_divisors(matrix)
        matrix /= rows[:, np.newaxis]
        lu = DenseLU(matrix, overwrite=True, moves_pivots=False)
    else:
        scaled = matrix @ sp.diags(scale)
        rows = power_of_two(abs(scaled).max(axis=1).toarray().ravel())
        lu = SparseLU(sp.csc_matrix(sp.diags(1.0 / rows) @ scaled))
    return ScaledFactor(lu, rows, scale, is_whole=True)


@lru_cache(maxsize=8)
def last_unit(size: int) -> Array:
    """Return the unit vector (0, ..., 0, 1), shape (size,), not to be written to."""
    unit = np.zeros(size)
    unit[-1] = 1.0
    unit.flags.writeable = False
    return unit


# -- Jacobians in every storage --------------------------------------------------------------------


def columns_scaled(jacobian: Matrix, scale: Array) -> Matrix:
    """Return a new Jacobian with columns multiplied by ``scale``, an array or stored entries."""
    if isinstance(jacobian, np.ndarray):
        return jacobian * scale
    scaled = _structured(jacobian).scaled(scale)
    return scaled if isinstance(scaled, StoredJacobian) else dense(scaled)


def rows_divided(jacobian: Matrix, rows: Array) -> Matrix:
    """Return a new Jacobian, from a result of :func:`columns_scaled`, with rows divided."""
    is_dense = isinstance(jacobian, np.ndarray)
    return jacobian / rows[:, np.newaxis] if is_dense else jacobian.divided(rows)


def largest_in_rows(jacobian: Matrix) -> Array:
    """Return the largest magnitude in each row of a result of :func:`columns_scaled`."""
    is_dense = isinstance(jacobian, np.ndarray)
    return row_maxima(jacobian) if is_dense else jacobian.largest_in_rows()


def largest_in_scaled_rows(jacobian: Matrix, scale: Array) -> Array:
    """Return about the largest magnitude in each row, shape (n,), of columns times ``scale``."""
    is_dense = isinstance(jacobian, np.ndarray)
    own = None if is_dense else _structured(jacobian).largest_in_scaled_rows(scale)
    return largest_in_rows(columns_scaled(jacobian, scale)) if own is None else own


def column(jacobian: Matrix, index: int) -> Array:
    """Return a column of a Jacobian, shape (n,), in a new array."""
    if isinstance(jacobian, np.ndarray):
        return np.array(jacobian[:, index], dtype=float)
    return _structured(jacobian).column_at(index)


def kink_by_columns(before: Matrix, after: Matrix, gradient: Array, scale: Array) -> Array:
    """Return c of J' - J = c g^T (F1), shape (n,), from the Jacobians on both sides.

    The column of the unknown along which the test of gradient g changes most is compared, so that
    c is no small difference of large numbers.
    """
    steepest = int(np.abs(gradient * scale).argmax())
    return np.asarray((column(after, steepest) - column(before, steepest)) / gradient[steepest])


def balanced_columns(jacobian: Matrix) -> Array:
    """Return multipliers of the columns of [H_z, H_alpha] that balance H_z, powers of two.

    Each row is divided by the row's largest entry first; the multiplier for alpha is 1.
    """
    rows = entry_sizes(jacobian)[:, :-1]

    def largest(sizes: Matrix, axis: int) -> Array:
        found = sizes.max(axis=axis)
        found = dense(found).ravel() if sp.issparse(rows) else found
        return np.where(found > 0.0, found, 1.0)

    columns = largest(rows / largest(rows, 1)[:, np.newaxis], 0)
    return power_of_two(np.append(1.0 / columns, 1.0))


def entry_sizes(jacobian: Matrix) -> Matrix:
    """Return the magnitudes of the entries, sparse for a stored Jacobian."""
    stored = jacobian.tocsc() if isinstance(jacobian, StoredJacobian) else jacobian
    return abs(sp.csr_array(stored)) if sp.issparse(stored) else np.abs(dense(stored))


def _structured(jacobian: Matrix) -> StructuredJacobian:
    """Return a Jacobian that is no array as a Jacobian that factorises itself."""
    return jacobian if isinstance(jacobian, StructuredJacobian) else SparseJacobian(jacobian)


def augmented(jacobian: Matrix, b: Array, C: Array) -> Factor:
    """Factorise [[B, b, a], [C, 0, c]] of the unknowns z, mu and alpha, where J = [B, a].

    ``jacobian`` has entries of about 1. ``C``, shape (2, n + 1), has the rows [C, c], which are
    turned in their plane until c of the first row is zero: that border needs no column for alpha.
    """
    if size := float(np.hypot(*C[:, -1])):
        C = np.array([[C[1, -1], -C[0, -1]], C[:, -1]]) @ C / size
    n = len(b)
    if isinstance(jacobian, np.ndarray):
        whole = np.zeros((n + 2, n + 2), order="F")
        whole[:, np.arange(n + 2) != n] = np.vstack([jacobian, C])
        whole[:n, n] = b
        return factor(whole, np.ones(n + 2), overwrite=True)
    by_parts = _by_parts(jacobian, b, C)
    if not by_parts.is_singular():
        return by_parts
    rows = sp.vstack([jacobian.tocsc(), sp.csc_matrix(C)], format="csc")
    border = sp.csc_matrix(np.append(b, [0.0, 0.0])[:, np.newaxis])
    whole = sp.hstack([rows[:, :n], border, rows[:, n:]], format="csc")
    return factor(whole, np.ones(n + 2))


def _by_parts(jacobian: StoredJacobian, b: Array, C: Array) -> Factor:
    """Factorise by two borders around an LU of B, alpha in the second; return a singular part."""
    core, column = jacobian.split()
    if core.failed:
        return core
    ones = np.ones(len(b) + 2)
    inner = BorderedFactor(Interior(core, b), np.append(C[0, :-1], 0.0), ones[1:], ones[1:])
    if inner.is_singular():
        return inner
    row = np.concatenate([C[1, :-1], [0.0, C[1, -1]]])
    return BorderedFactor(Interior(inner, np.append(column, 0.0)), row, ones, ones)


#: Relative accuracy of the logarithms in lsqr: magnitudes need no more than a digit.
ACCURACY = 1e-6

#: Most entries of equations that are solved as a dense matrix.
MOST_DENSE = 10_000


def balanced(terms: Any, size: int) -> tuple[Array, Array]:
    """Return magnitudes u of unknowns and v of rows that balance equations (Curtis and Reid 1972).

    The terms ``terms[i, j] u[j] / v[i]`` are as close to 1 as possible: the sum of the squares of
    the logarithms of the terms is least. Of several answers (a row without terms, a group of
    unknowns without constants) the logarithms with the least sum of squares are taken.

    Parameters
    ----------
    terms : ndarray or sparse matrix, shape (m, size + k)
        Coefficients of ``size`` unknowns, and k columns of constants, whose magnitudes are 1.
    size : int

    Returns
    -------
    ndarray, ndarray, shapes (size,) and (m,)

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont.extending import balanced
    >>> u, v = balanced(np.array([[2.0, 0.0, 6.0], [0.0, 5.0, 5.0]]), 2)
    >>> [float(x) for x in np.round(u, 3)], [float(x) for x in np.round(v, 3)]
    ([3.0, 1.0], [6.0, 5.0])
    """
    from scipy.sparse.linalg import lsqr  # noqa: PLC0415  only where magnitudes are not given

    rows, columns, values = sp.find(terms)
    each, of_unknown = np.arange(len(rows)), columns < size
    entries = np.concatenate([np.ones(of_unknown.sum()), -np.ones(len(rows))])
    parts = (each[of_unknown], each), (columns[of_unknown], size + rows)
    at = tuple(map(np.concatenate, parts))
    logarithms, shape = -np.log(np.abs(values)), (len(rows), size + terms.shape[0])
    if prod(shape) <= MOST_DENSE:
        equations = np.zeros(shape)
        equations[at] = entries
        found = np.linalg.lstsq(equations, logarithms, rcond=None)[0]
    else:
        equations = sp.csr_array((entries, at), shape=shape)
        found = lsqr(equations, logarithms, atol=ACCURACY, btol=ACCURACY)[0]
    return np.exp(found[:size]), np.exp(found[size:])


@final
class Rows:
    """A copy of constant rows, such as the gradients of affine tests, for many products."""

    def __init__(self, matrix: Matrix) -> None:
        is_dense = isinstance(matrix, np.ndarray)
        own: Callable[..., Any] = np.array if is_dense else sp.csr_matrix
        self.matrix = own(matrix, dtype=float, copy=True)
        if not is_dense:
            self.matrix.sum_duplicates()
        #: The product with a vector, shape (m,); ``dot`` of a sparse matrix takes longer.
        self.dot: Callable[[Array], Array] = self.matrix.dot if is_dense else self.matrix.__matmul__

    @cached_property
    def magnitudes(self) -> Any:
        """The magnitudes of all entries, for products with vectors that are not negative."""
        return abs(self.matrix)

    def one(self, index: int) -> Array:
        """Return a row, dense, shape (k,), not to be written to."""
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(self.matrix[index])
        row = np.zeros(self.matrix.shape[1])
        starts = self.matrix.indptr
        entries = slice(starts.item(index), starts.item(index + 1))
        row[self.matrix.indices[entries]] = self.matrix.data[entries]
        return row

    def some(self, which: Indices) -> Array:
        """Return a few rows, dense, shape (len(which), k)."""
        if isinstance(self.matrix, np.ndarray):
            return self.matrix[which]
        return np.asarray(self.matrix[which].toarray())
