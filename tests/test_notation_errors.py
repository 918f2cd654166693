"""What a user hears of a function with switches that does not do what it should."""

import math
import warnings

import numpy as np
import pytest

from pwscont import (
    LCP,
    AbsNormal,
    Complementarity,
    InvalidInputError,
    InvalidSystemError,
    Switched,
    check_system,
    enumerate_solutions,
    explore,
    trace,
)
from pwscont.notation.derivatives import derivatives_of

WRONG = {
    "shape (3,)": lambda z, t, sw: np.zeros(3),
    "shape \\(1, 2\\)": lambda z, t, sw: np.zeros((1, 2)),
    "NoneType": lambda z, t, sw: None,
    "complex": lambda z, t, sw: z + 1j,
    "KeyError: 'gap'": lambda z, t, sw: {}["gap"],
    "finite at none": lambda z, t, sw: z * np.nan,
    "write sw.abs instead": lambda z, t, sw: np.abs(z) - t,
    "write sw.max instead": lambda z, t, sw: np.maximum(z, 0.0) - t,
    "write sw.clip instead": lambda z, t, sw: z.clip(0.0, 1.0) - t,
    "write sw.where instead": lambda z, t, sw: np.where(z > 0, z, 2.0 * z) - t,
    "no switch announces": lambda z, t, sw: np.sort(z) - t,
    "arguments of sw.max": lambda z, t, sw: sw.max(z, np.zeros(3)) - t,
    "arguments of sw.abs must be real": lambda z, t, sw: sw.abs(z + 1j) - t,
    "lower is larger": lambda z, t, sw: z - sw.clip(z, 1.0, 0.0) - t,
    "finite at none of": lambda z, t, sw: z - sw.clip(z, [0.0, np.nan], 1.0) - t,
    "sw has no 'maximum'; it has max": lambda z, t, sw: sw.maximum(z, 0.0) - t,
    "infinite": lambda z, t, sw: z - sw.max(z, -np.inf) - t,
    "arguments of sw.min must be real numbers or arrays of them, got texts": lambda z, t, sw: (
        z - sw.min(z, "a")
    ),
    "must return 2 real numbers, got str: texts": lambda z, t, sw: "z",
    "write a continuous formula": lambda z, t, sw: np.sign(z) - t,
}


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("words", WRONG)
def test_a_wrong_function_is_refused_at_once(words, linear):
    with pytest.raises(InvalidSystemError, match=words.replace("(3,)", "\\(3,\\)")):
        Switched(2, WRONG[words], linear=linear)


@pytest.mark.parametrize(
    ("f", "words"),
    [
        (lambda z, t, sw: z * z - t, "entry 0 of the function is not affine"),
        (lambda z, t, sw: z - t**3, "entry 0 of the function"),
        (lambda z, t, sw: z - sw.relu(z[0] * z[1]) - t, "call 1 of sw, sw.relu"),
        (lambda z, t, sw: z - z[0] * sw.relu(z) - t, "entry 0 of the function"),
        (lambda z, t, sw: z + 1e-3 * np.sin(z) - t, "not affine"),
    ],
)
def test_a_curved_function_is_not_linear(f, words):
    with pytest.raises(InvalidSystemError, match=words):
        Switched(2, f, linear=True)


def test_switches_must_not_depend_on_values():
    def f(z, t, sw):  # floats go unseen by what carries derivatives
        return [sw.relu(z[0]) - t if float(z[0]) > 5.0 else z[0] - t]

    system = Switched(1, f)
    with pytest.raises(InvalidSystemError, match="the switches of the function change"):
        system.test_functions(np.array([6.0]), 0.0)

    def other(z, t, sw):
        first, second = (sw.relu, sw.abs) if float(z[0]) > 5.0 else (sw.abs, sw.relu)
        return [first(z[0]) + second(z[0] - 1.0) - t]

    with pytest.raises(
        InvalidSystemError, match=r"sw.relu is number 1 .* before \(sw.abs, sw.relu"
    ):
        Switched(1, other).test_functions(np.array([6.0]), 0.0)


