"""What a system says of its kinks, H_after - H_before = c kappa (F11), and what comes of it."""

import numpy as np
import pytest
from pwscont_circuits.scenes import diode_ladder, schmitt_trigger
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_structures import ObstacleProblem
from random_bodies import contact_body, random_body

from pwscont import (
    InvalidSystemError,
    PiecewiseLinearSystem,
    StartNotFoundError,
    check_system,
    trace,
)
from pwscont.basics.arrays import dense
from pwscont.bench.calls import counted

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


class Switches(PiecewiseLinearSystem):
    """A z + C |z - k| = a + alpha b with a diagonal C."""

    def __init__(self, n, seed):
        rng = np.random.default_rng(seed)
        self.size, self.k = n, rng.normal(size=n)
        self.A = 0.3 / np.sqrt(n) * rng.normal(size=(n, n)) + 1.5 * np.eye(n)
        self.C = rng.uniform(-1.0, 1.0, n)
        self.a, self.b = rng.normal(size=n), 3.0 * rng.normal(size=n)

    def test_functions(self, z, alpha):
        return z - self.k

    def residual(self, z, alpha, character):
        side = np.where(character.array, 1.0, -1.0)
        return self.A @ z + self.C * side * (z - self.k) - self.a - alpha * self.b

    def jacobian(self, z, alpha, character):
        side = np.where(character.array, 1.0, -1.0)
        return np.column_stack([self.A + np.diag(self.C * side), -self.b])


class Told(Switches):
    """The same, and c, wrong by a factor if there is one."""

    factor = 1.0

    def kink(self, before, after, test):
        c = np.zeros(self.size)
        c[test] = self.factor * self.C[test] * (2.0 if after.array[test] else -2.0)
        return c


def coulomb(p, seed):
    """Return a random body with a load, without friction at one node, guided at none."""
    rng = np.random.default_rng(seed)
    body = contact_body(random_body(p, seed, inner=seed % 3, gap=bool(seed % 2)))
    friction = rng.uniform(0.0, 4.0, p) * (np.arange(p) != 1)
    return CoulombLoad(body, AffineLoad(*rng.normal(size=(2, body.n))), friction)


def guided(seed):
    """Return a body of two nodes, of which the second is guided."""
    A = np.diag([3.0, 2.0, 4.0, 1.0])
    A[:3, :3] += 0.3 * np.array([[0.0, 2.0, -1.0], [2.0, 0.0, 1.0], [-1.0, 1.0, 0.0]])
    N, T = np.eye(4)[[0, 2]], np.eye(4)[[1, 3]]
    body = ContactBody(A, N, T, [0.0, 0.1], guided=[False, True])
    force = np.random.default_rng(seed).normal(size=(2, 4)) * [1.0, 1.0, 1.0, 0.0]
    return CoulombLoad(body, AffineLoad(*force), 1.5)


def obstacle(n, seed):
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return ObstacleProblem(K, np.random.default_rng(seed).uniform(-1.0, 0.0, n), np.ones(n))


SYSTEMS = {
    **{f"coulomb {p} {seed}": coulomb(p, seed) for p in (1, 2, 3) for seed in range(4)},
    "coulomb, many nodes": coulomb(33, 0),
    **{f"guided {seed}": guided(seed) for seed in range(2)},
    **{f"obstacle {n}": obstacle(n, 0) for n in (2, 9)},
    "diode ladder": diode_ladder(3).system,
    "Schmitt trigger": schmitt_trigger().system,
    "switches": Told(4, 0),
}


def interfaces(system, rng):
    """Yield a test and both cells at a point where nothing else vanishes."""
    n, scale = system.size, system.scale(0.0, 1.0)
    gradients = dense(system.test_jacobian(np.zeros(n), 0.0))
    for test in rng.permutation(np.flatnonzero(gradients.any(axis=1)))[:30]:
        x = np.append(scale * rng.normal(size=n), rng.normal())
        g = gradients[test]
        x -= system.test_functions(x[:-1], x[-1])[test] / (g @ g) * g
        here = system.character(x[:-1], x[-1])
        sides = [here.with_sign(int(test), sign) for sign in (False, True)]
        if all(test in system.bounding_tests(side) for side in sides):
            yield int(test), sides


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.sweep(6)
def test_selections_differ_by_c_kappa_everywhere(name):
    system, rng, checked = SYSTEMS[name], np.random.default_rng(1), 0
    scale = system.scale(0.0, 1.0)
    for _ in range(10):
        for test, (below, above) in interfaces(system, rng):
            z, alpha = scale * rng.normal(size=system.size), float(rng.normal())
            one, other = (system.residual(z, alpha, side) for side in (below, above))
            kappa = system.test_functions(z, alpha)[test]
            close = 1e-12 * (1.0 + np.abs(one).max() + np.abs(other).max())
            for change, c in (
                (other - one, system.kink(below, above, test)),
                (one - other, system.kink(above, below, test)),
            ):
                assert change == pytest.approx(kappa * c, abs=close)
            checked += 1
    assert checked >= 10


def marks(graph):
    return [(str(point.kind), round(point.alpha, 9)) for point in graph.special_points()]


def followed(system):
    try:
        return trace(system, (np.zeros(system.size), -1.0), (-1.0, 1.0))
    except StartNotFoundError:
        pytest.skip("no solution found")


@pytest.mark.parametrize("n", [1, 3, 12, 20, 70])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.sweep(6)
def test_a_known_kink_leads_along_the_same_path(n, seed):
    assert marks(followed(Told(n, seed))) == marks(followed(Switches(n, seed)))


def refused_or_marks(system):
    """Return the marks of what was followed, or the end of the message of its refusal."""
    try:
        return marks(followed(system))
    except InvalidSystemError as error:
        return str(error)[-16:]


@pytest.mark.parametrize("factor", [-1.0, 0.0, 2.0, 1.001, 1.0 + 1e-6, 1.0 + 1e-9])
@pytest.mark.parametrize("n", [1, 5, 30, 70])
@pytest.mark.sweep(16)
def test_a_wrong_kink_is_refused_or_makes_no_difference(n, factor):
    true, wrong = followed(Switches(n, 3)), Told(n, 3)
    wrong.factor = factor
    assert refused_or_marks(wrong) in ("run check_system", marks(true))
    rng = np.random.default_rng(0)
    report = check_system(wrong, [(rng.normal(size=n), 0.3) for _ in range(3)])
    if abs(factor - 1.0) > 1e-5:
        assert "kink across test function" in str(report)


def test_the_right_kink_is_no_defect():
    assert check_system(Told(5, 2), [(np.full(5, 0.3), 0.2), (np.zeros(5), 0.0)])


def test_a_kink_of_the_wrong_shape_is_named():
    class Short(Told):
        def kink(self, before, after, test):
            return np.zeros(2)

    with pytest.raises(InvalidSystemError, match=r"Short.kink returned shape \(2,\)"):
        followed(Short(5, 2))


def test_a_known_kink_saves_two_residuals_a_transition():
    counts = []
    for kind in (Switches, Told):
        system = kind(70, 1)
        with counted(system) as calls:
            graph = followed(system)
        counts.append(calls["residual"])
    assert counts[0] - counts[1] >= 2 * (len(graph.pieces) - 3)
