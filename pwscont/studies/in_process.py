"""Cases one after the other in this process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pwscont.linear.threads import few_threads
from pwscont.studies.case import CaseRunner, StudyRow


def in_process(run: CaseRunner, numbers: Iterable[int]) -> Iterator[StudyRow]:
    """Yield the rows of some cases; BLAS has one thread meanwhile, as in all other processes."""
    with few_threads(0):
        yield from map(run, numbers)
