"""Quadratic programs, LASSO, games and ReLU layers against closed forms and every combination."""

from itertools import product

import numpy as np
import pytest
from pwscont_optimisation import BestReplies, Game, Lasso, QuadraticProgram, ReluLayer
from pwscont_optimisation.diabetes import FEATURES, PRODUCTS, correlations
from pwscont_optimisation.scenes import (
    CIRCLE,
    game,
    kojima_shindo,
    kojima_shindo_function,
    lasso,
    layer,
    lcp,
    parametric_qp,
    relu_fixed_points,
)
from scipy.optimize import minimize, minimize_scalar
from sweeps import swept
from switched_systems import agree, clip_solutions, distinct, lcp_solutions, relu_solutions

from pwscont import LCP, EndPoints, InvalidInputError, InvalidSystemError, check_system, explore

INTERVAL = (-2.0, 2.0)
#: Values of alpha that no transition of a random problem hits.
SLICES = (-1.7321, -0.6103, 0.1234, 0.9871, 1.6543)


def states(graph, alpha):
    return [solution.z for solution in graph.solutions(alpha)]


def transitions(graph):
    return [
        (point.alpha, point.message) for point in graph.special_points() if point.kind in CHANGES
    ]


CHANGES = ("transition", "nonsmooth fold")

# -- LASSO ---------------------------------------------------------------------------------------

#: From scikit-learn 1.9: lars_path(X, y, method="lasso") of its diabetes data, times 442.
PENALTIES = [
    949.43526038, 889.31378536, 452.89570053, 316.07337895, 130.1295371, 88.78429935,
    68.96479019, 19.98116536, 5.47753637, 5.08823629, 2.18226684, 1.31044134,
]  # fmt: skip
#: What happens there, as Efron et al. (2004) describe it: HDL (s3) leaves, and comes back.
STEPS = [
    "bmi+ enters", "s5+ enters", "bp+ enters", "s3- enters", "sex- enters", "s6+ enters",
    "s1- enters", "s4+ enters", "s2+ enters", "age- enters", "s3- leaves", "s3+ enters",
]  # fmt: skip
LEAST_SQUARES = [
    -10.0098663, -239.81564367, 519.84592005, 324.3846455, -792.17563855, 476.73902101,
    101.04326794, 177.06323767, 751.27369956, 67.62669218,
]  # fmt: skip


def test_lasso_path_of_the_diabetes_data():
    graph = lasso().run()
    assert graph.guarantee == "complete (unique by the system's promise)"
    (branch,) = graph.components()
    points = graph.itinerary(branch, -1)[1:-1]
    assert [point.alpha for point in points] == pytest.approx(PENALTIES, rel=1e-8)
    assert [point.passed(-1) for point in points] == STEPS
    (least,) = graph.solutions(0.0)
    assert least.z == pytest.approx(np.array(LEAST_SQUARES), rel=1e-7)
    assert least["|b|_1"] == pytest.approx(3459.97763244, rel=1e-8)


def is_lasso(X, y, penalty, b):
    """Tell whether b satisfies the conditions for a minimiser."""
    c, slack = X.T @ (y - X @ b), 1e-9 * (1.0 + np.abs(X.T @ y).max())
    on = np.abs(b) > 1e-12 * np.abs(b).max()
    return (np.abs(c) <= penalty + slack).all() and (
        np.abs(c - penalty * np.sign(b))[on] <= slack
    ).all()


def random_lasso(seed, p):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(p + 1, 3 * p + 2))
    X = rng.normal(size=(m, p)) @ (np.eye(p) + 0.5 * rng.normal(size=(p, p)) / np.sqrt(p))
    return X, X @ rng.normal(size=p) + rng.normal(size=m)


@pytest.mark.parametrize("seed", swept(range(5), range(5, 200)))
def test_random_lasso_paths_satisfy_the_conditions(seed):
    X, y = random_lasso(seed, 2 + seed % 19)
    check_lasso(X, y, Lasso(X, y))


@pytest.mark.slow
@pytest.mark.parametrize("p", [50, 100])
def test_long_lasso_paths(p):
    X, y = random_lasso(p, p)
    check_lasso(X, y, Lasso(X, y))


@pytest.mark.slow
def test_lasso_with_more_features_than_observations():
    X, y = random_lasso(7, 60)
    X, y = X[:25], y[:25]
    check_lasso(X, y, Lasso(X, y, unique=True), least=0.02)


