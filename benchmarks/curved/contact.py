"""Curved contact: one to three Coulomb nodes, every piece of every mode from its own formula.

At fixed alpha a mode is a linear system in the contact forces; its inequalities are sampled over
the interval, and where one changes sign is located by a root finder. So all pieces are known, with
their ends; pieces that end at the same point belong to one component. Modes are as in the paper:
no contact, stick, slip+ (lam_t = F lam_nu), slip- (lam_t = -F lam_nu).

Failure modes and answers
-------------------------
- An inequality that is violated between two samples only: its local minima are refined.
- Ends that cannot be joined in pairs, as at a corner: no special points are compared, and what is
  missing may be called a loop that is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise, product
from typing import Any

import networkx as nx
import numpy as np
from pwscont_coulomb import ContactBody, CoulombFriction, CoulombLoad
from scipy.optimize import brentq, minimize_scalar

from curved.case import Case, Truth
from curved.planar import Rng, log_uniform
from curved.truth import EPS, MARGIN, Component, Monotone, Special

NONE, STICK, PLUS, MINUS = range(4)
#: Samples of an interval.
COUNT = 1200


@dataclass
class Problem:
    """Unknowns ordered normals first; load and F as functions of alpha, for many alphas at once.

    Attributes
    ----------
    compliance : ndarray, shape (2 p, 2 p)
    gap : ndarray, shape (p,)
    load : callable
        (k,) -> (k, 2 p).
    friction : callable
        (k,) -> (k,).
    """

    compliance: np.ndarray
    gap: np.ndarray
    load: Callable[[np.ndarray], np.ndarray]
    friction: Callable[[np.ndarray], np.ndarray]

    def state(self, modes: tuple[int, ...], alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return z = (u, lam), shape (k, 4 p), and all slacks, shape (k, .), of a mode."""
        p, C, F = len(self.gap), self.compliance, self.friction(alpha)
        free = self.load(alpha) @ C.T
        B, b = np.zeros((len(alpha), 2 * p, 2 * p)), np.zeros((len(alpha), 2 * p))
        for i, mode in enumerate(modes):
            if mode == NONE:
                B[:, i, i] = B[:, p + i, p + i] = 1.0
                continue
            B[:, i], b[:, i] = C[i], self.gap[i] - free[:, i]
            if mode == STICK:
                B[:, p + i], b[:, p + i] = C[p + i], -free[:, p + i]
            else:
                B[:, p + i, p + i], B[:, p + i, i] = 1.0, F if mode == MINUS else -F
        try:
            lam = np.linalg.solve(B, b[..., None])[..., 0]
        except np.linalg.LinAlgError:  # a root finder that closes in on a pole may hit it
            return self.state(modes, alpha * (1.0 + 8.0 * EPS))
        u = free + lam @ C.T
        return np.hstack([u, lam]), np.column_stack(list(self._slacks(modes, u, lam, F)))

    def _slacks(
        self, modes: tuple[int, ...], u: np.ndarray, lam: np.ndarray, F: np.ndarray
    ) -> Iterator[np.ndarray]:
        p = len(self.gap)
        for i, mode in enumerate(modes):
            if mode == NONE:
                yield self.gap[i] - u[:, i]
                continue
            yield -lam[:, i]
            if mode == STICK:
                yield -F * lam[:, i] - lam[:, p + i]
                yield -F * lam[:, i] + lam[:, p + i]
            else:
                yield u[:, p + i] if mode == PLUS else -u[:, p + i]

    def pieces(self, modes: tuple[int, ...], grid: np.ndarray) -> list[tuple[float, float]]:
        """Return the intervals of alpha in which a mode is a solution."""
        at = lambda x: self.state(modes, np.array([x]))[1][0]  # noqa: E731
        slack = self.state(modes, grid)[1]
        roots = {float(grid[0]), float(grid[-1])}
        for j in range(slack.shape[1]):
            roots.update(_roots(lambda x, j=j: float(at(x)[j]), grid, slack[:, j]))
        cuts = sorted(roots)
        inside = [(a, b) for a, b in pairwise(cuts) if at(0.5 * (a + b)).min() > 0.0]
        merged: list[tuple[float, float]] = []
        for a, b in inside:
            if merged and merged[-1][1] == a and at(a).min() > 0.0:
                merged[-1] = (merged[-1][0], b)
            else:
                merged.append((a, b))
        return merged


def _roots(f: Callable[[float], float], grid: np.ndarray, value: np.ndarray) -> Iterator[float]:
    """Yield the zeros of a function given on a grid, pairs between two samples included."""
    size = np.abs(value)
    extra = []
    for i in 1 + np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:])):
        side = np.sign(value[i])
        if (side * value[i - 1 : i + 2] > 0).all():
            bounds = (grid[i - 1], grid[i + 1])
            least = minimize_scalar(lambda x, s=side: s * f(x), bounds=bounds, method="bounded")
            if least.fun < 0.0:
                extra.append(float(least.x))
    points = np.unique([*grid, *extra])
    known = dict(zip(grid, value, strict=True))
    values = np.array([known[x] if x in known else f(x) for x in points])
    for i in np.flatnonzero(values[:-1] * values[1:] < 0.0):
        yield brentq(f, points[i], points[i + 1], xtol=1e-15 * (1 + abs(points[i])))


