"""The tape of a system, compared with what the system says."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, generic
from pwscont.basics.character import Character
from pwscont.basics.errors import InvalidInputError
from pwscont.notation.curved import SwitchedSystem
from pwscont.proof.contraction import formula, picked, values_of
from pwscont.proof.interval import Interval
from pwscont.proof.tape import NotTracedError, Tape, TracedSwitches, traced
from pwscont.system.system import PiecewiseSystem, SlicewiseLinearSystem

#: At how many points the tape is compared with the formula, and how much they may differ, relative
#: to the values and to the bound on rounding.
COMPARED, ALIKE, ROUNDINGS = 40, 1e-9, 100.0
#: Most tests of a class, whose selections are written down one by one.
MOST_TESTS = 8
#: How often an interface is looked for, and by how many bisections.
LOOKS, BISECTIONS = 200, 60


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
    tests = np.asarray(system.test_functions(z, alpha), dtype=object).ravel()
    if len(tests) > MOST_TESTS:
        raise NotTracedError(f"{len(tests)} tests are more than {MOST_TESTS}")

    def chosen(signs: tuple[bool, ...]) -> Any:
        if len(signs) == len(tests):
            return np.asarray(system.residual(z, alpha, Character(signs)), dtype=object)
        return sw.select(tests[len(signs)], chosen((*signs, True)), chosen((*signs, False)))

    return chosen(())


def check_tape(tape: Tape, system: Any, box: Interval) -> None:
    """Refuse a tape that says something else than the system at some point of a box."""
    for x in _points(box, COMPARED).T:
        with np.errstate(all="ignore"):
            value = _value(system, x[:-1], float(x[-1]))
            known = formula(tape, Interval(x[:, np.newaxis]))[:, 0]
            slack = ALIKE * np.abs(value) + ROUNDINGS * known.width()
            differs = (value < known.lo - slack) | (value > known.hi + slack)
        if differs.any():
            raise InvalidInputError(
                f"the formula is not what its operations say, at {x}: it decides by something that "
                "cannot be traced, so that nothing can be proved"
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
        value: Array = np.asarray(system.residual(z, alpha, system.character(z, alpha)))
        return value
    except Exception as error:
        raise InvalidInputError(f"the formula fails at {np.append(z, alpha)}: {error}") from error


def _check_interface(tape: Tape, places: tuple[int, ...], box: Interval) -> None:
    """Refuse a class whose selections differ where a test vanishes, on many segments at once."""
    a, b = _points(box, LOOKS), _points(box, LOOKS, LOOKS)

    def test(x: Array) -> Array:
        return picked(places, values_of(tape, Interval(x)), x.shape[1:])[0].middle()

    first = test(a)
    crossed = first * test(b) < 0.0
    a, b, first = a[:, crossed], b[:, crossed], first[crossed]
    for _ in range(BISECTIONS):
        middle = 0.5 * (a + b)
        same = test(middle) * first > 0.0
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    ends = values_of(tape, Interval(np.minimum(a, b), np.maximum(a, b)))
    known = picked(places, ends, a.shape[1:])
    one, other = known[1], known[2]
    slack = ALIKE * (1.0 + one.reach()) + ROUNDINGS * (one.width() + other.width())
    if (np.abs(one.middle() - other.middle()) > slack).any():
        raise InvalidInputError(
            "two selections of the class differ where a test vanishes, so that nothing can be "
            "proved; check_system says where"
        )
