"""Nested dissection of unknowns in the plane.

The unknowns are halved again and again at the median of the longer side of the bounding box.
Unknowns of the left half that are coupled with the right half are the separator: the two halves
without the separator are independent. A separator is eliminated after the halves, which for n
unknowns of a plane mesh takes O(n log n) memory and O(n^1.5) work (George 1973).

The tree is a complete binary tree with nodes numbered as in a heap: 1 the root, 2 i and 2 i + 1 the
halves of i. Positions only guide the cuts: any positions give a correct order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pwscont.extending import Array, Indices, Matrix

#: Approximate number of unknowns of a leaf: smaller leaves cost overhead, larger leaves fill.
LEAF = 64


@final
@dataclass(frozen=True, slots=True, eq=False)
class Dissection:
    """An order of elimination and the tree of fronts that gives the order.

    Attributes
    ----------
    order : ndarray of int, shape (m,)
        The unknowns in the order of elimination.
    tree : ndarray of int
        The heap numbers of the fronts, children before parents.
    bounds : ndarray of int, shape (len(tree) + 1,)
        Front i eliminates ``order[bounds[i] : bounds[i + 1]]``.
    """

    order: Indices
    tree: Indices
    bounds: Indices


def dissect(A: Matrix, unknowns: Indices, positions: Array) -> Dissection:
    """Return a nested dissection of some unknowns.

    Parameters
    ----------
    A : scipy.sparse csr, shape (n, n)
        A matrix with a symmetric pattern; the values of entries do not matter.
    unknowns : ndarray of int, shape (m,)
    positions : ndarray, shape (2, n)
    """
    depth = max(0, int(np.ceil(np.log2(max(len(unknowns), 1) / LEAF))))
    place = np.full(A.shape[0], 0, dtype=np.intp)  # 0: not to be eliminated
    place[unknowns] = 1
    links = A.tocoo()
    inner = links.row < links.col
    rows, columns = links.row[inner], links.col[inner]
    open_, settled = unknowns, np.zeros(A.shape[0], dtype=bool)
    settled[place == 0] = True
    for _ in range(depth):
        between = ~(settled[rows] | settled[columns])
        rows, columns = rows[between], columns[between]
        right = _right_half(place[open_], positions[:, open_])
        side = np.zeros(A.shape[0], dtype=bool)
        side[open_] = right
        crossing = (place[rows] == place[columns]) & (side[rows] != side[columns])
        settled[np.where(side[rows], columns, rows)[crossing]] = True
        open_, right = open_[~settled[open_]], right[~settled[open_]]
        place[open_] = 2 * place[open_] + right
    return _ordered(unknowns, place[unknowns], depth)


def _right_half(part: Indices, positions: Array) -> Indices:
    """Tell for each unknown whether the unknown lies in the right half of a part."""
    first = np.lexsort((part,))
    starts = np.flatnonzero(np.diff(part[first], prepend=-1))
    extent = np.stack(
        [
            np.maximum.reduceat(x[first], starts) - np.minimum.reduceat(x[first], starts)
            for x in positions
        ]
    )
    number = np.empty(len(part), dtype=np.intp)
    sizes = np.diff(np.append(starts, len(part)))
    number[first] = np.repeat(np.arange(len(starts)), sizes)
    x = np.where(extent[0] >= extent[1], 0, 1)[number]
    along, across = np.where(x == 0, positions[0], positions[1]), positions.sum(axis=0)
    by_place = np.lexsort((across, along, number))
    middle = along[by_place[starts + sizes // 2]]  # equal coordinates on the same side
    right: Indices = (along >= middle[number]).astype(np.intp)
    return right


def _ordered(unknowns: Indices, place: Indices, depth: int) -> Dissection:
    """Sort unknowns by place in the tree, children before parents."""
    rank = _postorder(depth)
    by_rank = np.argsort(rank[place], kind="stable")
    tree, starts = np.unique(rank[place[by_rank]], return_index=True)
    heap = np.empty(len(rank), dtype=np.intp)
    heap[rank] = np.arange(len(rank))
    return Dissection(unknowns[by_rank], heap[tree], np.append(starts, len(unknowns)))


def _postorder(depth: int) -> Indices:
    """Return the rank of each heap number when children come before parents; 0 for none."""
    rank = np.zeros(2 ** (depth + 1), dtype=np.intp)
    size = 2 ** (depth + 1) - 1
    rank[1] = size
    for number in range(2, len(rank)):
        parent, level = number // 2, number.bit_length() - 1
        size = 2 ** (depth + 1 - level) - 1
        rank[number] = rank[parent] - 1 - (0 if number % 2 else size)
    return rank
