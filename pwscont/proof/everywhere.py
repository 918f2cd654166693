"""A search that finds all solutions of a formula in a box, and proves that there are no others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, finite_array, generic
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Failure, Guarantee, SearchScope
from pwscont.curve.error_samples import Found
from pwscont.curve.metric import Metric
from pwscont.curve.semismooth import semismooth_newton
from pwscont.notation.curved import SwitchedSystem
from pwscont.proof.cover import covered
from pwscont.proof.interval import Interval
from pwscont.proof.newton import formula
from pwscont.proof.proof import BoxProof
from pwscont.proof.tape import Tape, traced
from pwscont.search.default_search import default_search
from pwscont.search.search import KnownBranches, NothingKnown, Search, starts_of
from pwscont.system.abilities import completed
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem
from pwscont.transitions.departures import settled

#: The default box reaches so many typical magnitudes from zero, where there are no bounds.
FAR = 1e3
#: At how many points the tape is compared with the formula, and how much they may differ, relative
#: to the values and to the bound on rounding.
COMPARED, ALIKE, ROUNDINGS = 40, 1e-9, 100.0


@final
@dataclass(frozen=True, slots=True)
class Everywhere(Search):
    """All solutions of a formula in a box of the unknowns, proved by interval arithmetic.

    For systems written as formulas with switches (:func:`pwscont.Switched`,
    :func:`pwscont.Complementarity`). Boxes of (z, alpha) are excluded, contracted, proved to hold
    one solution at every alpha, or halved. Starts are the proved solutions between the windows of
    alpha around folds; where something is not proved, the default search goes on. ``graph.proof``
    says what was proved, see :class:`~pwscont.proof.proof.BoxProof`.

    Attributes
    ----------
    box : tuple of array_like, optional
        The least and largest unknowns, each broadcastable to (n,). Default: the bounds of the
        system; where there is no bound, a thousand typical magnitudes to both sides of zero; of a
        periodic unknown, one period. Nothing is proved of solutions outside the box.
    seconds : float
        After how many seconds boxes that are not decided are left open.

    Raises
    ------
    InvalidInputError
        If the box or the seconds make no sense; in a run, if the system is no formula, or the
        formula cannot be traced, with the reason.

    Examples
    --------
    >>> from pwscont import Everywhere, Switched, explore
    >>> loop = Switched(1, lambda z, t, sw: sw.abs(z - 3) + t**2 - 0.01)  # far from both ends
    >>> graph = explore(loop, (-1.0, 1.0), search=Everywhere(box=(-10.0, 10.0)))
    >>> graph.count(0.0), graph.proof.count(0.0), graph.proof.holds
    (2, 2, True)
    """

    box: tuple[Any, Any] | None = None
    seconds: float = 10.0
    _last: dict[str, Any] = field(default_factory=dict, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check box and seconds."""
        if not 0.0 < finite_array("seconds", self.seconds, ()) < np.inf:
            raise InvalidInputError(f"seconds must be positive, got {self.seconds}")
        if self.box is not None:
            object.__setattr__(self, "box", _checked_box(self.box))

    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield the proved solutions, then what the default search finds if something is open."""
        return self.starts_beside(system, metric, interval, NothingKnown())

    def starts_beside(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        interval: tuple[float, float],
        known: KnownBranches,
    ) -> Iterator[Found]:
        """Yield the proved solutions, then what the default search finds if something is open."""
        proof = self.prove(system, metric, interval)
        for z, alpha in _places(proof):
            yield from _corrected(system, metric, z, alpha)
        if not proof.holds:
            search = default_search(system, interval)
            yield from starts_of(search, system, metric, interval, known)

    def prove(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> BoxProof:
        """Return the proof for a system, made once for the same formula, interval and box."""
        tape = tape_of(system)
        size = tape.size
        lower, upper = self._limits(system, metric.scale[:size], size)
        box = Interval(np.append(lower, interval[0]), np.append(upper, interval[1]))
        scale = np.append(metric.scale[:size], interval[1] - interval[0])
        key = b"".join(each.tobytes() for each in (box.lo, box.hi, scale))
        known = self.proved(system, interval)
        if known is not None and self._last["key"] == key:
            return known
        check_tape(tape, system, box)
        with np.errstate(all="ignore"):
            proof = BoxProof(tape, box, scale, covered(tape, box, scale, self.seconds))
            _ = proof.stretches
        formula = getattr(system, "formula", None)
        self._last.update(formula=formula, interval=interval, key=key, proof=proof)
        return proof

    def _limits(self, system: PiecewiseSystem, scale: Array, size: int) -> tuple[Array, Array]:
        """Return the least and largest unknowns."""
        if self.box is not None:
            lower, upper = (finite_array("box", end) for end in self.box)
            if any(end.shape not in ((), (1,), (size,)) for end in (lower, upper)):
                raise InvalidInputError(f"box must broadcast to {size} unknowns, got {self.box}")
            return np.broadcast_to(lower, (size,)), np.broadcast_to(upper, (size,))
        own = Box.of(system)
        reach = np.minimum(FAR * scale, 0.5 * own.period[:size])
        lower, upper = own.lower[:size], own.upper[:size]
        return np.where(np.isfinite(lower), lower, -reach), np.where(
            np.isfinite(upper), upper, reach
        )

    def proved(self, system: PiecewiseSystem, interval: tuple[float, float]) -> BoxProof | None:
        """Return the proof of the last run, if the run was of this formula and interval."""
        formula = getattr(system, "formula", None)
        is_last = self._last.get("formula") is formula and self._last.get("interval") == interval
        return self._last["proof"] if is_last else None

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing here: what is proved, the graph says by its proof."""
        box = "bounds, or 1000 typical magnitudes" if self.box is None else f"{self.box}"
        what = (
            f"all solutions proved in a box of the unknowns ({box}), if within {self.seconds:g} s"
        )
        return SearchScope(
            f"{what}; where something is open, the default search", Guarantee.NOTHING
        )


