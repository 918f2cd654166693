"""Where tracing starts: given starts, bounds, periods, unique systems; no start without digits."""

import numpy as np
import pytest
from searches import Nothing

from pwscont import (
    EndPoints,
    InvalidInputError,
    InvalidSystemError,
    Limits,
    MultiStart,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    StartNotFoundError,
    Switched,
    explore,
    trace,
)
from pwscont.curve.metric import Metric
from pwscont.scenes.scene import Scene
from pwscont.scenes.table import report
from pwscont.search.default_search import default_search

#: Most calls of a formula of two unknowns, for each branch that explore finds and follows.
MOST_CALLS = 2500

# -- points without digits -----------------------------------------------------------------------


class Saturating(PiecewiseSystem):
    """z / (1 + z) where z >= 0, z elsewhere, equal to alpha: one solution for alpha < 1."""

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return (z / (1.0 + z) if character.signs[0] else z) - alpha


@pytest.mark.parametrize("interval", [(-1.0, 0.5), (-1.0, 0.9), (-3.0, -1.0), (0.0, 0.9)])
@pytest.mark.sweep(4)
def test_a_diverged_point_is_no_start(interval):
    """At alpha = -1 Newton runs off to -1e16 on the selection of the other cell."""
    graph = explore(Saturating(), interval)
    for alpha in np.linspace(*interval, 7):
        (solution,) = graph.solutions(float(alpha))
        truth = alpha / (1.0 - alpha) if alpha > 0.0 else alpha
        assert solution.z[0] == pytest.approx(truth, rel=1e-9, abs=1e-12)
    assert np.abs([point.z for point in graph.special_points()]).max() < 10.0


@pytest.mark.parametrize("search", [EndPoints(), MultiStart()])
def test_no_search_yields_points_without_digits(search):
    system = Saturating()
    found = list(search.starts(system, Metric.of(system, (-2.0, 2.0)), (-2.0, 2.0)))
    assert [x.tolist() for x, _ in found] == [[-2.0, -2.0]]


# -- rough starts --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n", [20, 60])
def test_a_curved_string_over_an_obstacle_has_one_solution(n):
    """From every start H grows before H falls: the active set changes first."""
    string = (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) * (n + 1.0) ** 2

    def forces(z, load, sw):  # the derivative of a convex energy, or the gap to the obstacle
        return sw.max(string @ z + z**3 - 20.0 * load, z - 0.5)

    graph = explore(Switched(n, forces), (-1.0, 1.0))
    for load in (-0.7, 0.3, 0.9):
        (solution,) = graph.solutions(load)
        gap, force = 0.5 - solution.z, 20.0 * load - string @ solution.z - solution.z**3
        assert min(gap.min(), force.min() / string[0, 0]) >= -1e-12
        assert np.minimum(gap, force / string[0, 0]).max() <= 1e-12


@pytest.mark.slow
def test_starts_that_lead_to_known_solutions_cost_little():
    """Nine solutions, three of each equation: z**3 - 3 z = alpha has three for |alpha| < 2."""
    calls = 0

    def two_of_a_kind(z, load, sw):
        nonlocal calls
        calls += 1
        return [z[i] ** 3 - 3.0 * z[i] + 0.5 * sw.relu(z[i] - 3.0) - load for i in range(2)]

    limits = Limits(seconds=1000.0)  # no proof ends the search
    graph = explore(Switched(2, two_of_a_kind), (-1.0, 1.0), limits=limits)
    roots = sorted(np.roots([1.0, 0.0, -3.0, -0.3]).real)
    found = sorted(tuple(solution.z) for solution in graph.solutions(0.3))
    assert np.array(found) == pytest.approx(np.array([(a, b) for a in roots for b in roots]))
    assert calls <= MOST_CALLS * len(found)


# -- given starts --------------------------------------------------------------------------------


