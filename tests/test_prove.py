"""Counts of linear pieces at one alpha, with a certificate for every cell."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import random_bodies
import reference_enumeration
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.scenes import example3, fig7
from rational import integer_family, number_of_solutions
from sweeps import swept

import pwscont.proof.cells
from pwscont import (
    LCP,
    BranchGraph,
    InvalidInputError,
    Switched,
    SystemNeededError,
    enumerate_solutions,
    explore,
    prove,
    trace,
)
from pwscont.extending import ExactMode, Kind
from pwscont.graph.records import Place
from pwscont.proof.cells import ExactCells, ends_of, segment_of
from pwscont.proof.interval import Interval
from pwscont.proof.prove import certified_pieces, proved_solutions
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


@pytest.mark.parametrize("seeds", swept([range(8)], [range(8, 600)]))
def test_integer_problems_agree_with_rational_enumeration(seeds):
    """Singular and tied: what is proved is right, and infinitely many are never a number."""
    proved = 0
    for seed in seeds:
        M, q, d, e = integer_family(np.random.default_rng(seed))
        for alpha in (Fraction(-1), Fraction(0), Fraction(1, 2)):
            truth = number_of_solutions(M, q, d, e, alpha, Fraction(0))
            cells = ExactCells(*LCP(M, q, d).exact_rows(float(alpha)))
            boxes, points, undecided = proved_solutions(cells, float(alpha))
            if not undecided:
                proved += 1
                assert truth in (None, len(boxes) + len(points))
            assert undecided or truth != math.inf
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
    said = "exactly 3 solutions at alpha = 0, proved; the 2 given are not these"
    assert (proof.holds, proof.statements[0]) == (False, said)
    twice = Solutions([whole[0], whole[0], whole[1]], whole.guarantee, whole.system, whole.alpha)
    assert not prove(twice).holds
    for by in (1e-6, 1e-12):
        moved = [replace(whole[0], z=whole[0].z + by), *whole[1:]]
        assert not prove(Solutions(moved, whole.guarantee, whole.system, whole.alpha)).holds


def test_data_moved_by_rounding_across_a_kink_moves_the_count():
    """min(z, z - q) = 0 with z >= 0: z = q, or z = 0 if q <= 0; tied at q = 0."""
    game = Switched(1, lambda z, t, sw: sw.abs(z) - t, linear=True)
    counts = [prove(enumerate_solutions(game, t)).count for t in (-5e-324, 0.0, 5e-324, 1e-12)]
    assert counts == [0, 1, 2, 2]


@pytest.mark.parametrize("off", [5.0, -1e-6, np.nan, np.inf])
def test_what_is_no_solution_is_not_proved_beside_solutions_that_are_close(off):
    close = LCP([[1, 0, 0], [0, 1, 2], [0, 2, 1]], q=[-1, -1e-9, -1e-9], d=[0, 0, 0])
    known = enumerate_solutions(close, 0.0)  # three, within 1e-9
    assert prove(known).holds
    wrong = [known[0], known[1], replace(known[2], z=known[2].z + off)]
    assert not prove(Solutions(wrong, "complete", close, 0.0)).holds


@pytest.mark.parametrize("some", [(0, 0, 1), (0, 1, 1), (2, 2, 2), (1, 0, 0)])
def test_a_solution_listed_twice_instead_of_a_close_one_is_not_proved(some):
    close = LCP([[1, 0, 0], [0, 1, 2], [0, 2, 1]], q=[-1, -1e-9, -1e-9], d=[0, 0, 0])
    known = enumerate_solutions(close, 0.0)
    assert prove(Solutions(known[::-1], "complete", close, 0.0)).holds
    assert not prove(Solutions([known[k] for k in some], "complete", close, 0.0)).holds


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
        cells = ExactCells(*system.exact_rows(0.0))
        for choice, box in proved_solutions(cells, 0.0)[0].items():
            point, _ = segment_of(*cells.of(choice), (0.0, 0.0))
            bad += escaped(box, point[:-1]) > 0
    return bad


def escaped(found, exact):
    """Return how many exact numbers are outside of intervals."""
    triples = zip(found.lo.ravel().tolist(), found.hi.ravel().tolist(), exact, strict=True)
    return sum(not Fraction(lo) <= x <= Fraction(hi) for lo, hi, x in triples)


def narrowed(found, part):
    """Return intervals with a part of the width around the middle."""
    far = 0.5 * part * found.width()
    return Interval(found.middle() - far, found.middle() + far)


def test_enclosures_hold_the_rational_solutions():
    assert bad_boxes(12) == 0


def test_enclosures_that_are_too_narrow_are_caught(monkeypatch):
    solved = pwscont.proof.cells.solved

    monkeypatch.setattr(pwscont.proof.cells, "solved", lambda *args: narrowed(solved(*args), 1e-6))
    assert bad_boxes(12) > 0


def exact_rows(matrix, x, right):
    """Return matrix x + right in rational numbers."""
    A, b, c = ([[Fraction(v) for v in row] for row in each.tolist()] for each in (matrix, x, right))
    return [
        sum(row[k] * b[k][j] for k in range(len(b))) + c[i][j]
        for i, row in enumerate(A)
        for j in range(len(b[0]))
    ]


@pytest.mark.parametrize("is_exact", [True, False])
def test_products_of_matrices_hold_exact_products(is_exact):
    """Of all magnitudes, with and without cancellation; without a width results are lost."""
    lost = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        matrix = rng.normal(size=(6, 5)) * 2.0 ** rng.integers(-60, 60, size=(6, 5))
        x = rng.normal(size=(5, 2)) * 2.0 ** rng.integers(-60, 60, size=(5, 2))
        right = -(matrix @ x) if seed % 2 else rng.normal(size=(6, 2))
        near = matrix * (1.0 + 1e-12 * rng.uniform(-1.0, 1.0, matrix.shape))
        far = 1.1e-12 * np.abs(matrix)
        known = Interval(matrix) if is_exact else Interval(near - far, near + far)
        truth = exact_rows(matrix, x, right)
        found = known @ Interval(x) + right
        assert escaped(found, truth) == 0
        lost += escaped(narrowed(found, 1e-3), truth)
    assert lost > 0


def test_products_of_the_largest_and_the_smallest_numbers_hold_exact_products():
    """A bound on the rounding of the smallest numbers is itself smaller than any number."""
    rng = np.random.default_rng(5)
    for power in (900, 1000, 1020):
        matrix = rng.normal(size=(5, 4)) * 2.0**power
        x = rng.normal(size=(4, 3)) * 2.0 ** rng.integers(-1070, -1000, size=(4, 3))
        matrix[:, 2:], x[2:] = -matrix[:, :2] * (1.0 + 2.0**-40), x[:2]  # terms cancel
        found = Interval(matrix) @ Interval(x)
        assert escaped(found, exact_rows(matrix, x, np.zeros((5, 3)))) == 0


def exact_range(sides, interval):
    """Return from where to where rows (slope, constant) are not negative, None for nowhere."""
    first, last = map(Fraction, interval)
    for slope, constant in ((Fraction(a), Fraction(b)) for a, b in sides.tolist()):
        if slope:
            root = -constant / slope
            first, last = (max(first, root), last) if slope > 0 else (first, min(last, root))
        elif constant < 0:
            return None
    return (first, last) if first <= last else None


def judged_cells(seeds):
    """Return how many cells of random rows, many tied, are wrongly called empty, and empty."""
    empty = wrong = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        whole, interval = rng.integers(-2, 3, size=(30, 4, 2)).astype(float), (-1.0, 1.0)
        sides = whole if seed % 2 else whole + 1e-3 * rng.normal(size=whole.shape)
        far = 10.0 ** -rng.uniform(1.0, 16.0) * np.abs(sides) * (seed % 3)
        _, is_empty = ends_of(Interval(sides - far, sides + far), interval)
        empty += is_empty.sum()
        wrong += sum(exact_range(rows, interval) is not None for rows in sides[is_empty])
    return wrong, empty


def test_cells_that_are_called_empty_are_empty_in_rational_numbers():
    wrong, empty = judged_cells(range(60))
    assert wrong == 0
    assert empty > 500


def test_roots_without_their_width_are_caught(monkeypatch):
    division = Interval.__truediv__
    thin = lambda x, y: Interval(division(x, y).middle())  # noqa: E731
    monkeypatch.setattr(Interval, "__truediv__", thin)
    assert judged_cells(range(60))[0] > 0


# -- pieces and transitions ------------------------------------------------------------------------


def test_the_pieces_of_the_paper_are_proved():
    proof = prove(explore(fig7().system, (-2.0, 2.0)))
    assert proof.holds
    assert proof.is_complete
    assert proof.statements[0] == "complete, proved: 4 pieces and 3 transitions"
    assert prove(explore(GAME, (-1.0, 2.0))).statements[0].startswith("complete, proved: 3 pieces")


def random_graph(p, seed, scale=1.0):
    body = random_bodies.random_body(p, seed, gap=seed % 2 == 1)
    load = random_bodies.load_with_several_solutions(body, 4.0, seed)
    slope = np.random.default_rng(seed).normal(size=len(load))
    system = CoulombLoad(random_bodies.contact_body(body), AffineLoad(load, scale * slope), 4.0)
    return explore(system, (-1.0, 1.0))


@pytest.mark.parametrize(
    ("p", "seeds"),
    swept([(1, range(6)), (2, range(6)), (3, range(3))], [(3, range(3, 40)), (4, range(12))]),
)
@pytest.mark.sweep(3)
def test_random_paths_are_proved_complete(p, seeds):
    for seed in seeds:
        graph = random_graph(p, seed)
        assert prove(graph).is_complete
        for lo, hi, count in graph.multiplicity():
            assert prove(graph, 0.5 * (lo + hi)).count == count


def test_many_pieces_are_proved_without_a_word_on_other_solutions():
    body = random_bodies.random_body(14, 1)
    loads = [random_bodies.random_vector(body.n, seed) for seed in (1, 2)]
    system = CoulombLoad(random_bodies.contact_body(body), AffineLoad(*loads), 0.5)
    graph = trace(system, (np.zeros(system.size), 0.0), (-3.0, 3.0))
    proof = prove(graph)
    n = len(graph.pieces)
    assert proof.statements[0] == (
        f"{n} pieces and {n - 1} transitions, proved; of other solutions nothing is proved: "
        "too many cells"
    )
    assert not proof.is_complete


def test_a_graph_with_a_branch_dropped_is_not_complete():
    """Seed 1 has two branches: each is proved, and is not all."""
    graph = random_graph(1, 1)
    first = graph.components()[0]
    point = first[0].points[1]
    part = trace(graph.system, (point[:-1], point[-1]), graph.interval)
    assert 0 < len(part.pieces) < len(graph.pieces)
    proof = prove(part)
    assert proof.holds
    assert not proof.is_complete
    assert proof.statements[0].endswith(" undecided")


def test_a_branch_that_is_listed_twice_is_not_proved():
    graph = explore(GAME, (-1.0, 2.0))
    nodes, pieces = graph.nodes, graph.pieces
    more = [replace(node, id=node.id + len(nodes)) for node in nodes]
    again = [
        replace(p, id=p.id + len(pieces), start=p.start + len(nodes), end=p.end + len(nodes))
        for p in pieces
    ]
    twice = BranchGraph([*nodes, *more], [*pieces, *again], graph.interval, system=GAME)
    assert twice.count(0.0) == 6
    assert not prove(twice).holds


def moved(graph, index, part):
    """Return a graph with the special point at the end of a piece moved along alpha."""
    pieces = list(graph.pieces)
    points = pieces[index].points.copy()
    points[-1] += part * (points[-1] - points[0])
    pieces[index] = replace(pieces[index], points=points)
    return BranchGraph(graph.special_points(), pieces, graph.interval, system=graph.system)


@pytest.mark.parametrize("name", ["fig7", "two ways", "vertical pieces"])
def test_a_curve_that_jumped_is_not_proved(name):
    """The right cells and the right alphas, but other solutions there."""
    system = fig7().system if name == "fig7" else CORNERS[name][0]
    graph = explore(system, (-1.5, 1.5))
    for k, piece in enumerate(graph.pieces):
        points = piece.points.copy()
        points[:, 0] += 1e-10 * (1.0 + np.abs(points[:, 0]))
        pieces = [*graph.pieces[:k], replace(piece, points=points), *graph.pieces[k + 1 :]]
        assert not prove(BranchGraph(graph.nodes, pieces, graph.interval, system=system)).holds


def doctored(graph):
    """Yield graphs with other points between, cells, places or special points."""
    (first, *others), nodes = graph.pieces, graph.nodes
    lo, hi = first.points
    for between in ([0.5 * (lo + hi) + 1.0], [0.3 * lo + 0.7 * hi, 0.7 * lo + 0.3 * hi]):
        yield [replace(first, points=np.array([lo, *between, hi])), *others], nodes
    yield [replace(first, character=first.character.flip(0)), *others], nodes
    for k, node in enumerate(nodes):
        for off in (1.0, 1e-10):
            places = [Place(node.place.x + off * row, node.place.error) for row in np.eye(len(lo))]
            for place in (places[0], places[-1]):
                yield graph.pieces, [*nodes[:k], replace(node, place=place), *nodes[k + 1 :]]
                yield graph.pieces, [*nodes, replace(node, place=place, id=len(nodes))]


@pytest.mark.parametrize("name", ["fig7", "two ways", "vertical pieces"])
@pytest.mark.sweep(2)
def test_what_a_graph_says_beside_the_ends_of_pieces_is_proved_too(name):
    graph = explore(fig7().system if name == "fig7" else CORNERS[name][0], (-1.5, 1.5))
    for pieces, nodes in doctored(graph):
        wrong = BranchGraph(nodes, pieces, graph.interval, system=graph.system)
        assert not prove(wrong).holds


def test_a_piece_that_ends_at_a_wrong_place_is_not_proved():
    graph = explore(fig7().system, (-2.0, 2.0))
    for part in (-1e-4, 1e-4, -1e-10, 1e-10):
        proof = prove(moved(graph, 1, part))
        assert not proof.holds
        assert proof.open


def test_a_kink_just_before_the_end_of_the_interval_is_not_passed_over():
    """The last piece is narrower than any tolerance, and is missing."""
    near = 1.0 - 2.0**-30
    bent = Switched(1, lambda z, t, sw: z - sw.max(t - near, 0.0), linear=True)
    graph = trace(bent, ([0.0], 0.0), (-1.0, 1.0))
    assert len(graph.pieces) == 2
    assert prove(graph).is_complete
    one = Switched(1, lambda z, t, sw: z - sw.max(t - 2.0, 0.0), linear=True)
    short = trace(one, ([0.0], 0.0), (-1.0, 1.0))
    wrong = BranchGraph(short.nodes, short.pieces, short.interval, system=bent)
    assert prove(short).is_complete
    assert not prove(wrong).holds


FLAT = Switched(
    1, lambda z, t, sw: sw.clip(z, -1, 1) - sw.max(z - 2, 0) - 2 * sw.min(z + 2, 0) - t, linear=True
)
CORNERS = {
    "two ways": (LCP(np.eye(2), np.zeros(2), [-1.0, -1.0]), "2 pieces and 1 transition"),
    "four ways": (LCP([[1, 2], [2, 1]], np.zeros(2), [-1, -1]), "4 pieces and 1 transition"),
    "vertical pieces": (FLAT, "5 pieces and 4 transitions"),
}


@pytest.mark.parametrize("name", CORNERS)
def test_corners_and_vertical_pieces_are_proved_in_rational_numbers(name):
    system, words = CORNERS[name]
    graph = explore(system, (-1.5, 1.5))
    assert prove(graph).statements[0] == f"complete, proved: {words}"
    for k in range(len(graph.pieces)):
        assert not prove(moved(graph, k, 1e-10)).holds


def test_a_corner_with_a_way_dropped_is_not_complete():
    graph = explore(CORNERS["four ways"][0], (-1.5, 1.5))
    for k in range(4):
        pieces = [p for p in graph.pieces if p.id != k]
        proof = prove(BranchGraph(graph.nodes, pieces, graph.interval, system=graph.system))
        assert not proof.is_complete


RAYS = {
    "of a formula": Switched(1, lambda z, t, sw: sw.relu(z) - t, linear=True),
    "of an LCP": LCP([[0.0]], q=[0.0], d=[1.0]),
}


@pytest.mark.parametrize("name", RAYS)
def test_rays_without_end_are_proved_where_the_graph_has_infinitely_many_solutions(name):
    graph = explore(RAYS[name], (-1.0, 1.0))
    words = "complete, proved: 1 piece and 0 transitions; solutions without end at alpha = 0"
    assert prove(graph).statements[0] == words
    nodes = [replace(node, kind=Kind.TRANSITION) for node in graph.nodes]
    finite = BranchGraph(nodes, graph.pieces, graph.interval, system=graph.system)
    assert finite.count(0.0) != math.inf
    assert prove(finite).open[0].startswith("special point")


def test_a_piece_that_ends_where_no_ray_begins_is_not_proved():
    graph = explore(CORNERS["vertical pieces"][0], (-1.5, 1.5))
    for piece in graph.pieces:
        part = BranchGraph(graph.nodes, [piece], graph.interval, system=graph.system)
        assert not prove(part).holds


def test_an_area_of_solutions_stays_undecided():
    area = LCP(np.zeros((2, 2)), q=[0.0, 0.0], d=[1.0, 1.0])
    assert prove(explore(area, (-1.0, 1.0))).open == ["cell (1, 1)"]


def test_a_system_without_a_switch_is_proved():
    line = Switched(2, lambda z, t, sw: np.array([z[0] - t, z[1] + z[0]]), linear=True)
    graph = explore(line, (-1.0, 1.0))
    assert prove(graph).is_complete
    assert prove(graph, 0.5).count == 1


def test_a_graph_of_a_body_with_other_friction_is_not_proved():
    """The fold moves by 1e-13."""
    body = ContactBody([[2.0, -1.0], [-1.0, 2.0]], [[1.0, 0.0]], [[0.0, 1.0]])
    load = AffineLoad([1.0, 3.0], [0.0, -8.0])
    graph, other = explore(CoulombLoad(body, load, 4.0), (-1.0, 1.0)), 4.0 + 1e-12
    moved = CoulombLoad(body, load, other)
    assert prove(graph).is_complete
    wrong = BranchGraph(graph.nodes, graph.pieces, graph.interval, system=moved)
    assert not prove(wrong).holds


def test_transitions_that_only_look_alike_are_not_joined(monkeypatch):
    """The rows of a neighbour moved by 1e-12: the pieces no longer end in one point."""
    graph = explore(fig7().system, (-2.0, 2.0))
    common, parts = graph.system.exact_lines()
    slip = parts[0][3]
    rows = slip.equations.copy()
    rows[0, -1] += 1e-12
    wrong = [[*parts[0][:3], ExactMode(rows, slip.sides)]]
    assert certified_pieces(graph, (common, parts)).holds
    assert not certified_pieces(graph, (common, wrong)).holds


def test_a_graph_that_was_read_without_its_system_is_refused(tmp_path):
    explore(GAME, (-1.0, 2.0)).save(tmp_path / "game")
    with pytest.raises(SystemNeededError, match="without its system"):
        prove(BranchGraph.load(tmp_path / "game"))
    assert prove(BranchGraph.load(tmp_path / "game", system=GAME)).is_complete


def test_what_prove_refuses():
    curved = Switched(1, lambda z, t, sw: z**2 - t)
    with pytest.raises(InvalidInputError, match="no exact data"):
        prove(explore(curved, (0.5, 1.0)), 0.7)
    with pytest.raises(InvalidInputError, match="needs the alpha"):
        prove(explore(example3().system, (0.0, 5.0)))
    with pytest.raises(InvalidInputError, match="prove takes"):
        prove([1, 2])
    with pytest.raises(InvalidInputError, match="but the solutions are at 0"):
        prove(enumerate_solutions(GAME, 0.0), 0.5)
    wide = LCP(np.eye(20), np.ones(20), np.ones(20))
    with pytest.raises(InvalidInputError, match="too many"):
        prove(enumerate_solutions(wide, 0.0))
