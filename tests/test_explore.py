"""Every component: against brute force, closed loops in closed form, what searches promise."""

import numpy as np
import pytest
from closed_loops import Diamond, DiamondAndLine
from paper_systems import CASES, ONE_NODE
from pwscont_coulomb import AffineLoad, CoulombFriction, CoulombLoad, FromFrictionless
from random_bodies import contact_body, load_with_several_solutions, random_body, random_vector
from reference_enumeration import enumerate_solutions as brute_force
from reference_enumeration import modes_of, slacks
from searches import Nothing
from sweeps import swept

from pwscont import (
    AllTransitions,
    BranchGraph,
    EndPoints,
    MultiStart,
    PiecewiseSystem,
    Slices,
    Switched,
    explore,
)
from pwscont.basics.errors import InvalidInputError
from pwscont.search import Search

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

BUT_LOOPS = "complete but for closed loops"


# -- random bodies -------------------------------------------------------------------------------


def random_system(p, seed):
    body = random_body(p, seed, inner=seed % 2, gap=seed % 3 == 0)
    friction = (0.3, 1.0, 3.0, 8.0)[seed % 4]
    size = 1.0 + 4.0 * (seed % 2)
    load = AffineLoad(size * random_vector(body.n, seed), random_vector(body.n, [seed, 1]))
    return body, friction, CoulombLoad(contact_body(body), load, friction)


def assert_same(found, expected, modes):
    """The same cells, each once, with the same signs and z."""
    by_modes = {modes_of(solution.label): solution for solution in found}
    assert len(found) == len(by_modes) == len(expected)
    for one in expected:
        solution = by_modes[modes(one)]
        size = 1e-9 * np.abs(one.z).max()
        np.testing.assert_allclose(solution.z, one.z, rtol=1e-9, atol=size)
        assert solution.det_sign == one.det_sign


@pytest.mark.parametrize(
    ("p", "bodies"),
    swept(
        [(3, 5)],
        [(2, 20), (1, 30), (4, 2), (1, 120), (2, 100), (3, 50), (4, 30)],
    ),
)
def test_random_bodies(p, bodies):
    numbers, components = [], []
    for seed in range(bodies):
        body, friction, system = random_system(p, seed)
        graph = explore(system, (-10.0, 10.0))
        assert graph.is_balanced()
        assert graph.guarantee == "complete"
        components.append(len(graph.components()))
        rng = np.random.default_rng(seed)
        for alpha in rng.uniform(-10.0, 10.0, 50):
            expected = brute_force(body, system.load(alpha), friction)
            if min(one.margin for one in expected) < 1e-8:
                continue
            assert_same(graph.solutions(alpha), expected, lambda found: found.modes)
            numbers.append(len(expected))
    if bodies > 2:  # enough to meet some of them
        assert max(numbers) > 1
        assert max(components) > 1


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("everywhere", [True, False])
@pytest.mark.sweep(8)
def test_nodes_without_friction(p, everywhere):
    """Their tests kappa2 and kappa3 are one function: the cell of stick has no inside."""
    for seed in range(20):
        body, friction, system = random_system(p, seed)
        friction = np.zeros(p) if everywhere else np.where(np.arange(p) == seed % p, 0.0, friction)
        graph = explore(CoulombLoad(system.body, system.load, friction), (-10.0, 10.0))
        assert graph.is_balanced()
        assert graph.guarantee == "complete"
        for alpha in np.random.default_rng(seed).uniform(-10.0, 10.0, 5):
            expected = brute_force(body, system.load(alpha), friction)
            assert len(expected) == 1 or not everywhere
            assert_same(graph.solutions(alpha), expected, lambda found: found.modes)


# -- closed loops --------------------------------------------------------------------------------


def loops(graph):
    """Return the components that reach no end of the interval."""
    kinds = {
        c: {graph.point(node).kind for piece in pieces for node in (piece.start, piece.end)}
        for c, pieces in enumerate(graph.components())
    }
    return [graph.components()[c] for c, found in kinds.items() if not found & {"start", "end"}]


FINDS_THE_DIAMOND = {
    "default": None,
    "transitions": AllTransitions(),
    "slice": Slices((0.3,)),
    "slice at the corner": Slices((0.0,)),
    "everything": EndPoints() + Slices((-0.9, -0.2, 0.0, 0.3)) + AllTransitions(),
    "everything else": AllTransitions() + Slices((0.3, -0.5)) + EndPoints(),
}


