"""Exact maps in small windows, of singular cells, and of families of small integers."""

import math
from fractions import Fraction

import numpy as np
import pytest
from rational import SwitchedFamily, integer_family, number_of_solutions
from sweeps import swept

from pwscont import LCP, Switched, plane
from pwscont.basics.errors import InvalidInputError, InvalidSystemError
from pwscont.extending import Polyhedron

pytest.importorskip("shapely", reason="exact maps need the extra 'maps'")

UNIT = (-1.0, 1.0)
SMALL = 2.0**-20
WINDOWS = [
    (UNIT, UNIT),
    ((-2.0, 2.0), (-3.0, 1.0)),
    ((0.0, 1.0), (0.0, 1.0)),
    ((-1e3, 1e3), (-1e3, 1e3)),
    ((0.0, 2.0**-10), (0.0, 1e3)),
    ((-SMALL, SMALL), (-SMALL, SMALL)),
    ((0.5, 0.5 + SMALL), (-0.25, -0.25 + SMALL)),
    ((-(2.0**-30), 2.0**-30), (-1e-12, 1e-12)),
]


def in_window(f, n, centre, half):
    """Return the map around a point of a system of n unknowns."""
    alphas, mus = ((c - half, c + half) for c in centre)
    return plane(lambda mu: Switched(n, lambda z, t, sw: f(z, t, mu, sw), linear=True), alphas, mus)


def test_small_windows_take_no_rounding_of_singular_cells_for_solutions():
    """Both equations give -z0 - z1 another value: there is no solution."""

    def contradicting(z, t, mu, sw):
        return np.array([-z[0] - z[1] + 2.0 * mu - 2.0, -z[0] - z[1] - sw.abs(-t - mu)])

    found = in_window(contradicting, 2, (1.0, 2.0), SMALL)
    assert found.count(1.0, 2.0) == 0
    assert found.guarantee == "complete"


def test_one_solution_in_a_small_window_beside_a_singular_cell():
    def one(z, t, mu, sw):
        y = sw.abs(-2.0 * z[0] - z[1] + 3.0 * mu - 3.0)
        first = -2.0 * z[0] - z[1] - y - 2.0 * t - mu - 2.0
        return np.array([first, -z[0] + z[1] - y + 2.0 * t + 2.0 * mu + 2.0])

    found = in_window(one, 2, (1.0, -1.0), SMALL)
    (solution,) = found.solutions(1.0, -1.0)
    np.testing.assert_allclose(solution.z, [-4.0 / 3.0, -11.0 / 6.0], rtol=1e-12)


def test_a_singular_cell_in_a_small_window_is_an_edge():
    """The sum of both equations is 2 - 2 mu = 0, and y = 2 t - 2 is no more than zero."""

    def on_a_line(z, t, mu, sw):
        y = sw.min(z[0] - z[1] + t, 0.0)
        return np.array([-y + 2.0 * t - 2.0 * mu, y - 2.0 * t + 2.0])

    found = in_window(on_a_line, 2, (1.0, 1.0), SMALL)
    assert found.guarantee == "complete"
    part = found.vertical[0]
    np.testing.assert_allclose(part.plane, [[1.0 - SMALL, 1.0], [1.0, 1.0]], rtol=1e-13)
    assert found.count(1.0 - 2.0**-21, 1.0) == math.inf
    assert found.count(1.0 + 2.0**-21, 1.0) == 0
    assert found.count(1.0 - 2.0**-21, 1.0 + 2.0**-22) == 0


def test_a_system_without_parameters_that_is_singular():
    """z1 = z0 + 1 solves both equations, whatever alpha and mu are."""

    def free(z, t, mu, sw):
        y = sw.min(z[1] - z[0] + 1.0 + 0.0 * t, 0.0)
        return np.array([z[1] - z[0] - y - 1.0, z[1] - z[0] - 1.0])

    found = in_window(free, 2, (0.0, 0.0), 1.0)
    assert found.guarantee == "complete"
    assert [sector.count for sector in found.sectors] == [math.inf]


def test_an_unknown_that_common_equations_decide():
    """The sum of both equations says that the second switch is one, which it always is."""

    def decided(z, t, mu, sw):
        first, second = sw.max(z[1] - z[0] + 1.0 + 0.0 * t, 0.0), sw.max(1.0 + 0.0 * z[0], 0.0)
        return np.array([first - z[1] - second + 1.0, z[1] - first - second + 1.0])

    found = in_window(decided, 2, (0.0, 0.0), 1.0)
    assert found.guarantee == "complete"
    assert [sector.count for sector in found.sectors] == [math.inf]


def test_close_solutions_in_a_small_window_are_two():
    """-2 z - 1 + 2 t >= 0 and z >= 0, one of them zero: 0 and t - 1/2."""
    M, q, d = np.array([[-2.0]]), np.array([-1.0]), np.array([2.0])
    found = plane(lambda mu: LCP(M, q + 0.0 * mu, d), (0.5, 0.5 + SMALL), (-0.25, -0.25 + SMALL))
    first, second = found.solutions(0.5 + 2.0**-29, -0.25)
    solutions = sorted(float(one.z[0]) for one in (first, second))
    assert solutions == [0.0, pytest.approx(2.0**-29)]


