"""Equilibria of Filippov systems and periodic points of maps against closed forms and all words."""

from functools import reduce
from itertools import product

import numpy as np
import pytest
from pwscont_dynamics import AffinePeriodicPoints, FilippovEquilibria, PeriodicPoints
from pwscont_dynamics.scenes import border_collision, boundary_equilibrium, normal_form
from sweeps import swept
from switched_systems import agree

from pwscont import InvalidInputError, InvalidSystemError, check_system, explore
from pwscont.search import MultiStart

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

INTERVAL = (-1.0, 1.0)


def states(graph, alpha):
    return [solution.z for solution in graph.solutions(alpha)]


# -- maps ----------------------------------------------------------------------------------------


def orbits(left, right, b, period):
    """Return all orbits of x -> A x + b with A by the sign of x_1, over all words."""
    n, found = len(b), []
    for word in product([0, 1], repeat=period):
        M, v = np.eye(n), np.zeros(n)
        for side in word:
            A = (left, right)[side]
            M, v = A @ M, A @ v + b
        x = np.linalg.solve(np.eye(n) - M, v)
        points = [x]
        for side in word[:-1]:
            points.append((left, right)[side] @ points[-1] + b)
        if all((point[0] >= 0.0) == side for point, side in zip(points, word, strict=True)):
            found.append(np.concatenate(points))
    return found


@pytest.mark.parametrize("period", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("numbers", "count"),
    [((1.6, 0.4, -2.2, 0.5), None), ((0.5, 0.3, -0.4, 0.3), (1, 1)), ((2, 0.3, -0.4, 0.3), (0, 2))],
)
def test_the_normal_form(numbers, count, period):
    """Chaos, persistence and a non-smooth fold at mu = 0 (di Bernardo et al. 2008, chapter 3)."""
    graph = border_collision(period, *numbers).run()
    left, right = normal_form(*numbers[:2]), normal_form(*numbers[2:])
    for mu in (-0.7, 0.7):
        truth = orbits(left, right, np.array([mu, 0.0]), period)
        assert agree(truth, states(graph, mu))
        assert count is None or len(truth) == count[mu > 0]
    assert graph.guarantee == "complete"
    assert graph.count(0.0) == 1


def test_sixteen_words_from_one_point():
    graph = border_collision().run()
    assert [count for *_, count in graph.multiplicity()] == [0, 16]
    (point,) = graph.special_points("nonsmooth branch point")
    assert point.alpha == pytest.approx(0.0, abs=1e-15)
    found = graph.solutions(0.5)
    assert sorted(solution.label for solution in found) == sorted(
        f"word {''.join(word)}" for word in product("LR", repeat=4)
    )
    assert sorted(solution["period"] for solution in found) == [1] * 2 + [2] * 2 + [4] * 12
    for solution in found:
        word = solution.label.split()[1]
        M = np.eye(2)
        for letter in word:
            M = normal_form(*((1.6, 0.4) if letter == "L" else (-2.2, 0.5))) @ M
        largest = np.abs(np.linalg.eigvals(M)).max()
        assert solution["|multiplier|"] == pytest.approx(largest, rel=1e-12)


def test_a_stable_point_attracts():
    """The recorded multiplier says whether iteration converges."""
    left, right = normal_form(0.5, 0.3), normal_form(-0.4, 0.3)
    graph = border_collision(1, 0.5, 0.3, -0.4, 0.3).run()
    for mu in (-0.5, 0.5):
        (solution,) = graph.solutions(mu)
        x = np.zeros(2)
        for _ in range(200):
            x = (right if x[0] >= 0.0 else left) @ x + [mu, 0.0]
        assert solution["|multiplier|"] == pytest.approx(0.3**0.5, rel=1e-12)
        assert x == pytest.approx(solution.z, abs=1e-12)


@pytest.mark.parametrize("seed", swept(range(8), range(8, 300)))
def test_random_affine_maps(seed):
    rng, n, period = np.random.default_rng(seed), 1 + seed % 3, 1 + seed % 4
    left = rng.normal(size=(n, n))
    right = left.copy()
    right[:, 0] = rng.normal(size=n)
    b, c = rng.normal(size=(2, n))
    graph = explore(AffinePeriodicPoints(left, right, c, b, period), INTERVAL)
    assert graph.guarantee.startswith("complete")
    for alpha in (-0.8123, -0.1234, 0.4567, 0.9345):
        assert agree(orbits(left, right, b + alpha * c, period), states(graph, alpha))


