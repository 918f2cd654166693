"""A contact problem that a body hands to the systems of the plug-in, and the way back."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from pwscont.foundation.arrays import Array
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.elastic.elastic_body import ElasticBody
from pwscont_coulomb.friction import CoulombFriction
from pwscont_coulomb.load import AffineLoad, CoulombLoad


class ElasticProblem(ABC):
    """Matrices and load of an elastic body, in some choice of unknowns.

    Attributes
    ----------
    elastic : ElasticBody
    body : ContactBody
    load : AffineLoad
    friction : ndarray, shape (p,)
    """

    elastic: ElasticBody
    body: ContactBody
    load: AffineLoad
    friction: Array

    def along_load(self, r: Any = None) -> CoulombLoad:
        """Return the system whose parameter alpha is that of the loads."""
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
            As for :class:`~pwscont_coulomb.CoulombFriction`; by default all nodes have one
            coefficient, whatever that of the contact boundary.
        """
        return CoulombFriction(self.body, self.load(alpha), r, profile)

    @abstractmethod
    def displacements(self, z: Array, alpha: float) -> Array:
        """Return the displacements of all nodes of the mesh, shape (k, 2).

        Parameters
        ----------
        z : ndarray, shape (n + 2 p,)
            A state of the system, such as ``solution.z``.
        alpha : float
            The parameter of the loads, not that of a system along the friction.
        """

    def multipliers(self, z: Array) -> tuple[Array, Array]:
        """Return the normal and tangential contact force of each node, each of shape (p,).

        The normal force is negative where the node presses on the obstacle; forces act on the
        body along its normals and tangents.
        """
        n, p = self.body.n, self.body.p
        return z[n : n + p], z[n + p :]
