"""A piecewise-linear problem as a list of blocks with options to choose from.

With y the unknowns, every block (a contact node, say) contributes a set of
equations ``E y + e = 0`` and inequalities ``G y + g >= 0``. Equations common to all cells are
eliminated beforehand, which leaves as many unknowns as the blocks have equations: two for each
contact node, however many displacements the body has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import final

import numpy as np
import scipy.linalg

from pwscont.basics.arrays import Array, Indices, generic, own_dense
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.magnitudes import rounded_to_one
from pwscont.curve.metric import LARGEST, SHORTEST, Metric
from pwscont.enumeration.echelon import MOST_WORK, independent
from pwscont.linear.factorise import balanced
from pwscont.system.box import Box
from pwscont.system.contract import residual_at
from pwscont.system.promises import check_blocks, refuse_bent, refuse_bent_tests
from pwscont.system.system import Block, PiecewiseLinearSystem, SlicewiseLinearSystem


@final
@dataclass(frozen=True, slots=True, eq=False)
class Option:
    """An option of a block: E y + e = 0 and G y + g >= 0."""

    tests: tuple[int, ...]  # the test functions that the block decides
    signs: tuple[bool, ...]  # the signs of these tests
    #: The tests of the block that bound the cell, and +1 or -1 for the signs of these tests, shape
    #: (t,).
    bounding: Indices
    side: Array
    E: Array  # shapes (k, d), (k,), (t, d), (t,); rows of E and G have unit length
    e: Array
    G: Array
    g: Array
    rows: Array  # the coefficients of the original unknowns in the equations, shape (k, N)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A slice of a system, reduced to the unknowns that blocks decide."""

    #: The options of each block; blocks with the fewest options come first.
    blocks: list[list[Option]]
    #: Shapes (l, d) and (l,): inequalities A y + b >= 0 that every solution satisfies, whatever the
    #: options.
    A: Array
    b: Array
    origin: Array  # the original unknowns are origin + basis @ y, shapes (n,) and (n, d)
    basis: Array
    #: Shape (c, n): the coefficients of the original unknowns in the equations common to all cells.
    common: Array
    tests: int  # number of test functions of the system
    #: The condition of the common equations, by which rounding may have grown in origin and basis.
    growth: float

    @property
    def dimension(self) -> int:
        """d, the number of reduced unknowns."""
        return int(self.basis.shape[1])

    def chosen(self, picks: Indices | tuple[int, ...]) -> list[Option]:
        """Return the options that a choice picks, by number, in the first blocks."""
        return [options[pick] for options, pick in zip(self.blocks, picks, strict=False)]

    def rank_added(self, picks: tuple[int, ...]) -> int | None:
        """Return how many equations of the last option picked are independent, exactly.

        None if the same question for all choices would take too long.
        """
        chosen = [option.rows for option in self.chosen(picks)]
        rows = np.vstack([self.common, *chosen])
        cells = prod(len(options) for options in self.blocks)
        if cells * len(rows) * rows.shape[1] ** 2 > MOST_WORK:
            return None
        return sum(independent(rows)[len(rows) - len(chosen[-1]) :])

    def character(self, picks: Indices) -> Character:
        """Return the character of a choice of an option per block."""
        character = Character([True] * self.tests)
        for option in self.chosen(picks):
            character = character.with_signs(option.tests, option.signs)
        return character


