"""A piecewise-linear problem as a list of blocks with options to choose from.

With y the unknowns, every block (a contact node, say) contributes a set of
equations ``E y + e = 0`` and inequalities ``G y + g >= 0``. Equations common to all cells are
eliminated beforehand, which leaves as many unknowns as the blocks have equations: two for each
contact node, however many displacements the body has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
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
from pwscont.linear.balance import balanced
from pwscont.system.box import Box
from pwscont.system.contract import residual_at
from pwscont.system.promises import (
    check_blocks,
    checked_necessary,
    refuse_bent,
    refuse_bent_tests,
)
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
    """A slice of a system in numbers: rows of H for every mode, and the tests."""

    #: dH/dz, shape (n, n), and H at z = 0, shape (n,), with every block in mode k.
    rows: list[tuple[Array, Array]]
    tests: tuple[Array, Array]  # gradients by z, shape (m, n), and values at z = 0, shape (m,)
    blocks: tuple[Block, ...]
    bounding: list[list[list[int]]]  # for every mode of every block, the tests that bound the mode

    @classmethod
    def of(cls, system: SlicewiseLinearSystem, alpha: float, scale: Array) -> Table:
        """Evaluate a system at z = 0, and check at typical magnitudes that the system is affine."""
        *rows, (K, tests) = affine_forms(system, alpha, np.append(scale, 0.0))
        blocks = system.blocks()
        bounds = [[bounding(system, b, mode, len(tests)) for mode in b.modes] for b in blocks]
        return cls([(J[:, :-1], r) for J, r in rows], (K[:, :-1], tests), blocks, bounds)


def affine_forms(
    system: SlicewiseLinearSystem, alpha: float, reach: Array
) -> list[tuple[Array, Array]]:
    """Return the matrices and constants of H in every mode, and of the tests, as functions of x.

    Parameters
    ----------
    system : SlicewiseLinearSystem
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

    Raises
    ------
    InvalidSystemError
        If H or a test is not affine over ``reach``.

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


def reduce(system: SlicewiseLinearSystem, scale: Array, alpha: float) -> Problem | None:
    """Return the slice of a system at ``alpha`` as a reduced problem, None if without solution.

    ``scale``, shape (n,): typical magnitudes of z; the reduced unknowns are of the order of 1.
    """
    forms = [(J[:, :-1], r) for J, r in affine_forms(system, alpha, np.append(scale, 0.0))]
    return problem_of(system, forms, checked_necessary(system, alpha), scale)


def problem_with_alpha(system: PiecewiseLinearSystem, metric: Metric) -> Problem | None:
    """Return the problem for the unknowns (z, alpha - lo), None for a problem without solution.

    The inequality alpha >= lo is the last of the lower bounds.
    """
    (lo, hi), box = metric.interval, Box.of(system)
    reach = np.append(metric.scale[:-1], hi - lo)
    least, most = np.append(box.lower, 0.0), np.append(box.upper, hi - lo)
    unit, below, above = np.eye(len(reach)), np.isfinite(least), np.isfinite(most)
    within = np.vstack([unit[below], -unit[above]]), np.append(-least[below], most[above])
    return problem_of(system, affine_forms(system, lo, reach), within, reach)


def problem_of(
    system: SlicewiseLinearSystem,
    affine: Sequence[tuple[Array, Array]],
    necessary: tuple[Array, Array],
    scale: Array,
) -> Problem | None:
    """Return a problem from affine forms of some unknowns, None if without solution.

    ``system``: the system that names blocks and bounding tests.
    ``affine``: matrices and constants as from :func:`affine_forms`. The first n of the N unknowns
    are z; parameters may follow.
    ``necessary``: matrix and constant of the functions that are never negative.
    ``scale``, shape (N,): typical magnitudes.
    """
    *slices, tests = affine
    blocks, m = system.blocks(), len(tests[1])
    owned = [row for block in blocks for row in block.rows]
    common = sorted(set(range(system.size)).difference(owned))
    eliminated = _eliminate(slices[0][0][common], slices[0][1][common], scale)
    if eliminated is None:
        return None
    origin, basis, growth = eliminated
    forms = [*((matrix[owned], vector[owned]) for matrix, vector in slices), tests, necessary]
    rows = np.vstack([matrix for matrix, _ in forms])
    reduced = _reduced(rows, np.concatenate([vector for _, vector in forms]), origin, basis)
    cuts = [0, *accumulate(len(vector) for _, vector in forms)]
    *equations, (G, g), (A, b) = (
        tuple(part[first:end] for part in reduced) for first, end in pairwise(cuts)
    )

    def option(block: Block, first: int, k: int) -> Option:
        mode, own = block.modes[k], slice(first, first + len(block.rows))
        bounds = np.array(bounding(system, block, mode, m), dtype=np.intp)
        side = np.array([1.0 if mode[block.tests.index(i)] else -1.0 for i in bounds.tolist()])
        E, e = (part[own] for part in equations[k])
        signed = side[:, np.newaxis] * G[bounds], side * g[bounds]
        matrix = slices[k][0][list(block.rows)]
        return Option(block.tests, mode, bounds, side, E, e, *signed, matrix)

    options, first = list[list[Option]](), 0
    for block in blocks:
        options.append([option(block, first, k) for k in range(len(block.modes))])
        first += len(block.rows)
    options.sort(key=len)
    return Problem(options, A, b, origin, basis, slices[0][0][common], m, growth)


def _eliminate(C: Array, c: Array, scale: Array) -> tuple[Array, Array, float] | None:
    """Return a solution of C z + c = 0, a basis of the null space of C, and the condition of C.

    None without solution. Rows may depend on each other, as where a vanishing test is a further
    equation. Scaled unknowns and orthogonality make the basis well conditioned.
    """
    if not len(C):
        return np.zeros(len(scale)), np.diag(scale), 1.0
    lengths = np.linalg.norm(C * scale, axis=1)
    lengths[lengths == 0.0] = 1.0
    rows, rest = C * scale / lengths[:, np.newaxis], c / lengths
    tolerance, order = GUARD * EPS * len(scale), np.arange(len(C))
    Q, R = np.linalg.qr(rows.T, mode="complete")
    if np.abs(np.diagonal(R)).min() <= tolerance:
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


def bounding(
    system: SlicewiseLinearSystem, block: Block, mode: tuple[bool, ...], tests: int
) -> list[int]:
    """Return the tests of a block that bound the cell in a mode."""
    character = Character([True] * tests).with_signs(block.tests, mode)
    return [i for i in system.bounding_tests(character) if i in block.tests]


def _reduced(matrix: Array, vector: Array, origin: Array, basis: Array) -> tuple[Array, Array]:
    """Return matrix @ basis with unit rows, and matrix @ origin + vector divided alike.

    A row below the rounding of the terms of the row is made zero: such a row does not depend on the
    reduced unknowns.
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

    Where the user gives no magnitudes, the magnitudes balance the terms of all rows and tests, so
    that other units change nothing. A constant is as large as the part that alpha brings: the sum
    may be zero.
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
