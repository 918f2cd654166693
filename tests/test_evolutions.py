"""The graph of evolutions: merged states, queries, files, journal; plastic springs."""

import json
from math import inf

import networkx as nx
import numpy as np
import pytest
from evolution_truth import random_problem
from pwscont_coulomb import ContactBody, QuasiStaticCoulomb
from pwscont_structures import PlasticTruss

from pwscont import (
    EvolutionGraph,
    EvolutionScene,
    GraphFileError,
    InvalidInputError,
    InvalidSystemError,
    Journal,
    LoadHistory,
    PiecewiseLinearSystem,
    Stop,
    Switched,
    SystemNeededError,
    SystemWithMemory,
    evolve,
)


def test_a_truss_without_hardening_collapses():
    load = LoadHistory([[0.0], [4.0]])
    truss = PlasticTruss([[1.0], [1.0]], load, [1.0, 2.0], [1.0, 1.0])
    evolution = evolve(truss, (0.0, 1.0))
    (loss,) = evolution.losses()
    assert loss.t == pytest.approx(0.5, rel=1e-14)  # both bars yield under 2


def test_many_bars_that_yield_at_once_are_certain():
    """Thirty equal bars yield together: hardening makes every rate unique."""
    load = LoadHistory([[0.0], [50.0], [-50.0]])
    evolution = evolve(PlasticTruss(np.ones((30, 1)), load, 1.0, 1.0, 0.3), (0.0, 2.0))
    assert evolution.is_complete
    # yield at u = 1 under 30 (1 + 0.3); then 50 = 30 (1 + 0.3 u)
    (state,) = evolution.states(1.0)
    assert state["u_1"] == pytest.approx((50.0 / 30.0 - 1.0) / 0.3, rel=1e-13)


def test_a_truss_of_three_bars_shakes_down_after_one_reversal():
    angles = np.array([-0.7, 0.0, 0.7])
    B = np.column_stack([np.sin(angles), np.cos(angles)])
    loads = [[0.0, 0.0], *[[0.0, 2.6], [0.0, 0.5]] * 3]
    truss = PlasticTruss(B, LoadHistory(loads), 1.0, 1.0, 0.05)
    evolution = evolve(truss, (0.0, 6.0))
    (cycle,) = evolution.cycle(2.0)
    assert cycle.kind == "shakedown"
    (energy,) = evolution.dissipated(0.0, 6.0)
    assert energy > 0.0
    assert evolution.dissipated(2.0, 6.0) == [pytest.approx(0.0, abs=1e-12)]


def test_cyclic_yield_dissipates_the_area_of_the_loop():
    """A spring of stiffness and yield 1 beside one of stiffness 1, under a load between -4 and 4.

    Then u runs between -3 and 3, and the spring yields over 4 of these 6, twice in each cycle.
    """
    truss = PlasticTruss([[1.0]], LoadHistory([[0.0], *[[4.0], [-4.0]] * 3]), 1.0, 1.0, 1.0)
    evolution = evolve(truss, (0.0, 6.0))
    (cycle,) = evolution.cycle(2.0)
    assert (cycle.kind, cycle.periods) == ("cyclic slip", 1)
    assert evolution.dissipated(4.0, 6.0) == [pytest.approx(8.0, rel=1e-13)]


class Slider(PiecewiseLinearSystem):
    """z = (force, plastic stretch) of a spring of stiffness 1 pulled by w(t), |force| <= 1."""

    size = 2

    def __init__(self, slip):
        self.slip = slip

    def test_functions(self, z, t):
        return np.array([1.0 - (t - self.slip), 1.0 + t - self.slip])

    def residual(self, z, t, character):
        below, above = character.signs
        trial = t - self.slip
        force = trial if below and above else (1.0 if above else -1.0)
        return np.array([z[0] - force, z[1] - (t - force)])


class Pulled(SystemWithMemory):
    def remembering(self, memory):
        return Slider(memory[0])

    def memory(self, z, t):
        return z[1:]

    def initial_memory(self):
        return np.zeros(1)


