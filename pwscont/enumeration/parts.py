"""Parts of a system that can be solved one after the other (docs/theory, F13).

The unknowns that stand in each row, in any mode, make a directed graph. Its strongly connected
components, in topological order, are the parts: each depends on the parts before it only. A search
over all modes is then exponential in the largest part only. The rows of a block belong to one part,
and so do its tests, unless these depend on earlier parts alone.

Failure modes and answers
-------------------------
- An entry vanishes by chance in the mode evaluated, and not elsewhere: an entry counts if it is not
  zero in any mode, and a cell is cut off only by inequalities that its part really decides.
- Rows and unknowns that cannot be paired, as in a system that is singular by its structure, and
  blocks without rows: there is one part only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from pwscont.basics.arrays import Indices
from pwscont.system.blocks import Block, number_of_cells

Pattern = npt.NDArray[np.bool_]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Rows and unknowns that depend on each other.

    Attributes
    ----------
    rows, unknowns : ndarray of int, shape (k,)
    blocks : tuple of int
        The blocks whose rows are among these; empty for a linear part.
    """

    rows: Indices
    unknowns: Indices
    blocks: tuple[int, ...]


def parts_of(pattern: Pattern, tests: Pattern, blocks: Sequence[Block]) -> list[Part]:
    """Return the parts of a system, each after the parts that it depends on.

    Parameters
    ----------
    pattern : ndarray of bool, shape (n, n)
        Which unknowns stand in which rows, in any mode.
    tests : ndarray of bool, shape (m, n)
        Which unknowns stand in which test functions.
    blocks : sequence of Block
    """
    n = len(pattern)
    whole = [Part(np.arange(n), np.arange(n), tuple(range(len(blocks))))]
    if len(blocks) < 2 or not all(block.rows for block in blocks):
        return whole
    unknown_of = maximum_bipartite_matching(sp.csr_matrix(pattern), perm_type="column")
    if (unknown_of < 0).any():
        return whole
    needs = pattern.copy()
    for block in blocks:
        own = list(block.rows)
        needs[own] |= tests[list(block.tests)].any(axis=0) | pattern[own].any(axis=0)
        needs[np.ix_(own, unknown_of[own])] = True
    needs = needs[:, unknown_of]  # row by row
    _, label = connected_components(sp.csr_matrix(needs), directed=True, connection="strong")
    owner = [int(label[block.rows[0]]) for block in blocks]
    return [
        Part(
            rows := np.flatnonzero(label == number),
            unknown_of[rows],
            tuple(i for i, part in enumerate(owner) if part == number),
        )
        for number in _in_order(needs, label)
    ]


def _in_order(needs: Pattern, label: Indices) -> list[int]:
    """Return the numbers of the components, each after the components that it needs."""
    before: dict[int, set[int]] = {int(number): set() for number in np.unique(label)}
    for row, needed in np.argwhere(needs):
        if label[row] != label[needed]:
            before[int(label[row])].add(int(label[needed]))
    return list(TopologicalSorter(before).static_order())


def most_cells(parts: Sequence[Part], blocks: Sequence[Block]) -> int:
    """Return the number of combinations of modes of the part that has the most."""
    return max(number_of_cells(blocks[i] for i in part.blocks) for part in parts)
