"""Further abilities of systems: a class for each ability, for which every room asks by isinstance.

If a system without the ability has a natural answer, a function beside the class gives the answer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, Indices
from pwscont.basics.character import Character
from pwscont.system.system import PiecewiseSystem
from pwscont.system.values import broken


class Compact:
    """Kept for old systems: nothing asks any more which components of a solution are essential."""


class Ending(ABC):
    """A system whose curves end at some interfaces, as the locus of a transition does.

    Examples
    --------
    >>> from pwscont import PiecewiseLinearSystem, trace
    >>> from pwscont.extending import Ending
    >>> class Fuse(PiecewiseLinearSystem, Ending):
    ...     size = 1
    ...     def test_functions(self, z, alpha):
    ...         return 1.0 - z
    ...     def residual(self, z, alpha, character):
    ...         return z - alpha
    ...     def end(self, character, tests):
    ...         return "the fuse blows" if character.signs[0] else None
    >>> graph = trace(Fuse(), ([0.0], 0.0), (0.0, 2.0))
    >>> [(point.alpha, point.message) for point in graph.special_points("end")]
    [(1.0, 'the fuse blows')]
    """

    @abstractmethod
    def end(self, character: Character, tests: frozenset[int]) -> str | None:
        """Return why a curve in this cell ends where all of ``tests`` vanish.

        None if the curve goes on in another cell. If the curve of a cell ends at a corner, all
        curves that meet at the corner end; from a start at a corner, the curve of every cell is
        followed, and no curve goes on as another.
        """


def end_of(system: PiecewiseSystem, character: Character, tests: frozenset[int]) -> str | None:
    """Return why a curve of a system ends where ``tests`` vanish, None for a curve that goes on."""
    why = system.end(character, tests) if isinstance(system, Ending) else None
    if not (why is None or isinstance(why, str)):
        words = "must return why a curve ends, a text, or None where it goes on"
        raise broken(system, "end", f"{words}, got {why!r}")
    return why


class HidesUnknowns(ABC):
    """A system whose last unknowns follow from the first unknowns, and are hidden from users.

    The methods of the system know all ``size`` unknowns. A user gives and gets the first ``shown``
    unknowns: starts, solutions, special points, names, events, recorded quantities and files. A
    user's own detectors, steppers and searches see all.
    """

    shown: int

    @abstractmethod
    def with_hidden(self, z: Array, alpha: float) -> Array:
        """Return all unknowns, shape (size,), from the shown unknowns, shape (shown,)."""

    def told_apart(self) -> Any:
        """Return the system without unknowns that stand for several alike parts; default self."""
        return self


def shown_size(system: PiecewiseSystem) -> int:
    """Return the number of unknowns that a user knows.

    Examples
    --------
    >>> from pwscont import LCP
    >>> from pwscont.extending import shown_size
    >>> shown_size(LCP([[1.0]], q=[0.0], d=[1.0]))
    1
    """
    return system.shown if isinstance(system, HidesUnknowns) else system.size


def completed(system: PiecewiseSystem, z: Array, alpha: float) -> Array:
    """Return all unknowns from the unknowns that a user knows.

    Examples
    --------
    >>> import numpy as np
    >>> from pwscont import Switched
    >>> from pwscont.extending import completed
    >>> nested = Switched(1, lambda z, t, sw: z - sw.relu(sw.relu(z - t) - 1.0))
    >>> completed(nested, np.array([2.0]), 0.5).size
    2
    """
    return system.with_hidden(z, alpha) if isinstance(system, HidesUnknowns) else z


def completed_point(system: PiecewiseSystem, x: Array) -> Array:
    """Return (z, alpha) with all unknowns from (z, alpha) with the unknowns that a user knows."""
    if not isinstance(system, HidesUnknowns):
        return x
    return np.append(system.with_hidden(x[:-1], float(x[-1])), x[-1])


def shown_points(system: PiecewiseSystem, points: Array) -> Array:
    """Return points (..., z, alpha), or errors of points, without the hidden unknowns."""
    if not isinstance(system, HidesUnknowns) or system.shown == system.size:
        return points
    return np.delete(points, np.s_[system.shown : system.size], axis=-1)


def all_names(system: PiecewiseSystem) -> tuple[str, ...]:
    """Return a name for every unknown, including hidden unknowns.

    Examples
    --------
    >>> from pwscont import Switched
    >>> from pwscont.extending import all_names
    >>> all_names(Switched(1, lambda z, t, sw: z - sw.relu(sw.relu(z - t) - 1.0)))
    ('z[0]', 'hidden[0]')
    """
    names = tuple(system.names())
    return (*names, *(f"hidden[{i}]" for i in range(system.size - len(names))))


class BringsSearches(ABC):
    """A system that offers special searches.

    :func:`pwscont.explore` adds the searches to the default search if trying every cell would take
    too long.
    """

    @abstractmethod
    def searches(self) -> Sequence[Any]:
        """Return these searches, each a :class:`~pwscont.Search`."""


class DecidesCorners(ABC):
    """A system that may know that a corner has one ray at most to either side of alpha."""

    @abstractmethod
    def has_one_ray(self, z: Array, alpha: float, zero: frozenset[int]) -> bool:
        """Tell whether at most one ray leads to each side of alpha, and none keeps alpha.

        Asked where the cells that meet at the corner, at which the tests ``zero`` vanish, are too
        many to be tried; False where that is not known.
        """


@final
@dataclass(frozen=True, slots=True, eq=False)
class ExactMode:
    """The equations and inequalities of one mode of a part of a system, as rows of doubles.

    A row has n + 2 entries: coefficients of z, of alpha, and a constant.
    """

    equations: Array  #: Shape (k, n + 2): each row times (z, alpha, 1) is zero.
    sides: Array  #: Shape (s, n + 2): each row times (z, alpha, 1) is not negative.


class ExactData(ABC):
    """A system of linear pieces that hands over its data as exact numbers, for proofs."""

    @abstractmethod
    def exact_rows(self, alpha: float) -> tuple[Array, Sequence[Sequence[ExactMode]]]:
        """Return the rows common to all modes, shape (k, n + 2), and for every part its modes.

        A solution at alpha solves the common rows, and for every part the equations and
        inequalities of at least one mode. All numbers count as exact.
        """

    def exact_lines(self) -> tuple[Array, Sequence[Sequence[ExactMode]]] | None:
        """Return rows that hold at every alpha, None where rows are not affine in alpha."""
        return None


class ExactRates(ABC):
    """A system with memory that hands over its law of friction as exact numbers, for proofs."""

    @abstractmethod
    def exact_rates(self) -> tuple[Array, Array, Array, Array]:
        """Return A (n, n), N and T (p, n), and F (p,) of contact with friction."""


class GivesFormula(ABC):
    """A system made from a function f(z, alpha, sw) of a user, which proofs evaluate anew."""

    @property
    @abstractmethod
    def formula(self) -> Any:
        """The user's function of (z, alpha, sw)."""