class Notated(SystemWithMemory):
    """A spring pulled to and fro, written with switches: its law has hidden unknowns."""

    def remembering(self, memory):
        def law(z, t, sw):
            w = 2.0 - sw.abs(t - 2.0)
            return [z[0] - sw.clip(w - memory[0], -1.0, 1.0), z[1] - (w - z[0])]

        return Switched(2, law, linear=True)

    def memory(self, z, t):
        return z[1:]

    def initial_memory(self):
        return np.zeros(1)


def test_a_law_with_switches_remembers():
    evolution = evolve(Notated(), (0.0, 5.0))
    assert evolution.is_complete
    values = [(1.0, 1.0), (1.5, 1.0), (2.0, 1.0), (3.0, 0.0), (4.0, -1.0), (5.0, -1.0)]
    for t, force in values:
        (state,) = evolution.states(t)
        assert state.z[0] == pytest.approx(force, abs=1e-12)
    assert evolution.states(5.0)[0].memory == pytest.approx([0.0], abs=1e-12)


class Jenkins(SystemWithMemory):
    """A spring with a yield force under a force that goes up, down past the yield force, and back.

    z = (stretch, force); the unit of the stretch is ``unit``. The stretch stands within the clip
    alone.
    """

    def __init__(self, unit):
        self.unit = unit

    def remembering(self, memory):
        def law(z, t, sw):
            load = t - 5.0 * sw.relu(t - 1.0) + 6.0 * sw.relu(t - 1.75)
            return [z[1] - load, z[1] - sw.clip((z[0] - memory[0]) / self.unit, -2.0, 2.0)]

        return Switched(2, law, linear=True)

    def memory(self, z, t):
        return z[:1] - self.unit * z[1:]

    def initial_memory(self):
        return [0.0]


@pytest.mark.parametrize("unit", [2.0**-40, 2.0**-20, 1.0, 2.0**20, 2.0**40])
def test_an_unknown_within_a_clip_may_have_any_unit(unit):
    """The corners of the load were taken for losses where the unit is large."""
    evolution = evolve(Jenkins(unit), (0.0, 3.0))
    assert evolution.guarantee == "all evolutions with finitely many events"
    assert evolution.losses() == []
    assert len(evolution.paths()) == 1
    for t, load in ((0.5, 0.5), (1.0, 1.0), (1.5, -1.0), (1.75, -2.0), (3.0, 0.5)):
        (state,) = evolution.states(t)
        assert state.z == pytest.approx([unit * load, load], rel=1e-9, abs=0.0)


def test_events_of_users_and_recorded_quantities():
    evolution = evolve(
        Pulled(),
        (0.0, 3.0),
        events={"half": lambda z, t: z[0] - 0.5, "far": Stop(lambda z, t: z[1] - 1.5)},
        record={"work": lambda z, t: z[0] * t},
    )
    named = [(state.name, round(state.t, 12)) for state in evolution.events() if state.name]
    assert named == [("half", 0.5), ("far", 2.5)]
    assert evolution.states(2.0)[0]["work"] == pytest.approx(2.0)
    assert evolution.count(2.9) == 0
    with pytest.raises(InvalidInputError, match="event"):
        evolve(Pulled(), (0.0, 3.0), events={"bad": 3.0})


# -- graphs ----------------------------------------------------------------------------------------


def one_node():
    return ContactBody([[2.0, -1.0], [-1.0, 2.0]], N=[[1.0, 0.0]], T=[[0.0, 1.0]])


@pytest.fixture(scope="module")
def branching():
    """Return evolutions of one node at F = 4, with several states at the beginning."""
    loads = [[0.25, -0.75], [0.25, 2.0], [0.25, -2.0], [0.25, 2.0]]
    return evolve(QuasiStaticCoulomb(one_node(), LoadHistory(loads), 4.0), (0.0, 3.0))


