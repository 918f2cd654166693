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
from typing import Any, final

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from pwscont.basics.errors import InvalidInputError
from pwscont.intervals.functions import ELEMENTARY
from pwscont.notation.arithmetic import KINKED

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
    refused : list of NotTracedError
        What the formula asked for in vain, though it may have gone on.
    """

    size: int
    steps: list[Step] = field(default_factory=list)
    outputs: list[int] = field(default_factory=list)
    refused: list[NotTracedError] = field(default_factory=list)
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

    def has(self, name: str) -> bool:
        """Tell whether an operation stands on the tape."""
        return any(step.name == name for step in self.steps)

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
        return self._of(ufunc.__name__, *(_as_entry(each) for each in args))

    def __getattr__(self, name: str) -> Any:
        """Return a function by its name, as numpy asks the entries of arrays."""
        if name not in ELEMENTARY and name not in DERIVED:
            raise AttributeError(f"{name} is not known to the tape")
        return lambda *args: self._of(name, self, *args)

    def _of(self, name: str, *args: Any) -> Any:
        """Write an operation on this number and others down, or refuse the operation in words."""
        if name in DERIVED:
            return DERIVED[name](*args)
        simple = SIMPLER[name](*args) if name in SIMPLER and _are_known(args) else None
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
            log = self.tape.node("log", base)
            return self.tape.node("exp", power * log)
        if float(power).is_integer() and abs(power) <= LARGEST_POWER:
            return self.tape.node("power", base, number=float(power))
        return base.sqrt() if power == 0.5 else (_exact(power) * base.log()).exp()

    def copy(self) -> Traced:
        """Return the number itself, which never changes."""
        return self

    def _refuse(self, *args: Any) -> Any:
        self.tape.refused += [
            NotTracedError(
                "the formula takes the plain number of, or a decision by, something that depends "
                "on (z, alpha): write decisions with the switches of sw"
            )
        ]
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


def _as_entry(thing: Any) -> Any:
    return thing.item() if isinstance(thing, np.ndarray) else thing


def _is_number(thing: Any) -> bool:
    return isinstance(thing, Real)


def _are_known(args: tuple[Any, ...]) -> bool:
    return all(_is_number(each) or isinstance(each, Traced) for each in args)


def _product(x: Any, y: Any) -> Any:
    """Return a square, or a product with one or with zero, None for other products."""
    number, other = (x, y) if _is_number(x) else (y, x)
    if not _is_number(number):
        return x.tape.node("power", x, number=2.0) if x.place == y.place else None
    if number == 0.0 and other.tape.steps[other.place].name == "variable":
        return 0.0
    return other if number == 1.0 else None


def _sum(x: Any, y: Any) -> Any:
    """Return a sum with zero or with an infinite number, None for other sums."""
    number, other = (x, y) if _is_number(x) else (y, x)
    if not _is_number(number):
        return None
    return other if number == 0.0 else number if isinf(number) else None


def _difference(x: Any, y: Any) -> Any:
    if _is_number(y):
        return _sum(x, -y)
    if not _is_number(x):
        return None
    return -y if x == 0.0 else x if isinf(x) else None


#: Operations that need not be written down, or are simpler than they look.
SIMPLER: dict[str, Callable[..., Any]] = {
    "add": _sum,
    "subtract": _difference,
    "multiply": _product,
}
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

    def _each(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return np.frompyfunc(function, len(arguments), 1)(*map(_as_array, arguments))

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

    def select(self, s: Any, a: Any, b: Any) -> Any:
        """Return ``a`` where ``s >= 0``, and ``b`` elsewhere, promised to agree where s is 0."""
        return self._each(self._select, s, a, b)

    def _select(self, s: Any, a: Any, b: Any) -> Any:
        is_same = self._tape.place_of(a) == self._tape.place_of(b)
        return a if is_same else self._tape.node("select", s, a, b)

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
        """Tell whether lower <= upper for certain: the same number plus ordered constants."""
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
    nodes = [tape.node("variable", number=float(i)) for i in range(tape.size + 1)]
    z = np.empty(tape.size, dtype=object)
    z[:] = nodes[:-1]
    with np.errstate(all="ignore"):
        found = np.asarray(f(z, nodes[-1], TracedSwitches(tape)), dtype=object).ravel()
    for error in tape.refused:  # the formula went on without the number
        raise error
    tape.outputs = [tape.place_of(each) for each in found]
