"""The tape of a formula: the elementary operations of f(z, alpha, sw), written down once.

The formula is called with arrays of :class:`Traced` objects. numpy hands every operation on such an
array to the nodes, and every node writes the operation on the tape.

Failure modes and answers
-------------------------
- The formula decides by a value (a comparison, ``np.floor``, ``float(alpha)``), or calls what no
  node knows (a table, a solver, complex numbers): refused in words.
- The formula hides a decision from the nodes: the tape is compared with the formula at many points.
- A clip whose bounds may not be in order is written as decisions, across which nothing is proved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite, isinf
from numbers import Real
from typing import Any, final

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from pwscont.basics.errors import InvalidInputError
from pwscont.notation.arithmetic import KINKED
from pwscont.proof.operations import ELEMENTARY

#: Largest whole number that is taken as a power by repeated multiplication.
LARGEST_POWER = 64
PLAIN_NUMBER = (
    "the formula takes the plain number of, or a decision by, something that depends on "
    "(z, alpha): write decisions with the switches of sw"
)


class NotTracedError(TypeError):
    """A formula does what a tape cannot hold."""


@final
@dataclass(frozen=True, slots=True)
class Step:
    """One operation of a tape, with the places of the arguments on the tape.

    ``numbers`` has the value of a constant, the exponent of a power, the number of a variable.
    """

    name: str
    args: tuple[int, ...] = ()
    numbers: tuple[float, ...] = ()


@final
@dataclass(slots=True, eq=False)
class Tape:
    """The operations of a formula of ``size`` unknowns, arguments first: z, alpha, and so on.

    ``outputs`` are the places of the entries of the formula, and ``refused`` is what the formula
    asked for in vain, though it may have gone on.
    """

    size: int
    steps: list[Step] = field(default_factory=list)
    outputs: list[int] = field(default_factory=list)
    refused: list[NotTracedError] = field(default_factory=list)
    _places: dict[Step, int] = field(default_factory=dict)

    def node(self, name: str, *args: Any, numbers: tuple[float, ...] = ()) -> Traced:
        """Write an operation down, unless it stands there, and return the node of the result."""
        step = Step(name, tuple(self.place_of(each) for each in args), numbers)
        if step not in self._places:
            self._places[step] = len(self.steps)
            self.steps.append(step)
        return Traced(self, self._places[step])

    def variable(self, number: int) -> Traced:
        """Return the node of a variable."""
        return self.node("variable", numbers=(float(number),))

    def place_of(self, thing: Any) -> int:
        """Return the place of a node or of a constant."""
        if not isinstance(thing, Traced):
            thing = self.node("constant", numbers=(_exact(thing),))
        place: int = thing.place
        return place

    def parted(self, thing: Any) -> tuple[Any, float]:
        """Return a number, with a sign, and a constant: their sum is a node, exactly."""
        place = self.place_of(thing)
        step = self.steps[place]
        if step.name == "constant":
            return None, step.numbers[0]
        if step.name == "negative":
            return (step.args[0], -1.0), 0.0
        if step.name in ("add", "subtract"):
            sign = 1.0 if step.name == "add" else -1.0
            (first, one), (second, other) = ((arg, self.steps[arg]) for arg in step.args)
            if one.name == "constant":
                return (second, sign), one.numbers[0]
            if other.name == "constant":
                return (first, 1.0), sign * other.numbers[0]
        return (place, 1.0), 0.0

    def has(self, name: str) -> bool:
        """Tell whether an operation stands on the tape."""
        return any(step.name == name for step in self.steps)


def _exact(thing: Any) -> float:
    """Return a real number as a float, or refuse a number that a float does not hold."""
    if not isinstance(thing, Real | np.bool_) or float(thing) != thing or not isfinite(thing):
        raise NotTracedError(f"{thing!r} is no real number that a float holds exactly")
    return float(thing)


@final
class Traced(NDArrayOperatorsMixin):
    """A number on a tape; numpy's functions of the number write operations on the tape."""

    __slots__ = ("place", "tape")

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape, self.place = tape, place

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *args: Any, **options: Any) -> Any:
        """Write an operation down; for arrays, the operation of every entry."""
        if method != "__call__" or options:
            raise NotTracedError(f"the formula calls {ufunc.__name__}.{method} with options")
        if any(isinstance(each, np.ndarray) and each.ndim for each in args):
            return ufunc(*(_as_array(each) for each in args))
        numbers = (each.item() if isinstance(each, np.ndarray) else each for each in args)
        return self._of(ufunc.__name__, *numbers)

    def __getattr__(self, name: str) -> Any:
        """Return a function by its name, as numpy asks the entries of arrays."""
        if name not in ELEMENTARY and name not in DERIVED:
            raise AttributeError(f"{name} is not known to the tape")
        return lambda *args: self._of(name, self, *args)

    def _of(self, name: str, *args: Any) -> Any:
        """Write an operation on this number and others down, or refuse the operation in words."""
        if name in DERIVED:
            return DERIVED[name](*args)
        if name in ("add", "subtract", "multiply") and all(map(_is_known, args)):
            simple = _simpler(name, *args)
            if simple is not None:
                return simple
        if name in ELEMENTARY or name in ("negative", "add", "subtract", "multiply", "divide"):
            return self.tape.node(name, *args)
        if name == "power":
            return self._power(*args)
        better = KINKED.get(name)
        if better is None:
            raise NotTracedError(f"the formula takes {name}, which is not known to the tape")
        raise NotTracedError(
            f"the formula takes {name} of something that depends on (z, alpha), a decision by a "
            f"value: {f'write {better}' if better else 'write it with the switches of sw'}"
        )

    def _power(self, base: Any, power: Any) -> Any:
        if not _is_number(power):
            return self.tape.node("exp", power * self.tape.node("log", base))
        if float(power).is_integer() and abs(power) <= LARGEST_POWER:
            return self.tape.node("power", base, numbers=(float(power),))
        return base.sqrt() if power == 0.5 else (_exact(power) * base.log()).exp()

    def copy(self) -> Traced:
        """Return the number itself, which never changes."""
        return self

    def _refuse(self, *args: Any) -> Any:
        self.tape.refused += [NotTracedError(PLAIN_NUMBER)]
        raise self.tape.refused[-1]

    __hash__ = None  # type: ignore[assignment]
    __bool__ = __float__ = __int__ = __index__ = __complex__ = _refuse
    __floor__ = __ceil__ = __trunc__ = __round__ = _refuse


