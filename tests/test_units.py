"""Results do not depend on the units of length, force and the parameter."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from paper_systems import CASES, ONE_NODE, TWO_NODES
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from pwscont_optimisation import QuadraticProgram
from pwscont_power import Network, PowerFlow
from pwscont_power.networks import ieee14
from reference_enumeration import Body
from sweeps import swept

from pwscont import (
    LCP,
    AbsNormal,
    Complementarity,
    ExactLinear,
    InvalidInputError,
    InvalidSystemError,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    Switched,
    enumerate_solutions,
    explore,
    trace,
)
from pwscont.curve.magnitudes import rough_magnitudes

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

# stiffness and force of one unit of the paper's data: soft tissue to steel, micro to mega
UNITS = [(1.0, 1.0), (1e3, 1e-3), (2.1e11, 1e3), (2.1e11, 1e6), (1e-6, 1e-9), (1e12, 1.0)]
ALL_UNITS = pytest.mark.parametrize(("stiffness", "force"), UNITS)
STEPPERS = pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()])


def scaled_body(body: Body, stiffness):
    return ContactBody(stiffness * body.A, body.N, body.T)


def natural(z, body, stiffness, force):
    """Return z in the paper's units."""
    scale = np.repeat([force / stiffness, force], [body.n, 2 * body.p])
    return z / scale


def assert_same(graph, reference, body, stiffness, force, per_alpha):
    assert [p.label for p in graph.pieces] == [p.label for p in reference.pieces]
    for found, expected in zip(graph.pieces, reference.pieces, strict=True):
        assert found.det_sign == expected.det_sign
        ends = np.array(found.interval) / per_alpha
        np.testing.assert_allclose(ends, expected.interval, rtol=1e-11, atol=1e-11)
        z = [natural(z, body, stiffness, force) for z in found.z[[0, -1]]]
        np.testing.assert_allclose(z, expected.z[[0, -1]], rtol=1e-9, atol=1e-11)


@cache
def reference_of(name):
    return explore(CASES[name].system, CASES[name].interval)


@ALL_UNITS
@STEPPERS
@pytest.mark.parametrize("name", ["fig7", "example1"])
@pytest.mark.sweep(12)
def test_affine_load(stiffness, force, stepper, name):
    case, body = CASES[name], CASES[name].body
    load = AffineLoad(force * case.load.f0, case.load.f1)
    system = CoulombLoad(scaled_body(body, stiffness), load, 4.0)
    interval = tuple(force * end for end in case.interval)
    graph = explore(system, interval, stepper=stepper)
    reference = reference_of(name)
    assert_same(graph, reference, body, stiffness, force, per_alpha=force)


@ALL_UNITS
@pytest.mark.sweep(8)
def test_friction(stiffness, force):
    name = "example3"
    case = CASES[name]
    load = force * np.array([0.4, -1.4, 1.5, -1.5])
    system = CoulombFriction(scaled_body(TWO_NODES, stiffness), load)
    graph = explore(system, case.interval)
    reference = reference_of(name)
    assert_same(graph, reference, TWO_NODES, stiffness, force, per_alpha=1.0)


@ALL_UNITS
def test_trace_from_a_rough_start(stiffness, force):
    """Semismooth Newton, too, measures in the units of the system."""
    load = AffineLoad([0.25 * force, 0.0], [0.0, force])
    system = CoulombLoad(scaled_body(ONE_NODE, stiffness), load, 4.0)
    graph = trace(system, (np.zeros(4), 1.5), (-2.0, 2.0))
    assert [count for _, _, count in graph.multiplicity()] == [1, 3, 1]
    alphas = [node.alpha for node in graph.special_points("nonsmooth fold")]
    np.testing.assert_allclose(alphas, [-0.5, -1.0], rtol=1e-11)


@pytest.mark.parametrize("r", [1e-4, 0.1, 10.0, 1e4])
@pytest.mark.parametrize("name", ["fig7", "example1"])
def test_the_scale_of_the_augmented_multipliers_does_not_matter(r, name):
    case = CASES[name]
    system = CoulombLoad(scaled_body(case.body, 1.0), case.load, 4.0, r=r)
    graph = explore(system, case.interval)
    assert_same(graph, reference_of(name), case.body, 1.0, 1.0, 1.0)