def test_the_graph_is_a_plain_networkx_graph(branching, tmp_path):
    graph = branching.nx
    assert isinstance(graph, nx.DiGraph)
    assert nx.is_directed_acyclic_graph(graph)
    assert set(nx.get_node_attributes(graph, "kind").values()) <= {
        "start", "event", "branching", "loss", "jump", "undecided", "end",
    }  # fmt: skip
    nx.write_graphml(graph, tmp_path / "evolution.graphml")
    first = branching.events("start")[0]
    assert json.loads(graph.nodes[first.node]["z"]) == first.z.tolist()
    sinks = [node for node in graph if not graph.out_degree(node)]
    sources = [node for node in graph if not graph.in_degree(node)]
    number = sum(
        len(list(nx.all_simple_paths(graph, a, b))) for a in sources for b in sinks if a != b
    )
    number += sum(a in sinks for a in sources)
    assert branching.paths().number == number


def test_paths_lead_from_starts_to_sinks(branching):
    paths = list(branching.paths())
    assert len({tuple(path.nodes) for path in paths}) == len(paths) == len(branching.paths())
    for path in paths:
        for a, b in zip(path.pieces[:-1], path.pieces[1:], strict=True):
            assert a.end == b.start
        assert path.state(path.start).t == 0.0
    with pytest.raises(IndexError):
        branching.paths()[len(paths)]


def test_states_say_how_they_were_reached(branching):
    for state in branching.states(1.5):
        assert branching.nodes[state.history[0]].kind == "start"
        times = [branching.nodes[i].t for i in state.history]
        assert times == sorted(times)


def test_files_keep_everything(branching, tmp_path):
    file = tmp_path / "evolution.npz"
    branching.save(file)
    loaded = EvolutionGraph.load(file)
    assert loaded.to_dict() == branching.to_dict()
    for t in (0.3, 1.0, 2.2):
        for a, b in zip(loaded.states(t), branching.states(t), strict=True):
            assert np.abs(a.z - b.z).max() < 1e-14
            assert np.abs(a.memory - b.memory).max() < 1e-14
    with pytest.raises(SystemNeededError):
        loaded.dissipated(0.0, 3.0)
    again = EvolutionGraph.load(file, branching.system)
    assert again.dissipated(0.0, 3.0) == pytest.approx(branching.dissipated(0.0, 3.0))
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(GraphFileError, match="damaged"):
        EvolutionGraph.load(damaged)
    with pytest.raises(GraphFileError, match="cannot read"):
        EvolutionGraph.load(tmp_path / "nowhere.npz")


def test_pictures_and_tables(branching):
    pytest.importorskip("pandas")
    assert branching.plot("u_t").axes
    assert branching.plot("λ_t", "u_t").axes
    assert len(branching.to_dataframe("pieces")) == len(branching.pieces)
    assert list(branching.to_dataframe("events")["t"]) == [node.t for node in branching.nodes]
    with pytest.raises(InvalidInputError, match="rows"):
        branching.to_dataframe("points")
    with pytest.raises(InvalidInputError, match="kind must be"):
        branching.events("fold")
    with pytest.raises(InvalidInputError, match="outside"):
        branching.states(4.0)


def test_equal_states_are_one_node():
    """Three starts with different slip forget their past in one long slip."""
    loads = [[1.0, 0.0], [1.0, 5.0], [1.0, 4.0]]
    ends = []
    for slip in (0.0, 0.3):
        system = QuasiStaticCoulomb(one_node(), LoadHistory(loads), 0.5, slip)
        ends.append(evolve(system, (0.0, 2.0)).states(2.0)[0].z)
    assert np.abs(ends[0] - ends[1]).max() < 1e-13


# -- journal ---------------------------------------------------------------------------------------


def test_an_interrupted_run_goes_on(tmp_path, branching):
    class KilledError(Exception):
        pass

    def kill(pieces, t):
        if pieces > 4:
            raise KilledError

    system, file = branching.system, tmp_path / "run.journal"
    with Journal(file) as journal, pytest.raises(KilledError):
        evolve(system, (0.0, 3.0), journal=journal, report=kill)
    with Journal(file) as journal:
        assert 0 < len(journal) < len(branching.nodes)
        again = evolve(system, (0.0, 3.0), journal=journal)
        assert journal.is_finished
    assert again.to_dict() == branching.to_dict()
    other = QuasiStaticCoulomb(one_node(), system.history, 3.0)
    with Journal(file) as journal, pytest.raises(InvalidInputError, match="another run"):
        evolve(other, (0.0, 3.0), journal=journal)


