"""How the command line ends: full disks, closed streams, interruptions, broken plug-ins."""

import importlib
import os
import random
import resource
import signal
import subprocess
import sys
import time
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from sweeps import swept

from pwscont import BranchGraph, PiecewiseLinearSystem, trace
from pwscont.commands.cli import main
from pwscont.commands.options import spread
from pwscont.linear.threads import THREADS
from pwscont.scenes import registry
from pwscont.scenes.registry import BrokenSceneError, load_scene

pytestmark = pytest.mark.slow  # the others take too long for the README's command


FULL = Path("/dev/full")
posix = pytest.mark.skipif(os.name != "posix", reason="signals, limits and devices of POSIX")


def command(*arguments, **how):
    """Run ``python -m pwscont`` in a process of its own."""
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | how
    return subprocess.run([sys.executable, "-m", "pwscont", *arguments], check=False, **how)


def shell(line, *words):
    """Run a line of the shell, in which $PWSCONT is the command."""
    line = line.replace("$PWSCONT", f"'{sys.executable}' -m pwscont")
    return subprocess.run(
        ["bash", "-c", line, "bash", *map(str, words)], capture_output=True, text=True, check=False
    )


def one_line(err):
    assert err.startswith("pwscont: ")
    assert err.count("\n") == 1
    return err


# -- the order of arguments ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "read"),
    [
        ("run --at 1 2 fig7", "run --at 1 --at 2 fig7"),
        ("run fig7 --at 1 2 --json", "run fig7 --at 1 --at 2 --json"),
        ("run -s nodes=5 friction=1 block", "run -s nodes=5 -s friction=1 block"),
        ("run --set nodes=5 --at 0 -s f=1 block", "run --set nodes=5 --at 0 -s f=1 block"),
        ("run --at x", "run --at x"),
        ("run 5", "run 5"),
        ("run -s --json", "run -s --json"),
    ],
)
def test_options_with_several_values(given, read):
    assert list(spread(given.split())) == read.split()


def test_negative_values_are_no_options():
    assert list(spread(["--at", "-1", "-1e-3", "fig7"])) == [
        "--at",
        " -1",
        "--at",
        " -1e-3",
        "fig7",
    ]


def test_options_before_the_scene(capsys):
    assert main(["run", "--at", "0.7", "-0.75", "fig7"]) == 0
    out = capsys.readouterr().out
    assert "1 solution at alpha = 0.7\n" in out
    assert "3 solutions at alpha = -0.75" in out
    assert main(["run", "-s", "nodes=5", "friction=0.2", "block"]) == 0
    before = capsys.readouterr().out
    assert main(["run", "block", "-s", "friction=0.2", "-s", "nodes=5"]) == 0
    assert capsys.readouterr().out == before


# -- disks and streams -----------------------------------------------------------------------------


