"""Graphs that a proof stands behind: classes, the default, files, and what is refused."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from pages import blocks, check_answers
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad

import pwscont.proof.everywhere
from pwscont import (
    LCP,
    BranchGraph,
    Complementarity,
    Everywhere,
    InvalidInputError,
    Limits,
    PiecewiseSystem,
    Switched,
    enumerate_solutions,
    explore,
    prove,
    trace,
)
from pwscont.curve.metric import Metric

pytestmark = pytest.mark.sweep(3)  # the others take too long for the README's command

ARCH = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)


# -- classes --------------------------------------------------------------------------------------


class Arch(PiecewiseSystem):
    """The README's system."""

    size = 1
    jump = 0.0

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        stop = 5.0 * (z - 1.0) + self.jump if character.signs[0] else 0.0
        return z * (z - 1.0) * (z - 2.0) + stop - alpha


def test_a_class_is_proved_across_its_kinks():
    graph = explore(Arch(), (-0.5, 1.0), search=Everywhere())
    assert graph.guarantee == "complete in the box, proved; balanced"
    assert [graph.proof.count(t) for t in (-0.2, 0.2, 0.7)] == [1, 3, 1]
    assert "agree where tests vanish" in graph.proof.statements[-1]


def test_a_class_that_returns_the_same_array_again_and_again_is_proved_right():
    """The stop lies beyond all points of the box at which the class is compared with its tape."""

    class Reusing(PiecewiseSystem):
        size, kept = 1, None

        def test_functions(self, z, alpha):
            return z - 1.0

        def residual(self, z, alpha, character):
            if self.kept is None or self.kept.dtype != z.dtype:
                self.kept = np.empty(1, dtype=z.dtype)
            self.kept[0] = (z[0] - 1.0) * (5.0 if character.signs[0] else -5.0) - alpha
            return self.kept

    metric = Metric(np.array([1.0, 1.5]), (0.5, 1.0))
    proof = Everywhere(box=(-1e4, 1.5)).prove(Reusing(), metric, (0.5, 1.0))
    assert proof.count(0.7) == 2


def test_a_class_whose_selections_differ_is_refused():
    system = Arch()
    system.jump = 1e-3
    metric = Metric(np.array([1.0, 1.5]), (-0.5, 1.0))
    with pytest.raises(InvalidInputError, match="differ where a test vanishes"):
        Everywhere(box=(-5.0, 5.0)).prove(system, metric, (-0.5, 1.0))


def test_a_class_that_asks_for_numbers_is_refused_in_words():
    class Plain(Arch):
        def residual(self, z, alpha, character):
            return super().residual(z, float(alpha), character)

    with pytest.raises(InvalidInputError, match="plain number"):
        explore(Plain(), (-0.5, 1.0), search=Everywhere())


# -- by default -----------------------------------------------------------------------------------


def test_explore_proves_small_formulas_by_default():
    graph = explore(ARCH, (-0.5, 1.0))
    assert graph.guarantee == "complete in the box, proved; balanced"
    assert graph.proof.boxes < 1000
    assert "proved" in repr(graph)
    assert graph.to_dict()["guarantee"] == graph.guarantee


@pytest.mark.slow
def test_by_default_what_is_not_proved_is_not_mentioned():
    graph = explore(Switched(1, lambda z, t, sw: (z - t) ** 2 * (z - 3)), (-1.0, 1.0))
    assert graph.proof is None
    assert "prove" not in graph.guarantee


@pytest.mark.slow
def test_nothing_is_proved_by_default_where_limits_are_set():
    graph = explore(ARCH, (-0.5, 1.0), limits=Limits(seconds=600.0))
    assert (graph.proof, graph.guarantee) == (None, "balanced")


