"""Studies: against closed forms, the same rows whatever runs them, and nothing lost on the way."""

import os
import random
import signal
import subprocess
import sys
import time
from functools import partial
from math import inf, nan

import numpy as np
import pytest
import studycases
from study_parts import COUNTS, numbers, with_tests
from studycases import (
    GRAPH,
    ends_always,
    ends_once,
    exits,
    known_graph,
    number_of_pieces,
    one_node,
    recorded,
    refused,
    slow_study,
)

from pwscont import (
    BranchGraph,
    CountAt,
    CriticalValue,
    InvalidInputError,
    MaxCount,
    NonUniqueLength,
    PiecewiseSystem,
    QuantityAt,
    Study,
    StudyResult,
)
from pwscont.studies.store import Store

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


FRICTIONS = (0.5, 1.5, 2.5, 4.0)


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


@pytest.mark.slow
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
        (
            Study(one_node, {"friction": [1.0, 4.0]}, ["first-fold"]),
            r"measure: .*first-fold[^;]*; remove it",
        ),
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


def cubic(factor, further=0.0):
    """Return a function with the same name for each factor."""

    class Cubic(PiecewiseSystem):
        size = 1

        def test_functions(self, z, alpha):
            return np.zeros(0)

        def residual(self, z, alpha, character):
            return z**3 - factor * z - alpha

    def case(k):
        return Cubic(), (-k, k + further)

    return case


def counted_with(number):
    return lambda graph: graph.count(0.0) + number


greatest = partial(QuantityAt, "z[0]", 0.1)
TWO = [
    (cubic(1.0), cubic(-1.0), MaxCount(), MaxCount()),
    (cubic(1.0), cubic(1.0, further=1.0), MaxCount(), MaxCount()),
    (cubic(1.0), cubic(1.0), counted_with(0), counted_with(1)),
    (cubic(1.0), cubic(1.0), greatest(lambda v: max(v) + 1), greatest(lambda v: max(v) + 2)),
    (cubic(1.0), cubic(1.0), counted_with(np.array([1.0])), counted_with(np.array([2.0]))),
]


@pytest.mark.slow
@pytest.mark.parametrize(("problem", "other", "measure", "another"), TWO)
@pytest.mark.sweep(6)
def test_another_function_of_the_same_name_is_refused(tmp_path, problem, other, measure, another):
    """The study is finished, and no case is run again."""
    path, over = tmp_path / "study.db", {"k": [1.0, 2.0]}
    Study(problem, over, {"asked": measure}).run(store=path).close()
    Study(problem, over, {"asked": measure}).run(store=path, resume=True).close()
    with pytest.raises(InvalidInputError, match="is of another study: its functions have changed"):
        Study(other, over, {"asked": another}).run(store=path, resume=True)


TOLD = """
import sys
sys.path[:0] = {paths}
import numpy as np
from pwscont import CountAt, QuantityAt
from pwscont.studies.case import digest

LIMIT, WORDS = 3.0, ("a", "b")

def helper(x, y=2, *, z=frozenset("abc")):
    return [LIMIT * v for v in (x, y)] if x in {{"p", "q", "r"}} else helper(y)

class Law:
    stiffness = 4.0
    names = property(lambda self: WORDS)
    @staticmethod
    def force(z):
        return helper(z) + {factor}

def case(k):
    return Law(), lambda graph: np.sin(Law.force(k))

print(digest([case, QuantityAt("u", 1.0, max), CountAt(1.0), helper]))
"""


def told_by_a_process(seed, factor):
    code = TOLD.format(paths=sys.path, factor=factor)
    surroundings = {**os.environ, "PYTHONHASHSEED": str(seed)}
    run = [sys.executable, "-c", code]
    return subprocess.run(run, env=surroundings, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_functions_are_told_alike_by_all_processes():
    assert told_by_a_process(1, 5.0) == told_by_a_process(2, 5.0) != told_by_a_process(1, 5.5)


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
