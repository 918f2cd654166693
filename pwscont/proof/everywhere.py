"""Searches that prove that all solutions of a formula in a box are found."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.budget import current_budget
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Guarantee, SearchScope
from pwscont.basics.rounding import EPS
from pwscont.curve.error_samples import Found
from pwscont.curve.magnitudes import nonlinear_reach
from pwscont.curve.metric import Metric, Range
from pwscont.graph.proved import BoxProof
from pwscont.proof.boxes import MOST_BOXES, Domain, counted_proof, covered
from pwscont.proof.interval import Interval
from pwscont.proof.tape import check_tape, tape_of
from pwscont.search.default_search import default_search
from pwscont.search.pursuit import solution_from
from pwscont.search.search import KnownBranches, Search, scope_of, starts_of
from pwscont.system.abilities import completed, formula_of, shown_size
from pwscont.system.box import Box
from pwscont.system.system import PiecewiseSystem

#: How far from zero the default box reaches, if there are no bounds, in distances at which H is
#: clearly nonlinear.
FAR = 1e3
#: Most unknowns of a formula that is tried.
MANY_UNKNOWNS = 3
#: Most work by default, within a second: boxes, times operations of the formula and its
#: derivatives, and others that every box needs. The answer depends on no clock.
MOST_WORK, BESIDES = 4_000_000, 50
#: The last limit, on a machine that is very slow.
SECONDS = 5.0


@final
@dataclass(frozen=True, slots=True)
class Everywhere(Search):
    """All solutions of a formula in a box of the unknowns, proved by interval arithmetic.

    For formulas with switches (:func:`pwscont.Switched`, :func:`pwscont.Complementarity`), and for
    classes whose methods do arithmetic only. Starts are the proved solutions between folds; where
    something is not proved, the default search goes on. ``graph.proof`` says what was proved, see
    :class:`~pwscont.graph.proved.BoxProof`.

    Attributes
    ----------
    box : tuple of array_like, optional
        The least and largest unknowns, each broadcastable to (n,). Default: the bounds of the
        system; where there is no bound, a thousand typical magnitudes to both sides of zero and of
        known branches; of a periodic unknown, one period. Nothing is proved of solutions outside.
    seconds : float
        After how many seconds boxes that are not decided are left open.

    Raises
    ------
    InvalidInputError
        If box or seconds make no sense; in a run, if no formula can be traced, with the reason.

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
    _first: Search | None = field(default=None, init=False, repr=False)
    _last: dict[str, Any] = field(default_factory=dict, init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check box and seconds."""
        if not 0.0 < finite_array("seconds", self.seconds, ()) < np.inf:
            raise InvalidInputError(f"seconds must be positive, got {self.seconds}")
        if self.box is not None:
            object.__setattr__(self, "box", _checked_box(self.box))

    @classmethod
    def after(cls, search: Search) -> Everywhere:
        """Return a search that looks for more after another search, if all is proved quickly.

        If anything stays open, and in a run with limits, the answer is that of the other search.
        """
        new = cls(seconds=SECONDS)
        object.__setattr__(new, "_first", search)
        return new

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield the proved solutions, and what the other search or the default search finds."""
        return self.starts_beside(system, metric, interval, KnownBranches())

    def starts_beside(
        self, system: PiecewiseSystem, metric: Metric, interval: Range, known: KnownBranches
    ) -> Iterator[Found]:
        """Yield the proved solutions, and what the other search or the default search finds."""
        asked, rest = (system, metric, interval, known), self._first
        if rest is not None:
            known.are_all = lambda: self.prove_again(*asked) is not None
            yield from starts_of(rest, *asked)
        proof = self.prove_again(*asked)
        for stretch in proof.stretches if proof else ():
            for least, largest in stretch.solutions or ():
                guess = completed(system, 0.5 * (least + largest), stretch.alpha)
                if found := solution_from(system, metric, guess, stretch.alpha, ()):
                    yield found
        if proof and not proof.holds:
            yield from starts_of(default_search(system, interval), *asked)

    def prove_again(
        self, system: PiecewiseSystem, metric: Metric, interval: Range, known: KnownBranches
    ) -> BoxProof | None:
        """Return the proof; after another search, the proof of everything, or nothing."""
        if self._first is None:
            return self.prove(system, metric, interval, known)
        if shown_size(system) <= MANY_UNKNOWNS and not current_budget().is_limited:
            with suppress(InvalidInputError):  # no formula that can be traced
                self.prove(system, metric, interval, known, is_quick=True)
                return self.proved(system, interval)
        return None

    def prove(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        interval: Range,
        known: KnownBranches | None = None,
        *,
        is_quick: bool = False,
    ) -> BoxProof:
        """Return the proof for a system, made once for the same formula, interval and box.

        The default box reaches as far around ``known`` branches as around zero. A quick proof ends
        after little work, and then counts nothing.
        """
        tape = tape_of(system)
        n = tape.size
        ends = self.box or _default_box(system, metric, n, known or KnownBranches())
        if not {np.size(end) for end in ends} <= {1, n}:
            raise InvalidInputError(f"box must broadcast to {n} unknowns, got {self.box}")
        whole = [np.broadcast_to(end, (n,)) for end in ends]
        if (whole[1] - whole[0] > Box.of(system).period[:n] * (1.0 + EPS)).any():
            raise InvalidInputError(f"box must be at most one period wide, got {self.box}")
        box = Interval(*(np.append(*each) for each in zip(whole, interval, strict=True)))
        scale = np.append(metric.scale[:n], interval[1] - interval[0])
        key = [each.tobytes() for each in (box.lo, box.hi, scale)], tape.steps, tape.outputs
        last: BoxProof | None = self._last.get("proof")
        if last and self._is_last(system, interval) and self._last["key"] == key:
            return last
        values = check_tape(tape, system, box)
        most = MOST_BOXES * max(n - 2, 1) ** 2
        most = MOST_WORK // (len(tape.slopes.steps) + BESIDES) if is_quick else most
        with np.errstate(all="ignore"):
            domain = Domain(tape, box, scale)
            found = covered(domain, box[np.newaxis], domain.continues, self.seconds, most)
            proof = replace(counted_proof(domain, *found, is_whole=is_quick), values=values)
        self._last.update(asked=(formula_of(system) or system, interval), key=key, proof=proof)
        return proof

    def _is_last(self, system: PiecewiseSystem, interval: Range) -> bool:
        formula, of = self._last.get("asked", (None, None))
        return formula is (formula_of(system) or system) and of == interval

    def proved(self, system: PiecewiseSystem, interval: Range) -> BoxProof | None:
        """Return the proof of the last run, if the run was of this formula and interval."""
        proof: BoxProof | None = self._last.get("proof")
        is_said = proof is not None and (proof.holds or self._first is None)
        return proof if is_said and self._is_last(system, interval) else None

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Promise nothing more: what is proved, the graph says by its proof."""
        if self._first is not None:
            scope = scope_of(self._first, system)
            words = "; between the ends only if not all branches were proved before"
            words *= shown_size(system) <= MANY_UNKNOWNS
            return SearchScope(scope.what + words, scope.promise)
        box = self.box or "bounds, or 1000 times as far as H becomes nonlinear"
        what = f"all solutions proved in a box of the unknowns ({box})"
        what += f", if within {self.seconds:g} s; where something is open, the default search"
        return SearchScope(what, Guarantee.NOTHING)


def _checked_box(box: Any) -> tuple[Any, Any]:
    """Return both ends as numbers or tuples of numbers, which can be compared."""
    is_pair = isinstance(box, tuple | list) and len(box) == 2
    lower, upper = (finite_array("box", end) for end in (box if is_pair else (1.0, 0.0)))
    fits = {lower.shape, upper.shape} <= {(), (1,), (max(lower.size, upper.size),)}
    if not fits or not (lower < upper).all():
        raise InvalidInputError(f"box must be a pair, least < largest, that fit, got {box!r}")
    ends: Any = [tuple(end.tolist()) if end.ndim else float(end) for end in (lower, upper)]
    return ends[0], ends[1]


def _default_box(
    system: PiecewiseSystem, metric: Metric, size: int, known: KnownBranches
) -> tuple[Array, Array]:
    """Return bounds of the shown unknowns: given, or FAR times as far as H becomes nonlinear.

    Beyond known branches a whole number of reaches: the same box when a run is resumed.
    """
    own, scale = Box.of(system), nonlinear_reach(system, metric)[:size]
    lower, upper, period = (end[:size] for end in (own.lower, own.upper, own.period))
    reach = np.minimum(FAR * scale, 0.5 * period)
    points = [] if np.isfinite(period).any() else [x[:size] for x in known.extremes()]
    far = np.max([np.maximum([-x, x], 0.0) for x in (0.0 * scale, *points)], axis=0)
    least, most = (np.where(far > reach, np.ceil(far / reach), 0.0) + 1.0) * reach
    lower = np.where(np.isfinite(lower), lower, -least)
    return lower, np.minimum(np.where(np.isfinite(upper), upper, most), lower + period)
