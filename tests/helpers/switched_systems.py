"""Problems with max, min, abs, relu and clip, and all their solutions by ways that know no pwscont.

Each truth tries every combination of modes with matrices written by hand.
"""

from itertools import product

import numpy as np

#: Solutions are one if they differ by less; modes are consistent up to this.
SAME, SLACK = 1e-7, 1e-9


def distinct(solutions):
    """Return solutions, each once."""
    found = []
    for z in solutions:
        if not any(np.abs(z - other).max() < SAME for other in found):
            found.append(z)
    return found


def agree(one, other):
    """Tell whether two lists have the same solutions."""
    near = [min((np.abs(z - y).max() for y in other), default=np.inf) for z in one]
    return len(one) == len(other) and all(
        apart < SAME * (1.0 + np.abs(one).max()) for apart in near
    )


def lcp_solutions(M, q):
    """z >= 0, w = M z + q >= 0, z w = 0, over 2^n."""
    n, found = len(q), []
    for active in product([False, True], repeat=n):
        free = np.array(active)
        A, b = np.where(free[:, None], M, np.eye(n)), np.where(free, -q, 0.0)
        z = np.linalg.solve(A, b)
        if (z >= -SLACK).all() and (M @ z + q >= -SLACK).all():
            found.append(z)
    return distinct(found)


def clip_solutions(B, a, lower=0.0, upper=1.0):
    """x = clip(B x + a, lower, upper), over 3^N."""
    n, found = len(a), []
    for modes in product([-1, 0, 1], repeat=n):
        mode = np.array(modes)
        A = np.where((mode == 0)[:, None], np.eye(n) - B, np.eye(n))
        b = np.where(mode == 0, a, np.where(mode < 0, lower, upper))
        x = np.linalg.solve(A, b)
        v = B @ x + a
        low, high = v - lower <= SLACK, v - upper >= -SLACK
        between = (v - lower >= -SLACK) & (v - upper <= SLACK)
        if np.where(mode < 0, low, np.where(mode > 0, high, between)).all():
            found.append(x)
    return distinct(found)


def relu_solutions(W, b):
    """z = max(0, W z + b), over 2^n."""
    n, found = len(b), []
    for signs in product([0.0, 1.0], repeat=n):
        on = np.array(signs)
        z = np.linalg.solve(np.eye(n) - on[:, None] * W, on * b)
        if ((2.0 * on - 1.0) * (W @ z + b) >= -SLACK).all():
            found.append(z)
    return distinct(found)


# -- random nested switches ----------------------------------------------------------------------
#
# A tree is ("affine", row of n + 2 numbers for (z, alpha, 1)), or an operation with trees.


def random_tree(rng, n, depth):
    """Return a random nested function of (z, alpha)."""
    if depth == 0:
        return ("affine", rng.normal(size=n + 2))
    operation = rng.choice(["max", "min", "abs", "relu", "clip", "sum"])
    count = {"max": 2, "min": 2, "sum": 2}.get(operation, 1)
    inner = [random_tree(rng, n, int(rng.integers(0, depth))) for _ in range(count - 1)]
    inner.append(random_tree(rng, n, depth - 1))
    return (str(operation), *inner)


def written(tree, z, alpha, sw):
    """Return the value of a tree, as a user writes it."""
    operation, *inner = tree
    if operation == "affine":
        row = inner[0]
        return row[:-2] @ z + row[-2] * alpha + row[-1]
    values = [written(each, z, alpha, sw) for each in inner]
    if operation == "sum":
        return values[0] - 0.5 * values[1]
    if operation == "clip":
        return sw.clip(values[0], -0.4, 0.7)
    return getattr(sw, operation)(*values)


def switches_of(tree):
    """Return the numbers of modes of the switches of a tree, inner ones first."""
    operation, *inner = tree
    if operation == "affine":
        return []
    own = {"sum": [], "clip": [3]}.get(operation, [2])
    return [number for each in inner for number in switches_of(each)] + own


def frozen(tree, modes):
    """Return the affine row of a tree with frozen switches, and rows that must not be negative."""
    operation, *inner = tree
    if operation == "affine":
        return inner[0], []
    parts = [frozen(each, modes) for each in inner]
    rows, conditions = [row for row, _ in parts], [c for _, some in parts for c in some]
    one = np.zeros_like(rows[0])
    one[-1] = 1.0
    if operation == "sum":
        return rows[0] - 0.5 * rows[1], conditions
    mode = modes.pop(0)
    if operation == "clip":
        low, high = rows[0] + 0.4 * one, rows[0] - 0.7 * one
        value = (-0.4 * one, rows[0], 0.7 * one)[mode]
        return value, conditions + [[-low], [low, -high], [high]][mode]
    a, b = {"abs": (rows[0], -rows[0]), "relu": (rows[0], 0.0 * one)}.get(operation, (None, None))
    a, b = (rows[0], rows[1]) if a is None else (a, b)
    larger = (a - b) if mode else (b - a)
    first = bool(mode) != (operation == "min")
    return (a if first else b), [*conditions, larger]


def tree_solutions(trees, alpha):
    """Return all z at which every tree is zero, over all modes."""
    counts, found = [number for tree in trees for number in switches_of(tree)], []
    for modes in product(*map(range, counts)):
        rest = list(modes)
        pairs = [frozen(tree, rest) for tree in trees]
        rows = np.array([row for row, _ in pairs])
        conditions = np.array([row for _, some in pairs for row in some]).reshape(-1, rows.shape[1])
        z = np.linalg.solve(rows[:, :-2], -rows[:, -2] * alpha - rows[:, -1])
        if (conditions @ np.append(z, [alpha, 1.0]) >= -SLACK).all():
            found.append(z)
    return distinct(found)


# -- circuits ------------------------------------------------------------------------------------


def schmitt(z, vin, sw):
    """Two Ebers-Moll transistors: unknowns are the voltages of base 1, base 2, emitter, c1, c2."""
    b1, b2, e, c1, c2 = z

    def transistor(base, collector):
        forward = sw.relu((base - e - 0.6) / 0.02)
        back = sw.relu((base - collector - 0.5) / 0.02)
        collects, emits = 0.99 * forward - back, forward - 0.5 * back
        return collects, emits, emits - collects

    ic1, ie1, ib1 = transistor(b1, c1)
    ic2, ie2, ib2 = transistor(b2, c2)
    return np.array(
        [
            (vin - b1) - ib1,
            (c1 - b2) / 10.0 - b2 / 10.0 - ib2,
            ie1 + ie2 - e / 0.5,
            (10.0 - c1) / 4.0 - (c1 - b2) / 10.0 - ic1,
            (10.0 - c2) / 1.5 - ic2,
        ]
    )


SCHMITT_FOLDS = [1.4792248062015503, 3.2125124847178763]


def ladder(sections, thresholds):
    """Return a diode ladder: N sections of series R = 1 and shunt diode."""

    def f(v, source, sw):
        before = np.concatenate([np.ravel(source), v[:-1]])
        after = np.concatenate([v[1:], v[-1:]])
        return (before - v) - (v - after) - sw.relu(v - thresholds) / 0.05

    return f


def ladder_source(last, thresholds):
    """Return the source that gives the last diode this voltage: the ladder from its end."""
    after, v = last, last
    for threshold in thresholds[::-1]:
        after, v = v, v + (v - after) + max(0.0, v - threshold) / 0.05
    return v