def limited_to(size):
    """Return what makes writes of a child beyond a size fail, as a full disk does."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.mark.slow
@posix
@pytest.mark.parametrize("size", swept([700], [0]))
def test_a_full_disk(tmp_path, size, capsys):
    """The answer is printed, one line says why there is no file, and the next run is as ever."""
    done = command("run", "fig7", "-o", str(tmp_path), preexec_fn=limited_to(size))
    main(["run", "fig7"])
    assert done.stdout == capsys.readouterr().out
    assert f"cannot write to {tmp_path}: " in one_line(done.stderr)
    assert done.returncode == 2
    assert not [file for file in tmp_path.iterdir() if file.suffix != ".journal"]
    assert main(["run", "fig7", "-o", str(tmp_path)]) == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["fig7.npz", "fig7.png"]


@posix
def test_files_that_could_not_be_written_need_no_second_run(tmp_path, monkeypatch):
    """A journal that is whole stays: --resume computes nothing."""
    (tmp_path / "fig7.npz").mkdir()
    assert main(["run", "fig7", "-o", str(tmp_path)]) == 2
    (tmp_path / "fig7.npz").rmdir()
    monkeypatch.setattr(
        "pwscont.continuation.follow.PieceFollower.follow", lambda *_: pytest.fail("again")
    )
    assert main(["run", "fig7", "-o", str(tmp_path), "--resume"]) == 0
    assert len(BranchGraph.load(tmp_path / "fig7.npz").pieces) == 4


@posix
@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full")
def test_standard_output_on_a_full_disk(tmp_path):
    with FULL.open("w") as full:
        done = command("run", "fig7", "-o", str(tmp_path), stdout=full)
    written, line = done.stderr.splitlines()
    assert written.startswith("written: ")  # the files are not lost
    assert line == "pwscont: No space left on device"
    assert done.returncode == 2
    assert sorted(file.name for file in tmp_path.iterdir()) == ["fig7.npz", "fig7.png"]


@posix
def test_closed_streams():
    done = shell("$PWSCONT run fig7 >&-")
    assert "standard output is closed" in one_line(done.stderr)
    assert done.returncode == 2
    assert shell("$PWSCONT run fig77 2>&-").returncode == 2
    done = shell("$PWSCONT run fig7 | head -1; exit ${PIPESTATUS[0]}")
    assert (done.stdout.count("\n"), done.stderr, done.returncode) == (1, "", 0)


@pytest.mark.parametrize(
    "setting",
    ["nodes=99999999", "nodes=-5", "nodes=1e3", "friction=nan", "friction=1e400", "friction=-1"],
)
def test_absurd_settings(setting, capsys):
    """They are refused before any work."""
    assert main(["run", "block", "-s", setting]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    one_line(printed.err)


def test_too_little_memory(capsys, monkeypatch):
    def solve(*_):
        raise MemoryError("Unable to allocate 7 PiB")

    monkeypatch.setattr("pwscont.Scene.solve", solve)
    assert main(["run", "fig7"]) == 2
    assert "not enough memory; try smaller settings" in one_line(capsys.readouterr().err)


def is_loading(child):
    """Tell whether a run has begun to load numpy; until then Python itself was starting."""
    return "numpy" in Path(f"/proc/{child.pid}/maps").read_text(encoding="utf-8")


def check_interruption(seconds):
    """Interrupt a run so soon after it began to load."""
    run = [sys.executable, "-m", "pwscont", "run", "block", "-s", "nodes=60"]
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        while not is_loading(child):
            time.sleep(0.01)
        time.sleep(seconds)
        child.send_signal(signal.SIGINT)
        out, err = child.communicate()
    assert child.returncode in (130, -signal.SIGINT, 0)
    assert "Traceback" not in out + err


linux = pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no /proc")


@linux
@pytest.mark.parametrize("seconds", [0.0, 0.3, 0.8])
@pytest.mark.sweep(2)
def test_interruption_within_the_first_second(seconds):
    check_interruption(seconds)


@linux
@pytest.mark.slow
def test_interruption_at_any_time_of_the_first_seconds():
    moments = random.Random(8)
    for _ in range(40):
        check_interruption(moments.uniform(0.0, 2.0))


class Interrupts:
    """An attribute that is interrupted while the class of the attribute is being made."""

    def __set_name__(self, owner, name):
        raise KeyboardInterrupt


def test_interruption_while_a_class_is_made_is_an_interruption(monkeypatch, capsys):
    """Python 3.11 raises a RuntimeError there, caused by the interruption."""

    def make(options):
        type("Made", (), {"attribute": Interrupts()})

    monkeypatch.setattr("pwscont.commands.cli.run_scene", make)
    assert main(["run", "fig7"]) == 130
    assert "interrupted" in capsys.readouterr().err


# -- plug-ins --------------------------------------------------------------------------------------

BROKEN = """
raise_on_import = {}
def nonsense(): return 7
def titleless():
    from pwscont.scenes.answer import Runnable
    class Bare(Runnable):
        name = "bare"
        def values(self, wanted): return ()
        def solve(self, at, report): return None
    return Bare()
