"""The equations of a circuit as matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import final

import numpy as np
import scipy.sparse as sp

from pwscont.extending import Array, Matrix
from pwscont_circuits.stamps import Stamps, Sum

#: Least number of entries of a sparse matrix: smaller matrices are faster as dense arrays.
SMALL = 10_000
#: The name of the parameter among the unknowns.
SWEPT = "swept"


@final
class Equations:
    """The rows A x + b - R max(0, C x - knots) with x = (z, alpha).

    Parameters
    ----------
    stamps : Stamps
    values : mapping of str to float
        The values of all sources except the source that is the parameter.
    """

    def __init__(self, stamps: Stamps, values: Mapping[str, float]) -> None:
        self._stamps, self._values = stamps, values
        self.place = {name: i for i, name in enumerate((*stamps.names, SWEPT))}
        self.knots = np.array([ramp.knot for ramp in stamps.ramps])

    @cached_property
    def A(self) -> Matrix:  # noqa: N802  the usual name
        """The linear part, shape (n, n + 1)."""
        rows: dict[str, Sum] = {name: [] for name in self._stamps.names}
        for row, unknown, factor in self._stamps.entries:
            rows[row].append((unknown, factor))
        for row, name, factor in self._stamps.sources:
            if name not in self._values:
                rows[row].append((SWEPT, factor))
        return self._matrix(list(rows.values()))

    @cached_property
    def b(self) -> Array:
        """The constant part, shape (n,)."""
        b = np.zeros(len(self._stamps.names))
        for row, value in self._stamps.constants:
            b[self.place[row]] += value
        for row, name, factor in self._stamps.sources:
            b[self.place[row]] += factor * self._values.get(name, 0.0)
        return b

    @cached_property
    def C(self) -> Matrix:  # noqa: N802
        """The control voltages of all ramps, shape (m, n + 1)."""
        return self._matrix([ramp.control for ramp in self._stamps.ramps])

    @cached_property
    def R(self) -> Matrix:  # noqa: N802
        """The changes of slope at all knots, shape (n, m)."""
        changes = [[(ramp.row, ramp.change)] for ramp in self._stamps.ramps]
        return self._matrix(changes)[:, :-1].T

    @cached_property
    def supports(self) -> tuple[Matrix, Array]:
        """Rows D and d with D x + d >= 0 at every operating point."""
        rests = np.array([rest for _, rest in self._stamps.supports])
        return self._matrix([terms for terms, _ in self._stamps.supports]), rests

    @cached_property
    def conductance(self) -> float:
        """The median of all conductances between nodes, 1.0 if there are none."""
        currents = set(self._stamps.currents)
        found = [abs(f) for row, name, f in self._stamps.entries if not currents & {row, name}]
        return float(np.median(found)) if found else 1.0

    def scale(self, swept: float) -> Array:
        """Return typical magnitudes of the unknowns while a source goes as far as ``swept``.

        All voltages have the magnitude of the largest given voltage, and all currents share a
        magnitude, too: many currents are zero, or too small to measure, over the whole sweep.
        """
        given = [*np.abs(self.knots), 0.0]
        for row, name, _ in self._stamps.sources:
            size = abs(self._values.get(name, swept))
            given.append(size if row in self._stamps.currents else size / self.conductance)
        voltage = float(max(given)) or 1.0
        sizes = len(self._stamps.nodes), len(self._stamps.currents)
        return np.repeat([voltage, voltage * self.conductance], sizes)

    def _matrix(self, rows: Sequence[Sum]) -> Matrix:
        """Return sums of unknowns as rows; entries that repeat are summed."""
        entries = [(i, self.place[name], f) for i, row in enumerate(rows) for name, f in row]
        i, j, factors = zip(*entries, strict=True) if entries else ((), (), ())
        shape = (len(rows), len(self.place))
        matrix = sp.csr_array((factors, (i, j)), shape=shape, dtype=float)
        return matrix.toarray() if len(self.place) ** 2 < SMALL else matrix