@pytest.mark.parametrize("search", FINDS_THE_DIAMOND.values(), ids=FINDS_THE_DIAMOND)
def test_diamond_is_found_and_drawn_once(search):
    graph = explore(Diamond(), (-2.0, 2.0), search=search)
    assert len(graph.components()) == len(loops(graph)) == 1
    assert len(graph.pieces) == graph.nx.number_of_nodes() == 4
    assert all(degree == 2 for _, degree in graph.nx.degree())
    kinds = sorted((point.alpha, point.kind) for point in graph.special_points() if point.id >= 0)
    assert [kind for _, kind in kinds] == [
        "nonsmooth fold",
        "transition",
        "transition",
        "nonsmooth fold",
    ]
    np.testing.assert_allclose([alpha for alpha, _ in kinds], [-1, 0, 0, 1], rtol=0, atol=1e-14)
    for alpha in (-1.5, -0.9, 0.25, 1.2):
        expected = [abs(alpha) - 1.0, 1.0 - abs(alpha)] if abs(alpha) < 1.0 else []
        found = sorted(solution.z[0] for solution in graph.solutions(alpha))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
        assert graph.balance(alpha) == 0


def test_a_loop_is_missed_from_the_ends_and_the_guarantee_says_so():
    graph = explore(Diamond(), (-2.0, 2.0), search=EndPoints())
    assert graph.pieces == ()
    assert graph.guarantee == BUT_LOOPS
    assert explore(Diamond(), (-2.0, 2.0)).guarantee == "complete"


@pytest.mark.parametrize("centre", [0.0, 0.3, -2.5])
def test_a_loop_beside_a_branch(centre):
    system, interval = DiamondAndLine(centre), (-5.0, 5.0)
    missed = explore(system, interval, search=EndPoints())
    assert [len(component) for component in missed.components()] == [len(missed.pieces)]
    assert loops(missed) == []
    assert missed.guarantee == BUT_LOOPS
    searches = (None, EndPoints() + Slices((centre + 0.5,)), EndPoints() + AllTransitions())
    for search in searches:
        graph = explore(system, interval, search=search)
        (loop,) = loops(graph)
        assert len(graph.components()) == 2
        assert len(loop) == 4
        for alpha in (centre - 0.8, centre + 0.1, centre + 0.99):
            half = 1.0 - abs(alpha - centre)
            found = sorted(solution.z[0] for solution in graph.solutions(alpha))
            np.testing.assert_allclose(found, [0.0, 4.0 - half, 4.0 + half], rtol=0, atol=1e-13)
        assert [graph.count(centre + d) for d in (-1.01, 1.01)] == [1, 1]


def isola_system(p, seed):
    body = random_body(p, seed)
    f0 = load_with_several_solutions(body, 8.0, seed, tries=10)
    load = AffineLoad(f0, random_vector(body.n, seed + 1))
    return body, load, CoulombLoad(contact_body(body), load, 8.0)


@pytest.mark.parametrize(("p", "seed", "pieces"), [(2, 44, 6), (2, 73, 4), (3, 8, 8), (3, 53, 4)])
def test_a_loop_of_a_body_with_friction(p, seed, pieces):
    """Bodies with friction have closed loops, which no path from either end reaches."""
    body, load, system = isola_system(p, seed)
    graph = explore(system, (-10.0, 10.0))
    (loop,) = loops(graph)
    assert len(loop) == pieces
    alphas = np.concatenate([piece.alpha for piece in loop])
    lo, hi = alphas.min(), alphas.max()
    assert -10.0 < lo < hi < 10.0
    without = explore(system, (-10.0, 10.0), search=EndPoints())
    with_slice = explore(
        system, (-10.0, 10.0), search=EndPoints() + Slices((0.5 * (lo + hi),)) + AllTransitions()
    )
    for alpha in (lo + (hi - lo) * s for s in (0.01, 0.37, 0.61, 0.99)):
        expected = brute_force(body, load(alpha), 8.0)
        assert_same(graph.solutions(alpha), expected, lambda s: s.modes)
        assert_same(with_slice.solutions(alpha), expected, lambda s: s.modes)
        assert without.count(alpha) < len(expected)
        assert without.balance(alpha) == graph.balance(alpha) == 1
    assert (graph.guarantee, without.guarantee) == ("complete", BUT_LOOPS)
    assert len(with_slice.pieces) == len(graph.pieces)


# -- searches that promise nothing ---------------------------------------------------------------


