"""The quantities that a study measures of each case.

Values are numbers, texts, tuples of numbers and texts, or None if there is nothing to measure, such
as the first fold of a curve without folds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf, isnan
from numbers import Real
from typing import Any, TypeAlias, final

import numpy as np

from pwscont import BranchGraph, InvalidInputError
from pwscont.extending import Kind, short
from pwscont.scenes.panels import quantity_named
from pwscont.studies.problem import Problem, Setting, described, explored


@final
class ExploredCase:
    """A case as a measure sees the case: settings, and graphs that are explored when asked for.

    Parameters
    ----------
    problem : callable
        Settings -> a problem.
    settings : mapping of str to value

    Attributes
    ----------
    settings : mapping of str to value
    guarantee : str
        The guarantee of the first graph, or of the first graph that is not complete.
    is_proven : bool
        Whether all graphs that were asked for are complete.
    failure : BaseException or None
        The error because of which the case has no graph, known once the graph was asked for.
    """

    def __init__(self, problem: Problem, settings: Mapping[str, Setting]) -> None:
        self._problem = problem
        self.settings = settings
        self.guarantee, self.is_proven = "", False
        self.failure: BaseException | None = None

    @cached_property
    def graph(self) -> BranchGraph:
        """The graph of the case; the first access explores the case."""
        if self.failure is None:
            try:
                return self._noted(explored(self._problem(**self.settings)))
            except (Exception, SystemExit) as error:
                self.failure = error
        raise self.failure

    def beside(self, **changed: Setting) -> BranchGraph:
        """Return the graph with some settings changed or added."""
        where = ", ".join(f"{name} = {_word(value)}" for name, value in changed.items())
        return self._noted(explored(self._problem(**{**self.settings, **changed})), where)

    def _noted(self, graph: BranchGraph, where: str = "") -> BranchGraph:
        """Return a graph, after updating the case's guarantee by the graph's."""
        if not self.guarantee or (self.is_proven and not graph.is_complete):
            self.is_proven = graph.is_complete
            at = "" if self.is_proven or not where else f"at {where}: "
            self.guarantee = f"{at}{graph.guarantee}"
        return graph


def _word(value: Setting) -> str:
    return f"{value:.8g}" if isinstance(value, float) else str(value)


Measured: TypeAlias = bool | int | float | str | tuple[Any, ...] | None
#: Default tolerance of a critical value, as a part of the length of the first bracket: nine digits.
BRACKET_PART = 1e-9


class Measure(ABC):
    """The seam for a quantity that a study measures of each case; equal cases have equal values.

    Examples
    --------
    >>> from pwscont import Measure, Study
    >>> class Pieces(Measure):
    ...     def of(self, case):
    ...         return len(case.graph.pieces)
    >>> bar = Study("softening-bar", {"elements": [1]}, {"pieces": Pieces()})
    >>> [row.values["pieces"] for row in bar.run()]
    [3]
    """

    #: The further settings that the measure varies.
    varied: tuple[str, ...] = ()

    @abstractmethod
    def of(self, case: ExploredCase) -> Measured:
        """Return the value for a case.

        Raises
        ------
        InvalidInputError
            If the value cannot be computed; the row of the case then says why.
        """


@final
@dataclass(frozen=True, slots=True)
class OfGraph(Measure):
    """A measure from a function of the graph."""

    function: Callable[[BranchGraph], Any]

    def __str__(self) -> str:
        return described(self.function)

    def of(self, case: ExploredCase) -> Measured:
        """Return the function's value as plain numbers and texts."""
        return plain(self.function(case.graph))


@final
@dataclass(frozen=True, slots=True)
class CountAt(Measure):
    """The number of solutions at one alpha; infinite on a vertical piece.

    Raises
    ------
    InvalidInputError
        If alpha is no finite number.

    Examples
    --------
    >>> from pwscont import CountAt, Study
    >>> bar = Study("softening-bar", {"elements": [1]}, {"asked": CountAt(2.5)})
    >>> [row.values["asked"] for row in bar.run()]
    [3]
    """

    alpha: float

    def __post_init__(self) -> None:
        """Check the parameter."""
        _check_alpha(self.alpha)

    def of(self, case: ExploredCase) -> Measured:
        """Return the number of solutions."""
        return case.graph.count(self.alpha)


