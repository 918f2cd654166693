"""Broken promises of a user's system are refused in words, and kept ones never."""

import numpy as np
import pytest
import scipy.sparse as sp
from paper_systems import CASES

from pwscont import (
    Block,
    InvalidSystemError,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    enumerate_solutions,
    explore,
    trace,
)


def one(residual, test=lambda z, alpha: z - 1.0, base=PiecewiseSystem):
    """Return a system with one unknown; residual is a function of (z, alpha, sign)."""

    class System(base):
        size = 1

        def test_functions(self, z, alpha):
            return np.atleast_1d(test(z[0], alpha))

        def residual(self, z, alpha, character):
            return np.atleast_1d(residual(z[0], alpha, character.signs[0]))

    return System()


# -- affine --------------------------------------------------------------------------------------

CURVED = {
    "z^3": lambda z, a, on: z**3 - z - a,
    "z^3 on one side only": lambda z, a, on: z - a + (0.1 * (z - 1.0) ** 3 if on else 0.0),
    "alpha^2": lambda z, a, on: z - a**2,
    "z alpha": lambda z, a, on: z - 1.0 + 0.5 * z * a,
    "1e-6 z^2": lambda z, a, on: z - a + 1e-6 * z**2,
}


@pytest.mark.parametrize("name", CURVED)
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_curved_residual_declared_linear(name, unit):
    """Also in other units, where scale() tells them."""
    system = one(
        lambda z, a, on: CURVED[name](z / unit, a, on),
        lambda z, a: z / unit - 1.0,
        PiecewiseLinearSystem,
    )
    type(system).scale = lambda self, lo, hi: np.array([unit])
    with pytest.raises(InvalidSystemError, match=r"is a PiecewiseLinearSystem, but residual in"):
        explore(system, (0.5, 2.0))


@pytest.mark.parametrize("name", ["z^3", "z^3 on one side only"])
def test_a_curved_residual_declared_slicewise_linear(name):
    system = one(CURVED[name], base=SlicewiseLinearSystem)
    words = "is a SlicewiseLinearSystem, but residual in .* not affine in z at fixed alpha"
    with pytest.raises(InvalidSystemError, match=words):
        explore(system, (0.5, 2.0))
    with pytest.raises(InvalidSystemError, match=words):
        enumerate_solutions(system, 0.5)


def test_slicewise_linear_systems_may_be_curved_in_alpha():
    graph = explore(one(CURVED["alpha^2"], base=SlicewiseLinearSystem), (0.5, 2.0))
    assert graph.multiplicity() == [(0.5, 2.0, 1)]


def test_a_curved_residual_that_only_tracing_meets():
    """The start lies in a straight cell, and the run enters the curved one."""
    system = one(CURVED["z^3 on one side only"], base=PiecewiseLinearSystem)
    with pytest.raises(InvalidSystemError, match="residual in cell"):
        trace(system, ([0.5], 0.5), (0.5, 2.0))


def test_curved_tests_declared_linear():
    system = one(lambda z, a, on: z - a, lambda z, a: z**2 - 1.0, PiecewiseLinearSystem)
    with pytest.raises(InvalidSystemError, match="test_functions is not affine"):
        explore(system, (0.5, 2.0))


def test_a_wrong_jacobian_of_a_linear_system():
    system = one(lambda z, a, on: z - a, base=PiecewiseLinearSystem)
    system.jacobian = lambda z, alpha, character: np.array([[1.0, -1.1]])
    with pytest.raises(InvalidSystemError, match="or its Jacobian is wrong"):
        explore(system, (0.5, 2.0))


class Cancelling(PiecewiseLinearSystem):
    """3 z - alpha + 2 = 3 |3 z - 3 alpha + 1| + 3 |2 z - alpha + 2|.

    At alpha = -1, H is 0 in one cell, as the rounded sum of terms that are not.
    """

    size = 1

    def test_functions(self, z, alpha):
        return np.array([3.0 * (alpha - z[0]) - 1.0, 2.0 * z[0] - alpha + 2.0])

    def residual(self, z, alpha, character):
        signs = np.where(character.array, 1.0, -1.0)
        return 3.0 * z - alpha + 2.0 - 3.0 * (signs @ self.test_functions(z, alpha))


def test_terms_that_cancel_in_one_cell_are_not_curved():
    """With 3 z + 3 = 3 |3 z + 4| + 3 |2 z + 3|: no solution, for one kink is 1 where it is 0."""
    solutions = enumerate_solutions(Cancelling(), -1.0)
    assert len(solutions) == 0
    assert "complete" in solutions.guarantee


# -- continuity ----------------------------------------------------------------------------------

JUMPS = [1e-3, 1e-5, 1e-9, -1e-12]


