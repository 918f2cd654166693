"""The command line: progress, a process of its own, and the seam."""

import io
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from cli_parts import CONTACT, CURVES, OTHERS, run, run_json
from sweeps import swept
from terminals import Clock, Terminal

from pwscont import BranchGraph, PiecewiseSystem, Scene
from pwscont.commands import run as running
from pwscont.commands.progress import EVERY, FIRST, Progress
from pwscont.scenes.answer import Answer, Runnable
from pwscont.scenes.registry import load_scene
from pwscont.scenes.table import report

# -- progress ------------------------------------------------------------------------------------


@pytest.mark.parametrize("stream", [io.StringIO(), None])
def test_progress_is_shown_on_terminals_only(monkeypatch, stream):
    if stream is None:
        monkeypatch.setattr(sys, "stderr", None)
    clock = Clock()
    progress = Progress("F", stream, clock)
    clock.now += 10.0 * FIRST
    progress(3, 0.25)
    progress.close()
    assert stream is None or stream.getvalue() == ""


def test_progress_is_silent_for_a_second():
    clock, stream = Clock(), Terminal()
    progress = Progress("F", stream, clock)
    for clock.now in (100.0, 100.5, 100.0 + FIRST - 1e-3):
        progress(1, 0.0)
    progress.close()
    assert stream.getvalue() == ""


def test_progress_after_a_second_is_one_line():
    clock, stream = Clock(), Terminal()
    progress = Progress("F", stream, clock)
    clock.now += FIRST
    progress(3, 0.25)
    progress(4, 0.5)  # too soon after the last
    clock.now += EVERY
    progress(5, 1.0 / 3.0)
    progress.close()
    first, second = stream.getvalue().rstrip("\n").split("\r")[1:]
    assert first.rstrip() == "3 pieces, F = 0.25, 3 pieces/s"  # three in the first second
    assert second.rstrip() == "5 pieces, F = 0.333333, 4.17 pieces/s"  # 5 / 1.2


def test_the_rate_is_that_of_the_last_seconds():
    clock, stream = Clock(), Terminal()
    progress = Progress("F", stream, clock)
    for clock.now, pieces in [(101.0, 100), (102.0, 200), (107.0, 205), (112.0, 210)]:
        progress(pieces, 0.0)
    assert stream.getvalue().rstrip().endswith(", 1 pieces/s")  # 10 since 102


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig7", "example1-critical-friction"])
def test_progress_goes_to_standard_error(capsys, monkeypatch, name):
    clock = Clock()

    def late(parameter):
        progress = Progress(parameter, clock=clock)
        clock.now += 10.0
        return progress

    monkeypatch.setattr(running, "Progress", late)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    status, out, err = run(capsys, "run", name, "--json")
    assert status == 0
    assert json.loads(out)["scene"] == name
    assert "\r1 piece, " in err


# -- a process of its own ------------------------------------------------------------------------


def fresh(*arguments, code=None):
    """Run Python in a fresh process."""
    command = ["-c", code] if code else ["-m", "pwscont"]
    return subprocess.run(
        [sys.executable, *command, *arguments], capture_output=True, text=True, check=False
    )


def test_python_m_pwscont():
    done = fresh("run", "fig7", "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["components"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [("run", "fig77"), ()])
def test_python_m_pwscont_ends_with_the_status_of_the_command(arguments):
    assert fresh(*arguments).returncode == 2


@pytest.mark.slow
def test_a_reader_that_stops_early_is_no_error():
    command = [sys.executable, "-m", "pwscont", "run", "fig7"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


LOADED = """
import sys
from importlib import import_module
from importlib.metadata import entry_points
from pwscont.commands.cli import main
for arguments in (sys.argv[1:3], sys.argv[1:]):
    status = main(arguments)
    print(status, "matplotlib" in sys.modules, file=sys.stderr)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", swept(["fig7"], ["fig5"]))
def test_pictures_are_imported_only_where_asked_for(tmp_path, name):
    done = fresh("run", name, "-o", str(tmp_path), code=LOADED)
    assert done.returncode == 0
    # matplotlib may say that its cache of fonts is made
    told = [line for line in done.stderr.splitlines() if line.startswith("0 ")]
    assert told == ["0 False", "0 True"]


# -- the seam ------------------------------------------------------------------------------------


def test_scenes_of_others_plug_in(capsys, monkeypatch):
    """Whatever implements the seam runs: here a scene without any system."""

    class Counted(Answer):
        def as_text(self):
            return "one, two"

        def as_dict(self):
            return {"scene": "count", "count": 2}

        def write(self, directory):
            (directory / "count.txt").write_text("2")
            return [directory / "count.txt"]

    class Count(Runnable):
        name, title, parameter = "count", "counts to two", "i"

        def values(self, wanted):
            return ()

        def solve(self, at, report):
            report(2, math.pi)
            return Counted()

    monkeypatch.setattr(running, "load_scene", lambda name, settings: Count())
    assert run(capsys, "run", "count")[:2] == (0, "one, two\n")
    assert run_json(capsys, "count")["count"] == 2


def test_scene_runs_to_a_branch_graph():
    scene = load_scene("fig7")
    assert isinstance(scene.run(), BranchGraph)
    assert scene.values(None) == scene.at
    assert scene.values([0.5]) == (0.5,)


@pytest.mark.parametrize(
    "name", swept([n for n in CURVES if n in CONTACT], [n for n in CURVES if n in OTHERS])
)
@pytest.mark.sweep(3)
def test_answers_are_those_of_the_graph(name):
    scene = load_scene(name)
    data = scene.solve(scene.at, lambda *_: None).as_dict()
    assert len(data["solutions"]) == sum(len(scene.run().solutions(alpha)) for alpha in scene.at)


class StressAndDisplacement(PiecewiseSystem):
    """A stress in pascals beside a displacement in metres, and one that is zero."""

    size = 3

    def names(self):
        return ["stress", "u", "zero"]

    def scale(self, lo, hi):
        return np.array([1e9, 1e-4, 1e-4])

    def test_functions(self, z, alpha):
        return z[:1] + 1e12

    def residual(self, z, alpha, character):
        third = (z[2] + z[1]) / 1e-4 - 0.5 * alpha
        return np.array([z[0] / 1e9 - alpha, z[1] / 1e-4 - 0.5 * alpha, third])


def test_unknowns_in_small_units_are_not_zero_beside_those_in_large_ones():
    scene = Scene("units", "units", StressAndDisplacement(), (-1.0, 1.0))
    assert "stress = 7e+08, u = 3.5e-05, zero = 0\n" in report(scene, scene.run(), [0.7]) + "\n"
