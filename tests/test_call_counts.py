"""How much work a run is: calls by kind, kept as upper bounds.

The bounds are the numbers of the day when they were written, not rounded up: whoever makes a run
dearer must say so by raising one. Whoever makes it cheaper may lower them: ``counts`` prints them.
"""

import subprocess
import sys

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, ContactBody, CoulombLoad
from pwscont_coulomb.rows import SparseGradients
from pwscont_coulomb.scenes import example1, example3, fig7, fig10, fig13

from pwscont import (
    ExactLinear,
    NaturalParameter,
    PiecewiseLinearSystem,
    PseudoArclength,
    StepSize,
    explore,
    trace,
)
from pwscont.bench.calls import KINDS, counted, factorisations
from pwscont.continuation import assembly
from pwscont.search import EndPoints
from pwscont.transitions import SmoothBranchPoints, SmoothFolds

# residual, jacobian, test_functions, test_jacobian, factorisations, solves, determinant signs
TRACED = {
    (fig7, ExactLinear): (8, 8, 10, 4, 2, 3, 1),
    (fig7, PseudoArclength): (46, 45, 57, 16, 44, 86, 42),
    (example1, ExactLinear): (10, 10, 12, 4, 2, 3, 1),
    (example1, PseudoArclength): (52, 51, 69, 24, 50, 98, 48),
    (fig10, PseudoArclength): (362, 216, 278, 133, 113, 566, 96),
    (fig13, PseudoArclength): (37, 25, 44, 4, 18, 47, 14),
    (example3, PseudoArclength): (37, 25, 44, 4, 18, 47, 14),
}


def trace_all(system, interval, stepper):
    return trace(system, (np.zeros(system.size), interval[0]), interval, stepper=stepper)


def counts(system, interval, stepper):
    with counted(system) as calls:
        graph = trace_all(system, interval, stepper)
    return {kind: calls[kind] for kind in KINDS}, graph


@pytest.mark.parametrize(("scene", "stepper"), TRACED, ids=lambda part: part.__name__)
def test_calls_by_kind(scene, stepper):
    made, calls = scene(), dict(zip(KINDS, TRACED[scene, stepper], strict=True))
    found, _ = counts(made.system, made.interval, stepper())
    dearer = {kind: found[kind] for kind in KINDS if found[kind] > calls[kind]}
    assert not dearer, f"more than {calls}"


def test_natural_parameter_on_a_steep_piece_tries_each_step_about_once():
    scene = example3()
    start = next(s for s in scene.run().solutions(14.0) if "slip" in s.label)
    with counted(scene.system) as calls:
        graph = trace(scene.system, (start.z, 14.0), scene.interval, stepper=NaturalParameter())
    points = sum(len(piece.alpha) for piece in graph.pieces)
    assert points > 40
    assert calls["jacobian"] <= 3 * points


def random_path(p=8, seed=1):
    """Return a random body pressed on the obstacle and dragged along it."""
    root = np.random.default_rng(seed).normal(size=(2 * p, 2 * p))
    picks, rng = np.eye(2 * p), np.random.default_rng(seed)
    body = ContactBody(root @ root.T + np.eye(2 * p), picks[0::2], picks[1::2])
    f0, f1 = rng.normal(size=2 * p) + np.tile([2.0, 0.0], p), rng.normal(size=2 * p)
    return CoulombLoad(body, AffineLoad(f0, f1), 0.5)


# what one piece more costs on a path of straight pieces
PER_PIECE = (2, 2, 5, 5, 2, 8, 2)
# where a piece does not begin within the error of the transition, both sides are compared there
COMPARED = (4, 4, 0, 0, 0, 0, 0)


def test_work_grows_linearly_with_the_pieces():
    """A piece costs two factorisations, whatever the path's length: nothing is searched in it."""
    system, table = random_path(), []
    for hi in (-2.0, 0.0, 5.0, 40.0):
        calls, graph = counts(system, (-5.0, hi), ExactLinear())
        table.append([len(graph.pieces), *calls.values()])
    growth = np.diff(table, axis=0)
    assert (growth[:, 0] >= 7).all()
    assert table[-1][0] == 29
    # solves may come out uneven: a corner or a located point takes one or two more
    assert (growth[:, 1:] <= np.outer(growth[:, 0], PER_PIECE) + COMPARED).all()


class UsedError(Exception):
    """Something was called that must not be."""


def refuse(*_):
    raise UsedError


@pytest.mark.parametrize("detector", [SmoothFolds, SmoothBranchPoints])
def test_linear_pieces_are_not_watched_for_what_they_cannot_have(monkeypatch, detector):
    monkeypatch.setattr(detector, "read", refuse)
    system, interval = fig7().system, fig7().interval
    trace_all(system, interval, ExactLinear())
    with pytest.raises(UsedError):  # the trap works
        trace_all(system, interval, PseudoArclength())