def test_a_jump_at_zero_is_refused_before_the_search():
    system = one(lambda z, a, on: z + z**3 + (1.0 if on else -1.0) - a, lambda z, a: z)
    with pytest.raises(InvalidSystemError, match=r"residual jumps by 2 in row 0 .* z = \[0\.\]"):
        explore(system, (-0.5, 0.5))


def test_constants_that_cancel_are_no_jump_at_zero():
    def residual(z, a, on):
        return z + z**3 - a + ((0.1 + 1e8) - 1e8 if on else 0.1)  # apart by 1.5e-9

    graph = explore(one(residual, lambda z, a: z), (-1.0, 0.0), starts=[([-0.6], -0.716)])
    assert graph.count(-0.5) == 1


@pytest.mark.parametrize("jump", JUMPS)
@pytest.mark.parametrize("base", [PiecewiseSystem, SlicewiseLinearSystem, PiecewiseLinearSystem])
@pytest.mark.parametrize("force", [1e-6, 1.0, 1e6])
@pytest.mark.sweep(5)
def test_a_jump_is_refused_down_to_rounding(jump, base, force):
    system = one(
        lambda z, a, on: force * (z - a + (jump if on else 0.0)), lambda z, a: z - 0.3, base
    )
    with pytest.raises(InvalidSystemError, match=r"residual jumps by .* in row 0 where cell"):
        explore(system, (-1.0, 1.0))
    with pytest.raises(InvalidSystemError, match=r"residual jumps by .* in row 0 where cell"):
        trace(system, ([-1.0], -1.0), (-1.0, 1.0))


@pytest.mark.parametrize("stiff", [1.0, 1e6, 1e9])
@pytest.mark.sweep(3)
def test_a_kink_of_any_stiffness_is_no_jump(stiff):
    system = one(lambda z, a, on: z - a + (stiff * (z - 0.3) if on else 0.0), lambda z, a: z - 0.3)
    graph = explore(system, (-1.0, 1.0))
    kinks = [*graph.special_points("transition"), *graph.special_points("corner")]
    assert [point.alpha for point in kinks] == [pytest.approx(0.3)]


def cancelling(z, a, on):
    return 1e8 * (z - 0.3) * 3.0 - 3e8 * z + 0.9e8 + z - a + (0.7 * (z - 0.3) if on else 0.0)


@pytest.mark.slow
def test_terms_that_cancel_at_the_interface_are_rounding_and_no_jump():
    graph = explore(one(cancelling, lambda z, a: z - 0.3), (-1.0, 1.0))
    assert len(graph.special_points("transition")) == 1


def test_terms_that_cancel_are_no_jump_close_to_the_interface():
    graph = explore(one(cancelling, lambda z, a: z - 0.3), (0.25, 0.35))
    assert len(graph.special_points("transition")) == 1


def test_a_jump_where_two_tests_vanish():
    class Corner(PiecewiseLinearSystem):
        size = 2

        def test_functions(self, z, alpha):
            return z - 0.3

        def residual(self, z, alpha, character):
            signs = np.array(character.signs, dtype=float)
            return z - alpha + 0.5 * signs * (z - 0.3) + 1e-6 * signs[0] * signs[1]

    with pytest.raises(InvalidSystemError, match="jumps"):
        explore(Corner(), (-1.0, 1.0))


@pytest.mark.parametrize("name", ["fig7", "example1", "example3"])
def test_no_false_alarm_on_the_paper(name):
    case = CASES[name]
    assert explore(case.system, case.interval).pieces


# -- finite --------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_residual_that_is_nowhere_finite(value):
    with pytest.raises(InvalidSystemError, match=r"finite at none of 24 points"):
        explore(one(lambda z, a, on: value), (-1.0, 1.0))


def test_a_residual_that_is_undefined_for_some_z_is_no_error():
    def residual(z, a, on):
        with np.errstate(invalid="ignore"):
            return np.sqrt(z) - 1.0 - a

    graph = explore(one(residual), (-0.5, 1.0))
    assert graph.count(0.5) == 1
    assert graph.solutions(0.5)[0].z[0] == pytest.approx(2.25)


# -- arrays --------------------------------------------------------------------------------------


def test_one_buffer_returned_again_and_again():
    class Buffers(PiecewiseSystem):
        size = 1
        residuals, tests = np.zeros(1), np.zeros(1)

        def test_functions(self, z, alpha):
            self.tests[:] = z - 0.2
            return self.tests

        def residual(self, z, alpha, character):
            self.residuals[:] = z**3 + z - alpha + (z - 0.2 if character.signs[0] else 0.0)
            return self.residuals

    graph = explore(Buffers(), (-1.0, 1.0))
    assert graph.multiplicity() == [(-1.0, 1.0, 1)]
    assert [p.alpha for p in graph.special_points("transition")] == [pytest.approx(0.208)]


