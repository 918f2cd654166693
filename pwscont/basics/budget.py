"""Limits of a run, and how much of each limit is left.

Long work calls :func:`check_budget` now and then. During a run the first Ctrl-C only sets a flag,
which the next check sees, so that no graph is left half changed. A second Ctrl-C, for a residual
that hangs, raises at once. A handler that the program has installed itself is left alone.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from numbers import Integral, Real
from types import FrameType
from typing import Any, TypeVar, final

from pwscont.basics.errors import InvalidInputError

Result = TypeVar("Result")


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of :func:`pwscont.trace` and :func:`pwscont.explore`.

    If a limit runs out, everything found so far comes back, and the guarantee names the limit.

    Attributes
    ----------
    pieces : int, optional
        The most pieces that the graph may have; default any number.
    seconds : float, optional
        The time after which the run ends; default no limit. The run first finishes the current step
        of the search or of a piece, which takes longer for large systems. Events are marked
        afterwards, for at most half of the limit; the guarantee says if events are missing.

    Raises
    ------
    InvalidInputError
        If pieces is no positive whole number, or seconds no positive number.

    Examples
    --------
    >>> from pwscont import Limits, Switched, explore
    >>> waves = Switched(1, lambda z, t, sw: z - sw.abs(t), linear=True)
    >>> explore(waves, (-1.0, 1.0), limits=Limits(pieces=1)).guarantee
    'the limit of 1 piece was reached: there may be more; open ends at alpha = 0'
    """

    pieces: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        pieces, seconds = self.pieces, self.seconds
        whole = isinstance(pieces, Integral) and not isinstance(pieces, bool)
        if pieces is not None and not (whole and pieces > 0):
            raise InvalidInputError(f"pieces must be a positive whole number, got {pieces!r}")
        number = isinstance(seconds, Real) and not isinstance(seconds, bool)
        most = sys.float_info.max  # a larger integer overflows
        if seconds is not None and not (number and (0 < seconds <= most or seconds == math.inf)):
            raise InvalidInputError(f"seconds must be a positive number, got {seconds!r}")


#: The limits of a run to which a user gives none.
NO_LIMITS = Limits()
#: The reason of a run that a user ended.
INTERRUPTED = "interrupted"
#: The time for work on what a run has found, as a part of the limit.
AFTERWARDS = 0.5

_current: ContextVar[Budget | None] = ContextVar("budget", default=None)


@final
class OutOfBudget(KeyboardInterrupt):
    """A limit has run out: the run ends as after Ctrl-C."""


def check_budget() -> None:
    """Go on, or raise the KeyboardInterrupt by which the run that is going on has to end."""
    budget = _current.get()
    if budget is not None:
        budget.check()


@final
class Budget:
    """The budget of a run, which lasts as long as its ``with`` block; ``clock`` tells seconds."""

    def __init__(
        self, limits: Limits | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._limits, self._clock = limits or NO_LIMITS, clock
        #: Whether a user has set a limit.
        self.is_limited = limits is not None and limits != NO_LIMITS
        seconds = self._limits.seconds
        self._deadline = clock() + (seconds if seconds is not None else math.inf)
        self._reason, self._is_interrupted, self._was_interrupted = "", False, False
        self._outer = _current.get()

    def __enter__(self) -> Budget:
        """Begin the run."""
        self._handler = self._install()  # from here on Ctrl-C leaves nothing half done
        self._token = _current.set(self)
        return self

    def __exit__(self, *_: object) -> None:
        """End the run; an interrupted run also ends an enclosing run."""
        _current.reset(self._token)
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
        if self._outer is not None:
            self._outer._is_interrupted |= self._is_interrupted or self._was_interrupted

    @property
    def spent(self) -> str:
        """What ran out, in words; empty while every limit allows more."""
        return self._reason or (INTERRUPTED if self._is_interrupted else "")

    def check(self) -> None:
        """Raise if this budget, or the budget of a run around this run, is spent."""
        if self._is_interrupted:
            raise OutOfBudget(INTERRUPTED)
        if self._clock() >= self._deadline:
            raise OutOfBudget(f"the limit of {self._limits.seconds:g} seconds was reached")
        if self._outer is not None:
            self._outer.check()

    def extend(self) -> None:
        """Allow some seconds more, for work on what the run has found; Ctrl-C ends the work."""
        self._reason = self.spent
        self._was_interrupted |= self._is_interrupted
        self._is_interrupted = False
        seconds = self._limits.seconds
        if seconds is not None:
            self._deadline = max(self._deadline, self._clock() + AFTERWARDS * seconds)

    def allows(self, pieces: int) -> bool:
        """Tell whether a run that has followed ``pieces`` pieces may follow another piece."""
        most = self._limits.pieces
        if most is not None and pieces >= most and not self.spent:
            self._reason = f"the limit of {most} piece{'' if most == 1 else 's'} was reached"
        return not self.spent

    def end(self, why: KeyboardInterrupt) -> str:
        """Remember what ended the run, and return the reason in words."""
        if isinstance(why, OutOfBudget):
            self._reason = self._reason or str(why)
        else:
            self._is_interrupted = True
        return self.spent

    def spend(self, work: Callable[[], Result], otherwise: Result) -> Result:
        """Return what ``work`` returns, or ``otherwise`` if the budget is spent first."""
        if self.spent:
            return otherwise
        try:
            return work()
        except KeyboardInterrupt as why:
            self.end(why)
            return otherwise

    def _install(self) -> Any:
        """Handle Ctrl-C where the main thread has Python's own handler; return Python's handler."""
        if threading.current_thread() is not threading.main_thread():
            return None
        before = signal.getsignal(signal.SIGINT)  # None: the handler is not from Python
        if before is not signal.default_int_handler:
            return None
        signal.signal(signal.SIGINT, self._on_interrupt)
        return before

    def _on_interrupt(self, _: int, __: FrameType | None) -> None:
        if self._is_interrupted:
            raise KeyboardInterrupt
        self._is_interrupted = True


def current_budget() -> Budget:
    """Return the budget of the run that is going on; outside a run, a budget without limits."""
    return _current.get() or Budget()
