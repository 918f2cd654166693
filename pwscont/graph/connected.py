"""What is connected with what."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from itertools import chain

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

#: Two members that are connected.
Pair = tuple[int, int]


def connected(members: Iterable[int], pairs: Iterable[Pair]) -> list[set[int]]:
    """Return the sets of members that are connected, in the order of their least ones."""
    joined = list(pairs)
    known = sorted({*members, *chain.from_iterable(joined)})
    place = {member: i for i, member in enumerate(known)}
    ends = np.array([[place[a], place[b]] for a, b in joined], dtype=int).reshape(-1, 2)
    size = len(known)
    matrix = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
    sets: dict[int, set[int]] = defaultdict(set)
    for member, label in zip(known, connected_components(matrix, directed=False)[1], strict=True):
        sets[int(label)].add(member)
    return list(sets.values())


def shortest_way(members: Iterable[int], pairs: Iterable[Pair], a: int, b: int) -> list[int]:
    """Return the members on a shortest way from one to another; empty where there is none."""
    import networkx as nx  # noqa: PLC0415  it takes longer to import than most paths to follow

    graph = nx.Graph()
    graph.add_nodes_from(members)
    graph.add_edges_from(pairs)
    try:
        return list(nx.shortest_path(graph, a, b))
    except nx.NetworkXNoPath:
        return []
