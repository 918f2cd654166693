"""What lies inside the interval only is found: loops, and branches from infinity to infinity."""

import numpy as np
import pytest

from pwscont import PiecewiseSystem, Switched, explore, trace
from pwscont.curve.metric import Metric, deflation, stretch
from pwscont.search.multi_start import Throughout

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


class Curve(PiecewiseSystem):
    """H(z, alpha) = 0 for one unknown, without a kink where it matters."""

    size = 1

    def __init__(self, function, box=None):
        self.function, self.box = function, box

    def bounds(self):
        return self.box or super().bounds()

    def test_functions(self, z, alpha):
        return z + 70.0

    def residual(self, z, alpha, character):
        with np.errstate(divide="ignore"):
            return self.function(z, alpha)


class Counted:
    """A function that counts its calls."""

    def __init__(self, function):
        self.function, self.calls = function, 0

    def __call__(self, z, alpha):
        self.calls += 1
        return self.function(z, alpha)


def islands(z, alpha):
    """Return zero on a line and on two ellipses of 4 and of 20 % of the interval (-1, 1)."""
    small = ((z - 3.0) / 0.3) ** 2 + ((alpha - 0.55) / 0.04) ** 2 - 1.0
    large = ((z + 2.0) / 0.7) ** 2 + ((alpha + 0.2) / 0.2) ** 2 - 1.0
    return (z - 0.1 * alpha) * small * large


#: A function, an interval, bounds, and the number of solutions at some alphas.
CASES = {
    "circle": (lambda z, a: z**2 + a**2 - 1.0, (-1.5, 1.5), None, {0.1: 2, 0.97: 2, 1.2: 0}),
    "tanh": (lambda z, a: np.tanh(z) - a, (-1.4, 1.4), None, {-0.95: 1, 0.1: 1, 1.2: 0}),
    "root": (lambda z, a: z / np.sqrt(1 + z**2) - a, (-1.4, 1.4), None, {-0.9: 1, 0.7: 1, 1.2: 0}),
    "pole": (lambda z, a: z * (0.64 - a**2) - 1.0, (-1.5, 1.5), None, {-1.2: 1, 0.1: 1, 1.2: 1}),
    "hyperbola": (lambda z, a: 1.0 / z - a, (-0.5, 1.0), None, {-0.3: 1, 0.0: 0, 0.1: 1}),
    "bounds": (lambda z, a: z - a, (-1.0, 1.0), (0.0, 0.5), {-0.5: 0, 0.2: 1, 0.8: 0}),
    "islands": (islands, (-1.0, 1.0), None, {-0.5: 1, -0.2: 3, 0.3: 1, 0.55: 3, 0.9: 1}),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.sweep(6)
def test_as_many_as_the_closed_form_says(name):
    function, interval, box, counts = CASES[name]
    graph = explore(Curve(function, box), interval)
    assert {alpha: graph.count(alpha) for alpha in counts} == counts
    assert sum(len(piece.alpha) for piece in graph.pieces) <= 2000


class FarFromZero(PiecewiseSystem):
    """A loop around a point far from zero, such as a temperature, in n turned unknowns."""

    def __init__(self, radius, place, rng):
        self.size, self.radius, self.place = len(place), radius, place
        self.frame = np.linalg.qr(rng.normal(size=(len(place),) * 2))[0]

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        y = self.frame.T @ (z - self.place)
        return np.array([y[0] ** 2 + alpha**2 - self.radius**2, *(y[1:] - np.sin(y[0]))])


@pytest.mark.parametrize("size", [30.0, 300.0, 1e4])
@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.sweep(9)
def test_loops_far_from_zero(n, size):
    rng = np.random.default_rng([n, int(size)])
    radius = rng.uniform(0.3, 0.8)
    graph = explore(FarFromZero(radius, size * rng.normal(size=n), rng), (-1.0, 1.0))
    for alpha in rng.uniform(-1.0, 1.0, 5):
        assert graph.count(alpha) == (2 if abs(alpha) < radius else 0), graph.guarantee


class WeakLoad(PiecewiseSystem):
    """Roots at known places, which a weak load hardly moves, in n turned unknowns."""

    def __init__(self, roots, load, n, rng):
        self.size, self.roots, self.load = n, roots, load
        self.frame = np.linalg.qr(rng.normal(size=(n, n)))[0]

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        y = self.frame.T @ z
        return np.array([np.prod(y[0] - self.roots) - self.load * alpha, *(y[1:] - y[0])])


@pytest.mark.slow
@pytest.mark.parametrize("load", [1e-2, 1e-4, 1e-8])
@pytest.mark.parametrize(("n", "most"), [(1, 6), (2, 3), (3, 3)])
@pytest.mark.sweep(9)
def test_branches_that_a_weak_load_hardly_moves(n, most, load):
    rng = np.random.default_rng([n, most])
    for number in range(2, most):
        roots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 2.0, number - 1))])
        graph = explore(WeakLoad(roots, load, n, rng), (0.1, 1.0))
        assert graph.count(0.5) == number, (graph.guarantee, roots)


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e4])
@pytest.mark.parametrize("load", [1e-3, 1e-5, 1e-7])
@pytest.mark.sweep(12)
def test_constants_that_cancel_beside_a_weak_load(load, unit):
    b = 1.85 * unit

    def curve(z, alpha):
        return (z - b) ** 2 / b**2 + 0.5 * z / b - 1.0 - load * alpha

    graph = explore(Curve(curve), (0.1, 1.0))
    assert (graph.count(0.5), graph.guarantee) == (2, "balanced")