@pytest.mark.slow
def test_periodic_points_of_a_curved_map():
    """x -> mu - x^2 left of 0, mu - 3 x right of it: period two by the quadratic formula.

    With x < 0 and y = mu - x^2 >= 0, x = mu - 3 y is 3 x^2 - x - 2 mu = 0.
    """
    system = PeriodicPoints(
        lambda x, mu: mu - x**2, lambda x, mu: mu - 3.0 * x, lambda x, mu: x[0], 1, period=2
    )
    graph = explore(system, (0.05, 1.0), parameter="mu")
    for mu in (0.1, 0.5, 0.9):
        x = (1.0 - (1.0 + 24.0 * mu) ** 0.5) / 6.0
        y, fixed = mu - x**2, mu / 4.0
        truth = [np.array(z) for z in ([x, y], [y, x], [fixed, fixed])]
        below = (-1.0 - (1.0 + 4.0 * mu) ** 0.5) / 2.0  # x = mu - x^2
        truth += [np.array([below, below])]
        assert agree([z for z in truth if abs(z[0]) < 2.0], states(graph, mu))
        (other,) = (s for s in graph.solutions(mu) if s.label == "word LR")
        assert system.largest_multiplier(other.z, mu) == pytest.approx(abs(6.0 * x), rel=1e-7)
        assert system.least_period(other.z, mu) == 2


def test_words_of_maps():
    system = border_collision(2).system
    assert system.names() == ("x1 at 0", "x2 at 0", "x1 at 1", "x2 at 1")
    one, other = (system.character(np.array([x, 0.0, -1.0, 0.0]), 0.0) for x in (-1.0, 1.0))
    assert system.describe_transition(one, other) == "border collision LL → RL"
    assert system.test_name(1) == "the border at point 1"


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("period", [1, 2, 3, 4])
@pytest.mark.sweep(4)
def test_the_sign_is_that_of_the_determinant_of_one_less_the_derivative(n, period):
    rng = np.random.default_rng(10 * n + period)
    left = rng.normal(size=(n, n))
    right = left + np.outer(rng.normal(size=n), np.arange(n) == 0)
    points = AffinePeriodicPoints(left, right, rng.normal(size=n), period=period)
    graph = explore(points, INTERVAL)
    found = [*graph.solutions(-0.5), *graph.solutions(0.5)]
    assert found  # a line through zero has solutions on one side at least
    for solution in found:
        steps = [right if side == "R" else left for side in solution.label.split()[-1]]
        derivative = reduce(lambda whole, step: step @ whole, steps, np.eye(n))
        assert solution.det_sign == np.sign(np.linalg.det(np.eye(n) - derivative))


# -- Filippov systems ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("c2", "kind"), [(0.3, "transition"), (-2.0, "nonsmooth fold")])
def test_boundary_equilibria(c2, kind):
    """A focus meets the border: a pseudo-equilibrium goes on, or comes back."""
    A, b, c = np.array([[-1, 1], [-0.3, -0.5]]), np.array([1.0, 0.2]), np.array([1.0, c2])
    graph = boundary_equilibrium(1.0, c2).run()
    (point,) = graph.special_points(kind)
    assert (point.alpha, point.z[0]) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert point.message.startswith("boundary equilibrium")
    for mu in (-0.6, 0.6):
        check_affine(graph, A, mu * b, c, mu)


def affine_equilibria(A, b, c):
    """Return regular equilibria, and pseudo-equilibria with their shares, for f+ = A x + b, f- = c.

    On x_1 = 0 a pseudo-equilibrium has A x + b = -nu c with nu = (1 - share) / share > 0.
    """
    n = len(b)
    x = np.linalg.solve(A, -b)
    regular = [x] if x[0] > 0.0 else []
    rest, nu = np.split(np.linalg.solve(np.column_stack([A[:, 1:], c]), -b), [n - 1])
    pseudo = [(np.append(0.0, rest), 1.0 / (1.0 + nu[0]))] if nu[0] > 0.0 else []
    return regular, pseudo


def check_affine(graph, A, b, c, alpha):
    regular, pseudo = affine_equilibria(A, b, c)
    truth = [np.append(x, 1.0 + x[0]) for x in regular]
    truth += [np.append(x, share) for x, share in pseudo]
    assert agree(truth, states(graph, alpha))


@pytest.mark.parametrize("seed", swept(range(2), range(2, 80)))
def test_random_boundary_equilibria(seed):
    rng, n = np.random.default_rng(seed), 2 + seed % 2
    A, (b, c, d) = rng.normal(size=(n, n)), rng.normal(size=(3, n))
    b = 0.3 * b
    system = FilippovEquilibria(
        lambda x, t: A @ x + b + t * d, lambda x, t: c, lambda x, t: x[0], n
    )
    graph = explore(system, INTERVAL)
    for alpha in (-0.8123, -0.1234, 0.4567, 0.9345):
        check_affine(graph, A, b + alpha * d, c, alpha)


@pytest.mark.slow
def test_equilibria_of_a_curved_field():
    """x' = mu - x^2 for x > 0 and x' = 1 for x < 0: sqrt(mu), or 0 with share 1 / (1 - mu)."""
    system = FilippovEquilibria(lambda x, mu: mu - x**2, lambda x, mu: [1.0], lambda x, mu: x[0], 1)
    graph = explore(system, INTERVAL, parameter="mu")
    for mu in (-0.9, -0.2, 0.3, 0.8):
        (solution,) = graph.solutions(mu)
        x = np.sqrt(max(mu, 0.0))
        assert solution.z[0] == pytest.approx(x, abs=1e-10)
        share = 1.0 if mu > 0.0 else 1.0 / (1.0 - mu)
        assert system.share(solution.z, mu) == pytest.approx(share, rel=1e-10)
        if mu > 0.0:
            assert system.growth(solution.z, mu) == pytest.approx(-2.0 * x, rel=1e-6)


