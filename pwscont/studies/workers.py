"""Cases on the cores of this machine: processes that each run case after case.

Each process has a separate pipe. Therefore the case that ends a process is known, only that case
has to be run again, and the remaining processes go on.

Failure modes and answers
-------------------------
- A process dies, for example killed for lack of memory: a new process takes over the case. A case
  that ends three processes becomes a failed row.
- Processes die before the first case, as in a script without ``__main__`` guard, or cannot import
  the study's functions: the study is refused with advice.
- Ctrl-C reaches all processes of a terminal: workers ignore Ctrl-C, this process ends the workers.
- This process is killed: the pipes close, and the workers end after the current cases.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, final

from pwscont import InvalidInputError
from pwscont.extending import THREADS
from pwscont.studies.case import CaseRunner, StudyRow

#: Number of processes that a case may end before the case fails.
MOST_DEATHS = 3
#: Processes begin as new interpreters, which is safe with threads and equal on all systems.
SPAWN = get_context("spawn")
GUARD = "in a script, the lines that run the study must stand under if __name__ == '__main__':"


def serve(pipe: Connection) -> None:
    """Run in a worker process the cases whose numbers the pipe brings, until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        run = pickle.loads(pipe.recv_bytes())
    except Exception as error:
        pipe.send(f"{type(error).__name__}: {error}")
        return
    pipe.send("")
    try:
        while True:
            pipe.send(run(pipe.recv()))
    except (EOFError, BrokenPipeError):
        return


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Block Ctrl-C for processes that begin within, until these processes ignore Ctrl-C."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # the first process would start the tracker, and the tracker would unblock signals
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let BLAS use a single thread in processes that begin here, unless the user sets a number."""
    decided = any(name in os.environ for name in THREADS)
    chosen = {} if decided else dict.fromkeys(THREADS, "1")
    os.environ |= chosen
    try:
        yield
    finally:
        for name in chosen:
            del os.environ[name]


@final
class Worker:
    """A process that runs cases.

    Attributes
    ----------
    case : int or None
        The case that the process computes.
    is_ready : bool
        Whether the process could load the study.
    """

    def __init__(self, run: bytes) -> None:
        self.case: int | None = None
        self.is_ready = False
        self._pipe, far = SPAWN.Pipe()
        with _one_thread(), _no_interrupts():
            self._process = SPAWN.Process(target=serve, args=(far,), daemon=True)
            self._process.start()
        far.close()
        self._say(self._pipe.send_bytes, run)

    @property
    def signs(self) -> tuple[Any, Any]:
        """Objects that :func:`multiprocessing.connection.wait` waits for: pipe and end."""
        return self._pipe, self._process.sentinel

    def begin(self, case: int) -> None:
        """Send the number of a case to the process."""
        self.case = case
        self._say(self._pipe.send, case)

    def _say(self, send: Any, what: Any) -> None:
        with suppress(OSError):  # a process that has ended is noticed at the next answer
            send(what)

    def answer(self) -> StudyRow | str | None:
        """Return the answer of the process; None before the answer.

        Raises
        ------
        EOFError
            If the process has ended.
        """
        try:
            if self._pipe.poll():
                return self._pipe.recv()
        except OSError as error:
            raise EOFError from error
        if self._process.is_alive():
            return None
        raise EOFError

    def end(self) -> int | None:
        """End the process, and return the exit code, negative for a signal."""
        self._process.terminate()
        self._process.join()
        self._pipe.close()
        return self._process.exitcode


def on_workers(run: CaseRunner, numbers: Iterable[int], count: int) -> Iterator[StudyRow]:
    """Yield the rows of cases as the cases finish in worker processes.

    Parameters
    ----------
    run : CaseRunner
    numbers : iterable of int
    count : int
        Number of processes.

    Raises
    ------
    InvalidInputError
        If the study cannot be sent to other processes.
    """
    crew = Crew(run, numbers, count)
    try:
        yield from crew.rows()
    finally:
        crew.end()


@final
class Crew:
    """The processes that run the cases of a study."""

    def __init__(self, run: CaseRunner, numbers: Iterable[int], count: int) -> None:
        self._run, self._message = run, sendable(run)
        self._numbers, self._again = iter(numbers), deque[int]()
        self._deaths: Counter[int | None] = Counter()
        self._workers: list[Worker] = []
        for _ in range(count):
            self._workers.append(Worker(self._message))

    def end(self) -> None:
        """End all processes."""
        for worker in self._workers:
            worker.end()

    def rows(self) -> Iterator[StudyRow]:
        """Yield rows until no case is left."""
        while any(worker.case is not None or not worker.is_ready for worker in self._workers):
            wait([sign for worker in self._workers for sign in worker.signs])
            for place, worker in enumerate(self._workers):
                yield from self._heard(place, worker)

    def _heard(self, place: int, worker: Worker) -> Iterator[StudyRow]:
        """Yield the row that a worker answers, and send the next case to the worker."""
        try:
            answer = worker.answer()
        except EOFError:
            yield from self._replaced(place, worker)
            return
        if answer is None:
            return
        if isinstance(answer, StudyRow):
            yield answer
        elif answer:
            raise InvalidInputError(f"workers cannot load the study: {answer}; {IMPORTABLE}")
        worker.is_ready, worker.case = True, None
        self._give(worker)

    def _give(self, worker: Worker) -> None:
        case = self._again.popleft() if self._again else next(self._numbers, None)
        if case is not None:
            worker.begin(case)

    def _replaced(self, place: int, worker: Worker) -> Iterator[StudyRow]:
        """Replace a worker that has ended; the case runs again, or yields a failed row."""
        code, case = worker.end(), worker.case
        self._deaths[case] += 1
        if self._deaths[case] < MOST_DEATHS:
            self._again.extend([] if case is None else [case])
        elif case is None:
            words = f"worker processes end before their first case (exit code {code}); {GUARD}"
            raise InvalidInputError(words)
        else:
            words = f"the case ended its process {MOST_DEATHS} times (exit code {code})"
            yield self._run.failed(case, words)
        self._workers[place] = Worker(self._message)


IMPORTABLE = "functions must stand at the top of a module that can be imported, no lambdas"


def sendable(run: CaseRunner) -> bytes:
    """Return the runner of a study as bytes for worker processes.

    Raises
    ------
    InvalidInputError
        If a part of the study cannot be sent, such as a lambda.
    """
    try:
        return pickle.dumps(run)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        words = f"the study cannot be sent to other processes: {error}; {IMPORTABLE}"
        raise InvalidInputError(words) from error