def test_arguments_are_checked():
    def line(z, t, sw):
        return z - sw.relu(z - t)

    with pytest.raises(InvalidInputError, match="n must be"):
        Switched(0, line)
    with pytest.raises(InvalidInputError, match="f must be a function"):
        Switched(1, 3.0)
    with pytest.raises(InvalidInputError, match="names must be 1 texts, got 2"):
        Switched(1, line, names=["a", "b"])
    with pytest.raises(InvalidInputError, match="switches must be 1 names"):
        Switched(1, line, switches=["a", "b"])
    with pytest.raises(InvalidInputError, match="names must be a list of texts, got 5"):
        Switched(1, line, names=5)
    with pytest.raises(InvalidInputError, match="switches must be a list of texts, got 'a'"):
        Switched(1, line, switches="a")
    for wrong in ({"unique": "no"}, {"degree": 0.5}, {"degree": "1"}):
        with pytest.raises(InvalidInputError, match="unique must be True or False, and degree a"):
            Switched(1, line, **wrong)
    for bounds in (5, ("a", "b")):
        with pytest.raises(InvalidInputError, match=r"bounds must be a pair \(lower, upper\) of"):
            Switched(1, line, bounds=bounds)
    for M in (np.ones((2, 3)), np.ones(2), 2.0):
        with pytest.raises(InvalidInputError, match="M must be square"):
            LCP(M, [0, 0], [0, 0])
    with pytest.raises(InvalidInputError, match=r"Z has shape \(\), expected \(1, 1\)"):
        AbsNormal(1.0, 0.0, 1.0, 1.0, [0], [0])
    with pytest.raises(InvalidInputError, match="strictly lower triangular"):
        AbsNormal([[1]], [[1]], [[1]], [[1]], [0], [0])
    with pytest.raises(InvalidInputError, match="J has shape"):
        AbsNormal([[1]], [[0]], [[1, 2]], [[1]], [0], [0])
    with pytest.raises(InvalidInputError, match="how many unknowns"):
        Complementarity(lambda z, t: z - t)
    with pytest.raises(InvalidInputError, match="z of the start has shape"):
        trace(Switched(1, line), ([0.0, 1.0], 0.0), (-1.0, 1.0))


@pytest.mark.parametrize(
    ("f", "bounds", "points"),
    [
        # relu(-z) is zero where the function is tried first, and so are its products
        (lambda z, t, sw: z - sw.max(sw.relu(-z) * sw.relu(z + 3.0), t), None, [[-3.0], [0.0]]),
        (lambda z, t, sw: z - sw.max(sw.relu(-z) ** 2 - 0.5, t), None, [[0.0]]),
        # and exp(-40 y) where relu(40 z) is not
        (lambda z, t, sw: z + sw.max(np.exp(-40.0 * sw.relu(40.0 * z)), 0.1) - t, None, [[0.0]]),
        # and here an unknown could be at its bound
        (
            lambda z, t, sw: np.array([z[0] - t, z[1] - sw.max(z[1] * sw.relu(z[0] - 0.3), 1.0)]),
            (0.0, np.inf),
            [[0.3, 1.0]],
        ),
    ],
)
def test_switches_within_switches_are_seen_wherever_the_function_is_tried(f, bounds, points):
    system = Switched(len(points[0]), f, bounds=bounds)
    report = check_system(system, [(z, t) for z in points for t in (-1.0, 0.5)])
    assert not report.defects, report


@pytest.mark.parametrize("bounds", [(2.0, 3.0), (2.0, np.inf), (-np.inf, 2.9), (2.79, 2.81)])
def test_switches_of_unknowns_with_equal_bounds_are_not_taken_for_one(bounds):
    def f(z, t, sw):
        return np.array([z[0] - t + sw.relu(z[0] - 2.5), z[1] - 2.2 + sw.relu(z[1] - 2.5)])

    system, z = Switched(2, f, bounds=bounds), np.array([2.8, 2.2])
    found = system.residual(z, 2.9, system.character(z, 2.9))
    assert found == pytest.approx([2.8 - 2.9 + 0.3, 0.0], abs=1e-15)


@pytest.mark.parametrize("steepness", [30.0, 1e3])
def test_switches_of_saturated_arguments_are_not_taken_for_one(steepness):
    def f(z, t, sw):
        return z - t + np.stack([sw.relu(np.tanh(steepness * each)) for each in z])

    system, z = Switched(6, f), np.array([0.3, -0.3, 0.3, -0.3, -0.3, 0.3])
    found = system.residual(z, 0.0, system.character(z, 0.0))
    assert found == pytest.approx(z + np.maximum(0.0, np.tanh(steepness * z)), abs=1e-15)