def check_lasso(X, y, system, least=0.0):
    graph = explore(system, (least * system.greatest, 1.1 * system.greatest))
    assert graph.guarantee.startswith("complete (unique")
    for share in (0.03, 0.21, 0.55, 0.93, 1.05):
        (solution,) = graph.solutions(share * system.greatest)
        assert is_lasso(X, y, solution.alpha, solution.z)
    assert max(point.alpha for point in graph.special_points("transition")) == pytest.approx(
        system.greatest, rel=1e-12
    )


@pytest.mark.slow
def test_lasso_breaks_where_scikit_learn_says():
    lars_path = pytest.importorskip("sklearn.linear_model").lars_path
    for p in (10, 40, 100):
        X, y = random_lasso(p, p)
        alphas, *_ = lars_path(X, y, method="lasso")
        system = Lasso(X, y)
        graph = explore(system, (0.0, 1.1 * system.greatest))
        found = [point.alpha for point in graph.special_points("transition")]
        assert sorted(found, reverse=True) == pytest.approx(alphas[:-1] * len(y), rel=1e-9)


def test_lasso_does_not_depend_on_units():
    X, y = random_lasso(3, 6)
    unit = 10.0 ** np.array([-6, 3, 0, 5, -2, 1])
    one, other = Lasso(X, y), Lasso(X * unit, y * 1e4)
    interval = (0.0, 1.1 * Lasso(X, y).greatest)
    (b,) = explore(one, interval).solutions(0.0)
    (scaled,) = explore(other, (0.0, 1.1 * other.greatest)).solutions(0.0)
    assert scaled.z * unit / 1e4 == pytest.approx(b.z, rel=1e-8)


def test_words_of_the_lasso():
    system = Lasso.from_products(correlations(), PRODUCTS, FEATURES)
    character = system.character(np.zeros(10), 930.0)
    assert system.label(character) == "active: bmi+"
    none = system.character(np.zeros(10), 1000.0)
    assert system.label(none) == "active: none"
    assert system.describe_transition(character, none) == "bmi+ leaves"
    many = Lasso(np.eye(20), np.ones(20))
    assert many.label(many.character(np.ones(20), 0.1)) == "20 active"


# -- quadratic programs --------------------------------------------------------------------------


def qp_solutions(Q, q, A, b):
    """Return all (x, mu) that satisfy the conditions of Karush, Kuhn and Tucker, over 2^m."""
    (m, n), found = A.shape, []
    for active in product([False, True], repeat=m):
        on = np.array(active)
        K = np.block([[Q, A.T], [np.where(on[:, None], A, 0.0), np.diag((~on).astype(float))]])
        if np.linalg.matrix_rank(K) < n + m:
            continue
        z = np.linalg.solve(K, np.concatenate([-q, np.where(on, b, 0.0)]))
        if (z[n:] >= -1e-9).all() and (b - A @ z[:n] >= -1e-9).all():
            found.append(z)
    return distinct(found)


def random_qp(seed, convex):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    Q = rng.normal(size=(n, n))
    Q = Q @ Q.T + 0.1 * np.eye(n) if convex else Q + Q.T
    A, b = np.vstack([rng.normal(size=(m, n)), np.eye(n), -np.eye(n)]), rng.uniform(0.5, 2, m)
    b = np.concatenate([b, np.full(2 * n, 3.0)])
    e = np.concatenate([0.1 * rng.normal(size=m), np.zeros(2 * n)])
    return Q, rng.normal(size=n), A[: m + 2 * n], b, 2.0 * rng.normal(size=n), e


@pytest.mark.parametrize("seed", swept(range(4), range(4, 80)))
@pytest.mark.parametrize("convex", [True, False])
@pytest.mark.sweep(3)
def test_random_quadratic_programs(seed, convex):
    Q, q, A, b, d, e = random_qp(seed, convex)
    graph = explore(QuadraticProgram(Q, q, A, b, d, e), INTERVAL)
    # where more constraints meet than there are variables, rounding cannot always rule it out
    assert graph.guarantee.startswith(("complete", "balanced"))
    for alpha in SLICES[1:4]:
        truth, found = qp_solutions(Q, q + alpha * d, A, b + alpha * e), states(graph, alpha)
        assert agree(truth, found) or not graph.is_complete  # which may miss a pair
        assert all(any(agree([z], [y]) for y in truth) for z in found)
        assert len(truth) == 1 or not convex


