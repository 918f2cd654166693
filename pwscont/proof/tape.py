"""The tape of a formula: the elementary operations of f(z, alpha, sw), written down once.

numpy hands operations on arrays of :class:`Traced` to the entries, which write the operations down.
Derivatives are tapes too. The tape is compared with the system before anything is proved.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial, reduce
from inspect import signature
from math import isfinite, isinf
from numbers import Real
from operator import add
from types import SimpleNamespace
from typing import Any, final

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from pwscont.basics.arrays import Array, Signs, generic
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.graph.proved import SAME_VALUES, value_of
from pwscont.notation.arithmetic import KINKED, OF_TWO, SMOOTH, refuse_kink
from pwscont.notation.curved import SwitchedSystem
from pwscont.proof.interval import ELEMENTARY, OPERATIONS, SWITCHES, Interval
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

#: Largest whole number that is taken as a power by repeated multiplication.
LARGEST_POWER = 64
#: Why a formula is refused.
DECIDES = (
    "the formula takes the plain number of something that depends on (z, alpha), or decides by it: "
    "write decisions with the switches of sw, and np.array([...]) instead of entries put into zeros"
)
Rules = Mapping[str, Callable[..., Interval]]


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
    """The operations of a formula of ``size`` unknowns, z and alpha first.

    ``outputs`` are the places of the results; ``refused`` is what the formula asked for in vain.
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
                raise TypeError("the formula keeps numbers that depend on (z, alpha)")
            return thing.place
        return self.node("constant", numbers=(self.exact(thing),)).place

    def exact(self, thing: Any) -> float:
        """Return a real number as a float, or refuse a number that a float does not hold."""
        if isinstance(thing, Real | np.bool_) and float(thing) == thing and isfinite(thing):
            return float(thing)
        return self.refuse(f"{thing!r} is no real number that a float holds exactly")

    def refuse(self, why: Any) -> Any:
        """Refuse a formula, also a formula that goes on all the same."""
        self.refused.append(why if isinstance(why, Exception) else TypeError(why))
        raise self.refused[-1]

    @cached_property
    def slopes(self) -> Tape:
        """The tape of the formula, n outputs, and its derivatives by (z, alpha), n (n + 1)."""
        return self._with_slopes(self.outputs)

    @cached_property
    def tests(self) -> Tape:
        """The tape of the tests of all switches, and of their derivatives by (z, alpha)."""
        new, switches = self._copy(), [step for step in self.steps if step.name in SWITCHES]
        args = [[Traced(new, place) for place in step.args] for step in switches]
        tests = [SWITCHES[step.name][0](*x) for step, x in zip(switches, args, strict=True)]
        return new._with_slopes([new.place_of(each) for each in tests])

    @cached_property
    def bent(self) -> Tape:
        """The tape of H''[t, t], a function of n + 1 variables (z, alpha) and as many variables t.

        Meant for places without a kink.
        """
        new, count = self._copy(), self.size + 1
        seeds = {i: new.node("variable", numbers=(count + i,)) for i in range(count)}
        for _ in range(2):
            slopes = new._derivatives(seeds)
            new.outputs = [new.place_of(slopes[place]) for place in new.outputs]
        return new

    def _copy(self) -> Tape:
        return replace(self, steps=[*self.steps], _places={**self._places})

    def _with_slopes(self, places: Sequence[int]) -> Tape:
        new = self._copy()
        slopes = [new._derivatives({i: 1.0}) for i in range(self.size + 1)]
        new.outputs = [*places, *(new.place_of(by[place]) for place in places for by in slopes)]
        return new

    def _derivatives(self, seeds: Mapping[int, Any]) -> list[Any]:
        """Return the derivatives of all steps, numbers or nodes, from those of the variables."""
        found: list[Any] = []
        for place, step in enumerate([*self.steps]):
            if step.name == "variable":
                found.append(seeds.get(step.numbers[0], 0.0))
            else:
                x, dx = ([Traced(self, k) for k in step.args], [found[k] for k in step.args])
                found.append(_derivative(Traced(self, place), step, x, dx))
        return found


