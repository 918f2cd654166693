"""Trusses, softening bars, strings, membranes and struts, against closed forms and other programs.

The truth comes from roots of polynomials, from all modes by brute force, from an active-set solver
for bounded least squares, from elliptic integrals and from a collocation solver.
"""

import runpy
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pwscont_structures import (
    AllEquilibria,
    SofteningBar,
    Strut,
    Support,
    TrussChain,
    membrane,
    scenes,
    string,
)
from pwscont_structures.law import SnapLaw
from pwscont_structures.obstacle import ObstacleProblem
from scipy.integrate import solve_bvp
from scipy.linalg import cholesky, eigvals, solve_triangular
from scipy.optimize import lsq_linear, minimize
from scipy.special import ellipe, ellipk

from pwscont import InvalidInputError, check_system, explore
from pwscont.extending import Guarantee

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

LIMIT = 2.0 / 27.0**0.5  # the largest force of d (d - 1)(d - 2)
EULER = np.pi**2


def found(graph, alpha):
    """Return the states at one alpha as a sorted array."""
    return ordered(solution.z.tolist() for solution in graph.solutions(alpha))


def ordered(states):
    """Return states in an order that rounding does not change."""
    return np.array(sorted(states, key=lambda state: np.round(state, 7).tolist()))


def real_roots(coefficients):
    """Return the real roots of a cubic."""
    roots = np.roots(coefficients)
    return roots[np.abs(roots.imag) < 1e-9].real


def compressions(k, load, place=np.inf, stiffness=0.0):
    """Return all compressions of a truss with a stop under it."""
    cubic = np.array([k, -3.0 * k, 2.0 * k, -load])
    stopped = cubic + np.array([0.0, 0.0, stiffness, -stiffness * place if stiffness else 0.0])
    return [d for d in real_roots(cubic) if d < place] + [
        d for d in real_roots(stopped) if stiffness and d >= place
    ]


def equilibria(k, load, stop=(np.inf, 0.0)):
    """Return all equilibria of trusses in series, the stop under the last."""
    trusses = [compressions(each, load) for each in k[:-1]] + [compressions(k[-1], load, *stop)]
    return ordered(np.cumsum(d[::-1])[::-1].tolist() for d in product(*trusses))


# --- trusses


