"""Elimination by MUMPS: the same matrices on one rank and on two, failures in words.

What needs MUMPS runs in processes of its own (``mumps_cases``), so that none of the tests' own
processes becomes one of MPI.
"""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from pwscont_coulomb.elastic import Mumps, ranks
from pwscont_coulomb.elastic.mumps import MumpsFactor
from pwscont_coulomb.elastic.ranks import BEGIN, END, SOLVE, Ranks
from pwscont_coulomb.elastic.scenes import block_body
from scipy import sparse

from pwscont import MissingPackageError
from pwscont.basics.errors import InvalidInputError

CASES = str(Path(__file__).parent / "helpers" / "mumps_cases.py")
INSTALLED = pytest.mark.skipif(not find_spec("mumps"), reason="pymumps is not installed")
MPIEXEC = pytest.mark.skipif(not shutil.which("mpiexec"), reason="there is no mpiexec")
TWO = ["mpiexec", "-n", "2", sys.executable]


def run(command):
    """Run a command that may be of two ranks, whatever the number of cores and the user."""
    allowed = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",  # the cores may be busy with other tests
        "OPENBLAS_NUM_THREADS": "1",
    }
    env = os.environ | allowed
    return subprocess.run(
        command, env=env, capture_output=True, text=True, timeout=300, check=False
    )


def check(launcher, count, *arguments):
    done = run([*launcher, CASES, *arguments])
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(f"all holds on {count} rank(s)\n")


@INSTALLED
@MPIEXEC
def test_matrices_on_two_ranks():
    check([*TWO, "-m", "pwscont_coulomb.mpi"], 2, "quick")


@INSTALLED
@pytest.mark.slow
def test_everything_in_one_process():
    check([sys.executable], 1)


@INSTALLED
@MPIEXEC
@pytest.mark.slow
def test_everything_on_two_ranks():
    check([*TWO, "-m", "pwscont_coulomb.mpi"], 2)


SCRIPT = """
from pwscont_coulomb.elastic import Mumps
from pwscont_coulomb.elastic.scenes import block_body
block_body(3).condensed(Mumps())
raise SystemExit("a fault of the script")
"""


@INSTALLED
@MPIEXEC
@pytest.mark.slow
@pytest.mark.parametrize(
    ("runner", "words"),
    [
        ([], "mpiexec -n 2 python -m pwscont_coulomb.mpi SCRIPT"),
        (["-m", "pwscont_coulomb.mpi"], "a fault of the script"),
    ],
)
def test_scripts_on_two_ranks_end_in_words(tmp_path, runner, words):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = run([*TWO, *runner, str(script)])
    assert done.returncode
    assert words in done.stderr


def test_a_missing_library_is_said_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "mpi4py.MPI", None)
    with pytest.raises(MissingPackageError, match=r"libmumps-dev .* pip install '\.\[mumps\]'"):
        block_body(3).condensed(Mumps())


def test_another_package_of_that_name_is_told_apart(monkeypatch):
    monkeypatch.setitem(sys.modules, "mumps", sys)
    with pytest.raises(MissingPackageError, match="is another one"):
        Ranks(OneRank()).begin()


# -- failures, by a solver that reports them -----------------------------------------------------


class OneRank:
    size = 1


class Reporting:
    """A solver that notes its jobs and reports the values of INFOG(1) that a test gives."""

    def __init__(self, reports, relaxed):
        self.id, self.reports, self.relaxed, self.code = type("Id", (), {})(), reports, relaxed, 0

    def run(self, job):
        self.code = self.reports.pop(0) if self.reports else 0
        if self.code < 0:
            raise RuntimeError(self.code)

    def set_icntl(self, control, value):
        if control == 14:
            self.relaxed.append(value)

    def get_infog(self, position):
        return {1: self.code, 9: -3, 16: 7, 17: 12}.get(position, 0)

    def set_shape(self, n):
        self.n = n

    def cast_array(self, array):
        return 0

    def destroy(self):
        self.relaxed.append("destroyed")


@pytest.fixture
def factor_of(monkeypatch):
    def made(*reports, relaxed):
        here = Ranks(OneRank())
        monkeypatch.setattr(ranks, "_pymumps", lambda: None)
        monkeypatch.setattr(ranks, "_solver", lambda comm: Reporting(list(reports), relaxed))
        monkeypatch.setattr("pwscont_coulomb.elastic.mumps.ranks", lambda: here)
        kept, interior = np.array([0]), np.array([1, 2])
        return MumpsFactor(sparse.eye(3, format="coo"), kept, interior, np.array([1, 2, 0]))

    return made


def test_workspace_is_enlarged(factor_of):
    relaxed = []
    factor = factor_of(0, -9, -9, 0, relaxed=relaxed)
    assert relaxed == [20, 20, 50, 100]  # of the analysis, then of the factorisation
    assert factor.entries == 3_000_000
    del factor
    assert relaxed[-1] == "destroyed"


@pytest.mark.parametrize(
    ("report", "words"),
    [
        (
            -13,
            "does not fit into the memory of 1 rank: MUMPS expected 7 MB on one of them and 12 MB",
        ),
        (-10, "not positive definite"),
        (-99, r"failed with INFOG\(1\) = -99"),
    ],
)
def test_failures_are_said_in_words(factor_of, report, words):
    with pytest.raises(InvalidInputError, match=words):
        factor_of(0, report, relaxed=[])


def test_solvers_are_freed_after_the_job_within_which_they_are_released(monkeypatch):
    """All ranks would wait for each other if a job began within another."""
    done = []

    def perform(solvers, comm, number, job):
        solvers[number] = None
        if job == SOLVE:
            here.release(0)
        done.append((number, job))

    monkeypatch.setattr(ranks, "_perform", perform)
    monkeypatch.setattr(ranks, "_pymumps", lambda: None)
    here = Ranks(OneRank())
    first, second = here.begin(), here.begin()
    here.run(second, SOLVE)
    assert done == [(first, BEGIN), (second, BEGIN), (second, SOLVE), (first, END)]


def test_a_factor_whose_ranks_have_ended_is_refused():
    here = Ranks(OneRank())
    here.end()
    with pytest.raises(InvalidInputError, match="have ended"):
        here.run(0, SOLVE)