class Cubic(PiecewiseSystem):
    """(z - 1) (z - 2) (z + 3) = alpha."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([1.0])

    def residual(self, z, alpha, character):
        return (z - 1.0) * (z - 2.0) * (z + 3.0) - alpha


def cubic_roots(alpha):
    return sorted(np.roots([1.0, 0.0, -7.0, 6.0 - alpha]).real)


def test_deflation_finds_several_solutions_from_one_start():
    graph = explore(Cubic(), (-0.1, 0.1), search=MultiStart(count=1))
    found = sorted(solution.z[0] for solution in graph.solutions(0.05))
    roots = np.array(cubic_roots(0.05))
    assert len(found) >= 2
    assert all(np.abs(roots - z).min() < 1e-9 for z in found)
    assert graph.guarantee in (
        "balanced",
        "not balanced: at least one branch missing in (-0.1, 0.1)",
    )


def test_many_starts_find_all_roots():
    graph = explore(Cubic(), (-0.1, 0.1), search=MultiStart(count=20, spread=4.0))
    found = sorted(solution.z[0] for solution in graph.solutions(0.05))
    np.testing.assert_allclose(found, cubic_roots(0.05), rtol=0, atol=1e-9)
    assert graph.guarantee == "balanced"


def test_one_seed_gives_one_graph():
    _, _, system = random_system(3, 3)
    graphs = [
        explore(system, (-10.0, 10.0), search=MultiStart(count=5, seed=seed)).to_dict()
        for seed in (7, 7)
    ]
    assert graphs[0] == graphs[1]


def large_system(seed):
    body = random_body(11, seed, inner=0)
    load = AffineLoad(2.0 * random_vector(body.n, seed), random_vector(body.n, seed + 1))
    return body, load, CoulombLoad(contact_body(body), load, 3.0)


def assert_is_solution(body, load, friction, solution):
    n, p, modes = body.n, body.p, modes_of(solution.label)
    u, lam_nu, lam_t = np.split(solution.z, [n, n + p])
    size = 1e-9 * (1.0 + np.abs(solution.z).max())
    residual = body.A @ u - load - body.N.T @ lam_nu - body.T.T @ lam_t
    assert np.abs(residual).max() < size * np.abs(body.A).max()
    assert slacks(body, np.full(p, friction), modes, solution.z).min() > -size
    free = np.array([mode == "no contact" for mode in modes])
    assert np.abs(lam_nu[free]).max(initial=0.0) + np.abs(lam_t[free]).max(initial=0.0) < size
    assert np.abs((body.N @ u - body.gap)[~free]).max(initial=0.0) < size
    for i, mode in enumerate(modes):
        if mode == "stick":
            assert abs(body.T[i] @ u) < size
        if mode.startswith("slip"):
            sign = 1.0 if mode == "slip+" else -1.0
            assert abs(lam_t[i] - sign * friction * lam_nu[i]) < size


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_from_frictionless_with_ten_nodes(seed):
    """An odd number at each end, since the homotopy starts with one solution; all are true."""
    body, load, system = large_system(seed)
    graph = explore(system, (0.0, 1.0), search=FromFrictionless())
    assert graph.count(0.0) % 2 == graph.count(1.0) % 2 == 1
    for alpha in (0.0, 0.3, 1.0):
        solutions = graph.solutions(alpha)
        assert sum(solution.det_sign for solution in solutions) == 1
        for solution in solutions:
            assert_is_solution(body, load(alpha), 3.0, solution)
    assert graph.guarantee == "balanced"


def test_from_frictionless_is_for_coulomb_friction():
    with pytest.raises(InvalidInputError, match="Coulomb"):
        explore(Cubic(), (0.0, 1.0), search=FromFrictionless())


def test_all_transitions_is_for_straight_pieces():
    system = CoulombFriction(contact_body(random_body(1, 0)), np.ones(3))
    with pytest.raises(InvalidInputError, match="PiecewiseLinearSystem"):
        explore(system, (0.0, 1.0), search=AllTransitions())


# -- what is promised, and where it is said ------------------------------------------------------


@pytest.mark.slow
def test_default_search_by_size():
    """Complete where that takes seconds, and it says what it is where not."""
    _, _, small = random_system(2, 1)
    assert explore(small, (-10.0, 10.0)).guarantee == "complete"
    body = random_body(2, 3)
    friction = CoulombFriction(contact_body(body), load_with_several_solutions(body, 4.0, 3))
    assert explore(friction, (0.0, 6.0)).guarantee == BUT_LOOPS
    assert explore(large_system(0)[2], (0.0, 1.0)).guarantee == "balanced"
    assert explore(Cubic(), (-0.1, 0.1)).guarantee != "complete"


PROMISES = {
    "ends": (EndPoints(), BUT_LOOPS),
    "slices": (Slices((-1.5, 0.0)), "balanced"),
    "many starts": (MultiStart(count=30), "balanced"),
    "frictionless": (FromFrictionless(), "balanced"),
    "ends and more": (Nothing() + EndPoints(), BUT_LOOPS),
    "everything": (AllTransitions() + Nothing(), "complete"),
}


@pytest.mark.parametrize("name", PROMISES)
def test_guarantee_is_said_everywhere(name, tmp_path):
    search, expected = PROMISES[name]
    case = CASES["fig7"]
    graph = explore(case.system, case.interval, search=search)
    graph.save(tmp_path / "graph")
    loaded = BranchGraph.load(tmp_path / "graph")
    with_system = BranchGraph.load(tmp_path / "graph", system=case.system)
    assert graph.is_balanced()
    for one in (graph, loaded, with_system):
        assert one.guarantee == one.to_dict()["guarantee"] == expected
        assert one.searched == graph.searched


def test_nothing_found_is_not_balanced():
    case = CASES["fig7"]
    graph = explore(case.system, case.interval, search=Nothing())
    assert graph.pieces == ()
    assert graph.guarantee == "not balanced: at least one branch missing in (-2, 2)"


MISSING = {
    "no contact": "(-2, -0.5)",
    "slip-": "(-1, -0.5)",
    "stick": "(-1, 1)",
    "slip+": "(1, 2)",
}


@pytest.mark.parametrize("label", MISSING)
@pytest.mark.parametrize("with_system", [True, False])
def test_a_missing_branch_is_said_with_its_interval(label, with_system, tmp_path):
    case = CASES["fig7"]
    whole = explore(case.system, case.interval)
    system = case.system if with_system else None
    graph = BranchGraph(
        [point for point in whole.special_points() if point.id >= 0],
        [piece for piece in whole.pieces if piece.label != label],
        whole.interval,
        system=system,
        searched=whole.searched,
    )
    if not with_system and label in ("no contact", "stick"):
        assert not graph.is_balanced()  # which value is right, nobody knows
        return
    expected = f"not balanced: at least one branch missing in {MISSING[label]}"
    assert graph.guarantee == expected
    graph.save(tmp_path / "graph")
    assert BranchGraph.load(tmp_path / "graph", system=system).guarantee == expected


def test_a_graph_without_its_first_piece_answers():
    """The ids of pieces are keys, not positions."""
    case = CASES["fig7"]
    whole = explore(case.system, case.interval)
    points = [point for point in whole.special_points() if point.id >= 0]
    graph = BranchGraph(points, whole.pieces[1:], whole.interval, system=case.system)
    assert graph.to_dict()["guarantee"] == graph.guarantee
    assert sorted(p.id for pieces in graph.components() for p in pieces) == [1, 2, 3]
    a, b = graph.solutions(-0.7)[0], graph.solutions(1.5)[0]
    assert [piece.id for piece in graph.path(a, b)] == [piece.id for piece in whole.path(a, b)]


def test_a_missing_pair_cancels():
    """Balance is necessary, not sufficient: the promise then is the search's alone."""
    _, _, system = isola_system(2, 44)
    whole = explore(system, (-10.0, 10.0))
    (loop,) = loops(whole)
    rest = [piece for piece in whole.pieces if piece.id not in {p.id for p in loop}]
    nodes = {node for piece in rest for node in (piece.start, piece.end)}
    points = [point for point in whole.special_points() if point.id in nodes]
    graph = BranchGraph(points, rest, whole.interval, system=system)
    assert graph.is_balanced()
    assert graph.guarantee == "balanced"


