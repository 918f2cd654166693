"""Every case of Janovsky and Ligursky (2012) against exact pieces, nodes and counts."""

import math
from collections import Counter

import numpy as np
import pytest
from paper_systems import CASES, REFERENCE, STRAIGHT, circle, sphere
from pwscont_coulomb.scenes import circular_path, periodic_path
from reference_enumeration import (
    det_sign,
    enumerate_solutions,
    exact_pieces,
    modes_of,
    solve_modes,
)

from pwscont import ExactLinear, PseudoArclength, explore

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

RUNS = [(name, PseudoArclength) for name in CASES] + [(name, ExactLinear) for name in STRAIGHT]
EXACT = 1e-9
PRINTED = 1.1e-7  # the reference rounds z to seven digits, and is off by one in the last


@pytest.fixture(scope="module", params=RUNS, ids=lambda run: f"{run[0]}-{run[1].__name__}")
def explored(request):
    name, stepper = request.param
    case = CASES[name]
    return case, explore(case.system, case.interval, stepper=stepper())


def regular_pieces(graph):
    return [piece for piece in graph.pieces if not piece.is_vertical]


def regular_alphas(case, count=57):
    """Return alphas well away from every transition of the reference."""
    lo, hi = case.interval
    breaks = {alpha for piece in case.reference["pieces"] for alpha in piece["alpha"]}
    tried = lo + (hi - lo) * (np.arange(count) + 0.5) / count
    return [a for a in tried if min(abs(a - b) for b in breaks) > 1e-6 * (hi - lo)]


def rising_ends(piece):
    """Return (alpha, z) at the lower and at the higher alpha of a piece."""
    order = slice(None) if piece.alpha[0] <= piece.alpha[-1] else slice(None, None, -1)
    return piece.alpha[order][[0, -1]], piece.z[order][[0, -1]]


def expected_piece(case, piece):
    """Return the one piece of the reference with the same modes and interval."""
    modes, (lo, hi) = modes_of(piece.label), piece.interval
    matches = [
        other
        for other in case.reference["pieces"]
        if tuple(other["modes"]) == modes
        and abs(other["alpha"][0] - lo) < EXACT
        and abs(other["alpha"][1] - hi) < EXACT
    ]
    assert len(matches) == 1, f"{modes} on ({lo}, {hi}) is no piece of the reference"
    return matches[0]


def test_reference_covers_the_cases():
    assert set(CASES) == set(REFERENCE)


def test_pieces_are_those_of_the_reference(explored):
    case, graph = explored
    pieces = regular_pieces(graph)
    found = {id(expected_piece(case, piece)) for piece in pieces}
    assert len(found) == len(pieces) == len(case.reference["pieces"])


def test_determinant_signs(explored):
    case, graph = explored
    for piece in regular_pieces(graph):
        assert piece.det_sign == expected_piece(case, piece)["det_sign"]
        middle = 0.5 * sum(piece.interval)
        assert piece.det_sign == det_sign(case.body, case.friction(middle), modes_of(piece.label))


def test_pieces_run_along_the_positive_orientation(explored):
    _, graph = explored
    for piece in regular_pieces(graph):
        assert np.sign(piece.alpha[-1] - piece.alpha[0]) == piece.det_sign


def test_states_at_the_ends_match_the_printed_digits(explored):
    case, graph = explored
    for piece in regular_pieces(graph):
        printed = expected_piece(case, piece)["z_at_ends"]
        np.testing.assert_allclose(rising_ends(piece)[1], printed, rtol=0, atol=PRINTED)


def test_states_along_pieces_match_an_independent_solve(explored):
    case, graph = explored
    for piece in regular_pieces(graph):
        for z, alpha in zip(piece.z, piece.alpha, strict=True):
            expected = solve_modes(
                case.body, case.load(alpha), case.friction(alpha), modes_of(piece.label)
            )
            np.testing.assert_allclose(z, expected, rtol=EXACT, atol=EXACT)


def merged(table):
    """Return rows (lo, hi, count), neighbours with one count put together."""
    rows = []
    for lo, hi, count in table:
        if rows and rows[-1][1:] == (lo, count):
            rows[-1] = (rows[-1][0], hi, count)
        else:
            rows.append((lo, hi, count))
    return rows


def test_multiplicity(explored):
    case, graph = explored
    # the reference leaves vertical pieces out
    expected = case.reference["solution_count"]
    table = merged(row for row in graph.multiplicity() if row[2] != np.inf)
    assert [row[2] for row in table] == [row[2] for row in expected]
    np.testing.assert_allclose(
        [row[:2] for row in table], [row[:2] for row in expected], rtol=0, atol=EXACT
    )


def test_balance_is_one_at_regular_alphas(explored):
    case, graph = explored
    alphas = regular_alphas(case)
    assert len(alphas) > 50
    assert {graph.balance(alpha) for alpha in alphas} == {1}
    assert graph.is_balanced()


