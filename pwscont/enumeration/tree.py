"""The search over all choices of options.

Linear programs, many at once, cut off choices that no point can satisfy: undecided blocks are
relaxed to what holds in all of their options. Each choice branches on the block whose options are
most wrong at the vertex of the choice. Choices that cannot be cut off, because their vertex lies in
the cells of all options that are left (an unloaded body), are decided together
(:mod:`pwscont.enumeration.choices`), and so are all choices if the search has cost as much as that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.budget import check_budget
from pwscont.basics.character import Character
from pwscont.enumeration import simplex
from pwscont.enumeration.choices import Choices, inequalities_of, narrowed, together
from pwscont.enumeration.options import Problem, Table, problem_of
from pwscont.enumeration.polyhedron import satisfies
from pwscont.enumeration.simplex import Forms, Vertices
from pwscont.system.system import SlicewiseLinearSystem

#: Most choices in a batch: a larger batch would gain little and cost memory.
BATCH = 4**7
#: Number of choices for which batches take about as long as linear programs.
FEW_CHOICES = 4**8
#: Choices that are decided in batches in the time of a linear program.
CHOICES_PER_PROGRAM = 16
#: In place of these two for cells that hold lines, of which both ends are found: a chain of 16
#: diodes is done in a quarter of the time, a problem without structure takes at most 1.2 times it.
CUT_OFF_LINES = 4**7, 48
#: Most options of a block that the search branches on.
MANY_OPTIONS = 64
#: Most linear programs solved at once: more programs would gain little and cost memory.
PROGRAMS = 1024


def leaves(
    problem: Problem, few: int | None = None, per_program: float | None = None
) -> Iterator[Choices]:
    """Yield all complete choices with a point that nearly satisfies the inequalities.

    The inequalities of singular cells need not have been looked at. ``few`` and ``per_program``: in
    place of FEW_CHOICES and CHOICES_PER_PROGRAM, where more is done than to find a point.
    """
    few, per_program = few or FEW_CHOICES, per_program or CHOICES_PER_PROGRAM
    numbers = [len(options) for options in problem.blocks]
    is_worth_searching = prod(numbers) > few and max(numbers) <= MANY_OPTIONS
    ends: Iterable[tuple[int, ...]] | None = None
    if is_worth_searching:
        ends = _search(problem, per_program)
    if ends is None:  # all choices, by batches for each choice of the first blocks
        first = next(m for m in range(len(numbers) + 1) if prod(numbers[m:]) <= BATCH)
        open_blocks = (simplex.OPEN,) * (len(numbers) - first)
        ends = ((*picks, *open_blocks) for picks in product(*map(range, numbers[:first])))
    for some in ends:  # choices of some blocks, of which all completions are left
        check_budget()
        picks = np.array(some, dtype=np.intp)
        order = np.argsort(picks == simplex.OPEN, kind="stable")
        reordered = replace(problem, blocks=[problem.blocks[i] for i in order])
        begun = _of_first(reordered, picks[picks != simplex.OPEN].tolist())
        for choices in filter(len, together(reordered, begun) if begun else ()):
            yield replace(choices, picks=choices.picks[np.argsort(order)])


@final
@dataclass(frozen=True, slots=True, eq=False)
class AffineCells:
    """Some cells of a system and the points that solve H there, parameters being unknowns, too.

    The solutions of cell i are the points ``starts[i] + directions[i] @ w`` for which no entry of
    ``sides[i] @ w + values[i]`` is negative; rounding may have let cells without solutions pass.
    See the example of :func:`enumerate_cells`, which makes these.
    """

    starts: Array  #: Shape (N, n).
    directions: Array  #: Shape (N, n, q).
    #: Shape (N, k, q): the inequalities that hold in every cell, then the tests that bound the
    #: cell, filled up with 1 >= 0; a row has unit length in what all common equations leave.
    sides: Array
    values: Array  #: Shape (N, k).
    tests: Indices  #: Shape (N, k): the test function of each inequality, -1 for others.
    growth: Array  #: Shape (N,): the factor by which rounding may have grown in the starts.
    rounding: Array  #: Shape (N,): the estimated error of the values.
    _problem: Problem
    _choices: Choices

    @classmethod
    def of(cls, problem: Problem, choices: Choices) -> AffineCells:
        """Return the cells of choices of options."""
        starts = choices.starts @ problem.basis.T + problem.origin
        errors = choices.growth, choices.rounding
        inequalities = inequalities_of(problem, choices)
        lines = problem.basis @ choices.directions
        return cls(starts, lines, *inequalities, *errors, problem, choices)

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self.starts)

    def character(self, i: int) -> Character:
        """Return the character of cell i."""
        return self._problem.character(self._choices.picks[:, i])

    def is_solved(self, i: int, growth: float) -> bool:
        """Tell whether the start of cell i solves H to rounding, grown by a factor."""
        chosen = self._problem.chosen(self._choices.picks[:, i])
        return satisfies(chosen, self._choices.starts[i], growth)


def enumerate_cells(
    system: SlicewiseLinearSystem,
    forms: Sequence[tuple[Array, Array]],
    necessary: tuple[Array, Array],
    scale: Array,
    *,
    few: int | None = None,
) -> Iterator[AffineCells]:
    """Yield all cells with solutions, where parameters are unknowns.

    Parameters
    ----------
    system : SlicewiseLinearSystem
        Gives the blocks and the tests that bound a cell.
    forms : sequence of (ndarray, ndarray)
        As from :func:`affine_forms`, of z and any number of parameters.
    necessary : (ndarray, ndarray)
        Matrix A and constant b with A x + b >= 0 at all solutions that are asked for.
    scale : ndarray, shape (n,)
        Typical magnitudes of the unknowns.
    few : int, optional
        Cells that are tried all at once; of more cells linear programs cut off most. Default: many,
        as pays if no more is done with a cell than to find a point.

    Yields
    ------
    AffineCells
        Cells with equally many directions.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import LCP
    >>> from pwscont.extending import affine_forms, enumerate_cells
    >>> problem, size = LCP([[2.0]], q=[-1.0], d=[1.0]), np.ones(2)
    >>> within = np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([3.0, 3.0])  # abs(alpha) <= 3
    >>> forms = affine_forms(problem, 0.0, size)
    >>> [cells.directions.shape for cells in enumerate_cells(problem, forms, within, size)]
    [(2, 2, 1)]
    """
    problem = problem_of(Table.of(system, forms), necessary, scale)
    if problem is not None:
        found = leaves(problem, few, few and 1.0)
        yield from (AffineCells.of(problem, choices) for choices in found)


def _of_first(problem: Problem, picks: Iterable[int]) -> Choices | None:
    """Return the choice of options of the first blocks, None if nothing satisfies its equations."""
    choice: Choices | None = Choices.before_all(problem)
    for pick in picks:
        choice = narrowed(problem, choice, pick) if choice else None
    return choice


def _search(problem: Problem, per_program: float) -> list[tuple[int, ...]] | None:
    """Return the choices whose completions are all that is left; None if too costly."""
    blocks = [options for options in problem.blocks if len(options) > 1]
    single = (0,) * (len(problem.blocks) - len(blocks))
    first = _of_first(problem, single)
    if first is None:
        return []
    found = _ends(simplex.Forms.of(problem, blocks, first), per_program)
    return found and sorted(single + picks for picks in found)


def _ends(forms: Forms, per_program: float) -> list[tuple[int, ...]] | None:
    """Return the choices to be completed, depth first, in batches of programs; None if too many."""
    numbers, shape = forms.numbers, forms.options.shape[:2]
    most, batch = prod(numbers.tolist()) // per_program, max(1, PROGRAMS // int(numbers.max()))
    options = forms.options.reshape(-1, forms.options.shape[-1])
    signs = simplex.NOT_NEGATIVE, simplex.NOT_POSITIVE
    asked = np.vstack([(options & sign > 0).T for sign in signs]).astype(float)
    ends, programs = list[tuple[int, ...]](), 0
    stack = [simplex.feasible(forms, simplex.first_vertex(forms))]
    while stack and programs <= most:
        check_budget()
        nodes = stack.pop()
        stack += [nodes[batch:]] if len(nodes) > batch else []
        nodes = nodes[:batch]
        values, is_open = forms.values(nodes.points), nodes.picks == simplex.OPEN
        sides = np.maximum(np.hstack([-values, values]), 0.0)
        # how wrong each option of each open block is at each vertex
        wrong = (sides @ asked).reshape(len(nodes), *shape) * is_open[:, :, np.newaxis]
        # complete, or the choice holds at the vertex and fits into a batch
        completions = np.where(is_open, numbers, 1).astype(float).prod(axis=1)
        holds = wrong.max(axis=(1, 2), initial=0.0) <= simplex.slack_of(nodes)
        is_end = holds & (completions <= BATCH) | (completions == 1.0)
        ends += map(tuple, nodes.picks[is_end].tolist())
        branches = _branches(forms, nodes[~is_end], wrong[~is_end])
        programs += len(branches)
        stack += [simplex.feasible(forms, branches)] if len(branches) else []
    return None if stack else ends


def _branches(forms: Forms, nodes: Vertices, wrong: Array) -> Vertices:
    """Return all options of the block whose options are most wrong, for every choice."""
    block = np.where(nodes.picks == simplex.OPEN, wrong.sum(axis=2), -1.0).argmax(axis=1)
    numbers = forms.numbers[block]
    parent = np.repeat(np.arange(len(nodes)), numbers)
    option = np.arange(len(parent)) - np.repeat(np.cumsum(numbers) - numbers, numbers)
    picks = nodes.picks[parent]
    picks[np.arange(len(parent)), block[parent]] = option
    return nodes[parent].asking(forms.options[block[parent], option], picks)