@pytest.mark.parametrize("width", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("given", [None, 1.0])
@pytest.mark.sweep(4)
def test_narrow_intervals(width, given):
    arch = Switched(1, lambda z, t, sw: z * (z - 1.0) * (z - 2.0) - t, scale=given)
    middle = 0.2 + 0.5 * width
    graph = explore(arch, (0.2, 0.2 + width))
    exact = np.sort(np.roots([1.0, -3.0, 2.0, -middle]))
    assert np.allclose(sorted(float(s.z[0]) for s in graph.solutions(middle)), exact, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("apart", [1e-5, 1e-3])
def test_solutions_close_together_on_both_sides_of_a_kink(apart):
    def rows(z, t, sw):
        return [sw.abs(z[0] - z[1] ** 2) - apart, z[1] - t + 0.2 * sw.relu(z[0])]

    graph = explore(Switched(2, rows), (-1.0, 2.0))
    for alpha in (-0.5, 0.3, 1.7):  # z0 = z1^2 +- apart > 0: a quadratic equation for z1
        exact = [np.roots([0.2, 1.0, 0.2 * off - alpha]) for off in (apart, -apart)]
        found = sorted(float(s.z[1]) for s in graph.solutions(alpha))
        assert np.allclose(found, np.sort(np.concatenate(exact)), rtol=1e-9, atol=0.0)
    assert graph.guarantee == "balanced"  # known solutions are not found again and again


@pytest.mark.slow
def test_a_search_that_is_given_up_says_so():
    graph = explore(Curve(lambda z, a: np.sin(z) - 0.5 * a), (-1.0, 1.0))
    assert "there may be more" in graph.guarantee


@pytest.mark.slow
def test_a_bounded_function_far_from_zero_takes_little():
    bounded = Counted(lambda z, alpha: np.tanh(z - 300.0) - 1.4 * alpha)
    assert explore(Curve(bounded), (-1.0, 1.0)).count(0.1) == 1
    assert bounded.calls < 60_000  # 230,000 if Newton goes on where tanh is constant


class Waves(Curve):
    """A pole, and an unknown that oscillates along the branches to infinity; both are turned."""

    size = 2

    def __init__(self):
        self.turn = np.array([[np.cos(1.4), np.sin(1.4)], [-np.sin(1.4), np.cos(1.4)]])

    def bounds(self):
        return PiecewiseSystem.bounds(self)

    def test_functions(self, z, alpha):
        return z[:1] + 70.0

    def residual(self, z, alpha, character):
        y, wave = self.turn @ z
        return np.array([y * (0.3 - (alpha - 0.42) ** 2) - 1.9, wave - 0.9 * np.sin(y + 1.0)])


@pytest.mark.slow
def test_branches_to_infinity_along_which_an_unknown_oscillates():
    graph = explore(Waves(), (-0.38, 1.44))
    assert [graph.count(alpha) for alpha in (-0.3, 0.1, 0.4, 0.9, 1.3)] == [1, 1, 1, 1, 1]
    assert "runs to infinity" in graph.guarantee
    assert "twice" not in graph.guarantee
    assert sum(len(piece.alpha) for piece in graph.pieces) <= 16_000


@pytest.mark.parametrize("far", [1e80, 1e155, 1e300])
def test_known_solutions_are_not_felt_from_afar(far):
    """Functions such as exp(z / 2) throw starts so far that squares leave the range of numbers."""
    metric, known = Metric(np.ones(2), (-1.0, 1.0)), [np.array([1.0, 0.0])]
    with np.errstate(over="ignore", invalid="ignore"):
        assert deflation(metric, known, np.array([far, 0.0])) == 1.0
        assert stretch(metric, known, np.array([far, 0.0]), np.array([1.0, 0.0])) == 1.0


def test_a_loop_with_kinks():
    graph = explore(Switched(1, lambda z, t, sw: sw.abs(z) + t * t - 1.0), (-1.5, 1.5))
    assert [graph.count(t) for t in (-0.97, 0.1, 0.7, 1.2)] == [2, 2, 2, 0]


def test_a_line_that_cuts_a_sphere():
    """z_2 = 0.3 z_1 + 0.2 and z_3 = 0.1 leave a loop of z_1 and alpha."""

    def sphere(z, t, sw):
        return [
            z[0] ** 2 + z[1] ** 2 + z[2] ** 2 + t * t - 1.0,
            z[1] - 0.3 * z[0] - 0.2,
            z[2] - 0.1,
        ]

    graph = explore(Switched(3, sphere), (-1.4, 1.6))
    half = 0.12**2 - 4.0 * 1.09 * (0.04 + 0.01 + 0.5**2 - 1.0)
    roots = np.sort([(-0.12 + s * np.sqrt(half)) / 2.18 for s in (-1.0, 1.0)])
    assert np.sort([s.z[0] for s in graph.solutions(0.5)]) == pytest.approx(roots)
    assert [graph.count(t) for t in (-1.2, 1.2)] == [0, 0]


def test_what_was_searched_is_said():
    graph = explore(Curve(lambda z, a: z**2 + 1.0 + 0.0 * a), (0.0, 1.0))
    assert graph.guarantee == f"nothing found by {graph.searched.what}"
    assert "values of alpha between, deflated" in graph.searched.what


@pytest.mark.slow
def test_nothing_is_searched_inside_where_all_is_proved():
    """The loop |z - 3| + t^2 = 1 is proved from few calls; the same with a search takes more."""
    calls = []

    def loop(z, t, sw):
        calls.append(t)
        return sw.abs(z - 3.0) + t * t - 1.0

    counts = []
    for search in (None, Throughout()):
        calls.clear()
        graph = explore(Switched(1, loop), (-1.4, 1.6), search=search)
        counts.append(len(calls))
        assert [graph.count(t) for t in (-1.2, 0.5, 1.2)] == [0, 2, 0]
        assert (graph.proof is not None) == (search is None)
        assert search or "only if not all branches were proved" in graph.searched.what
    assert counts[0] < counts[1]


@pytest.mark.slow
def test_known_branches_are_not_searched_again_where_constants_cancel():
    def arch(z, alpha):
        turned = (z + 3e6 + 0.123) - (3e6 + 0.123)
        return turned + 0.5 * z**3 - 2.0 * z + 1.7 * np.maximum(z - 0.1, 0.0) - alpha

    counted = Counted(arch)
    graph = explore(Curve(counted), (-1.0, 1.0))
    for alpha in (-0.7, 0.2, 0.8):
        exact = [r.real for r in np.roots([0.5, 0.0, -1.0, -alpha]) if not r.imag and r.real < 0.1]
        exact += [
            r.real for r in np.roots([0.5, 0, 0.7, -0.17 - alpha]) if not r.imag and r.real > 0.1
        ]
        assert np.allclose(sorted(s.z[0] for s in graph.solutions(alpha)), sorted(exact), atol=1e-7)
    assert counted.calls < 150_000


#: Factors of z, which is zero for all alpha, and the number of solutions with this factor.
WITH_TRIVIAL = {
    "pitchfork": (lambda z, a, sw: z**2 - a, lambda a: 1 + 2 * (a > 0.0)),
    "nonsmooth pitchfork": (lambda z, a, sw: sw.abs(z) - a, lambda a: 1 + 2 * (a > 0.0)),
    "loop": (lambda z, a, sw: (z - 1) ** 2 + a * a - 0.01, lambda a: 1 + 2 * (abs(a) < 0.1)),
}


@pytest.mark.sweep(15)
@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1e-3, 1e3, 1e12])
@pytest.mark.parametrize("name", WITH_TRIVIAL)
def test_beside_a_solution_that_stays_at_zero_in_any_unit(name, unit):
    factor, count = WITH_TRIVIAL[name]
    system = Switched(1, lambda z, a, sw: z / unit * factor(z / unit, a, sw))
    graph = explore(system, (-1.0, 1.0))
    assert [graph.count(a) for a in (-0.3, -0.05, 0.05, 0.3)] == [
        count(a) for a in (-0.3, -0.05, 0.05, 0.3)
    ]