def _checked_box(box: Any) -> tuple[Any, Any]:
    """Return the ends of a box as tuples or numbers."""
    if not isinstance(box, tuple | list) or len(box) != 2:
        raise InvalidInputError(f"box must be a pair (least, largest), got {box!r}")
    lower, upper = (finite_array("box", end) for end in box)
    try:
        is_ordered = bool((lower < upper).all())
    except ValueError as error:
        raise InvalidInputError(f"the two ends of box do not fit: {error}") from error
    if not is_ordered:
        raise InvalidInputError(f"box needs least < largest, got {box!r}")
    return _plain(lower), _plain(upper)


def _plain(end: Array) -> Any:
    return tuple(end.tolist()) if end.ndim else end.item()


def tape_of(system: PiecewiseSystem) -> Tape:
    """Return the tape of a system.

    Raises
    ------
    InvalidInputError
        If the system is no curved formula with switches, or cannot be traced.
    """
    if not isinstance(system, SwitchedSystem):
        raise InvalidInputError(
            "Everywhere proves formulas with switches, as Switched and Complementarity take them "
            f"without linear=True; {type(system).__name__} hands over no formula. Of "
            "piecewise-linear systems AllTransitions finds everything"
        )
    return traced(system.formula, system.shown)


def check_tape(tape: Tape, system: Any, box: Interval) -> None:
    """Refuse a tape that says something else than the formula at some point of a box.

    Raises
    ------
    InvalidInputError
    """
    size = tape.size + 1
    for i in range(COMPARED):
        part = 0.5 + 0.5 * generic(size, i) * 2.0 ** -(i % 10)
        x = box.lo + (box.hi - box.lo) * part
        with np.errstate(all="ignore"):
            value = system.formula_at(x[:-1], float(x[-1]))
            known = formula(tape, Interval.point(x[:, np.newaxis]))[:, 0]
            slack = ALIKE * np.abs(value) + ROUNDINGS * known.width()
            differs = (value < known.lo - slack) | (value > known.hi + slack)
        if differs.any():
            raise InvalidInputError(
                f"the formula is not what its operations say, at {x}: it decides by something that "
                "cannot be traced, so that nothing can be proved"
            )


def _places(proof: BoxProof) -> Iterator[tuple[Array, float]]:
    """Yield the proved solutions, one set for each stretch between windows."""
    for stretch in proof.stretches:
        for least, largest in proof.solutions(stretch.alpha) or ():
            yield 0.5 * (least + largest), stretch.alpha


def _corrected(system: PiecewiseSystem, metric: Metric, z: Array, alpha: float) -> Iterator[Found]:
    """Yield the solution near a proved one as Newton leaves it."""
    guess = completed(system, z, alpha)
    found = semismooth_newton(system, metric, guess, alpha)
    if not isinstance(found, Failure):
        on_curve = settled(system, metric, found)
        if on_curve:
            yield on_curve
