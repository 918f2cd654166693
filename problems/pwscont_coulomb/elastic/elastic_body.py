"""Elastic bodies, and the contact problems that elastic bodies pose."""

from __future__ import annotations

from typing import final

from pwscont_coulomb.elastic.condensation import CondensedProblem
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.elimination import Elimination
from pwscont_coulomb.elastic.full import FullProblem


@final
class ElasticBody(DiscretisedBody):
    """A plane linear elastic body that may touch a rigid obstacle.

    All quantities are per unit thickness and in any consistent units.

    Parameters
    ----------
    mesh : skfem.Mesh or path
        Triangles or quadrilaterals; a path is read with meshio, where the physical groups of a
        Gmsh file become boundaries and subdomains of the same names.
    material : Material or mapping of str to Material
        For the whole body, or by subdomain; subdomains must cover the body without overlap.
    supports : sequence of Support
        Prescribed displacements.
    contact : ContactBoundary
    loads : sequence of Traction or BodyForce, optional
    state : PlaneState, optional
        PlaneStrain() or PlaneStress(); default plane strain.
    order : int, optional
        1 for P1 and Q1, 2 for P2 and Q2; default the order of the mesh's geometry.

    Attributes
    ----------
    space : Discretisation
    contact : ContactNodes
    A : scipy.sparse, shape (n, n)
        Stiffness of the free unknowns in x and y.
    f0, f1 : ndarray, shape (n,)
        Load at alpha = 0 and per unit of alpha, with the effect of prescribed displacements.
    free, held : ndarray of int
        Unknowns of the equations, and prescribed unknowns; unknown 2 k + a is component a of node
        k. The tangential unknown of a guided contact node is free and held: prescribed as zero,
        with an equation for the zero, so that every contact node has two equations.

    Raises
    ------
    InvalidInputError
        If the mesh has inverted elements, a name is unknown, a boundary is empty, the contact
        boundary overlaps a clamped boundary, a rigid motion is free, or a value does not fit.

    Examples
    --------
    >>> import skfem
    >>> from pwscont import explore
    >>> from pwscont_coulomb.elastic import ContactBoundary, ElasticBody, Support, Young
    >>> body = ElasticBody(
    ...     skfem.MeshQuad.init_tensor([0.0, 1.0, 2.0], [0.0, 1.0]).with_defaults(),
    ...     Young(E=1.0, nu=0.3),
    ...     supports=[Support("top", constant=(0.0, -0.01), growing=(0.01, 0.0))],
    ...     contact=ContactBoundary("bottom", friction=0.3),
    ... )
    >>> explore(body.condensed().along_load(), (0.0, 1.0)).count(0.5)
    1
    """

    def full(self) -> FullProblem:
        """Return the contact problem with all free unknowns, sparse."""
        return FullProblem(self)

    def condensed(self, elimination: Elimination | None = None) -> CondensedProblem:
        """Return the contact problem with the interior eliminated, dense of size 2 p.

        Parameters
        ----------
        elimination : Elimination, optional
            The way to eliminate; default :class:`~pwscont_coulomb.elastic.Multifrontal`.
        """
        return CondensedProblem(self, elimination)
