"""Contact problems of elastic bodies, and the displacements of solutions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import CONVERGED, Array, named
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.elastic.arguments import check_number
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.load import CoulombLoad
from pwscont_coulomb.load_paths import AffineLoad


class ElasticProblem(ABC):
    """Matrices and load of an elastic body, in some choice of unknowns.

    Attributes
    ----------
    elastic : DiscretisedBody
    body : ContactBody
    load : AffineLoad
    friction : ndarray, shape (p,)

    Examples
    --------
    >>> from pwscont_coulomb.elastic import ElasticProblem
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> problem = triangle().build().condensed()
    >>> isinstance(problem, ElasticProblem), problem.along_load().size
    (True, 4)
    """

    elastic: DiscretisedBody
    body: ContactBody
    load: AffineLoad
    friction: Array

    def __repr__(self) -> str:
        return named(self, self.body, f"of {self.elastic}")

    def along_load(self, r: Any = None) -> CoulombLoad:
        """Return the system whose parameter is the alpha of the loads."""
        return CoulombLoad(self.body, self.load, self.friction, r)

    def along_friction(
        self, alpha: float = 0.0, r: Any = None, profile: Any = 1.0
    ) -> CoulombFriction:
        """Return the system whose parameter is the friction coefficient, at the load of ``alpha``.

        Parameters
        ----------
        alpha : float
            Parameter of the loads.
        r, profile
            As for :class:`~pwscont_coulomb.CoulombFriction`; by default all nodes share a
            coefficient, whatever the friction of the contact boundary.
        """
        check_number("alpha", alpha)
        return CoulombFriction(self.body, self.load(alpha), r, profile)

    def load_parameter(self, z: Array, alpha: float) -> float:
        """Return the parameter of the loads under which a state is in equilibrium.

        A state of :meth:`along_load` has the parameter ``alpha``. A state of
        :meth:`along_friction`, whose alpha is the friction coefficient, has the parameter a of
        A u - N^T lam_nu - T^T lam_t = f0 + a f1, by least squares.

        Parameters
        ----------
        z : ndarray, shape (n + 2 p,)
        alpha : float
            The parameter of the system that z is a state of.

        Raises
        ------
        InvalidInputError
            If the loads grow without any effect on the contact nodes: then z does not tell the
            load.
        """
        if not self.elastic.grows:
            return alpha
        f0, f1, growth = self.load.f0, self.load.f1, np.abs(self.load.f1).max()
        if growth <= CONVERGED * np.abs(self.elastic.f1).max():
            raise InvalidInputError(
                "the loads grow with alpha, but not at the contact nodes: a solution does not tell "
                "under which load it was found; give load_alpha"
            )
        force, rounding = self._resisted(z)
        unit = f1 / growth
        found = float(unit @ (force - f0) / (unit @ unit)) / growth
        off = abs(found - alpha) * growth
        return alpha if off <= CONVERGED * float((rounding + np.abs(f0)).max()) else found

    def _resisted(self, z: Array) -> tuple[Array, Array]:
        """Return A u - N^T lam_nu - T^T lam_t, and the sum of the magnitudes of all terms."""
        body, u, (normal, tangential) = self.body, z[: self.body.n], self.multipliers(z)
        force = body.A @ u - body.N.T @ normal - body.T.T @ tangential
        sizes = abs(body.A) @ np.abs(u) + abs(body.N.T) @ np.abs(normal)
        return force, sizes + abs(body.T.T) @ np.abs(tangential)

    @abstractmethod
    def displacements(self, z: Array, alpha: float) -> Array:
        """Return the displacements of all nodes of the mesh, shape (k, 2).

        Parameters
        ----------
        z : ndarray, shape (n + 2 p,)
            A state of the system, such as ``solution.z``.
        alpha : float
            The parameter of the loads, not the friction coefficient of a system along the friction.
        """

    def multipliers(self, z: Array) -> tuple[Array, Array]:
        """Return the normal and tangential contact force of each node, each of shape (p,).

        The normal force is negative where the node presses on the obstacle; forces act on the body
        along normals and tangents.
        """
        n, p = self.body.n, self.body.p
        return z[n : n + p], z[n + p :]
