"""The load as parameter: follow equilibria along a load path (paper, Problem 1)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import isfinite
from typing import Any, TypeAlias, final

import numpy as np
from scipy.linalg.blas import dasum

from pwscont import Character, InvalidInputError, PiecewiseLinearSystem, Search
from pwscont.extending import Array, ExactMode, Indices, Matrix, checked_kind
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.coulomb import MOST_CELLS, Coulomb
from pwscont_coulomb.exact import exact_rows
from pwscont_coulomb.fixed import protected
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.frictionless import FromFrictionless
from pwscont_coulomb.kept import Kept
from pwscont_coulomb.load_paths import AffineLoad
from pwscont_coulomb.modes import mode_of
from pwscont_coulomb.per_node import not_negative
from pwscont_coulomb.states import HELD, IN_CONTACT, SLIPS

#: The constant parts of a cell: dH/dz, and [dH/dz | 0] if dH/dz is dense.
Constant: TypeAlias = tuple[Matrix, Array | None]
#: Most unknowns of a body for which the matrices of many cells are kept, to bound memory.
FEW_UNKNOWNS = 16


class CoulombLoad(Coulomb):
    """Coulomb friction with a load path; the parameter alpha moves along the path.

    Parameters
    ----------
    body : ContactBody
    load : callable or AffineLoad
        alpha -> f(alpha), shape (n,), smooth: a kink of the path must be announced by a test
        function, which needs another system. With an AffineLoad every piece is straight and the
        system is a :class:`~pwscont.PiecewiseLinearSystem`. A method ``derivative(alpha)`` of the
        load gives df/dalpha; without ``derivative`` differences are taken, in steps that fit and
        stay in the interval.
    friction : float or array_like, shape (p,)
        Friction coefficient F >= 0, for all nodes or per node.
    r : float or array_like, shape (p,), optional
        As for :class:`~pwscont_coulomb.coulomb.Coulomb`.

    Raises
    ------
    InvalidInputError
        If the friction is negative or the load has the wrong shape.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> system = CoulombLoad(body, AffineLoad([0.25, 0], [0, 1]), 4.0)
    >>> [s.label for s in explore(system, (-2.0, 2.0)).solutions(-0.75)]
    ['no contact', 'slip-', 'stick']
    """

    def __new__(cls, body: ContactBody, load: Any, friction: Any, r: Any = None) -> CoulombLoad:
        """Return the piecewise-linear system where the load is affine."""
        straight = cls is CoulombLoad and isinstance(load, AffineLoad)
        return super().__new__(AffineCoulombLoad if straight else cls)

    def __getnewargs__(self) -> tuple[Any, ...]:
        """Return the arguments with which ``copy`` and ``pickle`` make the object."""
        return self.body, self.load, self.friction

    def __init__(
        self, body: ContactBody, load: Callable[[float], Any], friction: Any, r: Any = None
    ) -> None:
        checked_kind("body", body, ContactBody, is_needed=True)
        if isinstance(load, AffineLoad):
            if load.f0.shape != (body.n,):
                raise InvalidInputError(f"load has shape {load.f0.shape}, expected ({body.n},)")
            body = body.under(float(np.abs([load.f0, load.f1]).max()))
        super().__init__(body, r)
        self.friction = np.where(body.guided, 0.0, not_negative("friction", friction, body.p))
        self._without_friction = self.friction == 0.0
        if not callable(load):
            raise InvalidInputError("load must be an AffineLoad or a callable alpha -> (n,)")
        self.load = load
        self._is_small = self.size <= FEW_UNKNOWNS
        most = MOST_CELLS if self._is_small else 1
        self._constant: Kept[Character, Constant] = Kept(most)

    def load_at(self, alpha: float) -> Array:
        """Return f(alpha), shape (n,)."""
        given = self.load(alpha)
        try:
            f = np.asarray(given, dtype=float)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"load({alpha}) must be numbers, got {given!r}") from error
        if f.shape != (self.body.n,):
            raise InvalidInputError(f"load({alpha}) has shape {f.shape}, expected ({self.body.n},)")
        if not (isfinite(dasum(f)) or np.isfinite(f).all()):  # sums of large numbers overflow
            raise InvalidInputError(f"load({alpha}) is not finite: {f}")
        self.body.refuse_guided_load(f)
        return f

    def friction_at(self, alpha: float) -> Array:
        """Return F, shape (p,)."""
        return self.friction

    def _extreme_loads(self, lo: float, hi: float) -> Array | None:
        """Return the loads at lo and hi of an affine path, None for other paths."""
        if not isinstance(self.load, AffineLoad):
            return None
        return np.column_stack([self.load_at(lo), self.load_at(hi)])

    def along_friction(self, alpha: float) -> Coulomb:
        """Return the problem at given alpha whose parameter scales all friction, from 0 up to 1."""
        return CoulombFriction(self.body, self.load_at(alpha), self.r, self.friction_at(alpha))

    def searches(self) -> tuple[Search, ...]:
        """Return the homotopy from the frictionless problem, which works for any p."""
        return (FromFrictionless(),)

    def with_nodes(self, kept: Indices) -> Coulomb:
        """Return the problem with only some contact nodes."""
        body = self.body.with_nodes(kept)
        return CoulombLoad(body, self.load, self.friction[kept], self.r[kept])

    def condensed_on(self, small: ContactBody, kept: Indices) -> Coulomb:
        """Return the same problem on the body condensed onto some of its contact nodes."""
        return CoulombLoad(small, self._reduced(small), self.friction[kept], self.r[kept])

    def _reduced(self, small: ContactBody) -> Any:
        """Return the load of the condensed body."""
        if isinstance(self.load, AffineLoad):
            return AffineLoad(small.reduced(self.load.f0), small.reduced(self.load.f1))
        return lambda alpha: small.reduced(self.load_at(alpha))

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return [dH/dz | -f'(alpha)]."""
        rate, (matrix, at_rest) = self._load_rate(alpha), self._of_cell(character, alpha)
        if at_rest is not None:
            jacobian = at_rest.copy()
            jacobian[: self.body.n, -1] = -rate
            return jacobian
        column = np.zeros(self.size)
        column[: self.body.n] = -rate
        return self.with_alpha_column(matrix, column)

    def _matrix_at(self, character: Character, alpha: float) -> Matrix:
        return self._of_cell(character, alpha)[0]

    def _of_cell(self, character: Character, alpha: float) -> Constant:
        """Return dH/dz in a cell, and [dH/dz | 0] if dH/dz is dense.

        The matrices of some cells are kept, unless a subclass lets F change.
        """
        friction = self.friction_at(alpha)
        if friction is self.friction:
            return self._constant.of(character, self._made)
        return self._with(friction, character)

    def _made(self, character: Character) -> Constant:
        return self._with(self.friction, character)

    def _with(self, friction: Array, character: Character) -> Constant:
        matrix = self.state_matrix(self.modes(character), friction)
        is_dense = isinstance(matrix, np.ndarray)
        at_rest = self.with_alpha_column(matrix, np.zeros(self.size)) if is_dense else None
        return matrix, at_rest

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return (kappa1, kappa2, kappa3) of node 1, of node 2, ..., shape (3 p,)."""
        if self._tests_by_z is None:
            return super().test_functions(z, alpha)
        tests: Array = self._tests_by_z.dot(z) + self._tests_at_rest
        return tests

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the constant gradients of the tests, not to be written to."""
        return self._test_gradients

    def _load_rate(self, alpha: float) -> Array:
        if hasattr(self.load, "derivative"):
            return np.asarray(self.load.derivative(alpha), dtype=float)
        return self.differences(alpha).by_parameter(self.load_at, alpha)

    @cached_property
    def _tests_at_rest(self) -> Array:
        """The tests at z = 0, shape (3 p,)."""
        return super().test_functions(np.zeros(self.size), 0.0)

    @cached_property
    def _tests_by_z(self) -> Array | None:
        """The gradients of the tests by z, shape (3 p, n + 2 p); None if sparse."""
        if self._has_sparse_tests:
            return None
        return np.ascontiguousarray(self._test_gradients[:, :-1])

    @cached_property
    def _test_gradients(self) -> Matrix:
        return protected(self._gradients.at(self.friction, np.zeros(3 * self.body.p)))


