"""The seam of searches, and what a search may ask about branches that are known."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arguments import wrong_result
from pwscont.basics.arrays import Array, finite_array
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.basics.outcome import Guarantee, SearchScope
from pwscont.basics.printing import at, short
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.curve.error_samples import Found
from pwscont.curve.metric import Metric, Range
from pwscont.graph.proved import Proof
from pwscont.system.selection import unexplained
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem


@final
class KnownBranches:
    """The branches of a run so far, which a search need not find again; none at first.

    Between the stored points of a piece a branch is taken for a straight line.
    """

    def __init__(self) -> None:
        #: Returns the character and the points (z, alpha) of every piece, shape (k, n + 1).
        self.followed: Callable[[], Iterable[tuple[Character, Array]]] = lambda: ()
        #: Tells whether it is proved that there are no others, so that no search is needed.
        self.are_all: Callable[[], bool] = lambda: False
        #: Whether a search was given up because of the number of solutions.
        self.is_left_off = False

    def pieces(self) -> Iterable[Array]:
        """Return the points (z, alpha) of every piece, each of shape (k, n + 1)."""
        return (points for _, points in self.followed())

    def at(self, alpha: float) -> list[Array]:
        """Return a point (z, alpha) near each known solution."""
        return [x for _, x in self.in_cells_at(alpha)]

    def in_cells_at(self, alpha: float) -> list[tuple[Character, Array]]:
        """Return a point (z, alpha) near each known solution, after the character of the piece."""
        found = []
        for character, points in self.followed():
            sides = np.sign(points[:, -1] - alpha)
            found += [(character, points[i]) for i in np.flatnonzero(sides == 0.0)]
            for i in np.flatnonzero(sides[1:] * sides[:-1] < 0.0):
                a, b = points[i], points[i + 1]
                found.append((character, a + (alpha - a[-1]) / (b[-1] - a[-1]) * (b - a)))
        return found

    def extremes(self) -> list[Array]:
        """Return the points of pieces at which alpha or an unknown is extremal, each once."""
        found = []
        for points in self.pieces():
            numbers = {*points.argmin(axis=0).tolist(), *points.argmax(axis=0).tolist()}
            found += [points[i] for i in sorted(numbers)]
        return found

    def leave_off(self) -> None:
        """Note that a search is given up because of the number of solutions."""
        self.is_left_off = True


#: The values that a search should yield, in words, for errors about values that are nearly right.
WANTED = (
    "wanted are pairs (x, error) of a solution x = np.append(z, alpha) and an estimate of its "
    "error, of the same shape, as semismooth_newton returns them"
)

#: Largest test that may be zero, as a part of the sum of the magnitudes of the terms, taken at z
#: plus typical magnitudes.
NEARLY_ZERO_TEST = 1e-6


class Search(ABC):
    """Finds solutions from which components can be traced; searches add up with ``+``.

    Examples
    --------
    >>> from pwscont import EndPoints, Search, Switched, explore
    >>> from pwscont.extending import Failure, Guarantee, SearchScope, semismooth_newton
    >>> class FromAbove(Search):
    ...     def starts(self, system, metric, interval):
    ...         found = semismooth_newton(system, metric, metric.scale[:-1], sum(interval) / 2)
    ...         if not isinstance(found, Failure):
    ...             yield found
    ...     def searched(self, system):
    ...         return SearchScope("Newton from above", Guarantee.NOTHING)
    >>> ring = Switched(1, lambda z, t, sw: z**2 + t**2 - 1)
    >>> graph = explore(ring, (-2.0, 2.0), search=EndPoints() + FromAbove())
    >>> graph.count(0.0), graph.searched.what
    (2, 'Newton once per cell at both ends; Newton from above')
    """

    @abstractmethod
    def starts(
        self, system: PiecewiseSystem, metric: Metric, interval: tuple[float, float]
    ) -> Iterator[Found]:
        """Yield solutions (z, alpha) with errors; a component may be hit repeatedly.

        What does not solve H nearly to rounding is left out, which the graph says.
        """

    def starts_beside(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        interval: tuple[float, float],
        known: KnownBranches,
    ) -> Iterator[Found]:
        """Yield starts as :meth:`starts` does; starts on known branches may be left out.

        The branches through a start are known when the next start is asked for. Default: the
        same starts as :meth:`starts`.
        """
        return self.starts(system, metric, interval)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Return the work of this search for a system, in words, and the promise.

        Default: the name of the class, and no promise.
        """
        return SearchScope(type(self).__name__, Guarantee.NOTHING)

    def proved(self, system: PiecewiseSystem, interval: tuple[float, float]) -> Proof | None:
        """Return what the last run of the search proved of a system; default nothing."""
        return None

    def prove_again(
        self,
        system: PiecewiseSystem,
        metric: Metric,
        interval: tuple[float, float],
        known: KnownBranches,
    ) -> Proof | None:
        """Return what a run proves that did not ask for starts, as with a journal; default none."""
        return None

    def __add__(self, other: Search) -> Search:
        if not isinstance(other, Search):
            hint = "; call it to make one" if isinstance(other, type) else ""
            raise InvalidInputError(
                f"{type(self).__name__} + {other!r}: searches add up with searches{hint}"
            )
        return CombinedSearch(self, other)


