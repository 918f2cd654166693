"""The equations of static contact with Coulomb friction; the parameter is load or friction.

z = (u, lam_nu, lam_t), and per node, with the notation of :mod:`pwscont_coulomb.modes`:

=============  ====================  =========================
mode           normal row            tangential row
=============  ====================  =========================
no contact     lam_nu                lam_t
stick          r (u_nu - gap)        r u_t
slip+          r (u_nu - gap)        lam_t - F kappa1
slip-          r (u_nu - gap)        lam_t + F kappa1
=============  ====================  =========================

after the rows A u - f - N^T lam_nu - T^T lam_t of equilibrium (paper, equations 4 to 7). All
rows are forces.

A guided node (:class:`~pwscont_coulomb.ContactBody`) is in no contact or in stick, with the
tangential row lam_t in each mode; kappa1 alone bounds the modes, and kappa2 = 1 and kappa3 = -1 are
constant.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont import Block, Character, SlicewiseLinearSystem
from pwscont.extending import (
    Array,
    BringsSearches,
    DecidesCorners,
    ExactData,
    ExactMode,
    Indices,
    Matrix,
    Reducible,
    Reduction,
    counted,
)
from pwscont_coulomb import modes as contact
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.condensed import is_worth_condensing
from pwscont_coulomb.contact_algebra import ContactAlgebra
from pwscont_coulomb.contact_matrix import ContactJacobian, ContactMatrix
from pwscont_coulomb.exact import exact_rows
from pwscont_coulomb.far_nodes import without_far_nodes
from pwscont_coulomb.fixed import Fixed, protected
from pwscont_coulomb.interior import without_interior
from pwscont_coulomb.kept import Kept
from pwscont_coulomb.modes import SIGNS
from pwscont_coulomb.names import names
from pwscont_coulomb.necessary import necessary
from pwscont_coulomb.per_node import positive
from pwscont_coulomb.row_updates import Updating
from pwscont_coulomb.rows import (
    DenseGradients,
    SparseGradients,
    by_node,
    rows_of_tests,
)
from pwscont_coulomb.states import IN_CONTACT, SLIPS, DenseStates, SparseStates, States

#: Most cells whose modes and bounding tests are kept; about the most signs of all kept cells.
MOST_CELLS, MOST_SIGNS = 128, 12000
MODES = tuple(SIGNS.values())
GUIDED_MODES = (SIGNS[contact.Mode.NO_CONTACT], SIGNS[contact.Mode.STICK])

#: Least number of contact nodes for which elimination by hand is faster than a general LU.
MANY_NODES = 32


class Coulomb(Fixed, SlicewiseLinearSystem, Reducible, BringsSearches, DecidesCorners, ExactData):
    """Static contact with Coulomb friction; subclasses say what the parameter is.

    Parameters
    ----------
    body : ContactBody
    r : float or array_like, shape (p,), optional
        Scale of the augmented multipliers (force per length), positive. Default: the stiffness
        of each node, so that results do not depend on units.
    """

    _given = frozenset({"body", "r", "load", "friction", "force", "profile"})
    #: Nodes with F = 0 at every parameter value, shape (p,).
    _without_friction: contact.Flags
    #: Solutions with positive determinant less solutions with negative determinant, for every f and
    #: every F >= 0 if the body is clamped.
    degree: int | None = 1
    line_styles = contact.LINE_STYLES

    def __init__(self, body: ContactBody, r: Any = None) -> None:
        self.body = body
        self.size = body.n + 2 * body.p
        self.r = positive("r", body.stiffness if r is None else r, body.p)
        self._offset = self.r * body.gap
        self._inside = np.where(body.guided, 1.0, 0.0)
        self._has_gap = bool(body.gap.any())
        if not body.is_clamped:  # the body may lift off, and no solution be left
            self.degree = None
        many = body.p >= MANY_NODES and body.is_clamped and ContactAlgebra.fits(body)
        #: How dH/dz is factorised where there are many contact nodes; None for a general LU.
        self.algebra = ContactAlgebra(body, self.r, Updating()) if many else None
        self._kappa1_rows, self._x_rows = rows_of_tests(body, self.r, self._has_sparse_tests)
        self._known: tuple[tuple[bytes, bytes], Matrix] | None = None
        most = min(MOST_CELLS, 1 + MOST_SIGNS // (3 * body.p))
        self._modes: Kept[Character, Indices] = Kept(most)
        self._bounding: Kept[Character, Indices] = Kept(most)
        self._jacobian: ContactJacobian | None = None
        self._scale: tuple[tuple[float, float], Array] | None = None

    @cached_property
    def _states(self) -> States:
        kind = SparseStates if self.body.is_sparse else DenseStates
        return kind(self.body, self._kappa1_rows, self._x_rows)

    @cached_property
    def _gradients(self) -> SparseGradients | DenseGradients:
        kind = SparseGradients if self._has_sparse_tests else DenseGradients
        return kind(self._kappa1_rows, self._x_rows)

    @property
    def _has_sparse_tests(self) -> bool:
        return self.body.is_sparse or self.algebra is not None

    @abstractmethod
    def load_at(self, alpha: float) -> Array:
        """Return f, shape (n,)."""

    @abstractmethod
    def friction_at(self, alpha: float) -> Array:
        """Return F per node, shape (p,)."""

    @abstractmethod
    def along_friction(self, alpha: float) -> Coulomb:
        """Return the problem at given alpha whose parameter scales all friction, from 0 up to 1."""

    @abstractmethod
    def condensed_on(self, small: ContactBody, kept: Indices) -> Coulomb:
        """Return the same problem on the body condensed onto some of its contact nodes."""

    @abstractmethod
    def with_nodes(self, kept: Indices) -> Coulomb:
        """Return the problem with only some contact nodes."""

    def exact_rows(self, alpha: float) -> tuple[Array, list[list[ExactMode]]]:
        """Return equilibrium, and the equations and inequalities of every mode of every node.

        A, N, T, gap, and f and F at alpha, count as exact.
        """
        load = self.load_at(alpha)
        return exact_rows(self.body, load, np.zeros_like(load), self.friction_at(alpha))

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return (kappa1, kappa2, kappa3) of node 1, of node 2, ..., shape (3 p,)."""
        kappa1, x = self.kappa1(z), self._shear(z)
        bound = self.friction_at(alpha) * kappa1
        return by_node(kappa1, x - bound + self._inside, x + bound - self._inside)

    def kappa1(self, z: Array) -> Array:
        """Return lam_nu - r (u_nu - gap), shape (p,)."""
        a = self.algebra
        kappa1: Array = a.push(z) if a is not None else self._kappa1_rows @ z
        return kappa1 + self._offset

    def _shear(self, z: Array) -> Array:
        """Return x = lam_t - r u_t, zero at guided nodes, shape (p,)."""
        a = self.algebra
        x: Array = a.shear(z) if a is not None else self._x_rows @ z
        return x

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows of the module's table, shape (n + 2 p,)."""
        residual: Array = self._linear_terms(z, alpha, character)
        equilibrium = residual[: self.body.n]
        equilibrium -= self.load_at(alpha)
        if self._has_gap:
            mode, friction = self.modes(character), self.friction_at(alpha)
            normal, tangential = residual[self.body.n :].reshape(2, -1)
            normal -= IN_CONTACT[mode] * self._offset
            tangential += friction * SLIPS[mode] * self._offset
        return residual

    def _linear_terms(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the terms of H that are linear in z, in a new array."""
        terms: Array = self._matrix_at(character, alpha).dot(z)
        return terms

    def _matrix_at(self, character: Character, alpha: float) -> Matrix:
        """Return dH/dz in a cell, not to be written to."""
        return self.state_matrix(self.modes(character), self.friction_at(alpha))

    def modes(self, character: Character) -> Indices:
        """Return the mode of each node, shape (p,), not to be written to."""
        return self._modes.of(character, contact.modes)

    def bounding_tests(self, character: Character) -> Indices:
        """Return the tests that bound the modes of all nodes.

        Bounding tests are kappa1 for no contact, kappa2 and kappa3 for stick, kappa1 and kappa2 for
        slip+, kappa1 and kappa3 for slip-. If F > 0, kappa2 >= 0 >= kappa3 implies kappa1 <= 0.
        Without friction kappa1 bounds stick, too: otherwise points with tension would count as
        solutions.
        """
        return self._bounding.of(character, self._bounds)

    def _bounds(self, character: Character) -> Indices:
        mode = self.modes(character)
        is_bound = contact.bounds(mode, self._without_friction, self.body.guided)
        return protected(is_bound.nonzero()[0])

    def cells(self) -> Iterator[Character]:
        """Yield the characters of all combinations of modes: 4^p if no node is guided."""
        for combination in product(*self._modes_of_nodes()):
            yield Character(tuple(sign for signs in combination for sign in signs))

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each contact node: four modes, or two if guided."""
        return self._blocks

    @cached_property
    def _blocks(self) -> tuple[Block, ...]:
        n, p = self.body.n, self.body.p
        return tuple(
            Block((3 * i, 3 * i + 1, 3 * i + 2), (n + i, n + p + i), modes)
            for i, modes in enumerate(self._modes_of_nodes())
        )

    def _modes_of_nodes(self) -> list[tuple[tuple[bool, ...], ...]]:
        """Return the signs of the modes that each node may be in."""
        return [GUIDED_MODES if guided else MODES for guided in self.body.guided]

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return lam_nu <= 0, u_nu <= gap and |lam_t| <= F |lam_nu| for all nodes."""
        return necessary(self.body, self.friction_at(alpha))

    def describe(self, character: Character) -> str:
        """Return mode and character triple of each node: ``node 1 slip- (1, 1, 0), ...``.

        The triples are the paper's, (kappa1 <= 0, kappa2 >= 0, kappa3 <= 0); without contact
        the last two depend on the point, see :meth:`triples`.
        """
        return contact.describe(character)

    def label(self, character: Character) -> str:
        """Return the contact mode of each node: ``node 1 slip-, node 2 stick``."""
        return contact.label(character)

    def triples(self, z: Array, alpha: float) -> list[tuple[int, int, int]]:
        """Return the paper's character triple of each node at a point (section 3.1)."""
        n, p = self.body.n, self.body.p
        lam_nu, x = z[n : n + p], self._shear(z)
        bound = self.friction_at(alpha) * lam_nu
        signs = zip(self.kappa1(z) <= 0.0, x - bound >= 0.0, x + bound <= 0.0, strict=True)
        return [(int(a), int(b), int(c)) for a, b, c in signs]

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return the paper's message, such as ``contact-slip → contact-stick``."""
        return contact.describe_change(before, after)

    def __repr__(self) -> str:
        nodes, tests = counted(self.body.p, "contact node"), counted(3 * self.body.p, "test")
        return f"{type(self).__name__}({counted(self.size, 'unknown')}, {tests}, {nodes})"

    def names(self) -> tuple[str, ...]:
        """Return u[i] (or u_nu and u_t where N and T pick single unknowns) and multipliers."""
        return self._names

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return names(self.body)

    def test_name(self, test: int) -> str:
        """Return a name such as ``kappa2 of node 3``."""
        return f"kappa{test % 3 + 1} of node {self.body.numbers[test // 3]}"

    def reduction(self, lo: float, hi: float) -> Reduction | None:
        """Leave out contact nodes that cannot reach the obstacle, and the interior of large bodies.

        Nodes are left out by an energy bound; the interior is eliminated where that saves time.
        """
        if not self.body.is_clamped:
            return None
        loads = self._extreme_loads(lo, hi) if self._has_gap else None
        near = None if loads is None else without_far_nodes(self.body, loads, self.with_nodes)
        if not is_worth_condensing(self.body.n, self.body.p):
            return near
        every = np.arange(self.body.p) if near is None else near.tests[::3] // 3
        ends = None if self._extreme_loads(lo, hi) is None else (lo, hi)
        found = without_interior(self.body, every, self.load_at, self.condensed_on, ends)
        return found if near is None else replace(found, reasons=near.reasons + found.reasons)

    def _extreme_loads(self, lo: float, hi: float) -> Array | None:
        """Return loads, shape (n, k), whose convex hull holds all loads, None if unknown."""
        return None

    def has_one_ray(self, z: Array, alpha: float, zero: frozenset[int]) -> bool:
        """Tell whether rates are unique at a corner (docs/theory, F17)."""
        if not self.body.is_clamped:
            return False
        from pwscont_coulomb.corner_rates import has_one_ray  # noqa: PLC0415  at few corners

        modes = self.modes(self.character(z, alpha))
        return has_one_ray(self.body, self.friction_at(alpha), modes, zero)

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical displacements and forces over the interval.

        Displacements have the size of displacements without contact: a soft direction may allow far
        larger displacements than force by stiffness.
        """
        if self._scale is None or self._scale[0] != (lo, hi):
            loads = np.column_stack([self.load_at(alpha) for alpha in np.linspace(lo, hi, 9)])
            k, gap = float(self.body.stiffness.max()), float(self.body.gap.max())
            force = max(float(np.abs(loads).max()), k * gap) or 1.0
            length = max(float(np.abs(self.body.solve(loads)).max()), gap) or force / k
            scale = np.repeat([length, force], [self.body.n, 2 * self.body.p])
            self._scale = ((lo, hi), protected(scale))
        return self._scale[1]

    def state_matrix(self, mode: Indices, friction: Array) -> Matrix:
        """Return dH/dz, shape (n + 2 p, n + 2 p), not to be written to; the last matrix is kept.

        The normal row of a node is the gradient of lam_nu, in contact of lam_nu - kappa1. The
        tangential row is the gradient of lam_t, in stick of lam_t - x, in slip+ and slip- of
        lam_t - F kappa1 and lam_t + F kappa1.
        """
        key, last = (mode.tobytes(), friction.tobytes()), self._known
        if last is None or last[0] != key:
            self._known = last = key, self._state_matrix(mode, friction)
        return last[1]

    def _state_matrix(self, mode: Indices, friction: Array) -> Matrix:
        if self.algebra is not None:
            return ContactMatrix(self.algebra, mode, friction)
        return self._states.at(mode, friction)

    def with_alpha_column(self, matrix: Matrix, column: Array) -> Matrix:
        """Return [matrix | column], dense, sparse or structured as the matrix is."""
        if type(matrix) is np.ndarray:
            jacobian = np.empty((self.size, self.size + 1))
            jacobian[:, :-1], jacobian[:, -1] = matrix, column
            return jacobian
        if isinstance(matrix, ContactMatrix):
            return self._contact_jacobian(matrix, column)
        return sp.hstack([matrix, sp.csr_matrix(column[:, np.newaxis])]).tocsr()

    def _contact_jacobian(self, matrix: ContactMatrix, column: Array) -> ContactJacobian:
        """Return [dH/dz | column]; the last Jacobian is kept, with all factorisations.

        The system keeps the Jacobian, not the matrix: two objects that refer to each other are
        freed late.
        """
        last = self._jacobian
        if last is None or last.matrix is not matrix or not np.array_equal(last.column, column):
            self._jacobian = last = ContactJacobian(matrix, column)
        return last