@pytest.mark.parametrize("start", [0.0, 1e-9])
@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_many_unknowns_that_stay_at_zero_in_any_unit(unit, start):
    """A chain buckles where alpha is an eigenvalue of K, the first at 2 - 2 cos(pi / 41)."""
    K = 2.0 * np.eye(40) - np.eye(40, k=1) - np.eye(40, k=-1)
    system = Switched(40, lambda z, a, sw: K @ z - a * z + z**3 / unit**2)
    graph = trace(system, (np.full(40, start * unit), 0.0), (0.0, 0.015))
    assert [graph.count(a) for a in (0.003, 0.013)] == [1, 3]
    assert sum(len(piece.points) for piece in graph.pieces) < 120


@pytest.mark.parametrize("unit", [1e-12, 1e3])
@pytest.mark.parametrize("function", [np.sinh, lambda z: 2.0 * z - np.tanh(z)])
def test_bends_beside_overflow_and_straight_parts(function, unit):
    """The slope of each function is 1 at z = 0 and grows: two more solutions where alpha > 0."""
    system = Switched(1, lambda z, a, sw: function(z / unit) - (1.0 + 0.5 * a) * z / unit)
    graph = trace(system, (np.zeros(1), -1.0), (-1.0, 1.0))
    assert [graph.count(a) for a in (-0.7, -0.2, 0.2, 0.7)] == [1, 1, 3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.0, 4.0])
