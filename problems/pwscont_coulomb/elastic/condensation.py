"""The contact problem in the displacements of the contact nodes alone.

The interior of a body never changes: the interior is eliminated once (docs/theory, F9), and the
contact unknowns are turned into normal and tangential displacements. The full field is recovered on
demand.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.extending import Array
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.elastic.arguments import check_kind
from pwscont_coulomb.elastic.contact_boundary import ContactNodes
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.elimination import Elimination
from pwscont_coulomb.elastic.multifrontal import Multifrontal
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.load_paths import AffineLoad


@final
class CondensedProblem(ElasticProblem):
    """A dense contact problem in the 2 p unknowns (u_nu of all contact nodes, then u_t of all).

    In these unknowns N = [I 0] and T = [0 I].

    Parameters
    ----------
    elastic : DiscretisedBody
    elimination : Elimination, optional
        Default :class:`~pwscont_coulomb.elastic.Multifrontal`.

    Raises
    ------
    InvalidInputError
        If ``elimination`` is no Elimination.

    Examples
    --------
    >>> from pwscont_coulomb.elastic import CondensedProblem
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> isinstance(triangle().build().condensed(), CondensedProblem)
    True
    """

    def __init__(self, elastic: DiscretisedBody, elimination: Elimination | None = None) -> None:
        chosen = Multifrontal() if elimination is None else elimination
        check_kind("elimination", chosen, Elimination)
        positions = elastic.positions[:, elastic.free // 2]
        self.elastic = elastic
        self._eliminated = chosen.eliminate(elastic.A, elastic.contact_unknowns, positions)
        self._rotation = elastic.contact.rotation()
        self.body = _body(self._turned(self._eliminated.schur), elastic.contact)
        loads = (self._rotation @ self._eliminated.reduce(f) for f in (elastic.f0, elastic.f1))
        self.load = AffineLoad(*loads)
        self.friction = elastic.contact.friction

    def _turned(self, schur: Array) -> Array:
        """Return the Schur complement in normal and tangential unknowns, symmetric to the bit."""
        half = self._rotation @ schur
        turned = self._rotation @ half.T
        symmetric: Array = 0.5 * (turned + turned.T)
        return symmetric

    def displacements(self, z: Array, alpha: float) -> Array:
        """Return the displacements of all nodes, shape (k, 2)."""
        kept = self._rotation.T @ z[: self.body.n]
        free = self._eliminated.recover(self.elastic.load(alpha), kept)
        return self.elastic.all_displacements(free, alpha)


def _body(stiffness: Array, contact: ContactNodes) -> ContactBody:
    picks, p = np.eye(len(stiffness)), contact.count
    return ContactBody(stiffness, picks[:p], picks[p:], contact.gap, contact.guided)
