"""Errors about a user's own system, starts without a solution, and values that are not finite."""

import numpy as np
import pytest
import scipy.sparse as sp
from error_parts import LOAD, body
from pwscont_coulomb import CoulombLoad

from pwscont import (
    Block,
    Limits,
    MultiStart,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    Slices,
    Switched,
    enumerate_solutions,
    explore,
    trace,
)
from pwscont.basics.errors import (
    GraphFileError,
    InvalidInputError,
    InvalidSystemError,
    PwscontError,
    StartNotFoundError,
)

# -- a user's own system -------------------------------------------------------------------------


class Kinked(PiecewiseSystem):
    """A correct system, z + |z| = alpha; the tests below break one method each."""

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return z + (z if character.signs[0] else -z / 2.0) - alpha


def broken(**methods):
    return type("Broken", (Kinked,), methods)()


def test_the_system_is_right_when_nothing_is_broken():
    graph = explore(broken(), (-1.0, 1.0))
    assert graph.multiplicity() == [(-1.0, 1.0, 1)]


@pytest.mark.parametrize(
    ("method", "returned"),
    [
        ("residual", lambda self, z, alpha, character: np.zeros(2)),
        ("residual", lambda self, z, alpha, character: np.zeros((1, 1))),
        ("residual", lambda self, z, alpha, character: 0.0),
        ("residual", lambda self, z, alpha, character: [0.0]),
        ("residual", lambda self, z, alpha, character: None),
        ("jacobian", lambda self, z, alpha, character: np.ones((1, 1))),
        ("jacobian", lambda self, z, alpha, character: np.ones(2)),
        ("jacobian", lambda self, z, alpha, character: sp.csr_matrix((2, 2))),
        ("test_functions", lambda self, z, alpha: np.zeros((1, 1))),
        ("test_functions", lambda self, z, alpha: 1.0),
        ("test_functions", lambda self, z, alpha: [1.0]),
        ("test_jacobian", lambda self, z, alpha: np.ones((1, 1))),
        ("test_jacobian", lambda self, z, alpha: np.ones((2, 2))),
        ("bounding_tests", lambda self, character: [1]),
        ("bounding_tests", lambda self, character: [-1]),
    ],
)
def test_wrong_shapes(method, returned):
    system = broken(**{method: returned})
    with pytest.raises(InvalidSystemError, match=rf"Broken\.{method} returned"):
        trace(system, ([1.0], 0.5), (-1.0, 1.0))
    with pytest.raises(InvalidSystemError, match=rf"Broken\.{method} returned"):
        explore(system, (-1.0, 1.0))


@pytest.mark.parametrize("size", [0, -1, 1.5, None, "one"])
def test_size(size):
    with pytest.raises(InvalidSystemError, match=r"Broken\.size must be an int"):
        trace(broken(size=size), ([1.0], 0.5), (-1.0, 1.0))


@pytest.mark.parametrize("scale", [[0.0], [-1.0], [1.0, 1.0], [np.nan]])
def test_scale(scale):
    system = broken(scale=lambda self, lo, hi: np.array(scale))
    with pytest.raises(PwscontError, match=r"Broken\.scale"):
        trace(system, ([1.0], 0.5), (-1.0, 1.0))