class Parallels(PiecewiseSystem):
    """sin(pi z) = 0 far out: solutions are the whole numbers, of which z = 0 is not looked for."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0] - 1000.5])

    def residual(self, z, alpha, character):
        return np.sin(np.pi * (z - alpha))


def test_given_starts_are_followed_first():
    given = [([997.02], 0.0), ([-400.45], 0.5)]
    graph = explore(Parallels(), (0.0, 1.0), starts=given, search=Nothing())
    assert sorted(s.z[0] for s in graph.solutions(0.5)) == pytest.approx([-400.5, 997.5])
    assert graph.searched.what.startswith("2 given starts; ")


def test_the_search_looks_around_given_starts():
    """By two starts: the given one and zero; each leads to a solution near it."""
    system = Parallels()
    search = default_search(system, (0.0, 1.0), [np.array([1000.02])])
    assert "around=((1000.02,),)" in repr(search)
    one = MultiStart(count=1, around=((1000.02,),))
    assert one.searched(system).what.startswith("Newton from 1 start at both ends (")
    found = one.starts(system, Metric.of(system, (0.0, 1.0)), (0.0, 1.0))
    assert next(found)[0][0] == pytest.approx(1000.0)


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ([([0.0], 0.5), ([0.0], 3.0)], r"starts\[1\] at alpha = 3.0 lies outside"),
        ([([0.0], 0.5), ([0.0, 1.0], 0.5)], r"z of starts\[1\] has shape \(2,\)"),
        ([([np.nan], 0.5)], r"z of starts\[0\] must be finite"),
        ([0.5], r"starts\[0\] must be a pair"),
        (3, "starts must be pairs"),
    ],
)
def test_a_bad_start_is_named(starts, message):
    with pytest.raises(InvalidInputError, match=message):
        explore(Parallels(), (0.0, 1.0), starts=starts)


class WithoutSolution(Saturating):
    def residual(self, z, alpha, character):
        return z**2 + 1.0


def test_a_start_without_solution_is_named():
    with pytest.raises(StartNotFoundError, match=r"near starts\[0\] at alpha = 0.5"):
        explore(WithoutSolution(), (0.0, 1.0), starts=[([1.0], 0.5)])


# -- bounds and periods --------------------------------------------------------------------------


class Line(PiecewiseSystem):
    """A power line from a bus of fixed voltage to a load alpha (1, 0.3), susceptance 2."""

    size = 2

    def test_functions(self, z, alpha):
        return np.array([z[1] - 2.0])

    def residual(self, z, alpha, character):
        angle, V = z
        active = 2.0 * V * np.sin(angle) + alpha
        return np.array([active, 2.0 * V**2 - 2.0 * V * np.cos(angle) + 0.3 * alpha])

    def names(self):
        return "angle", "V"

    def periods(self):
        return np.array([2.0 * np.pi, np.inf])


class PositiveVoltage(Line):
    def bounds(self):
        return np.array([-np.inf, 0.0]), np.inf


class HighVoltage(Line):
    def bounds(self):
        return np.array([-np.inf, 0.6]), np.inf


def voltages(alpha):
    """Return the positive solutions: V^2 is a root of a quadratic equation."""
    b, c = 0.3 * alpha - 1.0, alpha**2 * (0.25 + 0.0225)
    # 4 V^4 + 4 V^2 (0.3 alpha - 1) + alpha^2 (1 + 0.09) = 0 divided by 4
    squares = np.roots([1.0, b, c])
    return sorted(np.sqrt(squares.real).tolist()) if np.isreal(squares).all() else []


@pytest.mark.slow
def test_whole_periods_are_one_solution():
    """The equations hold for (angle + pi, -V) as well, and for no other copies."""
    graph = explore(Line(), (0.1, 0.7))
    for alpha in (0.2, 0.5, 0.65):
        found = sorted(abs(s.z[1]) for s in graph.solutions(alpha))
        assert found == pytest.approx(sorted(2 * voltages(alpha)), rel=1e-8)


@pytest.mark.parametrize("turn", [1e-6, 1e-11, 1.0, 360.0, 1e5])
@pytest.mark.parametrize("written", [False, True])
@pytest.mark.sweep(5)
def test_an_angle_in_any_unit(turn, written):
    """A cosine with a kink at one half has each value twice in a turn."""

    class Angle(PiecewiseSystem):
        size = 2

        def test_functions(self, z, alpha):
            return np.cos(2.0 * np.pi * z[:1] / turn) - 0.5

        def residual(self, z, alpha, character):
            height = np.cos(2.0 * np.pi * z[0] / turn)
            more = (height - 0.5) * character.signs[0]
            return np.array([height + more - alpha, z[1] - alpha * height])

        def periods(self):
            return np.array([turn, np.inf])

    def formula(z, alpha, sw):
        height = np.cos(2.0 * np.pi * z[0] / turn)
        return [height + sw.relu(height - 0.5) - alpha, z[1] - alpha * height]

    periods = [turn, np.inf]
    graph = explore(Switched(2, formula, periods=periods) if written else Angle(), (-0.9, 1.4))
    for alpha in (-0.6, 0.2, 1.1):
        angle = np.arccos(alpha if alpha < 0.5 else (alpha + 0.5) / 2.0) / (2.0 * np.pi)
        found = sorted(float(s.z[0]) / turn % 1.0 for s in graph.solutions(alpha))
        assert found == pytest.approx([angle, 1.0 - angle], rel=1e-9)


@pytest.mark.slow
def test_nothing_outside_the_bounds():
    graph = explore(PositiveVoltage(), (0.1, 0.7))
    assert len(graph.components()) <= 2
    for alpha in (0.2, 0.5, 0.65):
        assert sorted(s.z[1] for s in graph.solutions(alpha)) == pytest.approx(voltages(alpha))


def test_a_branch_ends_at_a_bound():
    graph = explore(HighVoltage(), (0.1, 0.8))
    (end,) = [p for p in graph.special_points("end") if 0.1 < p.alpha < 0.8]
    assert end.message == "V reaches its lower bound 0.6"
    assert end.z[1] == 0.6
    assert min(abs(v - 0.6) for v in voltages(end.alpha)) < 1e-9
    assert min(piece.z[:, 1].min() for piece in graph.pieces) >= 0.6


def test_a_start_outside_the_bounds_is_refused():
    low = [0.0, voltages(0.2)[0]]
    with pytest.raises(StartNotFoundError, match="outside the bounds of HighVoltage"):
        trace(HighVoltage(), ([-np.arcsin(0.1 / low[1]), low[1]], 0.2), (0.1, 0.7))


class Ramp(SlicewiseLinearSystem):
    """max(z, 0) + min(z, 0) / 2 = alpha: z never leaves through a bound that it rides on."""

    size = 2

    def test_functions(self, z, alpha):
        return np.array([z[0] - z[1]])

    def residual(self, z, alpha, character):
        return np.array([z[0] - z[1] - np.sin(alpha), z[1] if character.signs[0] else z[0]])

    def bounds(self):
        return 0.0, np.inf


def test_a_bound_may_be_a_test_as_well_and_pieces_may_ride_on_it():
    """min(z0, z1) = 0 and z0 - z1 = sin(alpha): one solution, always on a bound."""
    graph = explore(Ramp(), (-1.0, 5.0))
    for alpha in np.linspace(-0.95, 4.95, 23):
        (solution,) = graph.solutions(float(alpha))
        expected = max(np.sin(alpha), 0.0), max(-np.sin(alpha), 0.0)
        np.testing.assert_allclose(solution.z, expected, atol=1e-9)
    ends = {point.alpha for point in graph.special_points("end")}
    assert ends <= {-1.0, 5.0}


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ((1.0, 2.0, 3.0), r"must return \(lower, upper\)"),
        ((np.zeros(3), 1.0), r"can be broadcast to shape \(2,\)"),
        (([0.0, 1.0], [1.0, 1.0]), "lower < upper, but for V they are 1.0 and 1.0"),
        ((0.0, np.nan), "must return numbers"),
    ],
)
def test_wrong_bounds_are_refused(bounds, message, monkeypatch):
    monkeypatch.setattr(Line, "bounds", lambda self: bounds)
    with pytest.raises(InvalidSystemError, match=rf"Line.bounds\(\).*{message}"):
        explore(Line(), (0.1, 0.7))


@pytest.mark.parametrize("periods", [np.zeros(3), -1.0, "one", None])
def test_wrong_periods_are_refused(periods, monkeypatch):
    monkeypatch.setattr(Line, "periods", lambda self: periods)
    with pytest.raises(InvalidSystemError, match=r"Line.periods\(\) must return"):
        explore(Line(), (0.1, 0.7))


class ManyTests(Saturating):
    """Twenty tests, of which trying all patterns would be refused."""

    def test_functions(self, z, alpha):
        return z[0] - np.arange(20.0)


def test_many_tests_are_no_reason_to_refuse_a_search_without_cells():
    graph = explore(ManyTests(), (-1.0, -0.5))
    assert graph.solutions(-0.7)[0].z[0] == pytest.approx(-0.7)


# -- unique --------------------------------------------------------------------------------------


class Cubic(PiecewiseSystem):
    """z^3 + s z = alpha, with the promise of one solution, which is true for s = 1 only."""

    size, unique = 1, True

    def __init__(self, s):
        self.s = s

    def test_functions(self, z, alpha):
        return z - 0.3

    def residual(self, z, alpha, character):
        return z**3 + self.s * z - alpha


@pytest.mark.parametrize("find", [explore, lambda *a: trace(a[0], ([0.5], 0.6), a[1])])
def test_one_solution_of_a_unique_system_is_all(find):
    graph = find(Cubic(1.0), (-1.0, 1.0))
    assert graph.guarantee == "complete (unique by the system's promise)"
    assert graph.count(0.2) == 1


@pytest.mark.parametrize("find", [explore, lambda *a: trace(a[0], ([1.2], 0.6), a[1])])
def test_two_solutions_break_the_promise(find):
    with pytest.raises(InvalidSystemError, match=r"Cubic.unique promises one .*z=\[.*z=\["):
        find(Cubic(-1.0), (-1.0, 1.0))


class CountedStarts(Cubic):
    calls = 0

    def residual(self, z, alpha, character):
        type(self).calls += alpha == 1.0
        return super().residual(z, alpha, character)


def test_a_unique_system_is_not_searched_on():
    """From lo the branch reaches hi, where no start is looked for any more."""
    search = MultiStart(count=50)
    explore(CountedStarts(1.0), (-1.0, 1.0), search=search)
    few, CountedStarts.calls = CountedStarts.calls, 0
    CountedStarts.unique = False
    explore(CountedStarts(1.0), (-1.0, 1.0), search=search)
    assert few < 0.1 * CountedStarts.calls


# -- closed loops --------------------------------------------------------------------------------


class Ring(SlicewiseLinearSystem):
    """|z| = r(alpha), positive within the interval only: one closed loop."""

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return (z if character.signs[0] else -z) - (1.0 - (alpha - 0.4) ** 2 / self.radius**2)

    def __init__(self, radius):
        self.radius = radius


@pytest.mark.parametrize("radius", [0.1, 0.5, 0.9])
@pytest.mark.sweep(2)
def test_slices_between_the_ends_find_loops(radius):
    """Eight slices leave gaps of an eighth: no loop of that width is missed."""
    graph = explore(Ring(radius), (-1.0, 1.0 + radius))
    assert graph.count(0.4) == 2
    assert [len(c) for c in graph.components()] == [2]


def test_the_table_says_at_least_where_loops_may_be_missing():
    def heading(system):
        interval = (-1.0, 1.0)
        scene = Scene("ring", "a ring", system, interval)
        lines = report(scene, scene.run(), ()).splitlines()
        return next(line for line in lines if line.startswith("Number of solutions"))

    assert heading(Ring(0.3)) == "Number of solutions by alpha, at least"
    assert heading(Cubic(1.0)) == "Number of solutions by alpha"