@final
@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A system in numbers: rows of H for every mode and the tests, affine in N unknowns.

    The first n unknowns are z; parameters may follow.
    """

    #: Matrix, shape (n, N), and constant, shape (n,), of H with every block in mode k.
    rows: list[tuple[Array, Array]]
    tests: tuple[Array, Array]  # matrix, shape (m, N), and constant, shape (m,), of the tests
    blocks: tuple[Block, ...]
    bounding: list[list[list[int]]]  # for every mode of every block, the tests that bound the mode

    @classmethod
    def of(cls, system: SlicewiseLinearSystem, forms: Sequence[tuple[Array, Array]]) -> Table:
        """Return forms as from :func:`affine_forms` with the blocks and bounding tests."""
        *rows, tests = forms
        all_true, blocks = Character([True] * len(tests[1])), system.blocks()

        def bounding(block: Block, mode: tuple[bool, ...]) -> list[int]:
            character = all_true.with_signs(block.tests, mode)
            return [i for i in system.bounding_tests(character) if i in block.tests]

        bounds = [[bounding(block, mode) for mode in block.modes] for block in blocks]
        return cls(rows, tests, blocks, bounds)

    @classmethod
    def at(cls, system: SlicewiseLinearSystem, alpha: float, scale: Array) -> Table:
        """Return a slice of a system, by z alone; refuse a system that is not affine there.

        ``scale``, shape (n,): typical magnitudes of z.
        """
        forms = affine_forms(system, alpha, np.append(scale, 0.0))
        return cls.of(system, [(matrix[:, :-1], constant) for matrix, constant in forms])


def affine_forms(
    system: SlicewiseLinearSystem, alpha: float, reach: Array
) -> list[tuple[Array, Array]]:
    """Return the matrices and constants of H in every mode, and of the tests, as functions of x.

    Parameters
    ----------
    system : SlicewiseLinearSystem
        Refused if H or a test is not affine over ``reach``.
    alpha : float
        The forms count from the point z = 0 at ``alpha``.
    reach : ndarray, shape (n + 1,)
        Typical magnitudes of z, and the change of alpha over which the forms hold: 0 for a system
        that is affine in z only.

    Returns
    -------
    list of (ndarray, ndarray)
        Matrix, shape (n, n + 1), and constant, shape (n,), of H with every block in mode k, or in
        the last mode of the block; then, as the last form, matrix and constant of the m tests.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import LCP
    >>> from pwscont.extending import affine_forms
    >>> forms = affine_forms(LCP([[2.0]], q=[-1.0], d=[1.0]), 0.0, np.array([1.0, 1.0]))
    >>> len(forms)  # two modes, and the tests
    3
    """
    x, blocks = np.append(np.zeros(system.size), alpha), system.blocks()
    dx = reach * np.append(np.abs(generic(system.size)), 1.0)
    tests = np.array(system.test_functions(x[:-1], alpha), dtype=float)
    check_blocks(system, len(tests))
    K = own_dense(system.test_jacobian(x[:-1], alpha))
    refuse_bent_tests(system, x, dx, tests, K)
    forms, all_true = list[tuple[Array, Array]](), Character([True] * len(tests))
    for k in range(max((len(block.modes) for block in blocks), default=1)):
        character = all_true
        for block in blocks:
            mode = block.modes[min(k, len(block.modes) - 1)]
            character = character.with_signs(block.tests, mode)
        jacobian = own_dense(system.jacobian(x[:-1], alpha, character))
        residual = residual_at(system, x[:-1], alpha, character)
        refuse_bent(system, character, x, dx, residual, jacobian)
        forms.append((jacobian, residual))
    return [*forms, (K, tests)]


def problem_with_alpha(system: PiecewiseLinearSystem, metric: Metric) -> Problem | None:
    """Return the problem for the unknowns (z, alpha - lo), None for a problem without solution.

    The inequality alpha >= lo is the last of the lower bounds.
    """
    (lo, hi), box = metric.interval, Box.of(system)
    reach = np.append(metric.scale[:-1], hi - lo)
    least, most = np.append(box.lower, 0.0), np.append(box.upper, hi - lo)
    unit, below, above = np.eye(len(reach)), np.isfinite(least), np.isfinite(most)
    within = np.vstack([unit[below], -unit[above]]), np.append(-least[below], most[above])
    return problem_of(Table.of(system, affine_forms(system, lo, reach)), within, reach)


def problem_of(table: Table, necessary: tuple[Array, Array], scale: Array) -> Problem | None:
    """Return a table as a problem in reduced unknowns of the order of 1, None if without solution.

    ``necessary``: matrix and constant of the functions that are never negative.
    ``scale``, shape (N,): typical magnitudes.
    """
    slices = table.rows
    owned = [row for block in table.blocks for row in block.rows]
    common = sorted(set(range(len(slices[0][1]))).difference(owned))
    eliminated = _eliminate(slices[0][0][common], slices[0][1][common], scale)
    if eliminated is None:
        return None
    origin, basis, growth = eliminated
    forms = [*((matrix[owned], vector[owned]) for matrix, vector in slices), table.tests, necessary]
    *equations, (G, g), (A, b) = (_reduced(*form, origin, basis) for form in forms)

    def option(block: Block, first: int, k: int, tests: list[int]) -> Option:
        mode, own = block.modes[k], slice(first, first + len(block.rows))
        bounds = np.array(tests, dtype=np.intp)
        side = np.array([1.0 if mode[block.tests.index(i)] else -1.0 for i in tests])
        E, e = (part[own] for part in equations[k])
        signed = side[:, np.newaxis] * G[bounds], side * g[bounds]
        matrix = slices[k][0][list(block.rows)]
        return Option(block.tests, mode, bounds, side, E, e, *signed, matrix)

    options, first = list[list[Option]](), 0
    for block, bounding in zip(table.blocks, table.bounding, strict=True):
        options.append([option(block, first, k, tests) for k, tests in enumerate(bounding)])
        first += len(block.rows)
    options.sort(key=len)
    return Problem(options, A, b, origin, basis, slices[0][0][common], len(g), growth)


def _eliminate(C: Array, c: Array, scale: Array) -> tuple[Array, Array, float] | None:
    """Return a solution of C z + c = 0, a basis of the null space of C, and the condition of C.

    None without solution. Rows may depend on each other, as where a vanishing test is an equation.
    """
    if not len(C):
        return np.zeros(len(scale)), np.diag(scale), 1.0
    lengths = np.linalg.norm(C * scale, axis=1)
    lengths[lengths == 0.0] = 1.0
    rows, rest = C * scale / lengths[:, np.newaxis], c / lengths
    tolerance = GUARD * EPS * len(scale)
    Q, R, order = scipy.linalg.qr(rows.T, pivoting=True)
    rank = int((np.abs(np.diagonal(R)) > tolerance).sum())
    inner = np.linalg.solve(R[:rank, :rank].T, -rest[order[:rank]])
    beyond = R[:rank, rank:].T @ inner + rest[order[rank:]]
    size = np.abs(R[:rank, rank:]).T @ np.abs(inner) + np.abs(rest[order[rank:]])
    if (np.abs(beyond) > tolerance * (size + np.abs(inner).max(initial=0.0))).any():
        return None
    growth = 1.0 / float(np.abs(np.diagonal(R))[:rank].min(initial=1.0))
    decided, free = Q[:, :rank] @ inner, Q[:, rank:]
    # rounding is made zero, because other equations are measured by the size of these numbers
    decided[np.abs(decided) <= GUARD * EPS * np.abs(inner).max(initial=0.0)] = 0.0
    free[np.abs(free) <= GUARD * EPS] = 0.0
    return scale * decided, scale[:, np.newaxis] * free, growth


def _reduced(matrix: Array, vector: Array, origin: Array, basis: Array) -> tuple[Array, Array]:
    """Return matrix @ basis with unit rows, and matrix @ origin + vector divided alike.

    A row below the rounding of its terms does not depend on the reduced unknowns: it becomes zero.
    """
    rows, rest = matrix @ basis, vector + matrix @ origin
    terms = np.linalg.norm(np.abs(matrix) @ np.abs(basis), axis=1)
    lengths = np.linalg.norm(rows, axis=1)
    nothing = lengths <= GUARD * EPS * terms
    rows[nothing] = 0.0
    lengths[nothing] = (terms + np.abs(matrix) @ np.abs(origin) + np.abs(vector))[nothing]
    lengths[lengths == 0.0] = 1.0
    return rows / lengths[:, np.newaxis], rest / lengths


def measured_at(
    system: SlicewiseLinearSystem, alpha: float
) -> tuple[SlicewiseLinearSystem, Metric]:
    """Return a system with typical magnitudes at a single alpha, and the metric there.

    Magnitudes that the user does not give balance the terms of all rows and tests. A constant is as
    large as the part that alpha brings: the sum may be zero.
    """
    if system.gives_scale:
        return system, Metric.at(system, alpha)
    rows = list[Array]()
    for matrix, vector in affine_forms(system, alpha, np.zeros(system.size + 1)):
        known = np.where(np.isfinite(matrix), np.abs(matrix), 0.0)  # by alpha: may be infinite
        rows.append(np.column_stack([known, np.fmax(np.abs(vector), abs(alpha) * known[:, -1])]))
    terms = np.vstack(rows)
    terms[terms[:, -1] < np.finfo(float).tiny, -1] = 0.0  # without digits
    *of_z, width = balanced(terms, system.size + 1)[0].tolist()
    (low, high), step = system.domain, max(1.0, abs(alpha))
    lo, hi = (alpha, min(alpha + step, high)) if alpha < high else (max(alpha - step, low), alpha)
    fitted = system.within(lo, hi, rounded_to_one(np.array(of_z)))
    return fitted, Metric.at(fitted, alpha, min(max(width, SHORTEST), LARGEST))