def test_the_default_proof_finds_what_the_default_search_misses(monkeypatch):
    loop = Switched(1, lambda z, t, sw: (sw.abs(z - 30) + 1e4 * (t - 0.123) ** 2 - 1e-3) * (z + 1))
    with monkeypatch.context() as without:
        without.setattr(pwscont.proof.everywhere, "MANY_UNKNOWNS", 0)
        assert explore(loop, (-1.0, 1.0)).count(0.123) == 1
    graph = explore(loop, (-1.0, 1.0))
    assert graph.count(0.123) == graph.proof.count(0.123) == 3
    assert graph.guarantee.startswith("complete in the box, proved; ")


def test_a_graph_without_solutions_lends_no_other_system_the_proof(tmp_path):
    explore(Switched(1, lambda z, t, sw: z**2 + 1 + 0 * t), (-1.0, 1.0)).save(tmp_path / "empty")
    other = Switched(1, lambda z, t, sw: z**2 - 1 + 0 * t)
    assert BranchGraph.load(tmp_path / "empty", system=other).proof is None
    assert BranchGraph.load(tmp_path / "empty").proof.count(0.0) == 0


def test_a_graph_lends_no_other_system_with_the_same_branch_the_proof(tmp_path):
    """All points of the graph solve the other system, which has one more branch, at z = 5."""
    line = Switched(1, lambda z, t, sw: z - t)
    explore(line, (-1.0, 1.0)).save(tmp_path / "line")
    two = Switched(1, lambda z, t, sw: (z - t) * (z - 5.0))
    assert BranchGraph.load(tmp_path / "line", system=two).guarantee == "balanced"
    again = BranchGraph.load(tmp_path / "line", system=line)
    assert again.guarantee.startswith("complete in the box, proved")


def test_a_saved_graph_keeps_the_proof(tmp_path):
    graph = explore(ARCH, (-0.5, 1.0), search=Everywhere())
    graph.save(tmp_path / "arch")
    for again in (
        BranchGraph.load(tmp_path / "arch"),
        BranchGraph.load(tmp_path / "arch", system=ARCH),
    ):
        assert again.guarantee == graph.guarantee
        assert again.proof.statements == graph.proof.statements
        assert again.proof.folds == graph.proof.folds
        assert [again.proof.count(t) for t in (-0.2, 0.2, 0.7)] == [1, 3, 1]


@pytest.mark.slow
def test_an_open_proof_is_kept_as_such(tmp_path):
    pitchfork = Switched(1, lambda z, t, sw: z**3 - t * z)
    graph = explore(pitchfork, (-1.0, 1.0), search=Everywhere(box=(-3.0, 3.0)))
    graph.save(tmp_path / "pitchfork")
    again = BranchGraph.load(tmp_path / "pitchfork", system=pitchfork)
    assert again.proof.words == graph.proof.words == "not proved in 1 box"
    assert [again.proof.count(t) for t in (-0.5, 0.0, 0.5)] == [1, None, 3]


# -- graphs ----------------------------------------------------------------------------------------


def test_a_graph_says_what_is_proved():
    graph = explore(ARCH, (-0.5, 1.0), search=Everywhere())
    assert graph.guarantee.startswith("complete in the box, proved; ")
    assert [graph.proof.count(t) for t in (-0.2, 0.2, 0.7)] == [1, 3, 1]
    assert graph.proof.count(0.0) is None
    assert graph.proof.statements[1].startswith("folds in 2 ranges of alpha of width up to ")
    assert "[-1000, 1000]" in graph.proof.statements[2]
    assert "IEEE 754" in graph.proof.statements[3]
    with pytest.raises(InvalidInputError, match="outside"):
        graph.proof.count(2.0)
    with pytest.raises(InvalidInputError, match="alpha must be"):
        graph.proof.count("a")


def test_a_graph_with_a_branch_dropped_says_so():
    whole = explore(ARCH, (-0.5, 1.0), search=Everywhere())
    two = Switched(1, lambda z, t, sw: (z - 2 + t) * (z + 2 - t))
    proof = explore(two, (-1.0, 1.0), search=Everywhere()).proof
    part = trace(two, ([2.0], 0.0), (-1.0, 1.0))
    part.proof = proof
    assert "2 solutions proved in the box at alpha = 0, but 1 of them found" in part.guarantee
    assert "but" not in whole.guarantee


