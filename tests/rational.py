"""Linear complementarity problems of small integers, solved in rational numbers."""

import math
from fractions import Fraction
from itertools import product


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
    found, infinite = set(), False
    for free in product((False, True), repeat=n):
        equations = [rows[i] if free[i] else _unit(i, n) for i in range(n)]
        solved = _solve(equations, [-rest[i] if free[i] else Fraction(0) for i in range(n)])
        if solved is None:
            continue
        start, ways = solved
        sides = [(_unit(i, n), Fraction(0)) if free[i] else (rows[i], rest[i]) for i in range(n)]
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


def _solve(A, b):
    """Return a solution of A x = b and a basis of the null space; None without solution."""
    rows, pivots = [[*row, value] for row, value in zip(A, b, strict=True)], []
    n = len(A[0])
    for column in range(n):
        rank = len(pivots)
        pivot = next((i for i in range(rank, n) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        rows[rank] = [x / rows[rank][column] for x in rows[rank]]
        for i in set(range(n)) - {rank}:
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
