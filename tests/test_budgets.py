"""Limits and Ctrl-C: what was found comes back, and what ran out is said."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.scenes import fig7
from random_bodies import contact_body, random_body, random_vector

from pwscont import (
    AllTransitions,
    BranchGraph,
    EndPoints,
    InvalidInputError,
    Journal,
    Limits,
    PiecewiseSystem,
    Switched,
    explore,
    trace,
)
from pwscont.basics.budget import Budget, check_budget
from pwscont.commands.cli import main
from pwscont.continuation.follow import PieceFollower
from pwscont.continuation.known import accumulation

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

FIG7 = fig7()


def explored(**options):
    return explore(FIG7.system, FIG7.interval, **options)


def rows(graph):
    return {(piece.label, *np.round(piece.interval, 10)) for piece in graph.pieces}


class Helix(PiecewiseSystem):
    """z = (sin s, s), alpha = cos(s) / 2 for every s: a path that never ends."""

    size = 2

    def __init__(self, before_residual=lambda: None):
        self.before_residual = before_residual

    def test_functions(self, z, alpha):
        return np.array([z[0]])

    def residual(self, z, alpha, character):
        self.before_residual()
        return np.array([z[0] - np.sin(z[1]), alpha - 0.5 * np.cos(z[1])])


def helix(**options):
    return trace(Helix(), (np.zeros(2), 0.5), (-1.0, 1.0), **options)


def on_the_helix(graph):
    """Every point of the graph solves the equations."""
    points = np.vstack([piece.points for piece in graph.pieces])
    np.testing.assert_allclose(points[:, 0], np.sin(points[:, 1]), atol=1e-9)
    np.testing.assert_allclose(points[:, 2], 0.5 * np.cos(points[:, 1]), atol=1e-9)


# -- limits --------------------------------------------------------------------------------------


@pytest.mark.parametrize("pieces", [1, 2, 3])
@pytest.mark.parametrize("search", [AllTransitions(), EndPoints()])
def test_no_more_pieces_than_allowed(pieces, search):
    graph, whole = explored(limits=Limits(pieces=pieces), search=search), explored()
    assert len(graph.pieces) == pieces
    assert rows(graph) < rows(whole)
    (stopped,) = graph.special_points("stopped")
    assert f"the limit of {pieces} piece" in stopped.message
    assert stopped.lost == 1
    assert graph.guarantee.startswith(f"the limit of {pieces} piece")
    assert f"alpha = {stopped.alpha:.8g}" in graph.guarantee


def test_a_start_within_a_piece_counts_as_one():
    start = explored().solutions(0.0)[0]
    graph = trace(FIG7.system, (start.z, 0.0), FIG7.interval, limits=Limits(pieces=1))
    assert len(graph.pieces) == 1
    assert graph.count(0.0) == 1
    assert len(graph.special_points("start")) == 1


def test_limits_that_are_not_reached_change_nothing():
    assert explored(limits=Limits(pieces=4, seconds=600.0)).guarantee == "complete"


def test_a_path_that_never_ends_comes_back_after_so_many_seconds():
    graph = helix(limits=Limits(seconds=0.9))
    assert "the limit of 0.9 seconds was reached" in graph.guarantee
    # a machine that is busy may not come to the end of the first piece, and the start is the end
    assert len(graph.special_points("stopped")) in (1, 2)
    on_the_helix(graph)


def test_newton_in_each_of_many_cells_is_cut_short():
    calls = 0

    class Slow(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return z[0] - np.arange(1.0, 10.0)

        def residual(self, z, alpha, character):
            nonlocal calls
            calls += 1
            time.sleep(1e-3)
            return z**3 + z + sum(character.signs) + 10.0 - alpha

    graph = explore(Slow(), (0.0, 1.0), limits=Limits(seconds=0.3))
    assert "the limit of 0.3 seconds was reached" in graph.guarantee
    assert calls < 2**9  # fewer than there are cells


def test_an_enumeration_that_takes_minutes_is_cut_short():
    body = random_body(14, 0, inner=0)
    load = AffineLoad(random_vector(body.n, 0), random_vector(body.n, 1))
    system = CoulombLoad(contact_body(body), load, 3.0)
    graph = explore(system, (0.0, 1.0), search=EndPoints(), limits=Limits(seconds=0.2))
    assert not graph.pieces
    assert graph.guarantee.startswith("the limit of 0.2 seconds was reached")


def test_what_ran_out_is_kept_in_the_file(tmp_path):
    graph = explored(limits=Limits(pieces=2))
    graph.save(tmp_path / "graph.npz")
    again = BranchGraph.load(tmp_path / "graph.npz", system=FIG7.system)
    assert again.guarantee == graph.guarantee
    assert graph.to_dict()["guarantee"] == graph.guarantee


@pytest.mark.parametrize(
    "arguments",
    [
        {"pieces": 0},
        {"pieces": 1.5},
        {"pieces": True},
        {"seconds": 0.0},
        {"seconds": float("nan")},
        {"seconds": "5"},
    ],
)
def test_limits_that_make_no_sense(arguments):
    (name,) = arguments
    with pytest.raises(InvalidInputError, match=f"{name} must be a positive"):
        Limits(**arguments)


def test_limits_of_another_kind():
    with pytest.raises(InvalidInputError, match="limits must be a Limits, got 5"):
        explored(limits=5)


def test_a_journal_goes_on_after_the_limit(tmp_path):
    for pieces in (1, 2, 3):
        journal = Journal(tmp_path / "journal")
        assert len(explored(journal=journal, limits=Limits(pieces=pieces)).pieces) == pieces
        journal.close()
    journal = Journal(tmp_path / "journal")
    assert len(journal) == 3
    graph = explored(journal=journal)
    journal.close()
    assert graph.guarantee == "complete"
    assert rows(graph) == rows(explored())


@pytest.mark.slow
def test_a_piece_that_was_cut_is_not_in_the_journal(tmp_path):
    journal = Journal(tmp_path / "journal")
    graph = helix(limits=Limits(seconds=0.3), journal=journal)
    cut = [point for point in graph.special_points("stopped") if not point.lost]
    assert len(journal) >= len(graph.pieces) - len(cut)
    journal.close()
    journal = Journal(tmp_path / "journal")
    on_the_helix(helix(limits=Limits(pieces=len(graph.pieces) + 3), journal=journal))
    journal.close()


def test_a_run_within_a_run_ends_with_it():
    now = [0.0]
    with Budget(Limits(seconds=1.0), clock=lambda: now[0]), Budget(Limits()) as inner:
        check_budget()
        now[0] = 2.0
        with pytest.raises(KeyboardInterrupt, match="limit of 1 seconds") as caught:
            check_budget()
        assert inner.end(caught.value) == "the limit of 1 seconds was reached"
    check_budget()


# -- Ctrl-C --------------------------------------------------------------------------------------


def press_after(calls):
    """Return a function that presses Ctrl-C when it is called for that time."""
    left = [calls]

    def press():
        left[0] -= 1
        if not left[0]:
            os.kill(os.getpid(), signal.SIGINT)

    return press


@pytest.mark.parametrize("calls", [1, 5, 60, 2000, 4000])
def test_the_graph_found_so_far_comes_back_after_ctrl_c(calls):
    system = Helix(press_after(calls))
    graph = trace(system, (np.zeros(2), 0.5), (-1.0, 1.0))
    assert graph.guarantee.startswith("interrupted")
    if graph.pieces:
        on_the_helix(graph)
    assert (calls < 500) == (not graph.pieces)
    assert all("interrupted" in point.message for point in graph.special_points("stopped"))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def after_two_pieces(pieces, alpha):
    """Report to a user who then presses Ctrl-C."""
    if pieces == 2:
        raise KeyboardInterrupt


def test_an_interrupt_raised_by_a_report():
    graph = explored(report=after_two_pieces)
    assert graph.guarantee.startswith("interrupted")
    assert len(graph.pieces) == 2
    assert rows(graph) < rows(explored())


def test_ctrl_c_while_events_are_marked_keeps_all_pieces():
    press = press_after(400)  # the first calls are those of the starts

    def half(z, alpha):
        press()
        return alpha - 0.1

    graph = explored(events={"half": half})
    assert graph.guarantee.startswith("interrupted; no events are marked on")
    assert len(graph.pieces) >= len(explored().pieces)
    assert graph.count(0.0) == explored().count(0.0)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_events_are_marked_on_what_was_found_before_ctrl_c():
    found = explored(report=after_two_pieces)
    middle = 0.5 * sum(found.pieces[0].interval)
    graph = explored(report=after_two_pieces, events={"half": lambda z, alpha: alpha - middle})
    assert len(graph.special_points("event")) == found.count(middle) > 0
    assert "events" not in graph.guarantee


def flat(journal=None):
    """Explore a system that has half a line of solutions at every alpha."""
    area = Switched(1, lambda z, t, sw: sw.relu(z) - sw.relu(z + t - sw.abs(t)), linear=True)
    return explore(area, (-1.0, 1.0), journal=journal)


def arch(journal=None):
    """Explore z (z - 1) (z - 2) = alpha with a kink at 1, which is proved after the search."""
    law = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    return explore(law, (-0.5, 1.0), journal=journal)


@pytest.mark.parametrize(
    ("run", "parts", "has_journal"),
    [(flat, 5, False), (arch, 9, True)],
)
@pytest.mark.slow
def test_ctrl_c_at_every_look_at_the_budget_leaves_a_graph(
    run, parts, has_journal, tmp_path, monkeypatch
):
    looks, press, check = [0], [0], Budget.check

    def look(budget):
        looks[0] += 1
        budget._is_interrupted |= looks[0] == press[0]
        check(budget)

    journal = Journal(tmp_path / "journal") if has_journal else None
    whole = run(journal)  # the runs after this run repeat the search from the journal
    monkeypatch.setattr(Budget, "check", look)
    run(journal)
    for press[0] in np.unique(np.linspace(1, looks[0], parts, dtype=int)):
        looks[0] = 0
        graph = run(journal)
        assert graph.guarantee.startswith("interrupted")
        assert len(graph.pieces) <= len(whole.pieces)


def test_a_limit_of_seconds_bounds_events_too():
    now = [0.0]
    with Budget(Limits(seconds=1.0), clock=lambda: now[0]) as budget:
        now[0] = 2.0
        budget.extend()
        check_budget()
        now[0] = 2.6
        with pytest.raises(KeyboardInterrupt, match="limit of 1 seconds"):
            check_budget()


def test_a_second_ctrl_c_does_not_wait():
    """The first one cannot end a residual that hangs."""

    def hang():
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        threading.Event().wait(60.0)
        pytest.fail("waited for the residual")

    calls = [0]

    def hang_later():
        calls[0] += 1
        if calls[0] == 2000:
            hang()

    graph = trace(Helix(hang_later), (np.zeros(2), 0.5), (-1.0, 1.0))
    assert graph.guarantee.startswith("interrupted")
    assert graph.pieces
    on_the_helix(graph)


def test_ctrl_c_while_a_run_begins_leaves_nothing_behind(monkeypatch):
    """Its limits would be those of all runs to come."""
    install = Budget._install

    def interrupted(budget):
        monkeypatch.setattr(Budget, "_install", install)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Budget, "_install", interrupted)
    system, interval = fig7().system, fig7().interval
    with pytest.raises(KeyboardInterrupt):
        explore(system, interval, limits=Limits(seconds=1e-9))
    assert explore(system, interval).guarantee == "complete"


def test_a_handler_of_the_program_is_left_alone():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(1))
    try:
        graph = trace(Helix(press_after(60)), (np.zeros(2), 0.5), (-1.0, 1.0), limits=Limits(3))
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [1]
    assert graph.guarantee.startswith("the limit of 3 pieces")


def test_a_handler_of_another_language_is_left_alone(monkeypatch):
    """Python does not know it, and could not put it back."""

    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(signal, "getsignal", lambda _: None)
    monkeypatch.setattr(signal, "signal", refuse)
    assert helix(limits=Limits(pieces=2)).pieces


def test_in_another_thread():
    found = []
    thread = threading.Thread(target=lambda: found.append(helix(limits=Limits(pieces=5))))
    thread.start()
    thread.join()
    assert len(found[0].pieces) == 5


@pytest.mark.slow
def test_interrupted_on_the_command_line_and_resumed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        "pwscont.continuation.follow.PieceFollower.follow", _pressing(press_after(2))
    )
    assert main(["run", "fig7", "-o", str(tmp_path)]) == 130
    assert "--resume goes on from there" in capsys.readouterr().err
    monkeypatch.undo()
    assert main(["run", "fig7", "-o", str(tmp_path), "--resume"]) == 0
    assert "Guarantee: complete" in capsys.readouterr().out


def _pressing(press):
    original = PieceFollower.follow

    def pressing(self, ray):
        press()
        return original(self, ray)

    return pressing


# -- paths without an end ------------------------------------------------------------------------


class Spiral(PiecewiseSystem):
    """z = (r sin s, s), alpha = 0.3 + r cos s with r = exp(-s / 10): folds and kinks near 0.3."""

    size = 2

    def test_functions(self, z, alpha):
        return np.array([z[0]])

    def residual(self, z, alpha, character):
        r = np.exp(-z[1] / 10.0)
        return np.array([z[0] - r * np.sin(z[1]), alpha - 0.3 - r * np.cos(z[1])])


def accumulates_at(text):
    return float(text.split("accumulate at alpha = ")[1].split(")")[0].split(";")[0])


@pytest.mark.slow
def test_kinks_that_accumulate_are_said_to_with_the_alpha():
    graph = trace(Spiral(), (np.zeros(2), 1.3), (-1.0, 1.5), limits=Limits(pieces=45))
    (stopped,) = graph.special_points("stopped")
    assert accumulates_at(stopped.message) == pytest.approx(0.3, abs=1e-5)
    assert abs(stopped.alpha - 0.3) > 1e-4
    assert accumulates_at(graph.guarantee) == pytest.approx(0.3, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("make", [Helix, Spiral])
def test_a_path_that_repeats_itself_is_stopped_without_limits(make):
    start = {Helix: 0.5, Spiral: 1.3}[make]
    graph = trace(make(), (np.zeros(2), start), (-1.0, 1.5))
    for stopped in graph.special_points("stopped"):
        assert "repeats itself without end" in stopped.message
        assert ("accumulate" in stopped.message) == (make is Spiral)
    assert "a piece was stopped" in graph.guarantee
    assert graph.special_points("stopped")


@pytest.mark.slow
def test_folds_without_end_that_come_ever_closer_are_left_after_some():
    ring = Switched(1, lambda z, a, sw: np.sin(3 * z) - a * np.sqrt(1 + z**2))
    graph = explore(ring, (-0.5, 0.9))
    assert "repeats itself" in "".join(point.message for point in graph.special_points("stopped"))
    assert accumulates_at(graph.guarantee) == pytest.approx(0.0, abs=0.01)
    places = np.linspace(-8.0, 8.0, 100_001)
    for alpha in (0.2, 0.47):
        below = np.sin(3 * places) < alpha * np.sqrt(1 + places**2)
        assert graph.count(alpha) == np.count_nonzero(np.diff(below))


class Teeth(PiecewiseSystem):
    """alpha = sin(5 z) up to z = 30, where it goes on straight: a repeating path that ends."""

    size = 1

    def test_functions(self, z, alpha):
        return np.array([z[0] - 30.0])

    def residual(self, z, alpha, character):
        end = np.sin(150.0) + 5.0 * np.cos(150.0) * (z - 30.0)
        return alpha - (end if character.signs[0] else np.sin(5.0 * z))


@pytest.mark.slow
def test_limits_let_a_path_repeat_itself_as_long_as_they_last():
    graph = trace(Teeth(), (np.zeros(1), 0.0), (-2.0, 2.0), limits=Limits(pieces=30))
    assert len(graph.pieces) == 30
    assert not any("repeats" in point.message for point in graph.special_points())


@pytest.mark.parametrize("seed", range(5))
def test_limits_of_sequences(seed):
    rng, k = np.random.default_rng(seed), np.arange(10.0, 40.0)
    limit, ratio = rng.normal(), rng.uniform(0.05, 0.9)
    assert accumulation(limit - 3.0 * ratio ** (k - 10.0)) == pytest.approx(limit, abs=1e-9)
    assert accumulation(limit + 1.0 / k) == pytest.approx(limit, abs=2e-3)
    taking_turns = limit + (-0.5) ** np.arange(20.0)
    assert accumulation(taking_turns) == pytest.approx(limit, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_sequences_without_a_limit(seed):
    rng, k = np.random.default_rng(seed), np.arange(10.0, 40.0)
    assert accumulation(np.sqrt(k)) is None
    assert accumulation(np.log(k)) is None
    assert accumulation(k) is None
    assert accumulation(rng.normal(size=30)) is None
    assert accumulation(np.cumsum(np.sort(rng.random(12))[::-1])) is None
    assert accumulation(k[:3]) is None
