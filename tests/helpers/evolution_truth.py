"""All evolutions of small bodies with friction by brute force: every mode of every node, in numpy.

Nothing of pwscont is used. At each event all combinations of modes are tried on the full system of
displacements and contact forces; the evolutions are followed one by one and compared afterwards.
"""

from dataclasses import dataclass, field
from itertools import product

import numpy as np

#: A quantity is zero below this part of the typical ones.
ZERO = 1e-9
#: A history with more open evolutions, or more events, is left out.
MOST_STATES, MOST_EVENTS = 64, 400
#: Where pieces are shorter, events accumulate, and brute force decides by its tolerance.
SHORTEST = 1e-7


class TooManyError(Exception):
    """The history has too many evolutions for brute force."""


@dataclass
class Problem:
    """A body, polygon of loads over 0, 1, ..., friction and initial slip."""

    A: np.ndarray
    N: np.ndarray
    T: np.ndarray
    gap: np.ndarray
    loads: np.ndarray
    F: np.ndarray
    slip: np.ndarray

    def load(self, t):
        leg = min(int(t), len(self.loads) - 2)
        return self.loads[leg] + (t - leg) * (self.loads[leg + 1] - self.loads[leg])

    @property
    def p(self):
        return len(self.N)

    @property
    def length(self):
        return max(1.0, np.abs(np.linalg.solve(self.A, self.loads.T)).max())

    @property
    def force(self):
        return max(1.0, np.abs(self.loads).max())


@dataclass
class Truth:
    """Segments (t0, z0, t1, z1), single states, and losses (t, z)."""

    segments: list = field(default_factory=list)
    losses: list = field(default_factory=list)
    branchings: int = 0

    def states(self, t):
        """Return the different states at a time at which nothing happens."""
        found = []
        for t0, z0, t1, z1 in self.segments:
            if t0 <= t <= t1:
                z = z0 + (t - t0) / (t1 - t0) * (z1 - z0)
                if not any(np.abs(z - other).max() < 1e-7 for other in found):
                    found.append(z)
        return found


def solved(problem, modes, f, held_n, held_t):
    """Return (u, lam_nu, lam_t) in some modes, None where the equations are singular.

    Contact: N u = held_n. Stick: T u = held_t. Slip: lam_t = +-F lam_nu.
    """
    A, N, T, F, p = problem.A, problem.N, problem.T, problem.F, problem.p
    n = len(A)
    M, b = np.zeros((n + 2 * p, n + 2 * p)), np.zeros(n + 2 * p)
    M[:n, :n], M[:n, n : n + p], M[:n, n + p :] = A, -N.T, -T.T
    b[:n] = f
    for i, mode in enumerate(modes):
        row, tow = n + i, n + p + i
        if mode == "open":
            M[row, n + i] = M[tow, n + p + i] = 1.0
            continue
        M[row, :n], b[row] = N[i], held_n[i]
        if mode == "stick":
            M[tow, :n], b[tow] = T[i], held_t[i]
        else:
            M[tow, n + p + i], M[tow, n + i] = 1.0, -F[i] if mode == "plus" else F[i]
    if np.linalg.cond(M) > 1e12:
        return None
    return np.linalg.solve(M, b)


def statics(problem, t):
    """Return all equilibria with the initial slip, by all modes."""
    p, found = problem.p, []
    for modes in product(("open", "stick", "plus", "minus"), repeat=p):
        z = solved(problem, modes, problem.load(t), problem.gap, problem.slip)
        if z is None or not all(_static(problem, z, i, m) for i, m in enumerate(modes)):
            continue
        if not any(np.abs(z - other).max() < 1e-8 for other in found):
            found.append(z)
    return found


def _static(problem, z, i, mode):
    n, p, F = len(problem.A), problem.p, problem.F[i]
    u_n, u_t = problem.N[i] @ z[:n] - problem.gap[i], problem.T[i] @ z[:n] - problem.slip[i]
    ln, lt = z[n + i], z[n + p + i]
    d, f = ZERO * problem.length, ZERO * problem.force
    if mode == "open":
        return u_n <= d
    if ln > f:
        return False
    if mode == "stick":
        return abs(lt) <= -F * ln + f
    return u_t >= -d if mode == "plus" else u_t <= d


def options(problem, z):
    """Return the modes that each node may be in at a state."""
    n, p = len(problem.A), problem.p
    d, f = ZERO * problem.length, ZERO * problem.force
    for i in range(p):
        F, ln, lt = problem.F[i], z[n + i], z[n + p + i]
        if ln > -f:
            apart = problem.gap[i] - problem.N[i] @ z[:n] > d
            yield ("open",) if apart else ("open", "stick", "plus", "minus")
        elif abs(lt) < -F * ln - f:
            yield ("stick",)
        elif F == 0.0:
            yield ("plus",)
        else:
            yield ("stick", "plus") if lt < 0 else ("stick", "minus")