@pytest.mark.parametrize("place", [1e5, 1e16, 1e40, -10.0, -1e3, -1e6])
def test_a_stop_may_be_far_away(place):
    for k, load, stiffness in ((1.0, 0.3, 2.0), (0.05, -3.0, 0.1), (20.0, 0.1, 5.0)):
        found = SnapLaw(k, place, stiffness).compressions(load)
        true = sorted(compressions(k, load, place, stiffness))
        assert np.allclose(found, true, rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_two_trusses_have_nine_equilibria_near_no_load():
    k = [1.0, 1.1]
    graph = explore(TrussChain(k), (-0.6, 0.6))
    assert graph.guarantee == "complete"
    assert found(graph, 0.05) == pytest.approx(equilibria(k, 0.05), abs=1e-10)
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    expected = np.array([1.1, 1.0, 1.0, 1.0]) * LIMIT
    assert folds == pytest.approx([*-expected, *expected[::-1]], rel=1e-9)
    assert set(graph.balance_values()) == {1}


@pytest.mark.slow
@pytest.mark.parametrize("trusses", [3, 4])
def test_all_states_of_longer_chains(trusses):
    k = 1.0 + 0.1 * np.arange(trusses)
    graph = explore(TrussChain(k), (-1.0, 1.0), search=AllEquilibria())
    assert graph.count(0.01) == 3**trusses
    assert len(graph.components()) == 1
    assert found(graph, 0.01) == pytest.approx(equilibria(k, 0.01), abs=1e-9)


@pytest.mark.slow
def test_a_stop_leaves_one_three_or_nine():
    graph = explore(TrussChain([1.0, 1.0], {2: (0.9, 20.0)}), (-0.6, 0.6))
    assert graph.guarantee == "complete"
    assert [count for *_, count in graph.multiplicity()] == [1, 3, 9, 1]
    borders = [lo for lo, *_ in graph.multiplicity()][1:]
    assert borders == pytest.approx([-LIMIT, 0.9 * 0.1 * 1.1, LIMIT], rel=1e-8)
    assert check_system(graph.system, [(s.z, s.alpha) for s in graph.solutions(0.2)])
    words = {point.message for point in graph.special_points("nonsmooth fold")}
    assert words <= {"node 2 reaches its stop", "node 2 leaves its stop"}
    assert words


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_chains(seed):
    rng = np.random.default_rng(seed)
    k = rng.uniform(0.5, 2.0, rng.integers(1, 4))
    stop = (rng.uniform(-0.3, 2.5), rng.choice([0.1, 1.0, 20.0]))
    stops = {len(k): stop} if rng.random() < 0.7 else {}
    graph = explore(TrussChain(k, stops), (-1.0, 1.0), search=AllEquilibria())
    assert graph.guarantee == "complete"
    for load in rng.uniform(-1.0, 1.0, 6):
        truth = equilibria(k, load, stop) if stops else equilibria(k, load)
        assert found(graph, load) == pytest.approx(truth, abs=1e-8)


@pytest.mark.slow
def test_a_stop_between_trusses_promises_nothing():
    system = TrussChain([1.0, 1.1], {1: (1.5, 2.0)})
    graph = explore(system, (-0.2, 0.6))
    assert graph.searched.promise is Guarantee.NOTHING
    for solution in graph.solutions(0.1):
        d = np.array([solution["u_1"] - solution["u_2"], solution["u_2"]])
        carried = 0.1 - 2.0 * max(0.0, solution["u_1"] - 1.5)
        assert np.array([1.0, 1.1]) * d * (d - 1) * (d - 2) == pytest.approx(carried, abs=1e-10)
    with pytest.raises(InvalidInputError, match="whose only stop, if any, is at the last node"):
        explore(system, (-0.2, 0.6), search=AllEquilibria())


# --- softening bars


def test_snap_back_between_three_and_two_and_a_quarter():
    graph = explore(SofteningBar(), (0.0, 5.0))
    assert graph.guarantee == "complete"
    folds = graph.special_points("nonsmooth fold")
    assert [(p.alpha, p.message) for p in folds] == [
        (pytest.approx(3.0, rel=1e-14), "reaches its strength"),
        (pytest.approx(2.25, rel=1e-14), "breaks"),
    ]
    # e = alpha / 3; 1.8 - 0.8 e = (alpha - e) / 2; the spring is slack
    assert found(graph, 2.5)[:, 0] == pytest.approx([2.5 / 3.0, 0.55 / 0.3, 2.5], rel=1e-13)


def elongations(bar, alpha):
    """Return all states by trying all modes of all elements."""
    n, states = bar.size, []
    rows = [
        (bar.modulus, np.zeros(n)),
        (-bar.softening, bar.strength + bar.softening * bar.peak),
        (np.full(n, bar.remaining), np.zeros(n)),
    ]
    for modes in product(range(3), repeat=n):
        slope = np.array([rows[mode][0][i] for i, mode in enumerate(modes)])
        rest = np.array([rows[mode][1][i] for i, mode in enumerate(modes)])
        e = np.linalg.solve(np.diag(slope) + bar.spring, bar.spring * alpha - rest)
        line = bar.strength + bar.softening * (bar.peak - e)
        law = np.minimum(bar.modulus * e, np.maximum(line, bar.remaining * e))
        if np.allclose(slope * e + rest, law, rtol=0.0, atol=1e-11):
            states.append(e.tolist())
    return ordered(states)


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.sweep(40)
def test_random_bars(seed):
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 4)
    draw = (rng.uniform(*reach, n) for reach in [(0.5, 1.5), (0.5, 2.0), (0.2, 2.0)])
    bar = SofteningBar(rng.uniform(0.2, 1.0), *draw, remaining=rng.uniform(0.01, 0.2))
    graph = explore(bar, (0.0, 12.0))
    assert graph.guarantee == "complete"
    for alpha in rng.uniform(0.0, 12.0, 8):
        assert found(graph, alpha) == pytest.approx(elongations(bar, alpha), abs=1e-10)