def test_a_graph_on_another_curve_says_so():
    """As many solutions as proved, but others: a branch that jumped."""
    one, other = (Switched(1, lambda z, t, sw, c=c: z - t - c) for c in (0.0, 1e-3))
    graph = explore(one, (-1.0, 1.0), search=Everywhere())
    wrong = explore(other, (-1.0, 1.0))
    wrong.proof = graph.proof
    assert graph.guarantee.startswith("complete in the box, proved; ")
    assert "1 solution proved in the box at alpha = 0" in wrong.guarantee


def test_a_graph_with_one_of_two_close_solutions_and_a_wrong_one_says_so():
    """Both proved solutions are near the right one that was found, and the numbers agree."""
    close, wrong = (
        Switched(1, lambda z, t, sw, far=far: z * (z - far) + 0 * t) for far in (5e-7, 1.0)
    )
    graph = explore(wrong, (-1.0, 1.0))
    box = Everywhere(box=(-2.0, 2.0))
    graph.proof = box.prove(close, Metric(np.array([1.0, 2.0]), (-1.0, 1.0)), (-1.0, 1.0))
    assert graph.proof.count(0.0) == graph.count(0.0) == 2
    assert graph.guarantee.startswith("not complete: 2 solutions proved in the box")


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
def test_units_do_not_hide_a_curve_that_jumped(unit):
    one, other = (
        Switched(1, lambda z, t, sw, c=c: z - unit * (2 + t + c), scale=unit) for c in (0.0, 1e-3)
    )
    graph = explore(one, (-1.0, 1.0), search=Everywhere())
    wrong = explore(other, (-1.0, 1.0))
    wrong.proof = graph.proof
    assert graph.guarantee.startswith("complete in the box, proved; ")
    assert "1 solution proved in the box at alpha = 0, but others found" in wrong.guarantee


@pytest.mark.slow
def test_everywhere_finds_a_loop_that_other_searches_miss():
    loop = Switched(1, lambda z, t, sw: sw.abs(z - 300) + 100 * (t - 0.123) ** 2 - 1e-4)
    graph = explore(loop, (-1.0, 1.0), search=Everywhere())
    assert graph.count(0.123) == graph.proof.count(0.123) == 2


def test_complementarity_is_traced():
    problem = Complementarity(lambda z, t: t + 1 - z**2, lower=0.0, upper=2.0, n=1)
    proof = explore(problem, (-0.5, 5.0), search=Everywhere(box=(-1.0, 5.0))).proof
    assert proof.holds
    assert [proof.count(t) for t in (0.0, 4.0)] == [3, 1]


def test_a_search_used_twice_proves_the_formula_as_it_is_now():
    square, search = [1.0], Everywhere(box=(-4.0, 4.0))
    system = Switched(1, lambda z, t, sw: z**2 - square[0] + 0.0 * t)
    assert explore(system, (-1.0, 1.0), search=search).proof.count(0.0) == 2
    square[0] = -1.0
    assert explore(system, (-1.0, 1.0), search=search).proof.count(0.0) == 0


def test_a_decision_hidden_from_the_tape_is_seen():
    def sly(z, t, sw):
        return z - t if z.dtype.kind == "O" else z - t + 1e-3

    with pytest.raises(InvalidInputError, match="decides by something"):
        explore(Switched(1, sly), (-1.0, 1.0), search=Everywhere())


def test_systems_without_a_formula_are_refused():
    with pytest.raises(InvalidInputError, match="hands over no formula"):
        explore(LCP([[2.0]], [0.0], [-1.0]), (-1.0, 1.0), search=Everywhere())


