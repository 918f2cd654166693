"""Systems written with switches, against enumerations that know nothing of pwscont."""

from functools import partial
from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import brentq
from sweeps import swept
from switched_systems import (
    SCHMITT_FOLDS,
    agree,
    clip_solutions,
    distinct,
    ladder,
    ladder_source,
    lcp_solutions,
    random_tree,
    relu_solutions,
    schmitt,
    switches_of,
    tree_solutions,
    written,
)

from pwscont import (
    LCP,
    AbsNormal,
    BranchGraph,
    Character,
    Complementarity,
    Switched,
    check_system,
    enumerate_solutions,
    explore,
    trace,
)

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

ALPHAS = (-1.37, 0.21, 1.83)


def check_against(system, solutions, interval=(-2.0, 2.0), alphas=ALPHAS):
    """Compare the graph and the list of all solutions at some alphas with the truth."""
    graph = explore(system, interval)
    assert graph.guarantee.startswith("complete")
    for alpha in alphas:
        true = solutions(alpha)
        assert agree([s.z for s in enumerate_solutions(system, alpha)], true)
        assert agree([s.z for s in graph.solutions(alpha)], true)
    return graph


SEEDS = swept([0, 1, 2, 3], range(4, 60))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.sweep(4)
def test_linear_complementarity(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    M, q, d = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
    truth = lambda t: lcp_solutions(M, q + t * d)  # noqa: E731
    check_against(LCP(M, q, d), truth)
    written_out = Switched(n, lambda z, t, sw: sw.min(z, M @ z + q + t * d), linear=True)
    assert written_out.size == n
    check_against(written_out, truth)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_larger_linear_complementarity(seed):
    rng = np.random.default_rng(100 + seed)
    M, q, d = rng.normal(size=(10, 10)), rng.normal(size=10), rng.normal(size=10)
    for t in ALPHAS:
        found = enumerate_solutions(LCP(M, q, d), t)
        assert agree([s.z for s in found], lcp_solutions(M, q + t * d))


@pytest.mark.parametrize("seed", SEEDS)
def test_games(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    B, a, c = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
    game = Switched(n, lambda x, t, sw: x - sw.clip(B @ x + a + t * c, 0, 1), linear=True)
    assert [len(block.modes) for block in game.blocks()] == [3] * n
    check_against(game, lambda t: clip_solutions(B, a + t * c))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_games_of_six(seed):
    rng = np.random.default_rng(200 + seed)
    B, a, c = rng.normal(size=(6, 6)), rng.normal(size=6), rng.normal(size=6)
    game = Switched(6, lambda x, t, sw: x - sw.clip(B @ x + a + t * c, 0, 1), linear=True)
    for t in ALPHAS:
        found = enumerate_solutions(game, t)
        assert agree([s.z for s in found], clip_solutions(B, a + t * c))


@pytest.mark.parametrize(("seed", "n"), swept([(0, 4), (1, 6)], [(k, 14) for k in range(5)]))
def test_fixed_points_of_rectified_units(seed, n):
    rng = np.random.default_rng(seed)
    W, b, c = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
    units = Switched(n, lambda z, t, sw: z - sw.relu(W @ z + b + t * c), linear=True)
    found = enumerate_solutions(units, 0.4)
    assert agree([s.z for s in found], relu_solutions(W, b + 0.4 * c))


def nested(seed):
    """Return random nested trees, one for each unknown."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    lines = [("affine", np.append(2.0 * np.eye(n)[i], [0.0, 0.0])) for i in range(n)]
    return [("sum", line, random_tree(rng, n, int(rng.integers(1, 4)))) for line in lines]


def has_few_cells(seed):
    return np.prod([number for tree in nested(seed) for number in switches_of(tree)]) <= 1500


FEW = [seed for seed in range(60) if has_few_cells(seed)]


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1.0, 1e6])
def test_small_loads_beside_a_unit_matrix_are_affine(unit):
    """z - (z + q) is q but for rounding of z."""
    system = LCP(np.eye(2), [-unit, unit], [0.0, -2.0 * unit])
    (solution,) = enumerate_solutions(system, 1.0)
    np.testing.assert_allclose(solution.z, [unit, unit], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", swept(FEW[:3], FEW[3:]))
@pytest.mark.sweep(4)
def test_nested_switches(seed):
    trees = nested(seed)

    def f(z, t, sw):
        return np.array([written(tree, z, t, sw) for tree in trees])

    system = Switched(len(trees), f, linear=True)
    graph = check_against(system, partial(tree_solutions, trees))
    solutions = graph.solutions(0.21)
    assert all(s.z.shape == (len(trees),) for s in solutions)
    assert check_system(system, [(s.z, s.alpha) for s in solutions])
    curved = Switched(len(trees), f)  # the same without the promise
    for one in solutions[:1]:
        again = trace(curved, (one.z, 0.21), (-2.0, 2.0))
        true = trace(system, (one.z, 0.21), (-2.0, 2.0))
        for alpha in ALPHAS:
            assert agree(*([s.z for s in each.solutions(alpha)] for each in (again, true)))


@pytest.mark.parametrize("p", swept([6], [30]))
def test_lasso_has_its_optimality_conditions(p):
    rng = np.random.default_rng(p)
    X, y = rng.normal(size=(2 * p, p)), rng.normal(size=2 * p)
    G, c = X.T @ X, X.T @ y
    largest = float(np.abs(c).max())
    # the kinks are those of the soft threshold of a gradient step
    lasso = Switched(p, lambda b, t, sw: G @ b - c + sw.clip(b - G @ b + c, -t, t), linear=True)
    assert lasso.domain == (0.0, np.inf)
    graph = trace(lasso, (np.zeros(p), 1.01 * largest), (0.001 * largest, 1.01 * largest))
    for t in largest * rng.uniform(0.001, 1.0, 40):
        (solution,) = graph.solutions(t)
        gradient, b = c - G @ solution.z, solution.z
        used = np.abs(b) > 1e-12
        assert np.abs(gradient).max() <= t * (1.0 + 1e-10)
        assert gradient[used] == pytest.approx(t * np.sign(b[used]), rel=1e-9)


# -- circuits and structures ---------------------------------------------------------------------


def test_schmitt_trigger():
    names, switches = ["b1", "b2", "e", "c1", "c2"], ["F1", "R1", "F2", "R2"]
    trigger = Switched(5, schmitt, linear=True, names=names, switches=switches)
    graph = explore(trigger, (0.0, 6.0))
    folds = sorted(point.alpha for point in graph.special_points("nonsmooth fold"))
    assert folds == pytest.approx(SCHMITT_FOLDS, rel=1e-12)
    inner = sorted(point.alpha for point in graph.special_points("transition"))
    assert inner == pytest.approx([1.742321116928447, 3.1116621622682286], rel=1e-12)
    assert [row[2] for row in graph.multiplicity()] == [1, 3, 1]
    assert len(graph.pieces) == 5
    messages = {point.message for point in graph.special_points("transition")}
    assert messages <= {f"{name} turns {way}" for name in switches for way in ("on", "off")}
    assert graph.solutions(2.0)[0]["e"] == graph.solutions(2.0)[0].z[2]


@pytest.mark.parametrize("sections", [1, 7, 40])
def test_diode_ladder(sections):
    thresholds = 0.6 + 0.01 * np.sin(np.arange(sections))
    system = Switched(sections, ladder(sections, thresholds), linear=True, unique=True)
    graph = explore(system, (0.0, 3.0))
    for source in (0.3, 1.1, 2.9):
        (state,) = graph.solutions(source)
        last = brentq(lambda v, s=source: ladder_source(v, thresholds) - s, 0.0, 3.0, xtol=1e-15)
        assert state.z[-1] == pytest.approx(last, rel=1e-9)


def truss(u, load, sw):
    def p(d):
        return d * (d - 1.0) * (d - 2.0)

    stop = 20.0 * sw.relu(u[1] - 0.9)
    return np.array([p(u[0]) - p(u[1] - u[0]), p(u[1] - u[0]) + stop - load])


def truss_states(load):
    """Return all states of two trusses over a stop: forces f at which the trusses' sizes fit."""
    bends = 1.0 + 3.0**-0.5 * np.array([-1.0, 1.0])
    ranges = [(-3.0, bends[0]), (bends[0], bends[1]), (bends[1], 5.0)]

    def size(f, k):  # the deflection d on the k-th monotone branch of d (d - 1) (d - 2) = f
        low, high = ranges[k]
        g = lambda d: d * (d - 1.0) * (d - 2.0) - f  # noqa: E731
        return brentq(g, low, high, xtol=1e-15) if g(low) * g(high) <= 0.0 else np.nan

    def off(f, one, other):
        u = size(f, one) + size(f, other)
        return f + 20.0 * np.maximum(0.0, u - 0.9) - load

    found, forces = [], np.linspace(-2.0, 2.0, 3000)
    for one, other in product(range(3), repeat=2):
        values = [off(f, one, other) for f in forces]
        for i in np.flatnonzero(np.multiply(values[1:], values[:-1]) < 0.0):
            f = brentq(off, forces[i], forces[i + 1], (one, other), xtol=1e-15)
            found.append(np.cumsum([size(f, one), size(f, other)]))
    return distinct(found)


@pytest.mark.slow
def test_trusses_over_a_stop():
    loads = (0.2, 2.1, 21.9, 31.0)
    starts = [(u, load) for load in loads for u in truss_states(load)]
    graph = explore(Switched(2, truss), (0.0, 40.0), starts=starts)
    assert {len(truss_states(load)) for load in loads} == {1, 3}
    for load in loads:
        assert agree([s.z for s in graph.solutions(load)], truss_states(load))


def kojima_shindo(z, t):
    """Kojima and Shindo's problem; the last constant is 3.2, for at 3 a solution is degenerate."""
    x, y, u, v = z
    return np.array(
        [
            3 * x * x + 2 * x * y + 2 * y * y + u + 3 * v - 6 + t,
            2 * x * x + x + y * y + 10 * u + 2 * v - 2,
            3 * x * x + x * y + 2 * y * y + 2 * u + 9 * v - 9,
            x * x + 3 * y * y + 2 * u + 3 * v - 3.2,
        ]
    )


@pytest.mark.slow
def test_kojima_shindo():
    starts = [([1.2, 0.0, 0.0, 0.6], 0.0), ([1.0, 0.0, 3.0, 0.0], 0.0)]
    one = Switched(4, lambda z, t, sw: sw.min(z, kojima_shindo(z, t)))
    for system in (one, Complementarity(kojima_shindo)):
        graph = explore(system, (-4.0, 2.0), starts=starts)
        assert [row[2] for row in graph.multiplicity()] == [1, 3]
        for solution in [*graph.solutions(-3.5), *graph.solutions(1.0)]:
            F = kojima_shindo(solution.z, solution.alpha)
            assert np.minimum(solution.z, F) == pytest.approx(0.0, abs=1e-12)


# -- forms -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.sweep(4)
def test_abs_normal_form_is_solved_as_it_stands(seed):
    rng = np.random.default_rng(seed)
    n, s = int(rng.integers(1, 3)), int(rng.integers(1, 6))
    Z, L = rng.normal(size=(s, n)), np.tril(rng.normal(size=(s, s)), -1)
    J, Y = 3.0 * np.eye(n), 0.4 * rng.normal(size=(n, s))
    c, b = rng.normal(size=(2, s)), rng.normal(size=(2, n))
    system = AbsNormal(Z, L, J, Y, c, b)
    for alpha in ALPHAS:
        for solution in enumerate_solutions(system, alpha):
            sizes = np.zeros(s)
            for i in range(s):
                sizes[i] = abs(c[0, i] + alpha * c[1, i] + Z[i] @ solution.z + L[i] @ sizes)
            value = b[0] + alpha * b[1] + J @ solution.z + Y @ sizes
            assert value == pytest.approx(0.0, abs=1e-9)
    callables = AbsNormal(Z, L, J, Y, lambda t: c[0] + t * c[1], lambda t: b[0] + t * b[1])
    pairs = ([s.z for s in enumerate_solutions(each, 0.3)] for each in (system, callables))
    assert agree(*pairs)


def test_bounds_that_are_infinite_equal_or_move():
    lower, upper = np.array([-np.inf, 0.0, -np.inf, 0.5]), np.array([np.inf, np.inf, 1.0, 0.5])
    A = np.diag([1.0, 2.0, 3.0, 4.0]) + 0.1
    system = Complementarity(lambda z, t: A @ z - t, lower, upper, linear=True)
    assert len(system.switches) == 2  # neither the free unknown nor the fixed one has a kink
    assert system.switches == ("z[1]", "z[2]")
    graph = explore(system, (-3.0, 8.0))
    for t in (-2.0, 0.7, 7.0):
        (solution,) = graph.solutions(t)
        z, F = solution.z, A @ solution.z - t
        assert z[3] == 0.5
        assert F[0] == pytest.approx(0.0, abs=1e-12)
        assert min(z[1], F[1]) == pytest.approx(0.0, abs=1e-12)
        assert max(z[2] - 1.0, F[2]) == pytest.approx(0.0, abs=1e-12)
    moving = Complementarity(lambda z, t: z - 2.0, lambda t: [t], lambda t: [t + 1.0], n=1)
    graph = explore(moving, (0.0, 4.0))
    for t in (0.5, 1.5, 3.5):
        (solution,) = graph.solutions(t)
        assert solution.z[0] == pytest.approx(np.clip(2.0, t, t + 1.0), rel=1e-12)


def test_sparse_matrices_stay_sparse():
    n = 400
    M = sp.diags_array([-np.ones(n - 1), 2.1 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    system = LCP(M.tocsr(), -np.ones(n), np.linspace(-1.0, 1.0, n))
    character = system.character(np.zeros(n), 0.0)
    assert not isinstance(system.jacobian(np.zeros(n), 0.0, character), np.ndarray)
    graph = trace(system, (np.ones(n), 0.0), (0.0, 1.2))
    (end,) = graph.solutions(1.2)
    w = M @ end.z - 1.0 + 1.2 * np.linspace(-1.0, 1.0, n)
    assert np.minimum(end.z, w) == pytest.approx(0.0, abs=1e-10)


# -- hidden unknowns -------------------------------------------------------------------------------


def inner(z, t, sw):
    level = sw.max(sw.min(z[1], t) ** 2, 1.0 - z[0])
    return np.array([z[0] ** 3 - level, z[1] - sw.abs(sw.relu(z[0]) - t) + 0.3 * sw.relu(z[0])])


def test_a_user_never_meets_hidden_unknowns(tmp_path):
    system = Switched(2, inner, names=["p", "q"])
    assert system.size > system.shown == 2
    seen = set()

    def watched(z, alpha):
        seen.add(z.shape)
        return z[0] - 0.8

    graph = trace(
        system,
        ([1.5, 3.0], -2.0),
        (-2.0, 2.0),
        events={"level": watched},
        record={"sum": lambda z, alpha: float(z.sum())},
    )
    assert seen == {(2,)}
    assert graph.names == ("p", "q")
    assert graph.special_points("event")[0]["p"] == pytest.approx(0.8, rel=1e-12)
    for point in graph.special_points():
        assert (point.z.shape, point.error.shape) == ((2,), (3,))
    assert all(piece.points.shape[1] == 3 for piece in graph.pieces)
    solution = graph.solutions(0.7)[0]
    assert solution["sum"] == solution["p"] + solution["q"]
    graph.save(tmp_path / "graph.npz")
    again = BranchGraph.load(tmp_path / "graph.npz", system=system)
    assert again.solutions(0.7)[0].z == pytest.approx(solution.z, rel=1e-12)
    assert {*graph.to_dataframe("points").columns} == {"piece", "component", "label", "alpha"} | {
        *("p", "q", "sum")
    }
    assert check_system(system, [([0.3, -0.2], 0.1), (solution.z, 0.7)])


def test_switches_have_names():
    last = np.array([0.0, 0.5])
    diodes = Switched(2, lambda z, t, sw: z - sw.relu(t - z - last), switches=["D1", "D2"])
    graph = trace(diodes, ([0.0, 0.0], -1.0), (-1.0, 1.0))
    messages = [point.message for point in graph.special_points("transition")]
    assert messages == ["D1 turns on", "D2 turns on"]
    assert graph.pieces[1].label == "off: D2; on: D1"
    entries = Switched(2, lambda z, t, sw: z - sw.relu(t - z), switches=["D"])
    assert entries.switches == ("D[0]", "D[1]")
    plain = Switched(2, lambda z, t, sw: z - sw.relu(z + t) - sw.abs(t), names=["x", "y"])
    assert plain.switches == ("relu 1", "relu 2", "abs 1")


# -- powers of magnitudes --------------------------------------------------------------------------

LAWS = {
    "abs": lambda z, p, sw: z * sw.abs(z) ** (p - 1.0),
    "relu": lambda z, p, sw: sw.relu(z) ** p - sw.relu(-z) ** p,
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("p", swept([1.852], [1.2, 2.5]))
def test_powers_of_magnitudes_pass_zero(law, p):
    """Head losses: a frozen magnitude is negative beyond its cell, where it has no power.

    Two nodes in a chain have one solution, which bracketing finds.
    """
    shift = np.array([0.0, 0.3])
    f = lambda z, alpha, sw: LAWS[law](z + shift, p, sw) + np.array([z[1] - alpha, -z[0]])  # noqa: E731
    graph = explore(Switched(2, f), (-1.0, 1.0))
    odd = lambda x: np.sign(x) * np.abs(x) ** p  # noqa: E731
    assert not graph.special_points("stopped")
    for alpha in (-0.7, -0.2, 0.1, 0.6):
        z1 = brentq(lambda y, alpha: odd(odd(y + 0.3)) + y - alpha, -9.0, 9.0, (alpha,), 1e-14)
        (found,) = graph.solutions(alpha)
        np.testing.assert_allclose(found.z, [odd(z1 + 0.3), z1], atol=1e-9)


@pytest.mark.parametrize("p", [1.1, 1.2, 2.5])
@pytest.mark.parametrize("y", [-0.5, -1e-3])
def test_slopes_beyond_the_cell_of_a_power_are_those_of_the_values(p, y):
    """z |z|^(p - 1) with a frozen magnitude: z stays, and the power is mirrored at zero."""
    law = Switched(1, lambda z, t, sw: z * sw.abs(z) ** (p - 1.0) - t)
    inside = Character.of(law.test_functions(np.array([0.5]), 0.0))
    slope = law.jacobian(np.array([y]), 0.0, inside)[0, 0]
    assert slope == pytest.approx(-p * abs(y) ** (p - 1.0), rel=1e-12)