@pytest.mark.slow
def test_of_several_elements_each_may_soften_alone():
    bar = SofteningBar(0.5, [1.0, 1.05, 1.1], remaining=0.05)
    graph = explore(bar, (0.0, 8.0))
    assert found(graph, 4.9) == pytest.approx(elongations(bar, 4.9), abs=1e-12)
    alone = {s.label for s in graph.solutions(4.9) if s.label.count("elastic") == 2}
    assert "element 2 elastic" in " ".join(alone)
    assert check_system(bar, [(s.z, s.alpha) for s in graph.solutions(4.9)])


# --- strings and membranes


def least_energy(problem, alpha):
    """Return the state of least energy, by an active-set method for bounded least squares."""
    K = problem.K.toarray()
    U = cholesky(K)
    f = problem.rest + alpha * problem.load
    least = lsq_linear(
        U,
        -solve_triangular(U, f, trans="T"),
        (problem.obstacle, np.full(len(f), np.inf)),
        method="bvls",
        tol=1e-14,
    )
    return least.x


@pytest.mark.parametrize("seed", range(60))
@pytest.mark.sweep(24)
def test_random_strings(seed):
    rng = np.random.default_rng(seed)
    heights = -rng.uniform(0.01, 0.2, 12)
    system = string(12, lambda x: heights, length=2.0, tension=rng.uniform(0.5, 2.0), load=0.7)
    graph = explore(system, (-2.0, 8.0))
    assert graph.guarantee.startswith("complete")
    for alpha in rng.uniform(-2.0, 8.0, 4):
        truth = least_energy(system, alpha)
        assert found(graph, alpha) == pytest.approx(truth[np.newaxis], abs=1e-9)


@pytest.mark.slow
def test_a_string_on_a_table():
    """It hangs in parabolas of the length sqrt(2 g / load) on both sides of the table."""
    nodes, depth, load = 199, 0.05, 8.0
    graph = explore(string(nodes, lambda x: -depth), (0.0, load))
    [u] = found(graph, load)
    x = np.arange(1, nodes + 1) / (nodes + 1.0)
    side = (2.0 * depth / load) ** 0.5
    ends = x[np.abs(u + depth) < 1e-12][[0, -1]]
    assert ends == pytest.approx([side, 1.0 - side], abs=1.0 / nodes)
    hanging = -depth + 0.5 * load * np.maximum(0.0, side - np.minimum(x, 1.0 - x)) ** 2
    assert u == pytest.approx(hanging, abs=4e-5)
    [first, *_] = graph.special_points("transition")
    assert first.message == "node 100 touches the obstacle"
    assert first.alpha == pytest.approx(8.0 * depth, rel=1e-9)


def test_thousand_nodes_as_in_the_bare_loop():
    system = scenes.obstacle(1000).system
    assert check_system(scenes.obstacle(20).system, [(np.zeros(20), 0.0), (-np.ones(20), 4.0)])
    graph = explore(system, (0.0, 2.0))
    [solution] = graph.solutions(2.0)
    reaction, height = system.reaction(solution.z, 2.0), solution.z - system.obstacle
    assert reaction.min() > -1e-12
    assert height.min() > -1e-12
    assert np.minimum(reaction, height).max() < 1e-12