@pytest.mark.parametrize("box", [3.0, (1.0, 0.0), ([0.0, 0.0], [1.0, 1.0, 1.0]), (0.0, np.inf)])
def test_a_box_that_makes_no_sense_is_refused(box):
    with pytest.raises(InvalidInputError, match="box"):
        Everywhere(box=box)


@pytest.mark.slow
def test_nothing_is_imported_unless_asked_for():
    code = (
        "import sys\nfrom pwscont import LCP, explore\n"
        "explore(LCP([[2.0]], [0.0], [-1.0]), (-1.0, 1.0))\nprint('pwscont.proof' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False"]


def test_seconds_must_be_positive():
    with pytest.raises(InvalidInputError, match="seconds"):
        Everywhere(seconds=0.0)


def test_the_page_of_the_manual_says_what_is_true():
    names, answers = {}, 0
    for code in blocks("proofs.rst"):
        exec(compile(code, "proofs.rst", "exec"), names)
        answers += check_answers(code, names)
    assert answers == 6


def test_a_solution_of_zero_is_as_exact_as_the_branch_is_large():
    """z = alpha, whose solution at alpha = 0 is an event, known to 1e-17."""
    line = Switched(1, lambda z, a, sw: z - a)
    graph = explore(line, (-1.0, 1.0), events={"zero": lambda z, a: z[0]})
    assert graph.guarantee == "complete in the box, proved; balanced"


def test_a_graph_with_infinitely_many_solutions_by_rounding_is_not_proved():
    """The matrix is singular to rounding only: the doubles have two solutions at alpha = 0.5."""
    matrix = [
        [-0.9999999999999996, 2.0000000000000018, 6.851757162225668e-16],
        [-0.9999999999999991, 2.0, 0.999999999999998],
        [-1.0000000000000018, 1.9999999999999987, 0.9999999999999999],
    ]
    graph = explore(LCP(matrix, [-0.2, 0.0, 0.0], [1.0, 0.0, 0.0]), (-1.0, 1.0))
    proof, count = prove(graph), prove(graph, 0.5)
    assert count.count == 2
    assert proof.holds is proof.is_complete is (graph.count(0.5) == 2)
    assert count.holds is (graph.count(0.5) == 2)


# -- a search that is used again ------------------------------------------------------------------


def test_a_run_that_ends_before_its_search_has_no_proof_of_an_earlier_formula():
    stop = [5.0]
    law = Switched(
        1, lambda z, t, sw: z * (z - 1) * (z - 2) + stop[0] * sw.relu(z - 1) - t, scale=[1.0]
    )
    search, interval = Everywhere(), (-0.5, 1.0)
    assert explore(law, interval, search=search).proof.count(-0.3) == 1
    stop[0] = 0.0  # from now on three solutions
    cut = explore(law, interval, search=search, starts=[([0.0], 0.0)], limits=Limits(pieces=1))
    assert cut.proof is None
    assert explore(law, interval, search=search).proof.count(-0.3) == 3


# -- pieces that are stopped inside the box --------------------------------------------------------

