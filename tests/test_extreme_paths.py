"""Extreme geometry, numbers and lengths of paths."""

from fractions import Fraction

import numpy as np
import pytest
from extreme_parts import (
    COMPLETE,
    EPS,
    LOADED,
    Path,
    assert_matches,
    one_node,
    pieces_of,
    two_nodes,
)
from pwscont_coulomb import AffineLoad, ContactBody, CoulombFriction, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from sweeps import swept

from pwscont import (
    BranchGraph,
    ExactLinear,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    Switched,
    explore,
    trace,
)
from pwscont.basics.errors import PwscontError

# -- transversality lost -----------------------------------------------------------------------


class Grazing(PiecewiseLinearSystem):
    """The path z1 = alpha, z2 = z1 + slope (z1 - 1/4) meets the interface z2 = z1 at alpha = 1/4.

    Beyond it z2 rises by ``bend`` times the distance from the interface more.
    """

    size = 2

    def __init__(self, slope, bend):
        self.slope, self.bend = slope, bend

    def test_functions(self, z, alpha):
        return np.array([z[1] - z[0]])

    def residual(self, z, alpha, character):
        beyond = self.bend * (z[1] - z[0]) if character.signs[0] else 0.0
        return np.array([z[0] - alpha, z[1] - z[0] - self.slope * (z[0] - 0.25) - beyond])


@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arclength"])
@pytest.mark.parametrize("slope", [1e-4, 1e-8, 1e-10])
@pytest.mark.parametrize("bend", [0.5, -3.0, 3.0])
@pytest.mark.sweep(5)
def test_a_path_nearly_along_an_interface(stepper, slope, bend):
    """Alpha is known to EPS / slope there, and the error says so; the way on is not lost."""
    graph = trace(Grazing(slope, bend), ([-1.0, -1.0], -1.0), (-1.0, 1.0), stepper=stepper)
    (point,) = graph.special_points("transition" if bend < 1.0 else "nonsmooth fold")
    off = abs(point.alpha - 0.25)
    assert off <= 16.0 * EPS / slope
    assert off <= 10.0 * point.error[-1]
    assert point.error[-1] <= 1e3 * EPS / slope
    assert len(graph.pieces) == 2
    last = graph.pieces[-1].points[-1]
    assert last[1] - last[0] == pytest.approx(
        slope * (last[2] - 0.25) / (1.0 - bend), rel=1e-3 if slope > 1e-9 else 0.1
    )


