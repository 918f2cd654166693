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
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.scenes import example1, example3, fig7, one_node
from sweeps import swept

from pwscont import BranchGraph, InvalidInputError, Journal, MultiStart, Switched, explore
from pwscont.commands.cli import main
from pwscont.continuation.follow import PieceFollower
from pwscont.continuation.journal import walk_of, written
from pwscont.scenes.scene import Scene

ROUNDING = {"rtol": 1e-12, "atol": 1e-13}


def same(a, b):
    assert len(a.pieces) == len(b.pieces)
    for one, other in zip(a.pieces, b.pieces, strict=True):
        assert (one.start, one.end, one.label) == (other.start, other.end, other.label)
        assert one.character == other.character
        assert one.det_sign == other.det_sign
        np.testing.assert_allclose(one.points, other.points, **ROUNDING)
    for one, other in zip(a.special_points(), b.special_points(), strict=True):
        assert (one.kind, one.message) == (other.kind, other.message)
        np.testing.assert_allclose([*one.z, one.alpha], [*other.z, other.alpha], **ROUNDING)


@pytest.mark.parametrize("times", swept([2], [10]))
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


def finished(path):
    if not path.exists():
        return 0
    journal = Journal(path)
    pieces = len(journal)
    journal.close()
    return pieces


def islands():
    """Two circles and a line, which the search finds one after the other."""

    def f(z, alpha, sw):
        one, other = (z - 2.0) ** 2 + alpha**2 - 0.3, (z + 1.0) ** 2 + (alpha - 0.5) ** 2 - 0.2
        return one * other * (z - 0.1 * alpha)

    return SimpleNamespace(system=Switched(1, f), interval=(-1.5, 1.5))


@pytest.mark.parametrize("scene", [fig7, example1, example3, islands])
def test_interrupted_after_every_piece(scene, tmp_path, monkeypatch):
    made, walk, left = scene(), PieceFollower.walk, [0]

    def until_interrupted(self, ray):
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        return walk(self, ray)

    monkeypatch.setattr(PieceFollower, "walk", until_interrupted)
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
    walks, walk = [], PieceFollower.walk

    def kept(self, ray):
        found = walk(self, ray)
        walks.append((ray, found))
        return found

    monkeypatch.setattr(PieceFollower, "walk", kept)
    run()
    assert any(ray.interface_cells for ray, _ in walks) == (run is along_a_boundary)
    for ray, found in walks:
        read = walk_of(written(found), ray)
        np.testing.assert_array_equal(read.points, found.points)
        assert (read.arrival.kind, read.arrival.message) == (
            found.arrival.kind,
            found.arrival.message,
        )
        for a, b in zip(read.arrival.rays, found.arrival.rays, strict=True):
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
    database.execute("CREATE TABLE journal_3 (number)")
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
    with pytest.raises(sqlite3.ProgrammingError, match="closed"):
        explore(made.system, made.interval, journal=journal)


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


def test_a_second_process_is_kept_out(tmp_path, capsys):
    """Whoever comes second is told so, and the first one's journal stays."""
    journal = Journal(tmp_path / "fig7.journal")
    for more in ([], ["--resume"]):
        assert main(["run", "fig7", "-o", str(tmp_path), *more]) == 2
        assert "another process is writing to it" in capsys.readouterr().err
    journal.close()
    assert main(["run", "fig7", "-o", str(tmp_path), "--resume"]) == 0


# -- damage -------------------------------------------------------------------------------------


def flipped(content, rng):
    return bit_turned(content, rng.integers(len(content)), rng.integers(8))


def overwritten(content, rng):
    at, count = rng.integers(len(content)), rng.integers(1, 40)
    return content[:at] + rng.bytes(count) + content[at + count :]


