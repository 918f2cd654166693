"""Graphs that tests of exported data share."""

from functools import cache

import numpy as np
from pwscont_coulomb.scenes import example1, example3, fig7, fig10

from pwscont import (
    BranchGraph,
    PiecewiseSystem,
)

SCENES = [fig7, fig10, example1, example3]


@cache
def answer_of(scene):
    """Return the graph of a scene, which is solved once for all tests of a process."""
    return scene().run()


def power(z, alpha):
    return float(alpha * z[1])


def with_record(graph, **record):
    """Return the same graph with recorded quantities."""
    points = [point for point in graph.special_points() if point.id >= 0]
    more = {"starts": graph.starts, "system": graph.system, "record": record}
    return BranchGraph(points, graph.pieces, graph.interval, **more)


class Circle(PiecewiseSystem):
    """z^2 + alpha^2 = 1: a closed loop of two smooth pieces of length pi each."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([2.0 + z[0]])

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0


def of_another(graph, system):
    """Return the same graph of a system that a run would refuse."""
    points = [point for point in graph.special_points() if point.id >= 0]
    return BranchGraph(points, graph.pieces, graph.interval, system=system)