class Parabola(PiecewiseSystem):
    """y = x^2 and x + m min(y - d^2, 0) = alpha: tangent to the interface y = 0 as d falls."""

    size = 2

    def __init__(self, depth, m):
        self.depth, self.m = depth, m

    def test_functions(self, z, alpha):
        return np.array([z[1] - self.depth**2])

    def test_jacobian(self, z, alpha):
        return np.array([[0.0, 1.0, 0.0]])

    def residual(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m * (z[1] - self.depth**2)
        return np.array([z[1] - z[0] ** 2, z[0] + bend - alpha])

    def jacobian(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m
        return np.array([[-2.0 * z[0], 1.0, 0.0], [1.0, bend, -1.0]])


@pytest.mark.parametrize("m", [0.3, -0.9, 5.0])
@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.sweep(10)
def test_a_curved_path_nearly_tangent_to_an_interface(depth, m):
    """x^2 is known to all its digits next to zero, and so are both transitions."""
    graph = trace(Parabola(depth, m), ([-0.9, 0.81], -0.9), (-1.0, 1.0))
    transitions = graph.special_points("transition")
    np.testing.assert_allclose(sorted(p.alpha for p in transitions), [-depth, depth], rtol=1e-12)
    for point in transitions:
        assert abs(abs(point.alpha) - depth) <= 10.0 * point.error[-1] <= 1e-5 * depth
    assert not graph.special_points("stopped")
    for at in (-0.5, 0.5):
        (solution,) = graph.solutions(at)
        np.testing.assert_allclose(solution.z, [at, at**2], rtol=1e-14)


class RaisedParabola(Parabola):
    """The same with the interface at y = level + depth^2: rounding of y blurs where they meet."""

    def __init__(self, level, depth, m):
        super().__init__(depth, m)
        self.level = level
        self.interface = level + depth**2

    def test_functions(self, z, alpha):
        return np.array([z[1] - self.interface])

    def residual(self, z, alpha, character):
        bend = 0.0 if character.signs[0] else self.m * (z[1] - self.interface)
        return np.array([z[1] - z[0] ** 2 - self.level, z[0] + bend - alpha])


@pytest.mark.parametrize("m", [0.3, -0.9, 5.0])
@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-7, 3e-8, 1e-8, 1e-10, 0.0])
@pytest.mark.parametrize("level", [1.0, 0.3, 1e3])
@pytest.mark.sweep(30)
def test_a_curved_path_tangent_to_an_interface_within_rounding(level, depth, m):
    """x^2 = d^2 within EPS is x = d within EPS / d. Where d is rounding, the message says so."""
    system = RaisedParabola(level, depth, m)
    true = float(Fraction(system.interface) - Fraction(level)) ** 0.5
    graph = trace(system, ([-0.9, 0.81 + level], -0.9), (-1.0, 1.0))
    found = [*graph.special_points("transition"), *graph.special_points("stopped")]
    for point in found:
        assert abs(abs(point.alpha) - true) <= 10.0 * point.error[-1]
    if true**2 >= 4.0 * EPS * level:
        assert [point.kind for point in found] == ["transition", "transition"]
    elif graph.special_points("stopped"):
        assert "tangent to the interface" in found[-1].message
        assert graph.guarantee != COMPLETE


# -- gaps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [1e-300, 1e-15, 1e-12, 1e-6, 1e6, 1e12, 1e100])
@pytest.mark.sweep(3)
def test_any_gap(gap):
    path = Path(one_node(gap=gap), [0.25, 0.0], [0.0, 1.0], 4.0)
    assert_matches(explore(path.system(), path.interval), path)
    if gap < 1e50:
        path = Path(one_node(gap=gap), [0.25, 0.0], [0.0, gap], 4.0, (-10.0, 10.0))
        assert_matches(explore(path.system(), path.interval), path)


@pytest.mark.parametrize("far", [1e3, 1e8, 1e12, 1e16, 1e100])
@pytest.mark.parametrize("near", [0.0, 1e-12, 1e-3])
@pytest.mark.sweep(8)
def test_a_node_that_never_touches(far, near):
    """The gap of one node says nothing of the accuracy that the other one needs."""
    path = Path(two_nodes(gap=(near, far)), *LOADED, 4.0)
    graph = explore(path.system(), path.interval)
    assert_matches(graph, path)
    traced = trace(path.system(), (np.zeros(8), -2.0), path.interval)
    assert {p.label for p in traced.pieces} <= {piece[0] for piece in path.exact()}


# -- the range of floating-point numbers -------------------------------------------------------


def graphs_at(load):
    """Yield explored graphs, as (alphas in units of the interval, counts), at a scale of load."""
    body = contact_body(one_node())
    loads = CoulombLoad(body, AffineLoad([0.25 * load, 0.0], [0.0, load]), 4.0)
    yield lambda stepper: explore(loads, (-2.0, 2.0), stepper=stepper), 1.0
    inverse = CoulombLoad(body, AffineLoad([0.25 * load, 0.0], [0.0, 1.0]), 4.0)
    yield lambda stepper: explore(inverse, (-2.0 * load, 2.0 * load), stepper=stepper), load
    start = (np.array([0.0, 0.0, -0.25 * load, 0.0]), 0.0)
    yield lambda stepper: trace(loads, start, (-2.0, 2.0), stepper=stepper), 1.0


