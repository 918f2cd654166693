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
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from pwscont import Character, SlicewiseLinearSystem
from pwscont.foundation.arrays import Array, Indices, Matrix, finite_array
from pwscont.foundation.errors import InvalidInputError
from pwscont_coulomb import modes as contact
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.modes import BOUNDS, SIGNS, Mode

_IN_CONTACT = np.array([0.0, 1.0, 1.0, 1.0])
_STICKS = np.array([0.0, 1.0, 0.0, 0.0])
_SLIPS = np.array([0.0, 0.0, -1.0, 1.0])  # factor of F kappa1 in the tangential row


class Coulomb(SlicewiseLinearSystem):
    """Static contact with Coulomb friction; subclasses say what the parameter is.

    Parameters
    ----------
    body : ContactBody
    r : float or array_like, shape (p,), optional
        Scale of the augmented multipliers (force per length), positive. Default: the stiffness
        of each node, so that results do not depend on units.
    """

    def __init__(self, body: ContactBody, r: Any = None) -> None:
        self.body = body
        self.size = body.n + 2 * body.p
        self.r = _positive("r", body.stiffness if r is None else r, body.p)
        self._known: tuple[Any, Matrix] | None = None

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
        body = self.body
        u, lam_nu, lam_t = np.split(z, [body.n, body.n + body.p])
        kappa1 = lam_nu - self.r * (body.N @ u - body.gap)
        x = lam_t - self.r * (body.T @ u)
        bound = self.friction_at(alpha) * kappa1
        return np.stack([kappa1, x - bound, x + bound], axis=1).ravel()

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows of the module's table, shape (n + 2 p,)."""
        body, mode = self.body, contact.modes(character)
        residual: Array = self.state_matrix(mode, self.friction_at(alpha)) @ z
        residual[: body.n] -= self.load_at(alpha)
        offset = self.r * body.gap
        residual[body.n : body.n + body.p] -= _IN_CONTACT[mode] * offset
        residual[body.n + body.p :] += self.friction_at(alpha) * _SLIPS[mode] * offset
        return residual

    def bounding_tests(self, character: Character) -> Sequence[int]:
        """Return kappa1 for no contact, kappa2 and kappa3 for stick, kappa1 and one for slip."""
        bounds = BOUNDS[contact.modes(character)].ravel()
        return np.flatnonzero(bounds).tolist()

    def cells(self) -> Iterator[Character]:
        """Yield one character for each of the 4^p combinations of modes."""
        for combination in product(Mode, repeat=self.body.p):
            yield Character(tuple(sign for mode in combination for sign in SIGNS[mode]))

    def describe(self, character: Character) -> str:
        """Return the contact mode of each node."""
        return contact.describe(character)

    def describe_transition(self, before: Character, after: Character) -> str:
        """Return the paper's message, such as ``contact-slip → contact-stick``."""
        return contact.describe_change(before, after)

    def names(self) -> tuple[str, ...]:
        """Return u[i] (or u_nu and u_t where N and T pick single unknowns) and multipliers."""
        n, p = self.body.n, self.body.p
        u = [f"u[{i}]" for i in range(n)]
        for symbol, picks in (("ν", self.body.N), ("t", self.body.T)):
            for node, column in _single_unknowns(picks):
                u[column] = f"u_{symbol}{_suffix(node, p)}"
        lam = [f"λ_{symbol}{_suffix(node, p)}" for symbol in "νt" for node in range(p)]
        return (*u, *lam)

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical displacements and forces over the interval."""
        loads = [np.abs(self.load_at(alpha)).max() for alpha in np.linspace(lo, hi, 9)]
        k = float(self.body.stiffness.max())
        force = max(*loads, k * float(self.body.gap.max())) or 1.0
        return np.repeat([force / k, force], [self.body.n, 2 * self.body.p])

    # -- matrices ------------------------------------------------------------------------

    def state_matrix(self, mode: Indices, friction: Array) -> Matrix:
        """Return dH/dz, shape (n + 2 p, n + 2 p); the last one is remembered."""
        key = (mode.tobytes(), friction.tobytes())
        if self._known is None or self._known[0] != key:
            self._known = (key, self._assemble(mode, friction))
        return self._known[1]

    def _assemble(self, mode: Indices, friction: Array) -> Matrix:
        body = self.body
        touches, sticks = _IN_CONTACT[mode], _STICKS[mode]
        slips = _SLIPS[mode] * friction
        normal = (touches * self.r, 1.0 - touches)
        tangential = (sticks * self.r, -slips * self.r, slips, 1.0 - sticks)
        if body.is_sparse:
            return _sparse_blocks(body, normal, tangential)
        return _dense_blocks(body, normal, tangential)

    def with_alpha_column(self, matrix: Matrix, column: Array) -> Matrix:
        """Return [matrix | column], dense or sparse as the body is."""
        if self.body.is_sparse:
            return sp.hstack([matrix, sp.csr_matrix(column[:, np.newaxis])]).tocsr()
        jacobian = np.empty((self.size, self.size + 1))
        jacobian[:, :-1] = matrix
        jacobian[:, -1] = column
        return jacobian


def _dense_blocks(
    body: ContactBody, normal: tuple[Array, ...], tangential: tuple[Array, ...]
) -> Array:
    n, p = body.n, body.p
    N = body.N.toarray() if sp.issparse(body.N) else body.N
    T = body.T.toarray() if sp.issparse(body.T) else body.T
    matrix = np.zeros((n + 2 * p, n + 2 * p))
    node = np.arange(p)
    matrix[:n, :n], matrix[:n, n : n + p], matrix[:n, n + p :] = body.A, -N.T, -T.T
    matrix[n : n + p, :n] = normal[0][:, np.newaxis] * N
    matrix[n + node, n + node] = normal[1]
    matrix[n + p :, :n] = tangential[0][:, np.newaxis] * T + tangential[1][:, np.newaxis] * N
    matrix[n + p + node, n + node] = tangential[2]
    matrix[n + p + node, n + p + node] = tangential[3]
    return matrix


def _sparse_blocks(
    body: ContactBody, normal: tuple[Array, ...], tangential: tuple[Array, ...]
) -> Matrix:
    N, T, d = sp.csr_matrix(body.N), sp.csr_matrix(body.T), sp.diags
    return sp.bmat(
        [
            [body.A, -N.T, -T.T],
            [d(normal[0]) @ N, d(normal[1]), None],
            [d(tangential[0]) @ T + d(tangential[1]) @ N, d(tangential[2]), d(tangential[3])],
        ],
        format="csr",
    )


def _positive(name: str, values: Any, p: int) -> Array:
    array = per_node(name, values, p)
    if (array <= 0.0).any():
        raise InvalidInputError(f"{name} must be positive, got {array.min():.6g}")
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
