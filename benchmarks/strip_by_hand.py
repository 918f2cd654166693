"""The path of a strip with friction in a bare loop: what it costs with nothing but arithmetic.

The unknowns are the contact forces lam, normal ones first. With the compliance C the displacements
are C (f + lam). Each row of B lam = q + alpha q1 says what a displacement has to be, and is a row
of C, or what a force has to be. At a transition one or two rows are replaced. Each costs a column
of the inverse of B; then there is one product with C and one ratio test. Nothing is recorded, no
error is estimated, and corners and folds are not looked for: these paths have none.
"""

from __future__ import annotations

import numpy as np
from pwscont_coulomb import CoulombLoad
from pwscont_coulomb.modes import Mode, modes
from scipy.linalg import solve_triangular

from pwscont import Character

#: Replaced rows that are taken up into the inverse together.
TOGETHER = 48
#: Which way a node slips, by its mode.
SIDE = np.array([0.0, 0.0, 1.0, -1.0])


class Inverse:
    """The inverse of a matrix whose rows are replaced one by one, in product form."""

    def __init__(self, rows: np.ndarray) -> None:
        n = len(rows)
        self.rows, self.taken = rows, np.asfortranarray(np.linalg.inv(rows))
        self.columns, self.changes = np.empty((n, TOGETHER), order="F"), np.empty((TOGETHER, n))
        self.pivots, self.count = np.zeros((TOGETHER, TOGETHER)), 0

    def applied(self, x: np.ndarray) -> np.ndarray:
        """Return what the replaced rows make of the first inverse times something."""
        k = self.count
        parts = solve_triangular(
            self.pivots[:k, :k], self.changes[:k] @ x, lower=True, check_finite=False
        )
        return x - self.columns[:, :k] @ parts

    def replace(self, r: int, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Replace a row; return the change, and its column of the inverse over the pivot."""
        if self.count == TOGETHER:
            self.taken, self.count = np.asfortranarray(self.applied(self.taken)), 0
        k, change, column = self.count, row - self.rows[r], self.applied(self.taken[:, r])
        pivot = 1.0 + change @ column
        self.pivots[k, :k], self.pivots[k, k] = change @ self.columns[:, :k], pivot
        self.columns[:, k], self.changes[k], self.rows[r] = column, change, row
        self.count += 1
        return change, column / pivot


class StripByHand:
    """A strip on its way to alpha = 1.

    Parameters
    ----------
    system : CoulombLoad
        Of a body whose displacements are those of the contact nodes, normal ones first.
    z : ndarray
        The state at alpha = 0.
    character : Character
        The cell in which the path begins.
    """

    def __init__(self, system: CoulombLoad, z: np.ndarray, character: Character) -> None:
        body, self.p, self.friction = system.body, system.body.p, system.friction
        self.gap, self.mode = np.concatenate([body.gap, np.zeros(self.p)]), modes(character).copy()
        self.compliance = np.linalg.inv(body.A)
        self.pull = self.compliance @ (system.load_at(1.0) - system.load_at(0.0))
        self.u, self.lam = np.split(z.copy(), 2)
        self.inverse = Inverse(np.array([self.row(r) for r in range(2 * self.p)]))
        self.wanted = np.array([self.speed_wanted(r) for r in range(2 * self.p)])
        self.speed = self.inverse.taken @ self.wanted

    def follow(self) -> int:
        """Go to alpha = 1; return the number of transitions."""
        left, transitions = 1.0, 0
        while True:
            moving = self.pull + self.compliance @ self.speed
            falls = self.falls(moving)
            first = int(falls.argmin())
            step = min(float(falls.flat[first]), left)
            self.u += step * moving
            self.lam += step * self.speed
            left -= step
            if not left:
                return transitions
            self.cross(*divmod(first, self.p))
            transitions += 1

    def falls(self, moving: np.ndarray) -> np.ndarray:
        """Return how far it is until each test vanishes, shape (3, p)."""
        values, slopes = self.tests(self.u - self.gap, self.lam), self.tests(moving, self.speed)
        never = np.full(values.shape, np.inf)
        return np.divide(np.maximum(values, 0.0), -slopes, out=never, where=slopes < 0.0)

    def tests(self, u: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """Return what is positive inside the cell, or its slope; 0 where there is no test."""
        (over, along), (normal, shear) = np.split(u, 2), np.split(lam, 2)
        away, sticks = self.mode == Mode.NO_CONTACT, self.mode == Mode.STICK
        limit = -self.friction * normal
        return np.stack(
            [
                np.where(sticks, 0.0, np.where(away, -over, -normal)),
                np.where(sticks, limit - shear, SIDE[self.mode] * along),
                np.where(sticks, limit + shear, 0.0),
            ]
        )

    def cross(self, test: int, node: int) -> None:
        """Go on in the cell beyond a test of a node; stick and slip share their normal row."""
        self.mode[node] = self.beyond(test, node)
        for r in (node, self.p + node)[test > 0 :]:
            change, column = self.inverse.replace(r, self.row(r))
            before, self.wanted[r] = self.wanted[r], self.speed_wanted(r)
            self.speed += (self.wanted[r] - before - change @ self.speed) * column

    def beyond(self, test: int, node: int) -> Mode:
        """Return the mode of a node beyond a test."""
        if self.mode[node] == Mode.NO_CONTACT:
            return Mode.SLIP_PLUS if self.u[self.p + node] > 0.0 else Mode.SLIP_MINUS
        if self.mode[node] == Mode.STICK:
            return Mode.SLIP_MINUS if test == 1 else Mode.SLIP_PLUS
        return Mode.STICK if test == 1 else Mode.NO_CONTACT

    def is_held(self, r: int) -> bool:
        """Tell whether a row says what a displacement is."""
        mode = self.mode[r % self.p]
        return bool(mode == Mode.STICK or (r < self.p and mode != Mode.NO_CONTACT))

    def row(self, r: int) -> np.ndarray:
        """Return a row of B: C (f + lam) = gap, lam = 0, or lam_t = +-F lam_n."""
        if self.is_held(r):
            return self.compliance[r]
        row = np.zeros(2 * self.p)
        row[r] = 1.0
        if r >= self.p:
            node = r - self.p
            row[node] = -SIDE[self.mode[node]] * self.friction[node]
        return row

    def speed_wanted(self, r: int) -> float:
        """Return how fast the right-hand side of a row changes with alpha."""
        return -float(self.pull[r]) if self.is_held(r) else 0.0
