"""A line of progress for runs that take longer than a second."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO, final

FIRST = 1.0  # seconds before anything is shown
EVERY = 0.2  # seconds between two updates


@final
class Progress:
    """Shows how many pieces are done; silent for short runs.

    Parameters
    ----------
    parameter : str
        Name of alpha.
    stream : file, optional
        Default standard error, so that standard output stays clean.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(
        self,
        parameter: str,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._parameter = parameter
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._next = clock() + FIRST
        self._shown = False

    def __call__(self, pieces: int, alpha: float) -> None:
        """Report that ``pieces`` are finished and ``alpha`` is reached."""
        now = self._clock()
        if now >= self._next:
            self._next, self._shown = now + EVERY, True
            self._stream.write(f"\r{pieces} pieces, {self._parameter} = {alpha:.6g}   ")
            self._stream.flush()

    def close(self) -> None:
        """End the line, if one was begun."""
        if self._shown:
            self._stream.write("\n")
