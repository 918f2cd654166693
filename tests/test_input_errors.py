"""Every bad input is refused before any work, by an error that names what is wrong."""

import numpy as np
import pytest
import scipy.sparse as sp
from error_parts import LOAD, A, N, T, body
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad, HarmonicLoad

from pwscont import (
    ExactLinear,
    enumerate_solutions,
    explore,
    trace,
)
from pwscont.basics.errors import (
    InvalidInputError,
    PwscontError,
)

NOT_FINITE = pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])


def with_entry(matrix, value):
    changed = matrix.copy()
    changed[0, 0] = value
    return changed


# -- the body ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix], ids=["dense", "sparse"])
@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        ([[2.0, -1.0], [-0.9, 2.0]], "A is not symmetric"),
        ([[2.0, -3.0], [-3.0, 2.0]], "A is not positive definite"),
        ([[-2.0, 0.0], [0.0, -2.0]], "A is not positive definite"),
        ([[2.0, 0.1], [0.1, 0.0]], "A is not positive definite"),
        ([[2.0, -1.0, 0.0], [-1.0, 2.0, 0.0]], "A must be square"),
    ],
)
def test_stiffness(kind, matrix, words):
    with pytest.raises(InvalidInputError, match=words):
        ContactBody(kind(np.array(matrix)), N, T)


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_matrix], ids=["dense", "sparse"])
@NOT_FINITE
@pytest.mark.parametrize("which", ["A", "N", "T"])
def test_matrices_must_be_finite(kind, bad, which):
    matrices = {"A": A, "N": N, "T": T}
    matrices[which] = with_entry(matrices[which], bad)
    with pytest.raises(InvalidInputError, match=rf"{which}\S* must be finite"):
        ContactBody(*(kind(matrix) for matrix in matrices.values()))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((A, N[:, :1], T), "N has shape"),
        ((A, N, np.vstack([T, T])), "T has shape"),
        ((A, N, T[:, :1]), "T has shape"),
        ((A, [1.0, 0.0], T), "N must be a matrix"),
        ((2.0, N, T), "A must be a matrix"),
        ((A, 0.0 * N, T), "N is rank deficient"),
        ((A, N, 0.0 * T), "T is rank deficient"),
        ((A, N, N), "N and T together are rank deficient"),
        ((A, N, T, [-0.1]), "gap of node 1 is negative"),
        ((A, N, T, [0.1, 0.2]), "gap has shape"),
        ((A, N, T, [np.nan]), "gap must be finite"),
        ((A, N, T, ["wide"]), "gap must be an array of numbers"),
        (("stiff", N, T), "A must be an array of numbers"),
        ((A + 0j, N, T), "A must be an array of numbers: got complex numbers"),
        ((sp.csr_matrix(A + 0j), N, T), r"A.data must be an array of numbers: got complex"),
        ((A, N.astype(str), T), "N must be an array of numbers: got texts"),
        ((A, N, T.tolist(), [b"0.1"]), "gap must be an array of numbers: got texts"),
        ((A, N, T, np.array(["1"], dtype=object)), "gap must be an array of numbers: got texts"),
    ],
)
def test_body(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        ContactBody(*arguments)


@pytest.mark.parametrize("which", ["N", "T"])
def test_rank_deficient_operators_of_two_nodes(which):
    operators = {"N": np.eye(4)[[0, 2]], "T": np.eye(4)[[1, 3]]}
    operators[which] = operators[which][[0, 0]]
    with pytest.raises(InvalidInputError, match=f"{which} is rank deficient"):
        ContactBody(np.eye(4), **operators)


def test_which_gap_is_negative_is_said():
    with pytest.raises(InvalidInputError, match=r"gap of node 2 is negative: -0\.5"):
        ContactBody(np.eye(4), np.eye(4)[[0, 2]], np.eye(4)[[1, 3]], [1.0, -0.5])


# -- loads, friction, r --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((LOAD, -1.0), "friction must not be negative"),
        ((LOAD, [-0.5]), "friction must not be negative"),
        ((LOAD, np.nan), "friction must be finite"),
        ((LOAD, np.inf), "friction must be finite"),
        ((LOAD, [1.0, 2.0]), "friction must be a number or 1 numbers"),
        ((LOAD, "rough"), "friction must be an array of numbers"),
        ((LOAD, 1.0, 0.0), "r must be positive"),
        ((LOAD, 1.0, -1.0), "r must be positive"),
        ((LOAD, 1.0, [-1.0]), "r must be positive"),
        ((LOAD, 1.0, np.nan), "r must be finite"),
        ((LOAD, 1.0, [1.0, 1.0]), "r must be a number or 1 numbers"),
        (([1.0, 0.0], 1.0), "load must be an AffineLoad or a callable"),
        ((AffineLoad([1.0] * 3, [1.0] * 3), 1.0), "load has shape"),
    ],
)
def test_load_problem(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        CoulombLoad(body(), *arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0, np.nan],), "force must be finite"),
        (([1.0],), "force has shape"),
        (([1.0, 0.0], 0.0), "r must be positive"),
        ((["down", 0.0],), "force must be an array of numbers"),
    ],
)
def test_friction_problem(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        CoulombFriction(body(), *arguments)


@pytest.mark.parametrize(
    ("problem", "other"), [(CoulombLoad, (LOAD, 1.0)), (CoulombFriction, ([1.0, 0.0],))]
)
def test_a_body_comes_first(problem, other):
    with pytest.raises(InvalidInputError, match="body must be a ContactBody, got AffineLoad"):
        problem(LOAD, *other)


def test_a_load_path_returns_numbers():
    system = CoulombLoad(body(), lambda alpha: "heavy", 1.0)
    with pytest.raises(InvalidInputError, match=r"load\(0.5\) must be numbers, got 'heavy'"):
        system.load_at(0.5)


@NOT_FINITE
def test_affine_load_must_be_finite(bad):
    with pytest.raises(InvalidInputError, match="f0 must be finite"):
        AffineLoad([bad, 0.0], [0.0, 1.0])
    with pytest.raises(InvalidInputError, match="f1 must be finite"):
        AffineLoad([0.0, 0.0], [0.0, bad])


def test_affine_load_shapes_must_agree():
    with pytest.raises(InvalidInputError, match="f1 has shape"):
        AffineLoad([0.0, 0.0], [1.0])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.0, np.nan], [1.0, 0.0], [0.0, 1.0]), "f0 must be finite"),
        (([0.0, 0.0], [1.0], [0.0, 1.0]), "fc has shape"),
        (([0.0, 0.0], [1.0, 0.0], [0.0, 1.0, 2.0]), "fs has shape"),
        (([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], np.inf), "w must be finite"),
        (([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], 1.0, [1.0, 2.0]), "phase has shape"),
    ],
)
def test_harmonic_load(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        HarmonicLoad(*arguments)


def test_load_path_with_a_wrong_shape():
    system = CoulombLoad(body(), lambda alpha: np.ones(3), 1.0)
    with pytest.raises(InvalidInputError, match=r"load.* has shape"):
        explore(system, (0.0, 1.0))


@NOT_FINITE
def test_load_path_that_is_not_finite(bad):
    system = CoulombLoad(body(), lambda alpha: np.array([bad, alpha]), 1.0)
    with pytest.raises(PwscontError, match="load"):
        explore(system, (0.0, 1.0))
    with pytest.raises(PwscontError, match="load"):
        trace(system, (np.zeros(4), 0.5), (0.0, 1.0))


# -- interval, start, stepper --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        ((1.0, 1.0), "interval needs finite lo < hi"),
        ((2.0, -2.0), "interval needs finite lo < hi"),
        ((0.0, np.inf), "interval needs finite lo < hi"),
        ((-np.inf, 0.0), "interval needs finite lo < hi"),
        ((np.nan, 1.0), "interval needs finite lo < hi"),
        ((0.0, 1.0, 2.0), "interval must be two numbers"),
        ((0.0,), "interval must be two numbers"),
        (1.0, "interval must be two numbers"),
        (("a", "b"), "interval must be two numbers"),
        ((0.0, 10**400), "interval must be two numbers"),
        (None, "interval must be two numbers"),
    ],
)
def test_interval(interval, words):
    system = CoulombLoad(body(), LOAD, 4.0)
    with pytest.raises(InvalidInputError, match=words):
        explore(system, interval)
    with pytest.raises(InvalidInputError, match=words):
        trace(system, (np.zeros(4), 0.0), interval)


