"""What a run leaves out because its scene does not need it, and why: the plan in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from pwscont.basics.guarantee import Guarantee
from pwscont.continuation.plan import Plan, checked_interval
from pwscont.search import Search
from pwscont.search.default_search import default_search
from pwscont.stepping import ExactLinear, Stepper
from pwscont.system.system import PiecewiseLinearSystem, PiecewiseSystem, SlicewiseLinearSystem
from pwscont.transitions import SmoothFolds


class Omission(NamedTuple):
    """Something that a run does not compute or store.

    Attributes
    ----------
    what, why : str
    """

    what: str
    why: str


def omissions(
    system: PiecewiseSystem,
    interval: tuple[float, float],
    search: Search | None = None,
    stepper: Stepper | None = None,
) -> tuple[Omission, ...]:
    """Return what :func:`pwscont.explore` leaves out, without following anything.

    Parameters
    ----------
    system, interval, search, stepper
        As for :func:`pwscont.explore`.

    Returns
    -------
    tuple of Omission

    Raises
    ------
    InvalidInputError, InvalidSystemError
        As for :func:`pwscont.explore`.
    """
    plan = Plan.of(system, checked_interval(system, interval), stepper)
    parts = (
        _nodes(plan),
        _steps(plan),
        _detectors(plan),
        _derivatives(plan),
        _search(plan, search),
    )
    return tuple(omission for part in parts for omission in part)


def _nodes(plan: Plan) -> Iterator[Omission]:
    """Say which parts of the system provably stay in one mode."""
    if plan.reduction is None:
        return
    left = plan.system.size - plan.followed.size
    for reason in plan.reduction.reasons:
        yield Omission("a part of the system", reason)
    yield Omission(f"{left} of {plan.system.size} unknowns", "zero in the parts left out")


def _steps(plan: Plan) -> Iterator[Omission]:
    if isinstance(plan.stepper, ExactLinear):
        why = "all pieces are straight, one solve and one ratio test each"
        yield Omission("step sizes and corrections", why)
        yield Omission("points between special points", "the pieces are straight")
    yield Omission("tangents along the pieces", "a graph keeps points only")


def _detectors(plan: Plan) -> Iterator[Omission]:
    if not any(isinstance(detector, SmoothFolds) for detector in plan.detectors):
        yield Omission("detectors of smooth folds and branch points", "straight pieces have none")
    yield Omission("tests that do not bound the current cell", "they cannot end a piece")


def _derivatives(plan: Plan) -> Iterator[Omission]:
    """Say which derivatives come from the system, and need no differences."""
    given = [
        name
        for name in ("jacobian", "test_jacobian")
        if getattr(type(plan.system), name) is not getattr(PiecewiseSystem, name)
    ]
    if given:
        yield Omission("differences", f"the system brings {' and '.join(given)}")


def _search(plan: Plan, search: Search | None) -> Iterator[Omission]:
    """Say what a search with a stronger promise would be, and why it is not made."""
    chosen = search or default_search(plan.followed, plan.interval)
    promise = chosen.searched(plan.followed).promise
    if promise is Guarantee.EVERYTHING:
        return
    what = "a search that also finds every closed loop"
    if promise is Guarantee.NOTHING:
        what = "a search that promises to miss no branch"
    yield Omission(what, _why_no_better(plan, search))


def _why_no_better(plan: Plan, search: Search | None) -> str:
    if search is not None:
        return "the scene chooses its search"
    if not isinstance(plan.followed, SlicewiseLinearSystem):
        return "there is none for systems that are not affine in z"
    if not isinstance(plan.followed, PiecewiseLinearSystem):
        return "there is none for curved pieces"
    return "too many cells to enumerate in seconds"
