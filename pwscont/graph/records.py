"""The records of a branch graph: special points, pieces, solutions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import final

import numpy as np

from pwscont.basics.arrays import Array, largest
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidSystemError
from pwscont.basics.looks import apart, card, counted, short, state
from pwscont.basics.outcome import Kind
from pwscont.basics.quantities import NAMELESS, Quantities
from pwscont.basics.rounding import SAME_ALPHA
from pwscont.graph.place import Place, Track
from pwscont.system.system import PiecewiseSystem

#: Significant digits where the error is rounding.
ALL_DIGITS = 16.0


def significant(error: Array, values: Array, scale: Array) -> float:
    """Return how many decimal digits of ``values`` are significant, by their estimated error.

    Each is measured by its own size or, where that is smaller, by its typical magnitude, so that
    the number does not depend on units; 16 where the error is rounding.
    """
    off = largest(error / np.maximum(np.abs(values), scale))
    return min(ALL_DIGITS, max(0.0, -math.log10(off))) if off > 0.0 else ALL_DIGITS


@final
@dataclass(frozen=True, slots=True, eq=False)
class Accuracy:
    """Tells how many digits of a place are significant, by its error when it is asked for.

    Attributes
    ----------
    scale : ndarray, shape (n + 1,), or None
        Typical magnitudes of (z, alpha).
    known : float
        The number where there are no magnitudes.
    """

    scale: Array | None = None
    known: float = ALL_DIGITS

    def digits(self, place: Place) -> float:
        """Return the number of significant decimal digits."""
        return self.known if self.scale is None else significant(place.error, place.x, self.scale)


ROUNDING = Accuracy()


#: Orientation, +1 or -1 -> message.
Passage = Callable[[int], str]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """Two messages, or one for both orientations."""

    forward: str
    backward: str | None = None

    def __call__(self, orientation: int) -> str:
        """Return the message for an orientation."""
        return self.forward if orientation > 0 or self.backward is None else self.backward


@final
@dataclass(slots=True, eq=False)
class Begun:
    """That tracing began inside a cell, put into words when it is asked for.

    Attributes
    ----------
    system : PiecewiseSystem
        Has the words.
    character : Character
    """

    system: PiecewiseSystem
    character: Character

    def __call__(self, orientation: int) -> str:
        """Return the message."""
        return f"start in {self.system.label(self.character)}"

    def __reduce__(self) -> tuple[type[Said], tuple[str]]:
        return Said, (self(1),)  # copies, also in other processes, have no system


@final
@dataclass(slots=True, eq=False)
class Change:
    """What changes from one cell to another, put into words when it is asked for.

    Attributes
    ----------
    system : PiecewiseSystem
        Has the words.
    before, after : Character
        The cells in the order of the positive orientation.
    note : str
        What else is known.
    """

    system: PiecewiseSystem
    before: Character
    after: Character
    note: str = ""

    def __call__(self, orientation: int) -> str:
        """Return the message for an orientation."""
        cells = (self.before, self.after) if orientation > 0 else (self.after, self.before)
        change = self.system.describe_transition(*cells)
        return f"{change}; {self.note}" if self.note else change

    def __reduce__(self) -> tuple[type[Said], tuple[str, str]]:
        return Said, (self(1), self(-1))  # copies, also in other processes, have no system


#: With fewer significant digits a result says so wherever it is shown.
FEW_DIGITS = 6.0


def _no_error() -> Array:
    return np.zeros(0)


def _value_of(state: SpecialPoint | Solution, name: str) -> float:
    """Return an unknown by the system's name for it, or a recorded quantity.

    Raises
    ------
    UnknownNameError
        If there is no such name; the message names close ones.
    InvalidInputError
        If the function of a recorded quantity fails, or returns no finite float.
    """
    return state.quantities.value(name, state.z, state.alpha)


@final
@dataclass(frozen=True, slots=True, eq=False)
class SpecialPoint:
    """A node of the branch graph.

    ``point["u_t"]`` is an unknown by its name, or a recorded quantity.

    Attributes
    ----------
    id : int
        The id of the node in ``graph.nx``; -1 for a start within a piece, which is no node.
    kind : str
        A :class:`~pwscont.basics.outcome.Kind`, equal to its plain word, such as ``"transition"``
        or ``"nonsmooth fold"``; or a kind of a user's own detector.
    place : Place
        The point (z, alpha) and the estimate of its error.
    passed : callable
        Returns the message for an orientation, +1 or -1.
    piece : int or None
        For a start in the middle of a piece, the id of that piece.
    accuracy : Accuracy
        Tells how many digits are known.
    lost : int
        Number of pieces that leave here and could not be followed.
    quantities : Quantities
        The unknowns and recorded quantities by name.
    events : str
        The names of the events, and the words of users' detectors, that are zero here, where the
        point is of another kind.
    """

    id: int
    kind: str
    place: Place
    passed: Passage
    piece: int | None = None
    accuracy: Accuracy = ROUNDING
    lost: int = 0
    quantities: Quantities = NAMELESS
    events: str = ""

    __getitem__ = _value_of

    @property
    def z(self) -> Array:
        """The state, shape (n,)."""
        return self.place.x[:-1]

    @property
    def alpha(self) -> float:
        """The parameter."""
        return self.place.alpha

    @property
    def error(self) -> Array:
        """Estimate of the error of (z, alpha) from rounding and conditioning, shape (n + 1,)."""
        return self.place.error

    @property
    def digits(self) -> float:
        """Number of significant decimal digits, by the estimate of the error."""
        return self.accuracy.digits(self.place)

    @property
    def message(self) -> str:
        """What happens there when passed in positive orientation.

        For example ``"contact-slip → contact-stick"``.
        """
        return self.passed(1)

    @property
    def backward(self) -> str:
        """The message when passed in negative orientation."""
        return self.passed(-1)

    def asking(self, quantities: Quantities) -> SpecialPoint:
        """Return the same point, whose state is asked by these names."""
        what = self.id, self.kind, self.place, self.passed, self.piece, self.accuracy, self.lost
        return SpecialPoint(*what, quantities, self.events)

    @property
    def name(self) -> str:
        """The names of the events here; empty where there is none."""
        return self.message if self.kind == Kind.EVENT else self.events

    def __repr__(self) -> str:
        what = f"{self.kind}, alpha={self.alpha:.10g}, {_by_name(self)}"
        return f"SpecialPoint({self.id}: {what}{f', {short(self.message)}' * bool(self.message)})"

    def _repr_html_(self) -> str:
        rows = [("alpha", f"{self.alpha:.10g}"), ("state", _by_name(self))]
        more = [("message", short(self.message)), ("digits", f"{self.digits:.3g}")]
        return card(f"SpecialPoint {self.id}: {self.kind}", [*rows, *more])


def _by_name(record: SpecialPoint | Solution) -> str:
    """Return the state of a record with names; a repr does not fail where names do not fit."""
    z = record.z
    try:
        return state(record.quantities.names(len(z)), z)
    except InvalidSystemError:
        return state(NAMELESS.names(len(z)), z)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """An edge of the branch graph: one smooth piece, on which alpha is monotone.

    Attributes
    ----------
    id : int
        Key of the edge in ``graph.nx``.
    start, end : int
        Nodes at both ends, in the direction of positive orientation.
    character : Character
        The frozen character of the selection that the piece solves.
    naming : callable
        Returns the system's name for a character; names are long where there are many parts.
    track : Track
        Points (z, alpha) from start to end; two where the piece is straight.
    det_sign : int
        Sign of det(dH/dz) inside the piece, 0 where it is vertical. Along interfaces the index:
        the sum of the signs of the solutions into which a small change of H splits it, so 0 where
        two solutions of opposite signs coincide.
    """

    id: int
    start: int
    end: int
    character: Character
    naming: Callable[[Character], str]
    track: Track
    det_sign: int

    @property
    def label(self) -> str:
        """The system's name for the character."""
        return self.naming(self.character)

    @property
    def points(self) -> Array:
        """Points (z, alpha) from start to end, shape (k, n + 1)."""
        return self.track.points

    @property
    def z(self) -> Array:
        """The states along the piece, shape (k, n)."""
        return self.points[:, :-1]

    @property
    def alpha(self) -> Array:
        """The parameter along the piece, shape (k,)."""
        return self.track.alpha

    @property
    def interval(self) -> tuple[float, float]:
        """The smallest and the largest alpha of the piece."""
        first, last = self.track.start.alpha, self.track.end.alpha
        return min(first, last), max(first, last)

    @property
    def is_vertical(self) -> bool:
        """Whether all its points have one alpha, so that there are infinitely many solutions."""
        lo, hi = self.interval
        return self.det_sign == 0 and hi - lo <= SAME_ALPHA * max(abs(lo), abs(hi), 1e-300)

    @property
    def _course(self) -> str:
        return f"{self.track.start.alpha:.8g} → {self.track.end.alpha:.8g}"

    def __repr__(self) -> str:
        count = len(self.track.inner) + 2
        where = f"{short(self.label)}, alpha {self._course}"
        return f"Piece({self.id}: {where}, det {self.det_sign:+d}, {count} points)"

    def _repr_html_(self) -> str:
        rows = [("mode", short(self.label)), ("alpha", self._course)]
        more = [("det", f"{self.det_sign:+d}"), ("points", str(len(self.track.inner) + 2))]
        return card(f"Piece {self.id}", [*rows, *more])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """One solution at a given alpha.

    ``solution["u_t"]`` is an unknown by its name, or a recorded quantity.

    Attributes
    ----------
    z : ndarray, shape (n,)
    alpha : float
    character : Character
    label : str
        The system's name for the character.
    det_sign : int
        Sign of det(dH/dz); at a fold 0, the sum of the signs of the solutions that meet.
    piece : int
        The id of the piece that the solution lies on (at a node: of one of several); -1 without a
        graph.
    kind : str or None
        The kind of special point, such as a fold; None inside a piece.
    error : ndarray, shape (n + 1,)
        Estimate of the error of (z, alpha) from rounding and conditioning.
    digits : float
        Number of significant decimal digits, by the estimate of the error.
    quantities : Quantities
        The unknowns and recorded quantities by name.
    """

    z: Array
    alpha: float
    character: Character
    label: str
    det_sign: int
    piece: int
    kind: str | None = None
    error: Array = field(default_factory=_no_error)
    digits: float = 16.0
    quantities: Quantities = NAMELESS

    __getitem__ = _value_of

    def __repr__(self) -> str:
        where = f"{short(self.label)}{f', {self.kind}' if self.kind else ''}"
        what = f"alpha={self.alpha:.10g}, det {self.det_sign:+d}"
        return f"Solution({where}, {what}, {_by_name(self)})"

    def _repr_html_(self) -> str:
        rows = [("mode", short(self.label)), ("state", _by_name(self))]
        more = [("det", f"{self.det_sign:+d}"), ("digits", f"{self.digits:.3g}")]
        title = f"Solution at alpha = {self.alpha:.10g}{f', {self.kind}' if self.kind else ''}"
        return card(title, [*rows, *more])