@pytest.mark.parametrize(
    ("system", "begun"),
    [
        (lambda load: PlasticTruss([[1.0], [1.0]], load, [1.0, 2.0], 1.0, 0.5), [0.0, 4.0, -3.0]),
        (lambda load: QuasiStaticCoulomb(one_node(), load, 0.5), [[3, 0], [3, 3], [3, -3]]),
    ],
)
def test_a_journal_of_a_history_with_another_end_is_refused(tmp_path, system, begun):
    def along(factor):
        loads = np.vstack([np.reshape(begun, (3, -1)), np.ravel(begun[1]) * factor])
        return system(LoadHistory(loads))

    with Journal(tmp_path / "journal") as journal:
        first = evolve(along(0.5), (0.0, 3.0), journal=journal)
    with Journal(tmp_path / "journal") as journal:
        assert evolve(along(0.5), (0.0, 3.0), journal=journal).to_dict() == first.to_dict()
    with (
        Journal(tmp_path / "journal") as journal,
        pytest.raises(InvalidInputError, match="went on"),
    ):
        evolve(along(2.0), (0.0, 3.0), journal=journal)


@pytest.mark.parametrize("seed", [88, 99, 112])
@pytest.mark.sweep(2)
def test_a_resumed_run_repeats_every_bit(tmp_path, seed):
    """Whatever an evolver keeps between events."""

    class KilledError(Exception):
        pass

    def kill(pieces, t):
        if pieces > 2:
            raise KilledError

    problem = random_problem(seed)
    body = ContactBody(problem.A, problem.N, problem.T, problem.gap)
    history = LoadHistory(problem.loads)
    system = QuasiStaticCoulomb(body, history, problem.F, problem.slip)
    with Journal(tmp_path / "whole") as journal:
        whole = evolve(system, history.interval, jumps="nearest", journal=journal)
    with Journal(tmp_path / "killed") as journal, pytest.raises(KilledError):
        evolve(system, history.interval, jumps="nearest", journal=journal, report=kill)
    with Journal(tmp_path / "killed") as journal:
        again = evolve(system, history.interval, jumps="nearest", journal=journal)
    assert again.to_dict() == whole.to_dict()


# -- mistakes --------------------------------------------------------------------------------------


def test_a_load_that_only_grows_is_no_ratchetting():
    sticks = evolve(
        QuasiStaticCoulomb(one_node(), LoadHistory([[3, 0], [3, 0.1]]), 0.5), (0.0, 1.0)
    )
    assert [cycle.kind for cycle in sticks.cycle(0.25)] == ["not yet"]
    slides = evolve(QuasiStaticCoulomb(one_node(), LoadHistory([[3, 0], [3, 9]]), 0.5), (0.5, 1.0))
    assert [cycle.kind for cycle in slides.cycle(0.125)] == ["ratchetting"]


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, "a", 1e-9, 2.0])
def test_a_period_that_makes_no_sense_is_refused(period):
    with pytest.raises(InvalidInputError, match="period"):
        evolve(Pulled(), (0.0, 3.0)).cycle(period)


@pytest.mark.parametrize("t", [np.nan, "a", 1j, None, 10**400])
def test_a_time_must_be_a_number(t):
    evolution = evolve(Pulled(), (0.0, 3.0))
    for ask in (evolution.states, evolution.count, evolution.paths()[0].state):
        with pytest.raises(InvalidInputError, match="t must be"):
            ask(t)
    with pytest.raises(InvalidInputError, match="times must be"):
        evolution.dissipated(0.0, t)


class Forgetful(Pulled):
    """The memory is not that of the state."""

    def memory(self, z, t):
        return z[1:] + 0.3


class Growing(Pulled):
    """The law has more unknowns once there is a memory."""

    def remembering(self, memory):
        if memory[0] == 0.0:
            return Slider(0.0)

        def law(z, t, sw):
            force = sw.clip(t - memory[0], -1.0, 1.0)
            return [z[0] - force, z[1] - (t - force)]

        return Switched(2, law, linear=True)


class Curved(Pulled):
    def remembering(self, memory):
        return Switched(1, lambda z, t, sw: z - t**2)


