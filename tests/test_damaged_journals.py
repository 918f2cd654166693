"""The journal: damage, and the command line."""

import sqlite3

import numpy as np
import pytest
from journal_parts import DAMAGES, bit_turned, damaged, finished, recorded, same
from pwscont_coulomb.scenes import example1, example3, fig7
from sweeps import swept

from pwscont import BranchGraph, InvalidInputError, Journal, explore
from pwscont.commands.cli import main
from pwscont.continuation.follow import PieceFollower
from pwscont.scenes.scene import Scene


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
        "DELETE FROM journal_4 WHERE number = 4",
        "UPDATE journal_4 SET number = number + 1000 WHERE number = 4",
        "UPDATE journal_4 SET kind = 'start' WHERE number = 4",
        "UPDATE journal_4 SET text = text || ' ' WHERE number = 4",
        "UPDATE journal_4 SET rows = CAST(rows AS TEXT) WHERE number = 4",
        "UPDATE journal_4 SET rows = NULL WHERE number = 4",
        "UPDATE journal_4 SET checksum = NULL WHERE number = 4",
        "UPDATE journal_4 SET (kind, text, rows, checksum) = "
        "(SELECT kind, text, rows, checksum FROM journal_4 WHERE number = 5) WHERE number = 4",
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
        database.execute("DELETE FROM journal_4 WHERE number > 4")
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
    walk, left = PieceFollower.follow, [3]

    def interrupted(self, ray):
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        return walk(self, ray)

    monkeypatch.setattr(PieceFollower, "follow", interrupted)
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


@pytest.mark.slow
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