@final
@dataclass(frozen=True, slots=True)
class MaxCount(Measure):
    """The largest number of solutions at any alpha of the interval.

    Examples
    --------
    >>> from pwscont import MaxCount, Study
    >>> bar = Study("softening-bar", {"elements": [1]}, {"asked": MaxCount()})
    >>> [row.values["asked"] for row in bar.run()]
    [3]
    """

    def of(self, case: ExploredCase) -> Measured:
        """Return the largest number of solutions, infinite if a piece is vertical."""
        return most_solutions(case.graph)


def most_solutions(graph: BranchGraph) -> int | float:
    """Return the largest number of solutions at any alpha, single values of alpha included."""
    single = (graph.count(alpha) for alpha in graph.breaks())
    return max([*(count for _, _, count in graph.multiplicity()), *single])


@final
@dataclass(frozen=True, slots=True)
class NonUnique(Measure):
    """The intervals of alpha with more than one solution: pairs (lo, hi), ascending.

    Examples
    --------
    >>> from pwscont import NonUnique, Study
    >>> bar = Study("softening-bar", {"elements": [1]}, {"asked": NonUnique()})
    >>> [[round(end, 6) for end in row.values["asked"][0]] for row in bar.run()]
    [[2.25, 3.0]]
    """

    def of(self, case: ExploredCase) -> Measured:
        """Return the intervals; an interval with equal ends is a single alpha."""
        return non_unique(case.graph)


@final
@dataclass(frozen=True, slots=True)
class NonUniqueLength(Measure):
    """The length of all intervals of alpha with more than one solution.

    Examples
    --------
    >>> from pwscont import NonUniqueLength, Study
    >>> bar = Study("softening-bar", {"elements": [1]}, {"asked": NonUniqueLength()})
    >>> [round(row.values["asked"], 6) for row in bar.run()]
    [0.75]
    """

    def of(self, case: ExploredCase) -> Measured:
        """Return the sum of the lengths."""
        return sum((hi - lo for lo, hi in non_unique(case.graph)), 0.0)


def non_unique(graph: BranchGraph) -> tuple[tuple[float, float], ...]:
    """Return the intervals of alpha with more than one solution, neighbours joined."""
    stretches = [(lo, hi) for lo, hi, count in graph.multiplicity() if count > 1]
    single = [(alpha, alpha) for alpha in graph.breaks() if graph.count(alpha) > 1]
    joined: list[tuple[float, float]] = []
    for lo, hi in sorted(stretches + single):
        if joined and lo <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(hi, joined[-1][1]))
        else:
            joined.append((lo, hi))
    return tuple(joined)


@final
@dataclass(frozen=True, slots=True)
class FirstFold(Measure):
    """The smallest alpha of a fold or non-smooth fold; None without folds.

    Examples
    --------
    >>> from pwscont import FirstFold, Study
    >>> bar = Study("softening-bar", {"elements": [1]}, {"asked": FirstFold()})
    >>> [round(row.values["asked"], 6) for row in bar.run()]
    [2.25]
    """

    def of(self, case: ExploredCase) -> Measured:
        """Return alpha of the first fold."""
        graph = case.graph
        folds = [graph.special_points(kind) for kind in (Kind.FOLD, Kind.NONSMOOTH_FOLD)]
        return min((graph.clean(point.alpha) for some in folds for point in some), default=None)


@final
@dataclass(frozen=True, slots=True)
class QuantityAt(Measure):
    """The value of an unknown or a recorded quantity at one alpha.

    Attributes
    ----------
    quantity : str
    alpha : float
    of_all : callable
        Values at all solutions -> the value of the measure: ``max``, ``min``, ``tuple``, ...

    Raises
    ------
    InvalidInputError
        If alpha is no finite number.

    Examples
    --------
    >>> from pwscont import QuantityAt, Study
    >>> bar = Study("softening-bar", {"elements": [1]}, {"force": QuantityAt("force", 2.0)})
    >>> [round(row.values["force"], 6) for row in bar.run()]
    [0.666667]
    """

    quantity: str
    alpha: float
    of_all: Callable[[Iterable[float]], Any] = max

    def __post_init__(self) -> None:
        """Check the parameter."""
        _check_alpha(self.alpha)

    def of(self, case: ExploredCase) -> Measured:
        """Return ``of_all`` of the values at all solutions; None without solutions."""
        graph = case.graph
        quantity_named(self.quantity, graph.names, graph.quantities.record)
        values = [solution[self.quantity] for solution in graph.solutions(self.alpha)]
        return plain(self.of_all(values)) if values else None


