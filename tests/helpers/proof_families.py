"""Random systems with switches whose solutions are known without interval arithmetic."""

from itertools import pairwise

import numpy as np

from pwscont import Everywhere, Switched
from pwscont.curve.metric import Metric
from pwscont.proof.boxes import MOST_BOXES, Domain, covered
from pwscont.proof.interval import Interval
from pwscont.proof.tape import traced


def proved(f, n, box, interval, seconds=20.0):
    """Return the proof for a formula whose unknowns are of the order of one."""
    metric = Metric(np.append(np.ones(n), interval[1] - interval[0]), interval)
    return Everywhere(box=box, seconds=seconds).prove(Switched(n, f), metric, interval)


def domain_of(f, n, box, interval):
    """Return a formula whose unknowns are of the order of one, in a box."""
    lo, hi = (np.append(np.full(n, end), alpha) for end, alpha in zip(box, interval, strict=True))
    return Domain(traced(f, n), Interval(lo, hi), np.append(np.ones(n), interval[1] - interval[0]))


def accepted_in(domain):
    """Return the boxes that the search accepts, shape (k, n + 1)."""
    with np.errstate(all="ignore"):
        return covered(domain, domain.box[np.newaxis], domain.continues, 20.0, MOST_BOXES)[0]


class PiecewisePolynomial:
    """A polynomial of one unknown, plus kinks, plus b alpha + e alpha z."""

    def __init__(self, rng):
        self.c = rng.normal(size=rng.integers(2, 6))
        self.kinks = rng.normal(size=rng.integers(0, 4))
        self.sizes = rng.normal(size=len(self.kinks)) * 2.0
        self.b, self.e = rng.normal(), rng.normal() * rng.integers(0, 2)

    def __call__(self, z, alpha, sw):
        x, y = z[0], self.c[0] + self.b * alpha + self.e * alpha * z[0]
        for k, c in enumerate(self.c[1:], start=1):
            y = y + c * x**k
        for kink, size in zip(self.kinks, self.sizes, strict=True):
            y = y + size * sw.abs(x - kink)
        return np.array([y])

    def count(self, alpha, lo, hi):
        """Return the number of solutions between lo and hi, None where rounding could decide."""
        between = self.kinks[(self.kinks > lo) & (self.kinks < hi)]
        ends = np.sort(np.concatenate([[lo, hi], between]))
        found = [x for a, b in pairwise(ends) for x in self._roots(alpha, a, b)]
        is_close = (np.diff(np.sort(found)) < 1e-6).any()
        near_end = (np.abs(np.subtract.outer(found, ends)) < 1e-7).any() if found else False
        return None if is_close or near_end else len(found)

    def _roots(self, alpha, lo, hi):
        signs = np.sign(0.5 * (lo + hi) - self.kinks)
        q = self.c.copy()
        q[0] += self.b * alpha - (self.sizes * signs * self.kinks).sum()
        q[1] += self.e * alpha + (self.sizes * signs).sum()
        roots = np.roots(q[::-1])
        real = roots[np.abs(roots.imag) < 1e-7].real
        return real[(real >= lo - 1e-9) & (real <= hi + 1e-9)]


class Numbers:
    """The switches of numbers."""

    abs, max, clip = np.abs, np.maximum, np.clip


class Row:
    """A function of one unknown with kinks of some kind."""

    def __init__(self, rng):
        self.c = rng.normal(size=rng.integers(2, 5))
        self.kinks = rng.normal(size=rng.integers(0, 3))
        self.sizes = rng.normal(size=len(self.kinks)) * 1.5
        self.kind, self.wave = rng.integers(0, 3), rng.normal() * 2.0

    def __call__(self, x, sw):
        y = self.c[0]
        for k, c in enumerate(self.c[1:], start=1):
            y = y + c * x**k
        for kink, size in zip(self.kinks, self.sizes, strict=True):
            y = y + size * self._kinked(x, kink, sw)
        return y + self.wave * np.tanh(x) if self.kind == 2 else y

    def _kinked(self, x, kink, sw):
        if self.kind == 0:
            return sw.abs(x - kink)
        if self.kind == 1:
            return sw.max(x - kink, 0.3 * (x - kink))
        return sw.clip(x, kink - 0.5, kink + 0.5)


GRID = np.linspace(-6.0, 6.0, 24_001)


class Mixed:
    """Scalar equations, each after the other, hidden by linear maps of unknowns and equations.

    y = inverse z solves row_i(y_i) + b_i alpha + sum over j < i of coupled_ij y_j = 0.
    """

    def __init__(self, rng, n):
        self.n, self.rows = n, [Row(rng) for _ in range(n)]
        self.b, self.coupled = rng.normal(size=n), np.tril(rng.normal(size=(n, n)), -1)
        self.inverse = np.linalg.inv(np.eye(n) + 0.3 * rng.normal(size=(n, n)))
        self.mixed = np.eye(n) + 0.5 * rng.normal(size=(n, n))

    def is_covered(self, reach):
        """Tell whether the grid covers all y of states within the reach."""
        return np.abs(self.inverse).sum(axis=1).max() * reach < GRID[-1]

    def __call__(self, z, alpha, sw):
        y = self.inverse @ z
        rows = []
        for i, row in enumerate(self.rows):
            value = row(y[i], sw) + self.b[i] * alpha
            for j in range(i):
                value = value + self.coupled[i, j] * y[j]
            rows.append(value)
        return self.mixed @ np.array(rows)

    def count(self, alpha, reach):
        """Return the number of solutions within the reach, None where the grid could miss some."""
        partial, maps = [()], np.linalg.inv(self.inverse)
        for i, row in enumerate(self.rows):
            more = []
            for y in partial:
                rest = self.b[i] * alpha + self.coupled[i, :i] @ np.array(y)
                roots = _roots(row(GRID, Numbers) + rest)
                if roots is None:
                    return None
                more += [(*y, root) for root in roots]
            partial = more
        sizes = [np.abs(maps @ np.array(y)).max() for y in partial]
        near = any(abs(size - reach) < 1e-3 for size in sizes)
        return None if near else sum(size < reach for size in sizes)


def _roots(values):
    """Return the roots of a function on the grid, None where the function nearly touches zero."""
    signs, size = np.sign(values), np.abs(values)
    inner = size[1:-1]
    least = (inner < size[:-2]) & (inner <= size[2:]) & (signs[:-2] == signs[2:])
    steps = np.maximum(np.abs(np.diff(values))[:-1], np.abs(np.diff(values))[1:])
    if (signs == 0.0).any() or (inner < 3.0 * steps)[least & (signs[:-2] == signs[1:-1])].any():
        return None
    at = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
    part = values[at] / (values[at] - values[at + 1])
    return GRID[at] + part * (GRID[1] - GRID[0])


def uneven_arches(z, t, sw):
    """Uneven arches, each after the other, one for each unknown: up to 3^n solutions."""
    k, before = np.arange(1.0, len(z) + 1.0), np.concatenate([[0.0], z[:-1]])
    rows = z**3 - 1.2 * (1.0 + 0.1 * k) * z + 5.0 * sw.relu(z - 1.0)
    return rows - t * (1.0 - 0.05 * k) + 0.1 * before
