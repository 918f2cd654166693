"""The equations that both Coulomb systems share.

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

A guided node (:class:`~pwscont_coulomb.ContactBody`) is either in no contact or in stick. Its
tangential row is lam_t in both; kappa1 alone bounds them, and kappa2 = 1 and kappa3 = -1 are
constant.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont import Block, Character, SlicewiseLinearSystem
from pwscont.basics.arrays import Array, Indices, Matrix, dense, finite_array
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.looks import counted
from pwscont.linear.updates import Updating
from pwscont.search import Search
from pwscont.system.reduction import Reduction
from pwscont_coulomb import modes as contact
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.contact_algebra import ContactAlgebra, ContactMatrix
from pwscont_coulomb.modes import BOUNDS, SIGNS

IN_CONTACT = np.array([0.0, 1.0, 1.0, 1.0])
STICKS = np.array([0.0, 1.0, 0.0, 0.0])
SLIPS = np.array([0.0, 0.0, -1.0, 1.0])  # factor of F kappa1 in the tangential row

MODES = tuple(SIGNS.values())
GUIDED_MODES = (SIGNS[contact.Mode.NO_CONTACT], SIGNS[contact.Mode.STICK])

#: From this many contact nodes on, elimination by hand pays for itself.
MANY_NODES = 32
#: Rounding in the bound by which nodes are left out is far below this part of it.
REACH_MARGIN = 1e-6


class Coulomb(SlicewiseLinearSystem):
    """Static contact with Coulomb friction; subclasses say what the parameter is.

    Parameters
    ----------
    body : ContactBody
    r : float or array_like, shape (p,), optional
        Scale of the augmented multipliers (force per length), positive. Default: the stiffness
        of each node, so that results do not depend on units.
    """

    #: Nodes with F = 0 whatever the parameter, shape (p,).
    _without_friction: Array
    #: One solution more with positive than with negative determinant, whatever f and F >= 0.
    degree = 1
    line_styles = contact.LINE_STYLES

    def __init__(self, body: ContactBody, r: Any = None) -> None:
        self.body = body
        self.size = body.n + 2 * body.p
        self.r = _positive("r", body.stiffness if r is None else r, body.p)
        self._offset = self.r * body.gap
        self._inside = np.where(body.guided, 1.0, 0.0)
        self._has_gap = bool(body.gap.any())
        many = body.p >= MANY_NODES and ContactAlgebra.fits(body)
        #: How dH/dz is factorised where there are many contact nodes; None for a general LU.
        self.algebra = ContactAlgebra(body, self.r, Updating()) if many else None
        self._kappa1_rows, self._x_rows = self._test_rows()
        self._known: tuple[Any, Matrix] | None = None
        self._scale: tuple[tuple[float, float], Array] | None = None

    @cached_property
    def _free(self) -> Matrix:
        """Return dH/dz without any contact: equilibrium, lam_nu = 0, lam_t = 0."""
        n, body = self.body.n, self.body
        if not body.is_sparse:
            matrix = np.eye(self.size)
            matrix[:n] = np.hstack([body.A, -dense(body.N).T, -dense(body.T).T])
            return matrix
        one, N, T = sp.identity(body.p), sp.csr_matrix(body.N), sp.csr_matrix(body.T)
        blocks = [[body.A, -N.T, -T.T], [None, one, None], [None, None, one]]
        return sp.bmat(blocks, format="csr")

    @property
    def _has_sparse_tests(self) -> bool:
        return self.body.is_sparse or self.algebra is not None

    def _test_rows(self) -> tuple[Matrix, Matrix]:
        """Return the gradients by z of kappa1 and x, each of shape (p, n + 2 p)."""
        body, r, slides = self.body, self.r, 1.0 - self._inside
        if not self._has_sparse_tests:
            one, none = np.eye(body.p), np.zeros((body.p, body.p))
            N, T = -r[:, np.newaxis] * dense(body.N), -r[:, np.newaxis] * dense(body.T)
            return np.hstack([N, one, none]), slides[:, np.newaxis] * np.hstack([T, none, one])
        one, none = sp.identity(body.p), sp.csr_matrix((body.p, body.p))
        N, T = -sp.diags(r) @ sp.csr_matrix(body.N), -sp.diags(r) @ sp.csr_matrix(body.T)
        x = sp.diags(slides) @ sp.hstack([T, none, one])
        return sp.hstack([N, one, none]).tocsr(), x.tocsr()

    # -- what a subclass adds ------------------------------------------------------------

    def load_at(self, alpha: float) -> Array:
        """Return f, shape (n,)."""
        raise NotImplementedError

    def friction_at(self, alpha: float) -> Array:
        """Return F per node, shape (p,)."""
        raise NotImplementedError

    # -- the contract --------------------------------------------------------------------

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return (kappa1, kappa2, kappa3) of node 1, of node 2, ..., shape (3 p,)."""
        kappa1, x = self.kappa1(z), self._x_rows @ z
        bound = self.friction_at(alpha) * kappa1
        return _by_node(kappa1, x - bound + self._inside, x + bound - self._inside)

    def kappa1(self, z: Array) -> Array:
        """Return lam_nu - r (u_nu - gap), shape (p,)."""
        kappa1: Array = self._kappa1_rows @ z + self._offset
        return kappa1

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows of the module's table, shape (n + 2 p,)."""
        body, mode = self.body, contact.modes(character)
        residual: Array = self.state_matrix(mode, self.friction_at(alpha)) @ z
        residual[: body.n] -= self.load_at(alpha)
        if self._has_gap:
            n, p = body.n, body.p
            residual[n : n + p] -= IN_CONTACT[mode] * self._offset
            residual[n + p :] += self.friction_at(alpha) * SLIPS[mode] * self._offset
        return residual

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return kappa1 for no contact, kappa2 and kappa3 for stick, kappa1 and one for slip.

        Where F > 0, kappa2 >= 0 >= kappa3 implies kappa1 <= 0. Without friction kappa1 bounds
        stick too: else points with tension would be taken for solutions.
        """
        bounds = BOUNDS[contact.modes(character)]
        bounds[:, 0] |= self._without_friction
        bounds[self.body.guided, 1:] = False
        return np.flatnonzero(bounds).tolist()

    def cells(self) -> Iterator[Character]:
        """Yield one character for each combination of modes: 4^p where no node is guided."""
        for combination in product(*self._modes()):
            yield Character(tuple(sign for signs in combination for sign in signs))

    def blocks(self) -> tuple[Block, ...]:
        """Return one block per contact node, of four modes or, where it is guided, two."""
        n, p = self.body.n, self.body.p
        return tuple(
            Block((3 * i, 3 * i + 1, 3 * i + 2), (n + i, n + p + i), modes)
            for i, modes in enumerate(self._modes())
        )

    def _modes(self) -> list[tuple[tuple[bool, ...], ...]]:
        """Return the signs of the modes that each node may be in."""
        return [GUIDED_MODES if guided else MODES for guided in self.body.guided]

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return lam_nu <= 0, u_nu <= gap and |lam_t| <= F |lam_nu| for all nodes."""
        body, p, F = self.body, self.body.p, self.friction_at(alpha)
        offset = np.concatenate([np.zeros(p), body.gap, np.zeros(2 * p)])
        if body.is_sparse:
            one, N = sp.identity(p), sp.csr_matrix(body.N)
            rows = [[None, -one, None], [-N, None, None], [None, -sp.diags(F), one]]
            return sp.bmat([*rows, [None, -sp.diags(F), -one]]).tocsr(), offset
        one, none, slope = np.eye(p), np.zeros((p, p)), np.diag(-F)
        limits = np.block([[-one, none], [none, none], [slope, one], [slope, -one]])
        N = np.zeros((4 * p, body.n))
        N[p : 2 * p] = -dense(body.N)
        return np.hstack([N, limits]), offset

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
        lam_nu, x = z[n : n + p], self._x_rows @ z
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
        n, p = self.body.n, self.body.p
        u = [f"u[{i}]" for i in range(n)]
        for symbol, picks in (("ν", self.body.N), ("t", self.body.T)):
            for node, column in _single_unknowns(picks):
                u[column] = f"u_{symbol}{_suffix(node, p)}"
        lam = [f"λ_{symbol}{_suffix(node, p)}" for symbol in "νt" for node in range(p)]
        return (*u, *lam)

    def test_name(self, test: int) -> str:
        """Return a name such as ``kappa2 of node 3``."""
        return f"kappa{test % 3 + 1} of node {self.body.numbers[test // 3]}"

    def reduction(self, lo: float, hi: float) -> Reduction | None:
        """Leave out contact nodes that cannot reach the obstacle, by an energy bound."""
        energies = self._energies(lo, hi)
        if not self._has_gap or energies is None:
            return None
        reach = self.body.reach(energies)
        idle = self.body.gap > reach * (1.0 + REACH_MARGIN)
        idle[np.argmin(self.body.gap - reach)] = False  # at least one node remains
        return self._without(np.flatnonzero(idle), reach) if idle.any() else None

    def _energies(self, lo: float, hi: float) -> Array | None:
        """Return f.A^-1 f of the loads whose convex hull holds all loads, None if unknown."""
        return None

    def _with_nodes(self, kept: Indices) -> Coulomb:
        """Return the same problem with only some of its contact nodes."""
        raise NotImplementedError

    def _without(self, idle: Indices, reach: Array) -> Reduction:
        n, p, gap, numbers = self.body.n, self.body.p, self.body.gap, self.body.numbers
        kept = np.setdiff1d(np.arange(p), idle)
        return Reduction(
            system=self._with_nodes(kept),
            kept=np.concatenate([np.arange(n), n + kept, n + p + kept]),
            tests=(3 * kept[:, np.newaxis] + np.arange(3)).ravel(),
            idle=Character(SIGNS[contact.Mode.NO_CONTACT] * p),
            reasons=tuple(
                f"node {numbers[i]} cannot touch: it moves by at most {reach[i]:.3g} of its gap "
                f"{gap[i]:.3g} (energy bound)"
                for i in idle
            ),
        )

    def essential(self, character: Character) -> Indices | None:
        """Return two unknowns per node: displacements where it may move, else multipliers."""
        if self.algebra is None:
            return None
        return self._free_unknowns(contact.modes(character))

    def _free_unknowns(self, mode: Indices) -> Indices:
        a, n, p = self.algebra, self.body.n, self.body.p
        assert a is not None
        chosen = np.arange(n)
        node = np.arange(p)
        chosen[a.normal] = np.where(mode == contact.Mode.NO_CONTACT, a.normal, n + node)
        chosen[a.tangential] = np.where(mode == contact.Mode.STICK, n + p + node, a.tangential)
        return chosen

    def completed(self, values: Array, alpha: float, character: Character) -> Array:
        """Return z from what is free in these modes."""
        if self.algebra is None:
            return values
        mode, n, p = contact.modes(character), self.body.n, self.body.p
        a, touches = self.algebra, mode != contact.Mode.NO_CONTACT
        z = np.zeros(self.size)
        z[a.normal[touches]] = self.body.gap[touches]
        z[self._free_unknowns(mode)] = values
        slips = -SLIPS[mode] * self.friction_at(alpha)
        z[n + p :] += slips * z[n : n + p]
        return z

    def searches(self) -> tuple[Search, ...]:
        """Return the homotopy from the frictionless problem, which works for any p."""
        from pwscont_coulomb.frictionless import FromFrictionless  # noqa: PLC0415  it traces us

        return (FromFrictionless(),)

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical displacements and forces over the interval.

        Displacements are those of the body without contact: in a soft direction they may be
        far larger than force by stiffness.
        """
        if self._scale is None or self._scale[0] != (lo, hi):
            loads = np.column_stack([self.load_at(alpha) for alpha in np.linspace(lo, hi, 9)])
            k, gap = float(self.body.stiffness.max()), float(self.body.gap.max())
            force = max(float(np.abs(loads).max()), k * gap) or 1.0
            length = max(float(np.abs(self.body.solve(loads)).max()), gap) or force / k
            scale = np.repeat([length, force], [self.body.n, 2 * self.body.p])
            self._scale = ((lo, hi), scale)
        return self._scale[1]

    # -- matrices ------------------------------------------------------------------------

    def state_matrix(self, mode: Indices, friction: Array) -> Matrix:
        """Return dH/dz, shape (n + 2 p, n + 2 p), not to be written to; the last is remembered.

        With the gradients of kappa1 and x, the rows of a node are those of lam_nu, less kappa1
        in contact, and of lam_t, less x in stick, less or plus F kappa1 in slip.
        """
        key = (mode.tobytes(), friction.tobytes())
        if self._known is None or self._known[0] != key:
            self._known = (key, self._state_matrix(mode, friction))
        return self._known[1]

    def _state_matrix(self, mode: Indices, friction: Array) -> Matrix:
        if self.algebra is not None:
            return ContactMatrix(self.algebra, mode, friction)
        normal = _scaled(IN_CONTACT[mode], self._kappa1_rows)
        slip = _scaled(SLIPS[mode] * friction, self._kappa1_rows)
        tangential = _scaled(STICKS[mode], self._x_rows) - slip
        return self._less_contact(normal, tangential)

    def _less_contact(self, normal: Matrix, tangential: Matrix) -> Matrix:
        """Return the matrix of the body without contact, less rows of the contact nodes."""
        n, p = self.body.n, self.body.p
        if self.body.is_sparse:
            nothing = sp.csr_matrix((n, self.size))
            return (self._free - sp.vstack([nothing, normal, tangential])).tocsr()
        matrix = self._free.copy()
        matrix[n : n + p] -= normal
        matrix[n + p :] -= tangential
        return matrix

    def test_gradients(self, friction: Array, by_alpha: Array) -> Matrix:
        """Return the gradients of all tests, shape (3 p, n + 2 p + 1).

        Parameters
        ----------
        friction : ndarray, shape (p,)
        by_alpha : ndarray, shape (3 p,)
            Derivatives by alpha, the last column.
        """
        if self._has_sparse_tests:
            bound = sp.diags(friction) @ self._kappa1_rows
            rows = sp.vstack([self._kappa1_rows, self._x_rows - bound, self._x_rows + bound])
            by_node = np.arange(3 * self.body.p).reshape(3, self.body.p).T.ravel()
            return sp.hstack([rows.tocsr()[by_node], sp.csr_matrix(by_alpha[:, None])]).tocsr()
        bound = friction[:, np.newaxis] * self._kappa1_rows
        gradients = np.empty((3 * self.body.p, self.size + 1))
        gradients[:, :-1] = _by_node(self._kappa1_rows, self._x_rows - bound, self._x_rows + bound)
        gradients[:, -1] = by_alpha
        return gradients

    def with_alpha_column(self, matrix: Matrix, column: Array) -> Matrix:
        """Return [matrix | column], dense, sparse or structured as the matrix is."""
        if isinstance(matrix, ContactMatrix):
            return matrix.algebra.jacobian(matrix, column)
        if self.body.is_sparse:
            return sp.hstack([matrix, sp.csr_matrix(column[:, np.newaxis])]).tocsr()
        jacobian = np.empty((self.size, self.size + 1))
        jacobian[:, :-1] = matrix
        jacobian[:, -1] = column
        return jacobian


def _by_node(first: Array, second: Array, third: Array) -> Array:
    """Interleave three arrays along their first axis."""
    mixed = np.empty((3 * len(first), *first.shape[1:]))
    mixed[0::3], mixed[1::3], mixed[2::3] = first, second, third
    return mixed


def _scaled(factors: Array, rows: Matrix) -> Matrix:
    """Return each row multiplied by its factor."""
    return sp.diags(factors) @ rows if sp.issparse(rows) else factors[:, np.newaxis] * rows


def _positive(name: str, values: Any, p: int) -> Array:
    array = per_node(name, values, p)
    if (array <= 0.0).any():
        raise InvalidInputError(f"{name} must be positive, got {array.min():.6g}")
    return array


def not_negative(name: str, values: Any, p: int) -> Array:
    """Return a number, or p numbers, as p finite numbers that are not negative."""
    array = per_node(name, values, p)
    if (array < 0.0).any():
        raise InvalidInputError(f"{name} must not be negative, got {array.min():.6g}")
    return array


def per_node(name: str, values: Any, p: int) -> Array:
    """Return a number, or p numbers, as p finite numbers."""
    array = finite_array(name, values)
    if array.shape not in ((), (p,)):
        raise InvalidInputError(f"{name} must be a number or {p} numbers, got shape {array.shape}")
    return np.broadcast_to(array, (p,)).copy()


def _single_unknowns(picks: Matrix) -> Iterator[tuple[int, int]]:
    """Yield (node, column) for the rows of N or T that are unit vectors."""
    rows = sp.csr_matrix(picks)
    for node in range(rows.shape[0]):
        row = rows[node]
        if row.nnz == 1 and row.data[0] == 1.0:
            yield node, int(row.indices[0])


def _suffix(node: int, p: int) -> str:
    return f",{node + 1}" if p > 1 else ""
