"""A line of progress on a terminal, for runs that take longer than a second."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import TextIO, final

FIRST = 1.0  # seconds before anything is shown
EVERY = 0.2  # seconds between two updates
WINDOW = 10.0  # seconds over which the rate is taken


@final
class Progress:
    """Shows how many pieces are done, and how many per second lately; silent for short runs.

    Silent, too, where the line would end up in a file or in another program.

    The time left is not shown: nobody knows how many pieces there are.

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
        on_terminal = self._stream is not None and self._stream.isatty()
        self._next = clock() + FIRST if on_terminal else math.inf
        self._recent = deque([(clock(), 0)])
        self._shown = False

    def __call__(self, pieces: int, alpha: float) -> None:
        """Report that ``pieces`` are finished and ``alpha`` is reached."""
        now = self._clock()
        if now >= self._next:
            self._next, self._shown = now + EVERY, True
            line = f"{pieces} pieces, {self._parameter} = {alpha:.6g}{self._rate(now, pieces)}"
            self._stream.write(f"\r{line:<60}")
            self._stream.flush()

    def _rate(self, now: float, pieces: int) -> str:
        """Return pieces per second of the last seconds, not of the whole run."""
        self._recent.append((now, pieces))
        while len(self._recent) > 2 and self._recent[1][0] <= now - WINDOW:
            self._recent.popleft()
        since, before = self._recent[0]
        return f", {(pieces - before) / (now - since):.3g} pieces/s"

    def close(self) -> None:
        """End the line, if one was begun."""
        if self._shown:
            self._stream.write("\n")
