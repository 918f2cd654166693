"""Counts of linear pieces at one alpha, with a certificate for every cell."""

import math
from fractions import Fraction

import numpy as np
import pytest
import random_bodies
import reference_enumeration
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.scenes import example3, fig7
from rational import integer_family, number_of_solutions
from sweeps import swept

import pwscont.proof.cells
from pwscont import (
    LCP,
    InvalidInputError,
    Switched,
    enumerate_solutions,
    explore,
    prove,
)
from pwscont.proof.cells import proved_cells
from pwscont.search.enumeration import Solutions

GAME = LCP([[1, 2], [2, 1]], q=[-1, -1], d=[1, 0])


def test_three_solutions_of_the_paper_are_proved():
    graph = explore(fig7().system, (-2.0, 2.0))
    proof = prove(graph, -0.75)
    assert proof.holds
    assert proof.statements[0] == "exactly 3 solutions at alpha = -0.75, proved"
    assert [prove(graph, alpha).count for alpha in (-1.5, -0.75, 0.5)] == [1, 3, 1]


def test_doubles_move_a_fold_by_rounding():
    """0.4 is no double: the fold of Example 3 is not at 3.5 but beside 3.5."""
    graph = explore(example3().system, (0.0, 5.0))
    assert [prove(graph, F).count for F in (3.0, 3.5, 4.0)] == [3, 5, 5]


@pytest.mark.parametrize("seeds", swept([range(25)], [range(25, 600)]))
def test_integer_problems_agree_with_rational_enumeration(seeds):
    """Singular and tied: what is proved is right, and infinitely many are never a number."""
    proved = 0
    for seed in seeds:
        M, q, d, e = integer_family(np.random.default_rng(seed))
        for alpha in (Fraction(-1), Fraction(0), Fraction(1, 2)):
            truth = number_of_solutions(M, q, d, e, alpha, Fraction(0))
            cells = proved_cells(*LCP(M, q, d).exact_rows(float(alpha)), float(alpha))
            if not cells.open:
                proved += 1
                count = len(cells.boxes) + len(cells.points)
                assert truth in (None, count)
            assert cells.open or truth != math.inf
    assert proved > 2 * len(seeds)


@pytest.mark.parametrize(
    ("p", "seeds"),
    swept([(1, range(10)), (2, range(6)), (3, range(2))], [(3, range(2, 20)), (4, range(3))]),
)
def test_random_bodies_agree_with_an_independent_enumeration(p, seeds):
    for seed in seeds:
        body = random_bodies.random_body(p, seed, gap=seed % 2 == 1)
        load = random_bodies.load_with_several_solutions(body, 4.0, seed)
        system = CoulombLoad(
            random_bodies.contact_body(body), AffineLoad(load, 0.0 * load + 1.0), 4.0
        )
        found = enumerate_solutions(system, 0.0)
        proof = prove(found)
        assert proof.holds
        assert proof.count == len(reference_enumeration.enumerate_solutions(body, load, 4.0))


def test_a_solution_dropped_is_not_proved():
    whole = enumerate_solutions(GAME, 0.0)
    assert prove(whole).holds
    part = Solutions(whole[1:], whole.guarantee, whole.system, whole.alpha)
    proof = prove(part)
    assert not proof.holds
    assert (
        proof.statements[0] == "exactly 3 solutions at alpha = 0, proved; the 2 given are not these"
    )
    twice = Solutions([whole[0], whole[0], whole[1]], whole.guarantee, whole.system, whole.alpha)
    assert not prove(twice).holds


def test_data_moved_by_rounding_across_a_kink_moves_the_count():
    """min(z, z - q) = 0 with z >= 0: z = q, or z = 0 if q <= 0; tied at q = 0."""
    game = Switched(1, lambda z, t, sw: sw.abs(z) - t, linear=True)
    counts = [prove(enumerate_solutions(game, t)).count for t in (-5e-324, 0.0, 5e-324, 1e-12)]
    assert counts == [0, 1, 2, 2]


def test_infinitely_many_solutions_are_not_proved():
    flat = Switched(1, lambda z, t, sw: sw.relu(z) - t, linear=True)
    proof = prove(enumerate_solutions(flat, 0.0))
    assert not proof.holds
    assert proof.count is None
    assert proof.statements[0] == "not proved: 1 cell undecided at alpha = 0"


def bad_boxes(count):
    """Return how many enclosures of random bodies do not hold the rational solution."""
    bad = 0
    for seed in range(count):
        body = random_bodies.random_body(2, seed)
        load = random_bodies.random_vector(body.n, seed)
        system = CoulombLoad(random_bodies.contact_body(body), AffineLoad(load, load), 2.0)
        common, parts = system.exact_rows(0.0)
        for choice, (x, r) in proved_cells(common, parts, 0.0).boxes.items():
            exact = pwscont.proof.cells.ProvedCells()
            pwscont.proof.cells._in_rationals(common, parts, 0.0, choice, exact)
            (point,) = exact.points
            pairs = zip(point, x, r, strict=True)
            bad += any(abs(v - Fraction(float(a))) > Fraction(float(b)) for v, a, b in pairs)
    return bad


def test_enclosures_hold_the_rational_solutions():
    assert bad_boxes(12) == 0


def test_enclosures_that_are_too_narrow_are_caught(monkeypatch):
    solved = pwscont.proof.cells._solved

    def narrow(*args):
        x, radius = solved(*args)
        return x, 1e-6 * radius

    monkeypatch.setattr(pwscont.proof.cells, "_solved", narrow)
    assert bad_boxes(12) > 0


def test_what_prove_refuses():
    curved = Switched(1, lambda z, t, sw: z**2 - t)
    with pytest.raises(InvalidInputError, match="no exact data"):
        prove(explore(curved, (0.5, 1.0)), 0.7)
    with pytest.raises(InvalidInputError, match="needs the alpha"):
        prove(explore(GAME, (-1.0, 1.0)))
    with pytest.raises(InvalidInputError, match="prove takes"):
        prove([1, 2])
    wide = LCP(np.eye(20), np.ones(20), np.ones(20))
    with pytest.raises(InvalidInputError, match="too many"):
        prove(enumerate_solutions(wide, 0.0))