@pytest.mark.parametrize("interval", [(-0.1, 2.0), (-3.0, -1.0)])
def test_negative_friction_interval(interval):
    with pytest.raises(InvalidInputError, match=r"interval .*CoulombFriction"):
        explore(CoulombFriction(body(), [1.0, -3.0]), interval)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ((np.zeros(4), 2.5), "outside the interval"),
        ((np.zeros(4), -2.5), "outside the interval"),
        ((np.zeros(4), np.nan), "outside the interval"),
        ((np.zeros(3), 0.0), "z of the start has shape"),
        ((np.zeros((4, 1)), 0.0), "z of the start has shape"),
        ((0.0, 0.0), "z of the start has shape"),
        (([0.0, np.nan, 0.0, 0.0], 0.0), r"z of the start must be finite, but entry \[1\] is nan"),
        (([0.0, np.inf, 0.0, 0.0], 0.0), "z of the start must be finite"),
        ((["a"] * 4, 0.0), "z of the start must be an array of numbers"),
        (3.0, "start must be a pair"),
        ((np.zeros(4),), r"start must be a pair \(z, alpha\), got \(array"),
        ((np.zeros(4), 0.0, 1.0), "start must be a pair"),
        ((np.zeros(4), "here"), "start must be a pair"),
        ((np.zeros(4), 10**400), "start must be a pair"),
    ],
)
def test_start(start, words):
    with pytest.raises(InvalidInputError, match=words):
        trace(CoulombLoad(body(), LOAD, 4.0), start, (-2.0, 2.0))


@pytest.mark.parametrize(
    "system",
    [CoulombFriction(body(), [1.0, -3.0]), CoulombLoad(body(), lambda a: np.ones(2), 1.0)],
    ids=["friction", "curved load"],
)
def test_exact_stepper_needs_straight_pieces(system):
    with pytest.raises(InvalidInputError, match="ExactLinear needs a PiecewiseLinearSystem"):
        explore(system, (0.0, 1.0), stepper=ExactLinear())
    with pytest.raises(InvalidInputError, match="ExactLinear needs a PiecewiseLinearSystem"):
        trace(system, (np.zeros(4), 0.5), (0.0, 1.0), stepper=ExactLinear())


def test_solutions_outside_of_the_domain_are_not_asked_for():
    friction = CoulombFriction(body(), [1.0, -3.0])
    with pytest.raises(InvalidInputError, match=r"alpha = -1.0 is outside the domain \[0.0, inf\]"):
        enumerate_solutions(friction, -1.0)
