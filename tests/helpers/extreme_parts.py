"""Load paths that tests of extremes share."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from paper_systems import ONE_NODE, TWO_NODES
from pwscont_coulomb import AffineLoad, CoulombLoad
from random_bodies import contact_body
from reference_enumeration import Body, exact_pieces

EPS = np.finfo(float).eps


COMPLETE = "complete"


# -- load paths against rational arithmetic ----------------------------------------------------


@dataclass(frozen=True)
class Path:
    """A body on an affine load path f0 + alpha f1."""

    body: Body
    f0: Any
    f1: Any
    friction: Any
    interval: tuple[float, float] = (-2.0, 2.0)

    def system(self, r=None):
        load = AffineLoad(self.f0, self.f1)
        return CoulombLoad(contact_body(self.body), load, self.friction, r)

    def exact(self):
        """Return (modes of all nodes, lo, hi, sign of det) of every piece, without rounding."""
        f0, f1 = np.asarray(self.f0, dtype=float), np.asarray(self.f1, dtype=float)
        pieces = exact_pieces(self.body, f0, f1, self.friction, self.interval)
        return sorted((label(p.modes), p.lo, p.hi, p.det_sign) for p in pieces)

    def width(self):
        return self.interval[1] - self.interval[0]


def label(modes):
    if len(modes) == 1:
        return modes[0]
    if len(modes) == 3 and len(set(modes)) == 1:
        return f"nodes 1 to 3 {modes[0]}"
    return ", ".join(f"node {i} {mode}" for i, mode in enumerate(modes, start=1))


def pieces_of(graph):
    return sorted((p.label, *p.interval, p.det_sign) for p in graph.pieces if not p.is_vertical)


def assert_matches(graph, path, tolerance=64.0 * EPS):
    """Every piece is there, no other, and its ends are right relative to the interval."""
    found, expected = pieces_of(graph), path.exact()
    assert [(a[0], a[3]) for a in found] == [(b[0], b[3]) for b in expected]
    for mine, exact in zip(found, expected, strict=True):
        for a, b in zip(mine[1:3], exact[1:3], strict=True):
            assert abs(float(Fraction(a) - b)) <= tolerance * path.width(), (mine, exact)
    assert not graph.special_points("stopped")
    assert graph.guarantee == COMPLETE


def one_node(A=ONE_NODE.A, gap=0.0):
    return Body(np.array(A, dtype=float), ONE_NODE.N, ONE_NODE.T, np.array([gap]))


def two_nodes(stiff=1.0, coupling=0.3, gap=(0.0, 0.0)):
    """Return two copies of the paper's node, the first ``stiff`` times as stiff, coupled."""
    A = np.zeros((4, 4))
    A[:2, :2], A[2:, 2:] = stiff * ONE_NODE.A, ONE_NODE.A
    A[1, 2] = A[2, 1] = -coupling
    A[0, 3] = A[3, 0] = coupling / 2.0
    return Body(A, TWO_NODES.N, TWO_NODES.T, np.array(gap))


LOADED = ([0.25, 0.0, 0.25, 0.1], [0.0, 1.0, 0.2, 1.0])
