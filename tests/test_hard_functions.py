"""Functions with infinite slopes, overflow, ends and endless repetition, against closed forms."""

import numpy as np
import pytest

from pwscont import (
    Complementarity,
    InvalidSystemError,
    Limits,
    PiecewiseSystem,
    Switched,
    explore,
    trace,
)

pytestmark = [pytest.mark.filterwarnings("ignore::RuntimeWarning"), pytest.mark.sweep(4)]


def largest_residual(graph, f, alphas):
    """Return the largest |f| at the solutions of a graph."""
    found = [abs(f(float(s.z[0]), a)) for a in alphas for s in graph.solutions(a)]
    return max(found, default=0.0)


# -- infinite slopes: corrections vanish although H does not ---------------------------------------


@pytest.mark.slow
def test_a_root_of_zero_at_a_bound_makes_no_false_solutions():
    """z >= 0 and z - sqrt(z) - alpha: z = 0 solves for alpha < 0 only, the root from alpha = 0."""
    graph = explore(
        Complementarity(lambda z, a: [z[0] - np.sqrt(z[0]) - a], lower=0.0), (-2.0, 2.0)
    )
    assert [graph.count(alpha) for alpha in (-1.0, -0.1, 0.5, 1.5)] == [1, 3, 1, 1]
    for alpha in (0.5, 1.5):
        (solution,) = graph.solutions(alpha)
        assert solution.z[0] == pytest.approx((0.5 + np.sqrt(0.25 + alpha)) ** 2, rel=1e-9)


