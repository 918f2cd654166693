"""Systems written with switches against the same systems by hand, in one process.

    python benchmarks/notation.py [WORD ...] [--runs 7]

Only problems whose names have one of the words are run. Both ways have to find the same special
points; they take turns, the first run of each is dropped. Printed are medians and their ratio. Set
OPENBLAS_NUM_THREADS=1 where other programs run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from lasso import Lasso
from obstacle import INTERVAL, String, bent

from pwscont import (
    LCP,
    Block,
    Character,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    Switched,
    enumerate_solutions,
    explore,
    trace,
)

RNG = np.random.default_rng(0)


class HandLCP(PiecewiseLinearSystem):
    """z >= 0, M z + q + alpha d >= 0, complementary."""

    def __init__(self, M: np.ndarray, q: np.ndarray, d: np.ndarray) -> None:
        self.size, self.M, self.q, self.d = len(q), M, q, d
        self.balance, self.own = np.column_stack([M, d]), np.eye(len(q), len(q) + 1)

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        return self.M @ z + self.q + alpha * self.d - z

    def test_jacobian(self, z: np.ndarray, alpha: float) -> np.ndarray:
        return self.balance - self.own

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        return np.where(character.array, z, self.M @ z + self.q + alpha * self.d)

    def jacobian(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        return np.where(character.array[:, np.newaxis], self.own, self.balance)

    def blocks(self) -> tuple[Block, ...]:
        return tuple(Block((i,), (i,), ((True,), (False,))) for i in range(self.size))


class HandGame(PiecewiseLinearSystem):
    """x = clip(B x + a + alpha c, 0, 1)."""

    def __init__(self, B: np.ndarray, a: np.ndarray, c: np.ndarray) -> None:
        self.size, self.B, self.a, self.c = len(a), B, a, c
        self.answer, self.own = np.column_stack([B, c]), np.eye(len(a), len(a) + 1)

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        answer = self.B @ z + self.a + alpha * self.c
        return np.concatenate([answer, answer - 1.0])

    def test_jacobian(self, z: np.ndarray, alpha: float) -> np.ndarray:
        return np.vstack([self.answer, self.answer])

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        low, high = np.split(character.array, 2)
        answer = self.B @ z + self.a + alpha * self.c
        return z - np.where(low, np.where(high, 1.0, answer), 0.0)

    def jacobian(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        low, high = np.split(character.array, 2)
        return self.own - np.where((low & ~high)[:, np.newaxis], self.answer, 0.0)

    def bounding_tests(self, character: Character) -> list[int]:
        low, high = np.split(character.array, 2)
        return np.flatnonzero(np.concatenate([~high, low])).tolist()

    def blocks(self) -> tuple[Block, ...]:
        modes = ((False, False), (True, False), (True, True))
        return tuple(Block((i, i + self.size), (i,), modes) for i in range(self.size))

    def necessary(self, alpha: float) -> tuple[np.ndarray, np.ndarray]:
        n = self.size
        return np.vstack([np.eye(n), -np.eye(n)]), np.repeat([0.0, 1.0], n)


def kojima_shindo(z: np.ndarray, t: float) -> np.ndarray:
    """Return F; the last constant is 3.2, for at 3 a solution is degenerate."""
    x, y, u, v = z
    return np.array(
        [
            3 * x * x + 2 * x * y + 2 * y * y + u + 3 * v - 6 + t,
            2 * x * x + x + y * y + 10 * u + 2 * v - 2,
            3 * x * x + x * y + 2 * y * y + 2 * u + 9 * v - 9,
            x * x + 3 * y * y + 2 * u + 3 * v - 3.2,
        ]
    )


class HandComplementarity(PiecewiseSystem):
    """min(z, F(z, alpha)) = 0."""

    size = 4

    def test_functions(self, z: np.ndarray, alpha: float) -> np.ndarray:
        return z - kojima_shindo(z, alpha)

    def residual(self, z: np.ndarray, alpha: float, character: Character) -> np.ndarray:
        return np.where(character.array, kojima_shindo(z, alpha), z)


def alphas(graph: Any) -> list[float]:
    """Return where the special points of a graph are."""
    return sorted(point.alpha for point in graph.special_points())


def lcp() -> Any:
    """Return a linear complementarity problem by hand and written, and what is done with it."""
    n = 50
    A, q, d = RNG.normal(size=(n, n)), RNG.normal(size=n), RNG.normal(size=n)
    M = A @ A.T / n + np.eye(n) + 0.3 * (A - A.T) / n**0.5
    hand = HandLCP(M, q, d)
    start = trace(hand, (np.zeros(n), -3.0), (-3.0, -2.9)).special_points()[0].z
    return hand, LCP(M, q, d), lambda s: alphas(trace(s, (start, -3.0), (-3.0, 3.0)))


def game(work: Callable[[Any], Any]) -> Any:
    """Return a box game by hand and written, and what is done with it."""
    B, a, c = RNG.normal(size=(8, 8)), RNG.normal(size=8), RNG.normal(size=8)
    written = Switched(8, lambda x, t, sw: x - sw.clip(B @ x + a + t * c, 0, 1), linear=True)
    return HandGame(B, a, c), written, work


def lasso() -> Any:
    """Return the LASSO's normal map by hand and written, and what is done with it."""
    hand = Lasso(50)
    G, c = hand.gram, hand.start

    def f(z: Any, t: Any, sw: Any) -> Any:
        b = z - sw.clip(z, -t, t)
        return G @ b - b + z - c

    start, written = (hand.start, hand.interval[1]), Switched(50, f, linear=True)
    return hand, written, lambda s: alphas(trace(s, start, hand.interval))


