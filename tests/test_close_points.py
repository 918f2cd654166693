"""Special points closer than digits tell apart, and curves that touch an interface."""

import numpy as np
import pytest

from pwscont import PiecewiseLinearSystem, PiecewiseSystem, explore, trace

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

#: How far an event is beyond a kink.
GAPS = (0.0, 1e-12, 3e-11, 1e-10, 3e-10, 1e-9, 5e-9, 1e-7, -1e-10, -1e-9, -5e-9)


class Sheets(PiecewiseLinearSystem):
    """|z| = level + max(alpha - 0.2, 0): two solutions at every alpha."""

    size = 1

    def __init__(self, level=1.0):
        self.level = level

    def scale(self, lo, hi):
        return np.ones(1)

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha - 0.2])

    def residual(self, z, alpha, character):
        far, late = character.signs
        return (z if far else -z) - self.level - (alpha - 0.2 if late else 0.0)


class CurvedSheets(PiecewiseSystem):
    """The same solutions, as those of z^2 = (1 + max(alpha - 0.2, 0))^2."""

    size = 1
    test_functions = Sheets.test_functions

    def residual(self, z, alpha, character):
        return z**2 - (1.0 + (alpha - 0.2 if character.signs[1] else 0.0)) ** 2


@pytest.mark.parametrize("kind", [Sheets, CurvedSheets])
@pytest.mark.parametrize(
    "gap", [0.0, 1e-12, 3e-11, 1e-10, 3e-10, 1e-9, 5e-9, 1e-7, -1e-10, -1e-9, -5e-9]
)
@pytest.mark.sweep(6)
def test_an_event_beside_a_kink_loses_no_branch(kind, gap):
    graph = explore(kind(), (-1.0, 1.0), events={"level": lambda z, alpha: alpha - 0.2 - gap})
    for alpha in (-0.5, 0.1, 0.3, 0.7):
        found = sorted(solution.z[0] for solution in graph.solutions(alpha))
        true = 1.0 + max(alpha - 0.2, 0.0)
        np.testing.assert_allclose(found, [-true, true], rtol=1e-12)


@pytest.mark.parametrize("level", [1.0, 1e3, 1e6])
@pytest.mark.parametrize("gap", [2e-9, 1e-5, 1e-3, 1e-2])
@pytest.mark.sweep(6)
def test_events_side_by_side_far_from_zero(level, gap):
    """Digits tell the less apart, the larger unknowns are beside what is typical for them."""
    events = {"one": lambda z, alpha: alpha - 0.5, "other": lambda z, alpha: alpha - 0.5 - gap}
    graph = explore(Sheets(level), (-1.0, 1.0), events=events)
    if graph.special_points("stopped"):
        assert "stopped" in graph.guarantee
    else:
        assert [graph.count(alpha) for alpha in (-0.5, 0.3, 0.7)] == [2, 2, 2]


class FoldBesideSeam(PiecewiseSystem):
    """alpha = u^2 + u^3 / 7 + c max(u - d, 0)^2 with z = u + level: fold at u = 0, seam at d."""

    size = 1

    def __init__(self, d, c, level=0.0):
        self.d, self.c, self.level = d, c, level

    def scale(self, lo, hi):
        return np.ones(1)

    def test_functions(self, z, alpha):
        return z - self.level - self.d

    def residual(self, z, alpha, character):
        u = z - self.level
        return alpha - u**2 - u**3 / 7.0 - (self.c * (u - self.d) ** 2 * character.signs[0])


@pytest.mark.parametrize("begin", [0.5, -0.5])
@pytest.mark.parametrize("c", [0.0, 1.0])
@pytest.mark.parametrize("d", [0.0, 1e-12, 1e-10, 1e-9, 3e-9, 1e-8, 1e-7, -1e-12, -1e-9])
@pytest.mark.sweep(6)
def test_a_fold_beside_a_seam_loses_no_branch(d, c, begin):
    system = FoldBesideSeam(d, c)
    alpha = begin**2 + begin**3 / 7.0 + c * max(begin - d, 0.0) ** 2
    graph = trace(system, ([begin], alpha), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.5, 0.01, 0.7)] == [0, 2, 2]
    assert graph.is_balanced()


