"""Corners at which each vanishing test switches rows of its own: one factorisation for all cells.

There H'(x; d) = J d + sum_i c_i min(g_i . d, 0), where J belongs to one cell, in which all g_i . d
are positive, and the c_i come from the other selections (F1). With the null vector t of J, and
J w_i = c_i, each bordered by one more row, d = s t + sum_i v_i w_i, and what is left is a linear
complementarity problem of one row per test, with M = 1 + (g_i . w_j):

    y = s (g . t) + M v,  y >= 0,  v >= 0,  y . v = 0.

A cell is a choice of the v_i that do not vanish, and costs a solve of that size. Pairs of nodes
that change their modes together, as in symmetric bodies, are such corners.

Failure modes and answers
-------------------------
- Modes that differ by more than one test, as where a node both lifts off and begins to slip; a
  singular J; a matrix of a cell that is nearly singular, a slope that may be zero: the corner is
  left to the next way, :mod:`pwscont.transitions.corner.simple`.
- A direction found so does not fit the matrix of its cell: left to the next way, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from pwscont.basics.arrays import Array, Signs, dense, generic
from pwscont.basics.character import Character
from pwscont.basics.rounding import EPS, GUARD
from pwscont.curve.metric import Metric
from pwscont.curve.rank_one import by_columns
from pwscont.linear.factorise import bordered, last_unit
from pwscont.system.selection import Selection
from pwscont.system.system import Block, PiecewiseSystem

#: A test whose slope is below this part of its terms may as well stay zero.
SLANT = EPS**0.5
#: A cell whose matrix is not better conditioned than this is left to the next way.
WORST = SLANT**-1
#: A direction is one of its cell where its residual is below this part of typical terms.
ASTRAY = SLANT
#: What a direction of length one errs by, as SLANT sees it: a component that is zero is rounding.
NOISE = GUARD * EPS / SLANT


class Switch(NamedTuple):
    """A block with two modes at a corner, and the only test between these."""

    block: Block
    test: int
    modes: tuple[tuple[bool, ...], tuple[bool, ...]]


def switches(
    system: PiecewiseSystem,
    here: Character,
    blocks: Sequence[Block],
    choices: Sequence[Sequence[tuple[bool, ...]]],
    zero: frozenset[int],
) -> list[Switch] | None:
    """Return the switches of a corner, None where there is anything else.

    Parameters
    ----------
    system : PiecewiseSystem
    here : Character
        The signs at the corner.
    blocks : sequence of Block
        Those of which a test vanishes.
    choices : sequence of sequence of tuple of bool
        The modes of each of these blocks that meet at the corner.
    zero : frozenset of int
    """
    found: list[Switch] = []
    for block, modes in zip(blocks, choices, strict=True):
        if len(modes) == 1:
            continue
        between = _between(system, here, block, modes, zero)
        if len(modes) != 2 or len(between) != 1:
            return None
        found.append(Switch(block, between.pop(), (modes[0], modes[1])))
    return found


def _between(
    system: PiecewiseSystem,
    here: Character,
    block: Block,
    modes: Sequence[tuple[bool, ...]],
    zero: frozenset[int],
) -> set[int]:
    """Return the vanishing tests that bound all of some modes of a block, and differ in sign."""
    cells = [here.with_signs(block.tests, mode) for mode in modes]
    shared = set(block.tests) & zero
    for cell in cells:
        shared &= set(system.bounding_tests(cell))
    return {test for test in shared if len({cell.array[test] for cell in cells}) == 2}


def rays_by_switches(
    system: PiecewiseSystem, metric: Metric, x: Array, base: Character, found: list[Switch]
) -> list[tuple[Array, tuple[Character, ...]]] | None:
    """Return the directions of all rays, and their cells; None where this way is not sure.

    Parameters
    ----------
    system : PiecewiseSystem
    metric : Metric
    x : ndarray, shape (n + 1,)
    base : Character
        The character in which every switch is in its first mode.
    found : list of Switch
    """
    problem = _problem(system, metric, x, base, found)
    if problem is None:
        return None
    rays: list[tuple[Array, tuple[Character, ...]]] = []
    for chosen in product((False, True), repeat=len(found)):
        slopes = _slopes(problem, np.array(chosen))
        if slopes is None:
            return None
        if (slopes > 0.0).all() or (slopes < 0.0).all():
            v = np.where(chosen, slopes, 0.0)
            d = metric.normalised(np.sign(slopes[0]) * (problem.along + v @ problem.w))
            character = _with_modes(base, found, chosen)
            jacobian = Selection(system, character).jacobian(x)
            if (np.abs(jacobian @ d) > ASTRAY * problem.sizes).any():
                return None
            rays.append((d, (character,)))
    return rays


class _Problem(NamedTuple):
    """The complementarity problem of a corner, for s = 1, and what its directions are made of.

    Attributes
    ----------
    along, w : ndarray, shapes (n + 1,) and (k, n + 1)
        t and the w_i.
    h, M : ndarray, shapes (k,) and (k, k)
    terms, growth : ndarray, shapes (k,) and (k, k)
        Sizes of the terms of h and M.
    sizes : ndarray, shape (n,)
        Typical sizes of the terms of J d.
    """

    along: Array
    w: Array
    h: Array
    M: Array
    terms: Array
    growth: Array
    sizes: Array


def _problem(
    system: PiecewiseSystem, metric: Metric, x: Array, base: Character, found: list[Switch]
) -> _Problem | None:
    z, alpha = x[:-1], float(x[-1])
    tests = np.array([switch.test for switch in found], dtype=np.intp)
    g = dense(system.some_test_gradients(z, alpha, tests))
    g = g * np.where(base.array[tests], 1.0, -1.0)[:, np.newaxis]
    lengths = np.linalg.norm(g * metric.scale, axis=1, keepdims=True)
    if not lengths.all():  # a test that is zero all over
        return None
    g = g / lengths
    jacobian = Selection(system, base).jacobian(x)
    factor = bordered(jacobian, generic(len(x)) / metric.scale, metric.binary)
    if factor.is_singular():
        return None
    other = Selection(system, _with_modes(base, found, [True] * len(found))).jacobian(x)
    right = np.zeros((len(found) + 1, len(x)))
    for c, gradient, switch in zip(right, g, found, strict=False):
        rows = list(switch.block.rows)
        c[rows] = by_columns(jacobian, other, gradient, metric.scale)[rows]
    right[-1] = last_unit(len(x))
    solved = factor.solve_all(right)
    w, along = solved[:-1], solved[-1]
    terms = np.abs(g) @ (np.abs(along) + NOISE * metric.scale)
    M, growth = np.eye(len(g)) + g @ w.T, np.eye(len(g)) + np.abs(g) @ np.abs(w).T
    return _Problem(along, w, g @ along, M, terms, growth, abs(jacobian) @ metric.scale)


def _slopes(problem: _Problem, chosen: Signs) -> Array | None:
    """Return y, and v where it is chosen, of one cell for s = 1; None where one may be zero."""
    h, M = problem.h, problem.M
    inner = M[np.ix_(chosen, chosen)]
    if len(inner) and not np.linalg.cond(inner) < WORST:
        return None
    v = np.zeros(len(h))
    v[chosen] = -np.linalg.solve(inner, h[chosen])
    slopes: Array = np.where(chosen, v, h + M @ v)
    least = SLANT * (problem.terms + problem.growth @ np.abs(v))
    return slopes if (np.abs(slopes) > least).all() else None


def _with_modes(base: Character, found: Sequence[Switch], chosen: Sequence[bool]) -> Character:
    """Return a character with some switches in their second mode."""
    for switch, second in zip(found, chosen, strict=True):
        base = base.with_signs(switch.block.tests, switch.modes[second])
    return base
