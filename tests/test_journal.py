"""Interrupted runs go on where they stopped, and end with the same graph, to rounding.

On straight pieces what was factorised is carried from cell to cell, and made afresh where a run
goes on: the last digits may differ.
"""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import long_run
import numpy as np
import pytest
from journal_parts import (
    DAMAGES,
    bit_turned,
    damaged,
    finished,
    recorded,
    same,
)
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.scenes import example1, example3, fig7, one_node
from sweeps import swept

from pwscont import (
    BranchGraph,
    InvalidInputError,
    Journal,
    MultiStart,
    PiecewiseSystem,
    Switched,
    explore,
    trace,
)
from pwscont.commands.cli import main
from pwscont.continuation.follow import PieceFollower
from pwscont.continuation.journal import piece_of, written


@pytest.mark.parametrize("times", swept([1], [10]))
def test_killed_at_random_moments_and_resumed(tmp_path, times):
    """kill -9 in the middle of whatever it does; each time what is finished is kept."""
    journal, graph = tmp_path / "run.journal", tmp_path / "run.npz"
    rng, known, kills = np.random.default_rng(3), [], 0
    command = [sys.executable, long_run.__file__, str(journal), str(graph)]
    while kills < times:
        process = subprocess.Popen(command, stdout=subprocess.PIPE)
        process.stdout.readline()
        time.sleep(rng.uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        kills += process.returncode == -signal.SIGKILL
        if graph.exists():  # it was faster: begin again
            graph.unlink()
            journal.unlink()
            known = []
            continue
        known.append(finished(journal))
    assert known == sorted(known)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    same(BranchGraph.load(graph), long_run.run())


def islands():
    """Two circles and a line, which the search finds one after the other."""

    def f(z, alpha, sw):
        one, other = (z - 2.0) ** 2 + alpha**2 - 0.3, (z + 1.0) ** 2 + (alpha - 0.5) ** 2 - 0.2
        return one * other * (z - 0.1 * alpha)

    return SimpleNamespace(system=Switched(1, f), interval=(-1.5, 1.5))


@pytest.mark.parametrize("scene", [fig7, example1, example3, islands])
@pytest.mark.sweep(2)
def test_interrupted_after_every_piece(scene, tmp_path, monkeypatch):
    made, walk, left = scene(), PieceFollower.follow, [0]

    def until_interrupted(self, ray):
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        return walk(self, ray)

    monkeypatch.setattr(PieceFollower, "follow", until_interrupted)
    pieces = 0
    while True:
        left[0] = 1  # one walk more each time
        journal = Journal(tmp_path / "journal")
        assert len(journal) == pieces
        try:
            graph = explore(made.system, made.interval, journal=journal)
            if not graph.guarantee.startswith("interrupted"):
                break
            pieces += 1
        finally:
            journal.close()
    assert pieces >= 3
    monkeypatch.undo()
    same(graph, explore(made.system, made.interval))


def test_a_finished_search_is_not_made_again(tmp_path, monkeypatch):
    made = example3()
    journal = Journal(tmp_path / "journal")
    first = explore(made.system, made.interval, search=MultiStart(), journal=journal)

    def nothing(self, *_):
        yield from ()
        pytest.fail("searched again")

    monkeypatch.setattr(MultiStart, "starts", nothing)
    same(first, explore(made.system, made.interval, search=MultiStart(), journal=journal))
    journal.close()


def along_a_boundary():
    """Follow a load on the boundary of stick to slip, where rays belong to two cells."""
    on_it = AffineLoad([0.0, 0.0], [0.25, 4.0 * 0.25])  # u = 0: lam_t = -f_t, lam_nu = -f_nu
    explore(CoulombLoad(one_node(), on_it, 4.0), (1.0, 2.0))


@pytest.mark.parametrize("run", [lambda: long_run.run(interval=(-5.0, -2.0)), along_a_boundary])
def test_a_walk_reads_as_it_was_written(run, monkeypatch):
    walks, walk = [], PieceFollower.follow

    def kept(self, ray):
        found = walk(self, ray)
        walks.append((ray, found))
        return found

    monkeypatch.setattr(PieceFollower, "follow", kept)
    run()
    assert any(ray.interface_cells for ray, _ in walks) == (run is along_a_boundary)
    for ray, found in walks:
        (read, there), (points, arrival) = piece_of(written(found), ray), found
        np.testing.assert_array_equal(read, points)
        assert (there.kind, there.message) == (arrival.kind, arrival.message)
        for a, b in zip(there.rays, arrival.rays, strict=True):
            assert a.cells == b.cells
            assert a.curve.selection.bounding.tolist() == b.curve.selection.bounding.tolist()
            assert (a.index, a.state.orientation) == (b.index, b.state.orientation)
            for name in ("x", "tangent", "error"):
                np.testing.assert_array_equal(getattr(a.state, name), getattr(b.state, name))


def test_a_journal_of_another_run_is_refused(tmp_path):
    journal = Journal(tmp_path / "journal")
    made = fig7()
    explore(made.system, made.interval, journal=journal)
    words = r"interval: \[-2.0, 2.0\] when it was begun, \[-1.0, 2.0\] now"
    with pytest.raises(InvalidInputError, match=words):
        explore(made.system, (-1.0, 2.0), journal=journal)
    other = type(made.system)(made.system.body, made.system.load, 3.0)
    with pytest.raises(InvalidInputError, match="values of its functions have changed"):
        explore(other, made.interval, journal=journal)  # it begins with the same piece
    same(explore(made.system, made.interval, journal=journal), made.run())
    journal.close()


class Springs(PiecewiseSystem):
    """From z = 2 on a spring k1 more, from z = 4 on k2; the cells have their own residuals."""

    size = 1

    def __init__(self, k1, k2):
        self.k1, self.k2 = k1, k2

    def test_functions(self, z, alpha):
        return np.array([z[0] - 2.0, z[0] - 4.0])

    def residual(self, z, alpha, character):
        beyond = (z - 2.0, z - 4.0)
        added = zip(character.signs, (self.k1, self.k2), beyond, strict=True)
        return z - alpha + sum(k * force for sign, k, force in added if sign)


def test_other_constants_in_cells_that_no_path_enters_are_refused(tmp_path):
    """The changed law is z up to 2, falls to -2 at 4, and rises again."""
    system, changed, interval = Springs(0.5, 0.5), Springs(-3.0, 3.0), (-1.0, 1.0)
    with Journal(tmp_path / "journal") as journal:
        graph = explore(system, interval, journal=journal)
        same(explore(Springs(0.5, 0.5), interval, journal=journal), graph)
        assert [graph.count(0.5), explore(changed, interval).count(0.5)] == [1, 3]
        with pytest.raises(InvalidInputError, match="values of its functions have changed"):
            explore(changed, interval, journal=journal)


def test_a_journal_of_functions_that_are_not_defined_at_every_point(tmp_path):
    """The root of z - 5 is nan where the values are compared."""

    def system():
        return Switched(1, lambda z, a, sw: np.sqrt(z - 5.0) + sw.relu(z - 6.0) - a)

    with Journal(tmp_path / "journal") as journal:
        graph = trace(system(), ([5.25], 0.5), (0.25, 2.0), journal=journal)
        same(trace(system(), ([5.25], 0.5), (0.25, 2.0), journal=journal), graph)
    assert graph.solutions(2.0)[0].z == pytest.approx([5.0 + (np.sqrt(13.0) - 1.0) ** 2 / 4.0])


@pytest.mark.parametrize("stiffness", [50.0, 1.0, 5.1])
@pytest.mark.sweep(4)
def test_other_constants_beyond_a_kink_are_refused(tmp_path, stiffness):
    def arch(stop):
        return Switched(1, lambda z, t, sw: z * (z - 1.0) * (z - 2.0) + stop * sw.relu(z - 1.0) - t)

    with Journal(tmp_path / "j") as journal:
        explore(arch(5.0), (-0.5, 1.0), journal=journal).save(tmp_path / "graph.npz")
    with (
        Journal(tmp_path / "j") as journal,
        pytest.raises(InvalidInputError, match="values of its functions have changed"),
    ):
        explore(arch(stiffness), (-0.5, 1.0), journal=journal)
    with pytest.raises(InvalidInputError, match="is of another system"):
        BranchGraph.load(tmp_path / "graph.npz", arch(stiffness))


@pytest.mark.parametrize(
    "content", [Path(__file__).read_bytes(), b"pwscont journal 2\n", b"xy", bytes(4096)]
)
def test_another_file_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "file"
    path.write_bytes(content)
    words = "is no journal of this version; if it is of an earlier one, remove it"
    with pytest.raises(InvalidInputError, match=words):
        Journal(path)
    assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_another_database_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "database"
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE journal_4 (number)")
    database.close()
    content = path.read_bytes()
    with pytest.raises(InvalidInputError, match="is no journal"):
        Journal(path)
    assert path.read_bytes() == content


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "missing" / "journal"):
        with pytest.raises(InvalidInputError, match="cannot be written: see that its directory"):
            Journal(path)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write")
