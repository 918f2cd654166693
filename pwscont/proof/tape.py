"""The tape of a formula: the elementary operations of f(z, alpha, sw), written down once.

The formula is called with arrays of :class:`Traced` objects. numpy hands every operation on such an
array to the nodes, and every node writes the operation on the tape.

Failure modes and answers
-------------------------
- The formula decides by a value (a comparison, ``np.floor``, ``float(alpha)``): refused in words.
- The formula calls what no node knows (a table, a solver, complex numbers): refused in words.
- The formula hides a decision from the nodes: the tape is compared with the formula at many points.
- A clip with a lower bound above the upper bound, and a jump of ``sw.where``, have no derivative:
  the tape marks both, and no tube is proved there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite, isinf
from numbers import Real
from typing import Any, NoReturn, final

import numpy as np

from pwscont.basics.errors import InvalidInputError
from pwscont.proof.functions import ELEMENTARY

#: Largest whole number that is taken as a power by repeated multiplication.
LARGEST_POWER = 64


class NotTracedError(TypeError):
    """A formula does what a tape cannot hold."""


@final
@dataclass(frozen=True, slots=True)
class Step:
    """One operation of a tape.

    Attributes
    ----------
    name : str
    args : tuple of int
        The places of the arguments on the tape.
    number : float
        The value of a constant, the power of a power, the number of a variable.
    """

    name: str
    args: tuple[int, ...] = ()
    number: float = 0.0


@final
@dataclass(slots=True, eq=False)
class Tape:
    """The operations of a formula, arguments first.

    Attributes
    ----------
    size : int
        The number of unknowns n; the variables are z[0], ..., z[n - 1], alpha.
    steps : list of Step
    outputs : list of int
        The places of the n entries of the formula.
    """

    size: int
    steps: list[Step] = field(default_factory=list)
    outputs: list[int] = field(default_factory=list)
    _places: dict[Step, int] = field(default_factory=dict)

    def place(self, step: Step) -> int:
        """Return the place of an operation, which is written down once."""
        if step not in self._places:
            self._places[step] = len(self.steps)
            self.steps.append(step)
        return self._places[step]

    def node(self, name: str, *args: Any, number: float = 0.0) -> Traced:
        """Write an operation down and return the node of the result."""
        places = tuple(self.place_of(each) for each in args)
        return Traced(self, self.place(Step(name, places, number)))

    def place_of_variable(self, number: int) -> int:
        """Return the place of a variable."""
        return next(
            i
            for i, step in enumerate(self.steps)
            if step.name == "variable" and step.number == number
        )

    def place_of(self, thing: Any) -> int:
        """Return the place of a node or of a constant."""
        if isinstance(thing, Traced):
            return thing.place
        return self.place(Step("constant", (), _exact(thing)))


def _exact(thing: Any) -> float:
    """Return a real number as a float, or refuse a number that a float does not hold."""
    if not isinstance(thing, Real | np.bool_) or float(thing) != thing or not isfinite(thing):
        raise NotTracedError(f"{thing!r} is no real number that a float holds exactly")
    return float(thing)


def _refuse(what: str, better: str) -> Callable[..., NoReturn]:
    def refuse(*args: Any) -> NoReturn:
        raise NotTracedError(
            f"the formula takes {what} something that depends on (z, alpha){better}"
        )

    return refuse


ADVICE = ": write the decision with the switches of sw"


@final
class Traced:
    """A number on a tape, with the arithmetic of numbers."""

    __slots__ = ("place", "tape")

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape, self.place = tape, place

    @property
    def step(self) -> Step:
        """The operation that makes the number."""
        return self.tape.steps[self.place]

    def _with(self, name: str, *args: Any) -> Any:
        """Write an operation down; an array does the operation for every entry."""
        if any(isinstance(each, np.ndarray) for each in args):
            return NotImplemented
        return self.tape.node(name, *args)

    def __neg__(self) -> Any:
        return self.tape.node("negative", self)

    def __pos__(self) -> Traced:
        return self

    def __add__(self, other: Any) -> Any:
        if _is_number(other) and (other == 0.0 or isinf(other)):
            return other if other else self
        return self._with("add", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if _is_number(other) and (other == 0.0 or isinf(other)):
            return -other if other else self
        return self._with("subtract", self, other)

    def __rsub__(self, other: Any) -> Any:
        if _is_number(other) and (other == 0.0 or isinf(other)):
            return other if other else -self
        return self._with("subtract", other, self)

    def __mul__(self, other: Any) -> Any:
        if _is_number(other) and other == 1.0:
            return self
        if _is_number(other) and other == 0.0 and self.step.name == "variable":
            return 0.0
        if isinstance(other, Traced) and other.place == self.place:
            return self.tape.node("power", self, number=2.0)
        return self._with("multiply", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self._with("divide", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._with("divide", other, self)

    def __pow__(self, power: Any) -> Any:
        if isinstance(power, np.ndarray):
            return NotImplemented
        if not _is_number(power):
            return (power * self.log()).exp()
        if float(power).is_integer() and abs(power) <= LARGEST_POWER:
            return self.tape.node("power", self, number=float(power))
        return self.sqrt() if power == 0.5 else (_exact(power) * self.log()).exp()

    def __rpow__(self, base: Any) -> Any:
        if isinstance(base, np.ndarray):
            return NotImplemented
        return (self * self.tape.node("log", base)).exp()

    def square(self) -> Any:
        """Return the square, as numpy asks for it."""
        return self * self

    def hypot(self, other: Any) -> Any:
        """Return the root of the sum of two squares."""
        return (self * self + other * other).sqrt()

    def log2(self) -> Any:
        """Return the logarithm to base 2."""
        return self.log() / self.tape.node("log", 2.0)

    def log10(self) -> Any:
        """Return the logarithm to base 10."""
        return self.log() / self.tape.node("log", 10.0)

    def exp2(self) -> Any:
        """Return the power of 2."""
        return 2.0**self

    def conjugate(self) -> Traced:
        """Return the number itself, which is real."""
        return self

    def copy(self) -> Traced:
        """Return the number itself, which never changes."""
        return self

    def __getattr__(self, name: str) -> Any:
        """Return an elementary function, as numpy asks for it by its name."""
        if name not in ELEMENTARY:
            raise AttributeError(f"{name} is not known to the tape")
        return lambda: self.tape.node(name, self)

    __hash__ = None  # type: ignore[assignment]
    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = _refuse("a decision by", ADVICE)
    __eq__ = __ne__ = _refuse("a decision by", ADVICE)
    __abs__ = _refuse("the magnitude of", ": write sw.abs")
    __float__ = __int__ = __index__ = __complex__ = _refuse("the plain number of", "")
    __floor__ = __ceil__ = __trunc__ = __round__ = _refuse("the whole part of", "")
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = _refuse("a remainder of", "")


def _is_number(thing: Any) -> bool:
    return isinstance(thing, Real)


@final
class TracedSwitches:
    """The switches ``sw`` of a formula that is traced; every entry is a step of its own."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    def _each(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return np.frompyfunc(function, len(arguments), 1)(*arguments)

    def max(self, a: Any, b: Any) -> Any:
        """Return the larger of two quantities."""
        return self._each(lambda x, y: self._tape.node("max", x, y), a, b)

    def min(self, a: Any, b: Any) -> Any:
        """Return the smaller of two quantities."""
        return self._each(lambda x, y: self._tape.node("min", x, y), a, b)

    def abs(self, a: Any) -> Any:
        """Return the magnitude of a quantity."""
        return self._each(lambda x: self._tape.node("abs", x), a)

    def relu(self, a: Any) -> Any:
        """Return a quantity where the quantity is positive, and zero elsewhere."""
        return self.max(a, 0.0)

    def where(self, s: Any, a: Any, b: Any) -> Any:
        """Return ``a`` where ``s >= 0``, and ``b`` elsewhere; across a kink nothing is proved."""
        return self._each(lambda x, y, z: self._tape.node("where", x, y, z), s, a, b)

    def clip(self, a: Any, lower: Any, upper: Any) -> Any:
        """Return a quantity between bounds."""
        return self._each(self._clip, a, lower, upper)

    def _clip(self, a: Any, lower: Any, upper: Any) -> Any:
        if _is_number(lower) and lower == -np.inf:
            return a if _is_number(upper) and upper == np.inf else self._tape.node("min", a, upper)
        if _is_number(upper) and upper == np.inf:
            return self._tape.node("max", a, lower)
        if self._are_ordered(lower, upper):
            return self._tape.node("max", lower, self._tape.node("min", a, upper))
        return self._tape.node("clip", a, lower, upper)

    def _are_ordered(self, lower: Any, upper: Any) -> bool:
        """Tell whether lower <= upper for certain: the same number but for constants."""
        low, high = (self._but_constant(self._tape.place_of(each)) for each in (lower, upper))
        return low[:2] == high[:2] and low[2] <= high[2]

    def _but_constant(self, place: int) -> tuple[int, int, float]:
        """Return k, s and c of a number that is s times number k, plus c, exactly."""
        step = self._tape.steps[place]
        if step.name == "constant":
            return -1, 1, step.number
        if step.name == "negative":
            return step.args[0], -1, 0.0
        if step.name not in ("add", "subtract"):
            return place, 1, 0.0
        first, second = (self._tape.steps[each] for each in step.args)
        sign = 1 if step.name == "add" else -1
        if first.name == "constant":
            return step.args[1], sign, first.number
        if second.name == "constant":
            return step.args[0], 1, sign * second.number
        return place, 1, 0.0


def traced(f: Callable[[Any, Any, Any], Any], size: int) -> Tape:
    """Return the tape of a formula f(z, alpha, sw) of n unknowns.

    Raises
    ------
    InvalidInputError
        If the formula cannot be traced, with the reason.
    """
    tape = Tape(size)
    nodes = [tape.node("variable", number=float(i)) for i in range(size + 1)]
    z = np.empty(size, dtype=object)
    z[:] = nodes[:size]
    try:
        with np.errstate(all="ignore"):
            found = np.asarray(f(z, nodes[size], TracedSwitches(tape)), dtype=object).ravel()
        tape.outputs = [tape.place_of(each) for each in found]
    except Exception as error:
        raise InvalidInputError(
            f"the formula cannot be traced, so that nothing can be proved: {error}"
        ) from error
    if len(tape.outputs) != size:
        raise InvalidInputError(f"the formula returned {len(tape.outputs)} numbers, not {size}")
    return tape