def test_regions_of_model_predictive_control():
    """The pieces are the regions of Bemporad et al. (2002), with their laws of control."""
    graph = parametric_qp().run()
    assert graph.guarantee == "complete"
    H, F = (
        np.array([[1.5064, 0.4838], [0.4838, 1.5258]]),
        np.array([[9.6652, 7.0732], [5.2115, -7.0879]]),
    )
    for alpha in np.linspace(-1.45, 1.45, 30):
        (found,) = graph.solutions(alpha)
        linear = F @ [alpha, 0.5 - 0.3 * alpha]
        best = minimize(
            lambda u, g=linear: (0.5 * u @ H @ u + g @ u, H @ u + g),
            np.zeros(2),
            jac=True,
            bounds=[(-2.0, 2.0)] * 2,
            options={"ftol": 1e-15, "gtol": 1e-10},
        )
        assert found.z[:2] == pytest.approx(best.x, abs=1e-6)
    # the law without constraints, printed in the paper to four decimals
    free, state = np.array([[-5.9220, -6.8883], [-1.5379, 6.8291]]), np.array([0.1, 0.05])
    u = QuadraticProgram(H, F @ state, np.vstack([np.eye(2), -np.eye(2)]), [2.0] * 4)
    (only,) = explore(u, (0.0, 1.0)).solutions(0.5)
    assert only.z[:2] == pytest.approx(free @ state, abs=2e-4)


def test_an_infeasible_program_has_no_solution():
    """x <= alpha and x >= 0: nothing below alpha = 0, where the multipliers run to infinity."""
    system = QuadraticProgram([[1.0]], [1.0], [[1.0], [-1.0]], [0.0, 0.0], e=[1.0, 0.0])
    graph = explore(system, (-1.0, 1.0))
    assert graph.count(-0.5) == 0
    (found,) = graph.solutions(0.5)
    assert found.z == pytest.approx(np.array([0.0, 0.0, 1.0]), abs=1e-12)


def test_words_of_quadratic_programs():
    points = parametric_qp().run().special_points("transition")
    assert points[0].message == "u_0 max becomes inactive"
    system = QuadraticProgram([[1.0]], [0.0], [[1.0]], [1.0])
    assert system.names() == ("x1", "mu_g1")


# -- complementarity -----------------------------------------------------------------------------


def random_lcp(seed, n):
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(n, n))
    if seed % 2:  # a P-matrix
        skew = rng.normal(size=(n, n))
        M = M @ M.T + 0.1 * np.eye(n) + skew - skew.T
    return M, rng.normal(size=n), rng.normal(size=n)


@pytest.mark.parametrize("seed", swept(range(6), range(6, 300)))
@pytest.mark.sweep(2)
def test_random_linear_complementarity(seed):
    M, q, d = random_lcp(seed, 1 + seed % 10)
    graph = explore(LCP(M, q, d), INTERVAL)
    assert graph.guarantee.startswith("complete")
    for alpha in SLICES[1 : 3 if len(q) > 7 else 5]:
        truth = lcp_solutions(M, q + alpha * d)
        assert agree(truth, states(graph, alpha))
        assert len(truth) == 1 or not seed % 2


def test_the_scene_of_linear_complementarity():
    graph = lcp().run()
    assert graph.guarantee == "complete"
    rng = np.random.default_rng(1)
    M = rng.normal(size=(5, 5)) + np.eye(5)
    q, d = rng.normal(size=(2, 5))
    for alpha in (-2.5, -1.7, 0.1, 0.36, 1.5, 2.9):
        assert agree(lcp_solutions(M, q + alpha * d), states(graph, alpha))
    assert max(count for *_, count in graph.multiplicity()) == 5


@pytest.mark.slow
def test_kojima_shindo_turns_back():
    """On z_3 = z_4 = 0 the first two equations have a fold at the least t on an ellipse."""
    graph = kojima_shindo().run()
    assert graph.guarantee == "balanced"

    def t(a):
        b = np.sqrt(2.0 - a - 2.0 * a**2)
        return 6.0 - 3.0 * a**2 - 2.0 * a * b - 2.0 * b**2

    least = minimize_scalar(t, bounds=(0.0, 0.7), method="bounded", options={"xatol": 1e-10})
    (fold,) = graph.special_points("fold")
    assert fold.alpha == pytest.approx(least.fun, rel=1e-12)
    assert [count for *_, count in graph.multiplicity()] == [1, 3]
    for value in (-0.9, 0.0, 1.5, 1.95, 2.2, 2.45):
        found = states(graph, value)
        assert len(found) == (1 if value < fold.alpha else 3)
        for z in found:
            w = kojima_shindo_function(z, value)
            assert min(z.min(), w.min()) >= -1e-9
            assert z @ w == pytest.approx(0.0, abs=1e-9)
    (regular,) = states(graph, 0.0)
    assert regular == pytest.approx(np.array([1.5**0.5, 0.0, 0.0, 0.5]), abs=1e-12)