class Nothing(Pulled):
    def remembering(self, memory):
        return None


class Misnamed(Pulled):
    def names(self):
        return ("force",)


class WithoutEvolver(Pulled):
    def evolver(self, interval):
        return 3


@pytest.mark.parametrize(
    ("system", "error", "words"),
    [
        (Nothing(), InvalidInputError, "PiecewiseLinearSystem, got None"),
        (Misnamed(), InvalidSystemError, "2 names"),
        (WithoutEvolver(), InvalidInputError, "must be an Evolver"),
        (Forgetful(), InvalidSystemError, "does not hold"),
        (Growing(), InvalidSystemError, "3 unknowns now, 2 at first"),
        (Curved(), InvalidInputError, "PiecewiseLinearSystem"),
        (None, InvalidInputError, "SystemWithMemory"),
        (Switched(1, lambda z, t, sw: z - t), InvalidInputError, "SystemWithMemory"),
    ],
)
def test_mistakes_are_named(system, error, words):
    with pytest.raises(error, match=words):
        evolve(system, (0.0, 3.0))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"report": 3}, "report"),
        ({"record": {"t": lambda z, t: 1.0}}, "'t' is taken"),
        ({"events": {3: lambda z, t: t}}, "texts"),
        ({"jumps": 3}, "jumps"),
        ({"limits": 3}, "limits"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        evolve(Pulled(), (0.0, 3.0), **arguments)


def test_a_history_has_loads_within_its_times_only():
    history = LoadHistory([[0.0], [1.0]])
    assert history(1.0).tolist() == [1.0]
    for t in (-0.1, 1.1, np.nan):
        with pytest.raises(InvalidInputError, match="outside the history"):
            history(t)
    with pytest.raises(InvalidInputError, match="beyond rounding"):
        LoadHistory([[0.0], [1.0], [2.0]], [0.0, 1e-12, 1e12])


def test_a_file_is_read_with_its_own_system_only(branching, tmp_path):
    branching.save(tmp_path / "graph.npz")
    truss = PlasticTruss(np.eye(2), LoadHistory([[0.0, 0.0], [1.0, 1.0]]), 1.0, 1.0, 1.0)
    for system, words in ((3, "SystemWithMemory"), (truss, "remembers 2 numbers, the file 1")):
        with pytest.raises(InvalidInputError, match=words):
            EvolutionGraph.load(tmp_path / "graph.npz", system)


def test_a_scene_says_what_is_condensed():
    chain = 3.0 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    body, history = ContactBody(chain, np.eye(6)[:1], np.eye(6)[1:2]), LoadHistory(np.eye(6)[:2])
    system = QuasiStaticCoulomb(body, history, 0.5)
    plan = EvolutionScene("it", "it", system, history.interval).plan()
    assert plan["unknowns"].startswith("4 in place of 8")


def test_a_start_that_does_not_hold_is_refused():
    with pytest.raises(InvalidInputError, match="start"):
        evolve(Pulled(), (0.0, 3.0), [0.5, 0.0])
    with pytest.raises(InvalidInputError, match="start"):
        evolve(Pulled(), (0.0, 3.0), [0.0, inf])


def test_where_evolutions_branch_the_words_leave_out_those_that_branch_between_events():
    """Beyond K_tt / |K_nt| a node that slips may stick at any time: infinitely many evolutions."""
    body = ContactBody([[10, 4], [4, 6]], N=[[1, 0]], T=[[0, 1]])
    system = QuasiStaticCoulomb(body, LoadHistory([[0, 0], [1, 2]]), friction=2.75)
    evolution = evolve(system, (0.0, 1.0))
    slipping = next(state for state in evolution.states(0.5) if state.label == "slip+")
    assert evolve(system, (0.5, 1.0), start=slipping.z).count(0.75) > 1  # it may stick from here on
    assert evolution.guarantee.endswith("that branch at events only, not in between")
    unique = evolve(QuasiStaticCoulomb(body, LoadHistory([[0, 0], [1, 2]]), 0.2), (0.0, 1.0))
    assert unique.guarantee == "all evolutions with finitely many events"
