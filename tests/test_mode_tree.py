"""The search over modes by linear programs, against all cells and against other programs."""

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from random_bodies import contact_body, random_body, random_vector
from reference_enumeration import enumerate_solutions as try_all
from scipy.optimize import linprog

from pwscont import enumerate_solutions
from pwscont.curve.metric import Metric
from pwscont.enumeration import simplex, tree
from pwscont.enumeration.choices import SLACK, Choices
from pwscont.enumeration.options import Table, problem_of
from pwscont.enumeration.simplex import (
    NOT_NEGATIVE,
    NOT_POSITIVE,
    OPEN,
    Forms,
    feasible,
    first_vertex,
)
from pwscont.enumeration.slices import solve_slice
from pwscont.enumeration.tree import leaves

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from strip import strip


@pytest.fixture
def searching(monkeypatch):
    """Search where all cells would be tried at once, and never give up."""
    monkeypatch.setattr(tree, "BATCH", 4)
    monkeypatch.setattr(tree, "FEW_CHOICES", 4)
    monkeypatch.setattr(tree, "CHOICES_PER_PROGRAM", 1e-9)


def random_slice(p, seed):
    """A random body, with gaps or without, and round numbers in every third load."""
    rng = np.random.default_rng([p, seed])
    body = random_body(p, seed, inner=int(rng.integers(3)), gap=bool(rng.integers(2)))
    load = random_vector(body.n, [seed, 1])
    return body, load if seed % 3 else np.round(load), float(rng.choice([0.0, 0.3, 1.0, 4.0, 10.0]))


def loaded(body, load, friction):
    return CoulombLoad(contact_body(body), AffineLoad(load, np.ones(body.n)), friction)


def same_states(found, expected):
    assert len(found) == len(expected)
    for solution in expected:
        nearest = min(found, key=lambda other: np.abs(other.z - solution.z).max())
        assert_allclose(nearest.z, solution.z, rtol=0, atol=1e-8 * (1 + np.abs(solution.z).max()))


@pytest.mark.usefixtures("searching")
@pytest.mark.parametrize(("p", "slices"), [(1, 40), (2, 60), (3, 40), (4, 10)])
@pytest.mark.sweep(2)
def test_the_search_finds_what_all_cells_hold(p, slices):
    for seed in range(slices):
        body, load, friction = random_slice(p, seed)
        found = enumerate_solutions(loaded(body, load, friction), 0.0)
        assert found.guarantee.startswith("complete")
        assert sum(solution.det_sign for solution in found) == 1
        same_states(found, try_all(body, load, friction))


def both(system, alpha, monkeypatch):
    """The slice from all cells together, and from the search."""
    metric = Metric.at(system, alpha)
    with monkeypatch.context() as patch:
        patch.setattr(tree, "FEW_CHOICES", 4**9)
        together = solve_slice(system, metric, alpha)
        patch.setattr(tree, "BATCH", 4)
        patch.setattr(tree, "FEW_CHOICES", 4)
        patch.setattr(tree, "CHOICES_PER_PROGRAM", 1e-9)
        return together, solve_slice(system, metric, alpha)


def key(point):
    return sorted(character.signs for character in point.characters)


def same_slices(together, searched):
    assert not together.faces
    assert not together.undecided
    assert not searched.faces
    assert not searched.undecided
    assert len(searched.points) == len(together.points)
    a, b = (sorted(found.points, key=key) for found in (together, searched))
    for one, other in zip(a, b, strict=True):
        assert key(one) == key(other)
        assert one.det_sign == other.det_sign
        assert_allclose(one.x, other.x, rtol=0, atol=1e-8 * (1.0 + np.abs(one.x).max()))


@pytest.mark.slow
@pytest.mark.parametrize(("p", "slices"), [(5, 120), (6, 80), (7, 25), (8, 5)])
def test_the_search_against_all_cells_together(p, slices, monkeypatch):
    """Same solutions, in the same cells, with the same signs."""
    for seed in range(slices):
        system = loaded(*random_slice(p, 1000 + seed))
        same_slices(*both(system, 0.0 if seed % 2 else 0.5, monkeypatch))


@pytest.mark.parametrize("p", [3, 4])
def test_an_unloaded_body_is_at_rest_in_all_cells(p, monkeypatch):
    body = contact_body(random_body(p, 3))
    system = CoulombLoad(body, AffineLoad(np.zeros(body.n), np.ones(body.n)), 0.5)
    together, searched = both(system, 0.0, monkeypatch)
    same_slices(together, searched)
    assert len(searched.points[0].characters) == 4**p
    assert_allclose(searched.points[0].x, 0.0, rtol=0, atol=1e-12)


def alike(p, friction):
    """Equal nodes side by side: solutions are the products of the solutions of one node."""
    A, pick = np.kron(np.eye(p), [[2.0, -1.0], [-1.0, 2.0]]), np.eye(2 * p)
    body = ContactBody(A, pick[0::2], pick[1::2])
    return CoulombLoad(body, AffineLoad(np.tile([0.0, -10.0], p), np.tile([1.0, 0.0], p)), friction)


def slice_of(system, alpha):
    scale = Metric.at(system, alpha).scale[:-1]
    return problem_of(Table.at(system, alpha, scale), system.necessary(alpha), scale)


