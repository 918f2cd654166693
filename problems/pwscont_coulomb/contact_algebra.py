"""Jacobians of bodies with many contact nodes, eliminated by hand.

If N and T pick single displacements, the multipliers and the fixed displacements need no
elimination by pivots. With kappa1 and the rows of :mod:`pwscont_coulomb.coulomb`, the rest is the
system M u = g for the displacements. The rows of M for the displacements of a contact node are

==============  ======================  =============================
mode of node    row of u_nu             row of u_t
==============  ======================  =============================
no contact      A_nu                    A_t
stick           unit vector             unit vector
slip+           unit vector             A_t - F A_nu
slip-           unit vector             A_t + F A_nu
==============  ======================  =============================

All other rows of M are rows of A. Each row i is A_i - k_i A_nu, with A_nu
of the same node, or a unit vector. The key of a row is k_i, or infinity for a unit vector. A node
that changes mode changes at most two rows (docs/theory, F9), and det M and det(dH/dz) have the same
sign.

Failure modes and answers
-------------------------
- Stiffnesses of different magnitudes: M is scaled by powers of two from the diagonal of A, and
  slip rows by the friction; results do not depend on units.
- M is singular at folds and on vertical pieces, where the bordered matrix is not: see
  :mod:`~pwscont_coulomb.row_updates` and :mod:`pwscont.linear.factor`.
- A multiplier is the difference of elastic force and load, with the rounding errors of the two, as
  in the solution of the whole system.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas

from pwscont.extending import Array, Indices, Matrix, power_of_two
from pwscont_coulomb.row_updates import Updating

if TYPE_CHECKING:
    from pwscont_coulomb.body import ContactBody

#: Smallest entry of the matrix of magnitudes, without unit: smaller numbers count as zero.
SMALLEST = 1e-30


@final
class ContactAlgebra:
    """The elimination shared by all matrices of a body.

    Parameters
    ----------
    body : ContactBody
        With a dense A and with N and T that pick single displacements.
    r : ndarray, shape (p,)
        Scale of the augmented multipliers.
    solver : Updating
        Solves with M.
    """

    def __init__(self, body: ContactBody, r: Array, solver: Updating) -> None:
        self.A, self.r, self.solver = body.A, r, solver
        self.n, self.p = body.n, body.p
        self.slides = ~body.guided
        normal, tangential = picked(body.N), picked(body.T)
        self.partner = np.arange(body.n)
        self.partner[tangential] = normal
        self.normal, self.tangential = _span(normal), _span(tangential)
        #: A is scaled to D A D, with a diagonal of about 1.
        self.D = power_of_two(1.0 / np.sqrt(body.A.diagonal()))
        self.largest = np.array([np.abs(row).max() for row in body.A])
        #: A row by row, and column by column for BLAS: the same array, for A is symmetric.
        self.by_rows = body.A.T if body.A.flags.f_contiguous else np.ascontiguousarray(body.A)
        self._columns = self.by_rows.T

    @staticmethod
    def fits(body: ContactBody) -> bool:
        """Tell whether a body has a dense A, and N and T that pick single displacements."""
        return not body.is_sparse and all(_picks(rows) for rows in (body.N, body.T))

    @cached_property
    def magnitudes(self) -> Array:
        """The lower part of |D A D|, column by column, in single precision, for error estimates."""
        parts = []
        for j, column in enumerate(self.by_rows):  # A is symmetric
            scaled = np.abs(column[j:]) * self.D[j:] * self.D[j]
            scaled[scaled < SMALLEST] = 0.0
            parts.append(scaled.astype(np.float32))
        return np.concatenate(parts)

    def elastic(self, u: Array) -> Array:
        """Return A u, shape (..., n), for which half of A is read."""
        if u.ndim > 1:
            return np.stack([self.elastic(one) for one in u])
        force: Array = blas.dsymv(1.0, self._columns, u)
        return force

    def push(self, z: Array) -> Array:
        """Return lam_nu - r u_nu of all nodes, shape (p,)."""
        push: Array = z[self.n : self.n + self.p] - self.r * z[self.normal]
        return push

    def shear(self, z: Array) -> Array:
        """Return lam_t - r u_t of all nodes, zero at guided nodes, shape (p,)."""
        shear: Array = self.slides * (z[self.n + self.p :] - self.r * z[self.tangential])
        return shear

    def elastic_magnitudes(self, u: Array) -> Array:
        """Return |A| u for u >= 0, to single precision."""
        scaled = u / self.D
        largest = float(scaled.max()) or 1.0
        single = (scaled / largest).astype(np.float32)
        product: Array = blas.sspmv(self.n, 1.0, self.magnitudes, single, lower=1)
        scaled_back: Array = product * (largest / self.D)
        return scaled_back

    def rows(self, keys: Array, which: Indices) -> Array:
        """Return rows of the scaled M, shape (k, n)."""
        key, scale = keys[which], self.D[which] * self.weights(keys)[which]
        rows = np.zeros((len(which), self.n))
        unit = np.isinf(key)
        elastic = which[~unit]
        rows[~unit] = self.A[elastic]
        slips = np.flatnonzero(~unit & (key != 0.0))
        rows[slips] -= key[slips, np.newaxis] * self.A[self.partner[which[slips]]]
        rows *= self.D
        rows *= scale[:, np.newaxis]
        rows[unit] = 0.0
        rows[np.flatnonzero(unit), which[unit]] = 1.0
        return rows

    def weights(self, keys: Array) -> Array:
        """Return factors that bring the entries of slip rows to about 1, shape (n,)."""
        size = np.where(np.isinf(keys), 0.0, np.abs(keys)) * self.D / self.D[self.partner]
        return 1.0 / power_of_two(np.maximum(0.5, size))


@final
class Displacements:
    """The scaled matrix M with rows of given keys; see the module."""

    def __init__(self, algebra: ContactAlgebra, keys: Array) -> None:
        self._algebra, self.keys = algebra, keys
        self.unit = np.isinf(keys)
        self._key = np.where(self.unit, 0.0, keys)
        #: The factor of each row of a right-hand side.
        self.scale = np.where(self.unit, 1.0 / algebra.D, algebra.D * algebra.weights(keys))

    def rows(self, which: Indices) -> Array:
        """Return some rows, shape (k, n)."""
        return self._algebra.rows(self.keys, which)

    def dense(self) -> Array:
        """Return the whole matrix in Fortran order."""
        a = self._algebra
        # A is symmetric, and each row of the matrix a column of the transpose
        columns = a.by_rows * a.D[:, np.newaxis]
        columns[:, a.tangential] -= self._key[a.tangential] * columns[:, a.normal]
        columns *= np.where(self.unit, 0.0, a.D * a.weights(self.keys))
        columns[self.unit, self.unit] = 1.0
        return columns.T

    def product(self, x: Array, force: Array) -> Array:
        """Return M x for x and A D x, shape (..., n)."""
        a, product = self._algebra, force.copy()
        product[..., a.tangential] -= self._key[a.tangential] * force[..., a.normal]
        product *= self.scale
        return np.where(self.unit, x, product)


def _picks(rows: Matrix) -> bool:
    """Tell whether every row is a unit vector."""
    sparse = sp.csr_matrix(rows)
    return bool((np.diff(sparse.indptr) == 1).all() and (sparse.data == 1.0).all())


def picked(rows: Any) -> Indices:
    """Return the displacement that each row picks, shape (p,)."""
    return np.asarray(sp.csr_matrix(rows).indices, dtype=np.intp)


def _span(numbers: Indices) -> Indices | slice:
    """Return numbers that rise in equal steps as a slice, so that numpy makes no copy."""
    first, last = (int(numbers[0]), int(numbers[-1])) if len(numbers) else (0, -1)
    step = int(numbers[1]) - first if len(numbers) > 1 else 1
    rises = step > 0 and np.array_equal(numbers, np.arange(first, last + 1, step))
    return slice(first, last + 1, step) if rises else numbers
