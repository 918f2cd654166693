"""The command ``pwscont sweep``: what it prints, writes, keeps and refuses."""

import pytest
from studycases import scene_of_one_node
from terminals import Clock, Terminal

from pwscont.commands.cli import main
from pwscont.commands.progress import CaseProgress


@pytest.fixture
def one_node_scene(monkeypatch):
    """Offer a scene with settings that takes milliseconds."""
    load = "pwscont.studies.problem.load_scene"
    monkeypatch.setattr(load, lambda _, given: scene_of_one_node(**given))
    monkeypatch.setattr("pwscont.studies.problem.scene_settings", lambda _: ("friction", "f_nu"))


@pytest.mark.usefixtures("one_node_scene")
def test_a_sweep_prints_and_writes_a_row_for_each_case(capsys, tmp_path):
    out = tmp_path / "out"
    asked = ["sweep", "one", "--over", "friction=1:4:2", "f_nu=0.25,0.5"]
    asked += ["--measure", "max-count", "--measure", "non-unique", "-o", str(out)]
    assert main(asked) == 0
    printed = capsys.readouterr()
    assert "4 of 4 cases" in printed.out
    assert "  4         0.25  3          ((-1, -0.5))" in printed.out
    assert "proven 4, not proven 0, failed 0" in printed.out
    assert "no picture: non-unique cannot be drawn" in printed.err
    assert {file.name for file in out.iterdir()} == {"study.csv", "study.db", "max-count.png"}
    table = (out / "study.csv").read_bytes()
    assert len(table.splitlines()) == 5
    assert main(asked) == 2
    assert "it holds 4 rows" in capsys.readouterr().err
    assert main([*asked, "--resume"]) == 0
    assert (out / "study.csv").read_bytes() == table


@pytest.mark.usefixtures("one_node_scene")
def test_an_interrupted_sweep_keeps_what_is_done(capsys, monkeypatch, tmp_path):
    def interrupt(progress, done, total):
        if done == 2:
            raise KeyboardInterrupt

    asked = ["sweep", "one", "--over", "friction=1:4:4", "-o", str(tmp_path / "out")]
    with monkeypatch.context() as patched:
        patched.setattr("pwscont.commands.progress.CaseProgress.__call__", interrupt)
        assert main(asked) == 130
    assert len((tmp_path / "out" / "study.csv").read_text().splitlines()) == 3
    assert main([*asked, "--resume", "--graphs"]) == 0
    assert "4 of 4 cases" in capsys.readouterr().out
    assert len(list((tmp_path / "out" / "graphs").iterdir())) >= 2


@pytest.mark.usefixtures("one_node_scene")
def test_resume_with_nothing_to_resume_begins(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert main(["sweep", "one", "--over", "friction=1:4:2", "--resume", "-o", "out"]) == 0
    assert (tmp_path / "out" / "study.db").exists()


@pytest.mark.usefixtures("one_node_scene")
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--over", "friction=1,2"], "--over varies friction twice"),
        (["--over", "mu=1,2"], "no setting 'mu'; it has friction, f_nu"),
        (["-s", "friction=2"], "friction cannot be fixed and varied at once"),
        (["--measure", "max-cuont"], "did you mean max-count"),
        (["--resume"], "--resume needs -o DIR"),
        (["--graphs"], "--graphs needs -o DIR"),
        (["--workers", "0"], "workers must be a positive whole number"),
    ],
)
def test_wrong_sweeps_are_refused_in_words(capsys, monkeypatch, tmp_path, more, words):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "one", "--over", "friction=1:4:2", *more]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("friction", "is not of the form NAME=LO:HI:COUNT"),
        ("friction=", "is not of the form NAME=LO:HI:COUNT"),
        ("friction=1:2", "is not of the form NAME=LO:HI:COUNT"),
        ("friction=1:x:3", "is not of the form NAME=LO:HI:COUNT"),
        ("friction=1:2:0", "COUNT must be from 1 to 1000000, got 0"),
        ("friction=1:2:1000000000", "COUNT must be from 1 to 1000000, got 1000000000"),
        ("friction=1:inf:3", "LO and HI must be finite"),
    ],
)
def test_ranges_that_are_none_are_refused_in_words(capsys, over, words):
    with pytest.raises(SystemExit) as ended:
        main(["sweep", "fig7", "--over", over])
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ("0:49:50", list(range(50))),  # whole numbers stay whole
        ("0.77:6.69:2", [0.77, 6.69]),  # and ends are what was asked for
        ("2:5:1", [2.0]),
        ("5:2:3", [5.0, 3.5, 2.0]),
    ],
)
def test_ranges_are_evenly_spaced(monkeypatch, values, expected):
    seen = []
    monkeypatch.setattr("pwscont.commands.sweep.run", lambda options: seen.append(options) or 0)
    assert main(["sweep", "fig7", "--over", f"friction={values}"]) == 0
    assert seen[0].over == [("friction", expected)]


def test_progress_of_cases_has_rate_and_time_left():
    clock, stream = Clock(), Terminal()
    progress = CaseProgress(stream, clock)
    progress(10, 1000)  # found in the store
    clock.now += 2.0
    progress(14, 1000)
    assert stream.getvalue().strip() == "14 of 1000 cases, 2 cases/s, 8:13 min left"


@pytest.mark.usefixtures("one_node_scene")
def test_a_sweep_of_which_all_cases_fail_has_a_status_of_its_own(capsys):
    ways = [("count-at=9", 1), ("count-at=0", 0)]
    for measure, status in ways:
        assert main(["sweep", "one", "--over", "friction=1,4", "--measure", measure]) == status
    assert "outside the interval" in capsys.readouterr().out


@pytest.mark.usefixtures("one_node_scene")
def test_a_sweep_says_at_once_that_it_asks_a_scheduler(capsys, monkeypatch):
    monkeypatch.setattr("pwscont.commands.sweep.Study.run", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(["sweep", "one", "--over", "friction=1,4", "--scheduler", "tcp://10.0.0.1:8786"])
    assert "asking the scheduler at tcp://10.0.0.1:8786" in capsys.readouterr().err