def fails(): raise KeyError("no such mesh\\nat all")
def untyped(nodes: "Undefined" = 3): return None
number = 5
"""

OFFERED = {
    "dies": "broken_dies:scene",
    "leaves": "broken_leaves:scene",
    "missing": "no_such_package:scene",
    "nothing": "broken_scenes:nowhere",
    "nonsense": "broken_scenes:nonsense",
    "titleless": "broken_scenes:titleless",
    "fails": "broken_scenes:fails",
    "untyped": "broken_scenes:untyped",
    "number": "broken_scenes:number",
}


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """Install packages whose scenes cannot be made, and a second one that offers fig7."""
    (tmp_path / "broken_scenes.py").write_text(BROKEN)
    (tmp_path / "broken_dies.py").write_text("import numpy\nnumpy.nowhere\n")
    (tmp_path / "broken_leaves.py").write_text("raise SystemExit('bye')\n")
    for name, points in (("Broken", OFFERED), ("Rival", {"fig7": "broken_scenes:nonsense"})):
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = "".join(f"{scene} = {value}\n" for scene, value in points.items())
        (info / "entry_points.txt").write_text(f"[pwscont.scenes]\n{lines}")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()


@pytest.mark.usefixtures("broken")
@pytest.mark.parametrize("name", OFFERED)
def test_a_broken_scene_is_named_with_its_package(name, capsys):
    assert main(["run", name]) == 2
    err = one_line(capsys.readouterr().err)
    assert err.startswith(f"pwscont: scene {name} of package Broken cannot be made: ")


@pytest.mark.usefixtures("broken")
def test_broken_plug_ins_disturb_no_others(capsys):
    assert main(["scenes"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    for name in OFFERED:
        assert "(scene " in lines[name]
    assert lines["fig10"].endswith(load_scene("fig10").title)
    assert main(["run", "fig10"]) == 0


@pytest.mark.usefixtures("broken")
def test_two_scenes_of_one_name_are_refused_by_naming_both(capsys):
    assert main(["run", "fig7"]) == 2
    err = one_line(capsys.readouterr().err)
    assert "scene fig7 is offered by package Rival and package pwscont; uninstall one" in err
    with pytest.raises(BrokenSceneError, match="Rival"):
        load_scene("fig7")
    assert main(["scenes"]) == 0
    assert capsys.readouterr().out.count("\n  fig7 ") == 1


def test_a_package_without_a_name(monkeypatch):
    """Entry points that are not of an installed package are named by what they refer to."""
    points = EntryPoints(EntryPoint("x", f"some.{part}:x", registry.GROUP) for part in "ab")
    monkeypatch.setattr(registry, "entry_points", points.select)
    with pytest.raises(BrokenSceneError, match=r"offered by some\.a:x and some\.b:x"):
        load_scene("x")


# -- threads  --------------------------------------------------------------------------------

SHOW = """
import os, sys
from pwscont.__main__ import main
from pwscont.linear.threads import THREADS
assert "numpy" not in sys.modules
import pwscont.commands
sys.argv = ["pwscont", "--version"]
try:
    main()
except SystemExit:
    pass
assert "numpy" in sys.modules
print({name: os.environ.get(name) for name in THREADS})
"""


@pytest.mark.parametrize("chosen", [{}, {"OPENBLAS_NUM_THREADS": "3"}, {"OMP_NUM_THREADS": "2"}])
@pytest.mark.sweep(2)
def test_the_command_line_limits_threads_before_numpy_is_loaded(chosen):
    """Whoever sets one decides: OpenBLAS heeds its own variable before OMP_NUM_THREADS."""
    environment = {key: value for key, value in os.environ.items() if key not in THREADS} | chosen
    done = subprocess.run(
        [sys.executable, "-c", SHOW], env=environment, capture_output=True, text=True, check=True
    )
    limited = dict.fromkeys(THREADS, None) | chosen if chosen else dict.fromkeys(THREADS, "1")
    assert done.stdout.splitlines()[-1] == str(limited)


@pytest.fixture
def seen(monkeypatch):
    """Return the numbers of threads that BLAS has while a path is followed."""
    threadpoolctl = pytest.importorskip("threadpoolctl")
    numbers = []

    def report(*_):
        numbers.extend(info["num_threads"] for info in blas(threadpoolctl))

    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        if not all(info["num_threads"] == 2 for info in blas(threadpoolctl)):
            pytest.skip("BLAS without threads")
        yield SimpleNamespace(numbers=numbers, report=report)
        assert all(info["num_threads"] == 2 for info in blas(threadpoolctl))  # as it was before


def blas(threadpoolctl):
    return [info for info in threadpoolctl.threadpool_info() if info["user_api"] == "blas"]


class Chain(PiecewiseLinearSystem):
    """Diodes side by side, of which each is on above zero."""

    def __init__(self, size):
        self.size = size
        self.one, self.column = sp.eye_array(size, format="csr"), sp.csr_array(np.ones((size, 1)))

    def test_functions(self, z, alpha):
        return z - np.arange(self.size)

    def test_jacobian(self, z, alpha):
        return sp.hstack([self.one, 0.0 * self.column], format="csr")

    def residual(self, z, alpha, character):
        return z - alpha

    def jacobian(self, z, alpha, character):
        return sp.hstack([self.one, -self.column], format="csr")


@pytest.mark.parametrize(("size", "threads"), [(8, 2), (100, 1), (3000, 1), (7000, 2)])
def test_straight_pieces_of_thousands_of_unknowns_have_one_thread(seen, size, threads):
    """A step is a product, which waits for memory: threads only wait for each other.

    Of a few unknowns nothing is shared, whatever the number of threads: it is left alone.
    """
    start = np.full(size, -1.0), -1.0
    trace(Chain(size), start, (-1.0, -0.5), report=seen.report)
    assert set(seen.numbers) == {threads}


def test_a_variable_of_the_user_wins(seen, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    trace(Chain(100), (np.full(100, -1.0), -1.0), (-1.0, -0.5), report=seen.report)
    assert set(seen.numbers) == {2}