@pytest.mark.parametrize("power", [0.3, 0.5, 0.8])
@pytest.mark.sweep(3)
@pytest.mark.slow
def test_powers_below_one_of_a_switch(power):
    def f(z, a):
        return abs(z) ** power + 0.2 * z - a

    graph = explore(Switched(1, lambda z, a, sw: [sw.abs(z[0]) ** power + 0.2 * z[0] - a]), (-2, 2))
    assert largest_residual(graph, f, np.linspace(-1.9, 1.9, 11)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("kink", [0.3, -0.7])
@pytest.mark.parametrize("power", [0.5, 0.7])
@pytest.mark.parametrize("rise", [0.0, 0.4])
@pytest.mark.sweep(8)
def test_infinite_slopes_at_a_kink_that_is_not_zero(kink, power, rise):
    """At the kink the slopes make all of H look like rounding: no branch runs along the kink."""
    arch = Switched(1, lambda z, t, sw: z - 2.0 * sw.abs(z - kink - rise * t) ** power - t)
    graph = explore(arch, (-2.0, 2.0))

    def signs(t):
        """Return the number of solutions, by the signs at zero of the switch and far out."""
        q = np.concatenate([-np.geomspace(1e5, 1e-12, 20001), np.geomspace(1e-12, 1e5, 20001)])
        values = kink + rise * t + q - 2.0 * np.abs(q) ** power - t
        return int((values[1:] * values[:-1] < 0.0).sum())

    for t in (-1.73, -0.61, 0.27, 1.19, 1.91):
        assert graph.count(t) == signs(t)


@pytest.mark.parametrize("power", [0.5, 0.7])
@pytest.mark.parametrize("kink", [0.0, 0.25])
def test_a_fold_at_an_infinite_slope_is_one_solution(power, kink):
    graph = explore(Switched(1, lambda z, t, sw: sw.abs(z - kink) ** power - t), (-1.0, 1.0))
    assert [graph.count(t) for t in (-0.3, 0.3)] == [0, 2]
    assert graph.infinite == ()
    if kink == 0.0:  # elsewhere rounding of z moves the fold
        assert graph.count(0.0) == 1


@pytest.mark.slow
@pytest.mark.parametrize("at_bound", ["log", "1/z"])
def test_functions_that_are_infinite_at_a_bound(at_bound):
    if at_bound == "log":
        graph = explore(Complementarity(lambda z, a: [np.log(z[0]) - a], lower=0.0), (-2.0, 2.0))
        truth = np.exp
    else:
        graph = explore(Complementarity(lambda z, a: [2 - 1 / z[0] - a], lower=0.0), (-2.0, 1.0))

        def truth(alpha):
            return 1.0 / (2.0 - alpha)

    for alpha in (-1.0, 0.5):
        (solution,) = graph.solutions(alpha)
        assert solution.z[0] == pytest.approx(truth(alpha), rel=1e-9)


# -- overflow --------------------------------------------------------------------------------------


def test_no_solution_where_an_exponential_overflows():
    def f(z, a):
        return np.log(1 + np.exp(300 * z)) / 300 + 0.1 * z - a

    graph = explore(Switched(1, lambda z, a, sw: [f(z[0], a)]), (-3.0, 3.0))
    assert largest_residual(graph, f, (-2.0, 0.0, 2.0, 2.7, 2.8, 2.9)) < 1e-6
    assert all(abs(f(float(p.z[0]), p.alpha)) < 1e-6 for p in graph.special_points())


@pytest.mark.slow
def test_derivatives_of_a_steep_sigmoid_are_not_needed_to_be_exact():
    graph = explore(
        Switched(1, lambda z, a, sw: [z[0] - 1.5 / (1 + np.exp(-400 * (z[0] - 0.5))) - a]),
        (-3.0, 3.0),
    )
    assert [graph.count(alpha) for alpha in (-2.7, -2.0, -0.7, 1.7)] == [1, 1, 3, 1]


# -- far from zero ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("offset", "width"), [(300.0, 1e-3), (1e6, 1.0), (1e9, 0.01)])
def test_fine_structures_far_from_zero(offset, width):
    """y^3 - y + 0.3 relu(y - 0.2) = alpha for y = (z - offset) / width."""

    def equation(z, alpha, sw):
        y = (z[0] - offset) / width
        return [y**3 - y + 0.3 * sw.relu(y - 0.2) - alpha]

    graph = explore(Switched(1, equation), (-2.0, 2.0))
    counts = [graph.count(alpha) for alpha in (-1.5, 0.01, 0.25, 1.5)]
    # of z = 1e9 five digits are left, and Newton may stop: then the graph says so
    assert counts == [1, 3, 3, 1] or (offset == 1e9 and graph.guarantee != "balanced")
    for solution in graph.solutions(0.01):
        y = (float(solution.z[0]) - offset) / width
        assert abs(y**3 - y + 0.3 * max(y - 0.2, 0.0) - 0.01) < 1e-2


# -- where the model ends --------------------------------------------------------------------------

ENDS = {
    "arcsin": (lambda z, a: np.arcsin(z) - a, {-0.5 * np.pi, 0.5 * np.pi}),
    "root of alpha": (lambda z, a: np.sqrt(a - z) - z, {0.0}),
    "root of z": (lambda z, a: np.sqrt(z) + 1 - a, {1.0}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ENDS)
def test_the_end_of_a_model_lies_inside_and_within_the_error(name):
    f, ends = ENDS[name]
    graph = explore(Switched(1, lambda z, a, sw: [f(z[0], a)]), (-2.0, 2.0))
    stopped = graph.special_points("stopped")
    assert len(stopped) == len(ends)
    for point in stopped:
        assert np.isfinite(f(float(point.z[0]), point.alpha))
        assert min(abs(point.alpha - end) for end in ends) <= max(8.0 * point.error[-1], 1e-12)


@pytest.mark.parametrize("name", ["arcsin", "root of z"])
def test_the_end_of_a_model_by_differences_is_within_the_error(name):
    f, ends = ENDS[name]

    class ByDifferences(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z + 50.0

        def residual(self, z, alpha, character):
            return f(z, alpha)

    graph = explore(ByDifferences(), (-2.0, 2.0))
    for point in graph.special_points("stopped"):
        assert np.isfinite(f(float(point.z[0]), point.alpha))
        assert min(abs(point.alpha - end) for end in ends) <= 8.0 * point.error[-1]


class Numbers:
    """The switches of numbers."""

    abs = staticmethod(abs)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equation", "counts"),
    [
        (lambda z, a, sw: sw.abs(z) ** a - 2.0 - z, {-1.0: 2, 1.7: 2}),
        (lambda z, a, sw: z * sw.abs(z) ** a - 2.0 * a + 1.0, {1.7: 1}),
    ],
)
def test_powers_whose_exponent_changes_its_sign_raise_nothing(equation, counts):
    """At z = 0 the power is infinite, or nan, and Newton's steps grow beyond all numbers."""
    graph = explore(Switched(1, equation), (-1.0, 2.0))
    for alpha, count in counts.items():
        assert graph.count(alpha) == count
        for solution in graph.solutions(alpha):
            z = solution.z[0]
            assert abs(equation(z, alpha, Numbers)) < 1e-7 * (1.0 + abs(z) ** 2.7)


@pytest.mark.slow
def test_a_jump_of_a_power_is_no_solution():
    """At alpha = -1, z |z|^alpha is the sign of z: H is 2 for z < 0, and 4 for z > 0."""

    def equation(z, a, sw):
        return z * sw.abs(z) ** a - 2.0 * a + 1.0

    graph = explore(Switched(1, equation), (-1.0, 2.0), limits=Limits(pieces=20))
    assert graph.count(-1.0) == 0
    points = [(z, a) for piece in graph.pieces for z, a in piece.points if abs(z) < 1.0]
    assert max(abs(equation(z, a, Numbers)) for z, a in points) < 1e-2  # next to the jump


def test_a_piece_that_stops_where_slopes_are_infinite_ends_on_a_solution():
    def equation(z, a, sw):
        return sw.abs(z) ** a - 2.0 - z

    graph = trace(Switched(1, equation), ([-0.382], -0.5), (-1.0, -0.01))
    points = [point for piece in graph.pieces for point in piece.points]
    assert max(abs(equation(z, a, Numbers)) for z, a in points) < 1e-6


#: Slope of a band of solutions, and steepness of H below the band.
BANDS = [(0.8515441136060014, 1.9873988935975446), (0.8397174795825509, 0.8070434864400049)]


@pytest.mark.slow
@pytest.mark.parametrize(("slope", "steepness"), BANDS)
def test_slopes_that_vanish_on_both_sides_of_a_kink_are_no_jump(slope, steepness):
    """relu(z - s a)^2 (z - 3) - relu(s a - 1 - z) k (z + 4): solutions fill the band in between."""

    class Band(PiecewiseSystem):
        size = 1

        def __init__(self, slope, steepness):
            self.slope, self.steepness = slope, steepness

        def test_functions(self, z, alpha):
            return np.array([z[0] - self.slope * alpha, self.slope * alpha - 1.0 - z[0]])

        def residual(self, z, alpha, character):
            above, below = character.signs
            place = z[0] - self.slope * alpha
            up = place**2 * (z[0] - 3.0) if above else 0.0
            down = -(place + 1.0) * self.steepness * (z[0] + 4.0) if below else 0.0
            return np.array([up - down])

    assert explore(Band(slope, steepness), (-1.0, 1.3)).count(0.4) == np.inf


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_jump_beside_a_steep_function_is_refused(sign):
    """H jumps by 0.5 at z = 0; a typical magnitude away on one side, terms of H are 1e20."""

    class Steep(PiecewiseSystem):
        size = 1

        def scale(self, lo, hi):
            return np.ones(1)

        def test_functions(self, z, alpha):
            return z

        def residual(self, z, alpha, character):
            return np.exp(sign * 50.0 * z) + (0.5 if character.signs[0] else 0.0) - alpha

    with pytest.raises(InvalidSystemError, match="residual jumps by"):
        explore(Steep(), (0.5, 3.0))


# -- endless repetition ----------------------------------------------------------------------------


@pytest.mark.slow
def test_a_periodic_equation_without_periods_ends_in_words():
    graph = explore(Switched(1, lambda z, a, sw: [np.sin(z[0]) - a]), (-2.0, 2.0))
    assert "repeats itself without end" in graph.guarantee
    for solution in graph.solutions(0.3):
        assert np.sin(solution.z[0]) == pytest.approx(0.3, abs=1e-9)
    assert graph.count(1.5) == 0


@pytest.mark.slow
def test_islands_that_repeat_without_end_are_not_all_found():
    """For z0 < 0 the first equation is exp(sin(2 z1)) = -alpha: z1 repeats itself with z0."""

    def equations(z, a, sw):
        first = z[0] + sw.abs(z[0]) - np.exp(np.sin(2.0 * z[1])) - a
        return [first, z[1] - np.exp(np.sin(2.0 * z[0]))]

    graph = explore(Switched(2, equations), (-1.0, 2.0))
    assert "there may be more" in graph.guarantee
    for solution in graph.solutions(-0.7):
        assert np.abs(equations(solution.z, -0.7, Numbers)).max() < 1e-9


#: Unbounded periodic equations of two unknowns, whose solutions are infinitely many.
PERIODIC = {
    "paths that branch": lambda z, a, sw: [
        np.sin(z[0]) + 0.5 * sw.abs(np.cos(z[1])) - a,
        np.cos(z[0]) - np.sin(2.0 * z[1]),
    ],
    "many loops": lambda z, a, sw: [
        np.sin(3.0 * z[0]) + np.cos(2.0 * z[1]) - 0.3 * a,
        np.cos(2.0 * z[0]) - np.sin(z[1]),
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PERIODIC)
def test_periodic_equations_of_two_unknowns_end_in_words(name):
    graph = explore(Switched(2, PERIODIC[name]), (-1.0, 2.0))
    assert "many solutions were found" in graph.guarantee
    assert sum(len(piece.points) for piece in graph.pieces) < 12_000
    for alpha in (0.9, 1.2):
        for solution in graph.solutions(alpha):
            off = PERIODIC[name](solution.z, alpha, Numbers)
            assert np.abs(off).max() < 1e-7 * (1.0 + np.abs(solution.z).max())


def test_the_magnitude_of_an_unknown_in_an_oscillating_function_is_no_chance():
    """A sign change far out, where bisection goes astray, would give magnitudes of 1e9."""

    def equations(z, a, sw):
        first = z[0] - np.exp(np.sin(2.0 * z[1])) + sw.abs(z[0]) - a
        return [first, z[1] - np.exp(np.sin(2.0 * z[0]))]

    graph = explore(Switched(2, equations), (1.0, 1.5))
    # z1 = exp(sin(2 z0)), 2 z0 - exp(sin(2 z1)) = alpha for z0 > 0, and none for z0 < 0
    z0 = np.linspace(0.0, 5.0, 400_001)
    for alpha in (1.1, 1.4):
        values = 2.0 * z0 - np.exp(np.sin(2.0 * np.exp(np.sin(2.0 * z0)))) - alpha
        assert graph.count(alpha) == (values[1:] * values[:-1] < 0.0).sum()


def test_limits_end_an_equation_with_infinitely_many_branches():
    graph = explore(
        Switched(1, lambda z, a, sw: [np.tan(z[0]) - a]), (-2.0, 2.0), limits=Limits(pieces=12)
    )
    assert len(graph.pieces) == 12
    for solution in graph.solutions(0.3):
        assert np.tan(solution.z[0]) == pytest.approx(0.3, abs=1e-9)


@pytest.mark.slow
def test_infinitely_many_branches_far_apart_are_each_as_wide_as_one():
    """Of tan(z) = alpha the branch through zero and many others are found, all of them true."""
    graph = explore(Switched(1, lambda z, a, sw: np.tan(z) - a), (-1.0, 1.0))
    assert min(abs(s.z[0] - np.arctan(0.3)) for s in graph.solutions(0.3)) < 1e-9
    branches = [(s.z[0] - np.arctan(0.3)) / np.pi for s in graph.solutions(0.3)]
    np.testing.assert_allclose(branches, np.round(branches), atol=1e-9)
    assert len(set(np.round(branches))) == len(branches) > 20


class Squared(PiecewiseSystem):
    """(z^2 - a)^2 = 0."""

    size = 1

    def test_functions(self, z, alpha):
        return z + 70.0

    def residual(self, z, alpha, character):
        return (z**2 - alpha) ** 2


@pytest.mark.slow
def test_a_square_is_given_up_after_a_number_of_tiny_steps():
    """(z^2 - a)^2 vanishes twice on the curve: the graph says so, and promises nothing."""
    graph = explore(Squared(), (-1.0, 1.0))
    assert graph.guarantee.startswith("not balanced")
    assert "steps stay tiny" in graph.guarantee
    assert all(len(piece.points) < 2000 for piece in graph.pieces)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
@pytest.mark.sweep(30)
def test_a_reactor_has_no_solutions_at_negative_temperatures(seed):
    """There exp(g - g / temperature) is 1e40 to 1e180: a step of 1e-25 changes H by 1e17."""
    rng = np.random.default_rng([7, seed])
    g, heat, cooling = rng.uniform(15.0, 40.0), rng.uniform(0.2, 1.0), rng.uniform(0.0, 1.0)
    coolant, sign = rng.uniform(0.9, 1.0), 1 if seed % 3 else -1

    def residual(z, t, sw):
        rate = sign * t * z[0] * np.exp(g * (1.0 - 1.0 / z[1]))
        return [1.0 - z[0] - rate, 1.0 - z[1] + heat * rate - cooling * (z[1] - coolant)]

    def number(t):
        rate = np.linspace(0.0, 1.0, 1_000_001)
        temperature = (1.0 + heat * rate + cooling * coolant) / (1.0 + cooling)
        rest = rate - t * (1.0 - rate) * np.exp(g * (1.0 - 1.0 / temperature))
        return int((rest[1:] * rest[:-1] < 0.0).sum())

    graph = explore(Switched(2, residual), tuple(sorted((0.01 * sign, 3.0 * sign))))
    assert not graph.infinite
    for t in (0.02, 0.07, 0.234, 1.234, 2.7):
        assert graph.count(sign * t) == number(t)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1e4, 1e6, 1e8, 1e9, 1e10, 1e11])
@pytest.mark.sweep(7)
def test_a_fast_reaction_has_two_solutions(speed):
    """A + B <-> C in a stirred tank: only sums of rows tell the size of the third unknown."""

    def residual(z, t, sw):
        rate = speed * (z[0] * z[1] - 0.1 * z[2])
        return [t - z[0] - rate, 1.0 - z[1] - rate, rate - z[2]]

    graph = explore(Switched(3, residual), (0.1, 3.0))
    for t in (0.3, 0.9, 1.7, 2.6):
        # z2 = rate = speed ((t - z2) (1 - z2) - 0.1 z2)
        truth = np.sort(np.roots([1.0, -(t + 1.1 + 1.0 / speed), t]))
        found = sorted(float(solution.z[2]) for solution in graph.solutions(t))
        assert found == pytest.approx(truth, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.sweep(20)
def test_a_train_of_reactors_has_finitely_many_solutions(seed):
    rng = np.random.default_rng([9, seed])
    count, g = int(rng.integers(2, 4)), rng.uniform(10.0, 35.0)
    heat, cooling, coolant = rng.uniform(0.2, 1.2), rng.uniform(0.2, 3.0), rng.uniform(0.7, 1.1)

    def residual(z, t, sw):
        rows, feed, inlet = [], 1.0, 1.0
        for c, temperature in zip(z[::2], z[1::2], strict=True):
            rate = t * c * np.exp(g * (1.0 - 1.0 / temperature))
            cooled = cooling * (temperature - coolant)
            rows += [feed - c - rate, inlet - temperature + heat * rate - cooled]
            feed, inlet = c, temperature
        return rows

    graph = explore(Switched(2 * count, residual), (0.01, 4.0))
    assert not graph.infinite
    for t in (0.5, 1.234, 3.0):
        assert graph.count(t) >= 1
        for solution in graph.solutions(t):
            assert np.abs(residual(solution.z, t, None)).max() < 1e-9


@pytest.mark.parametrize("steepness", [20.0, 40.0, 100.0])
def test_exact_derivatives_are_not_accused_where_large_terms_cancel(steepness):
    """Far from both steps the slope is 1e-10, and H the sum of 1 and -1."""
    system = Switched(1, lambda z, t, sw: np.tanh(steepness * (z - t)) + np.tanh(steepness * z))
    graph = trace(system, ([0.0], 0.0), (-0.1, 0.1))
    assert [graph.count(t) for t in (-0.05, 0.02)] == [1, 1]
    assert graph.solutions(0.05)[0].z[0] == pytest.approx(0.025, abs=1e-9)


@pytest.mark.parametrize("power", [0.5, 1.5, 0.3])
def test_powers_of_the_parameter_need_no_negative_parameter(power):
    graph = explore(Switched(1, lambda z, t, sw: z - t**power), (0.3, 10.0))
    assert graph.solutions(1.7)[0].z[0] == pytest.approx(1.7**power, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("steepness", [3e4, 1e6])
@pytest.mark.parametrize("unit", [1e-9, 1.0])
def test_a_steep_flank_that_moves_with_alpha(steepness, unit):
    """The tails of the sigmoid solve left and right of the flank; continuity tells of a third."""

    def f(z, t, sw):
        return z / unit - 2.0 * np.tanh(steepness * (z / unit - 0.3 - t)) - 0.5 * t

    graph = explore(Switched(1, f), (-0.5, 0.5))
    for t in (-0.41, 0.1, 0.33):
        left, middle, right = sorted(float(s.z[0]) / unit for s in graph.solutions(t))
        assert (left, right) == pytest.approx((0.5 * t - 2.0, 0.5 * t + 2.0))
        assert middle == pytest.approx(0.3 + t, abs=2.0 / steepness)


def test_a_pole_is_no_change_of_sign():
    """z (z - t) = 1 has a root on either side of the pole."""
    graph = explore(Switched(1, lambda z, t, sw: 1 / (z - t) - z + sw.relu(z - 3)), (-1.0, 1.0))
    assert [graph.count(t) for t in (-0.7, 0.1, 0.5)] == [2, 2, 2]


@pytest.mark.slow
def test_solutions_alike_in_shape_beside_a_stop():
    """Bratu's equation on ten places with a stop: four solutions, of which three are far out."""
    n, stop = 10, 20.0 / 11.0 * (np.arange(10) == 5)
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)

    def f(z, t, sw):
        return stiffness @ z - t * np.exp(z) / 121.0 + stop * sw.relu(z[5] - 1.5)

    graph = explore(Switched(n, f), (0.2, 4.0))
    found = graph.solutions(2.1449)
    assert len(found) == 4  # as many as Newton finds from thousands of random starts
    for solution in found:
        terms = stiffness @ solution.z - 2.1449 * np.exp(solution.z) / 121.0
        assert np.abs(terms + stop * max(solution.z[5] - 1.5, 0.0)).max() < 1e-10