class Bend(PiecewiseSystem):
    """A fold and two transitions within 0.02 of alpha, wherever the interval lies."""

    size = 1

    def __init__(self, size_of_z, begin):
        self.unit, self.begin = size_of_z, begin

    def test_functions(self, z, alpha):
        return (z / self.unit + 0.46) ** 2 - 0.009**2

    def residual(self, z, alpha, character):
        w = z / self.unit
        smooth = 0.2357 * w - 0.4617 * np.tanh(w / 0.087) - (alpha - self.begin)
        return smooth - 0.8 * self.test_functions(z, alpha) * character.signs[0]


@pytest.mark.parametrize("unit", [1.0, 0.00425])
@pytest.mark.parametrize("begin", [0.0, 1e3, 1e6])
@pytest.mark.sweep(4)
def test_where_the_interval_lies_does_not_make_two_points_one(unit, begin):
    system, w = Bend(unit, begin), -0.0289
    alpha = float(0.2357 * w - 0.4617 * np.tanh(w / 0.087) - 0.8 * ((w + 0.46) ** 2 - 0.009**2))
    interval = (begin - 1.424, begin + 1.327)
    graph = trace(system, ([unit * w], begin + alpha), interval)
    found = {kind: graph.special_points(kind) for kind in ("transition", "fold")}
    places = {kind: sorted(p.z[0] / unit for p in points) for kind, points in found.items()}
    np.testing.assert_allclose(places["transition"], [-0.469, -0.451], rtol=1e-6)
    np.testing.assert_allclose(places["fold"], [-0.320964554], rtol=1e-4)


# -- systems that give no magnitudes --------------------------------------------------------------


def arch(a, z, alpha, sw):
    return [a * z[0] * (z[0] - 1.0) * (z[0] - 2.0) - alpha]


def kinked(a, z, alpha, sw):
    return [z[0] ** 3 - z[0] - alpha + 0.8 * sw.abs(z[0] - 0.3 * (a - 1.0))]


def coupled(a, z, alpha, sw):
    cubic = z[0] ** 3 - z[0] - 0.2 * a * z[1] + 0.5 * sw.relu(z[0] - 0.3)
    return [cubic - alpha, z[1] - z[0] ** 2]


def resting(a, z, alpha, sw):
    """z[1] rests at its bound 0 outside of a window of z[0]."""
    room = z[1] - 0.2 * a + (z[0] - 1.0) ** 2
    return [z[0] * (z[0] - 1.0) * (z[0] - 2.0) + z[1] - alpha, -sw.max(-room, -z[1])]


def diodes(a, z, alpha, sw):
    """A source behind a resistor, a diode, and a device whose current falls within a range."""
    tunnel = z[0] ** 3 - 1.5 * z[0] ** 2 + 0.6 * z[0]
    diode = 1e-3 * (np.exp(z[0] / 0.2) - 1.0)
    return [alpha - z[0] - a * z[2], z[2] - z[1] - diode, z[1] - tunnel]


def chain(a, z, alpha, sw):
    A = 2.0 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1)
    bent = 0.3 * z**3 * np.linspace(1.0, 0.0, 5)
    return A @ z - a * alpha + bent + 0.4 * sw.relu(z - 0.5)


#: An interval, and a rough solution at its lower end.
FAMILY = {
    arch: ((-1.0, 1.0), [-0.3]),
    kinked: ((-1.5, 1.5), [-2.0]),
    coupled: ((-1.0, 1.0), [-1.2, 1.4]),
    resting: ((-0.5, 1.0), [-0.1, 0.0]),
    diodes: ((-0.5, 1.5), [-0.1, -0.1, -0.1]),
    chain: ((-2.0, 3.0), [-1.0, -2.0, -2.0, -2.0, -1.0]),
}


def rescaled(f, a, unknowns, rows, per_alpha):
    """Return the system in other units: z in ``unknowns``, H in ``rows``."""

    def function(z, alpha, sw):
        values = f(a, z / unknowns, alpha / per_alpha, sw)
        return [row * value for row, value in zip(rows, values, strict=True)]

    return Switched(len(unknowns), function)