def string() -> Any:
    """Return a string over an obstacle by hand and written, and what is done with it."""
    hand = String(250, banded=True)

    def f(u: Any, t: Any, sw: Any) -> Any:
        return sw.min(u + hand.gap, bent(u) + t * hand.weight)

    start, written = (np.zeros(250), 0.0), Switched(250, f, linear=True)
    return hand, written, lambda s: alphas(trace(s, start, INTERVAL))[1:]


def complementarity(work: Callable[[Any], Any]) -> Any:
    """Return Kojima and Shindo's problem by hand and written, and what is done with it."""
    written = Switched(4, lambda z, t, sw: sw.min(z, kojima_shindo(z, t)))
    return HandComplementarity(), written, work


#: What makes a problem by hand, the same in notation, and what is done with either.
PROBLEMS: dict[str, Callable[[], Any]] = {
    "LCP, 50 unknowns, trace": lcp,
    "game, 8 players, explore": lambda: game(lambda s: alphas(explore(s, (-1.0, 1.0)))),
    "game, 8 players, enumerate": lambda: game(
        lambda s: sorted(solution.z[0] for solution in enumerate_solutions(s, 0.2))
    ),
    "LASSO, 50 coefficients, trace": lasso,
    "string, 250 nodes, trace": string,
    "Kojima-Shindo, trace": lambda: complementarity(
        lambda s: alphas(trace(s, ([1.0, 0.0, 3.0, 0.0], 0.0), (-4.0, 2.0)))
    ),
    "Kojima-Shindo, explore": lambda: complementarity(lambda s: alphas(explore(s, (-4.0, 2.0)))),
}


def compare(name: str, runs: int) -> None:
    """Print the times of a problem."""
    hand, written, work = PROBLEMS[name]()
    if not np.allclose(work(hand), work(written), rtol=1e-7, atol=1e-8):
        raise SystemExit(f"{name}: different answers")
    times: list[list[float]] = [[], []]
    for _ in range(runs):
        for system, mine in zip((hand, written), times, strict=True):
            begin = time.perf_counter()
            work(system)
            mine.append(1e3 * (time.perf_counter() - begin))
    one, other = map(median, times)
    print(f"{name:32} {one:9.1f} ms by hand {other:9.1f} ms written {other / one:6.2f}")


def main() -> None:
    """Print all comparisons."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*")
    parser.add_argument("--runs", type=int, default=7)
    given = parser.parse_args()
    for name in PROBLEMS:
        if not given.words or any(word in name for word in given.words):
            compare(name, given.runs)


if __name__ == "__main__":
    main()
