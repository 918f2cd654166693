"""The limits of a run: so many pieces, so many seconds."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from numbers import Integral, Real
from typing import final

from pwscont.basics.errors import InvalidInputError


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of :func:`pwscont.trace` and :func:`pwscont.explore`.

    Where a limit runs out, everything found so far comes back, and the guarantee says so.

    Attributes
    ----------
    pieces : int, optional
        The most pieces that the graph may have; default any number.
    seconds : float, optional
        The time after which the run ends; default as long as it takes. One step of the search or
        of a piece is finished first, for large systems more than that.

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
        if seconds is not None and not _is_positive(seconds):
            raise InvalidInputError(f"seconds must be a positive number, got {seconds!r}")


def _is_positive(value: object) -> bool:
    number = isinstance(value, Real) and not isinstance(value, bool)
    return number and (0 < value <= sys.float_info.max or value == math.inf)  # type: ignore[operator]
