"""Events where something else is already, and functions that are zero but for rounding."""

import numpy as np
import pytest

from pwscont import (
    BranchGraph,
    InvalidInputError,
    Journal,
    NaturalParameter,
    PiecewiseLinearSystem,
    PiecewiseSystem,
    PseudoArclength,
    Stop,
    explore,
    plot,
    trace,
)

pytestmark = pytest.mark.sweep(6)  # the others take too long for the README's command


class Kinked(PiecewiseLinearSystem):
    """z = 2 alpha up to z = 1, and z = 4 alpha - 1 beyond."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 1.0

    def residual(self, z, alpha, character):
        return z - (4.0 * alpha - 1.0 if character.signs[0] else 2.0 * alpha)


class Circle(PiecewiseSystem):
    """z^2 + alpha^2 = 1, with a test that vanishes at z = 0.6, alpha = 0.8 and -0.8."""

    size = 1

    def test_functions(self, z, alpha):
        return z - 0.6

    def residual(self, z, alpha, character):
        return z**2 + alpha**2 - 1.0


AT_ENDS = {"first": lambda z, a: z[0], "last": lambda z, a: 1.0 - a}
AT_KINK = {"value": lambda z, a: z[0] - 1.0, "place": lambda z, a: 8.0 * a**3 - 1.0}


def named(graph):
    """Return kind and name of what has a name, by alpha."""
    points = sorted(graph.special_points(), key=lambda point: point.alpha)
    return [(p.kind, p.name) for p in points if p.name]


@pytest.mark.parametrize("stepper", [None, PseudoArclength(), NaturalParameter()], ids=repr)
@pytest.mark.parametrize("start", [([0.0], 0.0), ([0.6], 0.3), ([1.0], 0.5), ([3.0], 1.0)], ids=str)
def test_transitions_and_ends_have_the_names_of_events(stepper, start):
    plain = trace(Kinked(), start, (0.0, 1.0), stepper=stepper)
    graph = trace(Kinked(), start, (0.0, 1.0), stepper=stepper, events=AT_ENDS | AT_KINK)
    assert [name for _, name in named(graph)] == ["first", "value, place", "last"]
    assert [p.kind for p in graph.special_points()] == [p.kind for p in plain.special_points()]
    assert graph.guarantee == plain.guarantee
    assert graph.multiplicity() == plain.multiplicity()


@pytest.mark.parametrize("stepper", [None, PseudoArclength()], ids=repr)
def test_folds_have_the_names_of_events(stepper):
    events = {
        "kink": lambda z, a: z[0] - 0.6,
        "turn": lambda z, a: z[0],
        "most": lambda z, a: a - 1.0,
    }
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), stepper=stepper, events=events)
    assert named(graph) == [
        ("fold", "turn"),
        ("transition", "kink"),
        ("transition", "kink"),
        ("fold", "turn, most"),
    ]
    assert not graph.special_points("event")
    assert graph.count(0.9) == 2


def test_a_search_names_the_ends_as_well():
    events = {"first": lambda z, a: a + 0.9, "last": lambda z, a: a - 0.9}
    graph = explore(Circle(), (-0.9, 0.9), events=events)
    assert not graph.special_points("event")
    assert [name for _, name in named(graph)] == ["first", "first", "last", "last"]


def test_an_event_beside_a_transition_is_a_point_of_its_own():
    beside = {"beside": lambda z, a: z[0] - (1.0 + 1e-6), "at": lambda z, a: z[0] - 1.0}
    graph = trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), events=beside)
    assert named(graph) == [("transition", "at"), ("event", "beside")]


def test_a_function_that_is_zero_on_a_stretch_names_its_edges_only():
    late = {"late": lambda z, a: max(0.0, z[0] - 1.0), "later": lambda z, a: max(0.0, z[0] - 2.0)}
    graph = trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), events=late)
    assert named(graph) == [("transition", "late"), ("event", "later")]


def test_a_stop_at_an_end_or_a_fold_is_named():
    last = {"last": Stop(lambda z, a: a - 1.0)}
    assert named(trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), events=last)) == [("event", "last")]
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), events=last)
    assert named(graph) == [("event", "last")]
    assert not graph.special_points("fold")[1:]
    assert [graph.count(alpha) for alpha in (0.0, 1.0)] == [2, 1]


def test_names_are_kept_and_shown(tmp_path):
    events = AT_ENDS | AT_KINK
    journal = Journal(tmp_path / "run.journal")
    graph = trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), events=events, journal=journal)
    journal.close()
    again = Journal(tmp_path / "run.journal")
    resumed = trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), events=events, journal=again)
    again.close()
    graph.save(tmp_path / "graph.npz")
    loaded = BranchGraph.load(tmp_path / "graph.npz")
    names = ["first", "value, place", "last"]
    for each in (graph, resumed, loaded):
        assert [name for _, name in named(each)] == names
        assert [node["name"] for node in each.to_dict()["nodes"]] == names
    texts = {text.get_text() for text in plot(graph).figure.findobj(lambda o: hasattr(o, "_text"))}
    assert any("value, place" in text for text in texts)


NOISE = {
    "trigonometric": lambda z, a: np.sin(z[0]) ** 2 + np.cos(z[0]) ** 2 - 1.0,
    "thirds": lambda z, a: 3.0 * (a / 3.0) - a,
    "logarithm": lambda z, a: np.log(np.exp(z[0] + a)) - z[0] - a,
    "cancelled": lambda z, a: (z[0] + 1e6) ** 2 - z[0] ** 2 - 2e6 * z[0] - 1e12,
}


@pytest.mark.parametrize("name", NOISE)
@pytest.mark.parametrize("start", [0.0, 0.3, 0.77])
def test_what_is_zero_but_for_rounding_is_refused(name, start):
    for system, z in ((Kinked(), 2.0 * start), (Circle(), np.sqrt(1.0 - start**2))):
        with pytest.raises(InvalidInputError, match=f"{name!r} is zero at the start"):
            trace(system, ([z], start), (-0.9, 0.9), events={name: NOISE[name]})


@pytest.mark.parametrize("stepper", [None, PseudoArclength()], ids=repr)
@pytest.mark.parametrize("noisy", [NOISE["trigonometric"], lambda z, a: 0.0], ids=["noise", "zero"])
@pytest.mark.slow
def test_a_residual_is_no_event_on_its_branches(stepper, noisy):
    events = {"H": lambda z, a: z[0] - 2.0 * a + noisy(z, a)}  # zero on the first piece only
    graph = trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), stepper=stepper, events=events)
    assert named(graph) == [("transition", "H")]
    events = {"H": lambda z, a: z[0] ** 2 + a**2 - 1.0 + noisy(z, a)}
    graph = trace(Circle(), ([1.0], 0.0), (-2.0, 2.0), stepper=PseudoArclength(), events=events)
    assert named(graph) == []
    assert graph.guarantee == "balanced"


@pytest.mark.parametrize("factor", [1e-30, 1.0, 1e30])
def test_small_functions_are_no_noise(factor):
    events = {"half": lambda z, a: factor * (z[0] - 0.5), "kink": lambda z, a: factor * (z[0] - 1)}
    graph = trace(Kinked(), ([0.0], 0.0), (0.0, 1.0), events=events)
    assert named(graph) == [("event", "half"), ("transition", "kink")]


def test_a_function_that_is_not_defined_beyond_a_point_may_be_zero_there():
    events = {"edge": lambda z, a: np.sqrt(1.0 - z[0] ** 2)}
    with np.errstate(invalid="ignore"):
        graph = explore(Circle(), (-0.9, -0.1), events=events)
    assert not graph.special_points("event")
