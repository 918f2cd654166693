"""All solutions at one alpha: against an enumeration of its own, closed forms and fractions."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from paper_systems import CASES, ONE_NODE, TWO_NODES
from pwscont_coulomb import AffineLoad, CoulombFriction, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import Body, exact_pieces, modes_of, slacks
from reference_enumeration import enumerate_solutions as brute_force
from sweeps import swept

from pwscont import (
    PiecewiseLinearSystem,
    PiecewiseSystem,
    SlicewiseLinearSystem,
    enumerate_solutions,
    explore,
)
from pwscont.basics.errors import InvalidInputError
from pwscont.curve.metric import Metric
from pwscont.enumeration.options import Option, Problem
from pwscont.enumeration.slices import solve_slice
from pwscont.enumeration.tree import leaves

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

NEAR_A_TRANSITION = 1e-8


def assert_same_solutions(found, expected):
    """The same modes, each once, with the same determinant signs and z to 1e-9 relative."""
    by_modes = {modes_of(solution.label): solution for solution in found}
    assert len(by_modes) == len(found)
    assert by_modes.keys() == {one.modes for one in expected}
    for one in expected:
        solution = by_modes[one.modes]
        assert solution.det_sign == one.det_sign
        assert solution.kind is None
        tolerance = 1e-9 * np.abs(one.z).max()
        np.testing.assert_allclose(solution.z, one.z, rtol=1e-9, atol=tolerance)


# -- random bodies -------------------------------------------------------------------------------


def random_problem(p, seed):
    """Return (body, load, friction): every third with gaps, every fourth with F per node."""
    rng = np.random.default_rng([seed, p, 5])
    body = random_body(p, seed, inner=seed % 3, gap=seed % 3 == 0)
    friction = rng.uniform(0.0, 8.0, p) if seed % 4 == 0 else float(rng.uniform(0.0, 8.0))
    return body, 3.0 * random_vector(body.n, [seed, p]), friction


@pytest.mark.parametrize(
    ("p", "bodies"),
    swept(
        [(1, 80), (2, 60), (3, 40), (4, 16), (5, 4)],
        [(1, 400), (2, 300), (3, 200), (4, 80), (5, 20)],
    ),
)
@pytest.mark.sweep(8)
def test_random_bodies(p, bodies):
    counts = []
    for seed in range(bodies):
        body, load, friction = random_problem(p, seed)
        expected = brute_force(body, load, friction)
        if min(one.margin for one in expected) < NEAR_A_TRANSITION:
            continue
        system = CoulombLoad(contact_body(body), AffineLoad(load, np.zeros(body.n)), friction)
        found = enumerate_solutions(system, 0.0)
        assert_same_solutions(found, expected)
        assert sum(solution.det_sign for solution in found) == 1
        counts.append(len(found))
    assert len(counts) > 0.95 * bodies
    assert max(counts) > 1 or bodies < 10  # there was something to miss


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.sweep(4)
def test_friction_as_parameter(p):
    """Slices are affine in z although they are curved in F."""
    for seed in range(20):
        body = random_body(p, seed, gap=seed % 2 == 0)
        force = 3.0 * random_vector(body.n, seed)
        system = CoulombFriction(contact_body(body), force)
        for friction in (0.5, 3.0, 8.0):
            expected = brute_force(body, force, friction)
            assert_same_solutions(enumerate_solutions(system, friction), expected)


@pytest.mark.parametrize("p", [1, 2, 3])
def test_curved_load_path(p):
    for seed in range(20):
        body = random_body(p, seed)
        f = [random_vector(body.n, [seed, i]) for i in range(3)]

        def load(alpha, f=f):
            return f[0] + np.cos(alpha) * f[1] + alpha**2 * f[2]

        system = CoulombLoad(contact_body(body), load, 5.0)
        expected = brute_force(body, load(1.3), 5.0)
        assert_same_solutions(enumerate_solutions(system, 1.3), expected)


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.sweep(4)
def test_without_friction_there_is_one_solution(p):
    """F = 0 is a strictly convex problem; slip+, slip- and stick differ in nothing but name."""
    for seed in range(30):
        body = random_body(p, seed, gap=seed % 2 == 0)
        load = 3.0 * random_vector(body.n, seed)
        system = CoulombLoad(contact_body(body), AffineLoad(load, 0.0 * load), 0.0)
        (solution,) = enumerate_solutions(system, 0.0)
        assert solution.det_sign == 1
        u, lam_nu, lam_t = np.split(solution.z, [body.n, body.n + p])
        residual = body.A @ u - load - body.N.T @ lam_nu - body.T.T @ lam_t
        np.testing.assert_allclose(residual, 0.0, rtol=0, atol=1e-12 * np.abs(load).max())
        np.testing.assert_allclose(lam_t, 0.0, rtol=0, atol=1e-12)
        free = body.gap - body.N @ u
        assert (free >= -1e-12).all()
        assert (lam_nu <= 1e-12).all()
        np.testing.assert_allclose(lam_nu * free, 0.0, rtol=0, atol=1e-12)


def test_seven_nodes():
    """Too many for brute force: every answer is a true one, and the signs sum to +1."""
    counts = []
    for seed in (0, 8):
        body = random_body(7, seed, inner=0)
        load = 3.0 * random_vector(body.n, [seed, 3])
        system = CoulombLoad(contact_body(body), AffineLoad(load, 0.0 * load), 8.0)
        found = enumerate_solutions(system, 0.0)
        assert len({solution.label for solution in found}) == len(found)
        assert sum(solution.det_sign for solution in found) == 1
        for solution in found:
            assert_is_solution(body, load, 8.0, solution)
        counts.append(len(found))
    assert max(counts) > 1


def assert_is_solution(body, load, friction, solution):
    p, modes = body.p, modes_of(solution.label)
    u, lam_nu, lam_t = np.split(solution.z, [body.n, body.n + p])
    size = 1e-10 * (1.0 + np.abs(solution.z).max())
    residual = body.A @ u - load - body.N.T @ lam_nu - body.T.T @ lam_t
    np.testing.assert_allclose(residual, 0.0, rtol=0, atol=size * np.abs(body.A).max())
    assert slacks(body, np.full(p, friction), modes, solution.z).min() >= -size
    for i, mode in enumerate(modes):
        equal = {
            "no contact": (lam_nu[i], lam_t[i]),
            "stick": (body.N[i] @ u - body.gap[i], body.T[i] @ u),
            "slip+": (body.N[i] @ u - body.gap[i], lam_t[i] - friction * lam_nu[i]),
            "slip-": (body.N[i] @ u - body.gap[i], lam_t[i] + friction * lam_nu[i]),
        }[mode]
        np.testing.assert_allclose(equal, 0.0, rtol=0, atol=size)


# -- at folds ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fold", "below", "above"), [(-1.0, 1, 3), (-0.5, 3, 1)])
@pytest.mark.parametrize("distance", [1e-9, 1e-12])
def test_next_to_a_fold(fold, below, above, distance):
    """The two folds of Fig. 7 in closed form: three solutions for -1 < alpha < -0.5."""
    system = CASES["fig7"].system
    assert len(enumerate_solutions(system, fold - distance)) == below
    assert len(enumerate_solutions(system, fold + distance)) == above


@pytest.mark.parametrize(("fold", "state"), [(-1.0, (0, 0, -0.25, 1.0)), (-0.5, (0, -0.25, 0, 0))])
def test_at_a_fold_the_double_solution_counts_once(fold, state):
    found = enumerate_solutions(CASES["fig7"].system, fold)
    double = [solution for solution in found if solution.kind is not None]
    assert len(found) == 2
    assert [(s.kind, s.det_sign) for s in double] == [("nonsmooth fold", 0)]
    np.testing.assert_allclose(double[0].z, state, rtol=0, atol=1e-14)
    assert sum(solution.det_sign for solution in found) == 1


def test_at_a_transition_the_solution_counts_once():
    """Stick ends and slip+ begins at alpha = 1 in Fig. 7."""
    (solution,) = enumerate_solutions(CASES["fig7"].system, 1.0)
    assert solution.kind == "transition"
    assert solution.det_sign == 1
    np.testing.assert_allclose(solution.z, [0, 0, -0.25, -1.0], rtol=0, atol=1e-14)


def count_of(pieces, alpha):
    """Return how many pieces have ``alpha`` inside, without rounding."""
    return sum(piece.lo < Fraction(alpha) < piece.hi for piece in pieces)


def ends_of(pieces, interval):
    """Return {alpha: [signs of the pieces that end there]} for all ends within the interval."""
    ends = {}
    for piece in pieces:
        for end in (piece.lo, piece.hi):
            if interval[0] < end < interval[1]:
                ends.setdefault(end, []).append(piece.det_sign)
    return ends


def affine_problems():
    yield TWO_NODES, CASES["example1"].system.load, 4.0, CASES["example1"].interval
    for seed in range(25):
        body = random_body(1 + seed % 2, seed)
        load = AffineLoad(random_vector(body.n, seed), random_vector(body.n, seed + 1))
        yield body, load, 6.0, (-2.0, 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("distance", swept([1e-11], [1e-9, 1e-12]))
def test_around_every_transition_against_fractions(distance):
    """Close to both sides of every transition and fold the number is that of fractions."""
    wrong, folds = [], 0
    for body, load, friction, interval in affine_problems():
        pieces = exact_pieces(body, load.f0, load.f1, friction, interval)
        system = CoulombLoad(contact_body(body), load, friction)
        for end, signs in ends_of(pieces, interval).items():
            folds += sum(signs) == 0
            for alpha in (float(end) - distance, float(end) + distance):
                count = len(enumerate_solutions(system, alpha))
                if count != count_of(pieces, alpha):
                    wrong.append((alpha, count, count_of(pieces, alpha)))
    assert not wrong
    assert folds > 10


def test_at_every_transition_and_fold_against_fractions():
    for body, load, friction, interval in affine_problems():
        pieces = exact_pieces(body, load.f0, load.f1, friction, interval)
        system = CoulombLoad(contact_body(body), load, friction)
        for end, signs in ends_of(pieces, interval).items():
            found = enumerate_solutions(system, float(end))
            marked = [(s.kind, s.det_sign) for s in found if s.kind is not None]
            through = [piece for piece in pieces if piece.lo < end < piece.hi]
            assert len(found) == len(through) + 1
            if sum(signs) == 0:
                assert marked == [("nonsmooth fold", 0)]
            else:
                assert marked == [("transition", signs[0])]


# -- faces ---------------------------------------------------------------------------------------


def slice_of(system, alpha):
    scale = np.append(system.scale(alpha, alpha), max(1.0, abs(alpha)))
    return solve_slice(system, Metric(scale), alpha)


def vertical(F=2.0):
    """Return one node with F = a / b under f = (1, -2 + alpha): vertical slip at alpha = 0."""
    return CoulombLoad(contact_body(ONE_NODE), AffineLoad([1.0, -2.0], [0.0, 1.0]), F)


def test_face_of_one_node_at_the_vertical_load():
    """With u_nu = 0 and lam_t = -2 lam_nu equilibrium is lam_nu = -1 - u_t for any u_t <= 0.

    From a u_t = -2 + 2 |lam_nu| and -b u_t = 1 + lam_nu: a segment from u_t = 0 (stick) to
    lam_nu = 0 (u_t = -1).
    """
    found = slice_of(vertical(), 0.0)
    (face,) = found.faces
    assert face.dimension == 1
    corners = sorted(face.corners[:, :-1].tolist(), key=lambda corner: np.round(corner, 9).tolist())
    expected = [[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 2.0]]
    np.testing.assert_allclose(corners, expected, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(face.corners[:, -1], 0.0)


@pytest.mark.parametrize("alpha", [-1e-9, 1e-9, -1.0, 0.5])
def test_beside_the_vertical_load_there_is_no_face(alpha):
    found = slice_of(vertical(), alpha)
    assert found.faces == ()
    assert len(found.points) == len(brute_force(ONE_NODE, [1.0, -2.0 + alpha], 2.0, 1e-12)) == 1


@pytest.mark.parametrize("alpha", [0.0, -1e-9, 1e-9])
def test_beside_the_vertical_friction_there_is_no_face(alpha):
    assert slice_of(vertical(F=2.0 + 1e-6), alpha).faces == ()


class HalfLine(PiecewiseLinearSystem):
    """max(z, 0) = max(alpha, 0): all z <= 0 at alpha = -1, without an end."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0], alpha])

    def residual(self, z, alpha, character):
        above, right = character.signs
        return np.array([(z[0] if above else 0.0) - (alpha if right else 0.0)])


