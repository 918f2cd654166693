"""Straight pieces from cell to cell by one solve (docs/theory, F11), against what is known."""

from collections import Counter

import numpy as np
import pytest
import scipy.sparse as sp
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.modes import Mode, modes
from random_bodies import contact_body, random_body

from pwscont import InvalidSystemError, PiecewiseLinearSystem, trace
from pwscont.basics.rounding import CONFIDENCE
from pwscont.bench.calls import counted
from pwscont.linear.factor import ProductForm
from pwscont.transitions import straight
from pwscont.transitions.zeros import FARTHEST_ZERO, ratio_test

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

# -- stated errors ---------------------------------------------------------------------------------


def pressed(p, seed):
    """Return a random body, and a load that presses it on the obstacle and drags it."""
    body, rng = contact_body(random_body(p, seed, inner=2, gap=True)), np.random.default_rng(seed)
    f0, f1 = rng.normal(size=(2, body.n))
    return CoulombLoad(body, AffineLoad(f0 + 2.0 * body.N.T.sum(axis=1), f1), 2.5)


@pytest.mark.parametrize("seed", [9, 16, 18])
def test_forces_of_free_nodes_are_zero_within_their_stated_errors(seed):
    system = pressed(23, seed)
    graph = trace(system, (np.zeros(system.size), -4.0), (-4.0, 4.0))
    points = {point.id: point.place for point in graph.special_points()}
    n, checked = system.body.n, 0
    for piece in graph.pieces:
        free = np.flatnonzero(modes(piece.character) == Mode.NO_CONTACT)
        forces = np.r_[n + free, n + system.body.p + free]
        for place in (points[piece.start], points[piece.end]):
            assert (np.abs(place.x[forces]) <= CONFIDENCE * place.error[forces]).all()
            checked += len(forces)
    assert checked > 500


def soft(p, seed, softness=1e-8):
    """Return a pressed body one direction of which is soft, and held by the contact."""
    body, rng = random_body(p, seed), np.random.default_rng(seed)
    sizes, directions = np.linalg.eigh(body.A)
    sizes[0] = softness * sizes[-1]
    A = (directions * sizes) @ directions.T
    loads = rng.normal(size=(2, body.n)) * np.sqrt(np.diag(A))
    loads[0] += np.sqrt(np.diag(A)) @ body.N.T @ body.N
    held = ContactBody(0.5 * (A + A.T), body.N, body.T, body.gap)
    return CoulombLoad(held, AffineLoad(*loads), 0.5)


@pytest.mark.parametrize("seed", range(2))
def test_digits_are_those_of_the_displacements_that_there_are(seed):
    """Typical displacements, those without contact, are far larger than any on this path."""
    system = soft(43, seed)
    graph = trace(system, (np.zeros(system.size), -2.0), (-2.0, 2.0))
    assert len(graph.pieces) > 20
    assert min(point.digits for point in graph.special_points()) > 11.0


class Complementary(PiecewiseLinearSystem):
    """min(z, M z + q + alpha d) = 0 in given units, Jacobians stored in some way, or not given."""

    size = 90

    def __init__(self, stored, unit):
        rng, n = np.random.default_rng(5), self.size
        spread = sp.random_array((n, n), density=0.05, rng=rng, data_sampler=rng.standard_normal)
        self.M = (sp.eye_array(n) * 9.0 + spread - spread.T).toarray() / unit
        self.q, self.d = rng.normal(size=n), rng.normal(size=n)
        self.stored, self.unit = stored, unit

    def force(self, z, alpha):
        return self.M @ z + self.q + alpha * self.d

    def test_functions(self, z, alpha):
        return self.force(z, alpha) - 9.0 * z / self.unit

    def residual(self, z, alpha, character):
        return np.where(character.array, 9.0 * z / self.unit, self.force(z, alpha))

    def jacobian(self, z, alpha, character):
        if self.stored is None:
            return super().jacobian(z, alpha, character)
        unit = np.eye(self.size, self.size + 1) * (9.0 / self.unit)
        rows = np.column_stack([self.M, self.d])
        return self.stored(np.where(character.array[:, np.newaxis], unit, rows))

    def scale(self, lo, hi):
        return np.full(self.size, 0.1 * self.unit)


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
@pytest.mark.parametrize("stored", [np.array, sp.csr_array, sp.csc_array, None])
def test_every_transition_solves_the_problem_however_jacobians_are_stored(stored, unit):
    """M is positive definite: there is one solution at every alpha."""
    system = Complementary(stored, unit)
    graph = trace(system, (np.zeros(system.size), -2.0), (-2.0, 2.0))
    points = graph.special_points()
    assert len(points) > 40
    for point in points:
        z, force = point.z / unit, system.force(point.z, point.alpha)
        assert np.abs(np.minimum(z, force)).max() < 1e-13
    assert graph.multiplicity() == [(-2.0, 2.0, 1)]


# -- wrong systems ---------------------------------------------------------------------------------