def attempted(state: SpecialPoint | Solution) -> dict[str, float | str]:
    """Return all recorded quantities of a state; for one that fails, a text that says why."""
    if not state.quantities.record:  # the state itself may have to be computed
        return {}
    return state.quantities.attempted(state.z, state.alpha)


@final
class Stretch(tuple[float, float, int | float]):
    """A stretch of alpha with one number of solutions; unpacks to (lo, hi, count).

    It may be a single value of alpha, and the number may be infinite.

    Attributes
    ----------
    lo_closed, hi_closed : bool
        Whether the number holds at that end as well. At a fold, where two solutions merge, the
        number is in between, and neither neighbour includes the end.
    """

    lo_closed: bool
    hi_closed: bool

    def __new__(
        cls, lo: float, hi: float, count: int | float, lo_closed: bool, hi_closed: bool
    ) -> Stretch:
        """Return the tuple (lo, hi, count) that knows its ends."""
        stretch = super().__new__(cls, (lo, hi, count))
        stretch.lo_closed, stretch.hi_closed = lo_closed, hi_closed
        return stretch

    def __getnewargs__(self) -> tuple[float, float, int | float, bool, bool]:
        return (*self, self.lo_closed, self.hi_closed)

    def __repr__(self) -> str:
        return f"Stretch({self.ends}: {counted(self[2], 'solution')})"

    def _repr_html_(self) -> str:
        return card(f"Stretch {self.ends}", [("solutions", self[2])])

    @property
    def ends(self) -> str:
        """The stretch in the notation of intervals, such as ``[0, 3)``."""
        left, right = "[" if self.lo_closed else "(", "]" if self.hi_closed else ")"
        return f"{left}{', '.join(apart(*self[:2]))}{right}"