def test_a_face_without_an_end_is_a_face():
    (face,) = slice_of(HalfLine(), -1.0).faces
    assert face.dimension == 1
    np.testing.assert_allclose(face.corners, [[0.0, -1.0]], rtol=0, atol=1e-14)
    assert slice_of(HalfLine(), 1.0).faces == ()


# -- systems of other kinds ----------------------------------------------------------------------


class TwoTents(SlicewiseLinearSystem):
    """2 |z0| - z1 = alpha^3 and |z1| + z0 = 1, without blocks and without a Jacobian."""

    size = 2

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        s0, s1 = (1.0 if sign else -1.0 for sign in character.signs)
        return np.array([2.0 * s0 * z[0] - z[1] - alpha**3, s1 * z[1] + z[0] - 1.0])


def tents(alpha):
    """Return all solutions by the four 2 x 2 systems, written out."""
    c, found = alpha**3, []
    for s0 in (1.0, -1.0):
        for s1 in (1.0, -1.0):
            # z0 = 1 - s1 z1, so (2 s0 (1 - s1 z1) - z1) = c
            z1 = (2.0 * s0 - c) / (1.0 + 2.0 * s0 * s1)
            z0 = 1.0 - s1 * z1
            if s0 * z0 > 0.0 and s1 * z1 > 0.0:
                found.append([z0, z1])
    return sorted(found)


