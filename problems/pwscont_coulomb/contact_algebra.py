"""Jacobians of bodies with many contact nodes, eliminated by hand.

Where N and T pick single displacements, the multipliers and the fixed displacements need no
elimination by pivots. With kappa1 and the rows of :mod:`pwscont_coulomb.coulomb`, what remains is
M u = g for the displacements, with one row for each of them,

==============  ======================  =============================
mode of node    row of u_nu             row of u_t
==============  ======================  =============================
no contact      A_nu                    A_t
stick           unit vector             unit vector
slip+           unit vector             A_t - F A_nu
slip-           unit vector             A_t + F A_nu
==============  ======================  =============================

and the rows of A for the displacements that are in no contact. All rows are A_i - k_i A_nu of
the same node, or unit vectors: the number k_i, infinite for a unit vector, says which. A node that
changes its mode changes at most two rows (docs/theory, F9), and the sign of det M is that of
det(dH/dz).

Failure modes and answers
-------------------------
- Stiffnesses of different magnitudes: M is scaled by powers of two from the diagonal of A, and
  slip rows by the friction in them; results do not depend on units.
- M is singular at folds and on vertical pieces, where the bordered matrix is not: see
  :mod:`pwscont.linear.updates` and :mod:`pwscont.linear.bordered`.
- A multiplier is the difference of elastic force and load: it carries their rounding, as the
  solution of the whole system does.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np
import scipy.sparse as sp

from pwscont.basics.arrays import Array, Indices, Matrix
from pwscont.linear.bordered import BorderedFactor, Interior, row_scale
from pwscont.linear.cores import Core
from pwscont.linear.factor import Factor, power_of_two
from pwscont.linear.structured import StructuredJacobian
from pwscont.linear.updates import RowMatrix, RowSolver, drifted
from pwscont_coulomb.modes import Mode

if TYPE_CHECKING:
    from pwscont_coulomb.body import ContactBody

#: Rows of A that are scaled at a time, so that no second matrix is stored.
CHUNK = 64
#: Below this size a number is zero beside one in the matrix of magnitudes.
SMALLEST = 1e-30


@final
class ContactAlgebra:
    """What all matrices of one body have in common.

    Parameters
    ----------
    body : ContactBody
        With a dense A and with N and T that pick single displacements.
    r : ndarray, shape (p,)
        Scale of the augmented multipliers.
    solver : RowSolver
        Solves with M.
    """

    def __init__(self, body: ContactBody, r: Array, solver: RowSolver) -> None:
        self.A, self.r, self.solver = body.A, r, solver
        self.n, self.p = body.n, body.p
        self.slides = ~body.guided
        self.normal, self.tangential = picked(body.N), picked(body.T)
        self.partner = np.arange(body.n)
        self.partner[self.tangential] = self.normal
        #: A is scaled to D A D, with a diagonal of about one.
        self.D = power_of_two(1.0 / np.sqrt(body.A.diagonal()))
        self.largest = np.array([np.abs(row).max() for row in body.A])
        self._last: ContactJacobian | None = None

    @staticmethod
    def fits(body: ContactBody) -> bool:
        """Tell whether a body has the structure that is needed."""
        return not body.is_sparse and all(_picks(rows) for rows in (body.N, body.T))

    def jacobian(self, matrix: ContactMatrix, column: Array) -> ContactJacobian:
        """Return [dH/dz | column]; the last is remembered, with what it has solved.

        Here, not by the matrix: two objects that hold each other wait long to be freed.
        """
        last = self._last
        if last is None or last.matrix is not matrix or not np.array_equal(last.column, column):
            self._last = last = ContactJacobian(matrix, column)
        return last

    @cached_property
    def magnitudes(self) -> Array:
        """|D A D| in single precision, for estimates of errors; shape (n, n)."""
        magnitudes = np.empty(self.A.shape, dtype=np.float32)
        for first in range(0, self.n, CHUNK):
            which = slice(first, first + CHUNK)
            scaled = np.abs(self.A[which]) * self.D * self.D[which, np.newaxis]
            scaled[scaled < SMALLEST] = 0.0
            magnitudes[which] = scaled
        return magnitudes

    def elastic_magnitudes(self, u: Array) -> Array:
        """Return |A| u for u >= 0, to single precision."""
        scaled = u / self.D
        largest = float(scaled.max()) or 1.0
        product: Array = self.magnitudes @ (scaled / largest).astype(np.float32)
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
        """Return what slip rows are multiplied by, for entries of about one; shape (n,)."""
        size = np.where(np.isinf(keys), 0.0, np.abs(keys)) * self.D / self.D[self.partner]
        return 1.0 / power_of_two(np.maximum(0.5, size))


@final
class Displacements(RowMatrix):
    """M, scaled, for the modes that ``keys`` stand for; see the module."""

    def __init__(self, algebra: ContactAlgebra, keys: Array) -> None:
        self._algebra, self.keys = algebra, keys
        self.unit = np.isinf(keys)
        self._key = np.where(self.unit, 0.0, keys)
        #: Right-hand sides are multiplied by this.
        self.scale = np.where(self.unit, 1.0 / algebra.D, algebra.D * algebra.weights(keys))

    def rows(self, which: Indices) -> Array:
        """Return some rows, shape (k, n)."""
        return self._algebra.rows(self.keys, which)

    def dense(self) -> Array:
        """Return the whole matrix in Fortran order."""
        n = self._algebra.n
        matrix = np.empty((n, n), order="F")
        for first in range(0, n, CHUNK):
            which = np.arange(first, min(first + CHUNK, n))
            matrix[first : first + CHUNK] = self.rows(which)
        return matrix

    def product(self, x: Array, force: Array) -> Array:
        """Return M x for x and A D x, shape (..., n)."""
        product = self.scale * (force - self._key * force[..., self._algebra.partner])
        return np.where(self.unit, x, product)


@final
class ContactMatrix:
    """dH/dz for one mode of every node, shape (n + 2 p, n + 2 p).

    Parameters
    ----------
    algebra : ContactAlgebra
    mode : ndarray of int, shape (p,)
    friction : ndarray, shape (p,)
    """

    __array_ufunc__ = None

    def __init__(self, algebra: ContactAlgebra, mode: Indices, friction: Array) -> None:
        self.algebra = algebra
        self.touches = mode != Mode.NO_CONTACT
        #: A guided node has no tangential row but lam_t = 0.
        self.sticks = (mode == Mode.STICK) & algebra.slides
        #: sF of slipping nodes, with s = 1 for slip+; zero for the others.
        self.slip = friction * np.where(self.touches & ~self.sticks, 1.0, 0.0)
        self.slip = np.where(mode == Mode.SLIP_MINUS, -self.slip, self.slip)
        keys = np.zeros(algebra.n)
        keys[algebra.normal[self.touches]] = np.inf
        keys[algebra.tangential] = np.where(self.sticks, np.inf, self.slip)
        self.displacements = Displacements(algebra, keys)

    def __matmul__(self, z: Array) -> Array:
        """Return the product with a vector: the terms of H that are linear in z."""
        u, normal, tangential = self._parts(z)
        a = self.algebra
        product = np.empty_like(z)
        product[: a.n] = a.A @ u
        product[a.normal] -= normal
        product[a.tangential] -= tangential
        push = a.r * u[a.normal]
        product[a.n : a.n + a.p] = np.where(self.touches, push, normal)
        sliding = tangential - self.slip * (normal - push)
        product[a.n + a.p :] = np.where(self.sticks, a.r * u[a.tangential], sliding)
        return product

    def __rmatmul__(self, y: Array) -> Array:
        """Return the product of a row with the matrix."""
        v, normal, tangential = self._parts(y)
        a = self.algebra
        sliding = np.where(self.sticks, 0.0, tangential)
        product = np.empty_like(y)
        product[: a.n] = a.A @ v
        product[a.normal] += a.r * (np.where(self.touches, normal, 0.0) + self.slip * sliding)
        product[a.tangential] += a.r * np.where(self.sticks, tangential, 0.0)
        free = np.where(self.touches, 0.0, normal)
        product[a.n : a.n + a.p] = free - v[a.normal] - self.slip * sliding
        product[a.n + a.p :] = sliding - v[a.tangential]
        return product

    def magnitudes(self, z: Array) -> Array:
        """Return the product of the magnitudes of the entries with z >= 0."""
        u, normal, tangential = self._parts(z)
        a = self.algebra
        product = np.empty_like(z)
        product[: a.n] = a.elastic_magnitudes(u)
        product[a.normal] += normal
        product[a.tangential] += tangential
        push = a.r * u[a.normal]
        product[a.n : a.n + a.p] = np.where(self.touches, push, normal)
        sliding = tangential + np.abs(self.slip) * (normal + push)
        product[a.n + a.p :] = np.where(self.sticks, a.r * u[a.tangential], sliding)
        return product

    def largest_in_rows(self, scale: Array) -> Array:
        """Return about the largest magnitude in each row with columns multiplied by ``scale``."""
        u, normal, tangential = self._parts(scale)
        a = self.algebra
        largest = np.empty_like(scale)
        largest[: a.n] = a.largest * u.max()
        largest[a.normal] = np.maximum(largest[a.normal], normal)
        largest[a.tangential] = np.maximum(largest[a.tangential], tangential)
        push = a.r * u[a.normal]
        largest[a.n : a.n + a.p] = np.where(self.touches, push, normal)
        bound = np.abs(self.slip) * np.maximum(normal, push)
        sliding = np.maximum(tangential, bound)
        largest[a.n + a.p :] = np.where(self.sticks, a.r * u[a.tangential], sliding)
        return largest

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return self.algebra.solver.sign(self.displacements)

    def solve(self, rhs: Array) -> Array:
        """Return the solution for right-hand sides, shape (..., n + 2 p)."""
        force, normal, tangential = self._parts(rhs)
        a = self.algebra
        load = force[..., a.normal] + normal
        g = force.copy()
        g[..., a.normal] = np.where(self.touches, normal / a.r, load)
        sliding = tangential + force[..., a.tangential] - self.slip * load
        g[..., a.tangential] = np.where(self.sticks, tangential / a.r, sliding)
        u, elastic = self._displaced(self.displacements.scale * g)
        excess = elastic - force
        solution = np.empty_like(rhs)
        found, pressure, shear = self._parts(solution)
        found[...] = u
        pressure[...] = np.where(self.touches, excess[..., a.normal], normal)
        sliding = tangential + self.slip * (pressure - normal)
        shear[...] = np.where(self.sticks, excess[..., a.tangential], sliding)
        return solution

    def _displaced(self, rhs: Array) -> tuple[Array, Array]:
        """Return u of M u = g, scaled, and A u, which tells the residual at no cost."""
        a, M = self.algebra, self.displacements
        while True:
            x = a.solver.solve(M, rhs)
            u = a.D * x
            force = u @ a.A  # A is symmetric
            if not drifted(rhs, x, M.product(x, force)) or not a.solver.renew(M):
                return u, force

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix, shape (n + 2 p,)."""
        force, normal, tangential = self._parts(rhs)
        a, unit = self.algebra, self.displacements.unit
        v = np.zeros(a.n)
        v[a.normal] = np.where(self.touches, -normal - self.slip * tangential, 0.0)
        v[a.tangential] = np.where(self.sticks, -tangential, 0.0)
        h = np.where(unit, 0.0, force - a.A @ v)
        w = self.displacements.scale * a.solver.solve_transposed(self.displacements, a.D * h)
        w[unit] = 0.0
        v += w
        v[a.normal] -= self.slip * w[a.tangential]
        excess = (force - a.A @ v)[a.normal], (force - a.A @ v)[a.tangential]
        solution = np.empty_like(rhs)
        solution[: a.n] = v
        sliding = tangential + v[a.tangential]
        shear = np.where(self.sticks, excess[1] / a.r, sliding)
        solution[a.n + a.p :] = shear
        push = excess[0] / a.r - self.slip * shear
        solution[a.n : a.n + a.p] = np.where(self.touches, push, normal + v[a.normal])
        return solution

    def _parts(self, z: Array) -> tuple[Array, Array, Array]:
        """Return the parts of a vector that belong to u, lam_nu and lam_t."""
        n, p = self.algebra.n, self.algebra.p
        return z[..., :n], z[..., n : n + p], z[..., n + p :]


