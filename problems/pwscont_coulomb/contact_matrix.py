"""dH/dz and dH/dx of bodies with many contact nodes, for :mod:`~pwscont_coulomb.coulomb`."""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np

from pwscont.extending import (
    Array,
    BorderedFactor,
    Factor,
    Indices,
    Interior,
    ScaledFactor,
    StructuredJacobian,
    power_of_two,
    row_scale,
)
from pwscont_coulomb.contact_algebra import ContactAlgebra, Displacements
from pwscont_coulomb.modes import STICKS, TOUCHES
from pwscont_coulomb.row_updates import drifted

#: Sign of the slip in each mode.
SIDES = np.array([0.0, 0.0, 1.0, -1.0])


@final
class ContactMatrix(Factor):
    """dH/dz for given modes of the nodes, shape (n + 2 p, n + 2 p).

    Parameters
    ----------
    algebra : ContactAlgebra
    mode : ndarray of int, shape (p,)
    friction : ndarray, shape (p,)
    """

    __array_ufunc__ = None

    def __init__(self, algebra: ContactAlgebra, mode: Indices, friction: Array) -> None:
        self.algebra = algebra
        self.touches = TOUCHES[mode]
        #: The tangential row of a guided node is lam_t = 0, in stick, too.
        self.sticks = STICKS[mode] & algebra.slides
        #: sF of slipping nodes, with s = 1 for slip+ and s = -1 for slip-; zero for all other
        #: nodes.
        self.slip = friction * SIDES[mode]

    @cached_property
    def displacements(self) -> Displacements:
        """M for the displacements; most matrices of a straight path are never solved with."""
        keys = np.zeros(self.algebra.n)
        keys[self.algebra.normal] = np.where(self.touches, np.inf, 0.0)
        keys[self.algebra.tangential] = np.where(self.sticks, np.inf, self.slip)
        return Displacements(self.algebra, keys)

    def dot(self, z: Array) -> Array:
        """Return the product with a vector: the terms of H that are linear in z."""
        return self._product(z, self.algebra.elastic(z[: self.algebra.n]))

    def _product(self, z: Array, force: Array) -> Array:
        """Return the product with a vector whose elastic force A u is known."""
        u, normal, tangential = self._parts(z)
        a = self.algebra
        product = np.empty_like(z)
        product[: a.n] = force
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
        product[: a.n] = a.elastic(v)
        product[a.normal] += a.r * (np.where(self.touches, normal, 0.0) + self.slip * sliding)
        product[a.tangential] += a.r * np.where(self.sticks, tangential, 0.0)
        free = np.where(self.touches, 0.0, normal)
        product[a.n : a.n + a.p] = free - v[a.normal] - self.slip * sliding
        product[a.n + a.p :] = sliding - v[a.tangential]
        return product

    def column_at(self, index: int) -> Array:
        """Return a column, at a cost proportional to the length."""
        a, unit = self.algebra, np.zeros(self.algebra.n + 2 * self.algebra.p)
        unit[index] = 1.0
        return self._product(unit, a.A[index] if index < a.n else np.zeros(a.n))

    def toarray(self) -> Array:
        """Return the matrix as a dense array."""
        a, touching, sticking = self.algebra, self.touches, self.sticks
        n, p = a.n, a.p
        normal, tangential = np.arange(n)[a.normal], np.arange(n)[a.tangential]
        forces = n + np.arange(p), n + p + np.arange(p)
        dense = np.zeros((n + 2 * p, n + 2 * p))
        dense[:n, :n] = a.A
        dense[normal, forces[0]] = dense[tangential, forces[1]] = -1.0
        dense[forces[0], normal] = np.where(touching, a.r, 0.0)
        dense[forces[0], forces[0]] = np.where(touching, 0.0, 1.0)
        dense[forces[1], tangential] = np.where(sticking, a.r, 0.0)
        dense[forces[1], forces[1]] = np.where(sticking, 0.0, 1.0)
        slip = np.where(sticking, 0.0, self.slip)
        dense[forces[1], forces[0]], dense[forces[1], normal] = -slip, slip * a.r
        return dense

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
        """Return roughly the largest entry of each row, with columns multiplied by ``scale``."""
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

    def solve_all(self, rhs: Array) -> Array:
        """Return the solutions for several right-hand sides, shape (l, n + 2 p)."""
        return self.solve(rhs)

    def _displaced(self, rhs: Array) -> tuple[Array, Array]:
        """Return u of M u = g, scaled, and A u, from which the residual follows at no cost."""
        a, M = self.algebra, self.displacements
        while True:
            x = a.solver.solve(M, rhs)
            u = a.D * x
            force = a.elastic(u)
            if not drifted(rhs, x, M.product(x, force)) or not a.solver.renew(M):
                return u, force

    def solve_transposed(self, rhs: Array) -> Array:
        """Return the solution with the transposed matrix, shape (n + 2 p,)."""
        force, normal, tangential = self._parts(rhs)
        a, unit = self.algebra, self.displacements.unit
        v = np.zeros(a.n)
        v[a.normal] = np.where(self.touches, -normal - self.slip * tangential, 0.0)
        v[a.tangential] = np.where(self.sticks, -tangential, 0.0)
        h = np.where(unit, 0.0, force - a.elastic(v))
        w = self.displacements.scale * a.solver.solve_transposed(self.displacements, a.D * h)
        w[unit] = 0.0
        v += w
        v[a.normal] -= self.slip * w[a.tangential]
        rest = force - a.elastic(v)
        excess = rest[a.normal], rest[a.tangential]
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

    is_at_hand = True

    def __init__(self, matrix: ContactMatrix, column: Array) -> None:
        self.matrix, self.column = matrix, column
        self.shape = (len(column), len(column) + 1)
        self._interior: tuple[Array, Array, Interior] | None = None

    def __matmul__(self, x: Array) -> Array:
        product: Array = self.matrix.dot(x[:-1]) + x[-1] * self.column
        return product

    def __rmatmul__(self, y: Array) -> Array:
        return np.append(self.matrix.__rmatmul__(y), self.column.dot(y))

    def __abs__(self) -> _Magnitudes:
        return _Magnitudes(self)

    def toarray(self) -> Array:
        """Return the matrix as a dense array."""
        return np.column_stack([self.matrix.toarray(), self.column])

    def bordered(self, row: Array, scale: Array) -> Factor:
        """Factorise [J; row] by the elimination of :class:`ContactAlgebra`."""
        rows, interior = self._split(scale)
        scaled = row * scale
        whole = row_scale(rows, scaled)
        whole[:-1] = rows
        return BorderedFactor(interior, scaled / whole[-1], whole, scale)

    def inner(self, scale: Array) -> Factor:
        """Return the part for z, which solves in the units of H and z."""
        return self.matrix

    def column_at(self, index: int) -> Array:
        """Return a column."""
        last = index == len(self.column)
        return self.column.copy() if last else self.matrix.column_at(index)

    def largest_in_scaled_rows(self, columns: Array) -> Array:
        """Return about the largest magnitude in each row, with columns multiplied."""
        largest = self.matrix.largest_in_rows(columns[:-1])
        return np.maximum(largest, np.abs(self.column) * columns[-1])

    def _split(self, scale: Array) -> tuple[Array, Interior]:
        """Return the divisors of the rows, and the block for z; kept for the last scale."""
        if self._interior is None or self._interior[0] is not scale:
            rows = power_of_two(self.largest_in_scaled_rows(scale))
            core = ScaledFactor(self.matrix, 1.0 / rows, 1.0 / scale[:-1])
            interior = Interior(core, self.column * scale[-1] / rows)
            self._interior = scale, rows, interior
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
