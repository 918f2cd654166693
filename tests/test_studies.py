"""Studies: against closed forms, the same rows whatever runs them, and nothing lost on the way."""

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from functools import partial
from importlib.util import find_spec
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import studycases
from studycases import (
    GRAPH,
    ends_always,
    ends_once,
    exits,
    known_graph,
    number_of_pieces,
    one_node,
    parabola,
    recorded,
    refused,
    slow_study,
)

from pwscont import (
    BranchGraph,
    CountAt,
    CriticalValue,
    FirstFold,
    InvalidInputError,
    MaxCount,
    MissingPackageError,
    NonUnique,
    NonUniqueLength,
    PwscontError,
    QuantityAt,
    SceneNotFoundError,
    Study,
    StudyResult,
    UnknownNameError,
)
from pwscont.studies.store import Store

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command

FRICTIONS = (0.5, 1.5, 2.5, 4.0)
COUNTS = {"most": MaxCount(), "first": FirstFold(), "where": NonUnique()}


def numbers(result):
    """Return all rows without their seconds, and close the store."""
    rows = [row.numbers for row in result]
    result.close()
    return rows


def with_tests():
    """Return the environment of a process that can import the problems of this file."""
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"PYTHONPATH": path}


# -- truth: for one node three solutions in (-F f_nu, -(a/b) f_nu) if F > a/b, else one -----------


def test_non_uniqueness_of_one_node_has_its_closed_form():
    over = {"friction": FRICTIONS, "f_nu": (0.25, 0.5)}
    length = {"length": NonUniqueLength(), "inside": CountAt(-0.6)}
    for row in Study(one_node, over, COUNTS | length).run():
        F, f_nu = row.settings.values()
        lo, hi = -F * f_nu, -2.0 * f_nu
        found = row.values
        if F < 2.0:
            assert (found["most"], found["first"], found["where"]) == (1, None, ())
        else:
            assert found["most"] == 3
            assert found["first"] == pytest.approx(lo, rel=1e-12)
            assert found["where"] == (pytest.approx((lo, hi), rel=1e-12),)
        assert found["length"] == pytest.approx(max(0.0, hi - lo), rel=1e-12)
        assert found["inside"] == (3 if lo < -0.6 < hi else 1)
        assert (row.proven, row.guarantee, row.failure) == (True, "complete", "")


def test_a_vertical_piece_counts_as_infinitely_many():
    (row,) = Study(one_node, {"friction": [2.0]}, COUNTS).run()
    assert row.values["most"] == inf
    assert row.values["where"] == (pytest.approx((-0.5, -0.5)),)


def test_the_critical_friction_of_one_node_is_a_over_b():
    critical = CriticalValue("friction", 0.5, 5.0, tolerance=1e-6)
    (row,) = Study(one_node, {"f_nu": [0.25]}, {"F": critical}).run()
    assert row.values["F"] == pytest.approx(2.0, abs=1.01 * critical.tolerance)
    assert row.proven


@pytest.mark.parametrize("tolerance", [0.5, 1e-3, pytest.param(None, marks=pytest.mark.slow)])
def test_the_bracket_of_a_critical_value_is_as_narrow_as_asked_for(tolerance):
    """The tolerance is in units of the setting, whatever the first bracket is."""
    for lo, hi in ((0.5, 5.0), (0.5, 50.0), (1.9, 2.3)):
        asked = {
            "F": CriticalValue("friction", lo, hi, tolerance=tolerance),
            "between": CriticalValue("friction", lo, hi, tolerance=tolerance, bracket=True),
        }
        (row,) = Study(one_node, {"f_nu": [0.25]}, asked).run()
        low, high = row.values["between"]
        assert row.values["F"] == high
        assert lo <= low < 2.0 + 1e-12  # to rounding, the slip piece is vertical around 2
        assert 2.0 - 1e-12 < high <= hi
        assert high - low <= (tolerance or 1e-9 * (hi - lo))