@final
class ContactJacobian(StructuredJacobian):
    """dH/d(z, alpha): a :class:`ContactMatrix` and the column for alpha."""

    def __init__(self, matrix: ContactMatrix, column: Array) -> None:
        self.matrix, self.column = matrix, column
        self.shape = (len(column), len(column) + 1)
        self._interior: tuple[Array, Array, Interior] | None = None

    def __matmul__(self, x: Array) -> Array:
        product: Array = self.matrix @ x[:-1] + x[-1] * self.column
        return product

    def __rmatmul__(self, y: Array) -> Array:
        return np.append(self.matrix.__rmatmul__(y), self.column.dot(y))

    def __abs__(self) -> _Magnitudes:
        return _Magnitudes(self)

    def toarray(self) -> Array:
        """Return the same matrix as a dense one, column by column."""
        size = len(self.column)
        columns = [self.matrix @ unit for unit in np.eye(size)]
        return np.column_stack([*columns, self.column])

    def bordered(self, row: Array, scale: Array) -> Factor:
        """Factorise [J; row] by the elimination of the module."""
        rows, interior = self._split(scale)
        scaled = row * scale
        whole = row_scale(rows, scaled)
        whole[:-1] = rows
        return BorderedFactor(interior, scaled / whole[-1], whole, scale)

    def _split(self, scale: Array) -> tuple[Array, Interior]:
        """Return what the rows are divided by, and the part for z; remembered for one scale."""
        if self._interior is None or self._interior[0] is not scale:
            largest = self.matrix.largest_in_rows(scale[:-1])
            rows = power_of_two(np.maximum(largest, np.abs(self.column) * scale[-1]))
            core = _ScaledCore(self.matrix, rows, scale[:-1])
            self._interior = scale, rows, Interior.at_once(core, self.column * scale[-1] / rows)
        return self._interior[1], self._interior[2]


