"""How many solutions, where, and along which way: graphs known in closed form."""

import math
from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
import pytest
from closed_loops import Diamond
from paper_systems import CASES, ONE_NODE
from pwscont_coulomb import AffineLoad, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import exact_pieces

from pwscont import AllTransitions, BranchGraph, PiecewiseSystem, Switched, explore, trace
from pwscont.basics.errors import InvalidInputError, InvalidSystemError, SystemNeededError

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

FREE, STICK, SLIP_PLUS, SLIP_MINUS = "no contact", "stick", "slip+", "slip-"


@pytest.fixture(scope="module")
def fig7():
    """1 solution, 3 between the folds at -1 and -0.5, then 1; a transition at 1."""
    return explore(CASES["fig7"].system, CASES["fig7"].interval)


def rows(stretches):
    return [(*stretch, stretch.lo_closed, stretch.hi_closed) for stretch in stretches]


def assert_stretches(found, expected):
    found = rows(found)
    assert [row[2:] for row in found] == [row[2:] for row in expected]
    np.testing.assert_allclose(
        [row[:2] for row in found], [row[:2] for row in expected], rtol=0, atol=1e-13
    )


# -- which ends belong to a stretch --------------------------------------------------------------


def test_ends_of_stretches_at_folds_and_at_the_interval(fig7):
    """Two solutions at a fold: neither neighbour, with one and three, includes it."""
    expected = [(-2, -1, 1, True, False), (-1, -0.5, 3, False, False), (-0.5, 2, 1, False, True)]
    assert_stretches(fig7.multiplicity(), expected)
    assert [stretch.ends for stretch in fig7.multiplicity()] == [
        "[-2, -1)",
        "(-1, -0.5)",
        "(-0.5, 2]",
    ]


def test_where(fig7):
    assert_stretches(fig7.with_count(1), [(-2, -1, 1, True, False), (-0.5, 2, 1, False, True)])
    assert_stretches(fig7.with_count(2), [(-1, -1, 2, True, True), (-0.5, -0.5, 2, True, True)])
    assert_stretches(fig7.with_count(3), [(-1, -0.5, 3, False, False)])
    assert fig7.with_count(0) == fig7.with_count(4) == []


def test_stretches_unpack(fig7):
    (lo, hi, count), *_ = fig7.multiplicity()
    assert (lo, hi, count) == (-2.0, pytest.approx(-1.0), 1)
    first = fig7.multiplicity()[0]
    assert first == (lo, hi, count) == (first.lo, first.hi, first.count)


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        ((-1.0, 0.0), [(-1, -0.5, 3, False, False), (-0.5, 0, 1, False, True)]),
        ((-2.0, -1.0), [(-2, -1, 1, True, False)]),
        ((-0.5, 1.0), [(-0.5, 1, 1, False, True)]),
        ((-2.0, -0.5), [(-2, -1, 1, True, False), (-1, -0.5, 3, False, False)]),
        ((-0.75, -0.6), [(-0.75, -0.6, 3, True, True)]),
    ],
)
def test_interval_that_ends_at_a_fold(interval, expected):
    graph = explore(CASES["fig7"].system, interval)
    assert_stretches(graph.multiplicity(), expected)
    for end in interval:
        assert graph.count(end) == {-1.0: 2, -0.5: 2, -0.75: 3, -0.6: 3}.get(end, 1)
    assert graph.is_balanced()


@pytest.mark.parametrize("ulps", range(-4, 5))
def test_interval_that_ends_at_a_fold_but_for_rounding(ulps):
    """The same numbers as at the fold itself: the difference is below the errors."""
    system = CASES["fig7"].system
    right, left = -0.5 + ulps * 2.0**-53, -1.0 + ulps * 2.0**-52
    for interval in ((-2.0, left), (right, 1.0), (left, 0.0), (-2.0, right)):
        graph = explore(system, interval)
        assert [graph.count(end) for end in interval] == [
            2 if end in (left, right) else 1 for end in interval
        ]
        assert graph.is_balanced()
        assert all(abs(piece.points[0, -1] - piece.points[-1, -1]) > 0.1 for piece in graph.pieces)


def test_a_transition_does_not_divide_a_stretch(fig7):
    assert [p.alpha for p in fig7.special_points("transition")] == pytest.approx([1.0])
    assert fig7.count(1.0) == 1
    assert fig7.multiplicity()[-1][1] == 2.0


