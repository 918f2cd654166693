"""The tape of a formula: the elementary operations of f(z, alpha, sw), written down once.

numpy hands operations on arrays of :class:`Traced` to the entries, which write the operations down;
a formula that decides by a value is refused in words. Derivatives are tapes too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from math import isfinite, isinf
from numbers import Real
from operator import add
from typing import Any, final

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from pwscont.notation.arithmetic import KINKED, OF_TWO, SMOOTH, refuse_kink
from pwscont.proof.interval import ELEMENTARY, OPERATIONS, SWITCHES, Interval

#: Largest whole number that is taken as a power by repeated multiplication.
LARGEST_POWER = 64
Rules = Mapping[str, Callable[..., Interval]]


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
    numbers: tuple[Any, ...] = ()


@final
@dataclass(eq=False)
class Tape:
    """The operations of a formula of ``size`` unknowns, arguments first: z, alpha, and so on.

    ``outputs`` are the places of the entries of the formula, and ``refused`` is what the formula
    asked for in vain, though it may have gone on.
    """

    size: int
    steps: list[Step] = field(default_factory=list)
    outputs: list[int] = field(default_factory=list)
    refused: list[Exception] = field(default_factory=list)
    _places: dict[Step, int] = field(default_factory=dict)

    def node(self, name: str, *args: Any, numbers: tuple[Any, ...] = ()) -> Traced:
        """Write an operation down, unless it stands there, and return the node of the result."""
        step = Step(name, tuple(self.place_of(each) for each in args), numbers)
        if step not in self._places:
            self._places[step] = len(self.steps)
            self.steps.append(step)
        return Traced(self, self._places[step])

    def place_of(self, thing: Any) -> int:
        """Return the place of a node or of a constant."""
        if isinstance(thing, Traced):
            if thing.tape is not self:
                raise NotTracedError("the formula keeps numbers that depend on (z, alpha)")
            return thing.place
        return self.node("constant", numbers=(_exact(thing),)).place

    @cached_property
    def slopes(self) -> Tape:
        """The tape of the formula, n outputs, and its derivatives by (z, alpha), n (n + 1)."""
        return self._with_slopes(self.outputs)

    @cached_property
    def tests(self) -> Tape:
        """The tape of the tests of all switches, and of their derivatives by (z, alpha)."""
        new = self._copy()
        tests = [
            SWITCHES[step.name][0](*(Traced(new, place) for place in step.args))
            for step in self.steps
            if step.name in SWITCHES
        ]
        return new._with_slopes([new.place_of(each) for each in tests])

    @cached_property
    def bent(self) -> Tape:
        """The tape of H''[t, t], a function of n + 1 variables (z, alpha) and as many variables t.

        Meant for places without a kink.
        """
        new, count = self._copy(), self.size + 1
        seeds = {i: new.node("variable", numbers=(count + i,)) for i in range(count)}
        for _ in range(2):
            known = new._derivatives(seeds)
            new.outputs = [new._slope(known, place) for place in new.outputs]
        return new

    def _copy(self) -> Tape:
        return replace(self, steps=[*self.steps], _places={**self._places})

    def _with_slopes(self, places: Sequence[int]) -> Tape:
        new = self._copy()
        known = [new._derivatives({i: 1.0}) for i in range(self.size + 1)]
        new.outputs = [*places, *(new._slope(by, place) for place in places for by in known)]
        return new

    def _slope(self, known: list[Any], place: int) -> int:
        return self.place_of(0.0 if known[place] is None else known[place])

    def _derivatives(self, seeds: Mapping[int, Any]) -> list[Any]:
        """Return the derivatives of all steps from those of the variables; None is zero."""
        known: list[Any] = []
        for place, step in enumerate([*self.steps]):
            if step.name == "variable":
                known.append(seeds.get(step.numbers[0]))
            else:
                x, dx = ([Traced(self, k) for k in step.args], [known[k] for k in step.args])
                known.append(_derivative(Traced(self, place), step, x, dx))
        return known


def _derivative(y: Traced, step: Step, x: list[Traced], dx: list[Any]) -> Any:
    """Return the derivative of a step from the derivatives of the arguments."""
    if all(each is None for each in dx):
        return None
    if step.name in SWITCHES:
        test, branches = SWITCHES[step.name]
        either = branches(*(0.0 if each is None else each for each in dx))
        return y.tape.node("jump" if step.name in ("where", "jump") else "slope", test(*x), *either)
    parts = zip(_factors(step, x, y), dx, strict=True)
    return reduce(add, (factor * slope for factor, slope in parts if slope is not None))


def _factors(step: Step, x: list[Traced], y: Traced) -> list[Any]:
    """Return the derivatives of a smooth operation by each argument."""
    if step.name == "negative":
        return [-1.0]
    if step.name == "power":
        (k,) = step.numbers
        return [k * x[0] ** (k - 1.0)]
    rules: Any = OF_TWO.get(step.name) or (SMOOTH[step.name],)
    return [rule(*x, y) for rule in rules]


def _exact(thing: Any) -> float:
    """Return a real number as a float, or refuse a number that a float does not hold."""
    if not isinstance(thing, Real | np.bool_) or float(thing) != thing or not isfinite(thing):
        raise NotTracedError(f"{thing!r} is no real number that a float holds exactly")
    return float(thing)


@final
class Traced(NDArrayOperatorsMixin):
    """A number on a tape; numpy's functions of the number write operations on the tape."""

    __slots__ = ("place", "tape")
    ndim, shape, size = 0, (), 1  # as numbers of numpy have

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape, self.place = tape, place

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *args: Any, **options: Any) -> Any:
        """Write an operation down; for arrays, the operation of every entry."""
        if method != "__call__" or options:
            self._refuse(f"the formula calls {ufunc.__name__}.{method} with options")
        if any(isinstance(each, np.ndarray) and each.ndim for each in args):
            return ufunc(*(as_array(each) for each in args))
        numbers = (each.item() if isinstance(each, np.ndarray) else each for each in args)
        return self._of(ufunc.__name__, *numbers)

    def __getattr__(self, name: str) -> Any:
        """Return a function by its name, as numpy asks the entries of arrays."""
        if name not in ELEMENTARY and name not in DERIVED:
            words = f"the formula asks for {name}, which is not known to the tape"
            if not name.startswith("__"):  # numpy asks for names of its own
                self.tape.refused.append(NotTracedError(words))
            raise AttributeError(words)
        return lambda *args: self._of(name, self, *args)

    def _of(self, name: str, *args: Any) -> Any:
        """Write an operation on this number and others down, or refuse the operation in words."""
        if name in DERIVED:
            return DERIVED[name](*args)
        if name in ELEMENTARY or name in ("negative", "add", "subtract", "multiply", "divide"):
            simple = _simpler(name, *args) if name in ("add", "subtract", "multiply") else None
            return self.tape.node(name, *args) if simple is None else simple
        if name == "power":
            return self._power(*args)
        if name in KINKED:
            self._refuse(refuse_kink(name))
        return self._refuse(f"the formula takes {name}, which is not known to the tape")

    def _power(self, base: Any, power: Any) -> Any:
        if not isinstance(power, Real):
            return self.tape.node("exp", power * self.tape.node("log", base))
        k = _exact(power)
        if k.is_integer() and abs(k) <= LARGEST_POWER:
            return base if k == 1.0 else self.tape.node("power", base, numbers=(k,))
        return base.sqrt() if k == 0.5 else (k * base.log()).exp()

    def copy(self, *args: Any) -> Traced:
        """Return the number itself, which never changes."""
        return self

    __copy__ = __deepcopy__ = copy

    def _refuse(self, why: Any) -> Any:
        """Refuse a formula, also a formula that goes on all the same."""
        self.tape.refused.append(why if isinstance(why, Exception) else NotTracedError(why))
        raise self.tape.refused[-1]

    def _decide(self, *args: Any) -> Any:
        return self._refuse(
            "the formula takes the plain number of, or a decision by, something that depends on "
            "(z, alpha): write decisions with the switches of sw"
        )

    __hash__ = None  # type: ignore[assignment]
    __bool__ = __float__ = __int__ = __index__ = __complex__ = _decide
    __floor__ = __ceil__ = __trunc__ = __round__ = _decide