@pytest.mark.parametrize("tolerance", [0.0, -1.0, inf, nan, "fine"])
def test_a_tolerance_is_a_positive_number(tolerance):
    with pytest.raises(InvalidInputError, match="in units of friction"):
        CriticalValue("friction", 0.5, 5.0, tolerance=tolerance)


def test_a_bracket_by_name():
    names = ["critical-bracket=friction:0.5:5:0.1"]
    (row,) = Study(one_node, {"f_nu": [0.25]}, names).run()
    low, high = row.values[names[0]]
    assert high - low <= 0.1


def test_without_a_change_there_is_no_critical_value_and_beyond_it_the_case_fails():
    asked = {"none": CriticalValue("friction", 0.5, 1.0), "beyond": CriticalValue("friction", 3, 5)}
    (row,) = Study(one_node, {"f_nu": [0.25]}, asked).run()
    assert row.values == {"none": None, "beyond": None}
    assert row.failure.startswith("beyond: friction = 3 is beyond the critical value already")


def test_a_critical_value_is_proven_only_if_all_graphs_are_complete():
    asked = {"F": CriticalValue("friction", 0.5, 5.0, tolerance=0.1)}
    (row,) = Study(studycases.unproven_above_three, {"f_nu": [0.25]}, asked).run()
    assert not row.proven
    assert row.guarantee == "at friction = 5: balanced"


def test_quantities_are_unknowns_and_what_a_scene_records():
    asked = {
        "slips": QuantityAt("u_t", -0.6, tuple),
        "twice": QuantityAt("twice", -0.6, min),
        "pieces": number_of_pieces,
    }
    (row,) = Study(recorded, {"friction": [4.0]}, asked).run()
    slips = sorted(solution["u_t"] for solution in GRAPH.solutions(-0.6))
    assert sorted(row.values["slips"]) == pytest.approx(slips)
    assert row.values["twice"] == pytest.approx(2.0 * slips[0])
    assert row.values["pieces"] == len(GRAPH.pieces)


def test_scenes_by_name_take_settings_as_the_command_line_does():
    pytest.importorskip("skfem")
    over = {"nodes": np.array([2.0, 3.0]), "friction": [0.2]}
    rows = list(Study("block", over, {"size": lambda graph: len(graph.names)}).run())
    assert [row.values["size"] for row in rows] == [8, 12]


# -- the same rows, whatever runs them -----------------------------------------------------------


@pytest.mark.slow
def test_two_workers_give_the_rows_of_one_bit_for_bit():
    study = Study(one_node, {"friction": np.linspace(0.5, 5.0, 9), "f_nu": [0.25, 0.3]}, COUNTS)
    assert numbers(study.run()) == numbers(study.run(workers=2))


def test_rows_stand_in_the_order_of_their_numbers_and_the_last_setting_changes_fastest():
    result = Study(known_graph, {"number": [1, 2]}, ["max-count"]).run()
    assert [row.case for row in result] == [0, 1]
    study = Study(one_node, {"friction": [1, 4], "f_nu": [0.3, 0.2]}, ["max-count"])
    assert [tuple(row.settings.values()) for row in study.run()] == [
        (1, 0.3),
        (1, 0.2),
        (4, 0.3),
        (4, 0.2),
    ]
    assert study.run().column("max-count").tolist() == [[1, 1], [3, 3]]


@pytest.mark.slow
def test_a_process_that_dies_is_replaced_and_its_case_runs_again(tmp_path):
    study = Study(partial(ends_once, folder=tmp_path), {"number": range(8)}, ["max-count"])
    rows = list(study.run(workers=2))
    assert (tmp_path / "ended").exists()
    assert [row.case for row in rows] == list(range(8))
    assert not any(row.failure for row in rows)


@pytest.mark.slow
def test_a_case_that_ends_every_process_is_a_failed_row():
    rows = list(Study(ends_always, {"number": range(4)}, ["max-count"]).run(workers=2))
    assert [bool(row.failure) for row in rows] == [False, False, True, False]
    assert rows[2].failure == "the case ended its process 3 times (exit code 9)"