def _derivative(y: Traced, step: Step, x: list[Traced], dx: list[Any]) -> Any:
    """Return the derivative of a step from the derivatives of the arguments."""
    moving = [isinstance(each, Traced) or each != 0.0 for each in dx]
    if not any(moving):
        return 0.0
    if step.name in SWITCHES:
        test, branches = SWITCHES[step.name]
        name = "jump" if step.name in ("where", "jump") else "slope"
        return y.tape.node(name, test(*x), *branches(*dx))
    if step.name == "negative":
        return -dx[0]
    rules: Any = OF_TWO.get(step.name) or (SMOOTH[step.name],)
    parts = zip(rules, dx, moving, strict=False)  # the exponent of a power does not move
    return reduce(
        add, (rule(*x, *step.numbers, y) * slope for rule, slope, moves in parts if moves)
    )


@final
class Traced(NDArrayOperatorsMixin):
    """A number on a tape; numpy's functions of the number write operations on the tape."""

    __slots__ = ("place", "tape")
    ndim, shape, size = 0, (), 1  # as numbers of numpy have

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape, self.place = tape, place

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *args: Any, **options: Any) -> Any:
        """Write an operation down; for arrays, the operation of every entry."""
        (place,) = options.pop("out", (None,))
        if method != "__call__" or options:
            self.tape.refuse(f"the formula calls {ufunc.__name__}.{method} with options")
        if isinstance(place, np.ndarray):  # r -= alpha
            place[...] = ufunc(*(as_array(each) for each in args))
            return place
        if any(isinstance(each, np.ndarray) and each.ndim for each in args):
            return ufunc(*(as_array(each) for each in args))
        numbers = (each.item() if isinstance(each, np.ndarray) else each for each in args)
        return self._of(ufunc.__name__, *numbers)

    def __getattr__(self, name: str) -> Any:
        """Return a function by its name, as numpy asks the entries of arrays."""
        if name not in ELEMENTARY and name not in DERIVED:
            words = f"the formula asks for {name}, which is not known to the tape"
            error = AttributeError(words)
            self.tape.refused += [error] * (not name.startswith("__"))  # which numpy asks for
            raise error
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
        unknown = f"the formula takes {name}, which is not known to the tape"
        return self.tape.refuse(refuse_kink(name) if name in KINKED else unknown)

    def _power(self, base: Any, power: Any) -> Any:
        if not isinstance(power, Real):
            return self.tape.node("exp", power * self.tape.node("log", base))
        k = self.tape.exact(power)
        if k in (0.0, 1.0):
            return base if k else 1.0
        if k.is_integer() and abs(k) <= LARGEST_POWER:
            return self.tape.node("power", base, numbers=(k,))
        return base.sqrt() if k == 0.5 else (k * base.log()).exp()

    def copy(self, *args: Any) -> Traced:
        """Return the number itself, which never changes."""
        return self

    __copy__ = __deepcopy__ = copy

    def _decide(self, *args: Any) -> Any:
        return self.tape.refuse(DECIDES)

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
    number, other = (x, y) if isinstance(x, Real) else (y, x)
    if not (isinstance(number, Real | Traced) and isinstance(other, Traced)):
        return None
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
    "tan": lambda x: x.sin() / x.cos(),
}


def evaluated(tape: Tape, boxes: Interval, rules: Rules = OPERATIONS) -> Interval:
    """Return the outputs of a tape on boxes (B, n + 1), shape (B, outputs)."""
    values, shape = list[Interval](), (len(boxes.lo), len(tape.outputs))
    found = Interval(np.empty(shape), np.empty(shape))
    for step in tape.steps if len(boxes.lo) else ():
        if step.name == "variable":
            values.append(boxes[:, step.numbers[0]])
        else:
            values.append(rules[step.name](*(values[arg] for arg in step.args), *step.numbers))
    for k, place in enumerate(tape.outputs if values else ()):
        found.lo[:, k], found.hi[:, k] = values[place].lo, values[place].hi
    return found


