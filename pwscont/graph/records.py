"""The records of a branch graph: places, special points, pieces, solutions.

A place is a point (z, alpha) with the estimate of its error. Only the first digits of an estimated
error mean anything, and a place keeps only these digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import final

import numpy as np
import numpy.typing as npt

from pwscont.basics.arrays import Array, largest
from pwscont.basics.character import Character
from pwscont.basics.outcome import Kind
from pwscont.basics.printing import apart, card, counted, short
from pwscont.basics.quantities import NAMELESS, Quantities
from pwscont.basics.rounding import CONFIDENCE, SAME_ALPHA

#: Number of low bits of a double that are dropped: sign, exponent and four binary digits remain.
DROPPED_BITS = np.uint64(48)
#: The integer that is added to the bits of a double before the low bits are dropped, to round up.
ROUND_UP = np.uint64(2**48 - 1)
#: The first digits of estimated errors, see :func:`first_digits`.
Digits = npt.NDArray[np.uint16]
#: The id of a start within a piece, which is no node of the graph.
NO_NODE = -1


@final
class Place:
    """A point x = (z, alpha), not to be written to, with the estimated error of each component."""

    __slots__ = ("_digits", "x")

    def __init__(self, x: Array, error: Array) -> None:
        self.x, self._digits = x, first_digits(error)

    @property
    def alpha(self) -> float:
        """The parameter."""
        return float(self.x[-1])

    @property
    def error(self) -> Array:
        """The estimated error, rounded up to the first digits, shape (n + 1,)."""
        return from_first_digits(self._digits)


def first_digits(error: Array) -> Digits:
    """Return estimated errors, not negative, in two bytes each, rounded up by at most 6 %."""
    bits = np.asarray(error, dtype=float).view(np.uint64)
    return ((bits + ROUND_UP) >> DROPPED_BITS).astype(np.uint16)


def from_first_digits(digits: Digits) -> Array:
    """Return the estimated errors that :func:`first_digits` stored."""
    return (digits.astype(np.uint64) << DROPPED_BITS).view(np.float64)


#: Significant digits where the error is rounding.
ALL_DIGITS = 16.0
#: With fewer significant digits a result says so wherever it is shown.
FEW_DIGITS = 6.0


def significant(error: Array, values: Array, scale: Array) -> float:
    """Return how many digits of ``values`` are significant, by the error in typical magnitudes."""
    off = largest(error / np.maximum(np.abs(values), scale))
    return min(ALL_DIGITS, max(0.0, -math.log10(off))) if off > 0.0 else ALL_DIGITS


def _value_of(state: SpecialPoint | Solution, name: str) -> float:
    """Return an unknown by the name that the system gives, or a recorded quantity."""
    return state.quantities.value(name, state.z, state.alpha)


@final
@dataclass(frozen=True, slots=True, eq=False)
class SpecialPoint:
    """A node of the branch graph.

    ``point["u_t"]`` is an unknown by name, or a recorded quantity.

    Attributes
    ----------
    id : int
        The id of the node in ``graph.nx``; -1 for a start within a piece, which is no node.
    kind : str
        A :class:`~pwscont.basics.outcome.Kind`, equal to a plain word, such as ``"transition"``
        or ``"nonsmooth fold"``; or a kind of a user's own detector.
    place : Place
        The point (z, alpha) and the estimated error.
    message : str
        What happens at the point when passed in positive orientation, for example
        ``"contact-slip → contact-stick"``.
    backward : str
        The message when passed in negative orientation.
    piece : int or None
        For a start in the middle of a piece, the id of that piece.
    digits : float
        Number of significant decimal digits, by the estimate of the error.
    lost : int
        Number of pieces that leave here and could not be followed.
    quantities : Quantities
        The unknowns and recorded quantities by name.
    events : str
        The names of the events, and the words of users' detectors, that are zero here, where the
        point is of another kind.

    Examples
    --------
    >>> from pwscont import LCP, explore
    >>> graph = explore(LCP([[2.0]], q=[0.0], d=[-1.0]), (-1.0, 1.0))
    >>> [(str(point.kind), point.alpha) for point in graph.special_points()]
    [('start', -1.0), ('transition', 0.0), ('end', 1.0)]
    """

    id: int
    kind: str
    place: Place
    message: str
    backward: str
    piece: int | None = None
    digits: float = ALL_DIGITS
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

    def passed(self, orientation: int) -> str:
        """Return the message for an orientation, +1 or -1."""
        return self.message if orientation > 0 else self.backward

    @property
    def name(self) -> str:
        """The names of the events here; empty where there is none."""
        return self.message if self.kind == Kind.EVENT else self.events

    def __repr__(self) -> str:
        what = f"{self.kind}, alpha={self.alpha:.10g}, {self.quantities.in_words(self.z)}"
        return f"SpecialPoint({self.id}: {what}{f', {short(self.message)}' * bool(self.message)})"

    def _repr_html_(self) -> str:
        rows = [("alpha", f"{self.alpha:.10g}"), ("state", self.quantities.in_words(self.z))]
        rows += [("message", short(self.message)), ("digits", f"{self.digits:.3g}")]
        return card(f"SpecialPoint {self.id}: {self.kind}", rows)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """An edge of the branch graph: one smooth piece, on which alpha is monotone.

    Attributes
    ----------
    id : int
        Key of the edge in ``graph.nx``.
    start, end : int
        Nodes at the two ends, in the direction of positive orientation.
    character : Character
        The frozen character of the selection that the piece solves.
    naming : callable
        Returns the system's name for a character; names are long where there are many parts.
    points : ndarray, shape (k, n + 1)
        Points (z, alpha) from start to end; two where the piece is straight.
    det_sign : int
        Sign of det(dH/dz) inside the piece, 0 on a vertical piece. Along interfaces the index: the
        sum of the signs of the solutions into which a small change of H splits the piece, so 0
        where two solutions of opposite signs coincide.

    Examples
    --------
    >>> from pwscont import LCP, explore
    >>> graph = explore(LCP([[2.0]], q=[0.0], d=[-1.0]), (-1.0, 1.0))
    >>> [(piece.label, piece.det_sign, len(piece.points)) for piece in graph.pieces]
    [('at its lower bound: z[0]', 1, 2), ('above its lower bound: z[0]', 1, 2)]
    """

    id: int
    start: int
    end: int
    character: Character
    naming: Callable[[Character], str]
    points: Array
    det_sign: int

    @property
    def label(self) -> str:
        """The system's name for the character."""
        return self.naming(self.character)

    @property
    def z(self) -> Array:
        """The states along the piece, shape (k, n)."""
        return self.points[:, :-1]

    @property
    def alpha(self) -> Array:
        """The parameter along the piece, shape (k,)."""
        return self.points[:, -1]

    @property
    def interval(self) -> tuple[float, float]:
        """The smallest and the largest alpha of the piece."""
        first, last = self.alpha[[0, -1]].tolist()
        return min(first, last), max(first, last)

    @property
    def is_vertical(self) -> bool:
        """Whether all points have one alpha, so that there are infinitely many solutions."""
        lo, hi = self.interval
        return self.det_sign == 0 and hi - lo <= SAME_ALPHA * max(abs(lo), abs(hi), 1e-300)

    @property
    def _course(self) -> str:
        return f"{self.alpha[0]:.8g} → {self.alpha[-1]:.8g}"

    def __repr__(self) -> str:
        where = f"{short(self.label)}, alpha {self._course}"
        return f"Piece({self.id}: {where}, det {self.det_sign:+d}, {len(self.points)} points)"

    def _repr_html_(self) -> str:
        rows = [("mode", short(self.label)), ("alpha", self._course)]
        more = [("det", f"{self.det_sign:+d}"), ("points", str(len(self.points)))]
        return card(f"Piece {self.id}", [*rows, *more])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """One solution at a given alpha.

    ``solution["u_t"]`` is an unknown by name, or a recorded quantity.

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
        The id of the piece on which the solution lies (at a node: the first of the pieces there);
        -1 without a graph.
    kind : str or None
        The kind of special point, such as a fold; None inside a piece.
    error : ndarray, shape (n + 1,)
        Estimate of the error of (z, alpha) from rounding and conditioning.
    digits : float
        Number of significant decimal digits, by the estimate of the error.
    quantities : Quantities
        The unknowns and recorded quantities by name.

    Examples
    --------
    >>> from pwscont import LCP, explore
    >>> graph = explore(LCP([[2.0]], q=[0.0], d=[-1.0]), (-1.0, 1.0))
    >>> (solution,) = graph.solutions(0.5)
    >>> solution["z[0]"], solution.det_sign, solution.label
    (0.25, 1, 'above its lower bound: z[0]')
    """

    z: Array
    alpha: float
    character: Character
    label: str
    det_sign: int
    piece: int
    kind: str | None = None
    error: Array = field(default_factory=lambda: np.zeros(0))
    digits: float = 16.0
    quantities: Quantities = NAMELESS

    __getitem__ = _value_of

    def __repr__(self) -> str:
        where = f"{short(self.label)}{f', {self.kind}' if self.kind else ''}"
        what = f"alpha={self.alpha:.10g}, det {self.det_sign:+d}"
        return f"Solution({where}, {what}, {self.quantities.in_words(self.z)})"

    def _repr_html_(self) -> str:
        rows = [("mode", short(self.label)), ("state", self.quantities.in_words(self.z))]
        more = [("det", f"{self.det_sign:+d}"), ("digits", f"{self.digits:.3g}")]
        title = f"Solution at alpha = {self.alpha:.10g}{f', {self.kind}' if self.kind else ''}"
        return card(title, [*rows, *more])


