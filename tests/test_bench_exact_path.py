"""Answers of the bench for systems with too many cells to try: the exact path, verified."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.elastic.scenes import block, block_body, press
from pwscont_coulomb.scenes import example1, fig7
from scipy.linalg import hilbert

from pwscont import BranchGraph, ExactLinear, NaturalParameter, PseudoArclength, explore, trace
from pwscont.bench import cases
from pwscont.bench.cases import Case, case_of
from pwscont.bench.contestants import Contestant, by_longest
from pwscont.bench.errors import errors, verdict
from pwscont.bench.measure import follow
from pwscont.bench.truth.exact_path import KNOWN_BY, verified_path
from pwscont.bench.truth.known_answer import UnknownAnswerError
from pwscont.bench.truth.rational import solve
from pwscont.bench.truth.refinement import KNOWN_BITS, refined
from pwscont.commands.cli import main
from pwscont.curve.metric import Metric
from pwscont.graph.records import Piece

pytestmark = pytest.mark.sweep(4)  # the others take too long for the README's command


SMALL = {"fig7": fig7, "example1": example1}
#: Agreement of two ways to one path, in the metric: rounding times the condition.
ROUNDING = 1e-12


def exact_graph(scene):
    return explore(scene.system, scene.interval, stepper=ExactLinear())


def verify(scene, pieces: Sequence[Piece]):
    scale = Metric.of(scene.system, scene.interval).scale
    return verified_path(scene.system, scene.interval, scale, pieces)


def sized(nodes: int):
    return replace(block(), build=partial(block_body, nodes))


@pytest.fixture(scope="module")
def block20() -> Case:
    return case_of(block())


# -- systems whose complete answer is known as well ------------------------------------------------


@pytest.mark.parametrize("name", SMALL)
def test_accepts_the_path_and_agrees_with_the_complete_answer(name):
    scene = SMALL[name]()
    found = verify(scene, exact_graph(scene).pieces)
    known = {piece.cell: piece for piece in case_of(scene).truth.pieces}
    assert {piece.cell for piece in found.pieces} == set(known)
    assert len(found.pieces) == len(known)
    for piece in found.pieces:
        assert (piece.span, piece.det_sign) == (known[piece.cell].span, known[piece.cell].det_sign)
        np.testing.assert_array_equal(piece.middle(), known[piece.cell].middle())


@pytest.mark.parametrize("name", SMALL)
def test_refined_solutions_agree_with_the_complete_answer(name, monkeypatch):
    """The same without elimination: refinement is right far beyond the last digit."""
    monkeypatch.setattr("pwscont.bench.truth.exact_path.SMALL", 0)
    scene = SMALL[name]()
    found = verify(scene, exact_graph(scene).pieces)
    known = {piece.cell: piece for piece in case_of(scene).truth.pieces}
    for piece in found.pieces:
        assert piece.det_sign == known[piece.cell].det_sign
        np.testing.assert_allclose(
            piece.span, known[piece.cell].span, rtol=4e-16, atol=2.0**-KNOWN_BITS
        )
        np.testing.assert_allclose(
            piece.middle(), known[piece.cell].middle(), rtol=4e-16, atol=2.0**-KNOWN_BITS
        )


# -- what is false is refused ----------------------------------------------------------------------


def shifted(piece: Piece, end: int, by: float) -> Piece:
    points = piece.points.copy()
    points[end] += by
    return replace(piece, points=points)


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("end", [0, -1])
@pytest.mark.parametrize("by", [1e-7, -1e-7, 1e-2, np.nan])
def test_refuses_a_shifted_end(number, end, by):
    scene = fig7()
    pieces = list(exact_graph(scene).pieces)
    pieces[number] = shifted(pieces[number], end, by)
    with pytest.raises(UnknownAnswerError, match=f"not true, {number} .* its ends are off"):
        verify(scene, pieces)


@pytest.mark.parametrize("number", range(4))
def test_refuses_every_wrong_character(number):
    scene = fig7()
    pieces = list(exact_graph(scene).pieces)
    true = scene.system.cell(pieces[number].character)
    wrong = [cell for cell in scene.system.cells() if scene.system.cell(cell) != true]
    assert len(wrong) == 3
    for character in wrong:
        trial = [*pieces]
        trial[number] = replace(pieces[number], character=character)
        with pytest.raises(UnknownAnswerError, match=f"not true, {number} "):
            verify(scene, trial)


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("wrong", [lambda sign: -sign, lambda sign: 0])
def test_refuses_a_wrong_or_missing_sign(number, wrong):
    scene = fig7()
    pieces = list(exact_graph(scene).pieces)
    sign = pieces[number].det_sign
    pieces[number] = replace(pieces[number], det_sign=wrong(sign))
    with pytest.raises(UnknownAnswerError, match=f"determinant has the sign \\{sign:+d}"):
        verify(scene, pieces)


@pytest.mark.parametrize("number", range(4))
def test_refuses_a_path_with_a_hole(number):
    scene = fig7()
    pieces = [piece for piece in exact_graph(scene).pieces if piece.id != number]
    with pytest.raises(UnknownAnswerError, match="breaks off at alpha"):
        verify(scene, pieces)


def test_refuses_a_piece_twice():
    scene = fig7()
    pieces = exact_graph(scene).pieces
    with pytest.raises(UnknownAnswerError, match="twice"):
        verify(scene, [*pieces, pieces[1]])


def test_refuses_a_path_without_pieces():
    with pytest.raises(UnknownAnswerError, match="no pieces"):
        verify(fig7(), [])


def test_refuses_a_path_without_one_of_its_branches():
    """What joins from end to end can still lack a branch; then the signs do not sum to one."""
    scene, parts = three_branches()
    verify(scene, [piece for part in parts for piece in part])
    assert sorted(piece.det_sign for part in parts for piece in part) == [-1, 1, 1]
    for left_out in parts:
        others = [piece for part in parts if part is not left_out for piece in part]
        with pytest.raises(UnknownAnswerError, match="the exact path lacks a branch"):
            verify(scene, others)


def test_completeness_is_not_claimed():
    """Two branches of opposite signs cancel: without both, nothing is seen."""
    scene, parts = three_branches()
    stable = next(part for part in parts if part[0].det_sign == 1)
    assert len(verify(scene, stable).pieces) == 1


def three_branches():
    """Return fig7 on the interval between its folds, where three branches do not meet."""
    scene = fig7()
    folds = sorted(p.alpha for p in exact_graph(scene).special_points("nonsmooth fold"))
    width = folds[1] - folds[0]
    scene = replace(scene, interval=(folds[0] + 0.1 * width, folds[1] - 0.1 * width))
    return scene, exact_graph(scene).components()


def test_refuses_a_test_that_vanishes_all_along():
    """Without friction and tangential load, stick and both slips are one at every alpha."""
    body = ContactBody([[2.0, 0.0], [0.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    system = CoulombLoad(body, AffineLoad([1.0, 0.0], [1.0, 0.0]), 0.0)
    interval = (0.0, 1.0)
    graph = trace(system, ([0.0, 0.0, -1.5, 0.0], 0.5), interval, stepper=ExactLinear())
    scale = Metric.of(system, interval).scale
    assert graph.pieces
    with pytest.raises(UnknownAnswerError, match="vanishes all along"):
        verified_path(system, interval, scale, graph.pieces)


# -- the block -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_exact_and_arclength_agree_on_block_with_20_contact_nodes(block20):
    """Issue 5: the same pieces, and the same places to rounding."""
    assert block20.truth.known_by == KNOWN_BY
    assert len(block20.truth.pieces) == 21
    for stepper in (ExactLinear(), PseudoArclength(), NaturalParameter()):
        graph = follow(block20, Contestant("", None, stepper))
        assert not verdict(graph, block20.truth, block20.system)
        found = errors(graph, block20.truth, block20.system)
        assert max(found.branch_max, found.points_max, found.transitions) < ROUNDING


@pytest.mark.parametrize("nodes", [5, 10])
@pytest.mark.sweep(2)
def test_block_by_mesh_size(nodes):
    case = case_of(sized(nodes))
    size = by_longest(0.1)
    graph = follow(case, Contestant("", size, PseudoArclength(step_size=size)))
    assert not verdict(graph, case.truth, case.system)
    found = errors(graph, case.truth, case.system)
    assert max(found.branch_max, found.points_max, found.transitions) < ROUNDING


def test_a_piece_of_the_block_that_is_shifted_is_refused():
    scene = sized(5).curve()
    pieces = list(exact_graph(scene).pieces)
    verify(scene, pieces)
    pieces[4] = shifted(pieces[4], -1, 1e-6)
    with pytest.raises(UnknownAnswerError, match="not true, 4 "):
        verify(scene, pieces)


def test_a_stepper_that_leaves_out_a_piece_is_wrong(block20):
    graph = follow(block20, Contestant("", None, PseudoArclength()))
    nodes = graph.special_points()
    short = BranchGraph(nodes, graph.pieces[:-1], graph.interval, system=block20.system)
    assert verdict(short, block20.truth, block20.system).startswith("1 of 21 pieces missing")


# -- what is not compared --------------------------------------------------------------------------


def test_larger_systems_are_refused_before_any_work(monkeypatch):
    monkeypatch.setattr(cases, "MOST_UNKNOWNS", 79)
    monkeypatch.setattr(cases, "explore", None)
    with pytest.raises(UnknownAnswerError, match="80 unknowns, more than the 79"):
        case_of(block())


def test_nodes_left_out_are_refused():
    with pytest.raises(UnknownAnswerError, match="left out"):
        case_of(press())


# -- the refinement --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_refined_is_rational_elimination(seed):
    """Rows and columns scaled over sixteen orders of magnitude; the error is below two to -200."""
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((6, 6)) * 10.0 ** rng.integers(-8, 8, (6, 1))
    matrix *= 10.0 ** rng.integers(-8, 8, 6)
    rhs = rng.standard_normal((6, 2))
    found, sign = refined(matrix, rhs)
    exact, exact_sign = solve(matrix, rhs)
    assert sign == exact_sign
    columns = [Fraction(float(c)) for c in np.abs(matrix).max(axis=0)]
    for k in range(2):
        terms = [abs(row[k]) * c for row, c in zip(exact, columns, strict=True)]
        off = [abs(a[k] - b[k]) * c for a, b, c in zip(found, exact, columns, strict=True)]
        assert max(off) <= max(terms) * Fraction(10) ** 20 / 2**KNOWN_BITS


def test_hilbert():
    """An inverse of integers, and a condition of 5e8: the answer is still exact to 40 digits."""
    n = 7
    matrix = np.array([[360360 // (i + j + 1) for j in range(n)] for i in range(n)], dtype=float)
    found, sign = refined(matrix, np.eye(n))
    exact, exact_sign = solve(matrix, np.eye(n))
    assert sign == exact_sign == 1
    off = max(
        abs(a - b) for p, q in zip(found, exact, strict=True) for a, b in zip(p, q, strict=True)
    )
    assert off < Fraction(1, 10**40)


@pytest.mark.parametrize(
    "matrix", [np.ones((2, 2)), np.zeros((2, 2)), np.diag([1.0, 0.0]), hilbert(14)]
)
def test_singular_to_rounding_has_no_sign(matrix):
    assert refined(matrix, np.ones((len(matrix), 1))) == ([], 0)


def test_no_right_side_no_solution():
    assert refined(np.eye(2), np.zeros((2, 1))) == ([[0], [0]], 1)


@pytest.mark.slow
def test_command(capsys, monkeypatch, block20):
    monkeypatch.setattr("pwscont.commands.bench.load_case", lambda *_: block20)
    monkeypatch.setattr("pwscont.commands.bench.contestants", few)
    assert main(["bench", "block", "--quick"]) == 0
    printed = capsys.readouterr().out
    assert "block: 21 pieces, 20 transitions, 0 folds; answer by the exact path, each" in printed
    assert "WRONG" not in printed


def few(is_straight: bool, quick: bool) -> list[Contestant]:
    assert is_straight
    assert quick
    size = by_longest(0.3)
    return [Contestant("arclength", size, PseudoArclength(step_size=size))]


@pytest.mark.slow
def test_blocks_by_mesh_size_from_the_command_line(capsys):
    assert main(["bench", "block", "-s", "nodes=5", "--quick"]) == 0
    printed = capsys.readouterr().out
    assert "answer by the exact path" in printed
    assert "WRONG" not in printed
    assert main(["bench", "-s", "nodes=5", "--quick"]) == 2
    assert "settings are those of one scene" in capsys.readouterr().err