def test_cases_that_fail_are_rows_that_say_why():
    asked = {"most": MaxCount(), "off": CountAt(9.0), "nan": lambda graph: np.nan}
    negative, zero, good = Study(refused, {"friction": [-1.0, 0.0, 4.0]}, asked).run()
    assert negative.failure == "friction is negative"
    assert zero.failure.startswith("ZeroDivisionError: ")
    assert good.values == {"most": 3, "off": None, "nan": None}
    assert good.failure == (
        "off: alpha = 9.0 lies outside the interval [-4.0, 4.0]; "
        "nan: it is nan; return None where there is nothing to measure"
    )


def test_a_case_cannot_end_the_program():
    (row,) = Study(exits, {"number": [1]}, ["max-count"]).run()
    assert row.failure == "SystemExit: enough"


def test_progress_is_told():
    told = []
    study = Study(known_graph, {"number": range(3)}, ["max-count"])
    study.run(report=lambda *done: told.append(done))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]


# -- the store -----------------------------------------------------------------------------------


def test_a_store_gives_back_every_bit(tmp_path):
    asked = {"odd": odd_values, "most": MaxCount()}
    study = Study(one_node, {"friction": [2.0, 1.0 / 3.0]}, asked)
    before = numbers(study.run())
    assert numbers(study.run(store=tmp_path / "study.db")) == before
    again = StudyResult.open(tmp_path / "study.db")
    assert again.is_finished
    assert again.provenance["measure"]["odd"].endswith("odd_values")
    assert set(again.provenance["versions"]) == {"python", "pwscont", "numpy", "scipy"}
    assert numbers(again) == before


def odd_values(graph):
    return np.array([0.1 + 0.2, 5e-324, 1.7976931348623157e308, inf]), "α", None, True


def test_a_study_goes_on_where_it_was_interrupted(tmp_path):
    def interrupt(done, total):
        if done == 4:
            raise KeyboardInterrupt

    path, study = tmp_path / "study.db", Study(known_graph, {"number": range(20)}, COUNTS)
    result = study.run(store=path, report=interrupt)
    assert (len(result), result.interrupted, result.is_finished) == (4, True, False)
    result.close()
    with pytest.raises(InvalidInputError, match="it holds 4 rows: resume goes on"):
        study.run(store=path)
    told = []
    whole = study.run(store=path, resume=True, report=lambda *done: told.append(done[0]))
    assert told == list(range(4, 21))
    assert numbers(whole) == numbers(study.run())


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_kills_at_random_moments_lose_nothing(tmp_path, workers):
    path, moments = tmp_path / "study.db", random.Random(workers)
    code = f"slow_study().run({workers}, store={str(path)!r}, resume=True)"
    script = f"from studycases import slow_study; {code}"
    for _ in range(5):
        process = subprocess.Popen([sys.executable, "-c", script], env=with_tests())
        deadline = time.monotonic() + 60.0
        while process.poll() is None and not path.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(moments.uniform(0.0, 1.5))
        process.kill()
        process.wait()
    result = slow_study().run(store=path, resume=True)
    assert numbers(result) == numbers(slow_study().run())


