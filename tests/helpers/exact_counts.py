"""The number of points of a union of polyhedra, in rational numbers, flat ones included."""

import math
from fractions import Fraction

from rational import solve


def count_of(cells):
    """Return how many points solve the equations and inequalities of some cell.

    Equations and inequalities (>= 0) are pairs of coefficients and a constant.
    """
    found = set()
    for equations, sides in cells:
        point, dimension = _polyhedron(equations, sides)
        if dimension > 0:
            return math.inf
        found |= {point} if dimension == 0 else set()
    return len(found)


def _polyhedron(equations, sides):
    """Return a point and the dimension of a polyhedron; -1 where it is empty."""
    solved = _solve(equations)
    if solved is None:
        return None, -1
    start, ways = solved
    rows = [(tuple(_dot(a, way) for way in ways), _dot(a, start) + b, False) for a, b in sides]
    if not _is_feasible(rows, len(ways)):
        return None, -1
    equal = [
        (a, b)
        for i, (a, b, _) in enumerate(rows)
        if not _is_feasible([*rows[:i], (a, b, True), *rows[i + 1 :]], len(ways))
    ]
    inner, free = _solve(equal) if equal else (None, ways)
    if free:
        return None, len(free)
    weights = inner or ()
    point = [
        s + sum(w * way[i] for w, way in zip(weights, ways, strict=True))
        for i, s in enumerate(start)
    ]
    return tuple(point), 0


def _is_feasible(rows, unknowns):
    """Tell whether a . s + b >= 0, or > 0, has a solution for all rows (Fourier and Motzkin)."""
    for j in range(unknowns):
        above, below = ([r for r in rows if side * r[0][j] > 0] for side in (1, -1))
        left = {r for r in rows if r[0][j] == 0}
        for a, b, one in above:
            for c, d, other in below:
                row = [a[j] * y - c[j] * x for x, y in zip((*a, b), (*c, d), strict=True)]
                size = max(map(abs, row)) or 1
                *both, rest = (value / size for value in row)
                left.add((tuple(both), rest, one or other))
        rows = list(left)
    return all(b > 0 if strict else b >= 0 for _, b, strict in rows)


def _solve(equations):
    """Return a solution of a . x + b = 0 and a basis of the null space, None without solution."""
    return solve([a for a, _ in equations], [-b for _, b in equations])


def _dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))
