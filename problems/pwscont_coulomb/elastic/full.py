"""The contact problem with all free unknowns of the mesh."""

from __future__ import annotations

from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array
from pwscont_coulomb.body import ContactBody
from pwscont_coulomb.elastic.discretised_body import DiscretisedBody
from pwscont_coulomb.elastic.problem import ElasticProblem
from pwscont_coulomb.load_paths import AffineLoad


@final
class FullProblem(ElasticProblem):
    """A sparse contact problem in u_x, u_y of all free nodes.

    Parameters
    ----------
    elastic : DiscretisedBody

    Examples
    --------
    >>> from pwscont_coulomb.elastic import FullProblem
    >>> from pwscont_coulomb.elastic.scenes import triangle
    >>> isinstance(triangle().build().full(), FullProblem)
    True
    """

    def __init__(self, elastic: DiscretisedBody) -> None:
        contact, p = elastic.contact, elastic.contact.count
        n = len(elastic.free)
        picks = sp.csr_matrix(
            (np.ones(2 * p), (np.arange(2 * p), elastic.contact_unknowns)), shape=(2 * p, n)
        )
        rotated = (contact.rotation() @ picks).tocsr()
        self.elastic = elastic
        self.body = ContactBody(elastic.A, rotated[:p], rotated[p:], contact.gap, contact.guided)
        self.load = AffineLoad(elastic.f0, elastic.f1)
        self.friction = contact.friction

    def displacements(self, z: Array, alpha: float) -> Array:
        """Return the displacements of all nodes, shape (k, 2)."""
        return self.elastic.all_displacements(z[: self.body.n], alpha)
