"""Cases one after the other in this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pwscont.linear.threads import one_thread
from pwscont.studies.case import CaseRunner, StudyRow


def in_process(run: CaseRunner, numbers: Iterable[int]) -> Iterator[StudyRow]:
    """Yield the rows of some cases; BLAS has one thread meanwhile, as in all other processes."""
    with one_thread():
        yield from map(run, numbers)