def _as_array(thing: Any) -> Any:
    """Return a traced number as an array without axes, which numpy takes apart itself."""
    if not isinstance(thing, Traced):
        return thing
    array = np.empty((), dtype=object)
    array[()] = thing
    return array


def _is_number(thing: Any) -> bool:
    return isinstance(thing, Real)


def _is_known(thing: Any) -> bool:
    return isinstance(thing, Real | Traced)


def _simpler(name: str, x: Any, y: Any) -> Any:
    """Return a sum, difference or product that is simpler than it looks, None for others."""
    number, other = (x, y) if _is_number(x) else (y, x)
    if not _is_number(number):
        return x**2 if name == "multiply" and x.place == y.place else None
    if name == "multiply":
        is_nothing = number == 0.0 and other.tape.steps[other.place].name == "variable"
        return 0.0 if is_nothing else other if number == 1.0 else None
    found: Any = number if isinf(number) else other if number == 0.0 else None
    return -found if name == "subtract" and found is y else found


#: Operations that are written down as others.
DERIVED: dict[str, Callable[..., Any]] = {
    "positive": lambda x: x,
    "conjugate": lambda x: x,
    "square": lambda x: x**2,
    "reciprocal": lambda x: 1.0 / x,
    "hypot": lambda x, y: (x * x + y * y).sqrt(),
    "log2": lambda x: x.log() / x.tape.node("log", 2.0),
    "log10": lambda x: x.log() / x.tape.node("log", 10.0),
    "exp2": lambda x: 2.0**x,
    "float_power": lambda x, y: x**y,
}