def test_switches_whose_arguments_saturate_wherever_they_are_tried_are_refused_where_they_differ():
    def f(z, t, sw):
        return z - t + np.stack([sw.relu(np.tanh(1e9 * each)) for each in z])

    system, z = Switched(6, f), np.array([0.3, -0.3, 0.3, -0.3, -0.3, 0.3])
    with pytest.raises(InvalidSystemError, match="same arguments wherever the function was tried"):
        system.residual(z, 0.0, system.character(z, 0.0))


@pytest.mark.parametrize("call", [lambda sw, x: sw.clip(x, -1.0, 1.0), lambda sw, x: sw.abs(x)])
def test_switches_that_differ_by_less_than_rounding_of_usual_arguments_are_one(call):
    def f(z, t, sw):
        return np.array([z[0] - t + call(sw, z[0] - 5e-32) + 2.0 * call(sw, z[0] - 4e-32)])

    system = Switched(1, f)
    for z in (np.zeros(1), np.array([4.5e-32]), np.array([0.25])):
        found = system.residual(z, 0.0, system.character(z, 0.0))
        assert found == pytest.approx(4.0 * z, abs=1e-30)


def test_one_switch_that_is_called_twice_and_differs_by_rounding_is_one():
    def f(z, t, sw):
        return np.array([z[0] - t + sw.relu(z[0]) + sw.relu(2.0 * z[0] * 0.5)])

    system, z = Switched(1, f), np.array([0.3])
    assert system.residual(z, 0.5, system.character(z, 0.5)) == pytest.approx([0.4], abs=1e-15)
    assert len(system.test_functions(z, 0.5)) == 1


def test_functions_of_the_math_module_are_not_called_outside_their_domain():
    def f(z, t, sw):
        return np.array([math.asin(z[0]) - t + sw.relu(sw.relu(z[0]) - 0.1)])

    graph = trace(Switched(1, f), ([0.0], 0.0), (-0.5, 0.5))
    (solution,) = graph.solutions(0.4)
    assert math.asin(solution.z[0]) + solution.z[0] - 0.1 == pytest.approx(0.4, abs=1e-12)


def test_one_finite_point_is_not_enough_to_take_switches_for_one():
    def f(z, t, sw):
        rooted = np.sqrt(1e-4 - z**2)
        return rooted - 1e-2 + np.array([sw.relu(z[0]), 2.0 * sw.relu(z[1])]) - t

    system, z = Switched(2, f), np.array([1e-3, -1e-3])
    found = system.residual(z, 0.0, system.character(z, 0.0))
    rest = np.sqrt(1e-4 - 1e-6) - 1e-2
    assert found == pytest.approx([rest + 1e-3, rest], abs=1e-15)


def test_bounds_may_be_an_array():
    bounds = np.array([[0.0, -1.0], [9.0, 1.0]])
    system = Switched(2, lambda z, t, sw: sw.relu(z) - t, bounds=bounds)
    for found, given in zip(system.bounds(), bounds, strict=True):
        np.testing.assert_array_equal(found, given)


def test_bounds_that_cross_end_the_domain():
    lasso = Switched(1, lambda z, t, sw: z - 1.0 + sw.clip(z, -t, t), linear=True)
    with pytest.raises(InvalidInputError, match="domain"):
        explore(lasso, (-1.0, 1.0))


# -- what must work ------------------------------------------------------------------------------