class Loop(PiecewiseSystem):
    """The circle z^2 + alpha^2 = 1: no solution, two, none; one at both folds."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([1.0])

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0


def test_stretches_without_solutions():
    graph = trace(Loop(), ([1.0], 0.0), (-2.0, 2.0))
    found = rows(graph.multiplicity())
    assert [row[2:] for row in found] == [(0, True, False), (2, False, False), (0, False, True)]
    singles = graph.with_count(1)
    assert [stretch[0] == stretch[1] for stretch in singles] == [True, True]
    np.testing.assert_allclose([s[0] for s in singles], [-1.0, 1.0], rtol=0, atol=1e-10)
    for fold in graph.special_points("fold"):
        assert graph.count(fold.alpha) == 1
        assert graph.balance(fold.alpha) == 0
        (solution,) = graph.solutions(fold.alpha)
        assert (solution.kind, solution.det_sign) == ("fold", 0)
    assert [len(graph.with_count(count)) for count in (0, 2, 3)] == [2, 1, 0]


def test_vertical_piece_has_infinitely_many_solutions():
    """Fig. 12's phenomenon at F = a / b: the slip piece stands upright at alpha = 0."""
    load = AffineLoad([1.0, -2.0], [0.0, 1.0])
    graph = explore(CoulombLoad(contact_body(ONE_NODE), load, 2.0), (-1.0, 1.0))
    assert graph.count(0.0) == math.inf
    assert [graph.count(alpha) for alpha in (-1.0, -1e-9, 1e-9, 1.0)] == [1, 1, 1, 1]
    states = np.array([solution.z for solution in graph.solutions(0.0)])
    ends = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 2.0]])  # they are equally right
    np.testing.assert_allclose(states[states[:, 3].argsort()], ends, rtol=0, atol=1e-13)
    assert graph.is_balanced()


def exact_count(pieces, alpha):
    """Return the number of solutions at a rational alpha: pieces through it, and joints at it."""
    through = sum(piece.lo < alpha < piece.hi for piece in pieces)
    ends = sum(alpha in (piece.lo, piece.hi) for piece in pieces)
    return through, ends


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.sweep(10)
def test_random_bodies_against_fractions(seed):
    """Every stretch and every single value of alpha, from pieces without rounding."""
    body = random_body(1 + seed % 3, seed)
    load = AffineLoad(random_vector(body.n, seed), random_vector(body.n, seed + 1))
    interval = (-3.0, 3.0)
    graph = explore(CoulombLoad(contact_body(body), load, 7.0), interval)
    pieces = exact_pieces(body, load.f0, load.f1, 7.0, interval)
    breaks = sorted({Fraction(-3), Fraction(3)} | {e for p in pieces for e in (p.lo, p.hi)})
    for a, b in pairwise(breaks):
        through, _ = exact_count(pieces, (a + b) / 2)
        assert graph.count(float((a + b) / 2)) == through
    for alpha in breaks[1:-1]:
        through, ends = exact_count(pieces, alpha)
        assert ends == 2
        assert graph.count(float(alpha)) == through + 1
    for stretch in graph.multiplicity():
        assert stretch.lo_closed == (graph.count(stretch[0]) == stretch[2])
        assert stretch.hi_closed == (graph.count(stretch[1]) == stretch[2])
    covered = sum(hi - lo for n in range(12) for lo, hi, _ in graph.with_count(n))
    assert covered == pytest.approx(6.0)


# -- solutions at special points -----------------------------------------------------------------


@pytest.mark.parametrize("fold", [-1.0, -0.5])
def test_solutions_at_folds_are_marked(fig7, fold):
    kinds = {s.kind: s.det_sign for s in fig7.solutions(fold)}
    assert kinds == {None: 1, "nonsmooth fold": 0}
    assert fig7.balance(fold) == 1


def test_solutions_elsewhere_are_not_marked(fig7):
    for alpha in (-1.5, -0.7, 0.0, 1.5):
        assert [s.kind for s in fig7.solutions(alpha)] == [None] * fig7.count(alpha)
    (passing,) = fig7.solutions(1.0)
    assert (passing.kind, passing.det_sign) == ("transition", 1)


def test_solutions_at_the_ends_of_the_interval(fig7):
    for alpha, label in ((-2.0, FREE), (2.0, SLIP_PLUS)):
        (solution,) = fig7.solutions(alpha)
        assert (solution.label, solution.det_sign) == (label, 1)
        assert solution.kind in ("start", "end")