def test_default_block():
    numbers = set()
    for alpha in np.linspace(-2.03, 2.01, 60):
        found = sorted(s.z.tolist() for s in enumerate_solutions(TwoTents(), float(alpha)))
        expected = tents(alpha)
        assert len(found) == len(expected)
        numbers.add(len(expected))
        if expected:
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert len(numbers) > 1


class Curved(PiecewiseSystem):
    size = 1

    def test_functions(self, z, alpha):
        return z.copy()

    def residual(self, z, alpha, character):
        return z**3 - alpha


def test_a_system_that_is_not_slicewise_linear_is_refused():
    with pytest.raises(InvalidInputError, match=r"SlicewiseLinearSystem, and Curved"):
        enumerate_solutions(Curved(), 0.0)


def test_a_large_gap_is_no_contact():
    body = Body(ONE_NODE.A, ONE_NODE.N, ONE_NODE.T, np.array([5.0]))
    system = CoulombLoad(contact_body(body), AffineLoad([1.0, 0.5], [0.0, 0.0]), 3.0)
    (solution,) = enumerate_solutions(system, 0.0)
    assert solution.label == "no contact"
    expected = np.append(np.linalg.solve(ONE_NODE.A, [1.0, 0.5]), [0.0, 0.0])
    np.testing.assert_allclose(solution.z, expected, rtol=0, atol=1e-14)