@final
class _Magnitudes:
    """|J|, for products with vectors that are not negative."""

    def __init__(self, jacobian: ContactJacobian) -> None:
        self._jacobian = jacobian

    def __matmul__(self, x: Array) -> Array:
        jacobian = self._jacobian
        product: Array = jacobian.matrix.magnitudes(x[:-1]) + x[-1] * np.abs(jacobian.column)
        return product


@final
class _ScaledCore(Core):
    """Solves with the matrix whose rows are divided and columns multiplied."""

    def __init__(self, matrix: ContactMatrix, rows: Array, columns: Array) -> None:
        self._matrix, self._rows, self._columns = matrix, rows, columns

    @property
    def sign(self) -> int:
        """Sign of the determinant."""
        return self._matrix.sign

    def solve(self, rhs: Array) -> Array:
        """Return the solution for one right-hand side."""
        return self._matrix.solve(rhs * self._rows) / self._columns

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n + 2 p)."""
        return self.solve(rhs)

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix."""
        return self._rows * self._matrix.solve_transposed(rhs / self._columns)


def _picks(rows: Matrix) -> bool:
    """Tell whether every row is a unit vector."""
    sparse = sp.csr_matrix(rows)
    return bool((np.diff(sparse.indptr) == 1).all() and (sparse.data == 1.0).all())


def picked(rows: Any) -> Indices:
    """Return the displacement that each row picks, shape (p,)."""
    return np.asarray(sp.csr_matrix(rows).indices, dtype=np.intp)
