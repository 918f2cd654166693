"""Counts of linear pieces: data far apart, and systems without switches."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp

from pwscont import (
    LCP,
    AbsNormal,
    BranchGraph,
    Complementarity,
    InvalidInputError,
    InvalidSystemError,
    PiecewiseLinearSystem,
    Switched,
    enumerate_solutions,
    explore,
    prove,
)
from pwscont.extending import ExactData, ExactMode
from pwscont.graph.records import Place
from pwscont.proof.cells import ExactCells
from pwscont.proof.prove import proved_solutions
from pwscont.search.enumeration import Solutions


@pytest.mark.parametrize("stiffness", [1.0, 2.0**60, 1e17, 1e200])
def test_units_of_a_complementarity_problem_do_not_hide_an_inequality(stiffness):
    """z - w rounds to -w: a cell with w = 0 and z < 0 has no solution all the same."""
    spring = Complementarity(lambda z, t: stiffness * z + 1.0 + 0.0 * t, n=1, linear=True)
    boxes, points, _ = proved_solutions(ExactCells(*spring.exact_rows(0.0)), 0.0)
    assert len(boxes) + len(points) == 1


STIFF = 1e156 * np.array([[1.0, 2.0], [2.0, 1.0]])


@pytest.mark.parametrize(
    ("game", "alpha"),
    [
        (LCP(STIFF, q=[-1e-170, -1e-170], d=[0, 0]), 0.0),
        (Complementarity(lambda z, t: STIFF @ z - 1e-170 + 0.0 * t, n=2, linear=True), 0.0),
        (Complementarity(lambda z, t: STIFF @ z - 1e-170 * t, n=2, linear=True), 1.0),
    ],
)
def test_numbers_that_units_would_make_too_small_are_kept(game, alpha):
    """Divided by 1e156, a constant of 1e-170 would be zero, and three solutions would be one."""
    boxes, points, _ = proved_solutions(ExactCells(*game.exact_rows(alpha)), alpha)
    assert len(boxes) + len(points) == 3


def test_numbers_that_units_would_make_infinite_are_kept():
    soft = LCP([[1e-200]], q=[-1e200], d=[0])
    assert soft.exact_rows(0.0)[1][0][1].equations.tolist() == [[1e-200, 0.0, -1e200]]


def test_a_solution_beyond_the_largest_double_is_counted_and_is_not_the_one_that_is_given():
    """z = 1e400, which rational numbers hold."""
    far = LCP([[1e-200]], q=[-1e200], d=[0])
    place = replace(
        enumerate_solutions(LCP([[1.0]], q=[-1.0], d=[0]), 0.0)[0], z=np.array([np.inf])
    )
    proof = prove(Solutions([place], "complete", far, 0.0))
    assert (proof.count, proof.holds) == (1, False)


@pytest.mark.parametrize("error", [np.inf, 1e3, -1.0])
def test_solutions_that_state_large_errors_are_the_right_ones_all_the_same(error):
    game = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[0, 0])
    for by in (0.0, 1e-3):
        found = [
            replace(each, z=each.z + by, error=np.full(3, error))
            for each in enumerate_solutions(game, 0.0)
        ]
        assert prove(Solutions(found, "complete", game, 0.0)).holds == (by == 0.0)


@pytest.mark.parametrize("error", [np.inf, 1e3])
def test_a_graph_that_moved_within_large_errors_is_not_proved(error):
    graph = explore(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), (-1.0, 2.0))
    for by in (np.zeros(3), np.array([1e-3, 1e-3, 0.0])):
        places = [Place(node.place.x + by, np.full(3, error)) for node in graph.nodes]
        nodes = [replace(n, place=place) for n, place in zip(graph.nodes, places, strict=True)]
        pieces = [replace(piece, points=piece.points + by) for piece in graph.pieces]
        moved = BranchGraph(nodes, pieces, graph.interval, system=graph.system)
        assert prove(moved).holds == (not by.any())


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 2e-20), (1e-58, 1e-22), (-1e-20, 1e-20)])
def test_bounds_closer_than_rounding_of_one_are_two_bounds(lower, upper):
    """z = lower, z = upper and the middle solve the problem of F = middle - z."""
    middle = 0.5 * (lower + upper)
    problem = Complementarity(
        lambda z, t: middle - z + 0.0 * t, lower=lower, upper=upper, n=1, linear=True
    )
    found = enumerate_solutions(problem, 0.0)
    assert len(found) == prove(found).count == 3


def test_kinks_closer_than_rounding_of_one_are_two_kinks():
    """The ramp from 0 to 1e-20 takes half of its height at z = 5e-21."""
    ramp = Switched(1, lambda z, t, sw: sw.relu(z) - sw.relu(z - 1e-20) - 5e-21, linear=True)
    found = enumerate_solutions(ramp, 0.0)
    assert prove(found).holds
    assert [s.z[0] for s in found] == pytest.approx([5e-21], rel=1e-9)


def test_coefficients_that_are_differences_of_values_are_no_exact_data():
    """1e20 + 1 rounds to 1e20: by differences, z + 1e20 = 0 would have no solution."""
    plain = Switched(1, lambda z, t, sw: np.array([float(z[0])]) + 1e20, linear=True)
    with pytest.raises(InvalidInputError, match="differences of values"):
        prove(enumerate_solutions(plain, 0.0))


def test_products_of_coefficients_that_are_too_small_are_no_exact_data():
    """|1e-200 x| 1e-200 = 1e-150 has the solutions 1e250 and -1e250."""
    tiny = AbsNormal(Z=[[1e-200]], L=[[0]], J=[[0]], Y=[[1e-200]], c=[0], b=([0], [-1]))
    with pytest.raises(InvalidInputError, match="too small for a double"):
        prove(enumerate_solutions(tiny, 1e-150))


SINGULAR = {
    "no unknown": (1, lambda z, t, sw: 0.0 * z - 1.5 - t, 0),
    "against each other": (2, lambda z, t, sw: np.array([z[0] + z[1] + 2 - t, z[0] + z[1] - 1]), 0),
    "a line": (2, lambda z, t, sw: np.array([z[0] + z[1] - t, 2 * z[0] + 2 * z[1] - 2 * t]), None),
}


@pytest.mark.parametrize("name", SINGULAR)
def test_equations_without_switches_that_are_singular_have_no_proved_solution(name):
    n, f, count = SINGULAR[name]
    system = Switched(n, f, linear=True)
    assert prove(enumerate_solutions(system, 0.0)).count == count
    graph = explore(system, (-1.0, 1.0))
    assert graph.count(0.0) == (math.inf if count is None else count)
    assert prove(graph).is_complete == (count is not None)


class Given(PiecewiseLinearSystem, ExactData):
    """abs(z) = alpha, with rows that the test makes of the right ones."""

    size = 1

    def __init__(self, made=np.array, common=()):
        self.made, self.common = made, np.reshape(common, (-1, 3))

    def test_functions(self, z, alpha):
        return z

    def residual(self, z, alpha, character):
        return (z if character.signs[0] else -z) - alpha

    def exact_rows(self, alpha):
        rows = [([[s, -1.0, 0.0]], [[s, 0.0, 0.0]]) for s in (1.0, -1.0)]
        modes = [ExactMode(*map(self.made, pair)) for pair in rows]
        return self.common, iter([iter(modes)])

    def exact_lines(self):
        return self.exact_rows(0.0)


SAME = {
    "single": lambda rows: np.array(rows, dtype=np.float32),
    "whole": lambda rows: np.array(rows, dtype=int),
    "objects": lambda rows: np.array(rows, dtype=object),
    "other order": lambda rows: np.asfortranarray(rows)[:, ::-1][:, ::-1],
}


@pytest.mark.parametrize("name", SAME)
def test_the_same_numbers_of_another_type_are_proved(name):
    system = Given(SAME[name])
    assert prove(enumerate_solutions(system, 0.5)).holds
    assert prove(explore(system, (-1.0, 1.0))).is_complete


THIRD = Fraction(1, 3)
WRONG = {
    "not a number": (lambda rows: np.array(rows) * np.nan, "finite"),
    "infinite": (lambda rows: np.array(rows) + np.inf, "finite"),
    "complex": (lambda rows: np.array(rows, dtype=complex), "complex"),
    "fractions": (lambda rows: np.array([[Fraction(x) * THIRD for x in rows[0]]]), "no doubles"),
    "large": (lambda rows: np.array(rows, dtype=int) * (2**60 + 1), "no doubles"),
    "sparse": (lambda rows: sp.csr_array(np.array(rows)), "exact rows fail"),
    "too wide": (lambda rows: np.append(rows, [[0.0]], axis=1), "exact rows fail"),
    "empty": (lambda rows: rows[0][0], "exact rows fail"),
}


@pytest.mark.parametrize("name", WRONG)
def test_rows_that_make_no_sense_are_refused_in_words(name):
    made, words = WRONG[name]
    for given in (enumerate_solutions(Given(made), 0.5), explore(Given(made), (-1.0, 1.0))):
        with pytest.raises((InvalidInputError, InvalidSystemError), match=words):
            prove(given)


def test_rows_of_another_number_of_unknowns_are_refused():
    wide = Given(lambda rows: np.append(rows, [[0.0]], axis=1))
    wide.common = np.zeros((0, 4))
    with pytest.raises(InvalidSystemError, match="1 unknowns, but exact rows have 2"):
        prove(enumerate_solutions(wide, 0.5))


def test_a_mode_that_contradicts_what_determines_all_unknowns_has_no_solution():
    """z = 5 for every mode: abs(z) = 0.5 has no solution then."""
    found = enumerate_solutions(Given(common=[1.0, 0.0, -5.0]), 0.5)
    assert prove(found).count == 0
    assert not prove(explore(Given(common=[1.0, 0.0, -5.0]), (-1.0, 1.0))).holds


NOTHING = np.zeros((0, 3))
TOO_MANY = {
    "z = 1/2 and z = 0": ([[2.0, 2.0, -1.0]], [[[1.0, 0.0, 0.0]]], {}),
    "z = alpha and z = 4 - alpha": ([[1.0, -1.0, 0.0], [1.0, 1.0, -4.0]], [], {2.0: 2.0}),
    "z = alpha, twice": ([[1.0, -1.0, 0.0]], [[[2.0, -2.0, 0.0]]], {0.0: 0.0, 2.0: 2.0}),
}


@pytest.mark.parametrize("name", TOO_MANY)
def test_more_equations_than_unknowns_are_solved_together(name):
    common, equations, truth = TOO_MANY[name]
    modes = [ExactMode(np.array(each), NOTHING) for each in equations]
    cells = ExactCells(np.array(common), [modes] if modes else [])
    for alpha in (0.0, 2.0):
        boxes, points, undecided = proved_solutions(cells, alpha)
        assert (boxes, undecided) == ({}, [])
        assert points == ({(truth[alpha],)} if alpha in truth else set())


@pytest.mark.parametrize(
    ("f", "words"),
    [
        # where bounds have crossed, 2 z - 1 is below one bound and above the other one at z = 2
        (lambda z, t, sw: sw.clip(2 * z - 1, 2 * z + 1, 1 - 1.5 * z) + z + 0 * t, "may cross"),
        # at z = 0 the branch z - t counts, so that z = 0 is no solution at t = 1
        (lambda z, t, sw: sw.where(z, z - t - 1, z - t + 1), "jumps"),
        (lambda z, t, sw: sw.where(z, z - t, 5 * z), "jumps"),
    ],
)
def test_formulas_that_are_no_functions_everywhere_or_jump_have_no_proved_count(f, words):
    found = enumerate_solutions(Switched(1, f, linear=True), 1.0)
    with pytest.raises((InvalidInputError, InvalidSystemError), match=words):
        prove(found)


def test_branches_that_agree_where_the_test_is_zero_do_not_jump():
    kinked = Switched(1, lambda z, t, sw: sw.where(z - 0.5, 2 * z - 0.5, z) - t, linear=True)
    assert prove(enumerate_solutions(kinked, 1.0)).count == 1


def test_nothing_is_counted_at_an_alpha_where_bounds_have_crossed():
    clipped = Switched(1, lambda z, t, sw: sw.clip(2 * z, t, 1 - t) - z - 0.1, linear=True)
    assert prove(enumerate_solutions(clipped, 0.5)).holds
    with pytest.raises(InvalidInputError, match="domain"):
        prove(enumerate_solutions(clipped, 0.6))


def test_coefficients_that_cancel_are_named_as_what_counts():
    """z = t, but 1e8 + 1e-9 rounds to 1e8, so that no coefficient of z is left."""
    rounded = Switched(1, lambda z, t, sw: 1e8 * z + 1e-9 * z - 1e8 * z - 1e-9 * t, linear=True)
    proof = prove(enumerate_solutions(rounded, 0.5))
    assert "coefficients of the formula, as floating point adds them up" in proof.statements[1]