def are_one(a: SpecialPoint | Solution, b: SpecialPoint | Solution) -> bool:
    """Tell whether the estimated errors of two states explain their difference."""
    errors = a.error + b.error if len(a.error) and len(b.error) else np.zeros(len(a.z) + 1)
    return bool((np.abs(a.z - b.z) <= CONFIDENCE * errors[:-1]).all())


def attempted(state: SpecialPoint | Solution) -> dict[str, float | str]:
    """Return all recorded quantities of a state; a text says why a quantity fails."""
    if not state.quantities.record:  # the state itself may have to be computed
        return {}
    return state.quantities.attempted(state.z, state.alpha)


@final
class Stretch(tuple[float, float, int | float]):
    """A stretch of alpha with one number of solutions; unpacks to (lo, hi, count).

    A stretch may be a single value of alpha, and the number may be infinite.

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
        """Return the tuple (lo, hi, count) with the ends marked as closed or open."""
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
    def lo(self) -> float:
        """The least alpha."""
        return self[0]

    @property
    def hi(self) -> float:
        """The largest alpha."""
        return self[1]

    @property
    def count(self) -> int | float:  # type: ignore[override]  # tuple.count is of no use here
        """The number of solutions."""
        return self[2]

    @property
    def ends(self) -> str:
        """The stretch in the notation of intervals, such as ``[0, 3)``."""
        left, right = "[" if self.lo_closed else "(", "]" if self.hi_closed else ")"
        return f"{left}{', '.join(apart(*self[:2]))}{right}"
