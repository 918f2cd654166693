"""The MPI processes that factorise together.

Rank 0 runs the script, with the mesh and the contact problem; each other rank holds a part of the
factors and waits. Every job of MUMPS takes all ranks: rank 0 sends the number of a solver and the
job, in MUMPS's own numbering, and then takes part itself. The waiting ranks sleep, and so leave
processor cores to other processes while rank 0 follows branches.

Failure modes and answers
-------------------------
- A script that was started on several ranks without a serving rank: refused, with the right
  command.
- A rank that fails ends the whole run by MPI_Abort: the other ranks would wait for ever.
- A factor that is used after the ranks have ended: refused.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from itertools import count
from time import sleep
from typing import Any, final

from pwscont import InvalidInputError, MissingPackageError

#: Jobs, in the numbering of MUMPS (Users' Guide, JOB).
BEGIN, END, ANALYSE, FACTORISE, SOLVE = -1, -2, 1, 2, 3
#: Seconds between two looks of a waiting rank for messages.
PATIENCE = 0.001


def mpi() -> Any:
    """Return the module ``mpi4py.MPI``.

    Raises
    ------
    MissingPackageError
        If mpi4py is not installed, or finds no MPI library.
    """
    return _loaded("mpi4py.MPI")


def _loaded(name: str) -> Any:
    try:
        return import_module(name)
    except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py without an MPI library
        raise MissingPackageError(
            f"Mumps needs MUMPS and pymumps, and {name} cannot be loaded: apt-get install "
            "libmumps-dev libopenmpi-dev openmpi-bin libopenblas0-pthread (or your cluster's "
            "MUMPS), then pip install '.[mumps]' in a checkout of pwscont"
        ) from error


def _pymumps() -> Any:
    """Return the module of pymumps, and no other of that name."""
    mumps = _loaded("mumps")
    if not hasattr(mumps, "DMumpsContext"):
        raise MissingPackageError(
            "Mumps needs pymumps, but the installed package 'mumps' is another one: "
            "pip uninstall python-mumps, then pip install '.[mumps]' in a checkout of pwscont"
        )
    return mumps


def _solver(comm: Any) -> Any:
    """Return a solver of MUMPS for symmetric positive definite matrices, which prints nothing."""
    solver = _pymumps().DMumpsContext(par=1, sym=1, comm=comm)
    solver.set_silent()
    return solver


def _perform(solvers: dict[int, Any], comm: Any, number: int, job: int) -> None:
    """Take part in a job; INFOG(1) of the solver, alike on all ranks, tells of failure."""
    if job == BEGIN:
        solvers[number] = _solver(comm)
    elif job == END:
        solvers.pop(number).destroy()
    else:
        with suppress(RuntimeError):  # rank 0 reads INFOG(1), and puts the failure into words
            solvers[number].run(job)


@final
class Ranks:
    """The ranks of a communicator, for the use of rank 0.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
        All other ranks are in :func:`serve`.
    """

    def __init__(self, comm: Any) -> None:
        self._comm = comm
        self._solvers: dict[int, Any] = {}
        self._numbers = count()
        self._released: list[int] = []
        self._busy = self._ended = False

    @property
    def size(self) -> int:
        """The number of ranks."""
        return int(self._comm.size)

    def begin(self) -> int:
        """Make a solver on all ranks and return the number of the solver.

        Raises
        ------
        MissingPackageError
            If pymumps is not installed here; the other ranks need not know.
        """
        _pymumps()
        number = next(self._numbers)
        self.run(number, BEGIN)
        return number

    def solver(self, number: int) -> Any:
        """Return this rank's part of a solver."""
        return self._solvers[number]

    def run(self, number: int, job: int) -> None:
        """Have all ranks do a job.

        Raises
        ------
        InvalidInputError
            If the other ranks have ended.
        """
        if self._ended:
            raise InvalidInputError(
                "the ranks that hold this factor have ended: recover displacements within the "
                "script that mpiexec runs"
            )
        self._all(number, job)
        self._free()

    def release(self, number: int) -> None:
        """Free a solver: now, or after the job at hand if garbage is collected within a job."""
        self._released.append(number)
        if not (self._busy or self._ended):
            self._free()

    def end(self) -> None:
        """Free all solvers and let the other ranks go."""
        self._released = list(self._solvers)
        self._free()
        self._tell(None)
        self._ended = True

    def _free(self) -> None:
        while self._released:
            self._all(self._released.pop(), END)

    def _all(self, number: int, job: int) -> None:
        self._busy = True
        try:
            self._tell((number, job))
            _perform(self._solvers, self._comm, number, job)
        finally:
            self._busy = False

    def _tell(self, message: tuple[int, int] | None) -> None:
        for rank in range(1, self._comm.size):
            self._comm.send(message, dest=rank)


#: The ranks that serve this process, if any.
_serving: list[Ranks] = []


@contextmanager
def hosting(comm: Any) -> Iterator[None]:
    """Have the other ranks, which are in :func:`serve`, take part in all eliminations by Mumps.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
        This process is rank 0 of the communicator.
    """
    _serving.append(Ranks(comm))
    try:
        yield
    finally:
        _serving.pop().end()


def serve(comm: Any) -> None:
    """Take part in the jobs of rank 0 until rank 0 leaves :func:`hosting`; for all other ranks.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
    """
    solvers: dict[int, Any] = {}
    try:
        while (message := _received(comm)) is not None:
            _perform(solvers, comm, *message)
    except BaseException:
        traceback.print_exc()
        comm.Abort(1)
        raise


def _received(comm: Any) -> tuple[int, int] | None:
    while not comm.Iprobe(source=0):  # a blocking receive would keep a core busy
        sleep(PATIENCE)
    return comm.recv(source=0)


def ranks() -> Ranks:
    """Return the ranks that factorise: the serving ranks, or this process alone.

    Raises
    ------
    MissingPackageError
        If mpi4py is not installed.
    InvalidInputError
        If there are several ranks and none serves.
    """
    size = mpi().COMM_WORLD.size
    if _serving:
        return _serving[-1]
    if size > 1:
        raise InvalidInputError(
            f"this script was started on {size} ranks that all run it; let rank 0 run it and the "
            f"others serve Mumps: mpiexec -n {size} python -m pwscont_coulomb.mpi SCRIPT"
        )
    return _alone()


@cache
def _alone() -> Ranks:
    return Ranks(mpi().COMM_SELF)