def test_a_directory_of_others_is_refused(tmp_path):
    path = tmp_path / "journal"
    Journal(path).close()
    tmp_path.chmod(0o500)
    try:
        for place in (path, tmp_path / "new"):
            with pytest.raises(InvalidInputError, match="cannot be written"):
                Journal(place)
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("name", [":memory:", "file:journal?mode=memory"])
def test_names_that_are_no_files_to_sqlite(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    Journal(name).close()
    assert Path(name).exists()


def test_a_closed_journal_says_so(tmp_path):
    made, journal = fig7(), Journal(tmp_path / "journal")
    journal.close()
    for _ in range(2):
        with pytest.raises(
            InvalidInputError, match=r"it is closed; Journal\(path\) opens it again"
        ):
            explore(made.system, made.interval, journal=journal)
        with Journal(tmp_path / "journal") as journal:  # closed again, and not empty
            explore(made.system, made.interval, journal=journal)


@pytest.mark.parametrize("path", [None, 3, b"journal"])
def test_a_journal_needs_a_path(path):
    with pytest.raises(InvalidInputError, match="a journal needs the path of a file, got"):
        Journal(path)


# -- the log ------------------------------------------------------------------------------------


def as_killed(path, made):
    """Leave the files of a run whose process was killed at its end; returns its graph."""
    journal = Journal(path.with_name("running"))
    graph = explore(made.system, made.interval, journal=journal)
    for suffix in ("", "-wal"):
        path.with_name(path.name + suffix).write_bytes(
            path.with_name("running" + suffix).read_bytes()
        )
    journal.remove()
    return graph


def test_a_closed_journal_is_one_file(tmp_path):
    path = tmp_path / "journal"
    graph = as_killed(path, fig7())
    assert {file.name for file in tmp_path.iterdir()} == {"journal", "journal-wal"}
    journal = Journal(path)
    assert journal.is_finished
    assert len(journal) == len(graph.pieces)
    journal.close()
    assert list(tmp_path.iterdir()) == [path]


def test_remove_leaves_nothing(tmp_path):
    path = tmp_path / "journal"
    as_killed(path, fig7())
    journal = Journal(path)
    journal.close()
    as_killed(path, fig7())
    journal.remove()
    assert not list(tmp_path.iterdir())


def test_a_journal_that_was_removed_without_its_log_begins_again(tmp_path):
    path = tmp_path / "journal"
    as_killed(path, fig7())
    path.unlink()
    journal = Journal(path)
    assert len(journal) == 0
    journal.close()


@pytest.mark.parametrize("seed", swept([8], [9, 10, 11]))
def test_a_damaged_log_only_ends_earlier(tmp_path, seed):
    """Each record of the log is there or not: none is read that was not written."""
    made, path, log = example1(), tmp_path / "journal", tmp_path / "journal-wal"
    truth, rng, lengths = as_killed(path, made), np.random.default_rng(seed), set()
    file, whole = path.read_bytes(), log.read_bytes()
    for damage in 3 * DAMAGES:
        path.write_bytes(file)
        log.write_bytes(damage(whole, rng))
        lengths.add(finished(path))
        same(recorded(path, made), truth)
    assert {0, len(truth.pieces)} <= lengths


@pytest.mark.parametrize("seed", swept([12], [13, 14, 15]))
def test_a_damaged_file_with_a_log_is_refused_or_gives_an_equal_graph(tmp_path, seed):
    made, path, log = fig7(), tmp_path / "journal", tmp_path / "journal-wal"
    truth, rng = as_killed(path, made), np.random.default_rng(seed)
    file, whole = path.read_bytes(), log.read_bytes()
    places = np.flatnonzero(np.frombuffer(file, np.uint8))
    for at in rng.choice(places, 30):
        log.write_bytes(whole)
        damaged(path, made, bit_turned(file, at, rng.integers(8)), truth)


@pytest.mark.slow
def test_a_second_process_is_kept_out(tmp_path, capsys):
    """Whoever comes second is told so, and the first one's journal stays."""
    journal = Journal(tmp_path / "fig7.journal")
    for more in ([], ["--resume"]):
        assert main(["run", "fig7", "-o", str(tmp_path), *more]) == 2
        assert "another process is writing to it" in capsys.readouterr().err
    journal.close()
    assert main(["run", "fig7", "-o", str(tmp_path), "--resume"]) == 0


class FarAway(PiecewiseSystem):
    """(z - 300)^2 = 1e-6 (1 - alpha^2): the path shows that z varies by far less than 300."""

    size = 1

    def test_functions(self, z, alpha):
        return z + 1e9

    def residual(self, z, alpha, character):
        return (z - 300.0) ** 2 - 1e-6 * (1.0 - alpha**2)


@pytest.mark.slow
def test_a_run_that_begins_again_with_other_magnitudes_is_resumed(tmp_path, monkeypatch):
    asked = FarAway(), (np.array([0.1]), 0.2), (-1.0, 1.0)
    with Journal(tmp_path / "whole") as journal:
        graph = trace(*asked, journal=journal)
        assert journal.magnitudes is not None
    same(graph, trace(*asked))
    walk, left = PieceFollower.follow, [0]

    def until_interrupted(self, ray):
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        return walk(self, ray)

    monkeypatch.setattr(PieceFollower, "follow", until_interrupted)
    for _ in range(20):
        left[0] = 1
        with Journal(tmp_path / "parts") as journal:
            graph = trace(*asked, journal=journal)
        if not graph.guarantee.startswith("interrupted"):
            break
    same(graph, trace(FarAway(), *asked[1:], journal=Journal(tmp_path / "whole")))
    assert {piece.points[:, 0].min() > 299.0 for piece in graph.pieces} == {True}


@pytest.mark.slow
def test_a_finished_journal_gives_the_same_proof(tmp_path):
    asked = Switched(1, lambda z, a, sw: z**3 - 2.0 * z + sw.relu(z - 0.5) - a), (-1.5, 1.5)
    said = []
    for _ in range(2):
        with Journal(tmp_path / "journal") as journal:
            said.append(explore(*asked, journal=journal).guarantee)
    assert said == 2 * ["complete in the box, proved; balanced"]


@pytest.mark.slow
@pytest.mark.parametrize("calls", [90, 130])
def test_a_run_that_was_cut_while_magnitudes_were_measured_goes_on(tmp_path, calls):
    """The circle of radius sqrt(0.1) about (2, 0), and 1 + z = 0.3 |alpha|."""
    left = [0]

    def circle_and_line(z, a, sw):
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt
        return (sw.abs(z - 2.0) ** 2 + a * a - 0.1) * (z + 1.0 - 0.3 * sw.abs(a))

    system, left[0] = Switched(1, circle_and_line), calls
    with Journal(tmp_path / "journal") as journal:
        graph = explore(system, (-1.0, 1.0), journal=journal)
    assert graph.guarantee.startswith("interrupted")
    with Journal(tmp_path / "journal") as journal:
        graph = explore(system, (-1.0, 1.0), journal=journal)
    assert [graph.count(alpha) for alpha in (-0.5, 0.05, 0.5)] == [1, 3, 1]