def test_a_membrane_over_a_dome():
    skfem = pytest.importorskip("skfem")
    mesh = skfem.MeshTri().refined(3)

    def dome(x):
        return -0.03 - 0.1 * ((x[0] - 0.55) ** 2 + 1.3 * (x[1] - 0.47) ** 2)

    system, inside = membrane(mesh, dome)
    assert system.size == len(inside) == 7**2
    graph = explore(system, (0.0, 3.0))
    for alpha in (0.7, 3.0):
        truth = least_energy(system, alpha)
        assert (truth > system.obstacle + 1e-9).any()
        assert found(graph, alpha) == pytest.approx(truth[np.newaxis], abs=1e-9)
    assert check_system(system, [(s.z, s.alpha) for s in graph.solutions(2.0)])


# --- struts


@pytest.mark.slow
def test_the_free_strut_is_the_elastica():
    """P = 4 K(k)^2, w = k / K(k), shortening 2 (1 - E(k) / K(k)), sin(angle / 2) = k."""
    system = Strut(10)
    graph = explore(system, (5.0, 16.0))
    [buckling] = graph.special_points("branch point")
    assert buckling.alpha == pytest.approx(EULER, rel=1e-4)
    for k in (0.3, 0.6):
        m = k**2
        load = 4.0 * ellipk(m) ** 2
        bent = [s for s in graph.solutions(load) if abs(s.z[0]) > 0.1]
        assert len(bent) == 2
        for solution in bent:
            assert abs(np.sin(solution.z[0] / 2.0)) == pytest.approx(k, rel=5e-4)
            middle = abs(system.deflection(solution.z, 0.5))
            assert middle == pytest.approx(k / ellipk(m), rel=5e-4)
            shortening = 2.0 * (1.0 - ellipe(m) / ellipk(m))
            assert system.shortening(solution.z) == pytest.approx(shortening, rel=1e-3)


def test_the_error_of_the_buckling_load_falls_with_the_fourth_power():
    errors = []
    for elements in (4, 8):
        system = Strut(elements)
        straight = np.zeros(system.size)
        free = system.character(straight, 0.0)
        at = [system.jacobian(straight, load, free)[:, :-1] for load in (0.0, 1.0)]
        loads = eigvals(at[0], at[0] - at[1])
        real = loads[np.isfinite(loads) & (np.abs(loads.imag) < 1e-6)].real
        errors.append(real[real > 1.0].min() - EULER)
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)


def collocated(system, solution, load):
    """Return angle, moment and height at the support in contact, and its reaction, by solve_bvp."""
    n = system.rod.n
    touched = int(np.flatnonzero(solution.character.array)[0])
    place, side = system.places[touched], system.sides[touched]
    waves = np.pi * np.arange(1, len(system.bow) + 1)

    def bent(s):
        return -np.sin(np.outer(s, waves)) @ (system.bow * waves**2)

    def slopes(t, y, p):
        parts = []
        for part, (first, length) in enumerate([(0.0, place), (place, 1.0 - place)]):
            theta, moment, _ = y[3 * part : 3 * part + 3]
            force = p[0] - (side * p[1] if part == 0 else 0.0)
            turned = moment + bent(first + length * t)
            parts += [turned, -load * np.sin(theta) - force * np.cos(theta), np.sin(theta)]
            parts[-3:] = [length * each for each in parts[-3:]]
        return np.array(parts)

    def ends(a, b, p):
        joined = b[:3] - a[3:]
        return np.array([a[1], a[2], b[4], b[5], *joined, b[2] - system.heights[touched]])

    t = np.linspace(0.0, 1.0, 41)
    nodes, angles = system.rod.nodes, solution.z[:n]
    guess = []
    for first, length in [(0.0, place), (place, 1.0 - place)]:
        theta = np.interp(first + length * t, nodes, angles)
        moment = np.gradient(theta, length * t) - bent(first + length * t)
        height = np.array([np.interp(s, *_heights(system, angles)) for s in first + length * t])
        guess += [theta, moment, height]
    answer = solve_bvp(
        slopes, ends, t, np.array(guess), p=[solution["V"], solution.z[n + 1 + touched]], tol=1e-8
    )
    assert answer.success
    return answer


