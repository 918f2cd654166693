"""The friction coefficient as parameter (paper, Problem 2)."""

from __future__ import annotations

from typing import Any, final

import numpy as np

from pwscont import Character, Search
from pwscont.extending import Array, Indices, Matrix, checked_kind, finite_array
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.coulomb import Coulomb
from pwscont_coulomb.frictionless import FromFrictionless
from pwscont_coulomb.per_node import not_negative
from pwscont_coulomb.rows import by_node
from pwscont_coulomb.states import SLIPS


@final
class CoulombFriction(Coulomb):
    """Coulomb friction under a fixed load; the parameter is the coefficient F >= 0.

    With a profile, the coefficient of node i is ``F * profile[i]``.

    Parameters
    ----------
    body : ContactBody
    force : array_like, shape (n,)
        The load f.
    r : float or array_like, shape (p,), optional
        As for :class:`~pwscont_coulomb.coulomb.Coulomb`.
    profile : float or array_like, shape (p,), optional
        Ratios between the nodes' coefficients, not negative; default all 1.

    Raises
    ------
    InvalidInputError
        If shapes do not fit the body, a ratio is negative, or the load moves a guided node.

    Examples
    --------
    >>> from pwscont import explore
    >>> from pwscont_coulomb import ContactBody, CoulombFriction
    >>> body = ContactBody([[2, -1], [-1, 2]], N=[[1, 0]], T=[[0, 1]])
    >>> graph = explore(CoulombFriction(body, [1, -3]), (0.1, 15.0), parameter="F")
    >>> [round(p.alpha, 6) for p in graph.special_points("nonsmooth fold")]
    [3.0]
    """

    domain = (0.0, np.inf)

    def __init__(self, body: ContactBody, force: Any, r: Any = None, profile: Any = 1.0) -> None:
        checked_kind("body", body, ContactBody, is_needed=True)
        self.force = finite_array("force", force, (body.n,))
        super().__init__(body.under(float(np.abs(self.force).max())), r)
        body.refuse_guided_load(self.force)
        self.profile = np.where(body.guided, 0.0, not_negative("profile", profile, body.p))
        self._without_friction = self.profile == 0.0

    def load_at(self, alpha: float) -> Array:
        """Return the fixed load, shape (n,)."""
        return self.force

    def friction_at(self, alpha: float) -> Array:
        """Return F = alpha times the profile, shape (p,)."""
        return alpha * self.profile

    def _extreme_loads(self, lo: float, hi: float) -> Array:
        """Return the fixed load."""
        return self.force[:, np.newaxis]

    def along_friction(self, alpha: float) -> Coulomb:
        """Return the problem at given alpha whose parameter scales all friction, from 0 up to 1."""
        return CoulombFriction(self.body, self.load_at(alpha), self.r, self.friction_at(alpha))

    def searches(self) -> tuple[Search, ...]:
        """Return the homotopy from the frictionless problem, which works for any p."""
        return (FromFrictionless(),)

    def with_nodes(self, kept: Indices) -> Coulomb:
        """Return the problem with only some contact nodes."""
        body = self.body.with_nodes(kept)
        return CoulombFriction(body, self.force, self.r[kept], self.profile[kept])

    def condensed_on(self, small: ContactBody, kept: Indices) -> Coulomb:
        """Return the same problem on the body condensed onto some of its contact nodes."""
        force, profile = small.reduced(self.force), self.profile[kept]
        return CoulombFriction(small, force, self.r[kept], profile)

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return [dH/dz | dH/dF]; F enters the tangential rows of slipping nodes."""
        column = np.zeros(self.size)
        column[-self.body.p :] = SLIPS[self.modes(character)] * self.profile * self.kappa1(z)
        return self.with_alpha_column(self._matrix_at(character, alpha), column)

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the gradients of the tests; kappa2 and kappa3 depend on F."""
        return self._gradients.at(self.friction_at(alpha), self._tests_by_friction(z))

    def some_test_gradients(self, z: Array, alpha: float, which: Indices) -> Matrix:
        """Return some rows of ``test_jacobian``."""
        return self._gradients.some(which, self.friction_at(alpha), self._tests_by_friction(z))

    def _tests_by_friction(self, z: Array) -> Array:
        """Return the derivatives of the tests by F, shape (3 p,)."""
        bound = self.profile * self.kappa1(z)
        return by_node(np.zeros_like(bound), -bound, bound)