def test_a_linear_system_that_returns_one_buffer():
    class Buffers(PiecewiseLinearSystem):
        size = 1
        residuals, tests = np.zeros(1), np.zeros(1)

        def test_functions(self, z, alpha):
            self.tests[:] = z - 0.2
            return self.tests

        def residual(self, z, alpha, character):
            self.residuals[:] = z - alpha + (z - 0.2 if character.signs[0] else 0.0)
            return self.residuals

    graph = explore(Buffers(), (-1.0, 1.0))
    assert graph.guarantee == "complete"
    assert [p.alpha for p in graph.special_points("transition")] == [pytest.approx(0.2)]


@pytest.mark.parametrize("late", [np.zeros((1, 1)), np.zeros(2), 0.0, None])
def test_a_residual_that_changes_its_shape_later(late):
    def residual(self, z, alpha, character):
        return z - alpha if z[0] < 0.5 else late

    methods = {"size": 1, "residual": residual, "test_functions": lambda self, z, alpha: z - 9.0}
    system = type("Late", (PiecewiseSystem,), methods)()
    with pytest.raises(InvalidSystemError, match=r"Late\.residual returned"):
        trace(system, ([0.0], 0.0), (0.0, 1.0))


def test_a_jacobian_that_changes_its_shape_later():
    def jacobian(self, z, alpha, character):
        return np.array([[1.0, -1.0]]) if z[0] < 0.5 else np.array([[1.0]])

    methods = {
        "size": 1,
        "residual": lambda self, z, alpha, character: z - alpha,
        "jacobian": jacobian,
        "test_functions": lambda self, z, alpha: z - 9.0,
    }
    with pytest.raises(InvalidSystemError, match=r"Late\.jacobian returned"):
        trace(type("Late", (PiecewiseSystem,), methods)(), ([0.0], 0.0), (0.0, 1.0))


def test_a_residual_that_writes_to_its_argument():
    def residual(self, z, alpha, character):
        z -= alpha
        return z.copy()

    methods = {"size": 1, "residual": residual, "test_functions": lambda self, z, alpha: z - 9.0}
    with pytest.raises(InvalidSystemError, match="writes to its argument z"):
        explore(type("Writes", (PiecewiseSystem,), methods)(), (0.5, 1.0))


# -- blocks --------------------------------------------------------------------------------------


def blocked(*blocks):
    class System(PiecewiseLinearSystem):
        size = 2

        def test_functions(self, z, alpha):
            return z - 0.3

        def residual(self, z, alpha, character):
            return z - alpha + 0.5 * np.array(character.signs) * (z - 0.3)

        def blocks(self):
            return blocks

    return System()


MODES = ((True,), (False,))


def test_blocks_that_fit():
    system = blocked(Block((0,), (0,), MODES), Block((1,), (1,), MODES))
    assert explore(system, (-1.0, 1.0)).guarantee == "complete"


@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        (
            (Block((0,), (0, 1), MODES), Block((1,), (1,), MODES)),
            "row 1 is claimed 2 times.*join these blocks, or make each switch an unknown",
        ),
        ((Block((0,), (0,), MODES), Block((0,), (1,), MODES)), "test function 0 is claimed 2"),
        ((Block((0,), (0,), MODES), Block((1,), (2,), MODES)), "there is no row 2, only 0 to 1"),
        ((Block((0,), (0,), MODES), Block((2,), (1,), MODES)), "no test function 2, only 0 to 1"),
        ((Block((0, 1), (0, 1), MODES),), "every mode of block 0 needs 2 signs"),
        ((Block((0,), (0,), ()), Block((1,), (1,), MODES)), "every mode of block 0 needs 1"),
    ],
)
def test_blocks_that_do_not_fit(blocks, words):
    with pytest.raises(InvalidSystemError, match=words):
        explore(blocked(*blocks), (-1.0, 1.0))


# -- numbers that are none -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("residual", "match"),
    [
        (lambda z, a, on: np.array([None]), "numbers of type object"),
        (lambda z, a, on: (z - a) + 1j * z, "numbers of type complex128"),
    ],
)
def test_numbers_that_are_not_real_are_refused(residual, match):
    with pytest.raises(InvalidSystemError, match=match):
        explore(one(residual, lambda z, a: z - 0.3), (-1.0, 1.0))


def test_tests_whose_number_changes_are_refused():
    system = one(lambda z, a, on: z - a, lambda z, a: np.append(z - 5.0, z[z > 0.5]))
    with pytest.raises(InvalidSystemError, match="their number must not change"):
        explore(system, (-1.0, 1.0))


@pytest.mark.slow
def test_a_double_curve_is_followed_or_named():
    graph = trace(one(lambda z, a, on: (z - a) ** 2, lambda z, a: z - 5.0), ([0.5], 0.5), (-1, 1))
    right = [graph.count(alpha) for alpha in (-0.5, 0.2, 0.7)] == [1, 1, 1]
    assert right or "a piece was stopped" in graph.guarantee