def _heights(system, angles):
    places = np.linspace(0.0, 1.0, 401)
    theta = np.interp(places, system.rod.nodes, angles)
    steps = 0.5 * (np.sin(theta[1:]) + np.sin(theta[:-1])) * np.diff(places)
    return places, np.append(0.0, np.cumsum(steps))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "height", "bow"),
    [
        (0.5, 0.1, (0.01, 0.004)),
        pytest.param(0.25, 0.05, (0.02,), marks=pytest.mark.slow),
        pytest.param(0.625, -0.12, (0.005, -0.01), marks=pytest.mark.slow),
        pytest.param(0.375, -0.03, (-0.005, 0.0, 0.002), marks=pytest.mark.slow),
    ],
)
def test_struts_on_a_support_by_collocation(place, height, bow):
    system = Strut(8, [Support(place, height)], bow)
    graph = explore(system, (1.0, 20.0))
    touching = [s for s in graph.solutions(16.0) if s.label == "support 1"]
    assert touching
    for solution in touching:
        answer = collocated(system, solution, 16.0)
        V, R = answer.p
        assert R > 0.0
        reaction = solution["R_1"]
        assert (solution["V"], reaction) == (pytest.approx(V, rel=2e-3), pytest.approx(R, rel=2e-3))
        exact = [*answer.sol(np.array([0.0, 1.0]))[0], answer.sol(1.0)[3]]
        nodes = [0.0, system.places[0], 1.0]
        angles = np.interp(nodes, system.rod.nodes, solution.z[: system.rod.n])
        assert angles == pytest.approx(exact, abs=2e-3)


@pytest.mark.slow
def test_the_state_of_least_energy_of_a_chain_of_links():
    """Sixty rigid links with springs between them, a program for constrained minima."""
    links, load, height = 60, 16.0, 0.1
    system = Strut(8, [Support(0.5, height)], [0.01])
    middles = (np.arange(links) + 0.5) / links
    slope = 0.01 * np.pi * np.cos(np.pi * middles)

    def energy(theta):
        bend = np.diff(theta - slope)
        value = 0.5 * links * bend @ bend + load * np.cos(theta).mean()
        gradient = -load * np.sin(theta) / links
        gradient[1:] += links * bend
        gradient[:-1] -= links * bend
        return value, gradient

    half = links // 2
    picked = np.arange(links) < half
    held = [
        {"type": "eq", "fun": lambda t: np.sin(t).mean(), "jac": lambda t: np.cos(t) / links},
        {
            "type": "ineq",
            "fun": lambda t: height - np.sin(t[:half]).sum() / links,
            "jac": lambda t: -np.cos(t) * picked / links,
        },
    ]
    start = 0.3 * np.cos(np.pi * middles)
    least = minimize(
        energy, start, jac=True, method="SLSQP", constraints=held, options={"ftol": 1e-12}
    )
    assert least.success
    graph = explore(system, (1.0, 18.0))
    angles = [
        np.interp(middles, system.rod.nodes, s.z[: system.rod.n]) for s in graph.solutions(load)
    ]
    assert min(np.abs(each - least.x).max() for each in angles) < 5e-3


