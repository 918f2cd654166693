"""What is connected with what, by networkx, which is imported where it is asked for."""

from __future__ import annotations

from collections.abc import Iterable

#: Two members that are connected.
Pair = tuple[int, int]


def connected(members: Iterable[int], pairs: Iterable[Pair]) -> list[set[int]]:
    """Return the sets of members that are connected, in the order of their least ones."""
    import networkx as nx  # noqa: PLC0415  it takes longer to import than most paths to follow

    graph = nx.Graph()
    graph.add_nodes_from(members)
    graph.add_edges_from(pairs)
    return sorted(nx.connected_components(graph), key=min)


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
