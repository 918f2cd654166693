"""A plain incremental scheme for contact with friction, in numpy: the scheme that others use.

Nothing of pwscont is used. The load goes in steps; at the end of each step the static problem
holds, with friction against the slip since the step before (backward differences). Each step is
solved by changes of modes until no mode changes: of all nodes at once, then of one by one (Murty).
"""

import numpy as np

OPEN, STICK, PLUS, MINUS = range(4)
#: So many changes of all nodes at once, then so many changes of the first wrong node alone.
MOST_AT_ONCE, MOST_ALONE = 30, 2000


class NotSettledError(Exception):
    """The modes of a step do not settle."""


def flexibility(A, N, T):
    """Return contact displacements by contact forces, shape (2 p, 2 p), and B = [N; T]."""
    B = np.vstack([N, T])
    return B @ np.linalg.solve(A, B.T), B


def solved(C, gap, F, g, before, modes):
    """Return contact forces of some modes: u = g + C lam."""
    p = len(gap)
    M, right = np.eye(2 * p), np.zeros(2 * p)
    touches, sticks = np.flatnonzero(modes != OPEN), np.flatnonzero(modes == STICK)
    M[touches], right[touches] = C[touches], (gap - g[:p])[touches]
    M[p + sticks], right[p + sticks] = C[p + sticks], (before - g[p:])[sticks]
    for mode, sign in ((PLUS, 1.0), (MINUS, -1.0)):
        slips = np.flatnonzero(modes == mode)
        M[p + slips, slips] = -sign * F[slips]
    return np.linalg.solve(M, right)


def step(C, gap, F, g, before, modes):
    """Return forces and modes at the end of a step that begins with some slip and modes."""
    p = len(gap)
    stiff = 1.0 / np.diag(C)
    for change in range(MOST_AT_ONCE + MOST_ALONE):
        forces = solved(C, gap, F, g, before, modes)
        u = g + C @ forces
        press = forces[:p] - stiff[:p] * (u[:p] - gap)
        shear = forces[p:] - stiff[p:] * (u[p:] - before)
        tiny = 1e-12 * (np.abs(forces).max() + np.abs(stiff * u).max())
        asked = np.select(
            [press >= -tiny, shear < F * press - tiny, shear > -F * press + tiny],
            [OPEN, PLUS, MINUS],
            STICK,
        )
        if (asked == modes).all():
            return forces, modes
        wrong = np.flatnonzero(asked != modes)
        modes = modes.copy()
        changed = wrong if change < MOST_AT_ONCE else wrong[:1]
        modes[changed] = asked[changed]
    raise NotSettledError


def increments(A, N, T, gap, F, loads, steps, slip=None):
    """Return (forces, u_t) at the corners of a polygon of loads, with so many steps for each line.

    Parameters
    ----------
    A, N, T, gap, F : ndarray
        Dense; F of shape (p,).
    loads : ndarray, shape (k, n)
    steps : int
    slip : ndarray, shape (p,), optional
    """
    C, B = flexibility(A, N, T)
    p = len(gap)
    free = B @ np.linalg.solve(A, loads.T)
    before, modes = np.zeros(p) if slip is None else slip, np.full(p, STICK)
    forces, modes = step(C, gap, F, free[:, 0], before, modes)
    states = [(forces, (free[:, 0] + C @ forces)[p:])]
    before = states[0][1]
    for leg in range(len(loads) - 1):
        for k in range(1, steps + 1):
            part = k / steps
            g = (1.0 - part) * free[:, leg] + part * free[:, leg + 1]
            forces, modes = step(C, gap, F, g, before, modes)
            before = (g + C @ forces)[p:]
        states.append((forces, before))
    return states
