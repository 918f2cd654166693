"""Lines of progress on a terminal, for runs that take longer than a second."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from collections.abc import Callable
from math import ceil
from typing import TextIO, final

from pwscont.extending import counted

FIRST = 1.0  # seconds before anything is shown
EVERY = 0.2  # seconds between two updates
WINDOW = 10.0  # seconds over which the rate is taken


@final
class ProgressLine:
    """A line on a terminal that each update overwrites.

    The line is silent for short runs, and if the stream is no terminal.

    Parameters
    ----------
    stream : file, optional
        Default standard error, so that standard output stays clean.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        on_terminal = self._stream is not None and self._stream.isatty()
        self._next = clock() + FIRST if on_terminal else math.inf
        self._recent = deque([(clock(), 0)])
        self._shown = False

    @property
    def is_due(self) -> bool:
        """Whether the next update may be written."""
        return self._clock() >= self._next

    def write(self, words: str) -> None:
        """Overwrite the line with new words."""
        self._next, self._shown = self._clock() + EVERY, True
        self._stream.write(f"\r{words:<60}")
        self._stream.flush()

    def rate(self, done: int) -> float:
        """Return the number done per second, over the last ``WINDOW`` seconds of the run."""
        now = self._clock()
        self._recent.append((now, done))
        while len(self._recent) > 2 and self._recent[1][0] <= now - WINDOW:
            self._recent.popleft()
        since, before = self._recent[0]
        return (done - before) / (now - since)

    def begin(self, done: int) -> None:
        """Set the number done at the start, so that the rate counts only the rest."""
        self._recent = deque([(self._clock(), done)])

    def close(self) -> None:
        """End the line if anything was written."""
        if self._shown:
            self._stream.write("\n")


@final
class Progress:
    """Shows the number of finished pieces, and the recent rate.

    The time left is not shown: the number of pieces is not known.

    Parameters
    ----------
    parameter : str
        Name of alpha.
    stream, clock : optional
        As for :class:`ProgressLine`.
    """

    def __init__(
        self,
        parameter: str,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._parameter = parameter
        self._line = ProgressLine(stream, clock)

    def __call__(self, pieces: int, alpha: float) -> None:
        """Report that ``pieces`` are finished and ``alpha`` is reached."""
        if self._line.is_due:
            rate = f"{self._line.rate(pieces):.3g} pieces/s"
            self._line.write(f"{counted(pieces, 'piece')}, {self._parameter} = {alpha:.6g}, {rate}")

    def close(self) -> None:
        """End the line if anything was written."""
        self._line.close()


@final
class CaseProgress:
    """Shows the number of finished cases of a study, the recent rate, and the time left.

    Parameters
    ----------
    stream, clock : optional
        As for :class:`ProgressLine`.
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._line = ProgressLine(stream, clock)
        self._is_begun = False

    def __call__(self, done: int, total: int) -> None:
        """Report that ``done`` cases of ``total`` are finished."""
        if not self._is_begun:
            self._is_begun = True
            self._line.begin(done)
        elif self._line.is_due and (rate := self._line.rate(done)) > 0.0:
            left = _duration((total - done) / rate)
            self._line.write(f"{done} of {total} cases, {rate:.3g} cases/s, {left} left")

    def close(self) -> None:
        """End the line if anything was written."""
        self._line.close()


def _duration(seconds: float) -> str:
    """Return a time such as 45 s, 3:05 min, 2:00 h."""
    if seconds < 60.0:
        return f"{ceil(seconds)} s"
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"{int(seconds) // 60}:{int(seconds) % 60:02d} min"
    return f"{minutes // 60}:{minutes % 60:02d} h"
