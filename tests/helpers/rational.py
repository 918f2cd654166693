"""Piecewise-linear families of small integers, solved in rational numbers."""

import math
from fractions import Fraction
from itertools import product

import numpy as np

from pwscont import Switched


def integer_family(rng):
    """Return M, q, d, e of min(z, M z + q + alpha d + mu e) = 0, often singular or tied."""
    n, most = int(rng.integers(1, 4)), int(rng.choice([1, 2, 5]))
    M, (q, d, e) = rng.integers(-most, most + 1, (n, n)), rng.integers(-most, most + 1, (3, n))
    if rng.random() < 0.3:
        e = d * int(rng.integers(-1, 2))
    if rng.random() < 0.3 and n > 1:
        M[-1] = M[0] * int(rng.integers(-1, 3))
    return M, q, d, e


def number_of_solutions(M, q, d, e, alpha, mu):
    """Return how many solutions there are, by all choices of which unknowns are zero.

    None where a singular choice has one point only, or several without interior.
    """
    n = len(q)
    rows = [[Fraction(int(v)) for v in row] for row in M]
    rest = [int(q[i]) + alpha * int(d[i]) + mu * int(e[i]) for i in range(n)]

    def cell(free):
        lines = [((_unit(i, n), Fraction(0)), (rows[i], rest[i])) for i in range(n)]
        return [pair[f] for pair, f in zip(lines, free, strict=True)], [
            pair[not f] for pair, f in zip(lines, free, strict=True)
        ]

    return _count(map(cell, product((False, True), repeat=n)))


#: What each kink multiplies its argument by, where it is negative and where not.
KINKS = {"abs": (-1, 1), "relu": (0, 1), "least": (1, 0)}


class SwitchedFamily:
    """A z + B y + c (1, alpha, mu) = 0 with y_j a kink of G_j z + H_j y + g_j (1, alpha, mu).

    Each kink depends on the earlier ones only. All numbers are small integers.
    """

    def __init__(self, rng):
        self.n, self.k = n, k = int(rng.integers(1, 4)), int(rng.integers(1, 5))
        most = int(rng.choice([1, 2, 5]))
        shapes = (n, n), (n, k), (n, 3), (k, n), (k, k), (k, 3)
        A, B, c, G, H, g = (rng.integers(-most, most + 1, shape) for shape in shapes)
        self.kinks = [str(kink) for kink in rng.choice(list(KINKS), k)]
        H[:] = np.tril(H, -1) * int(rng.integers(2))
        c[:, 1:] *= int(rng.integers(3) > 0)
        g[:, 1:] *= int(rng.integers(3) > 0)
        if n > 1 and rng.integers(3) == 0:
            A[1] = A[0] * int(rng.integers(-1, 2))
        self.A, self.B, self.c, self.G, self.H, self.g = A, B, c, G, H, g

    def system(self, mu):
        """Return the system at one mu, written with switches."""
        A, B, c, G, H, g = (
            m.astype(float) for m in (self.A, self.B, self.c, self.G, self.H, self.g)
        )

        def f(z, t, sw):
            y = []
            for j, kink in enumerate(self.kinks):
                argument = G[j] @ z + g[j, 0] + g[j, 1] * t + g[j, 2] * mu
                argument = argument + sum(H[j, i] * y[i] for i in range(j))
                call = {"abs": sw.abs, "relu": sw.relu, "least": lambda a: sw.min(a, 0.0)}[kink]
                y.append(call(argument))
            rows = (A[i] @ z + sum(B[i, j] * y[j] for j in range(self.k)) for i in range(self.n))
            return np.stack(
                [row + r[0] + r[1] * t + r[2] * mu for row, r in zip(rows, c, strict=True)]
            )

        return Switched(self.n, f, linear=True)

    def number_of_solutions(self, alpha, mu):
        """Return how many solutions there are; None as :func:`number_of_solutions`."""
        at = (Fraction(1), Fraction(alpha), Fraction(mu))

        def combined(line, by_y, constants, y):
            """Return line z + by_y y + constants as (coefficients of z, rest)."""
            a, b = [Fraction(int(v)) for v in line], _dot(map(int, constants), at)
            for weight, (coefficients, rest) in zip(map(int, by_y), y, strict=False):
                a = [x + weight * v for x, v in zip(a, coefficients, strict=True)]
                b += weight * rest
            return a, b

        def cell(signs):
            y, sides = [], []
            for j, sign in enumerate(signs):
                a, b = combined(self.G[j], self.H[j], self.g[j], y)
                factor, side = KINKS[self.kinks[j]][sign], 1 if sign else -1
                y.append(([factor * v for v in a], factor * b))
                sides.append(([side * v for v in a], side * b))
            rows = zip(self.A, self.B, self.c, strict=True)
            return [combined(*row, y) for row in rows], sides

        return _count(map(cell, product((False, True), repeat=self.k)))


def _count(cells):
    """Return the number of points that solve the equations and inequalities of some cell."""
    found, infinite = set(), False
    for equations, sides in cells:
        solved = solve([a for a, _ in equations], [-b for _, b in equations])
        if solved is None:
            continue
        start, ways = solved
        around = [[*(_dot(a, way) for way in ways), _dot(a, start) + b] for a, b in sides]
        if not ways:
            found |= {tuple(start)} if min(row[0] for row in around) >= 0 else set()
        elif _is_feasible(around, strictly=True):
            infinite = True
        elif _is_feasible(around, strictly=False):
            return None
    return math.inf if infinite else len(found)


def _unit(i, n):
    return [Fraction(int(i == j)) for j in range(n)]


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def solve(A, b):
    """Return a solution of A x = b and a basis of the null space; None without solution."""
    rows, pivots = [[*row, value] for row, value in zip(A, b, strict=True)], []
    n = len(A[0])
    for column in range(n):
        rank = len(pivots)
        pivot = next((i for i in range(rank, len(rows)) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        rows[rank] = [x / rows[rank][column] for x in rows[rank]]
        for i in set(range(len(rows))) - {rank}:
            rows[i] = [x - rows[i][column] * y for x, y in zip(rows[i], rows[rank], strict=True)]
        pivots.append(column)
    if any(row[-1] for row in rows[len(pivots) :]):
        return None
    start = [Fraction(0)] * n
    for row, column in zip(rows, pivots, strict=False):
        start[column] = row[-1]
    ways = []
    for free in sorted(set(range(n)) - set(pivots)):
        ways.append(_unit(free, n))
        for row, column in zip(rows, pivots, strict=False):
            ways[-1][column] = -row[free]
    return start, ways


def _is_feasible(rows, strictly):
    """Tell whether a . s + b >= 0 for all rows (*a, b) has a solution (Fourier and Motzkin)."""
    sides = [(row, strictly and any(row[:-1])) for row in rows]
    while len(sides[0][0]) > 1:
        above = [(row, strict) for row, strict in sides if row[0] > 0]
        below = [(row, strict) for row, strict in sides if row[0] < 0]
        sides = [(row[1:], strict) for row, strict in sides if row[0] == 0]
        for (a, one), (b, other) in product(above, below):
            both = [x / a[0] - y / b[0] for x, y in zip(a[1:], b[1:], strict=True)]
            sides.append((both, one or other))
        if not sides:
            return True
    return all(row[0] > 0 if strict else row[0] >= 0 for row, strict in sides)