def random_units(rng, n, which):
    """Return units of the unknowns, the rows and alpha: of all, or of the unknowns alone."""
    alike = np.full(n, 10.0 ** rng.uniform(-12, 12))
    unknowns = 10.0 ** rng.uniform(-12, 12, n) if which != "alike" else alike
    if which != "all":
        return unknowns, np.ones(n), 1.0
    return unknowns, 10.0 ** rng.uniform(-12, 12, n), 10.0 ** rng.uniform(-12, 12)


@pytest.mark.parametrize("which", ["all", "alike", "unknowns"])
@pytest.mark.parametrize("f", FAMILY, ids=lambda f: f.__name__)
@pytest.mark.parametrize("seed", swept(range(1), range(1, 4)))
@pytest.mark.sweep(18)
def test_units_do_not_matter_where_no_magnitudes_are_given(f, which, seed):
    rng = np.random.default_rng([seed, *map(ord, f.__name__ + which)])
    (interval, z), a, n = FAMILY[f], rng.uniform(0.7, 1.5), len(FAMILY[f][1])

    def found_in(unknowns, rows, per_alpha):
        system = rescaled(f, a, unknowns, rows, per_alpha)
        lo, hi = (per_alpha * end for end in interval)
        searched = seed > 0  # which takes longer
        return (
            explore(system, (lo, hi)) if searched else trace(system, (z * unknowns, lo), (lo, hi))
        )

    reference = found_in(np.ones(n), np.ones(n), 1.0)
    unknowns, rows, per_alpha = random_units(rng, n, which)
    graph = found_in(unknowns, rows, per_alpha)
    found, expected = (
        sorted((str(p.kind), p.alpha / unit, *(p.z / size)) for p in g.special_points())
        for g, unit, size in ((graph, per_alpha, unknowns), (reference, 1.0, 1.0))
    )
    assert [kind for kind, *_ in found] == [kind for kind, *_ in expected]
    places = [[each[1:] for each in points] for points in (found, expected)]
    np.testing.assert_allclose(np.sort(places[0], 0), np.sort(places[1], 0), atol=1e-7)
    points = [sum(len(piece.alpha) for piece in g.pieces) for g in (graph, reference)]
    assert points[0] <= 2.5 * points[1] + 10
    assert points[1] <= 2.5 * points[0] + 10


@pytest.mark.parametrize("rise", [1e-4, 1e-5, 1e-6, 1e-9])
@pytest.mark.parametrize("is_relative", [False, True])
@pytest.mark.sweep(4)
def test_a_small_arch_has_its_folds(rise, is_relative):
    unit = rise if is_relative else 1.0
    system = rescaled(arch, 1.0, [rise], [unit], unit)
    graph = trace(system, ([0.0], 0.0), (-unit, unit))
    assert len(graph.special_points("fold")) == 2
    np.testing.assert_allclose(
        sorted(s.z[0] for s in graph.solutions(0.0)), [0.0, rise, 2.0 * rise], atol=1e-9 * rise
    )


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("curve", [np.tan, lambda z: 8 * np.sin(z), lambda z: 1 / np.cos(z) - 1])
def test_functions_that_oscillate_have_magnitudes(curve, unit):
    """By how much z must change for a row to change: any size far away may do, and is none."""
    system = Switched(1, lambda z, alpha, sw: curve(z / unit) - alpha)
    [size] = rough_magnitudes(system, (0.0, 4.0), np.zeros(1))
    assert 0.25 * unit <= size <= 64.0 * unit
    graph = trace(system, ([0.5 * unit], 0.4), (0.1, 1.0))
    np.testing.assert_allclose(curve(graph.solutions(0.5)[0].z / unit), 0.5)


@pytest.mark.parametrize("low", [1e-12, -1e-12, 1e-9])
@pytest.mark.sweep(4)
def test_a_tiny_bound_is_no_magnitude(low):
    def graph(low):
        def function(z, t):
            return [z[0] * (z[0] - 1) * (z[0] - 2) + z[1] - t, z[1] - 0.2 + (z[0] - 1) ** 2]

        system = Complementarity(function, lower=[-np.inf, low], upper=np.inf, n=2)
        return trace(system, ([-0.1, 0.0], -0.5), (-0.5, 1.0))

    one, other = graph(0.0), graph(low)
    alphas = (-0.3, 0.1, 0.2, 0.3, 0.8)
    assert [other.count(t) for t in alphas] == [one.count(t) for t in alphas]
    numbers = [sum(len(piece.alpha) for piece in g.pieces) for g in (one, other)]
    assert numbers[1] <= 2 * numbers[0]


