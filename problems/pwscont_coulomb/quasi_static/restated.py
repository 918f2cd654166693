"""The static law in displacements that count from a place where nodes were at rest (F16)."""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont import Block, Character, LoadHistory, PiecewiseLinearSystem
from pwscont.extending import Array, Matrix, dense
from pwscont_coulomb import modes as contact
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad


@final
class RestatedCoulomb(PiecewiseLinearSystem):
    """Equilibria in which nodes have slipped from given places, for a load history.

    With v such that N v = 0 and T v is where the nodes were at rest, the law is the static law of
    u - v under the load f - A v. Beside the tests of the contact nodes stand the tests t - t_k,
    which choose the straight line of the load.

    Parameters
    ----------
    body : ContactBody
    history : LoadHistory
    friction : ndarray, shape (p,)
    slip : ndarray, shape (p,)
        T u where the nodes were at rest.
    """

    degree = 1
    line_styles = contact.LINE_STYLES

    def __init__(
        self, body: ContactBody, history: LoadHistory, friction: Array, slip: Array
    ) -> None:
        self.body, self.history, self.size = body, history, body.n + 2 * body.p
        self._law = CoulombLoad(body, AffineLoad(np.zeros(body.n), np.zeros(body.n)), friction)
        v = displaced(body, slip)
        self._shift = np.append(v, np.zeros(2 * body.p))
        self._force = np.asarray(body.A @ v)
        self._corners = history.corners

    def _split(self, character: Character) -> tuple[Character, int]:
        """Return the character of the contact nodes, and the number of the straight line."""
        signs, tests = character.signs, 3 * self.body.p
        return Character(signs[:tests]), sum(signs[tests:])

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the tests of the nodes, then those of the load."""
        tests = self._law.test_functions(z - self._shift, alpha)
        return np.append(tests, alpha - self._corners)

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the constant gradients of the tests."""
        above = self._law.test_jacobian(z, alpha)
        below = np.zeros((len(self._corners), self.size + 1))
        below[:, -1] = 1.0
        if sp.issparse(above):
            return sp.vstack([sp.csr_matrix(above), sp.csr_matrix(below)]).tocsr()
        return np.vstack([above, below])

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the rows of the static law in u - v under the load f - A v."""
        nodes, leg = self._split(character)
        residual = self._law.residual(z - self._shift, alpha, nodes)
        begin, slope = self.history.line(leg)
        residual[: self.body.n] += self._force - begin - alpha * slope
        return residual

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return [dH/dz | -f'(t)]."""
        nodes, leg = self._split(character)
        column = np.zeros(self.size)
        column[: self.body.n] = -self.history.line(leg)[1]
        law = self._law
        return law.with_alpha_column(law.state_matrix(law.modes(nodes), law.friction), column)

    def bounding_tests(self, character: Character) -> list[int]:
        """Return the bounding tests of the nodes, and of both ends of the straight line."""
        nodes, leg = self._split(character)
        first = 3 * self.body.p
        ends = [first + k for k in (leg - 1, leg) if 0 <= k < len(self._corners)]
        return [*self._law.bounding_tests(nodes).tolist(), *ends]

    def blocks(self) -> tuple[Block, ...]:
        """Return one block per contact node, and one for the load."""
        nodes, count = self._law.blocks(), len(self._corners)
        if not count:
            return nodes
        tests = tuple(3 * self.body.p + k for k in range(count))
        lines = tuple(tuple(k < leg for k in range(count)) for leg in range(count + 1))
        return (*nodes, Block(tests, tuple(range(self.body.n)), lines))

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return lam_nu <= 0, u_nu <= gap and abs(lam_t) <= F abs(lam_nu) for all nodes."""
        return self._law.necessary(alpha)

    def scale(self, lo: float, hi: float) -> Array:
        """Return typical displacements and forces over the history."""
        return self._magnitudes

    @cached_property
    def _magnitudes(self) -> Array:
        loads = self.history.loads.T
        k, gap = float(self.body.stiffness.max()), float(self.body.gap.max())
        slip = float(np.abs(self._shift).max())
        force = max(float(np.abs(loads).max()), k * gap, float(np.abs(self._force).max())) or 1.0
        length = max(float(np.abs(self.body.solve(loads)).max()), gap, slip) or force / k
        return np.repeat([length, force], [self.body.n, 2 * self.body.p])

    def names(self) -> tuple[str, ...]:
        """Return the names of the static law."""
        return self._law.names()

    def label(self, character: Character) -> str:
        """Return the contact mode of each node."""
        return contact.label(self._split(character)[0])

    def describe(self, character: Character) -> str:
        """Return mode and character triple of each node, and the straight line of the load."""
        nodes, leg = self._split(character)
        return f"{contact.describe(nodes)}, line {leg + 1} of the load"


def displaced(body: ContactBody, slip: Array) -> Array:
    """Return displacements v with N v = 0 and T v = slip, the shortest ones."""
    if not slip.any():
        return np.zeros(body.n)
    rows = np.vstack([dense(body.N), dense(body.T)])
    target = np.append(np.zeros(body.p), slip)
    v: Array = rows.T @ np.linalg.solve(rows @ rows.T, target)
    return v