@pytest.mark.parametrize("d", [1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("level", [1e3, 1e6])
@pytest.mark.sweep(4)
def test_a_fold_beside_a_seam_far_from_zero(d, level):
    graph = trace(FoldBesideSeam(d, 0.0, level), ([level + 0.5], 0.25 + 0.125 / 7.0), (-1.0, 1.0))
    assert [graph.count(alpha) for alpha in (-0.5, 0.1, 0.7)] == [0, 2, 2]


class Touches(PiecewiseSystem):
    """e - c max(e + D, 0) = 0 for e = z - sin(2 alpha), D = q ((alpha - p)^2 + d^2) >= 0.

    The test e + D is D / (1 - c) on the only curve, which stays where it is positive.
    """

    size = 1

    def __init__(self, p, q, c, d):
        self.p, self.q, self.c, self.d = p, q, c, d

    def depth(self, alpha):
        return self.q * ((alpha - self.p) ** 2 + self.d**2)

    def solution(self, alpha):
        return np.sin(2.0 * alpha) + self.c / (1.0 - self.c) * self.depth(alpha)

    def test_functions(self, z, alpha):
        return z - np.sin(2.0 * alpha) + self.depth(alpha)

    def residual(self, z, alpha, character):
        e = z - np.sin(2.0 * alpha)
        return e - self.c * (e + self.depth(alpha)) * character.signs[0]


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.sweep(24)
def test_a_curve_that_touches_an_interface_stays_on_its_side(seed):
    rng = np.random.default_rng(seed)
    p, q, c = (
        rng.uniform(-0.8, 0.8),
        10.0 ** rng.uniform(-1.0, 1.0),
        rng.choice([-2, -0.5, 0.5, 0.9]),
    )
    system = Touches(p, q, c, d=rng.choice([0.0, 1e-12, 1e-9, 1e-8, 1e-6]))
    graph = trace(system, ([system.solution(-0.95)], -0.95), (-1.0, 1.0))
    assert not graph.special_points("stopped")
    for alpha in (-0.99, -0.9, p - 1e-3, p + 1e-3, 0.9):
        (solution,) = graph.solutions(alpha)
        assert solution.z[0] == pytest.approx(system.solution(alpha), abs=1e-9)
    for point in graph.special_points("corner"):
        assert "touches the interface" in point.message
        assert abs(point.alpha - p) <= 10.0 * point.error[-1]


class FoldOfTwoLines(PiecewiseLinearSystem):
    """alpha = 3 max(z, 0) - z: falls to the fold at z = 0, and rises beyond."""

    size = 1

    def scale(self, lo, hi):
        return np.ones(1)

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return alpha + (z - 3.0 * z if character.signs[0] else z)


@pytest.mark.parametrize("begin", [0.25, -0.5])
@pytest.mark.parametrize("gaps", [(1e-9, 3e-9), (-1e-9, -3e-9), (1e-9, -2e-9), (4e-9, 5e-9)])
@pytest.mark.parametrize("events_see", ["z", "alpha"])
@pytest.mark.sweep(6)
def test_several_events_beside_a_fold_lose_no_branch(events_see, gaps, begin):
    """All are the same place by digits: what a walk left, and what it has passed before."""

    def seen(z, alpha):
        return z[0] if events_see == "z" else alpha

    events = {
        "one": lambda z, alpha: seen(z, alpha) - gaps[0],
        "other": lambda z, alpha: seen(z, alpha) - gaps[1],
    }
    alpha = max(2.0 * begin, -begin)
    graph = trace(FoldOfTwoLines(), ([begin], alpha), (-1.0, 1.0), events=events)
    assert [graph.count(alpha) for alpha in (-0.5, 0.01, 0.7)] == [0, 2, 2]
    assert graph.is_balanced()
    kinds = [str(point.kind) for point in graph.special_points()]
    met = sum(1 if events_see == "z" else 2 * (gap > 0.0) for gap in gaps)
    assert kinds.count("nonsmooth fold") == 1
    assert kinds.count("event") == met


class CutCircle(PiecewiseSystem):
    """z^2 + alpha^2 = 1 in all cells, cut by chords between pairs of angles."""

    size = 1

    def __init__(self, *pairs):
        ends = np.array(pairs)
        middle, half = 0.5 * ends.sum(axis=1), 0.5 * (ends[:, 1] - ends[:, 0])
        self.normals = np.column_stack([np.cos(middle), np.sin(middle)])
        self.offsets = np.cos(half)

    def test_functions(self, z, alpha):
        return self.normals @ np.array([alpha, z[0]]) - self.offsets

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0


#: A fold of alpha at pi, at or between seams, and where one of several seams is touched.
CHORDS = [
    *([(np.pi - gap, 0.229)] for gap in (1e-12, -1.1e-12, 1e-10, -1e-10, 1e-8, 0.0)),
    [(np.pi - 4e-11, 1.3), (np.pi + 1.6e-10, 2.2)],
    [(np.pi + 1.6e-10, 1.1), (np.pi, 2.2), (np.pi - 4.5e-11, np.pi + 7.7e-8)],
]


@pytest.mark.parametrize("chords", CHORDS)
@pytest.mark.parametrize("begin", [0.5, 2.57, 5.5])
@pytest.mark.sweep(12)
def test_seams_beside_a_fold_are_met(chords, begin):
    """Every piece lies in its own cell, and none is followed twice."""
    system = CutCircle(*chords)
    graph = trace(system, ([np.sin(begin)], np.cos(begin)), (-1.5, 1.5))
    assert not graph.special_points("stopped")
    for alpha in (-0.9, -0.3, 0.4, 0.9):
        found = graph.solutions(alpha)
        true = (1.0 - alpha**2) ** 0.5
        np.testing.assert_allclose(sorted(s.z[0] for s in found), [-true, true], rtol=1e-12)
        for solution in found:
            tests = system.test_functions(solution.z, alpha)
            clear = np.abs(tests) > 1e-9
            np.testing.assert_array_equal((tests >= 0.0)[clear], solution.character.array[clear])


class Touching(PiecewiseSystem):
    """y = x^2 + level, x = alpha while y >= interface: in decimal numbers, level is the interface.

    Beyond the interface the equations have the solutions y - level = -x^2 / (beyond - 1).
    """

    size = 2

    def __init__(self, level, interface, beyond):
        self.level, self.interface, self.beyond = level, interface, beyond

    def test_functions(self, z, alpha):
        return np.array([z[1] - self.interface])

    def residual(self, z, alpha, character):
        below = 0.0 if character.signs[0] else z[1] - self.interface
        return np.array([z[1] - z[0] ** 2 - self.level - self.beyond * below, z[0] - alpha])


#: Numbers of a user, and the same in another notation, which is larger by a unit in the last place.
SAME_DECIMALS = [(0.3, 0.1 + 0.2), (3.3, 1.1 + 2.2), (0.6, 6 * 0.1), (1.4, 14 * 0.1)]


@pytest.mark.parametrize(("level", "interface"), SAME_DECIMALS)
@pytest.mark.parametrize("beyond", [1.5, 2.0, 20.0])
@pytest.mark.parametrize("begin", [-0.9, 0.9])
@pytest.mark.sweep(9)
def test_a_curve_that_seems_to_cross_by_rounding_does_not_turn_back(
    level, interface, beyond, begin
):
    """Only rounding tells the touching curves from two non-smooth folds, which end them."""
    assert 0.0 < interface - level <= np.spacing(level)
    system = Touching(level, interface, beyond)
    graph = trace(system, ([begin, begin**2 + level], begin), (-1.0, 1.0))
    assert not graph.special_points("nonsmooth fold")
    for alpha in (-0.5, 0.1, 0.5):
        (solution,) = graph.solutions(alpha)
        np.testing.assert_allclose(solution.z, [alpha, alpha**2 + level], rtol=1e-12)