def _check_alpha(alpha: Any) -> None:
    if not (isinstance(alpha, Real) and -inf < alpha < inf):  # type: ignore[operator]
        raise InvalidInputError(f"alpha must be a finite number, got {short(repr(alpha))}")


def has_several(graph: BranchGraph) -> bool:
    """Tell whether a graph has more than one solution at some alpha."""
    return most_solutions(graph) > 1


@final
@dataclass(frozen=True, slots=True)
class CriticalValue(Measure):
    """The value of a further setting at which a property of the graph begins, by bisection.

    At every tried value the system is explored, and ``begins`` tells whether the graph has the
    property. The guarantee of the case is the guarantee of the least certain graph: if that graph
    is not complete, the graph may lack solutions.

    Attributes
    ----------
    setting : str
    lo, hi : float
        The first bracket: the property holds at hi and not at lo. If the property does not hold at
        hi, the value is None; if the property holds at lo, the critical value is smaller than lo,
        and the case fails. If the property begins several times in between, bisection finds one of
        these values.
    begins : callable
        BranchGraph -> bool; default whether some alpha has more than one solution.
    tolerance : float, optional
        Longest last bracket, in units of the setting; default 1e-9 times hi - lo.
    bracket : bool
        Whether the value is the last bracket, (lo, hi); default the upper end of the last bracket,
        at which the property holds.

    Raises
    ------
    InvalidInputError
        If lo and hi are not finite numbers with lo < hi, or the tolerance is no positive number.

    Examples
    --------
    >>> from pwscont import LCP, CriticalValue, Study
    >>> def case(coupling, shift):
    ...     return LCP([[1, coupling], [coupling, 1]], q=[-1, shift], d=[1, 0]), (-1.0, 2.0)
    >>> critical = CriticalValue("coupling", 0.5, 2.0, tolerance=0.01, bracket=True)
    >>> (row,) = Study(case, {"shift": [-1.0]}, {"coupling": critical}).run()
    >>> row.values["coupling"]
    (0.998046875, 1.00390625)
    """

    setting: str
    lo: float
    hi: float
    begins: Callable[[BranchGraph], bool] = has_several
    tolerance: float | None = None
    bracket: bool = False

    def __post_init__(self) -> None:
        """Check bracket and tolerance."""
        known, what = self.tolerance, f"critical value of {self.setting}"
        if known is not None and not (isinstance(known, Real) and 0.0 < known < inf):
            words = f"tolerance must be a positive number in units of {self.setting}"
            raise InvalidInputError(f"{what}: {words}, got {short(repr(known))}")
        if not -inf < self.lo < self.hi < inf:
            words = f"lo must be less than hi, and both finite, got {self.lo} and {self.hi}"
            raise InvalidInputError(f"{what}: {words}")

    @property
    def varied(self) -> tuple[str, ...]:  # type: ignore[override]
        """The setting, as the only varied setting."""
        return (self.setting,)

    def of(self, case: ExploredCase) -> Measured:
        """Return the critical value, or the bracket of the critical value."""
        if not self._is_there(case, self.hi):
            return None
        if self._is_there(case, self.lo):
            words = f"{self.setting} = {self.lo:g} is beyond the critical value already"
            raise InvalidInputError(f"{words}: choose a smaller one")
        last = self._bisected(case)
        return last if self.bracket else last[1]

    def _bisected(self, case: ExploredCase) -> tuple[float, float]:
        """Return the last bracket (lo, hi): the property holds at hi and not at lo."""
        lo, hi = float(self.lo), float(self.hi)
        tolerance = self.tolerance or BRACKET_PART * (hi - lo)
        while hi - lo > tolerance:
            middle = 0.5 * (lo + hi)
            if not lo < middle < hi:
                break
            lo, hi = (lo, middle) if self._is_there(case, middle) else (middle, hi)
        return lo, hi

    def _is_there(self, case: ExploredCase, value: float) -> bool:
        return bool(self.begins(case.beside(**{self.setting: value})))


def plain(value: Any) -> Measured:
    """Return a measured value as plain Python objects, equal in files and processes."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(map(plain, value))
    if isinstance(value, float) and isnan(value):
        raise InvalidInputError("it is nan; return None where there is nothing to measure")
    if not (value is None or isinstance(value, bool | int | float | str)):
        words = "a number, a text, several of them, or None"
        raise InvalidInputError(f"it must be {words}, got {short(repr(value))}")
    return value