def test_no_switch_at_all():
    system = Switched(2, lambda z, t, sw: z - t, linear=True)
    (solution,) = enumerate_solutions(system, 0.5)
    assert solution.z == pytest.approx([0.5, 0.5])
    assert explore(system, (0.0, 1.0)).guarantee == "complete"
    circle = Switched(2, lambda z, t, sw: [z[0] ** 2 + z[1] ** 2 - 1.0, z[0] - t])
    graph = trace(circle, ([0.0, 1.0], 0.0), (-2.0, 2.0))
    assert sorted(p.alpha for p in graph.special_points("fold")) == pytest.approx([-1.0, 1.0])


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize(
    "f",
    [
        lambda z, t, sw: z[0] - sw.max(t, 0.0),
        lambda z, t, sw: [z[0] - sw.max(t, 0)],
        lambda z, t, sw: z - sw.max([t], 0),
        lambda z, t, sw: z - sw.relu(np.array([t])),
        lambda z, t, sw: z - sum(sw.relu(each * t) for each in (0.25, 0.5, 0.25)),
        lambda z, t, sw: z - 0.5 * (t + sw.abs(t)),
        lambda z, t, sw: z - sw.where(t, t, 0.0),
        lambda z, t, sw: z - sw.clip(t, 0.0, np.inf),
        lambda z, t, sw: z + sw.min(-t, 0.0),
        lambda z, t, sw: z - sum(2 * [sw.relu(0.5 * t)]),
    ],
)
def test_the_same_kink_in_many_words(f, linear):
    system = Switched(1, f, linear=linear)
    graph = trace(system, ([0.0], -1.0), (-1.0, 1.0))
    for t in (-0.5, 0.25, 0.75):
        (solution,) = graph.solutions(t)
        assert solution.z[0] == pytest.approx(max(t, 0.0), abs=1e-12)


def test_a_switch_that_is_called_twice_is_one():
    def f(z, t, sw):
        return 3.0 * z - sw.relu(z - t) - sw.relu(z - t) + sw.relu(z + t) - 1.0

    system = Switched(1, f, linear=True)
    assert system.switches == ("relu 1", "relu 2")
    assert {point.kind for point in explore(system, (-1.0, 2.0)).special_points()} <= {
        *("start", "end", "transition")
    }


def smooth(z, t, sw):
    return np.array([z[0] - math.exp(-t * z[1]), z[1] + sw.relu(z[0] - 0.7) - t])


def filled(z, t, sw):
    value = np.zeros(2)
    value[0] = z[0] - np.exp(-t * z[1])
    value[1] = z[1] + sw.relu(z[0] - 0.7) - t
    return value


def looked_up(z, t, sw):
    load = np.interp(float(t), [-9.0, 9.0], [-9.0, 9.0])
    return np.array([z[0] - np.exp(-load * z[1]), z[1] + sw.relu(z[0] - 0.7) - load])


def traced(z, t, sw):
    return np.array([z[0] - np.exp(-t * z[1]), z[1] + sw.relu(z[0] - 0.7) - t])


@pytest.mark.slow
@pytest.mark.parametrize("f", [smooth, filled, looked_up])
@pytest.mark.sweep(4)
def test_functions_that_cannot_be_traced_are_followed_all_the_same(f):
    interval, start = (0.1, 1.5), ([1.0, 0.1], 0.1)
    graph, true = (trace(Switched(2, each), start, interval) for each in (f, traced))
    (kink,), (same,) = (each.special_points("transition") for each in (graph, true))
    assert kink.alpha == pytest.approx(same.alpha, rel=1e-9)
    for t in (0.2, 1.0):
        (one,), (other,) = graph.solutions(t), true.solutions(t)
        assert one.z == pytest.approx(other.z, rel=1e-9)


def test_derivatives_are_exact_where_a_function_can_be_traced():
    z, t = np.array([0.8, 0.3]), 0.4
    system = Switched(2, traced)
    character = system.character(z, t)
    e = np.exp(-t * z[1])
    exact = np.array([[1.0, t * e, z[1] * e], [1.0, 1.0, -1.0]])
    assert system.jacobian(z, t, character) == pytest.approx(exact, rel=1e-15)
    assert system.test_jacobian(z, t) == pytest.approx(np.array([[1.0, 0.0, 0.0]]), rel=1e-15)


def test_own_derivatives_are_used():
    calls = []

    def jacobian(z, t):
        calls.append(t)
        return np.array([[math.exp(z[0]), -1.0]])

    system = Complementarity(lambda z, t: [math.exp(z[0]) - t], n=1, jacobian=jacobian)
    graph = trace(system, ([1.0], 3.0), (0.5, 4.0))
    (kink,) = graph.special_points("transition")
    assert kink.alpha == pytest.approx(1.0, rel=1e-14)
    assert calls