def problem_of(blocks, dimension):
    """Every option as a pair (i, value): the equation y_i = value, without inequalities."""
    unit, none, empty = np.eye(dimension), np.zeros((0, dimension)), np.zeros(0)
    options = [
        [
            Option((), (), np.zeros(0, int), empty, row, np.array([-value]), none, empty, row)
            for row, value in ((unit[[i]], value) for i, value in block)
        ]
        for block in blocks
    ]
    return Problem(options, none, np.zeros(0), np.zeros(dimension), unit, none, 0, 1.0)


@pytest.mark.parametrize(
    "sizes",
    [
        *[(), (3,), (2, 1, 3), (1,) * 70 + (2, 2), (2,) * 15],
        pytest.param((4**7 + 1,), marks=pytest.mark.slow),
    ],
)
def test_every_choice_is_a_leaf(sizes):
    """More choices than a batch, and more blocks than an array has dimensions."""
    blocks = [[(i, float(k)) for k in range(size)] for i, size in enumerate(sizes)]
    found = list(leaves(problem_of(blocks, len(sizes))))
    starts = [tuple(start) for choices in found for start in choices.starts.tolist()]
    assert sorted(starts) == list(product(*map(range, sizes)))
    assert all(choices.directions.shape[1:] == (len(sizes), 0) for choices in found)


