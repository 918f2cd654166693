"""The tape of a system: the formula is called with traced numbers, then compared with the tape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from numbers import Real
from typing import Any, final

import numpy as np

from pwscont.basics.arrays import Array, generic
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.notation.curved import SwitchedSystem
from pwscont.proof.interval import Interval
from pwscont.proof.tape import NotTracedError, Tape, as_array, evaluated
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

#: At how many points the tape is compared with the formula, and how much they may differ, relative
#: to the values and to the bound on rounding.
COMPARED, ALIKE, ROUNDINGS = 40, 1e-9, 100.0
#: Most tests of a class, whose selections are written down one by one.
MOST_TESTS = 8
#: How often an interface is looked for, and by how many bisections.
LOOKS, BISECTIONS = 200, 60


def _each(function: Callable[..., Any]) -> Callable[..., Any]:
    names = signature(function)

    def switch(switches: TracedSwitches, *args: Any, **named: Any) -> Any:
        own = names.bind(switches.tape, *args, **named).args[1:]
        entry = partial(function, switches.tape)
        return np.frompyfunc(entry, len(own), 1)(*map(as_array, own))

    return switch


def _are_ordered(tape: Tape, lower: Any, upper: Any) -> bool:
    """Tell whether bounds are constants in order, or such constants minus the same number."""
    low, high = (tape.steps[tape.place_of(end)] for end in (lower, upper))
    if {low.name, high.name} == {"subtract"} and low.args[1] == high.args[1]:
        low, high = (tape.steps[each.args[0]] for each in (low, high))
    return {low.name, high.name} == {"constant"} and low.numbers <= high.numbers


def _clip(tape: Tape, a: Any, lower: Any, upper: Any) -> Any:
    """Return a clipped number; with bounds in the wrong order, what the notation returns.

    A clip whose bounds may not be in order is decisions, across which nothing is proved.
    """
    node = tape.node
    is_open = [isinstance(end, Real) and np.isinf(float(end)) for end in (lower, upper)]
    clipped = a if is_open[1] else node("min", a, upper)
    clipped = clipped if is_open[0] else node("max", lower, clipped)
    if any(is_open) or _are_ordered(tape, lower, upper):
        return clipped
    crossed = node("where", a - lower, upper, node("where", a - upper, a, lower))
    return node("where", upper - lower, clipped, crossed)


@final
@dataclass(frozen=True, slots=True)
class TracedSwitches:
    """The switches ``sw`` of a formula that is traced; every entry is a step of its own."""

    tape: Tape
    max = _each(lambda tape, a, b: tape.node("max", a, b))
    min = _each(lambda tape, a, b: tape.node("min", a, b))
    abs = _each(lambda tape, a: tape.node("abs", a))
    relu = _each(lambda tape, a: tape.node("max", a, 0.0))
    where = _each(lambda tape, s, a, b: tape.node("where", s, a, b))
    #: ``a`` where ``s >= 0``, and ``b`` elsewhere, promised to agree where s is 0.
    select = _each(
        lambda tape, s, a, b: (
            a if tape.place_of(a) == tape.place_of(b) else tape.node("select", s, a, b)
        )
    )
    clip = _each(_clip)


def traced(f: Callable[[Any, Any, Any], Any], size: int) -> Tape:
    """Return the tape of a formula f(z, alpha, sw), or say why the formula cannot be traced."""
    tape, again = Tape(size), Tape(size)
    try:
        for each in (tape, again):
            nodes = [each.node("variable", numbers=(i,)) for i in range(size + 1)]
            with np.errstate(all="ignore"):
                found = f(np.array(nodes[:-1], dtype=object), nodes[-1], TracedSwitches(each))
            for error in each.refused:  # the formula went on without the number
                raise error
            each.outputs = [each.place_of(x) for x in np.asarray(found, dtype=object).ravel()]
        if (tape.steps, tape.outputs) != (again.steps, again.outputs):
            raise NotTracedError("the formula is another one each time")
    except Exception as error:
        raise InvalidInputError(
            f"the formula cannot be traced, so that nothing can be proved: {error}"
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


def _selected(system: PiecewiseSystem, z: Any, alpha: Any, sw: TracedSwitches) -> Any:
    """Return the selections of a class, chosen by the tests one after the other."""
    z.setflags(write=False)  # all selections get the same unknowns
    tests = np.asarray(system.test_functions(z, alpha), dtype=object).ravel()
    if len(tests) > MOST_TESTS:
        raise NotTracedError(f"{len(tests)} tests are more than {MOST_TESTS}")

    def chosen(signs: tuple[bool, ...]) -> Any:
        if len(signs) == len(tests):
            return np.asarray(system.residual(z, alpha, Character(signs)), dtype=object)
        return sw.select(tests[len(signs)], chosen((*signs, True)), chosen((*signs, False)))

    return chosen(())


@np.errstate(all="ignore")
def check_tape(tape: Tape, system: Any, box: Interval) -> None:
    """Refuse a tape that says something else than the system at some point of a box."""
    points = _points(box, COMPARED)
    value = np.array([_value(system, x[:-1], float(x[-1])) for x in points.T]).T
    known = evaluated(tape, Interval(points))
    slack = ALIKE * np.abs(value) + ROUNDINGS * known.width()
    differs = ((value < known.lo - slack) | (value > known.hi + slack)).any(axis=0)
    if differs.any():
        raise InvalidInputError(
            f"the formula is not what its operations say, at {points[:, differs.argmax()]}: it "
            "decides by something that cannot be traced, so that nothing can be proved"
        )
    for step in tape.steps:
        if step.name == "select":
            _check_interface(tape, step.args, box)


def _points(box: Interval, count: int, first: int = 0) -> Array:
    """Return points (n + 1, count) of a box, more and more of them near the middle."""
    parts = [generic(len(box.lo), i) * 2.0 ** -(i % 10) for i in range(first, first + count)]
    points: Array = box.lo + (box.hi - box.lo) * (0.5 + 0.5 * np.array(parts))
    return points.T


def _value(system: Any, z: Array, alpha: float) -> Array:
    """Return H at a point, or refuse a system that fails there."""
    try:
        if isinstance(system, SwitchedSystem):
            return system.formula_at(z, alpha)
        return np.array(system.residual(z, alpha, system.character(z, alpha)), dtype=float)
    except Exception as error:
        raise InvalidInputError(f"the formula fails at {np.append(z, alpha)}: {error}") from error


def _check_interface(tape: Tape, places: tuple[int, ...], box: Interval) -> None:
    """Refuse a class whose selections differ where a test vanishes, on many segments at once."""
    a, b = _points(box, LOOKS), _points(box, LOOKS, LOOKS)
    select = replace(tape, outputs=[*places])
    first, last = (evaluated(select, Interval(x))[0].middle() for x in (a, b))
    for _ in range(BISECTIONS):
        middle = 0.5 * (a + b)
        same = evaluated(select, Interval(middle))[0].middle() * first > 0.0
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    known = evaluated(select, Interval(np.minimum(a, b), np.maximum(a, b)))
    one, other = known[1], known[2]
    slack = ALIKE * (1.0 + one.reach()) + ROUNDINGS * (one.width() + other.width())
    differ = np.abs(one.middle() - other.middle()) > slack
    if (differ & (first * last < 0.0)).any():
        raise InvalidInputError(
            "two selections of the class differ where a test vanishes, so that nothing can be "
            "proved; check_system says where"
        )