def with_slopes(
    tape: Tape, boxes: Interval, rules: Rules = OPERATIONS
) -> tuple[Interval, Interval]:
    """Return the outputs of ``slopes`` or ``tests`` of a tape: values (B, m), slopes (B, m, n + 1).

    Where a switch may be in either mode, a derivative is the hull of those of both branches, so
    that the mean value form holds across kinks (docs/theory, F20).
    """
    found, by = evaluated(tape, boxes, rules), tape.size + 1
    count = len(tape.outputs) // (by + 1)
    shape = len(boxes.lo), count, by
    return found[:, :count], found[:, count:].arranged(lambda end: end.reshape(shape))


# -- the tape of a system --------------------------------------------------------------------------

#: At how many points the tape is compared with the formula, and how much they may differ, relative
#: to the values and to the bound on rounding.
COMPARED, ROUNDINGS = 40, 100.0
#: Most tests of a class, whose selections are written down one by one.
MOST_TESTS = 8
#: How often an interface is looked for, and by how many bisections.
LOOKS, BISECTIONS = 200, 60


def _are_ordered(tape: Tape, lower: Any, upper: Any) -> bool:
    """Tell whether bounds are constants in order, or such constants minus the same number."""
    low, high = (tape.steps[tape.place_of(end)] for end in (lower, upper))
    if {low.name, high.name} == {"subtract"} and low.args[1] == high.args[1]:
        low, high = (tape.steps[each.args[0]] for each in (low, high))
    return {low.name, high.name} == {"constant"} and low.numbers <= high.numbers


def _clip(tape: Tape, a: Any, lower: Any, upper: Any) -> Any:
    """Return a clipped number: decisions, across which nothing is proved, if bounds may cross."""
    node = tape.node
    is_open = [isinstance(end, Real) and np.isinf(float(end)) for end in (lower, upper)]
    clipped = a if is_open[1] else node("min", a, upper)
    clipped = clipped if is_open[0] else node("max", lower, clipped)
    if any(is_open) or _are_ordered(tape, lower, upper):
        return clipped
    crossed = node("where", a - lower, upper, node("where", a - upper, a, lower))
    return node("where", upper - lower, clipped, crossed)


def switches_of(tape: Tape) -> SimpleNamespace:
    """Return the switches ``sw`` of a formula that is traced.

    ``select`` is ``where`` with a promise that a and b agree where s is 0.
    """
    node = tape.node
    entries: dict[str, Callable[..., Any]] = {
        "max": lambda a, b: node("max", a, b),
        "min": lambda a, b: node("min", a, b),
        "abs": lambda a: node("abs", a),
        "relu": lambda a: node("max", a, 0.0),
        "clip": lambda a, lower, upper: _clip(tape, a, lower, upper),
        "where": lambda s, a, b: node("where", s, a, b),
        "select": lambda s, a, b: (
            a if tape.place_of(a) == tape.place_of(b) else node("select", s, a, b)
        ),
    }

    def each(entry: Callable[..., Any]) -> Callable[..., Any]:
        names = signature(entry)
        of_arrays = np.frompyfunc(entry, len(names.parameters), 1)
        return lambda *args, **named: of_arrays(*map(as_array, names.bind(*args, **named).args))

    return SimpleNamespace(**{name: each(entry) for name, entry in entries.items()})


def traced(f: Callable[[Any, Any, Any], Any], size: int) -> Tape:
    """Return the tape of a formula f(z, alpha, sw), or say why the formula cannot be traced."""
    tape, again = Tape(size), Tape(size)
    try:
        for each in (tape, again):
            nodes = [each.node("variable", numbers=(i,)) for i in range(size + 1)]
            with np.errstate(all="ignore"):
                found = f(np.array(nodes[:-1], dtype=object), nodes[-1], switches_of(each))
            for error in each.refused:  # the formula went on without the number
                raise error
            each.outputs = [each.place_of(x) for x in np.asarray(found, dtype=object).ravel()]
        if (tape.steps, tape.outputs) != (again.steps, again.outputs):
            raise TypeError("the formula is another one each time")
    except Exception as error:
        found = DECIDES if "dtype('O')" in str(error) else error
        why = each.refused[0] if each.refused else found
        raise InvalidInputError(
            f"the formula cannot be traced, so that nothing can be proved: {why}"
        ) from error
    if len(tape.outputs) != size:
        raise InvalidInputError(f"the formula returned {len(tape.outputs)} numbers, not {size}")
    return tape