@final
class AffineCoulombLoad(CoulombLoad, PiecewiseLinearSystem):
    """Coulomb friction with an affine load path: all pieces are straight."""

    def exact_lines(self) -> tuple[Array, list[list[ExactMode]]]:
        """Return equilibrium and the modes of every node; A, N, T, gap, f0, f1 and F are exact."""
        load, slope = self.load_at(0.0), self._load_rate(0.0)
        return exact_rows(self.body, load, slope, self.friction)

    def _linear_terms(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the linear terms, row by row: a straight path asks too seldom to pay for a matrix.

        Matrices of small bodies are kept, for many cells are entered more than once.
        """
        if self.algebra is not None or self._is_small:
            return super()._linear_terms(z, alpha, character)
        return self._states.product(z, self.modes(character), self.friction)

    def kink(self, before: Character, after: Character, test: int) -> Array:
        """Return c, shape (n + 2 p,): only rows of the test's node change, see :mod:`.states`."""
        node, which = divmod(test, 3)
        old, new = mode_of(node, before), mode_of(node, after)
        normal = self.body.n + node
        c = np.zeros(self.size)
        if which:  # kappa2 and kappa3 are x -+ F kappa1
            c[normal + self.body.p] = HELD[old] - HELD[new]
        else:
            c[normal] = IN_CONTACT[old] - IN_CONTACT[new]
            c[normal + self.body.p] = self.friction[node] * (SLIPS[new] - SLIPS[old])
        return c
