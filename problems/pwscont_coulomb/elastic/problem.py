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

    def load_factors(self, z: Array) -> Array:
        """Return the factors of the constant and the growing loads that act in a state, shape (2,).

        A load history may go through any sums a f0 + b f1: then z tells a and b, by least squares.

        Raises
        ------
        InvalidInputError
            If z does not tell a and b, or is under other loads.
        """
        force, rounding = self._resisted(z)
        loads = np.stack([self.load.f0, self.load.f1], axis=1)
        sizes, whole = np.abs(loads).max(axis=0), [self.elastic.f0, self.elastic.f1]
        acts = sizes > CONVERGED * np.abs(whole).max(axis=1)
        if any(load.any() for load, act in zip(whole, acts, strict=True) if not act):
            raise InvalidInputError(
                "some of the loads move no contact node: a state does not tell how large they are"
            )
        factors = np.zeros(2)
        factors[acts] = np.linalg.lstsq(loads[:, acts] / sizes[acts], force)[0] / sizes[acts]
        if (np.abs(loads @ factors - force) > CONVERGED * rounding.max(initial=0.0)).any():
            raise InvalidInputError(
                "other loads act than the constant and the growing loads of the body from the "
                "mesh: the displacements of inner nodes are not known"
            )
        return factors

    def displacements_under(self, z: Array, factors: Array) -> Array:
        """Return the displacements of all nodes under factors of both loads, shape (k, 2).

        The displacements are linear in z and the factors.
        """
        nothing = np.zeros_like(z)
        constant = self.displacements(nothing, 0.0)
        growing = self.displacements(nothing, 1.0) - constant
        by_state: Array = self.displacements(z, 0.0) - constant
        moved: Array = by_state + factors[0] * constant + factors[1] * growing
        return moved

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