def as_array(thing: Any) -> Any:
    """Return a traced number as an array without axes, which numpy takes apart itself."""
    if not isinstance(thing, Traced):
        return thing
    array = np.empty((), dtype=object)
    array[()] = thing
    return array


def _simpler(name: str, x: Any, y: Any) -> Any:
    """Return a sum, difference or product that is simpler than it looks, None for others."""
    if not all(isinstance(each, Real | Traced) for each in (x, y)):
        return None
    number, other = (x, y) if isinstance(x, Real) else (y, x)
    if not isinstance(number, Real):
        return x**2 if name == "multiply" and x.place == y.place else None
    if name == "multiply":
        is_nothing = number == 0.0 and other.tape.steps[other.place].name == "variable"
        return 0.0 if is_nothing else other if number == 1.0 else -other if number == -1.0 else None
    if isinf(number):
        return -number if name == "subtract" and other is x else number
    return other if number == 0.0 and (name == "add" or other is x) else None


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
    "tan": lambda x: x.sin() / x.cos(),
}


def evaluated(tape: Tape, box: Interval, rules: Rules = OPERATIONS) -> Interval:
    """Return the outputs of a tape on boxes (n + 1, B), shape (outputs, B)."""
    values: list[Interval] = []
    for step in tape.steps:
        if step.name == "variable":
            values.append(box[step.numbers[0]])
        else:
            values.append(rules[step.name](*(values[arg] for arg in step.args), *step.numbers))
    shape = (len(tape.outputs), *box.lo.shape[1:])
    found = Interval(np.empty(shape), np.empty(shape))
    for k, place in enumerate(tape.outputs):
        found.lo[k], found.hi[k] = values[place].lo, values[place].hi
    return found


def with_slopes(tape: Tape, box: Interval, rules: Rules = OPERATIONS) -> tuple[Interval, Interval]:
    """Return m outputs and their derivatives by (z, alpha), shapes (m, B) and (m, n + 1, B).

    The tape is ``slopes`` or ``tests`` of another tape. Where a switch may be in either mode, a
    derivative is the hull of the derivatives of both branches, so that the mean value form holds
    across kinks (docs/theory, F20).
    """
    found, by = evaluated(tape, box, rules), tape.size + 1
    count = len(tape.outputs) // (by + 1)
    shape = (count, by, *box.lo.shape[1:])
    return found[:count], found[count:].arranged(lambda end: end.reshape(shape))
