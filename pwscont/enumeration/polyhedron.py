"""Polyhedra as exact as rounding allows, by linear programs of scipy's HiGHS.

Failure modes and answers
-------------------------
- A solver lets inequalities be violated by 1e-10 at best, which may be all there is of a thin
  polyhedron: iterative refinement (Gleixner, Steffy and Wolter, INFORMS J. Comput. 28, 2016). What
  is left of every inequality at the point found is magnified, and the program solved again for the
  rest of the way.
- A polyhedron without interior, such as a segment of the plane: the inequalities that hold with
  equality only have multipliers, and what they leave is looked at as a polyhedron of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Any, final

import numpy as np
from scipy.linalg import null_space

from pwscont.basics.arrays import Array

#: Of HiGHS: its least tolerances, and no presolve, which fails where there is no largest value.
TIGHT = {
    "primal_feasibility_tolerance": 1e-10,
    "dual_feasibility_tolerance": 1e-10,
    "presolve": False,
}
#: By how much what is left is magnified: then the tolerance is rounding.
MAGNIFIED = (1.0, 2.0**16)
#: What scipy calls a program without a largest value.
UNBOUNDED = 3
#: Of multipliers whose sum is one, those that are not nothing.
SOME = 1e-6
#: Points where inequalities vanish are tried up to this number.
MOST_CORNERS = 2000
#: Rows with a smaller determinant are as good as parallel.
PARALLEL = 1e-10
#: A point is well inside where inequalities hold by this part of its size.
SLACK = 1e-5
#: No direction is shorter.
TINY = float(np.finfo(float).tiny)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Polyhedron:
    """The points {w : matrix w + vector >= 0}.

    Attributes
    ----------
    matrix : ndarray, shape (k, q)
    vector : ndarray, shape (k,)
    """

    matrix: Array
    vector: Array

    @classmethod
    def of(cls, matrix: Array, vector: Array, rounding: float) -> Polyhedron | None:
        """Return a polyhedron without inequalities that hold everywhere, None if one holds nowhere.

        Parameters
        ----------
        rounding : float
            Below this a row of the matrix does not depend on w.
        """
        moves = np.abs(matrix).max(axis=1, initial=0.0) > rounding
        if (vector[~moves] < -rounding).any():
            return None
        return cls(matrix[moves], vector[moves])

    def moved(self, point: Array) -> Polyhedron:
        """Return the same polyhedron with a point as its origin."""
        return Polyhedron(self.matrix, self.vector + self.matrix @ point)

    def farthest(self, way: Array) -> Array | None:
        """Return a point with the largest ``way @ w``, None if there is none or no end."""
        found = self._largest(way)
        return None if found is None else found[0]

    def is_unbounded(self, way: Array) -> bool:
        """Tell whether there is no largest ``way @ w``."""
        return bool(self._program(way, self.vector).status == UNBOUNDED)

    def inside(self, rounding: float) -> tuple[Array, Array] | None:
        """Return a point inside and, shape (q, d), an orthonormal basis of the directions there.

        There are d < q of them where inequalities hold with equality only. None if no point
        satisfies all of them.

        Parameters
        ----------
        rounding : float
            By how much inequalities may be off.
        """
        if self.matrix.shape[1] == 1:
            return self._inside_line(rounding)
        corners = self._nearly_corners(rounding)
        if corners is not None and not len(corners):
            return None  # one that has no line has a corner, or is empty
        if corners is not None:
            middle = corners.mean(axis=0)
            if self._is_well_inside(middle, rounding):
                return middle, np.eye(len(middle))
        (k, q), last = self.matrix.shape, np.eye(self.matrix.shape[1] + 1)[-1]
        rows = np.vstack([np.column_stack([self.matrix, -np.ones(k)]), -last])
        found = Polyhedron(rows, np.append(self.vector, 1.0))._largest(last)
        if found is None:
            return None
        point, multipliers = found[0][:q], found[1][:k]
        least = (self.matrix @ point + self.vector).min(initial=1.0)
        off = rounding * (1.0 + np.abs(point).max(initial=0.0))
        if least > off:
            return point, np.eye(q)
        return None if least < -off else self._flat(point, multipliers > SOME, rounding)

    def _nearly_corners(self, rounding: float) -> Array | None:
        """Return points where some inequalities vanish and all hold, but for rounding.

        None where there are too many to try, or the polyhedron may hold a whole line.
        """
        k, q = self.matrix.shape
        if comb(k, q) > MOST_CORNERS or np.linalg.matrix_rank(self.matrix) < q:
            return None
        rows = np.array([*combinations(range(k), q)])
        sizes = np.abs(np.linalg.det(self.matrix[rows]))
        rows, sizes = rows[sizes > PARALLEL], sizes[sizes > PARALLEL]
        if not len(rows):
            return None
        points = np.linalg.solve(self.matrix[rows], -self.vector[rows][..., np.newaxis])[..., 0]
        slack = rounding * (1.0 + np.abs(points).max(axis=1)) / sizes
        holds = points @ self.matrix.T + self.vector >= -slack[:, np.newaxis]
        return np.asarray(points[holds.all(axis=1)])

    def _is_well_inside(self, point: Array, rounding: float) -> bool:
        off = SLACK * (1.0 + np.abs(point).max()) + rounding
        return bool((self.matrix @ point + self.vector > off).all())

    def ends(self) -> tuple[float, float]:
        """Return the least and the largest w where there is one dimension."""
        slopes, values = self.matrix[:, 0], self.vector
        rises, falls = slopes > 0.0, slopes < 0.0
        lo = (-values[rises] / slopes[rises]).max(initial=-np.inf)
        return float(lo), float((-values[falls] / slopes[falls]).min(initial=np.inf))

    def _inside_line(self, rounding: float) -> tuple[Array, Array] | None:
        """Return :meth:`inside` where there is one dimension."""
        lo, hi = self.ends()
        finite = [end for end in (lo, hi) if np.isfinite(end)]
        steepest = np.abs(self.matrix).min(initial=1.0)
        off = rounding * (1.0 + max(map(abs, finite), default=0.0)) / steepest
        if hi - lo < -off:
            return None
        middle = sum(finite) / len(finite) if finite else 0.0
        if hi - lo <= off:
            return np.array([middle]), np.zeros((1, 0))
        beside = float(np.isneginf(lo)) * -1.0 + float(np.isposinf(hi))
        return np.array([middle + beside]), np.eye(1)

    def _flat(self, point: Array, equal: Any, rounding: float) -> tuple[Array, Array] | None:
        """Return the inside of what is left where some inequalities hold with equality."""
        basis = null_space(self.matrix[equal])
        if not basis.shape[1]:
            return point, basis
        others = self.matrix[~equal] @ basis, self.moved(point).vector[~equal]
        rest = Polyhedron.of(*others, rounding)
        found = rest and rest.inside(rounding)
        return found and (point + basis @ found[0], basis @ found[1])

    def _largest(self, way: Array) -> tuple[Array, Array] | None:
        """Return a point with the largest ``way @ w``, and the multipliers of the inequalities."""
        point, way = np.zeros(len(way)), way / max(float(np.abs(way).max()), TINY)
        multipliers = np.zeros(len(self.vector))
        for factor in MAGNIFIED:
            found = self._program(way, factor * self.moved(point).vector)
            if found.x is None:
                return None if factor == 1.0 else (point, multipliers)
            point, multipliers = point + found.x / factor, -found.ineqlin.marginals
        return point, multipliers

    def _program(self, way: Array, vector: Array) -> Any:
        """Return scipy's answer for the largest ``way @ w`` with matrix w + vector >= 0."""
        from scipy.optimize import linprog  # noqa: PLC0415  it takes as long to import as all the rest

        free, A = [(None, None)] * len(way), -self.matrix
        return linprog(-way, A_ub=A, b_ub=vector, bounds=free, method="highs", options=TIGHT)