def test_an_unknown_that_is_tiny_at_the_start_has_the_magnitude_of_the_path():
    """At its start the second unknown is 1e-6 and hardly moves; then it grows to 500."""
    asked = []

    def f(z, alpha, sw):
        asked.append(alpha)
        return [z[0] - alpha, z[1] - 1e-6 * np.exp(20.0 * z[0])]

    graph = trace(Switched(2, f), ([0.0, 1e-6], 0.0), (0.0, 1.0))
    (end,) = [p for p in graph.special_points() if p.alpha == 1.0]
    np.testing.assert_allclose(end.z, [1.0, 1e-6 * np.exp(20.0)], rtol=1e-9)
    assert sum(len(piece.alpha) for piece in graph.pieces) < 500
    assert len(asked) < 2_000


@pytest.mark.parametrize("given", [1e-6, [1e-6]])
def test_magnitudes_that_are_given_to_formulas_are_kept(given):
    def function(z, t):
        return 2.0 * z - t

    formulas = [
        Switched(1, lambda z, t, sw: sw.max(z, 2.0 * z) - t, scale=given),
        Complementarity(function, n=1, scale=given),
        LCP([[2.0]], [0.0], [-1.0], scale=given),
    ]
    for system in formulas:
        assert system.gives_scale
        assert explore(system, (0.5e-6, 1e-6)).system.scale(0.0, 1.0)[0] == 1e-6


@pytest.mark.parametrize("given", [0.0, [1.0, 1.0, 1.0], [-1.0, 1.0], "wide"])
def test_wrong_magnitudes_are_refused(given):
    with pytest.raises(InvalidInputError, match="scale must be"):
        Switched(2, lambda z, t, sw: z - t, scale=given)


def test_hidden_unknowns_have_the_magnitudes_of_their_switches():
    system = Switched(1, lambda z, t, sw: z - sw.relu(sw.abs(1e6 * z) - t), scale=[1e-3])
    assert 1e2 < system.scale(0.0, 1.0)[1] < 1e4


def test_equations_of_subnormal_numbers_are_refused():
    with pytest.raises(InvalidSystemError, match=r"row 0 .* multiply it by a constant"):
        explore(Switched(1, lambda z, t, sw: 1e-320 * (z - t)), (-0.5, 1.0))


@pytest.mark.parametrize("power", [1e-3, 100.0, 1e8])
@pytest.mark.sweep(4)
def test_power_per_unit_of_any_base(power):
    network = ieee14()
    branches = [replace(b, r=b.r / power, x=b.x / power, b=b.b * power) for b in network.branches]
    generators = [
        replace(g, Q_min=g.Q_min * power, Q_max=g.Q_max * power) for g in network.generators
    ]
    injected = [power * np.asarray(s) for s in (network.load, network.generation, network.shunt)]
    other = Network(network.buses, tuple(branches), tuple(generators), network.slack, *injected)
    graphs = []
    for each in (network, other):
        system = PowerFlow(each)
        flat = np.where(np.isfinite(system.bounds()[0]), 1.0, 0.0)
        graphs.append(trace(system, (flat, 1.0), (0.3, 2.0)))
    special = [sorted((p.alpha, str(p.kind)) for p in graph.special_points()) for graph in graphs]
    assert [kind for _, kind in special[0]] == [kind for _, kind in special[1]]
    np.testing.assert_allclose(*[[alpha for alpha, _ in points] for points in special], rtol=1e-9)
    points = [sum(len(piece.alpha) for piece in graph.pieces) for graph in graphs]
    assert points[1] < 1.5 * points[0]


def test_magnitudes_can_be_given_to_power_flow():
    system = PowerFlow(ieee14(), scale=0.5)
    assert system.gives_scale
    np.testing.assert_array_equal(system.scale(0.0, 1.0), np.full(system.size, 0.5))