@pytest.mark.parametrize("scene", [fig7, fig10, fig13])
def test_trace_enumerates_nothing(monkeypatch, scene):
    monkeypatch.setattr("pwscont.enumeration.slices.leaves", refuse)
    made = scene()
    trace_all(made.system, made.interval, None)
    with pytest.raises(UsedError):  # the trap works
        explore(made.system, made.interval, search=EndPoints())


@pytest.mark.slow
def test_a_run_imports_no_pictures_and_no_bench():
    code = (
        "from pwscont_coulomb.scenes import fig7; fig7().run(); import sys; "
        "print(*[name for name in sys.modules if name.startswith(('matplotlib', 'pwscont.'))])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = run.stdout.split()
    assert "pwscont.graph" in loaded
    assert not [name for name in loaded if name.startswith(("matplotlib", "pwscont.bench"))]


# -- the counting itself --------------------------------------------------------------------------


def test_counting_leaves_nothing_behind():
    system = fig7().system
    classes = [type(system), *factorisations()]
    before = [dict(vars(owner)) for owner in classes]
    with counted(system) as calls:
        assert [dict(vars(owner)) for owner in classes] != before
    assert [dict(vars(owner)) for owner in classes] == before
    assert set(calls.values()) == {0}


def test_counting_stops_after_an_error():
    system = fig7().system
    before = dict(vars(type(system)))
    with pytest.raises(UsedError), counted(system):
        refuse()
    assert dict(vars(type(system))) == before


def test_counts_are_calls():
    system = fig7().system
    z, character = np.zeros(system.size), system.character(np.zeros(system.size), 0.0)
    with counted(system) as calls:
        system.residual(z, 0.0, character)
        system.residual(z, 1.0, character)
        system.jacobian(z, 0.0, character)
    assert (calls["residual"], calls["jacobian"], calls["solves"]) == (2, 1, 0)


# -- only the tests that bound the cell -----------------------------------------------------------


class Staircase(PiecewiseLinearSystem):
    """z = alpha on every stretch between walls at 1, 2, ...: a cell is bounded by two of them."""

    size = 1

    def __init__(self, walls):
        self.walls = np.arange(1.0, walls + 1.0)
        self.asked = []

    def test_functions(self, z, alpha):
        self.asked.append(len(self.walls))
        return z[0] - self.walls

    def test_jacobian(self, z, alpha):
        return np.tile([1.0, 0.0], (len(self.walls), 1))

    def some_tests(self, z, alpha, which):
        self.asked.append(len(which))
        return z[0] - self.walls[which]

    def some_test_gradients(self, z, alpha, which):
        return np.tile([1.0, 0.0], (len(which), 1))

    def bounding_tests(self, character):
        above = sum(character.signs)
        return [i for i in (above - 1, above) if 0 <= i < len(self.walls)]

    def residual(self, z, alpha, character):
        return z - alpha

    def jacobian(self, z, alpha, character):
        return np.array([[1.0, -1.0]])


def test_along_a_piece_only_the_bounding_tests_are_evaluated():
    """All 20 of them are asked for at the start, at nodes and by checks, never along a piece."""
    system, steps = Staircase(20), StepSize(first=1e-2, largest=1e-2)
    system.scale = lambda lo, hi: np.ones(1)
    graph = trace(system, ([0.0], 0.0), (0.0, 21.0), stepper=PseudoArclength(step_size=steps))
    points = sum(len(piece.points) for piece in graph.pieces)
    assert len(graph.pieces) == 21
    assert points > 500
    assert sum(asked <= 2 for asked in system.asked) >= points - len(graph.pieces)
    assert sum(asked == 20 for asked in system.asked) <= 4 * len(graph.pieces)


# -- only the names that somebody reads, and digits once ------------------------------------------


def test_no_names_are_made_before_they_are_asked_for(monkeypatch):
    """A long path has thousands of names, of which few are read.

    Digits cost less than a hundredth of a piece, and are made once for each special point.
    """
    said, label = [], CoulombLoad.label
    monkeypatch.setattr(CoulombLoad, "label", lambda *of: said.append("label") or label(*of))
    known, digits = [], assembly.significant
    monkeypatch.setattr(assembly, "significant", lambda *of: known.append(1) or digits(*of))
    graph = counts(random_path(), (-5.0, 5.0), ExactLinear())[1]
    assert len(known) == len(graph.special_points())
    assert len(said) <= 2  # where it starts
    (point, *_) = graph.special_points("transition")
    assert " → ".join(point.message.split(": ")[1].split(" → ")[::-1]) in point.backward


def test_gradients_of_tests_are_made_once_where_they_are_constant(monkeypatch):
    made, make = [], SparseGradients.at
    monkeypatch.setattr(SparseGradients, "at", lambda *of: made.append(1) or make(*of))
    graph = counts(random_path(p=33), (-5.0, 0.0), ExactLinear())[1]
    assert len(graph.pieces) > 10
    assert len(made) == 1