def test_too_many_tests_to_try_all_cells():
    class ManyTests(PiecewiseLinearSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z[0] - np.arange(17.0)

        def residual(self, z, alpha, character):
            return z - alpha

    with pytest.raises(InvalidSystemError, match=r"17 test functions.*override cells\(\)"):
        enumerate_solutions(ManyTests(), 0.5)
    graph = explore(ManyTests(), (0.0, 1.0))  # searches in another way, and promises nothing
    assert graph.count(0.5) == 1
    assert graph.guarantee == "balanced"
    assert len(trace(ManyTests(), ([0.5], 0.5), (0.25, 0.75)).pieces) == 1  # needs no cells


# -- starts without a solution -------------------------------------------------------------------


class NoSolution(PiecewiseSystem):
    """z^2 + 1 + |z| = alpha^2 has no solution for |alpha| < 1."""

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return z**2 + 1.0 + (z if character.signs[0] else -z) - alpha**2


@pytest.mark.parametrize("z", [0.0, 1.0, -3.0, 1e-9, 100.0])
def test_start_from_which_no_solution_is_found(z):
    with pytest.raises(StartNotFoundError, match="no solution found near the start"):
        trace(NoSolution(), ([z], 0.5), (-2.0, 2.0))


def test_the_same_system_where_it_has_solutions():
    """z^2 + z = 1.25 for alpha = 1.5: z = (-1 + sqrt(6)) / 2."""
    graph = trace(NoSolution(), ([1.0], 1.5), (1.2, 2.0))
    (solution,) = graph.solutions(1.5)
    assert solution.z[0] == pytest.approx((6.0**0.5 - 1.0) / 2.0, abs=1e-12)


def test_errors_are_value_errors_too():
    with pytest.raises(ValueError, match="interval"):
        explore(broken(), (1.0, 0.0))


# -- functions that are not finite ----------------------------------------------------------------


class Arch(PiecewiseSystem):
    """A curve with a fold; a test or the residual can be spoilt."""

    size = 1
    spoilt_test = staticmethod(lambda z: z - 5.0)
    spoilt_residual = staticmethod(lambda z: 0.0 * z)

    def test_functions(self, z, alpha):
        return self.spoilt_test(z)

    def residual(self, z, alpha, character):
        return z**2 + alpha - 1.0 + self.spoilt_residual(z)


def test_a_test_function_that_is_nan_is_not_taken_for_a_sign():
    arch = Arch()
    arch.spoilt_test = lambda z: np.nan * z
    with pytest.raises(InvalidSystemError, match=r"test_functions returned \[nan\]"):
        trace(arch, ([0.5], 0.75), (0.0, 2.0))


def test_a_test_function_that_becomes_nan_stops_the_branch():
    arch = Arch()
    arch.spoilt_test = lambda z: np.where(z > -0.5, z - 5.0, np.nan)
    graph = trace(arch, ([0.5], 0.75), (0.0, 2.0))
    (stopped,) = graph.special_points("stopped")
    assert "not finite" in stopped.message
    assert stopped.z[0] == pytest.approx(-0.5, abs=1e-6)
    assert graph.guarantee != "complete"


def test_a_residual_that_is_never_finite_is_refused():
    arch = Arch()
    arch.spoilt_residual = lambda z: np.nan * z
    with pytest.raises(InvalidSystemError, match="finite at none of"):
        explore(arch, (0.0, 0.5))
    with pytest.raises(StartNotFoundError, match="is not finite here"):
        trace(arch, ([0.5], 0.25), (0.0, 0.5))


@pytest.mark.parametrize(
    "run",
    [
        lambda arch: explore(arch, (0.0, 0.5)),
        lambda arch: trace(arch, ([0.866], 0.25), (0.0, 0.5)),
    ],
    ids=["explore", "trace"],
)
def test_a_wrong_jacobian_on_the_instance_is_refused(run):
    """With it steps go on and on, or a search finds nothing: it is named before the first step."""
    arch = Arch()
    arch.jacobian = lambda z, alpha, character: np.array([[7.0, 3.0]])
    with pytest.raises(InvalidSystemError, match=r"Arch\.jacobian in cell - is wrong in row 0"):
        run(arch)
    arch.jacobian = lambda z, alpha, character: np.array([[2.0 * z[0], 1.0]])
    assert run(arch).special_points()


def test_a_wrong_test_jacobian_on_the_instance_is_refused():
    arch = Arch()
    arch.test_jacobian = lambda z, alpha: np.array([[7.0, 3.0]])
    with pytest.raises(InvalidSystemError, match="test_jacobian is wrong in row 0"):
        trace(arch, ([0.866], 0.25), (0.0, 0.5))


def test_a_piece_that_goes_nowhere_ends(monkeypatch):
    """A piece of too many steps stops; the message says what to look for."""
    monkeypatch.setattr("pwscont.continuation.follow.MOST_STEPS", 2)
    (stopped, _) = trace(Arch(), ([0.866], 0.25), (0.0, 0.5)).special_points("stopped")
    assert "check_system" in stopped.message


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: explore(Arch, (0.0, 1.0)), "system must be a PiecewiseSystem.*call it to make"),
        (lambda: explore(None, (0.0, 1.0)), "system must be a PiecewiseSystem, got None"),
        (lambda: explore(Arch(), (0.0, 1.0), stepper="exact"), "stepper must be a Stepper"),
        (lambda: explore(Arch(), (0.0, 1.0), search="all"), "search must be a Search"),
        (lambda: explore(Arch(), (0.0, 1.0), journal="file"), "journal must be a Journal"),
        (lambda: trace(Arch(), ([1.0], 0.0), (0.0, 1.0), journal="file"), "journal must be"),
    ],
)
def test_arguments_of_another_kind(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: MultiStart(count=0), "count must be a positive whole number, got 0"),
        (lambda s: MultiStart(count=2.5), "count must be a positive whole number, got 2.5"),
        (lambda s: MultiStart(count=True), "count must be a positive whole number, got True"),
        (lambda s: MultiStart(seed=None), "seed must be a whole number from 0, got None"),
        (lambda s: MultiStart(seed=-1), "seed must be a whole number from 0, got -1"),
        (lambda s: MultiStart(around=1.5), "around must be states, got 1.5"),
        (lambda s: MultiStart(spread=-1.0), "spread must be positive, got -1.0"),
        (lambda s: MultiStart(spread=np.nan), "spread must be finite"),
        (lambda s: explore(s, (-2.0, 2.0), search=Slices((7.0,))), "7.0 lies outside the interval"),
        (lambda s: enumerate_solutions(s, np.nan), "alpha must be finite, but alpha is nan"),
        (lambda s: enumerate_solutions(s, "one"), "alpha must be a number, got 'one'"),
        (lambda s: enumerate_solutions(s, (0, 1)), r"alpha has shape \(2,\), expected a number"),
    ],
)
def test_searches(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call(CoulombLoad(body(), LOAD, 4.0))


def test_a_graph_that_cannot_be_written(tmp_path):
    graph = explore(CoulombLoad(body(), LOAD, 4.0), (-2.0, 2.0))
    with pytest.raises(GraphFileError, match=r"cannot write .*graph\.npz: No such file"):
        graph.save(tmp_path / "missing" / "graph.npz")
    for path in ("", None, 3):
        with pytest.raises(GraphFileError, match="cannot write"):
            graph.save(path)


class Promising(PiecewiseLinearSystem):
    """z + max(z - 1/2, 0) = alpha, with what it says of its modes replaced."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.5

    def residual(self, z, alpha, character):
        return z - alpha + (z - 0.5 if character.signs[0] else 0.0)

    def blocks(self):
        return (Block((0,), (0,), ((True,), (False,))),)


@pytest.mark.parametrize(
    ("method", "given", "words"),
    [
        ("blocks", None, r"blocks\(\) must return Blocks, got None"),
        ("blocks", [((0,), (0,))], r"blocks\(\) must return Blocks"),
        ("necessary", None, r"necessary\(\) must return \(A, b\), got None"),
        ("necessary", (np.ones((1, 2)), np.ones(1)), r"A of shape \(l, 1\) and b of shape \(l,\)"),
    ],
)
@pytest.mark.parametrize(
    "ask",
    [lambda system: explore(system, (0.0, 1.0)), lambda system: enumerate_solutions(system, 0.3)],
    ids=["explore", "enumerate_solutions"],
)
def test_what_a_system_says_of_its_modes(method, given, words, ask):
    assert ask(Promising())
    wrong = type("Wrong", (Promising,), {method: lambda self, *_: given})
    with pytest.raises(InvalidSystemError, match=words):
        ask(wrong())


def test_seconds_that_no_number_holds():
    with pytest.raises(InvalidInputError, match="seconds must be a positive number"):
        Limits(seconds=10**400)


@pytest.mark.parametrize(
    ("changes", "arguments", "error", "message"),
    [
        ({}, {"report": 3}, InvalidInputError, "report must be a function"),
        ({}, {"parameter": ""}, InvalidInputError, "parameter must be a text"),
        ({"size": 10**9}, {}, InvalidSystemError, "do not fit into the memory"),
        (
            {"residual": lambda self, z, alpha, character: z - np.random.default_rng().random()},
            {},
            InvalidSystemError,
            "not on chance",
        ),
    ],
)
@pytest.mark.parametrize("run", [explore, lambda s, i, **g: trace(s, ([0.0], 0.0), i, **g)])
def test_slips_that_were_raw_errors_are_named(changes, arguments, error, message, run):
    class Line(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z - 0.5

        def residual(self, z, alpha, character):
            return z - alpha

    with pytest.raises(error, match=message):
        run(type("Other", (Line,), changes)(), (-1.0, 1.0), **arguments)


@pytest.mark.slow
def test_a_residual_that_depends_on_earlier_points_is_named():
    class Latch(PiecewiseSystem):
        size, up = 1, False

        def test_functions(self, z, alpha):
            return z - 1.0

        def residual(self, z, alpha, character):
            self.up = z[0] > 1.2 or (self.up and z[0] >= 0.2)
            stop = 5.0 * (z - 1.0) if character.signs[0] else 0.0
            return z * (z - 1.0) * (z - 2.0) + stop - alpha + 0.05 * self.up

    with pytest.raises(InvalidSystemError, match="not on chance or on earlier points"):
        explore(Latch(), (-0.5, 1.0))


def test_a_jacobian_that_is_no_number_is_named():
    class NoNumber(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z - 1.0

        def residual(self, z, alpha, character):
            return z**3 - z - alpha

        def jacobian(self, z, alpha, character):
            return np.array([[np.nan, -1.0]])

    with pytest.raises(InvalidSystemError, match=r"NoNumber\.jacobian in .* is wrong in row 0"):
        explore(NoNumber(), (-0.5, 1.0))


@pytest.mark.parametrize(
    ("residual", "period"), [(np.sin, np.pi), (lambda z: z - np.sin(z), 2.0 * np.pi)]
)
def test_a_period_over_which_h_changes_is_refused(residual, period):
    system = Switched(1, lambda z, t, sw: residual(z) - t, periods=[period])
    with pytest.raises(InvalidSystemError, match=r"periods\(\) gives .* for unknown 0"):
        explore(system, (-0.2, 0.5))