@pytest.mark.slow
def test_stability_of_equilibria():
    """Eigenvalues of the field; and of the sliding field, written out by hand."""
    A = np.array([[-1, 1], [-0.3, -0.5]])
    graph = boundary_equilibrium(1.0, -2.0).run()
    found = {solution.label: solution for solution in graph.solutions(0.5)}
    regular, pseudo = found["regular, h > 0"], found["pseudo-equilibrium"]
    assert regular["growth"] == pytest.approx(np.linalg.eigvals(A).real.max(), rel=1e-7)
    # on x_1 = 0: x_2' = (f-_1 f+_2 - f+_1 f-_2) / (f-_1 - f+_1) with f- = (1, -2)

    def sliding(y, mu=0.5):
        first, second = A @ [0.0, y] + mu * np.array([1.0, 0.2])
        return (second + 2.0 * first) / (1.0 - first)

    y, step = pseudo.z[1], 1e-6
    assert sliding(y) == pytest.approx(0.0, abs=1e-12)
    slope = (sliding(y + step) - sliding(y - step)) / (2.0 * step)
    assert pseudo["growth"] == pytest.approx(slope, rel=1e-6)
    f = A @ pseudo.z[:2] + 0.5 * np.array([1.0, 0.2])
    assert pseudo["pull"] == pytest.approx(1.0 - f[0], rel=1e-6)


def test_words_of_equilibria():
    system = boundary_equilibrium().system
    words = [system.describe(system.character(np.array([0, 0, y]), 0.0)) for y in (-0.5, 0.5, 1.5)]
    assert words == [
        "regular equilibrium where h < 0",
        "pseudo-equilibrium",
        "regular equilibrium where h > 0",
    ]


# -- systems and errors --------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [border_collision, boundary_equilibrium])
def test_every_system_keeps_its_contract(scene):
    system, rng = scene().system, np.random.default_rng(0)
    points = [(rng.normal(size=system.size), float(rng.normal())) for _ in range(10)]
    report = check_system(system, points)
    assert not report.defects, report


WRONG = {
    "period must be a positive whole number, got 0": lambda: border_collision(0),
    "the map jumps at x_1 = 0: left and right differ in column 2": lambda: AffinePeriodicPoints(
        np.eye(2), 2.0 * np.eye(2), [1.0, 0.0]
    ),
    r"left has shape \(1, 1\), expected \(2, 2\)": lambda: AffinePeriodicPoints(
        [[1]], np.eye(2), [1, 0]
    ),
    "border must be a function": lambda: PeriodicPoints(abs, abs, None, 1),
    "n must be a positive whole number, got 1.5": lambda: FilippovEquilibria(abs, abs, abs, 1.5),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_said(message):
    with pytest.raises(InvalidInputError, match=message):
        WRONG[message]()


FIELDS = {
    r"plus must return 2 real numbers, and returns 1": lambda x, t: x[:1],
    r"plus fails at x = .*: ZeroDivisionError": lambda x, t: 1 / 0,
}


@pytest.mark.parametrize("message", FIELDS)
def test_errors_of_fields_are_named(message):
    system = FilippovEquilibria(FIELDS[message], lambda x, t: x, lambda x, t: x[0], 2)
    with pytest.raises(InvalidSystemError, match=message):
        explore(system, INTERVAL)


def test_a_map_that_jumps_is_refused():
    system = PeriodicPoints(
        lambda x, t: 0.5 * x + t, lambda x, t: 0.5 * x + t + 0.3, lambda x, t: x[0], 1
    )
    with pytest.raises(InvalidSystemError, match="jumps"):
        explore(system, INTERVAL)


@pytest.mark.parametrize("period", [2, 3])
def test_fixed_points_are_points_of_every_period(period):
    """x -> mu + 0.4 x left of 0, mu - 1.05 x + 0.3 x^2 right of it: one fixed point is far away."""

    def system(k):
        right = lambda x, mu: mu - 1.05 * x + 0.3 * x**2  # noqa: E731
        return PeriodicPoints(lambda x, mu: mu + 0.4 * x, right, lambda x, mu: x[0], 1, k)

    starts = [(np.full(1, far), -0.15) for far in (-0.25, 6.9057)]
    found = {d: system(period).of_period(d) for d in (1, period)}
    assert found[1].size == 1
    graph = explore(found[1], (-0.2, 0.4), starts=starts, search=MultiStart(count=1))
    assert [round(float(s.z[0]), 3) for s in graph.solutions(-0.15)] == [-0.25, 6.906]
    assert [type(each).__name__ for each in found[period].searches()] == ["ShorterPeriods"]
