"""Studies: other programs, pictures, wrong input, a cluster."""

import csv
import json
import os
import signal
import subprocess
import sys
from functools import partial
from importlib.util import find_spec
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from study_parts import COUNTS, numbers, with_tests
from studycases import (
    known_graph,
    one_node,
    parabola,
    refused,
    slow_study,
)

from pwscont import (
    CountAt,
    InvalidInputError,
    MaxCount,
    MissingPackageError,
    NonUnique,
    PwscontError,
    QuantityAt,
    SceneNotFoundError,
    Study,
    UnknownNameError,
)

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


@pytest.mark.slow
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
@pytest.mark.sweep(3)
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
        ({"problem": lambda friction, f_nu: None}, "needs the setting 'f_nu': vary it, or give it"),
        ({"resume": True}, "resume needs a store"),
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
@pytest.mark.sweep(3)
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


def test_an_alpha_beyond_all_floats_lies_outside():
    measures = {"far": CountAt(10**400), "most": MaxCount()}
    (row,) = Study(parabola, {"unit": [1.0]}, measures).run()
    assert row.values["most"] > 0
    assert "lies outside the interval" in row.failure


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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_table_does_not_replace_a_device(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    result = Study(known_graph, {"number": [0]}, ["max-count"]).run()
    with pytest.raises(InvalidInputError, match="it is a device, not a file"):
        result.write_csv(tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()


def test_texts_that_no_encoding_has_are_kept(tmp_path):
    study = Study(known_graph, {"number": ["\udcff.cir"]}, {"name": lambda graph: "\ud800"})
    result = study.run(store=tmp_path / "study.db")
    result.write_csv(tmp_path / "study.csv")
    (row,) = result
    result.close()
    assert (row.settings, row.values) == ({"number": "\udcff.cir"}, {"name": "\ud800"})
    assert "\\udcff.cir" in (tmp_path / "study.csv").read_text(encoding="utf-8")