def complementary_cells(M, q):
    """Return how many cells of z >= 0, M z + q >= 0, z (M z + q) = 0 hold a solution."""
    count, n = 0, len(q)
    for signs in product([False, True], repeat=n):
        z, free = np.zeros(n), np.array(signs)
        z[free] = np.linalg.solve(M[np.ix_(free, free)], -q[free])
        count += bool((z[free] > 0.0).all() and ((M @ z + q)[~free] > 0.0).all())
    return count


@pytest.mark.parametrize("seed", swept(range(8), range(8, 120)))
@pytest.mark.sweep(4)
def test_complementarity_in_a_unit_for_each_unknown_and_each_row(seed):
    """Units from 1e-9 to 1e9, without scale=: the counts are those of units of one."""
    rng = np.random.default_rng([35, seed])
    n = int(rng.integers(2, 5))
    M = np.round(rng.uniform(-2, 2, (n, n)), 2) + 2.0 * np.eye(n) * (rng.random() < 0.7)
    q, d = np.round(rng.uniform(-2, 2, n), 2), np.round(rng.uniform(-1, 1, n), 2)
    of_z, of_w = 10.0 ** rng.uniform(-9, 9, (2, n))
    system = LCP(of_w[:, np.newaxis] * M / of_z, of_w * q, of_w * d)
    graph = explore(system, (-2.0, 2.0))
    for alpha in (-1.73, -0.91, -0.13, 0.37, 1.19, 1.81):
        expected = complementary_cells(M, q + alpha * d)
        assert graph.count(alpha) == len(enumerate_solutions(system, alpha)) == expected


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-7, 1e-9, 1e-12, 1e9])
@pytest.mark.parametrize("cost", [1.0, 1e4, 1e7, 1e-9])
def test_a_program_has_its_two_solutions_in_any_unit(unit, cost):
    """-x^2 / 2 - 0.3 x, x <= 1: a maximum at -0.3, and the constraint."""
    slope = cost / unit
    system = QuadraticProgram([[-slope / unit]], [-0.3 * slope], [[1.0]], [unit], d=[0.1 * slope])
    found = enumerate_solutions(system, 0.0)
    assert sorted(s.z[0] / unit for s in found) == pytest.approx([-0.3, 1.0], rel=1e-14)
    assert found.guarantee == "complete"


def test_small_unknowns_make_no_false_solution():
    """The inequalities fail by as much as their terms, which are small."""
    M = [[2.0409191213851825, -2555665.031314182], [0.41809884672577885, -567769.6061279299]]
    q, d = [-4.5e-10, -2.2e-10], [-2.0e-9, -2.3e-10]
    assert len(enumerate_solutions(LCP(M, q, d), 0.3)) == 0


@pytest.mark.parametrize("unit", [1e-100, 1e-50, 1e50, 1e100])
def test_enumeration_in_extreme_units(unit):
    M, q, d = np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([-1.0, -1.0]), np.array([1.0, 0.0])
    for system in (LCP(M, unit * q, unit * d), LCP(unit * M, q, d)):
        assert len(enumerate_solutions(system, 0.0)) == 3
    with pytest.raises(InvalidSystemError, match="choose other units"):
        enumerate_solutions(LCP(M, unit**2.5 * q, unit**2.5 * d), 0.0)


class InUnits:
    """J x + Y |s| + b = 0, s = c + Z x + L |s|: small integers or any numbers, in any units."""

    def __init__(self, rng):
        n, m = self.shape = int(rng.integers(1, 4)), int(rng.integers(1, 5))
        any_number, shapes = rng.random() < 0.6, [(m, n), (m, m), (n, n), (n, m), (2, m), (2, n)]
        numbers = (rng.normal(size=s) if any_number else rng.integers(-2, 3, s) for s in shapes)
        self.Z, self.L, self.J, self.Y, self.c, self.b = (each.astype(float) for each in numbers)
        self.L = np.tril(self.L, -1)
        self.c[rng.integers(2)] *= rng.random() < 0.7
        self.b[rng.integers(2)] *= rng.random() < 0.7

    def system(self, of_x=1.0, of_rows=1.0, of_s=1.0, of_alpha=1.0):
        """Return the system in these units, which multiply numbers by powers of two."""
        n, m = self.shape
        x, rows, s = np.broadcast_to(of_x, n), np.broadcast_to(of_rows, n), np.broadcast_to(of_s, m)
        alpha = np.array([[1.0], [of_alpha]])
        return AbsNormal(
            Z=s[:, np.newaxis] * self.Z / x,
            L=s[:, np.newaxis] * self.L / s,
            J=rows[:, np.newaxis] * self.J / x,
            Y=rows[:, np.newaxis] * self.Y / s,
            c=s * self.c / alpha,
            b=rows * self.b / alpha,
        )