def graph_unless_refused(make, load):
    """Return the graph; None where the load is refused because of its units, as it may be."""
    if 1e-100 <= load <= 1e100:
        return make()
    try:
        return make()
    except PwscontError as refused:
        message = str(refused)
    assert "units" in message
    return None


@pytest.mark.parametrize("stepper", [ExactLinear(), PseudoArclength()], ids=["exact", "arclength"])
@pytest.mark.parametrize(
    "load", [1e-307, 1e-300, 1e-200, 1e-150, 1e-100, 1e100, 1e150, 1e200, 1e300]
)
@pytest.mark.sweep(3)
def test_loads_near_the_ends_of_the_range_of_numbers(load, stepper):
    """Either everything is right, or it is refused in words that say what to do."""
    for make, unit in graphs_at(load):
        graph = graph_unless_refused(lambda make=make: make(stepper), load)
        if graph is None:
            continue
        folds = sorted(point.alpha / unit for point in graph.special_points("nonsmooth fold"))
        np.testing.assert_allclose(folds, [-1.0, -0.5], rtol=1e-12)
        assert [count for _, _, count in graph.multiplicity()] == [1, 3, 1]
        assert all(np.isfinite(piece.points).all() for piece in graph.pieces)


@pytest.mark.parametrize("load", [1e-300, 1e-200, 1e-100, 1e100, 1e200, 1e300])
@pytest.mark.sweep(2)
def test_friction_under_loads_near_the_ends_of_the_range_of_numbers(load):
    system = CoulombFriction(contact_body(one_node()), [load, -3.0 * load])
    graph = graph_unless_refused(lambda: explore(system, (0.0, 5.0)), load)
    if graph is None:
        return
    (fold,) = graph.special_points("nonsmooth fold")
    assert fold.alpha == pytest.approx(3.0, rel=1e-14)


# -- the unloaded body -------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.3, 0.7, 4.0])
@pytest.mark.parametrize(("p", "seeds"), [(1, 24), (2, 6)])
@pytest.mark.sweep(8)
def test_a_path_through_the_unloaded_body(p, seeds, friction):
    """All tests vanish at alpha = 0. The path arrives there with rounding, and must see that."""
    for seed in range(seeds):
        body = random_body(p, seed)
        f1 = random_vector(body.n, [seed, 7])
        path = Path(body, np.zeros(body.n), f1, friction, (-2.0, 3.0))
        assert_matches(explore(path.system(), path.interval), path)


# -- ten thousand transitions ------------------------------------------------------------------