@final
@dataclass(frozen=True, slots=True)
class CombinedSearch(Search):
    """Two searches in turn."""

    first: Search
    second: Search

    def starts(self, system: PiecewiseSystem, metric: Metric, interval: Range) -> Iterator[Found]:
        """Yield what the first finds, then what the second finds."""
        return self.starts_beside(system, metric, interval, KnownBranches())

    def starts_beside(
        self, system: PiecewiseSystem, metric: Metric, interval: Range, known: KnownBranches
    ) -> Iterator[Found]:
        """Yield what the first finds, then what the second finds."""
        yield from starts_of(self.first, system, metric, interval, known)
        yield from starts_of(self.second, system, metric, interval, known)

    def proved(self, system: PiecewiseSystem, interval: Range) -> Proof | None:
        """Return what either search proved."""
        first = self.first.proved(system, interval)
        return first if first is not None else self.second.proved(system, interval)

    def prove_again(
        self, system: PiecewiseSystem, metric: Metric, interval: Range, known: KnownBranches
    ) -> Proof | None:
        """Return what either search proves."""
        first = self.first.prove_again(system, metric, interval, known)
        return first or self.second.prove_again(system, metric, interval, known)

    def searched(self, system: PiecewiseSystem) -> SearchScope:
        """Return the two descriptions and the better promise."""
        a, b = scope_of(self.first, system), scope_of(self.second, system)
        return SearchScope(f"{a.what}; {b.what}", max(a.promise, b.promise))


def checked_proof(search: Search, proof: Any) -> Proof | None:
    """Return what a search proved, or refuse what is no proof."""
    is_object = not isinstance(proof, type) and callable(getattr(proof, "judged", None))
    if proof is None or is_object:
        return proof
    raise wrong_result(search, "proved", "None, or an object with judged(graph, words)", proof)


def scope_of(search: Search, system: PiecewiseSystem) -> SearchScope:
    """Return the scope of a search for a system, or refuse what is no SearchScope."""
    scope = search.searched(system)
    if not isinstance(scope, SearchScope):
        raise InvalidInputError(
            f"{type(search).__name__}.searched must return a SearchScope(what, promise), "
            f"got {short(repr(scope))}"
        )
    return scope


def starts_of(
    search: Search, system: PiecewiseSystem, metric: Metric, interval: Range, known: KnownBranches
) -> Iterator[Found]:
    """Yield what a search finds beside known branches, or refuse what is no start, by name."""
    what = f"{type(search).__name__}.starts"
    found = search.starts_beside(system, metric, interval, known)
    if not isinstance(found, Iterable):
        raise InvalidInputError(f"{what} must yield pairs (x, error), got {short(repr(found))}")
    for start in found:
        x, error = _checked(what, start, system.size, interval)
        if isinstance(system, SlicewiseLinearSystem) and np.isfinite(error).all():
            _refuse_off_curve(what, system, x, error, metric.scale)
        yield x, error


def _checked(what: str, start: Any, size: int, interval: Range) -> Found:
    """Return a pair (x, error) of arrays with x in the interval; refuse any other start."""
    if isinstance(start, np.ndarray) and start.shape == (size + 1,):
        raise InvalidInputError(f"{what} yields x, {short(repr(start))}: {WANTED}")
    if not (isinstance(start, tuple | list) and len(start) == 2):
        raise InvalidInputError(f"{what} must yield pairs (x, error), got {short(repr(start))}")
    x, error = start
    try:
        error = np.asarray(error, dtype=float)
    except (TypeError, ValueError) as why:
        got = f"an error that is no array of numbers, {short(repr(error))}"
        raise InvalidInputError(f"{what} yields {got}: {WANTED}") from why
    if not error.ndim:
        raise InvalidInputError(f"{what} yields a pair (z, alpha), {short(repr(start))}: {WANTED}")
    is_sampled = error.size and error.ndim <= 2 and error.shape[-1] == size + 1
    if np.shape(x) != (size + 1,) or not is_sampled:
        raise InvalidInputError(
            f"{what} must yield pairs (x, error) with x = (z, alpha) of shape ({size + 1},) and "
            f"error of shape (k, {size + 1}), k > 0, got shapes {np.shape(x)} and {error.shape}"
        )
    x, (lo, hi) = finite_array(f"x of {what}", x), interval
    beyond = SAME_ALPHA * max(abs(lo), abs(hi))
    if not lo - beyond <= x[-1] <= hi + beyond:
        raise InvalidInputError(
            f"{what} yields a start at alpha = {x[-1]:.8g}, outside the interval [{lo}, {hi}]"
        )
    if np.isnan(error).any():
        raise InvalidInputError(f"{what} yields an error that is nan, at {at(x)}: {WANTED}")
    return x, error


def _refuse_off_curve(
    what: str, system: PiecewiseSystem, x: Array, error: Array, scale: Array
) -> None:
    """Refuse a start off the curve by more than its error: straight pieces would run beside."""
    z, alpha = x[:-1], float(x[-1])
    near = NEARLY_ZERO_TEST * (abs(system.test_jacobian(z, alpha)) @ (np.abs(x) + scale))
    if (np.abs(system.test_functions(z, alpha)) <= near).any():
        return  # the cell may be a matter of rounding
    if off := unexplained(system, system.character(z, alpha), x, scale, error):
        raise InvalidInputError(
            f"{what} yields a point off the curve, at {at(x)}: H is {off:.0e}, more than its error "
            "explains; correct it by semismooth_newton, and try check_search"
        )