class TwoTests(PiecewiseLinearSystem):
    """A kink at z_0 = 0.3, and a test that never vanishes; what one method says is changed."""

    size = 2

    def __init__(self, method="", changed=None):
        self.method, self.changed = method, changed

    def said(self, method, value, *of):
        return self.changed(value, *of) if method == self.method else value

    def test_functions(self, z, alpha):
        return self.said("test_functions", z - np.array([0.3, 50.0]))

    def test_jacobian(self, z, alpha):
        return self.said("test_jacobian", np.eye(2, 3))

    def residual(self, z, alpha, character):
        kink = 0.5 if character.signs[0] else -0.5
        return z - alpha + np.array([kink * (z[0] - 0.3), 0.0])

    def jacobian(self, z, alpha, character):
        kink = 0.5 if character.signs[0] else -0.5
        value = np.array([[1.0 + kink, 0.0, -1.0], [0.0, 1.0, -1.0]])
        return self.said("jacobian", value, character.signs[0])

    def bounding_tests(self, character):
        return self.said("bounding_tests", [0, 1])


def nan_in_row_1(value):
    value[1] = np.nan
    return value


WAYS = {
    "trace": lambda system: trace(system, ([-1.0, -1.0], -1.0), (-1.0, 1.0)),
    "explore": lambda system: explore(system, (-1.0, 1.0)),
    "enumerate": lambda system: enumerate_solutions(system, 0.2),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("method", "changed", "words"),
    [
        ("test_jacobian", nan_in_row_1, "test_jacobian returned numbers that are not finite"),
        ("jacobian", lambda J, on: nan_in_row_1(J) if on else J, "jacobian in cell .* not finite"),
        ("jacobian", lambda J, on: J if on else nan_in_row_1(J), "jacobian in cell .* not finite"),
    ],
)
def test_derivatives_that_are_not_finite(way, method, changed, words):
    """One row is enough: comparisons with what is no number hide all others."""
    assert WAYS[way](TwoTests())
    with pytest.raises(InvalidSystemError, match=words):
        WAYS[way](TwoTests(method, changed))


@pytest.mark.parametrize("unit", [1e-300, 1e-160, 1e160, 1e300])
def test_tests_in_units_in_which_squares_are_no_numbers(unit):
    class Units(TwoTests):
        def test_functions(self, z, alpha):
            return unit * super().test_functions(z, alpha)

        def test_jacobian(self, z, alpha):
            return unit * super().test_jacobian(z, alpha)

    for way in WAYS.values():
        with pytest.raises(InvalidSystemError, match="test function 0 of Units typically changes"):
            way(Units())


@pytest.mark.parametrize("given", [None, {0, 1}, iter([0, 1]), 0, np.array([[0, 1]])])
def test_bounding_tests_that_are_no_sequence(given):
    with pytest.raises(InvalidSystemError, match="must return a sequence of the numbers of tests"):
        explore(TwoTests("bounding_tests", lambda _: given), (-1.0, 1.0))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda rows: rows.view(np.matrix), r"numpy\.matrix of float64"),
        (np.ma.array, "MaskedArray of float64"),
        (lambda rows: rows.astype(object), "ndarray of object"),
        (lambda rows: rows.astype(bool), "ndarray of bool"),
        (lambda rows: rows + 0.0j, "ndarray of complex128"),
    ],
)
def test_gradients_that_are_no_array_of_numbers_are_refused(change, what):
    with pytest.raises(InvalidSystemError, match=rf"test_jacobian returned .*{what}: return an"):
        explore(TwoTests("test_jacobian", change), (-1.0, 1.0))


class OneRow(PiecewiseLinearSystem):
    """2 z + max(z, 0) = alpha, whose Jacobian scipy multiplies to scalars."""

    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return (2.0 + character.array) * z - alpha

    def jacobian(self, z, alpha, character):
        return sp.coo_array([[2.0 + character.array[0], -1.0]])


def test_a_jacobian_of_one_row_in_coordinates():
    graph = trace(OneRow(), ([-0.5], -1.0), (-1.0, 3.0))
    assert [point.alpha for point in graph.special_points()] == [-1.0, 0.0, 3.0]
    assert graph.special_points()[-1].z == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("kind", [PiecewiseSystem, PiecewiseLinearSystem])
def test_a_residual_that_writes_to_its_argument_only_away_from_zero_is_refused(kind):
    """At the state zero, where a run begins, writing zeros changes nothing."""

    class Writes(kind):
        size = 1

        def test_functions(self, z, alpha):
            return z - 1.0

        def residual(self, z, alpha, character):
            value = z - alpha
            z[:] = 0.0
            return value

    with pytest.raises(InvalidSystemError, match="residual writes to its argument z"):
        explore(Writes(), (-0.5, 1.0))
