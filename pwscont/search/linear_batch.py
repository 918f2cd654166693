"""Linear equations of many points in a batch, and the errors of the points by rounding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.rounding import EPS
from pwscont.curve.error_samples import samples

#: Largest condition number of equations that are solved in a batch: half of all digits are right.
WORST = EPS**-0.5


@final
@dataclass(frozen=True, slots=True, eq=False)
class LinearBatch:
    """A regular system of linear equations for each of k points, in typical magnitudes.

    Attributes
    ----------
    rows, inverse : ndarray, shape (k, l, l)
        The coefficients, the largest of each row being 1, and the inverse matrices.
    largest : ndarray, shape (k, l)
        The numbers by which the rows were divided.
    """

    rows: Array
    inverse: Array
    largest: Array

    @classmethod
    def of(cls, rows: Array, scale: Array) -> LinearBatch | None:
        """Return the equations with these coefficients of unknowns of these magnitudes.

        None if a matrix is nearly singular.
        """
        rows = rows * scale
        largest = np.abs(rows).max(axis=2)
        if not largest.all():
            return None
        rows /= largest[..., np.newaxis]
        try:
            inverse = np.asarray(np.linalg.inv(rows), dtype=float)
        except np.linalg.LinAlgError:
            return None
        condition = np.abs(rows).sum(axis=1).max(axis=1) * np.abs(inverse).sum(axis=1).max(axis=1)
        return cls(rows, inverse, largest) if (condition <= WORST).all() else None

    def among(self, some: Indices | slice) -> LinearBatch:
        """Return the equations of some of the points."""
        return LinearBatch(self.rows[some], self.inverse[some], self.largest[some])

    def solve(self, values: Array) -> Array:
        """Return the unknowns, shape (k, l), from right-hand sides of that shape."""
        unknowns: Array = (self.inverse @ (values / self.largest)[..., np.newaxis])[..., 0]
        return unknowns

    def errors(self, sizes: Array) -> Array:
        """Return samples of the errors of unknowns of these sizes, shape (k, number, l).

        The samples are defined as in :func:`~pwscont.curve.newton.uncertainty`.
        """
        rounding = EPS * (np.abs(self.rows) @ sizes[..., np.newaxis])
        found = self.inverse @ (rounding * samples(sizes.shape[1]).T)
        return np.swapaxes(found, 1, 2)

    def signs(self) -> Array:
        """Return the signs of the determinants, shape (k,)."""
        signs: Array = np.linalg.slogdet(self.rows)[0]
        return signs
