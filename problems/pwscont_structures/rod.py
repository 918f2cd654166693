"""A rod that bends and does not stretch or shear, by quadratic finite elements for the angle.

With theta(s) the angle between rod and chord, x' = cos theta and w' = sin theta (Euler's elastica).
Integrals are sums over the Gauss points of the elements.
"""

from __future__ import annotations

from typing import final

import numpy as np

from pwscont.extending import Array

#: Gauss points of an element: integrands are trigonometric functions of parabolas.
POINTS = 4


@final
class Rod:
    """The finite elements of a rod of length 1.

    Parameters
    ----------
    elements : int

    Attributes
    ----------
    angle, curvature : ndarray, shape (q, n)
        From the angles at the n = 2 elements + 1 nodes to angle and curvature at q Gauss points.
    s, weights : ndarray, shape (q,)
        Place and weight of the Gauss points.
    """

    def __init__(self, elements: int) -> None:
        self.elements, self.n = elements, 2 * elements + 1
        xi, weights = np.polynomial.legendre.leggauss(POINTS)
        values = np.stack([xi * (xi - 1.0) / 2.0, 1.0 - xi**2, xi * (xi + 1.0) / 2.0], axis=1)
        slopes = np.stack([xi - 0.5, -2.0 * xi, xi + 0.5], axis=1)
        half = 0.5 / elements
        self.angle, self.curvature = self._spread(values), self._spread(slopes / half)
        self.weights = np.tile(half * weights, elements)
        self.s = (half * (xi + 1.0) + 2.0 * half * np.arange(elements)[:, np.newaxis]).ravel()

    def _spread(self, block: Array) -> Array:
        """Return the matrix of all elements from the rows of a single element."""
        matrix = np.zeros((self.elements * POINTS, self.n))
        for e in range(self.elements):
            matrix[e * POINTS : (e + 1) * POINTS, 2 * e : 2 * e + 3] = block
        return matrix

    def up_to(self, ends: Array) -> Array:
        """Return the weights of integrals from 0 to ends of elements, shape (k, q)."""
        return np.where(self.s < ends[:, np.newaxis], self.weights, 0.0)

    @property
    def nodes(self) -> Array:
        """The places of the nodes, shape (n,)."""
        return np.linspace(0.0, 1.0, self.n)