@pytest.mark.parametrize("p", [2, 3])
@pytest.mark.parametrize("alpha", [-1.0, 1.0, 3.0])
def test_equal_nodes(p, alpha, monkeypatch):
    """Whole systems: the search does not see that the nodes are independent."""
    system, one = alike(p, 4.0), enumerate_solutions(alike(1, 4.0), alpha)
    monkeypatch.setattr(tree, "BATCH", 4)
    monkeypatch.setattr(tree, "FEW_CHOICES", 4)
    monkeypatch.setattr(tree, "CHOICES_PER_PROGRAM", 1e-9)
    problem = slice_of(system, alpha)
    starts = np.vstack([c.starts @ problem.basis.T + problem.origin for c in leaves(problem)])
    displacements = np.unique(np.round(starts[:, : 2 * p], 6), axis=0)
    assert len(displacements) == len(one) ** p


@pytest.mark.usefixtures("searching")
@pytest.mark.parametrize("distance", [1e-3, 1e-6, 1e-9, 1e-12])
def test_beside_the_fold_of_one_of_three_nodes(distance):
    """Two of the nodes have another load each; the fold of the first is known."""
    system, alone = _three(), enumerate_solutions
    fold = _fold()
    counts = [len(alone(system, fold + side * distance)) for side in (-1.0, 1.0)]
    assert sorted(counts) == [1, 3]


def _three():
    """The paper's one-node body with F = 4, and two nodes that stay in the air."""
    A, pick = np.kron(np.eye(3), [[2.0, -1.0], [-1.0, 2.0]]), np.eye(6)
    A[2:4, 4:6] = A[4:6, 2:4] = -0.1 * np.eye(2)
    away = [0.0, 0.0, -5.0, 1.0, -4.0, -1.0]
    load = AffineLoad(np.add(away, [0.0, -10.0, 0, 0, 0, 0]), np.eye(6)[0])
    return CoulombLoad(ContactBody(A, pick[0::2], pick[1::2]), load, 4.0)


def _fold():
    """Where no contact ends: A u = f with u_nu = 0, that is a f_nu + b f_t = 0 with f_t = -10."""
    return 5.0


def programs(seed, number=200):
    """Signs asked at random of the forms of a body, from its first vertex."""
    rng, body = np.random.default_rng(seed), random_body(3, seed)
    system = loaded(body, random_vector(body.n, seed), 4.0)
    problem = slice_of(system, 0.3)
    forms = Forms.of(problem, problem.blocks, Choices.before_all(problem))
    start = first_vertex(forms)[np.zeros(number, dtype=int)]
    picks = rng.integers(OPEN, 4, (number, 3))
    asked = np.zeros_like(start.signs)
    for block in range(3):
        chosen = picks[:, block] != OPEN
        asked[chosen] |= forms.options[block, picks[chosen, block]]
    return forms, start.asking(asked, np.arange(number)[:, np.newaxis])


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.sweep(3)
def test_programs_against_highs(seed):
    """Feasible by HiGHS, with its own tolerance to either side, means feasible, and conversely."""
    forms, some = programs(seed)
    holds = np.isin(some.picks, feasible(forms, some).picks)[:, 0]
    for signs, found in zip(some.signs, holds, strict=True):
        assert found or not _by_highs(forms, signs, -10.0 * SLACK)
        assert not found or _by_highs(forms, signs, 10.0 * SLACK)


def _by_highs(forms, signs, relaxed):
    up, down = (signs & NOT_NEGATIVE) > 0, (signs & NOT_POSITIVE) > 0
    rows = np.vstack([-forms.rows[up], forms.rows[down]])
    constants = np.concatenate([forms.constants[up], -forms.constants[down]]) + relaxed
    bounds = [(None, None)] * forms.rows.shape[1]
    return linprog(np.zeros(forms.rows.shape[1]), rows, constants, bounds=bounds).status == 0


def test_vertices_have_the_signs_asked():
    forms, some = programs(5)
    found = feasible(forms, some)
    values = forms.values(found.points)
    slack = SLACK * (1.0 + np.abs(found.points).max(axis=1))[:, np.newaxis]
    assert ((values >= -slack) | ((found.signs & NOT_NEGATIVE) == 0)).all()
    assert ((values <= slack) | ((found.signs & NOT_POSITIVE) == 0)).all()


def test_a_form_that_occurs_twice_is_listed_once():
    """lam_nu, lam_t, u_nu - gap, u_t, three tests, two slips, |lam_t| <= F |lam_nu|: 11 a node."""
    forms, _ = programs(6, number=1)
    assert len(forms.rows) == 3 * 11 + forms.rows.shape[1]
    assert_allclose(np.linalg.norm(forms.rows, axis=1), 1.0, rtol=1e-12)


def test_few_programs_are_solved_for_fourteen_nodes(monkeypatch):
    """A strip has 4^14 cells, and bases that are nearly singular: some thousand programs do."""
    solved = []

    def counting(forms, some):
        solved.append(len(some))
        return feasible(forms, some)

    monkeypatch.setattr(simplex, "feasible", counting)
    body, load = strip(14)
    found = enumerate_solutions(CoulombLoad(body, load, 0.4), 0.3)
    assert found.guarantee == "complete"
    assert sum(solution.det_sign for solution in found) == 1
    assert sum(solved) < 10_000


def test_the_search_gives_up_when_all_cells_are_cheaper(monkeypatch):
    """One program allowed: the answer is that of all cells."""
    system = loaded(*random_slice(4, 7))
    expected = [point.x for point in solve_slice(system, Metric.at(system, 0.3), 0.3).points]
    monkeypatch.setattr(tree, "BATCH", 4**2)
    monkeypatch.setattr(tree, "FEW_CHOICES", 4**2)
    monkeypatch.setattr(tree, "CHOICES_PER_PROGRAM", 4**4)
    found = [point.x for point in solve_slice(system, Metric.at(system, 0.3), 0.3).points]
    assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