def test_a_linear_function_that_cannot_be_traced_is_read_off_in_numbers():
    def f(z, t, sw):
        value = np.zeros(2)
        for i in range(2):
            value[i] = 2.0 * z[i] - sw.relu(z[1 - i] + float(t))
        return value

    (solution,) = enumerate_solutions(Switched(2, f, linear=True), 0.5)
    assert solution.z == pytest.approx([0.5, 0.5], rel=1e-14)


def test_numbers_of_any_size_keep_their_digits():
    """Coefficients come from derivatives: none is the small difference of large numbers."""
    system = Switched(1, lambda z, t, sw: 1e10 - 1e-3 * z - sw.relu(z) * 1e-3 - t, linear=True)
    (solution,) = enumerate_solutions(system, 0.0)
    assert solution.z[0] == pytest.approx(5e12, rel=1e-14)


def test_no_warning_leaves_a_function_at_places_that_nobody_asked_for():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        system = Switched(1, lambda z, t, sw: np.log(z) + sw.relu(z - 1.0) - t, bounds=(0.0, 9.0))
        graph = trace(system, ([0.5], -0.5), (-0.5, 1.0))
    (kink,) = graph.special_points("transition")
    assert kink.alpha == pytest.approx(0.0, abs=1e-12)


def test_jax_differentiates_what_is_written_with_it():
    jax = pytest.importorskip("jax")

    def f(z, t, sw):
        first = z[0] - jax.numpy.exp(-t * z[1])
        return jax.numpy.stack([first, z[1] + sw.relu(z[0] - 0.7) - t])

    system, same = Switched(2, f), Switched(2, traced)
    assert derivatives_of(system._lifted, []) is not None
    z, t = np.array([0.8, 0.3]), 0.4
    character = system.character(z, t)
    exact = same.jacobian(z, t, character)
    assert system.jacobian(z, t, character) == pytest.approx(exact, rel=1e-14)


class WarmStart:
    """The root of y^3 + y = z by Newton's method, which begins where the last call ended."""

    def __init__(self):
        self.y = 0.5

    def __call__(self, z, alpha, sw):
        y = self.y
        for _ in range(30):
            y = y - (y**3 + y - z[0]) / (3.0 * y**2 + 1.0)
        self.y = y
        return [y - alpha]


def test_a_function_that_keeps_numbers_for_the_next_call_is_refused():
    with pytest.raises(InvalidSystemError, match="keeps numbers of one call for the next"):
        explore(Switched(1, WarmStart()), (-1.0, 1.0))


@pytest.mark.parametrize("upper", ["x", np.nan])
def test_bounds_that_are_no_numbers_are_refused_in_words(upper):
    with pytest.raises(InvalidInputError, match=r"upper must be numbers, .* got \['?(x|nan)'?\]"):
        Complementarity(lambda z, t: z - t, lower=[0.0], upper=[upper])


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("F", [lambda z, t: z[:1] - t, lambda z, t: z.sum() - t])
def test_one_value_is_not_spread_over_all_unknowns(F, linear):
    with pytest.raises(InvalidSystemError, match="one number for each of the 3 unknowns"):
        Complementarity(F, n=3, linear=linear)
    assert Complementarity(lambda z, t: z.sum() - t, n=1, linear=linear).size == 1


@pytest.mark.slow
def test_bounds_that_cross_end_the_branch():
    def lower(t):
        return np.array([t, t])

    problem = Complementarity(lambda z, t: z**3 + t - 2.0, lower, [0.5, 0.5])
    graph = explore(problem, (0.0, 1.0))
    assert [graph.count(t) for t in (0.25, 0.75)] == [1, 0]
    assert "the model ends at alpha = 0.5 " in graph.guarantee
    meeting = Complementarity(
        lambda z, t: z**3 + t - 2.0, lambda t: 0.1 * t, lambda t: 0.3 - 0.2 * t, n=1
    )
    assert explore(meeting, (0.0, 1.0)).count(1.0) == 1


def test_the_wrong_bound_is_named():
    for lower in ([1.0, 1.0], [np.nan, 0.0, 0.0], ["a", "b", "c"]):
        with pytest.raises(
            InvalidInputError, match="lower must be numbers, one for all or one for each of 3"
        ):
            Complementarity(lambda z, t: z - t, lower, np.ones(3))