def powers_of_two(rng, *sizes):
    return [2.0 ** rng.integers(-30, 31, size) for size in sizes]


@pytest.mark.parametrize("seed", swept(range(20), range(20, 400)))
@pytest.mark.sweep(12)
def test_other_units_change_neither_solutions_nor_guarantee(seed):
    """Units of 1e-9 to 1e9 for each unknown, row and switch: powers of two change no digit."""
    rng = np.random.default_rng([36, seed])
    family = InUnits(rng)
    n, m = family.shape
    x, rows, s, (of_alpha,) = powers_of_two(rng, n, n, m, 1)
    usual, other = family.system(), family.system(x, rows, s, of_alpha)
    for alpha in (0.0, 1.0, -0.5, rng.normal()):
        expected = enumerate_solutions(usual, alpha)
        found = enumerate_solutions(other, alpha * of_alpha)
        assert len(found) == len(expected)
        assert found.guarantee == expected.guarantee
    graphs = explore(usual, (-2.0, 1.5)), explore(other, (-2.0 * of_alpha, 1.5 * of_alpha))
    guarantees = [graph.guarantee.split(";")[0] for graph in graphs]  # then follow values of alpha
    assert guarantees[0] == guarantees[1]
    alpha = rng.uniform(-2.0, 1.5)
    assert graphs[0].count(alpha) == graphs[1].count(alpha * of_alpha)


class WithoutJacobian(PiecewiseLinearSystem):
    """M z + |z| = q + alpha d, whose derivatives are differences."""

    def __init__(self, M, q, d):
        self.size, self.M, self.q, self.d = len(q), M, q, d

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        sides = 2.0 * character.array - 1.0
        return self.M @ z + sides * z - self.q - alpha * self.d


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1e6, 1e12])
def test_differences_fit_the_unit(unit):
    rng = np.random.default_rng(36)
    M, (q, d) = rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    one, other = (WithoutJacobian(M, u * q, u * d) for u in (1.0, unit))
    for alpha in (-1.0, 0.0, 0.3, 2.0):
        expected, found = (enumerate_solutions(system, alpha) for system in (one, other))
        assert len(found) == len(expected)
        for s, known in zip(found, expected, strict=True):
            np.testing.assert_allclose(s.z / unit, known.z, rtol=1e-9)


@pytest.mark.slow
def test_the_function_of_a_complementarity_problem_is_in_any_unit():
    # z = 0 until t = 0, then z = (0, t) until t = 1/2, then ((4 t - 2) / 3, (5 t - 1) / 3)
    M, q, d, calls = np.array([[2, -1], [-1, 2]]), np.array([1, 0]), np.array([1, 2]), {}
    for length, force in ((1.0, 1.0), (1e6, 1e-6), (1e-6, 1e6), (1e-2, 1e9)):

        def f(z, t, length=length, force=force):
            calls[length, force] = calls.get((length, force), 0) + 1
            return force * (M @ (z / length) + q - t * d)

        graph = trace(Complementarity(f, n=2), ([0.0, 0.0], -1.0), (-1.0, 2.0))
        kinks = [p.alpha for p in graph.special_points("transition")]
        np.testing.assert_allclose(sorted(kinks), [0.0, 0.5], atol=1e-12)
        np.testing.assert_allclose(graph.solutions(1.0)[0].z / length, [2 / 3, 4 / 3], rtol=1e-9)
    assert max(calls.values()) <= 2 * calls[1.0, 1.0]