@pytest.mark.parametrize("name", ["fig7", "fig10", "fig13", "fig14", "example1", "example3"])
def test_balance_at_every_node(name):
    """The sum of signs is +1 at folds and transitions as well, with folds counted zero."""
    case = CASES[name]
    graph = explore(case.system, case.interval)
    for point in graph.special_points():
        solutions = graph.solutions(point.alpha)
        assert graph.balance(point.alpha) == sum(s.det_sign for s in solutions) == 1
        assert graph.count(point.alpha) == len(solutions)
        for solution in solutions:
            if solution.kind in ("fold", "nonsmooth fold"):
                assert solution.det_sign == 0


# -- ways from one solution to another -----------------------------------------------------------


def labelled(graph, alpha, label):
    (found,) = [s for s in graph.solutions(alpha) if s.label == label]
    return found


def labels(path):
    return [piece.label for piece in path]


def test_path_on_one_piece(fig7):
    a, b = (labelled(fig7, alpha, STICK) for alpha in (-0.7, 0.4))
    assert labels(fig7.path(a, b)) == [STICK]
    assert labels(fig7.path(a, a)) == [STICK]


def test_path_to_the_neighbouring_piece(fig7):
    a, b = labelled(fig7, 0.0, STICK), labelled(fig7, 1.5, SLIP_PLUS)
    assert labels(fig7.path(a, b)) == [STICK, SLIP_PLUS]
    assert labels(fig7.path(b, a)) == [SLIP_PLUS, STICK]


def test_path_through_both_folds(fig7):
    a, b = labelled(fig7, -1.8, FREE), labelled(fig7, 1.8, SLIP_PLUS)
    assert labels(fig7.path(a, b)) == [FREE, SLIP_MINUS, STICK, SLIP_PLUS]
    assert labels(fig7.path(b, a)) == [SLIP_PLUS, STICK, SLIP_MINUS, FREE]


def test_path_between_solutions_at_one_alpha(fig7):
    a, b = labelled(fig7, -0.7, FREE), labelled(fig7, -0.7, STICK)
    assert labels(fig7.path(a, b)) == [FREE, SLIP_MINUS, STICK]


def test_path_from_a_fold(fig7):
    (fold,) = [s for s in fig7.solutions(-1.0) if s.kind == "nonsmooth fold"]
    path = fig7.path(fold, labelled(fig7, 1.5, SLIP_PLUS))
    assert path[-1].label == SLIP_PLUS
    assert labels(path) in ([STICK, SLIP_PLUS], [SLIP_MINUS, STICK, SLIP_PLUS])


def test_consecutive_pieces_of_a_path_share_a_node():
    case = CASES["example3"]
    graph = explore(case.system, case.interval)
    middle = [
        next(s for s in graph.solutions(0.5 * sum(piece.interval)) if s.piece == piece.id)
        for piece in graph.pieces
    ]
    component = {piece.id: c for c, pieces in enumerate(graph.components()) for piece in pieces}
    for a, b in combinations(middle, 2):
        path = graph.path(a, b)
        if component[a.piece] != component[b.piece]:
            assert path == []
            continue
        assert [path[0].id, path[-1].id] == [a.piece, b.piece]
        assert len({piece.id for piece in path}) == len(path)
        assert all({p.start, p.end} & {q.start, q.end} for p, q in pairwise(path))


def test_path_on_a_loop_takes_the_shorter_way():
    graph = explore(Diamond(), (-2.0, 2.0), search=AllTransitions())
    upper_left, upper_right = (graph.solutions(alpha)[1] for alpha in (-0.5, 0.5))
    pair = sorted(graph.solutions(-0.5), key=lambda s: s.z[0])
    assert [s.z[0] for s in pair] == pytest.approx([-0.5, 0.5])
    assert len(graph.path(*pair)) == 2
    assert len(graph.path(pair[0], pair[0])) == 1
    opposite = [s for s in graph.solutions(0.5) if s.z[0] > 0.0]
    assert len(graph.path(pair[0], opposite[0])) == 3
    assert upper_left.alpha == -upper_right.alpha


