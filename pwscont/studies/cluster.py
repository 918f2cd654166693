"""Cases on a cluster: the workers of a Dask scheduler.

Failure modes and answers
-------------------------
- A worker dies: Dask runs the worker's cases elsewhere, including cases whose finished rows were
  not fetched, and gives up a case that ended several workers; the case becomes a failed row.
- No scheduler answers, or workers have different versions, whose numbers may differ: refused before
  any work.
- The scheduler goes away: the study ends with an error, and all stored rows stay.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module
from itertools import islice
from typing import Any

from pwscont import InvalidInputError, MissingPackageError
from pwscont.extending import one_thread
from pwscont.studies.case import CaseRunner, StudyRow, versions

#: Number of cases that are sent ahead; more cases would fill the scheduler's memory.
AHEAD = 500
#: Seconds after which a scheduler that does not answer is given up; Dask asks twice.
PATIENCE = 5.0


def on_cluster(run: CaseRunner, numbers: Iterable[int], address: str) -> Iterator[StudyRow]:
    """Yield the rows of cases as the cases finish on the workers of a scheduler.

    Parameters
    ----------
    run : CaseRunner
    numbers : iterable of int
    address : str
        The address of the scheduler, such as ``tcp://10.0.0.1:8786``.
    """
    distributed = _distributed()
    with _client(distributed, address) as client:
        _check_versions(client)
        yield from _rows(distributed, client, run, iter(numbers))


def _rows(
    distributed: Any, client: Any, run: CaseRunner, numbers: Iterator[int]
) -> Iterator[StudyRow]:
    """Yield rows, with a constant number of cases sent ahead."""
    sent = {_sent(client, run, number): number for number in islice(numbers, AHEAD)}
    finished = distributed.as_completed(list(sent), loop=client.loop)
    for future in finished:
        number = sent.pop(future)
        yield _row(future, run, number)
        for following in islice(numbers, 1):
            more = _sent(client, run, following)
            sent[more] = following
            finished.add(more)


def run_alone(run: CaseRunner, number: int) -> StudyRow:
    """Return the row of a case, run on a worker with one thread of BLAS."""
    with one_thread():
        return run(number)


def _sent(client: Any, run: CaseRunner, number: int) -> Any:
    return client.submit(run_alone, run, number, pure=False)


def _row(future: Any, run: CaseRunner, number: int) -> StudyRow:
    # a worker may die with a row that was finished but not fetched: Dask computes the row again
    if future.status in ("lost", "pending"):
        future.exception()  # waits
    if future.status == "finished":
        return future.result()
    if future.status != "error":
        words = f"the scheduler does not have case {number} any more (it is {future.status})"
        raise InvalidInputError(f"{words}: was it started again? With a store, resume goes on")
    error = future.exception()
    return run.failed(number, " ".join(f"{type(error).__name__}: {error}".split()))


def _distributed() -> Any:
    try:
        return import_module("distributed")
    except ImportError as error:
        words = (
            "pip install 'dask[distributed]', or pip install '.[study]' in a checkout of pwscont"
        )
        raise MissingPackageError(f"a scheduler needs Dask: {words}") from error


def _client(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, MemoryError) as error:  # sizes that another service seems to send
        words = "start one with 'dask scheduler', which prints its address"
        raise InvalidInputError(f"no Dask scheduler answers at {address!r}; {words}") from error


def _check_versions(client: Any) -> None:
    """Refuse workers with different versions, whose numbers may differ."""
    here = versions()
    for worker, there in client.run(versions).items():
        for name in here:
            if there[name] != here[name]:
                words = f"worker {worker} has {name} {there[name]}, and this process {here[name]}"
                raise InvalidInputError(f"{words}: the numbers may differ")