def test_one_node_without_a_loop():
    """The promise of completeness costs nothing where there is nothing more to find."""
    load = AffineLoad([0.25, 0.0], [0.0, 1.0])
    system = CoulombLoad(contact_body(ONE_NODE), load, 4.0)
    found = [explore(system, (-2.0, 2.0), search=search) for search in (None, EndPoints())]
    assert [len(graph.pieces) for graph in found] == [4, 4]
    assert [len(graph.components()) for graph in found] == [1, 1]


# -- paths that leave the interval and come back ---------------------------------------------------


class OneSolution(Search):
    """The solution near zero of z - 2 max(z - 1, 0) - 2 min(z + 1, 0) = alpha, at alpha = 0."""

    def starts(self, system, metric, interval):
        yield np.zeros(system.size + 1), np.full((1, system.size + 1), 1e-16)


def zigzag(z, alpha, sw):
    return z - 2.0 * sw.max(z - 1.0, 0.0) - 2.0 * sw.min(z + 1.0, 0.0) - alpha


@pytest.mark.parametrize(("end", "count"), [(0.9, 3), (0.99, 3), (0.6, 1)])
def test_a_path_that_comes_back_to_the_interval_is_found(end, count):
    """The zigzag turns at 1 and -1: further away than a quarter of the interval is not looked."""
    graph = explore(Switched(1, zigzag, linear=True), (-end, end), search=OneSolution())
    assert graph.count(0.3) == count


def test_a_curved_system_is_evaluated_inside_the_interval_only():
    class Cubic(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return np.array([z[0]])

        def residual(self, z, alpha, character):
            assert -1.7 <= alpha <= 1.7
            return 3.0 * z - z**3 - alpha

    assert explore(Cubic(), (-1.7, 1.7)).count(0.3) == 3