def test_solutions_are_those_of_an_enumeration(explored):
    case, graph = explored
    for alpha in regular_alphas(case, 19):
        expected = enumerate_solutions(case.body, case.load(alpha), case.friction(alpha))
        by_modes = {solution.modes: solution for solution in expected}
        found = graph.solutions(alpha)
        assert len(found) == graph.count(alpha) == len(expected)
        for solution in found:
            match = by_modes.pop(modes_of(solution.label))
            np.testing.assert_allclose(solution.z, match.z, rtol=EXACT, atol=EXACT)
            assert solution.det_sign == match.det_sign


def same_place(end, place):
    close_alpha = abs(end[0] - place[0]) < EXACT
    return close_alpha and np.abs(np.subtract(end[1], place[1])).max() < 2 * PRINTED


def expected_nodes(case):
    """Return (kind, alpha) of every node, from which reference pieces meet where.

    The determinant changes sign exactly where alpha turns. At a vertical piece, which the
    reference leaves out, its two ends are separate nodes with one regular piece each.
    """
    places, (lo, hi) = [], case.interval
    for piece in case.reference["pieces"]:
        for end in zip(piece["alpha"], piece["z_at_ends"], strict=True):
            place = next((known for known in places if same_place(end, known)), None)
            if place is None:
                places.append((*end, [piece["det_sign"]]))
            else:
                place[2].append(piece["det_sign"])
    for alpha, _, signs in places:
        if alpha in (lo, hi):
            yield "end", alpha
        else:
            yield ("nonsmooth fold" if sum(signs) == 0 else "transition"), alpha


def test_kinds_of_nodes(explored):
    case, graph = explored
    expected = sorted(expected_nodes(case))
    found = sorted(
        # the search starts at ends of the interval: such a point is a start and an end
        ("end" if point.kind == "start" else str(point.kind), point.alpha)
        for point in graph.special_points()
    )
    assert [kind for kind, _ in found] == [kind for kind, _ in expected]
    np.testing.assert_allclose(
        [alpha for _, alpha in found], [alpha for _, alpha in expected], rtol=0, atol=EXACT
    )


def test_nonsmooth_folds_are_where_alpha_turns(explored):
    _, graph = explored
    turns = Counter(
        point.id
        for point in graph.special_points()
        if point.kind != "end" and _both_on_one_side(graph, point)
    )
    assert set(turns) == {point.id for point in graph.special_points("nonsmooth fold")}


def _both_on_one_side(graph, point):
    pieces = graph.pieces_at(point.id)
    sides = {np.sign(p.alpha.mean() - point.alpha) for p in pieces if p.det_sign}
    return len(pieces) == 2 and len(sides) == 1 and all(p.det_sign for p in pieces)


@pytest.mark.parametrize("name", STRAIGHT)
@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arc"])
def test_straight_cases_against_rational_arithmetic(name, stepper):
    case = CASES[name]
    graph = explore(case.system, case.interval, stepper=stepper)
    expected = exact_pieces(case.body, case.load.f0, case.load.f1, 4.0, case.interval)
    found = sorted((modes_of(p.label), p.det_sign, p.interval) for p in graph.pieces)
    exact = sorted((p.modes, p.det_sign, (float(p.lo), float(p.hi))) for p in expected)
    assert [row[:2] for row in found] == [row[:2] for row in exact]
    np.testing.assert_allclose(
        [row[2] for row in found], [row[2] for row in exact], rtol=1e-13, atol=1e-13
    )


def test_vertical_pieces_of_fig12():
    """At F = a/b the slip piece has one alpha: from the stick point to the free point."""
    case = CASES["fig12"]
    graph = explore(case.system, case.interval)
    vertical = [piece for piece in graph.pieces if piece.is_vertical]
    places = [piece["alpha"][1] for piece in case.reference["pieces"][:2]]
    assert len(vertical) == 2
    np.testing.assert_allclose(
        sorted(piece.alpha[0] for piece in vertical), sorted(places), rtol=0, atol=EXACT
    )
    for piece in vertical:
        assert piece.label == "slip-"
        assert piece.det_sign == 0
        assert np.ptp(piece.alpha) < EXACT
        alpha = piece.alpha[0]
        assert graph.count(alpha) == math.inf
        f_nu, f_t = case.load(alpha)
        assert f_t == pytest.approx(-2.0 * f_nu, abs=EXACT)  # the load is at the cone's edge
        ends = sorted(piece.z[[0, -1]].tolist(), key=lambda z: z[1])
        free, stuck = [0.0, -f_nu, 0.0, 0.0], [0.0, 0.0, -f_nu, -f_t]
        np.testing.assert_allclose(ends, [free, stuck], rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", [name for name in CASES if name != "fig12"])
def test_only_fig12_has_vertical_pieces(name):
    case = CASES[name]
    graph = explore(case.system, case.interval)
    assert not any(piece.is_vertical for piece in graph.pieces)


@pytest.mark.parametrize(("load", "paper"), [(circular_path(), circle), (periodic_path(), sphere)])
def test_harmonic_loads_are_the_papers_and_know_their_derivatives(load, paper):
    for alpha in np.linspace(-7.0, 7.0, 29):
        np.testing.assert_allclose(load(alpha), paper(alpha), rtol=0, atol=1e-14)
        change = (paper(alpha + 1e-5) - paper(alpha - 1e-5)) / 2e-5
        np.testing.assert_allclose(load.derivative(alpha), change, rtol=0, atol=1e-8)
