"""Time per point and accuracy of the fold on Bratu's equation in one dimension.

    python benchmarks/bratu.py

u'' + alpha exp(u) = 0 on (0, 1), u(0) = u(1) = 0, by second order differences at n points. The
fold of the differential equation is at alpha = 3.513830719; that of the discrete one differs by
O(h^2) and is computed here independently, by shooting from the middle. Compare rows of one run
with each other only: the machine's speed is in all of them.
"""

from __future__ import annotations

import math
import platform
import statistics
import time
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.optimize import brentq

from pwscont import (
    BandedJacobian,
    BranchGraph,
    Character,
    PiecewiseSystem,
    PseudoArclength,
    trace,
)
from pwscont.curve.stepper import StepSize

RUNS = 9


class Bratu(PiecewiseSystem):
    """Bratu's equation with its Jacobian in one of several storages: a system of one cell."""

    def __init__(self, n: int, storage: str = "banded") -> None:
        self.size, self.storage = n, storage
        self.squared = 1.0 / (n + 1) ** 2
        self.jacobians = 0
        # the pattern of the sparse storage: three entries per column, two in the first and last
        rows = np.arange(n)[:, np.newaxis] + [-1, 0, 1]
        self.indices = np.append(rows.ravel()[1:-1], np.arange(n))
        self.starts = np.append(
            np.minimum(np.maximum(3 * np.arange(n + 1) - 1, 0), 3 * n - 2), 4 * n - 2
        )

    def test_functions(self, z: Any, alpha: float) -> Any:
        """Return nothing: the system is smooth."""
        return np.zeros(0)

    def test_jacobian(self, z: Any, alpha: float) -> Any:
        """Return nothing."""
        return np.zeros((0, self.size + 1))

    def residual(self, z: Any, alpha: float, character: Character) -> Any:
        """Return h^2 (u'' + alpha exp(u)) at every point."""
        rest = alpha * self.squared * np.exp(z) - 2.0 * z
        rest[1:] += z[:-1]
        rest[:-1] += z[1:]
        return rest

    def jacobian(self, z: Any, alpha: float, character: Character) -> Any:
        """Return the derivatives, tridiagonal but for the last column."""
        self.jacobians += 1
        growth = self.squared * np.exp(z)
        bands = np.ones((3, self.size))
        bands[1] = alpha * growth - 2.0
        if self.storage == "banded":
            return BandedJacobian(bands, 1, 1, growth)
        data = np.append(bands.T.ravel()[1:-1], growth)
        whole = sp.csc_matrix((data, self.indices, self.starts), (self.size, self.size + 1))
        return whole if self.storage == "sparse" else whole.toarray()

    def scale(self, lo: float, hi: float) -> Any:
        """Return sqrt(n) for u of about one, so that lengths do not depend on n."""
        return np.full(self.size, math.sqrt(self.size))


def run(n: int, storage: str, largest: float) -> tuple[BranchGraph, list[float], int]:
    """Return the graph, the seconds of each run, and the number of Jacobians evaluated."""
    seconds, stepper = [], PseudoArclength(step_size=StepSize(largest=largest))
    for _ in range(RUNS):
        system = Bratu(n, storage)
        begin = time.perf_counter()
        graph = trace(system, (np.zeros(n), 0.5), (0.5, 4.0), stepper=stepper, parameter="lambda")
        seconds.append(time.perf_counter() - begin)
    return graph, seconds, system.jacobians


def discrete_fold(n: int) -> float:
    """Return the fold of the discrete equation for odd n, by shooting from the middle.

    The recurrence and its derivatives by alpha and by the value c in the middle give alpha(c);
    the fold is where its derivative vanishes.
    """
    c = brentq(lambda c: _slope(n, c), 1.0, 1.4, xtol=1e-13)
    return _alpha(n, c)


def _alpha(n: int, c: float) -> float:
    alpha = 3.5
    for _ in range(20):
        end, by_alpha, _ = _shoot(n, c, alpha)
        alpha -= end / by_alpha
    return alpha


def _slope(n: int, c: float) -> float:
    _, by_alpha, by_c = _shoot(n, c, _alpha(n, c))
    return -by_c / by_alpha


def _shoot(n: int, c: float, alpha: float) -> tuple[float, float, float]:
    """Return u at the boundary and its derivatives by alpha and c, for u symmetric."""
    h2 = 1.0 / (n + 1) ** 2
    growth = h2 * math.exp(c)
    now, now_a, now_c = c, 0.0, 1.0
    # increments: summing them keeps the digits that second differences would lose
    step, step_a, step_c = -0.5 * alpha * growth, -0.5 * growth, -0.5 * alpha * growth
    for _ in range((n + 1) // 2):
        now, now_a, now_c = now + step, now_a + step_a, now_c + step_c
        growth = h2 * math.exp(now)
        step -= alpha * growth
        step_a -= growth * (1.0 + alpha * now_a)
        step_c -= alpha * growth * now_c
    return now, now_a, now_c


def row(n: int, storage: str, largest: float, reference: float) -> str:
    """Return one line of the table."""
    graph, seconds, jacobians = run(n, storage, largest)
    (fold,) = graph.special_points("fold")
    points = sum(len(piece.points) for piece in graph.pieces)
    best, median = (1e3 * s / points for s in (min(seconds), statistics.median(seconds)))
    return (
        f"{n:5d} {storage:<7} {largest:5.3f} {points:4d} points {best:7.3f} [{median:.3f}] "
        f"ms/point, {jacobians / points:4.1f} Jacobians/point, fold {fold.alpha:.12f}, off the "
        f"discrete one by {fold.alpha - reference:8.1e}, off 3.513830719 by "
        f"{fold.alpha - 3.513830719:8.1e}"
    )


def main() -> None:
    """Print the table: n, storage, longest step, points, best and median time of all."""
    print(
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, "
        f"{platform.machine()}; best [median] of {RUNS} runs of trace, all of it included"
    )
    for n in (99, 999, 9999):
        reference = discrete_fold(n)
        for storage in ("banded", "sparse", "dense")[: 3 if n < 500 else 2]:
            for largest in (0.1, 0.05):
                print(row(n, storage, largest, reference))


if __name__ == "__main__":
    main()