def test_dependent_equations_leave_a_line_or_nothing():
    """y_1 may be asked for twice: the same value leaves y_0 free, another one is no solution."""
    blocks = [[(0, 0.0), (1, 1.0)], [(1, 1.0), (1, 2.0), (0, 0.0)]]
    found = list(leaves(problem_of(blocks, 2)))
    isolated = [choices for choices in found if not choices.directions.shape[-1]]
    starts = [tuple(start) for choices in isolated for start in choices.starts]
    assert sorted(starts) == [(0.0, 1.0), (0.0, 1.0), (0.0, 2.0)]
    lines = [choices.directions[0] for choices in found if choices.directions.shape[-1]]
    assert sorted(np.flatnonzero(np.abs(line[:, 0])).tolist() for line in lines) == [[0], [1]]


class Levelling(SlicewiseLinearSystem):
    """x rises to 1, falls to -2 and stays there, which is alpha; y = alpha x. Without Jacobians."""

    size = 2

    def test_functions(self, z, alpha):
        return z[0] - np.array([1.0, 2.0])

    def residual(self, z, alpha, character):
        x, y = z
        falls, stays = character.signs
        level = x - falls * 4.0 * (x - 1.0) + stays * 3.0 * (x - 2.0)
        return np.array([level - alpha, y - alpha * x])


@pytest.mark.parametrize("alpha", [-1.0, -0.85, 0.3])
@pytest.mark.sweep(4)
def test_a_cell_in_which_nothing_changes_has_no_solutions(alpha):
    found = enumerate_solutions(Levelling(), alpha)
    expected = [(x, alpha * x) for x in (alpha, (4.0 - alpha) / 3.0)]
    np.testing.assert_allclose(sorted(s.z.tolist() for s in found), expected, atol=1e-14)
    assert explore(Levelling(), (-1.0, 2.0)).guarantee == "complete but for closed loops"


class Plateau(SlicewiseLinearSystem):
    """x rises to 1, falls to 2.5 and stays; y = alpha x. The slopes on the plateau only cancel."""

    size = 2

    def __init__(self, up, down, unit):
        self.up, self.down, self.unit = up, down, unit

    def test_functions(self, z, alpha):
        return z[0] / self.unit - np.array([1.0, 2.5])

    def residual(self, z, alpha, character):
        falls, stays = character.signs
        x, turn = z[0] / self.unit, self.up + self.down
        level = self.up * x - falls * turn * (x - 1.0) + stays * self.down * (x - 2.5)
        return np.array([level - self.up * alpha, z[1] - alpha * z[0]])


@pytest.mark.parametrize("seed", range(20))
def test_rounding_of_slopes_that_cancel_is_no_slope(seed):
    """A plateau with a slope of rounding was met at 1e15, "complete (in exact arithmetic)"."""
    rng = np.random.default_rng(seed)
    (up, down), unit = rng.uniform(0.5, 3.0, 2), 10.0 ** (0 if seed % 2 else rng.integers(-18, 19))
    for alpha in (-0.3, 0.4, 0.9, 1.4):
        expected = int(alpha < 1.0) + int(up - 1.5 * down < up * alpha < up)
        assert len(enumerate_solutions(Plateau(up, down, unit), alpha)) == expected