def has_ended(group):
    """Tell whether no process of a group is left, soon."""
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def test_ctrl_c_does_not_reach_workers_that_are_starting():
    """Even the first one begins with the signal blocked."""
    script = (
        "import signal, pickle\n"
        "from pwscont.studies.workers import SPAWN, _no_interrupts\n"
        "blocked = lambda: signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())\n"
        "with _no_interrupts():\n"
        "    process = SPAWN.Process(target=print, args=('started',))\n"
        "    process.start()\n"
        "    print(blocked())\n"
        "process.join()\n"
        "print(blocked())\n"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert sorted(run.stdout.split()) == ["False", "True", "started"]


@pytest.mark.slow
def test_ctrl_c_ends_all_processes_and_keeps_what_is_done(tmp_path):
    path = tmp_path / "study.db"
    script = (
        "from studycases import slow_study; import sys\n"
        "def told(done, total): print(done, flush=True)\n"
        f"result = slow_study(5000).run(2, store={str(path)!r}, report=told)\n"
        "sys.exit(3 if result.interrupted else 4)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        env=with_tests(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while process.stdout.readline().strip() != "5":
        pass
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (3, "")
    assert has_ended(process.pid)
    kept = StudyResult.open(path)
    assert 5 <= len(kept) < 5000
    kept.close()


@pytest.mark.parametrize(
    ("study", "words"),
    [
        (Study(one_node, {"friction": [1.0, 2.5]}, ["max-count"]), r"over: .* when it was begun"),
        (Study(one_node, {"friction": [1.0, 4.0]}, ["first-fold"]), r"measure: .*first-fold"),
        (Study(recorded, {"friction": [1.0, 4.0]}, ["max-count"]), r"problem: studycases.one_node"),
    ],
)
def test_the_store_of_another_study_is_refused(tmp_path, study, words):
    path = tmp_path / "study.db"
    Study(one_node, {"friction": [1.0, 4.0]}, ["max-count"]).run(store=path).close()
    with pytest.raises(InvalidInputError, match=words):
        study.run(store=path, resume=True)


def test_settings_in_another_order_number_other_cases(tmp_path):
    path, over = tmp_path / "study.db", {"friction": [1.0, 4.0], "f_nu": [0.25, 0.5]}
    Study(one_node, over, ["max-count"]).run(store=path).close()
    turned = Study(one_node, {name: over[name] for name in reversed(over)}, ["max-count"])
    with pytest.raises(InvalidInputError, match=r"over: .* when it was begun"):
        turned.run(store=path, resume=True)


def test_a_function_that_has_changed_is_noticed(tmp_path):
    path, count = tmp_path / "study.db", {"value": 3}

    def measure(graph):
        return count["value"]

    def interrupt(done, total):
        if done == 1:
            raise KeyboardInterrupt

    study = Study(known_graph, {"number": [0, 1]}, {"value": measure})
    study.run(store=path, report=interrupt).close()
    count["value"] = 4
    with pytest.raises(InvalidInputError, match="case 0 gives other numbers now"):
        study.run(store=path, resume=True)


def test_damage_and_use_by_two_are_refused(tmp_path):
    path = tmp_path / "study.db"
    result = Study(known_graph, {"number": range(50)}, ["max-count"]).run(store=path)
    with pytest.raises(InvalidInputError, match="another process is writing to it"):
        Store(path)
    result.close()
    data = path.read_bytes()
    place = data.index(b"complete")
    path.write_bytes(data[:place] + b"COMPLETE" + data[place + 8 :])
    damaged = StudyResult.open(path)
    with pytest.raises(InvalidInputError, match="it is damaged"):
        list(damaged)
    damaged.close()
    path.write_text("a file that is no store, and long enough for SQLite to see that" * 20)
    with pytest.raises(InvalidInputError, match="it is no store of a study"):
        StudyResult.open(path)
    with pytest.raises(InvalidInputError, match="there is no store"):
        StudyResult.open(tmp_path / "none.db")
    assert not (tmp_path / "none.db").exists()
    with pytest.raises(InvalidInputError, match="cannot be written"):
        Store(tmp_path / "no" / "where.db")


def test_graphs_are_kept_on_demand(tmp_path):
    result = Study(one_node, {"friction": [1.0, 4.0]}, ["max-count"]).run(graphs=tmp_path / "g")
    assert result.graph(friction=4.0).count(-0.7) == 3
    assert isinstance(result.graph(friction=1.0), BranchGraph)
    with pytest.raises(InvalidInputError, match="no finished case has the settings"):
        result.graph(friction=2.0)


# -- other programs ------------------------------------------------------------------------------


def test_the_table_is_written_and_read(tmp_path):
    result = Study(refused, {"friction": [-1.0, 1.0, 4.0]}, COUNTS).run()
    result.write_csv(tmp_path / "study.csv")
    with open(tmp_path / "study.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:5] == ["case", "friction", "most", "first", "where"]
    assert rows[0]["failure"] == "friction is negative"
    assert [row["most"] for row in rows] == ["", "1", "3"]
    assert json.loads(rows[2]["where"]) == [[pytest.approx(-1.0), pytest.approx(-0.5)]]
    assert list(tmp_path.iterdir()) == [tmp_path / "study.csv"]


def test_data_frames_have_a_row_for_each_case():
    pytest.importorskip("pandas")
    frame = Study(one_node, {"friction": [1.0, 4.0]}, ["max-count"]).run().to_dataframe()
    assert frame["max-count"].tolist() == [1, 3]
    assert frame["proven"].all()


def test_datasets_have_the_settings_as_coordinates(tmp_path):
    xarray = pytest.importorskip("xarray")
    over = {"friction": [1.0, 4.0], "f_nu": [0.25, 0.5, 0.75]}
    result = Study(one_node, over, COUNTS).run()
    data = result.to_xarray()
    assert dict(data.sizes) == {"friction": 2, "f_nu": 3}
    assert float(data["first"].sel(friction=4.0, f_nu=0.5)) == pytest.approx(-2.0)
    assert np.isnan(data["first"].sel(friction=1.0)).all()
    result.write_netcdf(tmp_path / "study.nc")
    with xarray.open_dataset(tmp_path / "study.nc", engine="scipy") as read:
        assert read["most"].values.tolist() == [[1, 1, 1], [3, 3, 3]]
        assert "numpy" in json.loads(read.attrs["versions"])


@pytest.mark.parametrize(
    ("package", "use"),
    [
        ("xarray", lambda study: study.run().to_xarray()),
        ("pandas", lambda study: study.run().to_dataframe()),
        ("distributed", lambda study: study.run(scheduler="tcp://127.0.0.1:1")),
    ],
)
def test_what_is_missing_is_said_in_one_line(monkeypatch, package, use):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=r"pip install .*'\.\[study\]' in a checkout of"):
        use(Study(known_graph, {"number": [1]}, ["max-count"]))


# -- pictures ------------------------------------------------------------------------------------

OVER = {"friction": [-1.0, 2.0, 4.0], "word": ["a", "b"], "further": [1, 2]}


def anything(friction, word="a", further=1):
    return refused(friction)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("name", ["most", "first"])
def test_pictures_over_one_two_and_three_settings(tmp_path, count, name):
    over = dict(list(OVER.items())[:count])
    result = Study(anything, over, COUNTS).run()
    figure = result.plot(name)
    figure.savefig(tmp_path / "study.png")
    assert (tmp_path / "study.png").stat().st_size > 5000
    words = {text.get_text() for text in figure.findobj(lambda part: hasattr(part, "get_text"))}
    assert "failed" in words
    assert any("friction" in word for word in words)


def test_what_cannot_be_drawn_is_said():
    result = Study(known_graph, {"number": [1, 2]}, {"where": NonUnique()}).run()
    with pytest.raises(InvalidInputError, match="where cannot be drawn: its values are no numbers"):
        result.plot()
    with pytest.raises(UnknownNameError, match="there is no column 'wher'"):
        result.plot("wher")
    result = Study(known_graph, {"number": [1]}, ["max-count"]).run()
    with pytest.raises(InvalidInputError, match="one to three settings that vary, not 0"):
        result.plot()


# -- wrong input ---------------------------------------------------------------------------------


def given(problem=one_node, over=None, measure=("max-count",), **run):
    return Study(problem, {"friction": [1.0]} if over is None else over, measure).run(**run)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"over": {"fricton": [1.0]}}, "no setting 'fricton'; it has friction, f_nu; did you mean"),
        ({"problem": "wedge", "over": {"nods": [2]}}, "scene wedge has no setting 'nods'"),
        (
            {"problem": "fig7", "over": {"nods": [2]}},
            "scene fig7 has no setting 'nods'; it has none",
        ),
        ({"problem": "wegde"}, "there is no scene 'wegde'; did you mean wedge"),
        ({"problem": 3}, "needs the name of a scene, or a function .* got 3"),
        ({"over": {}}, "over must map settings to their values"),
        ({"over": {"friction": []}}, "over 'friction' is empty"),
        ({"over": {"friction": [1.0, 1]}}, "over 'friction' has the value 1.0 twice"),
        ({"over": {"friction": "1.0"}}, "over 'friction' must be several values"),
        ({"over": {"friction": 1.0}}, "over 'friction' must be several values"),
        ({"over": {"friction": [np.nan]}}, "over 'friction': values are finite numbers"),
        ({"over": {"seconds": [1.0]}}, "the name 'seconds' is that of another column"),
        ({"measure": ()}, "a study needs something to measure: max-count, first-fold"),
        ({"measure": ("max-cuont",)}, "there is no measure 'max-cuont'; .* did you mean max-count"),
        ({"measure": ("max-count", "max-count")}, "'max-count' is asked for twice"),
        ({"measure": "max-count"}, "measure must be several names"),
        ({"measure": ("count-at=x",)}, "'count-at=x' is not of the form count-at=ALPHA"),
        ({"measure": ("critical=friction:1",)}, "not of the form critical=SETTING:LO:HI"),
        ({"measure": ("critical=f_nu:2:1",)}, "lo must be less than hi"),
        ({"measure": ("critical=friction:1:2",)}, "'friction' is varied by the study and by a"),
        ({"measure": ("critical=mu:1:2",)}, "no setting 'mu'"),
        ({"measure": ("first-fold=1",)}, "first-fold takes no value"),
        ({"measure": {"friction": MaxCount()}}, "'friction' is both a setting and a measure"),
        ({"measure": {"most": MaxCount}}, "measure 'most' must be a Measure"),
        ({"workers": 0}, "workers must be a positive whole number, got 0"),
        ({"workers": 2, "scheduler": "tcp://x:1"}, "give them or a scheduler"),
    ],
)
def test_wrong_input_is_refused_in_words(wrong, words):
    with pytest.raises(PwscontError, match=words):
        given(**wrong)