#: H, and the number of solutions at each alpha in the box |z| <= 1000.
TO_INFINITY = {
    "both signs": (lambda z, t, sw: sw.abs(z) * (t - 0.3) - 0.05, lambda t: 2 if t > 0.3 else 0),
    "a pole": (lambda z, t, sw: z * (t - 0.3) - 0.05, lambda t: 1),
    "the pole at zero": (lambda z, t, sw: z * sw.abs(t) - 0.05, lambda t: 1),
    "another slope": (
        lambda z, t, sw: z * (t - 0.3) - 0.05 + 0.2 * sw.relu(z),
        lambda t: 2 if 0.1 < t < 0.3 else 1,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TO_INFINITY)
def test_a_piece_stopped_inside_the_box_is_named(name):
    H, number = TO_INFINITY[name]
    graph = explore(Switched(1, H), (-1.0, 1.0))
    assert not graph.is_complete
    words, _, rest = graph.guarantee.partition("elsewhere ")
    assert words.startswith("not complete: solutions that are proved are missing for alpha in (")
    assert rest.startswith("complete in the box, proved")
    gaps = [
        tuple(map(float, gap.split(", "))) for gap in re.findall(r"\(([^()]*, [^()]*)\)", words)
    ]
    for alpha in np.linspace(-1.0, 1.0, 2001) + 1.23e-4:
        if (proved := graph.proof.count(min(alpha, 1.0))) is None:
            continue
        inside = any(lo < alpha < hi for lo, hi in gaps)
        near = min(abs(alpha - pole) for pole in (0.0, 0.1, 0.3)) < 1e-4  # |z| may exceed 1000
        assert near or proved == number(alpha)
        assert inside == (graph.count(min(alpha, 1.0)) != proved)


def test_a_vertical_piece_where_a_number_is_counted_is_not_proved():
    flat = Switched(1, lambda z, t, sw: sw.relu(z) + sw.min(z + 1, 0) - t, linear=True)
    graph = explore(flat, (-1.0, 1.0))
    assert prove(graph).holds
    pieces = [replace(piece, det_sign=piece.det_sign or 1) for piece in graph.pieces]
    counted = BranchGraph(graph.nodes, pieces, graph.interval, system=graph.system)
    assert prove(counted).open[0].endswith("where a number is counted")


def test_a_solution_of_another_alpha_is_refused():
    found = enumerate_solutions(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), 0.0)
    found[0] = replace(found[0], alpha=0.5)
    with pytest.raises(InvalidInputError, match="is listed among those at alpha = 0"):
        prove(found)


def test_a_state_of_another_size_is_refused():
    found = enumerate_solutions(LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0]), 0.0)
    for strange in (replace(found[0], z=np.zeros(3)), found[0].z):
        found[0] = strange
        with pytest.raises(InvalidInputError, match=r"a Solution with z of shape \(2,\)"):
            prove(found)


@pytest.mark.parametrize("box", [(0.0, 2.0 * np.pi), (-1.0, 5.0), (3.3, 9.0), (-3.0, 3.0)])
def test_a_box_of_an_angle_may_lie_anywhere(box):
    """The angle is asin(t) or pi - asin(t), plus whole turns."""
    circle = Switched(1, lambda z, t, sw: np.sin(z) - t, periods=2.0 * np.pi)
    graph = explore(circle, (-0.5, 0.5), search=Everywhere(box=box))
    assert graph.guarantee.startswith("complete in the box, proved")
    one = np.arcsin(0.2) + 2.0 * np.pi * np.arange(-2, 3)
    angles = np.array([one, np.pi - one])
    assert graph.proof.count(0.2) == ((angles > box[0]) & (angles < box[1])).sum()


def test_a_box_of_an_angle_is_at_most_one_turn_wide():
    circle = Switched(1, lambda z, t, sw: np.sin(z) - t, periods=2.0 * np.pi)
    with pytest.raises(InvalidInputError, match="one period"):
        explore(circle, (-0.5, 0.5), search=Everywhere(box=(-10.0, 10.0)))
    bounded = Switched(1, lambda z, t, sw: np.sin(z) - t, periods=2.0 * np.pi, bounds=(-10.0, 10.0))
    assert explore(bounded, (-0.5, 0.5)).guarantee.startswith("complete in the box, proved")


def test_a_frictionless_piece_that_is_said_to_slip_the_other_way_is_not_proved():
    """Without friction both directions of slip have the same equations."""
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    graph = explore(CoulombLoad(body, AffineLoad([3.0, 0.0], [0.0, 1.0]), 0.0), (-1.0, 1.0))
    assert prove(graph).holds
    assert [piece.label for piece in graph.pieces] == ["slip-", "slip+"]
    for k, other in enumerate(reversed(graph.pieces)):
        pieces = list(graph.pieces)
        pieces[k] = replace(pieces[k], character=other.character)
        assert not prove(
            BranchGraph(graph.nodes, pieces, graph.interval, system=graph.system)
        ).holds