class NestedSawteeth(PiecewiseLinearSystem):
    """z1 = S(z0), z2 = W(z1), alpha = z0 + z2 with two sawteeth S and W.

    S has the values ``v`` at the whole numbers and is straight between them, so does W with
    ``w``. Each tooth of S crosses all kinks of W; alpha turns back at each of these. A cell is
    bounded by four tests, its neighbours on both saws, however many there are.
    """

    size = 3

    def __init__(self, teeth, kinks):
        self.first = -(teeth // 2)
        self.v = np.where(np.arange(teeth + 1) % 2, kinks + 0.7, 0.3)
        self.w = np.where(np.arange(kinks + 2) % 2, 2.1 / kinks, 0.1 / kinks)
        self.turns = self.first + np.arange(1.0, teeth)
        self.kinks = np.arange(1.0, kinks + 1.0)

    def test_functions(self, z, alpha):
        return np.concatenate([z[0] - self.turns, z[1] - self.kinks])

    def test_jacobian(self, z, alpha):
        return self._gradients

    @property
    def _gradients(self):
        rows = np.zeros((len(self.turns) + len(self.kinks), 4))
        rows[: len(self.turns), 0] = rows[len(self.turns) :, 1] = 1.0
        return rows

    def place(self, character):
        """Return the numbers of the tooth of S and of the stretch of W."""
        turns = len(self.turns)
        return sum(character.signs[:turns]), sum(character.signs[turns:])

    def bounding_tests(self, character):
        (i, j), turns, kinks = self.place(character), len(self.turns), len(self.kinks)
        own = [k for k in (i - 1, i) if 0 <= k < turns]
        return own + [turns + k for k in (j - 1, j) if 0 <= k < kinks]

    def slopes(self, i, j):
        return self.v[i + 1] - self.v[i], self.w[j + 1] - self.w[j]

    def residual(self, z, alpha, character):
        i, j = self.place(character)
        steep, flat = self.slopes(i, j)
        first = z[1] - self.v[i] - steep * (z[0] - self.first - i)
        return np.array([first, z[2] - self.w[j] - flat * (z[1] - j), z[0] + z[2] - alpha])

    def jacobian(self, z, alpha, character):
        steep, flat = self.slopes(*self.place(character))
        return np.array([[-steep, 1.0, 0, 0], [0, -flat, 1.0, 0], [1.0, 0, 1.0, -1.0]])

    def scale(self, lo, hi):
        return np.array([hi - lo, len(self.kinks), 1.0])

    def exact_alphas(self):
        """Return alpha at every kink in the order of the path, as rational numbers."""
        v, w = [Fraction(float(x)) for x in self.v], [Fraction(float(x)) for x in self.w]
        alphas, kinks = [], range(1, len(w) - 1)
        for i in range(len(v) - 1):
            if i:
                j = int(v[i])
                alphas.append(self.first + i + w[j] + (w[j + 1] - w[j]) * (v[i] - j))
            order = kinks if v[i + 1] > v[i] else reversed(kinks)
            alphas += [self.first + i + (j - v[i]) / (v[i + 1] - v[i]) + w[j] for j in order]
        return alphas


@pytest.mark.parametrize(
    ("stepper", "teeth"),
    swept(
        [(ExactLinear(), 9)],
        [(PseudoArclength(), 5), (ExactLinear(), 101), (PseudoArclength(), 11)],
    ),
    ids=lambda value: str(value) if isinstance(value, int) else type(value).__name__,
)
def test_thousands_of_transitions_without_drift(stepper, teeth):
    system = NestedSawteeth(teeth, kinks=100)
    lo, hi = system.first - 1.0, system.first + teeth + 1.0
    graph = trace(system, ([lo - 1.0, -50.0, -1.0], lo), (lo, hi), stepper=stepper)
    expected = system.exact_alphas()
    (component,) = graph.components()
    found = [point.alpha for point in graph.itinerary(component)[1:-1]]
    assert len(found) == len(expected) == 101 * teeth - 1
    errors = [abs(float(Fraction(a) - b)) for a, b in zip(found, expected, strict=True)]
    first, last = max(errors[:100]), max(errors[-100:])
    assert last <= 100.0 * first
    assert max(errors) <= 64.0 * EPS * (hi - lo)
    assert len(graph.special_points("nonsmooth fold")) == len(expected)
    if len(expected) < 2000:
        assert set(graph.balances()) == {1}


# -- what must not matter ----------------------------------------------------------------------


def mirrored(label):
    return label.translate(str.maketrans("+-", "-+"))


def swapped(label):
    first, second = (part.split(" ", 2)[2] for part in label.split(", "))
    return f"node 1 {second}, node 2 {first}"


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("load", [True, False], ids=["load", "friction"])
@pytest.mark.sweep(3)
class TestInvariance:
    """The same body described otherwise has the same branches."""

    def systems(self, seed, load, order=(0, 1), side=1.0, turn=1.0):
        body = random_body(2, seed, gap=bool(seed % 2))
        order = list(order)
        same = ContactBody(body.A, body.N[order], side * body.T[order], body.gap[order])
        f0, f1 = random_vector(body.n, [seed, 1]), random_vector(body.n, [seed, 2])
        if load:
            return CoulombLoad(same, AffineLoad(f0, turn * f1), np.array([3.0, 5.0])[order])
        return CoulombFriction(same, 3.0 * f0, profile=np.array([1.0, 1.5])[order])

    def graph(self, seed, load, **how):
        system = self.systems(seed, load, **how)
        return explore(system, (-2.0, 2.0) if load else (0.0, 3.0))

    def assert_same(self, graph, other, rename=str, turn=1.0):
        ends = [sorted((turn * p.interval[0], turn * p.interval[1])) for p in other.pieces]
        found = sorted(
            (rename(p.label), *e, p.det_sign) for p, e in zip(other.pieces, ends, strict=True)
        )
        expected = pieces_of(graph)
        assert [(a[0], a[3]) for a in found] == [(b[0], b[3]) for b in expected]
        np.testing.assert_allclose(
            [a[1:3] for a in found], [b[1:3] for b in expected], rtol=1e-11, atol=1e-11
        )

    def test_order_of_the_nodes(self, seed, load):
        other = self.graph(seed, load, order=(1, 0))
        self.assert_same(self.graph(seed, load), other, rename=swapped)

    def test_sign_of_the_tangent_direction(self, seed, load):
        self.assert_same(self.graph(seed, load), self.graph(seed, load, side=-1.0), rename=mirrored)

    def test_sign_of_the_parameter(self, seed, load):
        if not load:
            pytest.skip("a coefficient of friction has no other sign")
        other = self.graph(seed, load, turn=-1.0)
        self.assert_same(self.graph(seed, load), other, turn=-1.0)

    def test_direction_in_which_a_component_is_followed(self, seed, load):
        system, graph = self.systems(seed, load), self.graph(seed, load)
        lo, hi = graph.interval
        for component in graph.components():
            ends = {piece.start for piece in component} ^ {piece.end for piece in component}
            traced = [
                trace(system, (graph.point(i).z, graph.point(i).alpha), (lo, hi)) for i in ends
            ]
            for one in traced:
                expected = BranchGraph(graph.special_points(), component, (lo, hi))
                self.assert_same(expected, one)


class NearlyDependent(PiecewiseSystem):
    """P (z - g(alpha)) = 0 with singular values 1 and 1e-12 of P: rounding moves z by 1e-4."""

    size = 2
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    P = turn @ np.diag([1.0, 1e-12]) @ turn @ turn

    def path(self, alpha):
        return np.array([np.sin(3.0 * alpha), np.cos(2.0 * alpha)])

    def test_functions(self, z, alpha):
        return np.zeros(0)

    def residual(self, z, alpha, character):
        return self.P @ z - self.P @ self.path(alpha)

    def jacobian(self, z, alpha, character):
        along = np.array([3.0 * np.cos(3.0 * alpha), -2.0 * np.sin(2.0 * alpha)])
        return np.column_stack([self.P, -self.P @ along])


def test_steps_are_as_true_as_rounding_allows():
    """Rounding refuses no step, and the stated errors cover the errors."""
    system = NearlyDependent()
    graph = trace(system, (system.path(0.0), 0.0), (-1.0, 1.0))
    for alpha in (-0.9, -0.3, 0.2, 0.7):
        (found,) = graph.solutions(alpha)
        assert (np.abs(found.z - system.path(alpha)) <= 10.0 * found.error[:-1]).all()
        assert found.error[:-1].max() < 0.2


@pytest.mark.slow
def test_constants_that_cancel_in_the_equation_of_another_unknown():
    """x^3 / 3 - x = alpha has folds at x = 1 and -1; (y + 1e6) - 1e6 = sin(3 x) rounds y."""
    system = Switched(
        2,
        lambda z, a, sw: [z[0] ** 3 / 3 - z[0] - a, (z[1] + 1e6) - 1e6 - np.sin(3.0 * z[0])],
    )
    graph = trace(system, ([0.0, 0.0], 0.0), (-2.0, 2.0))
    folds = sorted(point.alpha for point in graph.special_points("fold"))
    assert folds == pytest.approx([-2.0 / 3.0, 2.0 / 3.0], abs=1e-6)
    assert [graph.count(alpha) for alpha in (-1.5, -0.5, 0.1, 1.5)] == [1, 3, 3, 1]
