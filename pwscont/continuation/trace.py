"""The branch graph of the component through a start."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pwscont.basics.budget import Budget
from pwscont.basics.given import checked_kind
from pwscont.basics.limits import Limits
from pwscont.basics.quantities import Function, checked_record
from pwscont.continuation.journal import Journal
from pwscont.continuation.plan import (
    Plan,
    Report,
    checked_detectors,
    checked_interval,
    silent,
)
from pwscont.continuation.prepared import followed, prepared
from pwscont.continuation.start import Start, checked_start, corrected
from pwscont.graph import BranchGraph
from pwscont.graph.structure import NOT_SEARCHED
from pwscont.search.enumeration import Found
from pwscont.stepping import Stepper
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions import TransitionDetector
from pwscont.transitions.user_event import Stop


def trace(
    system: PiecewiseSystem,
    start: tuple[Any, float],
    interval: tuple[float, float],
    *,
    stepper: Stepper | None = None,
    detectors: Iterable[TransitionDetector] = (),
    events: Mapping[str, Function | Stop] | None = None,
    record: Mapping[str, Function] | None = None,
    parameter: str = "alpha",
    report: Report = silent,
    journal: Journal | None = None,
    limits: Limits | None = None,
) -> BranchGraph:
    """Follow the component of H(z, alpha) = 0 through a start, in both directions.

    Parameters
    ----------
    system : PiecewiseSystem
    start : tuple of (array_like, shape (n,)) and float
        (z, alpha); z may be rough and is corrected at fixed alpha by semismooth Newton.
    interval : tuple of float
        (lo, hi): the values of alpha to stay in.
    stepper : Stepper, optional
        Default: exact for a PiecewiseLinearSystem, else PseudoArclength.
    detectors : iterable of TransitionDetector, optional
        Detectors beside the default ones; their special points may be of kinds of their own.
    events : mapping of str to callable or Stop, optional
        Functions g(z, alpha) -> float by name. Where one is zero is a special point of kind "event"
        with that name; one given as ``Stop(g)`` ends the branch there. They change no count and no
        balance. What is a transition, a fold or an end already stays what it is, and has the
        event's ``name``.
    record : mapping of str to callable, optional
        Quantities f(z, alpha) -> float by name, at hand as ``solution["name"]`` and
        ``point["name"]``, in data frames, tables and pictures.
    parameter : str, optional
        Name of alpha in tables and on axes.
    report : callable, optional
        Called with the number of pieces and the alpha reached, after each piece.
    journal : Journal, optional
        Where every finished piece is kept at once, so that an interrupted run can go on.
    limits : Limits, optional
        How many pieces the graph may have, and how many seconds it may take; default no limits.
        Where one runs out, and after Ctrl-C, the graph found so far comes back: its unfinished ends
        are special points of kind "stopped", and its guarantee says why. Ctrl-C ends the step that
        is being taken first; a second one does not wait for it.

    Returns
    -------
    BranchGraph

    Raises
    ------
    InvalidInputError
        If start, interval or stepper do not fit the system.
    InvalidSystemError
        If a method of the system returns the wrong shape.
    StartNotFoundError
        If no solution is found near the start.

    Examples
    --------
    >>> from pwscont import Switched, trace
    >>> arch = Switched(1, lambda z, t, sw: z * (z - 1) * (z - 2) + 5 * sw.relu(z - 1) - t)
    >>> branch = trace(arch, ([0.1], 0.0), (-0.5, 1.0))
    >>> [round(p.alpha, 6) for p in branch.special_points("fold")]
    [0.3849]
    """
    lo, hi = checked_interval(system, interval)
    checked_kind("journal", journal, Journal)
    checked_kind("limits", limits, Limits)
    rough = checked_start(system, start, (lo, hi))
    watched = checked_detectors(system, detectors, events)
    recorded = checked_record(record, system.names() if record else ())
    with Budget(limits or Limits()) as budget:
        plan = prepared(system, rough, (lo, hi), stepper, watched)

        def follow(plan: Plan, found: Iterator[Found]) -> BranchGraph:
            return plan.follow(found, parameter, report, NOT_SEARCHED, journal, budget, recorded)

        return followed(plan, rough[0], lambda plan: _corrected(plan, rough), follow)


def _corrected(plan: Plan, start: Start) -> Iterator[Found]:
    """Yield the solution near the start, computed when it is taken."""
    yield corrected(plan, start)