def test_infinitely_many_solutions_in_a_corner_of_a_small_window():
    """z2 may be anything from 0 to t - mu, which is no more than the window is wide."""
    M, d = np.array([[-1.0, -1.0], [-1.0, 0.0]]), np.array([1.0, 0.0])
    h = SMALL
    found = plane(lambda mu: LCP(M, -mu * d, d), (-h, h), (-h, h))
    assert found.guarantee == "complete"
    assert [found.count(a * h, b * h) for a, b in ((0.5, 0.1), (0.1, 0.5))] == [math.inf, 0]


def test_solutions_over_a_segment_only():
    """-mu z = 0 side by side: z = 0 solves both inequalities at mu = 0, and nothing else does."""
    M, q = np.array([[-1.0, -1.0], [0.0, -1.0]]), np.array([-1.0, 1.0])
    found = plane(lambda mu: LCP(M, mu * q, np.zeros(2)), UNIT, UNIT)
    assert found.count(0.3, 0.0) == 1
    assert found.count(0.3, 0.1) == found.count(0.3, -0.1) == 0


def test_infinitely_many_solutions_over_a_corner_of_the_window():
    """Any z >= 0 solves -t - mu = 0, which holds in one corner."""
    found = plane(
        lambda mu: LCP(np.zeros((1, 1)), np.array([-mu]), np.array([-1.0])), (0.0, 1.0), (0.0, 1.0)
    )
    assert [found.count(0.0, 0.0), found.count(0.5, 0.5)] == [math.inf, 0]


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("seed", swept(range(0, 4), range(4, 100)))
@pytest.mark.filterwarnings("error")
@pytest.mark.sweep(15)
def test_integer_families_against_rational_enumeration(seed, window):
    """Small integers: degenerate, tied and singular families of all kinds."""
    M, q, d, e = integer_family(np.random.default_rng(seed))
    (a, b), (c, f) = window
    try:
        found = plane(lambda mu: LCP(M.astype(float), q + mu * e, d), (a, b), (c, f))
    except (InvalidInputError, InvalidSystemError):
        assert b - a <= 2.0**-10  # z - (z + mu) is rounding where mu is tiny
        return
    if found.guarantee != "complete":
        return
    spots = np.random.default_rng([seed, 1]).random((8, 2))
    spots = [*spots.tolist(), (0.5, 0.5), (0.5, 0.25)]
    for x, y in spots:
        alpha, mu = a + x * (b - a), c + y * (f - c)
        expected = number_of_solutions(M, q, d, e, Fraction(alpha), Fraction(mu))
        assert expected is None or found.count(alpha, mu) == expected


@pytest.mark.parametrize("power", [36, 38, 40])
@pytest.mark.sweep(3)
def test_a_family_without_solutions_beside_thin_singular_cells(power):
    """Singular cells have solutions next to the origin, if inequalities may be off by 1e-10.

    Where alpha, mu and q are multiplied by one factor, the number of solutions stays.
    """
    M, q = np.array([[-3, -3, 3], [4, 0, -4], [4, 0, -4]]), np.array([-4, -1, 2])
    d, e = np.array([-1, 4, -5]), np.array([-1, 0, 5])
    found = plane(lambda mu: LCP(M.astype(float), q * 2.0**-power + mu * e, d), UNIT, UNIT)
    for x, y in [(-3, 2), (3, 2), (-1, 4), (1, 2), (1, 4), (2.0**34, 2.0**33)]:
        assert number_of_solutions(M, q, d, e, Fraction(x), Fraction(y)) == 0
        assert found.count(x * 2.0**-power, y * 2.0**-power) == 0


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.sweep(3)
def test_the_inside_of_a_polyhedron_has_as_many_directions_however_small(seed):
    """Values of small integers times 2^-40 are less than the tolerances of a solver."""
    rng = np.random.default_rng(seed)
    q = int(rng.integers(2, 4))
    matrix = np.vstack([rng.integers(-3, 4, (q + 3, q)), np.eye(q), -np.eye(q)]).astype(float)
    vector = np.concatenate([rng.integers(-2, 4, q + 3), np.full(2 * q, 8.0)])
    whole, small = (Polyhedron(matrix, f * vector).inside(1e-14) for f in (1.0, 2.0**-40))
    assert (whole is None) == (small is None)
    assert whole is None or whole[1].shape == small[1].shape


def test_switches_that_coincide_at_an_end_are_refused():
    def f(z, t, mu, sw):
        first = sw.min(z[0] - t - 2.0 * mu - 2.0, 0.0)
        return first + sw.min(z[0] - t - 3.0 * mu - 1.0, 0.0) + z[0]

    with pytest.raises(InvalidInputError, match="move the end"):
        in_window(f, 1, (1.0, 0.0), 1.0)


@pytest.mark.parametrize("seed", swept(range(12), range(12, 300)))
@pytest.mark.sweep(6)
def test_integer_switches_against_rational_enumeration(seed):
    family, rng = SwitchedFamily(np.random.default_rng(seed)), np.random.default_rng([seed, 1])
    (a, b), (c, f) = WINDOWS[seed % 3]
    found = plane(family.system, (a, b), (c, f))
    if found.guarantee != "complete":
        return
    for alpha, mu in [*(rng.random((6, 2)) * [b - a, f - c] + [a, c]).tolist(), (b, f)]:
        expected = family.number_of_solutions(alpha, mu)
        assert expected is None or found.count(alpha, mu) == expected


def test_windows_of_few_digits_are_refused():
    narrow = (1.0, 1.0 + 2.0**-30)
    with pytest.raises(InvalidInputError, match=r"mus = .* differ by less than 1e-08"):
        plane(lambda mu: LCP(np.eye(1), np.array([mu]), np.ones(1)), UNIT, narrow)