def test_a_chain_buckles_under_a_load_that_is_weak_beside_the_stiffness(apart):
    """As above with sin(z) for z - z^3, which never bends K z by much; units of each unknown."""
    K = 2.0 * np.eye(33) - np.eye(33, k=1) - np.eye(33, k=-1)
    first, second = (2.0 - 2.0 * np.cos(k * np.pi / 34.0) for k in (1, 2))
    units = 1e-6 * 10.0 ** np.random.default_rng(3).uniform(-apart, apart, 33)
    system = Switched(33, lambda z, a, sw: K @ (z / units) - a * np.sin(z / units))
    graph = trace(system, (np.zeros(33), 0.5 * first), (0.5 * first, 0.5 * (first + second)))
    assert [graph.count(a) for a in (0.8 * first, 0.8 * first + 0.2 * second)] == [1, 3]


@pytest.mark.parametrize("unit", [1e-60, 1e-45, 1e45, 1e60])
def test_folds_in_units_that_are_far_from_one(unit):
    """y - y^3 / 3 = alpha with y = z / unit has folds at y = 1 and y = -1."""
    graph = trace(Curve(lambda z, a: z / unit - (z / unit) ** 3 / 3.0 - a), ([0.0], 0.0), (-2, 2))
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    assert folds == pytest.approx([-2.0 / 3.0, 2.0 / 3.0])
    assert [graph.count(alpha) for alpha in (-1.0, 0.1, 1.0)] == [1, 3, 1]