class ShortCell(PiecewiseSystem):
    """z = sin(alpha), with a cell from alpha = 1 to 1.01: shorter than the first step."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([alpha - 1.0, 1.01 - alpha])

    def residual(self, z, alpha, character):
        return z - np.sin(alpha)


def test_a_curved_piece_of_one_step_is_no_straight_one(tmp_path):
    graph = explore(ShortCell(), (0.0, 3.0), starts=[([0.0], 0.0), ([0.846], 1.0047)])
    short = [piece for piece in graph.pieces if piece.interval[1] - piece.interval[0] < 0.02]
    assert len(short) == 1  # the second start is a point of it
    assert len(short[0].points) > 2
    graph.save(tmp_path / "graph.npz")
    with pytest.raises(SystemNeededError, match="curved"):
        BranchGraph.load(tmp_path / "graph.npz").solutions(1.005)


class TwoSheets(PiecewiseSystem):
    """(z - f) (z - f + d) = 0 with f = a sin(w alpha): sheets closer than steps can tell."""

    size, d = 1, 1.69e-4

    def test_functions(self, z, alpha):
        return np.ones(1)

    def residual(self, z, alpha, character):
        f = 0.96 * np.sin(13.34 * alpha + 4.224)
        return (z - f) * (z - f + self.d)


@pytest.mark.slow
def test_a_solution_is_on_its_own_sheet_or_has_an_error():
    """Between stored points the cubic may be nearer to the other sheet than to its own.

    The path takes so small steps that it is stopped after some of the interval.
    """
    start = 0.96 * np.sin(13.34 * 0.8 + 4.224)
    graph = trace(TwoSheets(), ([start], 0.8), (0.0, 6.0))
    for alpha in np.linspace(0.21, 1.29, 360):
        (found,) = graph.solutions(float(alpha))
        true = 0.96 * np.sin(13.34 * alpha + 4.224)
        assert abs(found.z[0] - true) <= 1e-8 + 10.0 * found.error[0]


@pytest.mark.parametrize("alpha", ["0.1", None, [0.1], np.array([0.1, 0.2]), 1j], ids=repr)
def test_what_is_no_number_is_refused(fig7, alpha):
    for ask in (fig7.count, fig7.solutions, fig7.balance):
        with pytest.raises(InvalidInputError, match="alpha must be a number"):
            ask(alpha)


class Stiffening(PiecewiseSystem):
    """z + bend z^3 + relu(z - stop) = alpha, whose constants a user may change."""

    size, bend, stop = 1, 1.0, 0.5

    def test_functions(self, z, alpha):
        return z - self.stop

    def residual(self, z, alpha, character):
        pushed = z - self.stop if character.signs[0] else 0.0
        return z + self.bend * z**3 + pushed - alpha


@pytest.mark.parametrize("bend", [0.0, 1.0])
@pytest.mark.parametrize("by", [0.5, 0.03])
def test_a_system_that_was_changed_after_the_run_is_refused(bend, by):
    system = Stiffening()
    system.bend = bend
    graph = trace(system, ([0.1], 0.1), (-1.0, 3.0))
    alpha = 1.0 + bend + 0.5  # z = 1
    assert graph.solutions(alpha)[0].z[0] == pytest.approx(1.0, rel=1e-12)
    system.stop += by
    with pytest.raises(InvalidSystemError, match="Stiffening has changed since the graph was made"):
        graph.solutions(alpha)
    system.stop -= by
    assert graph.solutions(alpha)[0].z[0] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("equation", "alpha"),
    [
        (lambda z, a, sw: z**2 - sw.abs(a), 0.0),
        (lambda z, a, sw: z**2 + a**2 - sw.abs(a), 0.0),
        (lambda z, a, sw: (z - 0.3) ** 2 - sw.relu(a - 0.2) - 3.0 * sw.relu(0.2 - a), 0.2),
        (lambda z, a, sw: np.exp(z) - 1.0 - z - sw.abs(a), 0.0),
    ],
)
@pytest.mark.sweep(4)
def test_two_folds_on_both_sides_of_a_kink_in_alpha_are_one_solution(equation, alpha):
    """Both curves end their turn at the same point, where z solves the equation once."""
    graph = explore(Switched(1, equation), (-1.0, 1.0))
    assert [graph.count(alpha + step) for step in (-0.1, 0.0, 0.1)] == [2, 1, 2]
    assert len(graph.solutions(alpha)) == 1
    assert graph.is_balanced()


def test_no_way_leads_to_a_solution_on_no_piece():
    """Beside z = 2 there is z = 0 at alpha = 0, where the last solution of |z| + alpha = 0 is."""
    equation = Switched(1, lambda z, a, sw: sw.min(sw.abs(z) + a, 2.0 - z), linear=True)
    graph = explore(equation, (0.0, 0.5))
    alone = [solution for solution in graph.solutions(0.0) if solution.piece == -1]
    (on_piece,) = (solution for solution in graph.solutions(0.5) if solution.piece >= 0)
    assert alone
    assert all(graph.path(solution, on_piece) == [] for solution in alone)