def test_scenes_that_are_not_there_are_an_error_of_their_own():
    with pytest.raises(SceneNotFoundError):
        given(problem="wegde")


def test_what_cannot_be_sent_to_other_processes_is_refused():
    with pytest.raises(InvalidInputError, match=r"cannot be sent to other processes: .*no lambdas"):
        given(measure={"pieces": lambda graph: 1}, over={"friction": [1.0, 2.0]}, workers=2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("from studycases import slow_study\nslow_study().run(workers=2)\n", "if __name__ =="),
        (
            "def own(n): pass\nStudy(own, {'n': [1, 2]}, ['max-count']).run(workers=2)",
            "cannot load",
        ),
    ],
)
def test_workers_that_cannot_begin_are_explained(tmp_path, script, words):
    start = "from pwscont import Study\n"
    (tmp_path / "script.py").write_text(start + script)
    source = ["-c", start + script] if "own" in script else [str(tmp_path / "script.py")]
    done = subprocess.run(
        [sys.executable, *source],
        check=False,
        env=with_tests(),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 1
    assert words in done.stderr.splitlines()[-1]


def test_problems_that_return_something_else_fail_in_words():
    (row,) = given(problem=lambda friction: 3)
    assert row.failure.startswith("the function of a study must return a Scene, a system with its")
    (row,) = given(problem=lambda friction: one_node()[0])
    assert "got AffineCoulombLoad" in row.failure


# -- a cluster -----------------------------------------------------------------------------------

DASK = pytest.mark.skipif(not find_spec("distributed"), reason="Dask is not installed")


@DASK
@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_cluster_of_two_gives_the_same_rows_though_a_worker_is_killed():
    from distributed import LocalCluster  # noqa: PLC0415  optional

    study = slow_study()
    killed = []

    def kill(done, total):
        if done == 20 and not killed:
            worker = next(iter(cluster.workers.values()))
            killed.append(worker.pid)
            os.kill(worker.pid, signal.SIGKILL)

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        result = study.run(scheduler=cluster.scheduler_address, report=kill)
    assert killed
    assert numbers(result) == numbers(study.run())


@DASK
@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_no_scheduler_is_said_in_words(monkeypatch):
    monkeypatch.setattr("pwscont.studies.cluster.PATIENCE", 1.0)
    with pytest.raises(
        InvalidInputError, match=r"no Dask scheduler answers at 'tcp://127.0.0.1:9'"
    ):
        given(scheduler="tcp://127.0.0.1:9")


def test_another_service_is_no_scheduler(monkeypatch):
    def client(*_, **__):
        raise MemoryError("what an answer that is no frame of Dask's makes of its first bytes")

    distributed = SimpleNamespace(Client=client)
    monkeypatch.setattr("pwscont.studies.cluster.import_module", lambda _: distributed)
    with pytest.raises(InvalidInputError, match=r"no Dask scheduler answers at 'tcp://x:80'"):
        given(scheduler="tcp://x:80")


# -- what is not there, or no number ---------------------------------------------------------------


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_parabola_turns_at_zero_and_not_beside_it(unit):
    over, measure = {"unit": [unit]}, ["first-fold", "non-unique", "max-count"]
    (row,) = Study(parabola, over, measure).run()
    assert row.values == {"first-fold": 0.0, "non-unique": ((0.0, unit),), "max-count": 2}


def test_an_unknown_quantity_is_said_where_there_are_no_solutions_too():
    measure = {"wrong": QuantityAt("u", -0.5), "right": QuantityAt("z[0]", -0.5)}
    (row,) = Study(parabola, {"unit": [1.0]}, measure).run()
    assert row.values == {"wrong": None, "right": None}
    assert row.failure == "wrong: there is no 'u'; names are z[0]"


@pytest.mark.parametrize("measure", [CountAt, partial(QuantityAt, "z[0]")])
@pytest.mark.parametrize("alpha", [float("nan"), inf, "x", None])
def test_alpha_of_a_measure_is_a_finite_number(measure, alpha):
    with pytest.raises(InvalidInputError, match="alpha must be a finite number"):
        measure(alpha)


def test_what_is_no_measure_is_refused():
    with pytest.raises(InvalidInputError, match="measure must be several names, got None"):
        Study(one_node, {"friction": [1.0]}, None)


def test_files_in_the_way_are_said(tmp_path):
    (tmp_path / "graphs").touch()
    (tmp_path / "study.csv").mkdir()
    study = Study(known_graph, {"number": [0]}, ["max-count"])
    with pytest.raises(InvalidInputError, match=r"cannot make the directory .*graphs: File exists"):
        study.run(graphs=tmp_path / "graphs")
    with pytest.raises(InvalidInputError, match=r"cannot write .*study.csv: "):
        study.run().write_csv(tmp_path / "study.csv")
    assert {file.name for file in tmp_path.iterdir()} == {"graphs", "study.csv"}


def test_texts_that_no_encoding_has_are_kept(tmp_path):
    study = Study(known_graph, {"number": ["\udcff.cir"]}, {"name": lambda graph: "\ud800"})
    result = study.run(store=tmp_path / "study.db")
    result.write_csv(tmp_path / "study.csv")
    (row,) = result
    result.close()
    assert (row.settings, row.values) == ({"number": "\udcff.cir"}, {"name": "\ud800"})
    assert "\\udcff.cir" in (tmp_path / "study.csv").read_text(encoding="utf-8")