def true_of(problem: Problem, interval: tuple[float, float]) -> Truth:
    """Return all components; a component's stretches carry the number of a piece as parameter."""
    grid = np.linspace(*interval, COUNT)
    pieces = [
        (modes, a, b)
        for modes in product(range(4), repeat=len(problem.gap))
        for a, b in problem.pieces(modes, grid)
    ]
    length = interval[1] - interval[0]
    joined = nx.Graph()
    joined.add_nodes_from(range(len(pieces)))
    ends = [
        (k, x, problem.state(modes, np.array([x]))[0][0])
        for k, (modes, a, b) in enumerate(pieces)
        for x in (a, b)
        if x not in interval
    ]
    specials: dict[int, list[Special]] = {k: [] for k in range(len(pieces))}
    partners = [0] * len(ends)
    for (i, (k, x, z)), (j, (m, y, w)) in combinations(enumerate(ends), 2):
        if abs(x - y) < 1e-9 * length and np.abs(z - w).max() < 1e-7 * (1 + np.abs(z).max()):
            joined.add_edge(k, m)
            turns = (x == pieces[k][1]) == (y == pieces[m][1])
            specials[k].append(Special("nonsmooth fold" if turns else "transition", x, 0.0))
            partners[i], partners[j] = partners[i] + 1, partners[j] + 1
    components = []
    for nodes in nx.connected_components(joined):
        stretches = [Monotone(k, k, pieces[k][1], pieces[k][2]) for k in sorted(nodes)]
        points = [point for k in sorted(nodes) for point in specials[k]]
        closed = not any(x in interval for k in nodes for x in pieces[k][1:])
        components.append(Component(stretches, points, closed))

    def solutions(component: Component, alpha: float) -> list[np.ndarray] | None:
        found = []
        for k, _, a, b in component.stretches:
            if min(abs(alpha - a), abs(alpha - b)) <= MARGIN * length:
                return None
            if a < alpha < b:
                found.append(problem.state(pieces[int(k)][0], np.array([alpha]))[0][0])
        return found

    return Truth(components, solutions, has_specials=all(n == 1 for n in partners))


def body_of(rng: Rng, p: int) -> tuple[ContactBody, np.ndarray, np.ndarray]:
    """Return a random body, its compliance, and its gaps."""
    Q = rng.normal(size=(2 * p, 2 * p))
    A = Q @ Q.T + log_uniform(rng, 0.05, 1) * np.eye(2 * p)
    gap = rng.choice([0.0, 0.3], size=p) * rng.uniform(0, 1, size=p)
    pick = np.eye(2 * p)
    return ContactBody(A, pick[:p], pick[p:], gap), np.linalg.inv(A), gap


def path_of(rng: Rng, n: int) -> tuple[Callable[[np.ndarray], np.ndarray], dict[str, Any]]:
    """Return a load path on (0, 6) of sines, a rational one or exponentials, for many alphas."""
    c, s, t = rng.normal(size=(3, n)) * [[1.0], [1.5], [1.5]]
    w, v = rng.uniform(0.3, 3.2, size=2)
    kind = str(rng.choice(["sines", "rational", "exponentials"]))
    shapes: dict[str, tuple[Any, Any]] = {
        "sines": (lambda x: np.sin(w * x), lambda x: np.cos(v * x)),
        "rational": (
            lambda x: 2 * (x - v) / (0.2 * w + (x - v) ** 2),
            lambda x: 1 / (1 + (x - w) ** 2),
        ),
        "exponentials": (lambda x: np.exp(-w * x), lambda x: np.exp(v * (x - 6) / 2)),
    }
    first, second = shapes[kind]
    load = lambda x: c + np.multiply.outer(first(x), s) + np.multiply.outer(second(x), t)  # noqa: E731
    return load, {"kind": kind, "w": float(w), "v": float(v)}


def contact(rng: Rng) -> Case:
    """Draw a curved load path, one to three nodes."""
    p, interval = int(rng.choice([1, 1, 2, 2, 3])), (0.0, 6.0)
    body, compliance, gap = body_of(rng, p)
    load, drawn = path_of(rng, 2 * p)
    F = float(rng.uniform(0, 3))
    problem = Problem(compliance, gap, load, lambda x: np.full(len(x), F))
    system = CoulombLoad(body, load, F)
    return Case({"p": p, "F": F, **drawn}, system, interval, true_of(problem, interval))


def friction(rng: Rng) -> Case:
    """Draw a fixed load, one to three nodes; the parameter is F."""
    p, interval = int(rng.choice([1, 2, 2, 3])), (0.0, float(rng.uniform(1, 10)))
    body, compliance, gap = body_of(rng, p)
    f = rng.normal(size=2 * p) * rng.choice([1.0, 3.0], size=2 * p)
    problem = Problem(compliance, gap, lambda x: np.tile(f, (len(x), 1)), lambda x: x)
    system = CoulombFriction(body, f)
    drawn = {"p": p, "f": f.tolist(), "interval": interval}
    return Case(drawn, system, interval, true_of(problem, interval))