def formula_of(system: PiecewiseSystem) -> Any:
    """Return the formula of a system, None for a system that is a class of its own."""
    return system.formula if isinstance(system, GivesFormula) else None


class Reducible(ABC):
    """A system that may know a smaller system with the same solutions."""

    @abstractmethod
    def reduction(self, lo: float, hi: float) -> Reduction | None:
        """Return the smaller system for alpha in [lo, hi], None if there is none.

        A part may be left out only if the part provably stays in the same mode on the whole
        interval.
        """


class Recovery(ABC):
    """How the unknowns that a reduction left out follow from the unknowns of the smaller system."""

    @abstractmethod
    def points(self, points: Array) -> Array:
        """Return points (..., z, alpha) of the full system from those of the smaller system."""

    @abstractmethod
    def errors(self, errors: Array) -> Array:
        """Return errors of points of the full system from those of the smaller system."""

    @abstractmethod
    def state(self, z: Array) -> Array:
        """Return the state of the smaller system of a state of the full system."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """A smaller system, without the parts that provably stay in the same mode."""

    system: PiecewiseSystem  #: The smaller system.
    kept: Indices  #: The places of the smaller system's unknowns in the full system.
    tests: Indices  #: The places of the smaller system's test functions in the full system.
    idle: Character  #: A character of the full system with the signs of the parts left out.
    reasons: tuple[str, ...]  #: For every part left out, the proof in words.
    #: How unknowns that are left out follow from the kept unknowns; default: zero.
    recovery: Recovery | None = None

    def points(self, points: Array, size: int, *, are_errors: bool = False) -> Array:
        """Return points (..., z, alpha), or errors, with the unknowns left out put back."""
        if self.recovery:
            return self.recovery.errors(points) if are_errors else self.recovery.points(points)
        full = np.zeros((*points.shape[:-1], size + 1))
        full[..., self.kept], full[..., -1] = points[..., :-1], points[..., -1]
        return full

    def state(self, z: Array) -> Array:
        """Return the unknowns that remain of a state of the full system."""
        return self.recovery.state(z) if self.recovery else z[self.kept]

    def character(self, character: Character) -> Character:
        """Return the character of the full system."""
        signs = self.idle.array.copy()
        signs[self.tests] = character.array
        return Character.of(np.where(signs, 1.0, -1.0))


#: The abilities that a system of a user may have, for :func:`check_abilities`.
ABILITIES = (Ending, Reducible, BringsSearches, HidesUnknowns, DecidesCorners, ExactData)


def check_abilities(system: PiecewiseSystem) -> None:
    """Refuse a method that is never called, as the system does not derive from the ability."""
    kind = type(system)
    for ability in ABILITIES:
        for method in sorted(ability.__abstractmethods__):
            if callable(getattr(kind, method, None)) and not isinstance(system, ability):
                words = f"would never be called, for {kind.__name__} does not derive from"
                what = f"pwscont.extending.{ability.__name__}: let it, or give the method"
                raise broken(system, method, f"{words} {what} another name")
