"""Systems that are affine between kinks, as matrices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
import scipy.sparse as sp

from pwscont import (
    BandedJacobian,
    Block,
    Character,
    InvalidInputError,
    InvalidSystemError,
    PiecewiseLinearSystem,
)
from pwscont.extending import Array, ExactData, ExactMode, Indices, Matrix, Signs
from pwscont.notation.layout import Layout
from pwscont.notation.notated import Given, Notated

#: Matrices of at most this number of entries, zeros included, are stored dense.
SMALL = 10_000
#: Matrices in which at least this part of all entries is nonzero are stored dense.
DENSE = 0.1
#: Matrices with more diagonals than this part of the number of rows are not stored as banded.
THIN = 0.1


def stored(matrix: Matrix) -> Matrix:
    """Return a sparse matrix in the cheaper form: sparse, or dense and read-only."""
    if np.prod(matrix.shape) > SMALL and matrix.nnz < DENSE * np.prod(matrix.shape):
        return matrix
    whole = matrix.toarray()
    whole.flags.writeable = False
    return whole


@final
class RowChoice:
    """Affine rows with several modes each; the caller chooses a mode for every row.

    Parameters
    ----------
    modes : sequence of (csr array, ndarray), shapes (n, n + 1) and (n,)
        The coefficients and constants of all rows, for each mode.
    """

    def __init__(self, modes: Sequence[tuple[Matrix, Array]]) -> None:
        #: The rows of all modes, one mode after the other.
        self._all = stored(sp.vstack([matrix for matrix, _ in modes], "csr"))
        self._rests = np.concatenate([rest for _, rest in modes])
        self._numbers = np.arange(len(modes[0][1]))
        self._bands = _Bands.of(modes) if sp.issparse(self._all) else None

    def rows(self, modes: Indices) -> Matrix:
        """Return the coefficients of the rows in given modes, shape (n, n + 1)."""
        if self._bands is not None:
            return self._bands.rows(modes)
        return self._all[modes * len(self._numbers) + self._numbers]

    def values(self, modes: Indices, x: Array) -> Array:
        """Return the values of the rows in given modes at x, shape (n,)."""
        values = self._all @ x + self._rests
        chosen: Array = values[modes * len(self._numbers) + self._numbers]
        return chosen


@final
class _Bands:
    """The rows of banded matrices."""

    def __init__(self, bands: Array, columns: Array, lower: int, upper: int) -> None:
        self._bands, self._columns, self._lower, self._upper = bands, columns, lower, upper
        n = columns.shape[1]
        self._numbers = np.arange(n)
        #: The row and the diagonal of each entry of the bands.
        rows = self._numbers + np.arange(-upper, lower + 1)[:, np.newaxis]
        self._rows = np.clip(rows, 0, n - 1)
        self._diagonals = np.arange(lower + upper + 1)[:, np.newaxis]

    @classmethod
    def of(cls, modes: Sequence[tuple[Matrix, Array]]) -> _Bands | None:
        """Return the bands of the matrices of all modes, None if the matrices are not narrow."""
        lower, upper = _width(modes)
        if lower + upper + 1 > THIN * len(modes[0][1]):
            return None
        bands = [_bands(matrix[:, :-1].tocoo(), lower, upper) for matrix, _ in modes]
        columns = [matrix[:, [-1]].toarray()[:, 0] for matrix, _ in modes]
        return cls(np.array(bands), np.array(columns), lower, upper)

    def rows(self, modes: Indices) -> BandedJacobian:
        """Return the rows in given modes as a banded matrix."""
        bands = self._bands[modes[self._rows], self._diagonals, self._numbers]
        column = self._columns[modes, self._numbers]
        return BandedJacobian(bands, self._lower, self._upper, column)


def _width(modes: Sequence[tuple[Matrix, Array]]) -> tuple[int, int]:
    """Return the numbers of diagonals below and above the main diagonal, over all modes."""
    lower = upper = 0
    for matrix, _ in modes:
        entries = matrix[:, :-1].tocoo()
        apart = entries.row - entries.col
        lower, upper = max(lower, apart.max(initial=0)), max(upper, (-apart).max(initial=0))
    return int(lower), int(upper)


def _bands(entries: Any, lower: int, upper: int) -> Array:
    """Return the diagonals of a sparse matrix in the storage of :class:`BandedJacobian`."""
    bands = np.zeros((lower + upper + 1, entries.shape[1]))
    bands[upper + entries.row - entries.col, entries.col] = entries.data
    return bands


#: Why the rows of a formula may not be the numbers of the formula.
SMALLER = "a product of coefficients of the function is too small for a double; choose other units"
ROUNDED = (
    "the function takes plain numbers only: its coefficients are rounded differences of values"
)
CROSSING = "bounds of sw.clip may cross, for their difference depends on z"
#: Number of cells whose matrices are kept: several cells take turns around a transition.
KEPT = 4


@final
@dataclass(frozen=True, slots=True, eq=False)
class SystemRows:
    """A system of rows ``A x + a`` with x = (z, alpha), all unknowns in z.

    Attributes
    ----------
    hidden : ndarray of int
        The numbers of the switches that are unknowns.
    owner : ndarray of int, shape (size,)
        The switch that chooses each row, -1 for none.
    modes : list of (csr array, ndarray)
        Entry k has all rows with every switch in mode k.
    tests, branches : (csr array, ndarray)
    value : (csr array, ndarray)
        The value of each switch at solutions, shape (number of switches, size + 1).
    is_lossy : bool
        Whether a product of coefficients is too small for a double.
    """

    hidden: Indices
    owner: Indices
    modes: list[tuple[Matrix, Array]]
    tests: tuple[Matrix, Array]
    branches: tuple[Matrix, Array]
    value: tuple[Matrix, Array]
    is_lossy: bool


def assembled(matrix: Matrix, rest: Array, size: int, layout: Layout) -> SystemRows:
    """Return the rows of a system from the coefficients of the user's function.

    A switch that stands in a single equation and in no argument of another switch is put into the
    equation, which then has the modes of the switch. Any further switch becomes an unknown with the
    row y - branch. Neither way changes det(dH/dz).
    """
    m, count = layout.number_of_tests, layout.count
    absorbed = _absorbed(matrix, size, count)
    hidden = np.setdiff1d(np.arange(count), absorbed)
    kept = np.concatenate([np.arange(size), size + hidden, [size + count]])
    parts = np.split(np.arange(len(rest)), [size, size + m])
    (F, f), (T, t), (B, b) = ((matrix[p][:, kept].tocsr(), rest[p]) for p in parts)
    own = matrix[:size][:, size : size + count].tocsr()
    factor = np.array([own[i, j] if j >= 0 else 0.0 for i, j in enumerate(absorbed)])
    unit = sp.eye_array(len(hidden), len(kept), k=size, format="csr")
    owner = np.concatenate([absorbed, hidden])
    modes, is_lossy = [], False
    for mode in range(layout.most_modes):
        place = layout.branches[:, mode]
        taken = place[absorbed] if count else np.zeros(size, dtype=np.intp)
        top = (F + sp.diags_array(factor) @ B[taken], f + factor * b[taken]) if count else (F, f)
        bottom = (unit - B[place[hidden]], -b[place[hidden]])
        whole = sp.vstack([top[0], bottom[0]], "csr")
        whole.eliminate_zeros()
        is_lossy |= _underflows(factor, B[taken], b[taken]) if count else False
        modes.append((whole, np.append(top[1], bottom[1])))
    value = _values(F, f, unit, hidden, absorbed, factor, count)
    return SystemRows(hidden, owner, modes, (T, t), (B, b), value, is_lossy)


def _underflows(factor: Array, B: Matrix, b: Array) -> bool:
    """Tell whether a product of numbers that are not zero is too small for a double."""
    sizes = abs(sp.hstack([B, sp.csr_array(b[:, np.newaxis])], "csr"))
    products = sp.diags_array(np.abs(factor)) @ sizes >= np.finfo(float).tiny
    nonzero = sp.diags_array((factor != 0.0).astype(float)) @ sizes > 0.0
    return bool(products.sum() < nonzero.sum())


def _absorbed(matrix: Matrix, size: int, count: int) -> Indices:
    """Return for each equation the switch that is put into the equation, -1 for none."""
    by_switch = (matrix[:, size : size + count] != 0.0).tocsc()
    absorbed = np.full(size, -1)
    for switch in range(count):
        rows = by_switch.indices[by_switch.indptr[switch] : by_switch.indptr[switch + 1]]
        if len(rows) == 1 and rows[0] < size and absorbed[rows[0]] < 0:
            absorbed[rows[0]] = switch
    return absorbed


def _values(
    F: Matrix, f: Array, unit: Matrix, hidden: Indices, absorbed: Indices, factor: Array, count: int
) -> tuple[Matrix, Array]:
    """Return coefficients and constants of the values of all switches at solutions."""
    values, rest = sp.lil_array((count, F.shape[1])), np.zeros(count)
    if len(hidden):
        values[hidden] = unit
    rows = np.flatnonzero(absorbed >= 0)
    if len(rows):
        values[absorbed[rows]] = sp.diags_array(-1.0 / factor[rows]) @ F[rows]
        rest[absorbed[rows]] = -f[rows] / factor[rows]
    return values.tocsr(), rest


@final
class SwitchedLinearSystem(Notated, PiecewiseLinearSystem, ExactData):
    """A piecewise-linear system written with switches; made by :func:`pwscont.Switched`."""

    #: Makes the system anew with a switch for each call of sw, if several calls are one switch.
    again: Callable[[], SwitchedLinearSystem] | None = None
    #: Why the rows are not the numbers of the formula; empty for rows that are.
    inexact = ""

    def __init__(
        self, size: int, layout: Layout, rows: SystemRows, given: Given, own: dict[int, int]
    ) -> None:
        super().__init__(size, layout, rows.hidden, given, own)
        self._rows, self.inexact = rows, SMALLER if rows.is_lossy else ""
        self._chosen = RowChoice(rows.modes)
        self._tests, self._test_values = stored(rows.tests[0]), rows.tests[1]
        self._switched = np.flatnonzero(rows.owner >= 0)
        #: The matrices of the last cells.
        self._known: dict[bytes, Matrix] = {}
        self.domain = self._ordered()

    def told_apart(self) -> SwitchedLinearSystem:
        """Return the system with a switch of its own for each call of sw."""
        return self.again() if self.again else self

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a pickle, without the function of the user."""
        return self.__dict__ | {"again": None}

    def _ordered(self) -> tuple[float, float]:
        """Return the alphas (lo, hi) at which no lower bound of a clip is above the upper bound.

        Bounds that depend on z do not count.
        """
        three, (T, t) = self._layout.three, self._rows.tests
        first, last = self._layout.first_tests[three], self._layout.last_tests[three]
        widths, rest = (T[first] - T[last]).toarray(), t[first] - t[last]
        self.inexact = self.inexact or CROSSING * bool(widths[:, :-1].any())
        rising = ~widths[:, :-1].any(axis=1) & (widths[:, -1] != 0.0)
        slopes, rest = widths[rising, -1], rest[rising]
        zeros = -rest / slopes
        lo, hi = zeros[slopes > 0.0].max(initial=-np.inf), zeros[slopes < 0.0].min(initial=np.inf)
        if lo > hi:
            raise InvalidSystemError("a lower bound of sw.clip is above the upper one at all alpha")
        return float(lo), float(hi)

    def test_functions(self, z: Array, alpha: float) -> Array:
        """Return the values of the test functions of all switches at (z, alpha), shape (m,)."""
        values: Array = self._tests @ np.append(z, alpha) + self._test_values
        return values

    def test_jacobian(self, z: Array, alpha: float) -> Matrix:
        """Return the constant gradients of the tests."""
        return self._tests

    def residual(self, z: Array, alpha: float, character: Character) -> Array:
        """Return the user's equations, then the equations of the hidden unknowns, shape (size,)."""
        return self._chosen.values(self._modes_of_rows(character.array), np.append(z, alpha))

    def jacobian(self, z: Array, alpha: float, character: Character) -> Matrix:
        """Return the constant matrix of a cell; the matrices of the last cells are kept."""
        key = bytes(character)
        if (known := self._known.get(key)) is None:
            known = self._chosen.rows(self._modes_of_rows(character.array))
            if len(self._known) >= KEPT:
                self._known.pop(next(iter(self._known)), None)
            self._known[key] = known
        return known

    def _modes_of_rows(self, signs: Signs) -> Indices:
        modes = np.zeros(self.size, dtype=np.intp)
        modes[self._switched] = self._layout.modes(signs)[self._rows.owner[self._switched]]
        return modes

    def values_of_switches(self, z: Array, alpha: float) -> Array:
        """Return the value of each switch, call by call: later calls may use earlier values."""
        layout, (B, b), (T, t) = self._layout, self._rows.branches, self._rows.tests
        values, x = np.zeros(layout.count), np.zeros(self.size + 1)
        x[: self.shown], x[-1] = z, alpha
        for mine in layout.slices:
            modes = layout.modes(T @ x + t >= 0.0)
            values[mine] = layout.values(B @ x + b, modes)[mine]
            x[self.shown : -1] = values[self._rows.hidden]
        return values

    def blocks(self) -> tuple[Block, ...]:
        """Return a block for each switch, which owns a row."""
        rows = {int(switch): row for row, switch in enumerate(self._rows.owner) if switch >= 0}
        return tuple(
            Block(self._layout.tests_of(switch), (rows[switch],), self._layout.signs(switch))
            for switch in range(self._layout.count)
        )

    def exact_rows(self, alpha: float) -> tuple[Array, list[list[ExactMode]]]:
        """Return the rows that no switch chooses, and those of every mode of every switch.

        Raises
        ------
        InvalidInputError
            If the rows are differences of values, a product of coefficients is too small, or bounds
            of a clip may cross.
        """
        if self.inexact:
            raise InvalidInputError(f"{self.inexact}: nothing can be proved")
        dense = [np.column_stack([A.toarray(), a]) for A, a in self._rows.modes]
        tests = np.column_stack([self._rows.tests[0].toarray(), self._rows.tests[1]])
        parts = []
        for switch in range(self._layout.count):
            own, places = self._rows.owner == switch, self._layout.tests_of(switch)
            rows, modes = [each[own] for each in dense], []
            for mode, signs in enumerate(self._layout.signs(switch)):
                near = [i for i in (mode - 1, mode) if 0 <= i < len(signs)]
                given = [(tests[places[i]], rows[2 * i + 1 - mode], signs[i]) for i in near]
                sides = [_side(rows[mode], *each) for each in given]
                modes.append(ExactMode(rows[mode], np.array(sides)))
            parts.append(modes)
        return dense[0][self._rows.owner < 0], parts

    def exact_lines(self) -> tuple[Array, list[list[ExactMode]]]:
        """Return the rows, which hold at every alpha."""
        return self.exact_rows(0.0)

    def necessary(self, alpha: float) -> tuple[Matrix, Array]:
        """Return inequalities that hold in every mode, such as max(a, b) >= a."""
        A, b = self._necessary
        return A[:, :-1], b + alpha * A[:, -1]

    @cached_property
    def _necessary(self) -> tuple[Array, Array]:
        (B, b), (V, v) = self._rows.branches, self._rows.value
        sides = [
            (switch, self._layout.branches[switch, mode], side)
            for switch, operation in enumerate(self._layout.operations)
            for mode, side in enumerate(operation.sides)
            if side
        ]
        if not sides:
            return np.zeros((0, self.size + 1)), np.zeros(0)
        switch, branch, side = (np.array(column) for column in zip(*sides, strict=True))
        rows = sp.diags_array(side.astype(float)) @ (V[switch] - B[branch])
        return rows.toarray(), side * (v[switch] - b[branch])


def _side(row: Array, test: Array, other: Array, sign: bool) -> Array:
    """Return an inequality of a mode: the row of the next mode, where the test is a difference."""
    change = other - row
    is_plus, is_minus = (change == test).all(), (change == -test).all()
    side = other[0] if is_plus else -other[0] if is_minus else test  # differences are rounded
    return side if sign else -side