def zeroed(content, rng):
    """Lose a page, as a disk does."""
    page = 512 * rng.integers(len(content) // 512 + 1)
    return content[:page] + bytes(len(content[page : page + 512])) + content[page + 512 :]


def truncated(content, rng):
    return content[: rng.integers(len(content))]


def cut_out(content, rng):
    at, count = rng.integers(len(content)), rng.integers(1, 600)
    return content[:at] + content[at + count :]


def doubled(content, rng):
    at, count = rng.integers(len(content)), rng.integers(1, 600)
    return content[: at + count] + content[at:]


def lengthened(content, rng):
    """Return the content with zeros behind, as after a failure of the power."""
    return content + bytes(int(rng.integers(1, 5000)))


DAMAGES = (flipped, overwritten, zeroed, truncated, cut_out, doubled, lengthened)


def recorded(path, made, **how):
    journal = Journal(path)
    try:
        return explore(made.system, made.interval, journal=journal, **how)
    finally:
        journal.close()


def bit_turned(content, at, bit):
    return content[:at] + bytes([content[at] ^ (1 << bit)]) + content[at + 1 :]


def damaged(path, made, content, truth):
    """Go on with a damaged journal; returns whether it was refused in words."""
    path.write_bytes(content)
    try:
        graph = recorded(path, made)
    except InvalidInputError as refusal:
        words = str(refusal)
    else:
        same(graph, truth)
        same(recorded(path, made), truth)  # what was written behind the damage is read again
        return False
    assert "remove it, or write elsewhere" in words or "cannot be written" in words
    assert str(path) in words
    return True


def check_damages(scene, path, times, seed):
    made = scene()
    truth = recorded(path, made)
    content, rng, refused = path.read_bytes(), np.random.default_rng(seed), 0
    for i in range(times):
        refused += damaged(path, made, DAMAGES[i % len(DAMAGES)](content, rng), truth)
    assert 0.3 * times < refused < 0.9 * times


@pytest.mark.parametrize("scene", swept([fig7], [example3]))
def test_a_damaged_journal_is_refused_or_gives_an_equal_graph(scene, tmp_path):
    check_damages(scene, tmp_path / "journal", 42, seed=5)


@pytest.mark.slow
@pytest.mark.parametrize("scene", [fig7, example1, example3])
@pytest.mark.parametrize("seed", [6])
def test_many_damages(scene, tmp_path, seed):
    check_damages(scene, tmp_path / "journal", 250, seed)


@pytest.mark.parametrize("step", swept([23], [1]))
def test_every_byte_that_is_not_zero_counts(tmp_path, step):
    """Those of SQLite that it does not look at change no graph; all others are seen."""
    made, path = fig7(), tmp_path / "journal"
    truth = recorded(path, made)
    content, refused = path.read_bytes(), 0
    places = np.flatnonzero(np.frombuffer(content, np.uint8))[::step]
    for number, at in enumerate(places):
        refused += damaged(path, made, bit_turned(content, at, number % 8), truth)
    assert refused > 0.9 * len(places)


@pytest.mark.parametrize(
    "change",
    [
        "DELETE FROM journal_3 WHERE number = 4",
        "UPDATE journal_3 SET number = number + 1000 WHERE number = 4",
        "UPDATE journal_3 SET kind = 'start' WHERE number = 4",
        "UPDATE journal_3 SET text = text || ' ' WHERE number = 4",
        "UPDATE journal_3 SET rows = CAST(rows AS TEXT) WHERE number = 4",
        "UPDATE journal_3 SET rows = NULL WHERE number = 4",
        "UPDATE journal_3 SET checksum = NULL WHERE number = 4",
        "UPDATE journal_3 SET (kind, text, rows, checksum) = "
        "(SELECT kind, text, rows, checksum FROM journal_3 WHERE number = 5) WHERE number = 4",
    ],
)
def test_changes_by_hand_are_refused(tmp_path, change):
    """A record that is taken out whole leaves a gap that is seen."""
    path = tmp_path / "journal"
    recorded(path, fig7())
    with sqlite3.connect(path) as database:
        assert database.execute(change).rowcount == 1
    database.close()
    with pytest.raises(InvalidInputError, match=r"is damaged \(record 4 is missing or changed\)"):
        Journal(path)


def test_the_last_record_may_be_lost(tmp_path):
    made, path = fig7(), tmp_path / "journal"
    truth = recorded(path, made)
    with sqlite3.connect(path) as database:
        database.execute("DELETE FROM journal_3 WHERE number > 4")
    database.close()
    same(recorded(path, made), truth)


def test_a_full_disk_stops_the_record_and_not_the_run(tmp_path):
    made, path = example1(), tmp_path / "journal"
    truth, journal = made.run(), Journal(path)
    journal._data.execute("PRAGMA max_page_count = 4")
    same(explore(made.system, made.interval, journal=journal), truth)
    assert isinstance(journal.trouble, sqlite3.OperationalError)
    assert "full" in str(journal.trouble)
    assert not journal.is_finished
    journal.close()
    assert 0 < finished(path) < len(truth.pieces)
    same(recorded(path, made), truth)


def test_ctrl_c_between_writing_and_counting(tmp_path):
    """The last record is written a second time, with the same number."""
    made, path = fig7(), tmp_path / "journal"
    journal = Journal(path)
    truth = explore(made.system, made.interval, journal=journal)
    journal._numbers["finished"].pop()
    same(explore(made.system, made.interval, journal=journal), truth)
    assert journal.trouble is None
    journal.close()
    same(recorded(path, made), truth)


# -- the command line -----------------------------------------------------------------------------


@pytest.mark.slow
def test_interruption_keeps_what_was_found_and_resume_goes_on(tmp_path, monkeypatch, capsys):
    walk, left = PieceFollower.walk, [3]

    def interrupted(self, ray):
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        return walk(self, ray)

    monkeypatch.setattr(PieceFollower, "walk", interrupted)
    out = str(tmp_path)
    assert main(["run", "example1", "-o", out]) == 130
    assert "3 pieces are kept in" in capsys.readouterr().err
    monkeypatch.undo()
    assert main(["run", "example1", "-o", out]) == 2
    assert "--resume goes on with it" in capsys.readouterr().err
    assert main(["run", "example1", "-o", out, "--resume"]) == 0
    assert not list(tmp_path.glob("*.journal*"))
    same(BranchGraph.load(tmp_path / "example1.npz"), example1().run())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fig7"], "needs -o DIR"),
        (["fig5", "-o", "."], "keeps no journal"),
    ],
)
def test_what_cannot_be_resumed(arguments, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["run", *arguments, "--resume"]) == 2
    assert message in capsys.readouterr().err


def test_resume_with_nothing_to_resume_begins(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):  # a finished run leaves no journal either
        assert main(["run", "fig7", "-o", "out", "--resume"]) == 0
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"fig7.npz", "fig7.png"}


def test_a_journal_closes_itself(tmp_path):
    scene = example1()
    with Journal(tmp_path / "run.journal") as journal:
        explore(scene.system, scene.interval, journal=journal)
        pieces = len(journal)
    with Journal(tmp_path / "run.journal") as again:  # a journal that is open would be locked
        assert (len(again), again.is_finished) == (pieces, True)


def test_a_run_that_fails_keeps_its_journal(tmp_path, monkeypatch, capsys):
    def fails(*_):
        raise OSError("disk full")

    monkeypatch.setattr(Scene, "solve", fails)
    assert main(["run", "fig7", "-o", str(tmp_path)]) == 2
    assert (tmp_path / "fig7.journal").exists()


def test_damage_that_sqlite_has_no_memory_for_is_said_in_words(tmp_path, monkeypatch):
    def endless(*_):
        raise MemoryError

    monkeypatch.setattr(Journal, "_value", endless)
    with pytest.raises(InvalidInputError, match=r"cannot use the journal .* it is damaged"):
        Journal(tmp_path / "journal")
