"""The estimated errors of transitions and solutions, against rational arithmetic.

Bodies with one and two contact nodes are scaled and made nearly singular up to condition numbers
of 1e10. Every float of the data is taken as the rational number that it is; the modes that the
package names are then solved in them without rounding.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from reference_enumeration import (
    Body,
    _exact,
    equations,
    exact_solve,
    modes_of,
    per_node,
    slacks,
    solve_modes,
)
from sweeps import swept

from pwscont import trace

ENOUGH = 0.999
INTERVAL = (-1.0, 1.0)
SMALLEST = Fraction(1, 2**1000)


@dataclass(frozen=True)
class Sample:
    """A random body on a load path, and a solution of it."""

    body: Body
    f0: np.ndarray
    f1: np.ndarray
    friction: np.ndarray

    def lines(self, modes):
        """Return z0 and z1 with z = z0 + alpha z1 in these modes, without rounding."""
        matrix, rhs = equations(self.body, self.friction, modes)
        rest = np.zeros(len(rhs) - self.body.n)
        columns = [rhs + np.append(self.f0, rest), np.append(self.f1, rest)]
        found, _ = exact_solve(matrix, columns)
        return [np.array(column, dtype=object) for column in found]

    def typical(self):
        """Return how large displacements, forces and alpha are on the whole path."""
        loads = np.column_stack([self.f0 + end * self.f1 for end in INTERVAL])
        length, force = np.abs(np.linalg.solve(self.body.A, loads)).max(), np.abs(loads).max()
        return np.repeat([length, force, 2.0], [self.body.n, 2 * self.body.p, 1])

    def alphas_of_slacks(self, modes, z0, z1):
        """Return the alphas at which an inequality of these modes turns into an equation."""
        body = Body(*(_exact(a) for a in (self.body.A, self.body.N, self.body.T, self.body.gap)))
        flat = Body(body.A, body.N, body.T, 0 * body.gap)
        friction = _exact(per_node(self.friction, body.p))
        pairs = zip(
            slacks(body, friction, modes, z0), slacks(flat, friction, modes, z1), strict=True
        )
        return [-value / rate for value, rate in pairs if rate != 0]


def random_sample(p, rng):
    """Return a body of any condition up to 1e10, in one of three ways."""
    n = 2 * p
    root = rng.normal(size=(n, n))
    A = root @ root.T + 0.2 * np.eye(n)
    friction = rng.uniform(0.1, 4.0, p)
    way = rng.integers(3)
    if way == 0:  # rows and columns scaled by powers of two
        powers = 2.0 ** rng.integers(-8, 9, n)
        A = A * powers * powers[:, np.newaxis]
    elif way == 1:  # one soft direction
        eigenvalues, vectors = np.linalg.eigh(A)
        eigenvalues[0] = eigenvalues[-1] * 10.0 ** -rng.uniform(0.0, 10.0)
        A = (vectors * eigenvalues) @ vectors.T
        A = (A + A.T) / 2.0
    else:  # slip of the first node nearly singular
        compliance = np.linalg.inv(A)
        if compliance[0, 1] != 0.0:
            critical = compliance[0, 0] / abs(compliance[0, 1])
            friction[0] = critical * (1.0 + rng.choice([-1, 1]) * 10.0 ** -rng.uniform(0.0, 10.0))
    load = np.sqrt(np.diag(A))
    body = Body(A, np.eye(n)[::2], np.eye(n)[1::2], np.zeros(p))
    return Sample(body, load * rng.normal(size=n), load * rng.normal(size=n), friction)


def graph_of(sample, rng):
    """Return the component through some solution at a random alpha."""
    alpha = rng.uniform(*INTERVAL)
    z = start(sample, alpha, rng)
    return None if z is None else trace(system_of(sample), (z, alpha), INTERVAL)


def system_of(sample):
    body, load = sample.body, AffineLoad(sample.f0, sample.f1)
    return CoulombLoad(ContactBody(body.A, body.N, body.T, body.gap), load, sample.friction)


def start(sample, alpha, rng):
    """Return a solution as LAPACK finds it, None where the first modes that fit are degenerate."""
    found = modes_at(sample, alpha, rng)
    body, load = sample.body, sample.f0 + alpha * sample.f1
    return solve_modes(body, load, sample.friction, found) if found else None


def modes_at(sample, alpha, rng):
    """Return modes in which there is a solution inside their cell, None if rounding hides it."""
    body = sample.body
    names = ("no contact", "stick", "slip+", "slip-")
    for choice in rng.permutation(4**body.p):
        modes = tuple(names[choice // 4**i % 4] for i in range(body.p))
        z = solve_modes(body, sample.f0 + alpha * sample.f1, sample.friction, modes)
        if slacks(body, per_node(sample.friction, body.p), modes, z).min() > 0.0:
            return modes
    return None


def ratio(found, error, exact):
    """Return the largest true error in units of the estimate, 0 where both vanish."""
    ratios = [0.0]
    for value, estimate, true in zip(found, error, exact, strict=True):
        off = abs(Fraction(float(value)) - true)
        if off:
            ratios.append(float(off / max(Fraction(float(estimate)), SMALLEST)))
    return max(ratios)


def tightness(found, error, exact):
    """Return the least estimate in units of the true error, over components that err."""
    pairs = [
        (abs(Fraction(float(v)) - t), Fraction(float(e)))
        for v, e, t in zip(found, error, exact, strict=True)
    ]
    return [float(e / off) for off, e in pairs if off]


@dataclass
class Measured:
    """For every case: kind, worst true error over estimate, estimates over true error, digits."""

    kind: str
    worst: float
    loose: list
    digits: float
    true_digits: float


def judged(kind, values, error, exact, digits, relevant, typical):
    loose = tightness(values[relevant], error[relevant], exact[relevant])
    off = np.array([float(abs(Fraction(float(v)) - t)) for v, t in zip(values, exact, strict=True)])
    size = np.maximum(np.abs(exact.astype(float)), typical[: len(exact)])
    true = min(16.0, -np.log10(max(1e-16, (off / size).max())))
    worst = ratio(values[relevant], error[relevant], exact[relevant])
    return Measured(kind, worst, loose, digits, true)


def transitions(sample, graph, lines):
    """Yield what each interior node of the graph is worth: alpha against its exact value."""
    typical = sample.typical()
    for point in graph.special_points():
        if point.kind not in ("transition", "nonsmooth fold"):
            continue
        piece = next(p for p in graph.pieces if point.id in (p.start, p.end))
        modes = modes_of(piece.label)
        z0, z1 = lines(modes)
        alphas = sample.alphas_of_slacks(modes, z0, z1)
        alpha = min(alphas, key=lambda a: abs(a - Fraction(point.alpha)))
        exact = np.append(z0 + alpha * z1, alpha)
        values = np.append(point.z, point.alpha)
        yield judged(
            "transition", values, point.error, exact, point.digits, slice(-1, None), typical
        )


def solutions(sample, graph, lines, rng):
    """Yield what each solution at a random alpha is worth: z against its exact value."""
    alpha, typical = rng.uniform(*INTERVAL), sample.typical()
    for solution in graph.solutions(alpha):
        if solution.kind is not None:
            continue
        z0, z1 = lines(modes_of(solution.label))
        exact = z0 + Fraction(alpha) * z1
        n = len(exact)
        yield judged(
            "solution", solution.z, solution.error[:n], exact, solution.digits, slice(n), typical
        )


def lines_of(sample):
    known = {}

    def lines(modes):
        if modes not in known:
            known[modes] = sample.lines(modes)
        return known[modes]

    return lines


@pytest.fixture(scope="module", params=swept([400], [2_000, 10_000]))
def measured(request):
    rng = np.random.default_rng(20120101)
    cases = []
    while len(cases) < request.param:
        sample = random_sample(2 if rng.random() < 0.15 else 1, rng)
        graph = graph_of(sample, rng)
        if graph is None:
            continue
        lines = lines_of(sample)
        cases += transitions(sample, graph, lines)
        for _ in range(6):
            cases += solutions(sample, graph, lines, rng)
    return cases[: request.param]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["transition", "solution"])
def test_the_true_error_is_rarely_ten_times_the_estimate(measured, kind):
    worst = np.array([case.worst for case in measured if case.kind == kind])
    assert len(worst) > len(measured) / 10
    assert np.mean(worst <= 10.0) >= ENOUGH, np.quantile(worst, [0.5, 0.9, 0.99, 0.999, 1.0])


@pytest.mark.parametrize("kind", ["transition", "solution"])
def test_the_estimate_is_not_absurdly_large(measured, kind):
    loose = np.concatenate([case.loose for case in measured if case.kind == kind])
    assert np.median(loose) < 1e3


def test_digits_say_where_fewer_than_six_are_left(measured):
    """The true number of digits is at most one less than what is said."""
    few = [case for case in measured if case.true_digits < 5.0]
    assert all(case.digits < 6.0 for case in few)
    said = np.array([case.digits - case.true_digits for case in measured])
    assert np.mean(said <= 1.0) >= ENOUGH


@pytest.mark.parametrize(("p", "samples"), swept([(1, 50), (2, 15)], [(1, 500), (2, 80)]))
@pytest.mark.sweep(2)
def test_a_solution_given_as_start_is_taken_as_one(p, samples):
    """However ill conditioned: the exact solution, rounded to doubles, is not refused."""
    rng = np.random.default_rng([2012, p])
    for _ in range(samples):
        sample, alpha = random_sample(p, rng), rng.uniform(*INTERVAL)
        if (modes := modes_at(sample, alpha, rng)) is None:
            continue
        z0, z1 = sample.lines(modes)
        exact = z0 + Fraction(alpha) * z1
        graph = trace(system_of(sample), (exact.astype(float), alpha), INTERVAL)
        found = [s for s in graph.solutions(alpha) if modes_of(s.label) == modes]
        assert any(ratio(s.z, s.error[:-1], exact) <= 10.0 for s in found)


@pytest.mark.parametrize("lost", [11, 12, 13])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.sweep(3)
def test_an_ill_conditioned_body_says_how_few_digits_are_left(lost, seed):
    """A solution without contact: u = A^-1 f with a condition number of ten to the ``lost``."""
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.normal(size=(2, 2)))[0]
    A = (Q * [1.0, 10.0**-lost]) @ Q.T
    A = (A + A.T) / 2.0
    sample = Sample(Body(A, np.eye(2)[:1], np.eye(2)[1:], np.zeros(1)), -A[:, 0], A[:, 1], [0.5])
    graph = graph_of(sample, rng)
    lines = lines_of(sample)
    found = [case for _ in range(5) for case in solutions(sample, graph, lines, rng)]
    for case in found:
        assert case.worst <= 10.0
        assert case.digits <= max(case.true_digits + 1.0, 1.0)