# -- games ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", swept(range(6), range(6, 120)))
@pytest.mark.sweep(4)
def test_random_games(seed):
    rng, n = np.random.default_rng(seed), 1 + seed % 6
    B = rng.normal(size=(n, n)) * (1.0 - np.eye(n))
    a, c = rng.normal(size=(2, n))
    graph = explore(BestReplies(B, a, c), INTERVAL)
    assert graph.guarantee.startswith("complete")
    assert set(graph.balances()) == {1}  # actions are bounded
    for alpha in SLICES[1 : 3 if n > 5 else 5]:
        assert agree(clip_solutions(B, a + alpha * c), states(graph, alpha))


@pytest.mark.parametrize("delta", [0.45, 0.55])
def test_uniqueness_on_a_circle(delta):
    """Bramoullé, Kranton and D'Amours (2014): below 1 / |smallest eigenvalue| there is one."""
    graph = game(delta).run()
    threshold = 1.0 / abs(np.linalg.eigvalsh(CIRCLE)[0])
    assert threshold == pytest.approx(0.5, rel=1e-14)
    most = max(count for *_, count in graph.multiplicity())
    assert most == (1 if delta < threshold else 3)


def test_identical_players_on_a_circle():
    """At delta = 1 two specialists who face each other, or the others, or all play alpha / 3."""
    graph = explore(BestReplies(-1.0 * CIRCLE, np.zeros(4), np.ones(4)), (-0.5, 3.5))
    alpha = 0.7
    truth = [[alpha, 0, alpha, 0], [0, alpha, 0, alpha], [alpha / 3.0] * 4]
    assert agree(np.array(truth), states(graph, alpha))


def test_what_players_do_in_words():
    graph = game().run()
    messages = [message for _, message in transitions(graph)]
    assert messages[:2] == ["player 3 leaves its lower bound", "player 1 leaves its lower bound"]


def test_games_with_curved_payoffs():
    """Two firms (Cournot) with price 1 / (1 + x1 + x2) and costs c x, capacity 1."""

    def marginal(x, cost):
        total = 1.0 + x[0] + x[1]
        return (total - x) / total**2 - cost

    graph = explore(Game(marginal, n=2), (0.1, 1.2), search=EndPoints(), parameter="cost")
    assert graph.count(1.1) == 1
    (idle,) = states(graph, 1.1)
    assert idle == pytest.approx(np.zeros(2), abs=1e-12)
    (full,) = states(graph, 0.15)
    assert full == pytest.approx(np.ones(2))  # (3 - 1) / 9 > 0.15
    (inner,) = states(graph, 0.5)  # (1 + x) / (1 + 2 x)^2 = 1/2
    x = max(np.roots([2.0, 1.0, -0.5]))
    assert inner == pytest.approx(np.full(2, x), rel=1e-10)


@pytest.mark.parametrize(
    "n", [2, pytest.param(1, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)]
)
def test_bounds_that_are_left_where_the_payoff_bends(n):
    """x_i^2 = t between the bounds: at t = 0 bounds are left, and dH/dx vanishes; x = 0 alone."""
    graph = explore(Game(lambda x, t: t - x**2, n=n), (-1.0, 1.0))
    assert [graph.count(t) for t in (-0.5, 0.0, 0.05, 0.5)] == [1, 1, 1, 1]
    assert "infinitely" not in graph.guarantee
    (half,) = states(graph, 0.25)
    assert half == pytest.approx(np.full(n, 0.5))


# -- ReLU layers ---------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", swept(range(6), range(6, 120)))
@pytest.mark.sweep(2)
def test_random_layers(seed):
    rng, n = np.random.default_rng(seed), 1 + seed % 10
    W, (b, c) = rng.normal(size=(n, n)) / np.sqrt(n), rng.normal(size=(2, n))
    W[0, 0] = 1.6 if seed % 3 == 0 else W[0, 0]
    graph = explore(ReluLayer(W, b, c), INTERVAL)
    assert graph.guarantee.startswith("complete")
    for alpha in SLICES[1 : 3 if n > 7 else 5]:
        assert agree(relu_solutions(W, b + alpha * c), states(graph, alpha))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_layers_of_fourteen_units(seed):
    rng = np.random.default_rng(seed)
    W, (b, c) = rng.normal(size=(14, 14)) / 14.0**0.5, rng.normal(size=(2, 14))
    graph = explore(ReluLayer(W, b, c), INTERVAL)
    for alpha in (-0.6103, 0.9871):
        assert agree(relu_solutions(W, b + alpha * c), states(graph, alpha))