class Torn(PiecewiseLinearSystem):
    """z_i = alpha, but beyond z_0 = 1/2 a row changes that agrees at z_2 = 1/2 only."""

    size = 70

    def test_functions(self, z, alpha):
        return z[:1] - np.array([0.25, 0.5, 0.75])

    def residual(self, z, alpha, character):
        rest, beyond = z - alpha, np.maximum(0.0, character.signs)
        rest[1] += beyond[0] * (z[0] - 0.25)
        rest[1] += beyond[1] * (z[2] - 0.5)
        return rest


def test_selections_that_agree_at_one_point_of_their_interface_are_refused():
    system = Torn()
    with pytest.raises(InvalidSystemError, match=r"disagree in row 1 .* all of their interface"):
        trace(system, (np.zeros(system.size), 0.0), (0.0, 1.0))


# -- work ------------------------------------------------------------------------------------------


class Terraces(PiecewiseLinearSystem):
    """z_0 = alpha, and z_k has a slope of k / 4 beyond the wall z_0 = 99.5 + k."""

    size = 70
    walls = np.arange(100.5, 130.0)

    def scale(self, lo, hi):
        return np.full(self.size, 100.0)

    def test_functions(self, z, alpha):
        return z[0] - self.walls

    def test_jacobian(self, z, alpha):
        return np.eye(1, self.size + 1).repeat(len(self.walls), axis=0)

    def slopes(self, character):
        return np.where(character.signs, 0.25 * np.arange(1.0, len(self.walls) + 1.0), 0.0)

    def residual(self, z, alpha, character):
        rest = z - alpha
        rest[1 : len(self.walls) + 1] -= self.slopes(character) * (z[0] - self.walls)
        return rest

    def jacobian(self, z, alpha, character):
        jacobian = np.eye(self.size, self.size + 1)
        jacobian[:, -1] = -1.0
        jacobian[1 : len(self.walls) + 1, 0] -= self.slopes(character)
        return jacobian


def work(monkeypatch, last):
    """Return calls of the system and of the routine on the way from 100 to an alpha."""
    system, start = Terraces(), (np.full(Terraces.size, 100.0), 100.0)
    with monkeypatch.context() as patch, counted(system) as calls:
        for owner, name in (
            (ProductForm, "solve"),
            (ProductForm, "solve_all"),
            (straight, "inner"),
        ):
            patch.setattr(owner, name, tallied(calls, name, getattr(owner, name)))
        graph = trace(system, start, (100.0, last))
    return Counter(calls), graph


def tallied(calls, name, function):
    calls[name] = 0

    def tally(*arguments):
        calls[name] += 1
        return function(*arguments)

    return tally


def test_work_of_a_transition_between_audits(monkeypatch):
    """One solve, three residuals, no factorisation, no Jacobian, no gradients of tests."""
    (few, short), (many, long) = (work(monkeypatch, last) for last in (104.0, 114.0))
    assert (len(short.pieces), len(long.pieces)) == (5, 15)
    more = {kind: count - few[kind] for kind, count in many.items() if count > few[kind]}
    assert more == {"solve": 10, "residual": 30, "test_functions": 10}


def test_an_audit_is_due_after_twenty_four_transitions(monkeypatch):
    (few, _), (many, _) = (work(monkeypatch, last) for last in (124.0, 125.0))
    assert many["solve_all"] == few["solve_all"] + 1


def test_one_factorisation_serves_all_cells(monkeypatch):
    (few, _), (many, _) = (work(monkeypatch, last) for last in (104.0, 125.0))
    assert many["inner"] == few["inner"] == 1
    assert many["jacobian"] == few["jacobian"] + 1  # of an audit


def test_a_piece_that_begins_inside_a_cell_is_not_searched(monkeypatch):
    """It goes the way of pieces between interfaces, one that begins at an interface does not."""

    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr("pwscont.continuation.follow.first_on_ray", refuse)
    assert len(work(monkeypatch, 104.0)[1].pieces) == 5
    with pytest.raises(AssertionError):  # the trap works
        trace(Terraces(), (np.full(Terraces.size, 100.5), 100.5), (100.0, 104.0))


# -- the ratio test --------------------------------------------------------------------------------

VALUES = np.concatenate([[0.0, -1e-18, 5e-324, 1e-300, 1e300], np.geomspace(1e-8, 1e8, 9)])
SLOPES = np.concatenate([[0.0], np.geomspace(1e-20, 1e20, 9)])


@pytest.mark.parametrize("seed", range(20))
def test_the_function_that_falls_to_zero_first(seed):
    """Against all distances one by one, with values next to zero, and slopes of any size."""
    rng = np.random.default_rng(seed)
    for count in rng.integers(1, 9, size=50):
        values, slopes = rng.choice(VALUES, size=count), rng.choice(SLOPES, size=count)
        slopes *= rng.choice([-1.0, 1.0], size=count)
        distances = [
            max(value, 0.0) / -slope if slope < 0.0 else np.inf
            for value, slope in zip(values.tolist(), slopes.tolist(), strict=True)
        ]
        with np.errstate(over="ignore"):  # as in a run
            found = ratio_test(values, slopes)
        first, distance = int(found.argmin()), found.min()
        least = min(distances) if min(distances) <= FARTHEST_ZERO else np.inf
        assert distance == pytest.approx(least, rel=1e-15, abs=1e-280)
        assert distance == np.inf or distances[first] == distance