class Chain(PiecewiseSystem):
    """A straight chain of rods with springs K = stiffness (2, -1): unknowns are unit times angles.

    ``load``: the right-hand side of alpha and the angles.
    """

    def __init__(self, size, stiffness, unit, load):
        self.size, self.unit, self.load = size, unit, load
        self.K = stiffness * (2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return self.K @ (z / self.unit) - self.load(alpha, z / self.unit)


@pytest.mark.parametrize("unit", [1e-6, 1.0])
def test_a_weak_load_that_buckles_a_stiff_chain_tells_the_unit_of_the_angles(unit):
    """K has the eigenvalues 4000 sin^2(j pi / 18); the straight chain stays for all loads."""
    chain = Chain(8, 1e3, unit, lambda alpha, angles: alpha * np.sin(angles))
    graph = trace(chain, (np.zeros(8), 0.0), (0.0, 300.0))
    (point,) = graph.special_points("branch point")
    assert point.alpha == pytest.approx(4e3 * np.sin(np.pi / 18.0) ** 2)
    assert [graph.count(alpha) for alpha in (100.0, 200.0)] == [1, 3]


class KnownChain(Chain):
    """The same chain with a Jacobian, for a load that does not depend on the angles."""

    def jacobian(self, z, alpha, character):
        by_alpha = -np.pi * np.cos(np.pi * alpha) * np.ones(self.size)
        return np.column_stack([self.K / self.unit, by_alpha])


@pytest.mark.parametrize("unit", [1e-6, 1.0])
def test_a_load_that_vanishes_at_both_ends_tells_the_unit_inside(unit):
    """K y = sin(pi alpha) (1, ..., 1) has one solution, y_i = sin(pi alpha) i (n + 1 - i) / 2."""
    chain = KnownChain(40, 1.0, unit, lambda alpha, angles: np.sin(np.pi * alpha) * np.ones(40))
    graph = trace(chain, (np.zeros(40), 0.0), (0.0, 1.0))
    (found,) = graph.solutions(0.3)
    i = np.arange(1.0, 41.0)
    np.testing.assert_allclose(found.z, unit * np.sin(0.3 * np.pi) * i * (41.0 - i) / 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_a_jump_of_h_at_an_end_says_nothing_of_the_unit(unit):
    """alpha^y jumps at alpha = y = 0, however small y is; alpha^y = 1/2 at one y for each alpha."""
    graph = explore(Curve(lambda z, a: np.power(a, z / unit) - 0.5), (0.0, 0.9))
    for alpha in (0.1, 0.5, 0.8):
        (found,) = graph.solutions(alpha)
        assert found.z == pytest.approx(unit * np.log(0.5) / np.log(alpha))


class FastReaction(PiecewiseSystem):
    """A reaction of rate 1e9 keeps z0 near z1 z2; only the sum of two rows tells the sizes."""

    size, rate = 3, 1e9

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        x, y, w = z
        fast = self.rate * (x - y * w)
        return np.array([fast - 1.0 + x, -fast + alpha - y, w**3 - 3.0 * w + x - 1.0])


@pytest.mark.slow
def test_a_fast_reaction_does_not_make_unknowns_seem_tiny():
    """With x = 1 + 3 w - w^3 and y = x - 1 + alpha a polynomial in w is left."""
    graph = explore(FastReaction(), (-2.0, 2.0))
    for alpha in (-1.5, -0.5, 0.5, 1.0, 1.9):
        x, e = np.poly1d([-1.0, 0.0, 3.0, 1.0]), 1.0 / FastReaction.rate
        w = np.poly1d([1.0, 0.0])
        roots = ((1.0 + e) * x - e - (x - 1.0 + alpha) * w).roots
        assert graph.count(alpha) == int((np.abs(roots.imag) < 1e-7).sum())


def test_branches_many_magnitudes_away_from_a_weak_load():
    """z (z - 1) (z - 3) = alpha / 1000 has three roots, and the load moves z by 1/3000."""
    graph = explore(Curve(lambda z, a: z * (z - 1.0) * (z - 3.0) - 1e-3 * a), (-1.0, 1.0))
    assert graph.multiplicity() == [(-1.0, 1.0, 3)]