@pytest.mark.parametrize("units", [8, pytest.param(20, marks=pytest.mark.slow)])
def test_four_units_that_excite_themselves(units):
    """With the four on or off as given, the others are a contraction: 16 states, each found so."""
    graph = relu_fixed_points(units).run()
    W, b, _ = layer(units, 0)
    truth = []
    for on in product([False, True], repeat=4):
        z = np.zeros(units)
        for _ in range(200):  # Gauss-Seidel; an excited unit that is on solves its own equation
            z = np.maximum(W @ z + b, 0.0)
            drive = (W[:4] @ z + b[:4]) - 1.6 * z[:4]
            z[:4] = np.where(on, -drive / 0.6, 0.0)
        truth.append(z)
    assert agree(truth, states(graph, 0.0))
    assert "start" not in {str(p.kind) for p in graph.special_points() if p.alpha in (-1.0, 1.0)}
    assert (graph.count(-0.9), graph.count(0.0), graph.count(0.9)) == (0, 16, 0)
    assert graph.guarantee == "balanced"


def test_units_turn_on_and_off():
    graph = explore(ReluLayer([[1.6]], [-1.0], [1.0]), (0.0, 2.0))
    (fold,) = graph.special_points("nonsmooth fold")
    assert fold.alpha == pytest.approx(1.0, rel=1e-14)
    assert fold.message in ("unit 1 turns off", "unit 1 turns on")


# -- systems and errors --------------------------------------------------------------------------

SYSTEMS = {
    "lasso": lambda: Lasso(*random_lasso(1, 4)),
    "convex": lambda: QuadraticProgram(*random_qp(2, True)),
    "nonconvex": lambda: QuadraticProgram(*random_qp(3, False)),
    "game": lambda: game().system,
    "layer": lambda: relu_fixed_points(8).system,
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_system_keeps_its_contract(name):
    system = SYSTEMS[name]()
    rng = np.random.default_rng(0)
    points = [(rng.normal(size=system.size), float(rng.uniform(0.5, 2))) for _ in range(10)]
    report = check_system(system, points)
    assert not report.defects, report


WRONG = {
    "X must be a matrix": lambda: Lasso([1.0, 2.0], [1.0, 2.0]),
    r"y has shape \(3,\), expected \(2,\)": lambda: Lasso(np.eye(2), np.ones(3)),
    "feature b2 is zero in all": lambda: Lasso([[1.0, 0.0]], [1.0]),
    "names must be 2 texts, got 1": lambda: Lasso(np.eye(2), np.ones(2), ["a"]),
    "Q must be symmetric": lambda: QuadraticProgram([[1, 1], [0, 1]], [0, 0], [[1, 0]], [1]),
    "Q must be symmetric, and": lambda: QuadraticProgram(
        [[1e9, 1e-3], [-1e-3, 1]], [0, 0], [[1, 0]], [1]
    ),
    "Q must be symmetric, and not": lambda: QuadraticProgram(
        [[1, 2e-8, 2e-8], [2e-8, 1e-16, 1e-16], [2e-8, -1e-16, 1e-16]], [0] * 3, [[1, 0, 0]], [1]
    ),
    "gram must be symmetric": lambda: Lasso.from_products([[2.0, 1.0], [0.5, 2.0]], [1.0, 1.0]),
    "constraint g1 is on no variable": lambda: QuadraticProgram([[1]], [0], [[0]], [1]),
    r"A has shape \(1, 2\), expected \(1, 1\)": lambda: QuadraticProgram([[1]], [0], [[1, 2]], [1]),
    "constraints must be 1 texts": lambda: QuadraticProgram(
        [[1]], [0], [[1]], [1], constraints=["a", "b"]
    ),
    r"B has shape \(1, 2\)": lambda: BestReplies([[1, 2]], [1], [1]),
    r"c has shape \(2,\), expected \(1,\)": lambda: ReluLayer([[1]], [1], [1, 2]),
    "players must be 1 texts, got 2": lambda: BestReplies([[0]], [1], [1], players=["a", "b"]),
    "lower and upper must be numbers": lambda: BestReplies([[0]], [1], [1], upper=[1, 2]),
    "marginal must be a function": lambda: Game(3.0),
    "units must be at least 6, got 3": lambda: relu_fixed_points(3),
    "seed must not be negative, got -1": lambda: relu_fixed_points(seed=-1),
    "n must be from 1 to 1000, got 0": lambda: lcp(0),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_said(message):
    with pytest.raises(InvalidInputError, match=message):
        WRONG[message]()


def test_bounds_the_wrong_way_round():
    with pytest.raises(InvalidSystemError, match="lower <= upper"):
        BestReplies([[0.0]], [1.0], [1.0], lower=2.0)