def rates(problem, z, t):
    """Return all solutions of the rate problem at a state, each with its modes."""
    leg = min(int(t + 1e-9), len(problem.loads) - 2)
    slope = problem.loads[leg + 1] - problem.loads[leg]
    choices, zero, found = list(options(problem, z)), np.zeros(problem.p), []
    for modes in product(*choices):
        rate = solved(problem, modes, slope, zero, zero)
        if rate is None:
            continue
        checks = (_rate(problem, z, rate, i, m, choices[i]) for i, m in enumerate(modes))
        if all(checks) and not any(np.abs(rate - o).max() < 1e-8 for o, _ in found):
            found.append((rate, modes))
    return found


def on_piece(problem, z, t, when, way):
    """Return the state on a piece that leaves z, solved for anew: errors of many pieces do not add.

    On a steep piece the end is rough, as the time of the end is; the next piece begins afresh.
    """
    rate, modes = way
    held_t = problem.T @ z[: len(problem.A)]
    state = solved(problem, modes, problem.load(when), problem.gap, held_t)
    return z + (when - t) * rate if state is None else state


def _rate(problem, z, rate, i, mode, choices):
    n, p, F = len(problem.A), problem.p, problem.F[i]
    u_n, u_t, ln, lt = (
        problem.N[i] @ rate[:n],
        problem.T[i] @ rate[:n],
        rate[n + i],
        rate[n + p + i],
    )
    d, f = 1e-9 * (1.0 + np.abs(rate[:n]).max()), 1e-9 * (1.0 + np.abs(rate[n:]).max())
    bound = lt - F * ln if "plus" in choices else -lt - F * ln
    holds = {
        "open": u_n <= d,
        "plus": u_t >= -d,
        "minus": u_t <= d,
        "stick": abs(lt) <= -F * ln + f if len(choices) == 4 else bound >= -f,
    }
    pulls = len(choices) == 4 and mode != "open" and ln > f
    return len(choices) == 1 or (holds[mode] and not pulls)


def next_event(problem, z, rate, t):
    """Return when the first inequality fails, at most the next corner of the load."""
    n, p, F = len(problem.A), problem.p, problem.F
    u_n, ln, lt = problem.N @ z[:n], z[n : n + p], z[n + p :]
    v_n, rn, rt = problem.N @ rate[:n], rate[n : n + p], rate[n + p :]
    end = min(np.floor(t + 1e-9) + 1.0, float(len(problem.loads) - 1))
    d, f = ZERO * problem.length, ZERO * problem.force
    best = end - t
    for values, slopes, slack in (
        (problem.gap - u_n, -v_n, d),
        (-ln, -rn, f),
        (-F * ln - lt, -F * rn - rt, f),
        (-F * ln + lt, -F * rn + rt, f),
    ):
        for value, slope in zip(values, slopes, strict=True):
            if value > slack and slope < -1e-12 * (1.0 + np.abs(slopes).max()):
                best = min(best, value / -slope)
    return t + best


def evolutions(problem):
    """Return all evolutions from all equilibria at the beginning, or refuse if they are many."""
    truth, end = Truth(), float(len(problem.loads) - 1)
    open_ = [(0.0, z) for z in statics(problem, 0.0)]
    events = 0
    while open_:
        open_.sort(key=lambda pair: pair[0])
        t, z = open_.pop(0)
        same = [k for k, o in enumerate(open_) if abs(o[0] - t) < 1e-8 and _close(o[1], z)]
        open_ = [o for k, o in enumerate(open_) if k not in same]
        if t >= end - 1e-9:
            continue
        events += 1
        if events > MOST_EVENTS or len(open_) > MOST_STATES:
            raise TooManyError
        ways = rates(problem, z, t)
        truth.branchings += len(ways) > 1
        if not ways:
            truth.losses.append((t, z))
        for way in ways:
            until = next_event(problem, z, way[0], t)
            if until - t < SHORTEST:
                raise TooManyError  # events accumulate, as of seed 8272
            ends = [on_piece(problem, z, t, when, way) for when in (t, until)]
            truth.segments.append((t, ends[0], until, ends[1]))
            open_.append((until, ends[1]))
    return truth


def _close(a, b):
    return np.abs(a - b).max() < 1e-8


def random_problem(seed, power=1.0, slips=0.3):
    """Return a random history of one to three nodes, F from 0 to 8, some with gaps and slip.

    A smaller power makes high friction more frequent; ``slips`` is how often there is initial slip.
    """
    rng = np.random.default_rng([35, seed])
    p = int(rng.integers(1, 4))
    n = 2 * p + int(rng.integers(0, 2))
    root = rng.normal(size=(n, n))
    A = root @ root.T + 0.05 * np.eye(n)
    pick = np.eye(n)
    gap = rng.uniform(0.0, 0.6, p) * (rng.random(p) < 0.3)
    count, around = int(rng.integers(2, 11)), rng.normal(size=n)
    loads = 2.0 * (around + rng.uniform(0.3, 1.5) * rng.normal(size=(count, n)))
    if rng.random() < 0.5:
        loads[0] = 0.0
    F = 8.0 * rng.random() ** power * (1.0 if rng.random() < 0.85 else 0.1) * np.ones(p)
    if rng.random() < 0.1:
        F[int(rng.integers(p))] = 0.0
    slip = rng.normal(size=p) * (rng.random() < slips)
    return Problem(A, pick[0 : 2 * p : 2], pick[1 : 2 * p : 2], gap, loads, F, slip)