def tape_of(system: PiecewiseSystem) -> Tape:
    """Return the tape of a system, or refuse a system that is linear, or cannot be traced."""
    if isinstance(system, SwitchedSystem):
        return traced(system.formula, system.shown)
    if isinstance(system, SlicewiseLinearSystem):
        raise InvalidInputError(
            f"{type(system).__name__} hands over no formula: Everywhere proves curved systems; of "
            "piecewise-linear systems AllTransitions finds everything"
        )
    return traced(partial(_selected, system), system.size)


def _selected(system: PiecewiseSystem, z: Any, alpha: Any, sw: Any) -> Any:
    """Return the selections of a class, chosen by the tests one after the other."""
    z.setflags(write=False)  # all selections get the same unknowns
    tests = np.array(system.test_functions(z, alpha), dtype=object).ravel()  # not a class's buffer
    if len(tests) > MOST_TESTS:
        raise TypeError(f"{len(tests)} tests are more than {MOST_TESTS}")

    def chosen(signs: tuple[bool, ...]) -> Any:
        if len(signs) == len(tests):
            return np.array(system.residual(z, alpha, Character(signs)), dtype=object)
        return sw.select(tests[len(signs)], chosen((*signs, True)), chosen((*signs, False)))

    return chosen(())


@np.errstate(all="ignore")
def check_tape(tape: Tape, system: Any, box: Interval) -> list[tuple[Array, Array]]:
    """Return H at points of a box, or refuse a tape that says something else at some point."""
    points = _points(box, COMPARED)
    try:
        value = np.array([value_of(system, x) for x in points])
    except Exception as error:
        raise InvalidInputError(f"the formula fails in the box: {error}") from error
    differs = _differ(evaluated(tape, Interval(points)), Interval(value)).any(axis=1)
    if differs.any():
        raise InvalidInputError(
            f"the formula is not what its operations say, at {points[differs.argmax()]}: it "
            "decides by something that cannot be traced, so that nothing can be proved"
        )
    for step in tape.steps:
        if step.name == "select":
            _check_interface(tape, step.args, box)
    return [*zip(points, value, strict=True)]


def _differ(one: Interval, other: Interval) -> Signs:
    """Tell which values differ by more than rounding explains."""
    slack = SAME_VALUES * other.reach() + ROUNDINGS * (one.width() + other.width())
    return np.abs(one.middle() - other.middle()) > slack


def _points(box: Interval, count: int, first: int = 0) -> Array:
    """Return points (count, n + 1) of a box, more and more of them near the middle."""
    parts = [generic(len(box.lo), i) * 2.0 ** -(i % 10) for i in range(first, first + count)]
    points: Array = box.lo + (box.hi - box.lo) * (0.5 + 0.5 * np.array(parts))
    return points


def _check_interface(tape: Tape, places: tuple[int, ...], box: Interval) -> None:
    """Refuse a class whose selections differ where a test vanishes, on many segments at once."""
    a, b = _points(box, LOOKS), _points(box, LOOKS, LOOKS)
    select = replace(tape, outputs=[*places])

    def holds(points: Array) -> Signs:
        return evaluated(select, Interval(points)).middle()[:, :1] >= 0.0

    first = holds(a)
    crosses = first != holds(b)
    for _ in range(BISECTIONS):
        middle = 0.5 * (a + b)
        same = holds(middle) == first
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    known = evaluated(select, Interval(np.minimum(a, b), np.maximum(a, b)))
    if (_differ(known[:, 1], known[:, 2]) & crosses[:, 0]).any():
        raise InvalidInputError(
            "two selections of the class differ where a test vanishes, so that nothing can be "
            "proved; check_system says where"
        )