@pytest.mark.slow
def test_the_scene_of_the_strut():
    graph = scenes.strut_supports().run()
    assert graph.searched.promise is Guarantee.NOTHING
    assert set(graph.balance_values()) == {1}
    assert [count for *_, count in graph.multiplicity()] == [1, 3, 5, 7, 9]
    [fold] = graph.special_points("nonsmooth fold")
    assert fold.message in ("touches support 2", "leaves support 2")
    for solution in graph.solutions(43.0):
        system = graph.system
        assert system.gaps(solution.z).min() > -1e-9
        assert min(solution["R_1"], solution["R_2"]) > -1e-9
    assert check_system(graph.system, [(s.z, s.alpha) for s in graph.solutions(20.0)])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: TrussChain([1.0, -1.0]), "stiffness of trusses must be positive"),
        (lambda: scenes.truss_chain(99999999), "trusses must be from 1 to 10000, got 99999999"),
        (lambda: TrussChain([]), "stiffness of trusses must be positive numbers, at least one"),
        (lambda: TrussChain([1.0], {2: (1.0, 1.0)}), "no node 2; there are nodes 1 to 1"),
        (lambda: TrussChain([1.0], {1: 3.0}), "a stop is a pair of place and stiffness"),
        (lambda: SofteningBar(0.0), r"must be positive numbers, .* got \[0.\]"),
        (lambda: SofteningBar([0.5, 1.0]), r"spring has shape \(2,\)"),
        (lambda: SofteningBar(1.0, [1.0, 1.1]), "several elements need a remaining slope"),
        (lambda: SofteningBar(1.0, [1.0, 1.1], [1.0] * 3), "numbers of elements"),
        (lambda: SofteningBar(remaining=2.0), "remaining must be from 0 to the modulus, got 2"),
        (lambda: string(0, lambda x: -x), "a string needs a whole number of nodes"),
        (lambda: string("a", lambda x: -x), "a string needs a whole number of nodes"),
        (lambda: string(5, lambda x: -x[:3]), "a height for each of 5 places"),
        (lambda: string(5, -1.0), "obstacle must be a function of x, got -1"),
        (lambda: Strut("a"), "a strut needs a whole number of elements, got 'a'"),
        (lambda: ObstacleProblem([[1.0, 2.0], [0.0, 1.0]], [0, 0], [1, 1]), "symmetric"),
        (lambda: ObstacleProblem(1.0, [0], [1]), r"square matrix, shape \(n, n\), got shape \(\)"),
        (lambda: Strut(4, [(0.5, 0.1)]), r"supports must be several Support\(...\), got"),
        (lambda: ObstacleProblem([[1, 2], [2, 1]], [0, 0], [1, 1]), "positive definite"),
        (lambda: Strut(1), "at least two elements, got 1"),
        (lambda: Strut(4, [Support(1.0, 0.1)]), "between the ends of the rod"),
        (lambda: Strut(4, [Support(0.5, 0.1)], [0.2]), "support 1 must be off the unloaded rod"),
        (lambda: scenes.strut_supports(elements=5), "must be even, got 5"),
        (lambda: SofteningBar(strength=[]), "must be positive numbers, one for each element"),
    ],
)
def test_mistakes_are_named(make, words):
    with pytest.raises(InvalidInputError, match=words):
        make()


@pytest.mark.slow
def test_the_numbers_of_the_tutorial(monkeypatch, capsys):
    """The table of Timoshenko and Gere (1961), section 2.7, and what the page says in words."""
    pytest.importorskip("skfem")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    page = Path(__file__).parents[1] / "docs" / "examples" / "structures.py"
    names = runpy.run_path(str(page))
    printed = capsys.readouterr().out
    assert "on the loop: 4" in printed
    for angle, ratio in [(40.0, 1.063), (60.0, 1.152), (80.0, 1.293)]:
        buckled = names["buckled"].solutions(ratio * EULER)
        assert max(np.degrees(s["theta(0)"]) for s in buckled) == pytest.approx(angle, abs=0.3)
    assert names["stopped"].guarantee == names["chain"].guarantee == "complete"


@pytest.mark.slow
def test_a_string_needs_no_finite_elements():
    """Scikit-fem is an optional extra: whoever has none is told so, and has strings."""
    code = (
        "import sys; sys.modules['skfem'] = None\n"
        "from pwscont_structures import membrane, string\n"
        "assert string(3, lambda x: -x).size == 3\n"
        "try: membrane(None, None)\n"
        "except ImportError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "membranes need scikit-fem: pip install '.[fem]'\n"
