"""Contraction of boxes by the operations of a tape, from the outputs back to the variables.

HC4: Benhamou, Goualard, Granvilliers and Puget, *Revising hull and box consistency* (1999). At a
solution every output is zero, and what is known of a result bounds the arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from pwscont.basics.arrays import Signs
from pwscont.intervals.functions import ELEMENTARY
from pwscont.intervals.interval import Interval, chosen
from pwscont.proof.newton import stacked
from pwscont.proof.tape import Step, Tape

ZERO = Interval.point(np.zeros(()))
#: Result and arguments of an operation -> for each argument, what is known of the argument.
Inverse = Callable[[Interval, list[Interval]], list[Interval]]


def contracted(tape: Tape, values: list[Interval], box: Interval) -> tuple[Interval, Signs]:
    """Return the parts of boxes in which the outputs may be zero, and which boxes are empty.

    ``values`` are the values of all steps on the boxes; the list is changed.
    """
    for place in tape.outputs:
        values[place] = values[place].meet(ZERO)
    empty = np.zeros(box.lo.shape[1], dtype=bool)
    for place in range(len(tape.steps) - 1, -1, -1):
        step, y = tape.steps[place], values[place]
        empty |= y.lo > y.hi
        for where, known in zip(step.args, _known(step, y, values), strict=False):
            values[where] = values[where].meet(known)
    left = [values[tape.place_of_variable(i)] for i in range(tape.size + 1)]
    empty |= np.any([each.lo > each.hi for each in left], axis=0)
    return stacked(left), empty


def _known(step: Step, y: Interval, values: list[Interval]) -> list[Interval]:
    """Return what is known of the arguments of a step; nothing for steps without an inverse."""
    x = [values[place] for place in step.args]
    if step.name == "power":
        return _of_square(y, x) if step.number == 2.0 else []
    return INVERSES[step.name](y, x) if step.name in INVERSES else []


def _of_max(y: Interval, x: list[Interval]) -> list[Interval]:
    """Return y for an argument if the other argument is certainly smaller, else its upper end."""
    top = Interval(np.full_like(y.lo, -np.inf), y.hi)
    return _of_defined(x, [chosen(x[1].hi < y.lo, y, top), chosen(x[0].hi < y.lo, y, top)])


def _of_min(y: Interval, x: list[Interval]) -> list[Interval]:
    low = Interval(y.lo, np.full_like(y.hi, np.inf))
    return _of_defined(x, [chosen(x[1].lo > y.hi, y, low), chosen(x[0].lo > y.hi, y, low)])


def _of_defined(x: list[Interval], known: list[Interval]) -> list[Interval]:
    """Return nothing of arguments that may have no value: a switch may take the other argument."""
    return [each.where(own.lo <= own.hi) for own, each in zip(x, known, strict=True)]


def _of_abs(y: Interval, x: list[Interval]) -> list[Interval]:
    """Return the numbers of magnitude y: on one side of zero if x is certainly on one side."""
    lo = np.where(x[0].lo > -y.lo, y.lo, -y.hi)
    return [Interval(lo, np.where(x[0].hi < y.lo, -y.lo, y.hi))]


def _of_square(y: Interval, x: list[Interval]) -> list[Interval]:
    return _of_abs(Interval(np.maximum(y.lo, 0.0), y.hi).sqrt(), x)


def _of_function(inverse: Callable[[Interval], Interval], y: Interval, x: object) -> list[Interval]:
    return [inverse(y)]


INVERSES: dict[str, Inverse] = {
    "negative": lambda y, x: [-y],
    "add": lambda y, x: [y - x[1], y - x[0]],
    "subtract": lambda y, x: [y + x[1], x[0] - y],
    "multiply": lambda y, x: [y / x[1], y / x[0]],
    "divide": lambda y, x: [y * x[1], x[0] / y],
    "max": _of_max,
    "min": _of_min,
    "abs": _of_abs,
}
INVERSES |= {
    name: partial(_of_function, function.inverse)
    for name, function in ELEMENTARY.items()
    if function.inverse is not None
}