@final
class TracedSwitches:
    """The switches ``sw`` of a formula that is traced; every entry is a step of its own."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    def _each(self, function: Callable[..., Any] | str, *args: Any) -> Any:
        """Return a function of every entry, or the nodes of an operation."""
        if isinstance(function, str):
            name, function = function, lambda *entries: self._tape.node(name, *entries)
        return np.frompyfunc(function, len(args), 1)(*map(_as_array, args))

    def max(self, a: Any, b: Any) -> Any:
        """Return the larger of two quantities."""
        return self._each("max", a, b)

    def min(self, a: Any, b: Any) -> Any:
        """Return the smaller of two quantities."""
        return self._each("min", a, b)

    def abs(self, a: Any) -> Any:
        """Return the magnitude of a quantity."""
        return self._each("abs", a)

    def relu(self, a: Any) -> Any:
        """Return a quantity where the quantity is positive, and zero elsewhere."""
        return self._each("max", a, 0.0)

    def where(self, s: Any, a: Any, b: Any) -> Any:
        """Return ``a`` where ``s >= 0``, and ``b`` elsewhere; across a kink nothing is proved."""
        return self._each("where", s, a, b)

    def select(self, s: Any, a: Any, b: Any) -> Any:
        """Return ``a`` where ``s >= 0``, and ``b`` elsewhere, promised to agree where s is 0."""

        def select(s: Any, a: Any, b: Any) -> Any:
            is_same = self._tape.place_of(a) == self._tape.place_of(b)
            return a if is_same else self._tape.node("select", s, a, b)

        return self._each(select, s, a, b)

    def clip(self, a: Any, lower: Any, upper: Any) -> Any:
        """Return a quantity between bounds."""
        return self._each(self._clip, a, lower, upper)

    def _clip(self, a: Any, lower: Any, upper: Any) -> Any:
        """Return a clipped number; with bounds in the wrong order, what the notation returns."""
        node, are_known = self._tape.node, [_is_number(each) for each in (lower, upper)]
        if are_known[0] and lower == -np.inf:
            return a if are_known[1] and upper == np.inf else node("min", a, upper)
        if are_known[1] and upper == np.inf:
            return node("max", a, lower)
        clipped = node("max", lower, node("min", a, upper))
        (low, least), (high, most) = (self._tape.parted(each) for each in (lower, upper))
        if low == high and least <= most:
            return clipped
        crossed = node("where", a - lower, upper, node("where", a - upper, a, lower))
        return node("where", upper - lower, clipped, crossed)


def traced(f: Callable[[Any, Any, Any], Any], size: int) -> Tape:
    """Return the tape of a formula f(z, alpha, sw), or say why the formula cannot be traced."""
    tape, again = Tape(size), Tape(size)
    try:
        for each in (tape, again):
            _write(each, f)
        if (tape.steps, tape.outputs) != (again.steps, again.outputs):
            raise NotTracedError("the formula is another one each time")
    except Exception as error:
        raise InvalidInputError(
            f"the formula cannot be traced, so that nothing can be proved: {error}"
        ) from error
    if len(tape.outputs) != size:
        raise InvalidInputError(f"the formula returned {len(tape.outputs)} numbers, not {size}")
    return tape


def _write(tape: Tape, f: Callable[[Any, Any, Any], Any]) -> None:
    """Write a formula on an empty tape."""
    nodes = [tape.variable(i) for i in range(tape.size + 1)]
    z = np.empty(tape.size, dtype=object)
    z[:] = nodes[:-1]
    with np.errstate(all="ignore"):
        found = np.asarray(f(z, nodes[-1], TracedSwitches(tape)), dtype=object).ravel()
    for error in tape.refused:  # the formula went on without the number
        raise error
    tape.outputs = [tape.place_of(each) for each in found]
