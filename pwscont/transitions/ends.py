"""Special points at which curves end because the system says so.

Failure modes and answers
-------------------------
- A corner is reached from a cell that goes on there, and curves of other cells that meet there end:
  it ends all of them, or what is found would depend on the side one comes from.
- A start is such a corner, and no cell is the one that the curve comes from: all are asked.
- A curve that runs along an interface does not end because it lies on it: a point that all curves
  pass within one cell is none where they could end.
"""

from __future__ import annotations

from pwscont.basics.kind import Kind
from pwscont.system.ending import Ending, end_of
from pwscont.transitions.detector import SpecialPointFound
from pwscont.transitions.rays import vanishing


def ended(arrival: SpecialPointFound) -> SpecialPointFound:
    """Return a special point as an end of all its rays, where the system ends a curve of one.

    Systems that are not :class:`~pwscont.extending.Ending` end none.
    """
    why = _reason(arrival)
    return SpecialPointFound(Kind.END, arrival.x, why, arrival.rays) if why else arrival


def _reason(arrival: SpecialPointFound) -> str | None:
    """Return why curves end at a special point where several cells meet, None where none does."""
    if arrival.kind == Kind.START or not arrival.rays:
        return None
    state, curve = arrival.rays[0].state, arrival.rays[0].curve
    system = curve.selection.system
    cells = dict.fromkeys(ray.curve.selection.character for ray in arrival.rays)
    if not isinstance(system, Ending) or len(cells) < 2:
        return None
    zero = vanishing(system, arrival.x, state.error, curve.metric.scale)
    reasons = (end_of(system, cell, zero) for cell in cells) if zero else ()
    return next(filter(None, reasons), None)
