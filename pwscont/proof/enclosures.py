"""Enclosures of a tape on boxes: values, derivatives, and lines slopes (x - centre) + rest.

In lines, terms that cancel are subtracted before anything is enclosed, and a smooth function leaves
half its second derivative only: a quarter of what the mean value form leaves (affine arithmetic;
Stolfi and de Figueiredo, *Self-validated numerical methods*, 1997).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.proof.interval import SMALLEST, ULP, Interval, chosen, together, upper
from pwscont.proof.operations import OPERATIONS
from pwscont.proof.tape import Step, Tape

#: Bound of the rounding of a product and of sums of two, in roundings.
ROUNDINGS = 8.0
NOTHING = Interval(np.zeros(1))
Rules = Mapping[str, Callable[..., Interval]]


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


def times(matrix: Array, right: Interval) -> Interval:
    """Return matrices of numbers (n, n, B) times intervals (n, ..., B)."""
    n, _, count = matrix.shape
    factors = Interval(matrix.reshape(n, n, *(1,) * (right.lo.ndim - 2), count))
    return (factors * right).total(axis=1)


class Line(NamedTuple):
    """A step on B boxes: slopes (n + 1, B), rest (B,), and the values on the boxes (B,)."""

    slopes: Any
    rest: Interval
    values: Interval


def lines_of(tape: Tape, box: Interval) -> tuple[Array, Interval]:
    """Return slopes (n, n + 1, B) and rests (n, B) of the outputs on boxes (n + 1, B).

    The centre is the middle of a box.
    """
    centre, units = box.middle(), np.eye(len(box.lo))[..., np.newaxis]
    far = (box - centre).reach()
    lines: list[Line] = []
    for step in tape.steps:
        if step.name == "variable":
            (i,) = step.numbers
            line = Line(units[i], Interval(centre[i]), box[i])
        elif not step.args:
            constant = OPERATIONS[step.name](*step.numbers)
            line = Line(0.0, constant, constant)
        else:
            args = [lines[arg] for arg in step.args]
            values = OPERATIONS[step.name](*(x.values for x in args), *step.numbers)
            if step.name in RULES:
                line = RULES[step.name](args, far)
            else:
                line = _smooth(step, args[0], values, far)
            # what may have no value stays unknown: a switch may take the other argument
            own = line.values.where(values.lo <= values.hi)
            line = line._replace(values=values.meet(own))
        lines.append(line)
    shape, outputs = far.shape, [lines[place] for place in tape.outputs]
    slopes = np.stack([np.broadcast_to(x.slopes, shape) for x in outputs])
    rests = (x.rest.arranged(lambda end: np.broadcast_to(end, shape[1:])) for x in outputs)
    return slopes, together(np.stack, *rests)


def _sum(lines: Sequence[Line], factors: Sequence[Any], rest: Interval, far: Array) -> Line:
    """Return the sum of factors times lines and of a rest; a factor that is a float is 1 or -1."""
    parts = [factor * x.slopes for factor, x in zip(factors, lines, strict=True)]
    slopes, sizes = sum(parts), sum(map(np.abs, parts))
    for factor, x in zip(factors, lines, strict=True):
        if isinstance(factor, float):
            rest = rest + x.rest if factor == 1.0 else rest - x.rest
        else:
            rest = rest + x.rest * factor
    error = upper((ROUNDINGS * (ULP * sizes + SMALLEST) * far).sum(axis=0), len(far))
    reach = upper((np.abs(slopes) * far).sum(axis=0), len(far))
    rest = rest + Interval(-error, error)
    return Line(slopes, rest, rest + Interval(-reach, reach))


def _product(x: Sequence[Line], far: Array) -> Line:
    """Return a product a b: b0 a + a0 b - a0 b0 + (a - a0)(b - b0), with numbers a0 and b0."""
    for one, other in (x, x[::-1]):
        if isinstance(one.slopes, float) and one.rest.lo is one.rest.hi:
            return _sum([other], [one.rest.lo], NOTHING, far)
    a, b = (each.values for each in x)
    a0, b0 = a.middle(), b.middle()
    return _sum(x, [b0, a0], (a - a0) * (b - b0) - Interval(a0) * b0, far)


def _quotient(x: Sequence[Line], far: Array) -> Line:
    inverse = _smooth(Step("power", numbers=(-1.0,)), x[1], 1.0 / x[1].values, far)
    return _product([x[0], inverse], far)


def _magnitude(x: Interval) -> tuple[list[Array], Interval]:
    """Return one slope and a rest that hold abs(x): a chord is above, a line through 0 below."""
    is_certain = (x.lo >= 0.0) | (x.hi <= 0.0)
    slope = np.clip((np.abs(x.hi) - np.abs(x.lo)) / (x.hi - x.lo), -1.0, 1.0)
    slope = np.where(is_certain, np.where(x.lo >= 0.0, 1.0, -1.0), slope)
    tops = [(abs(Interval(end)) - Interval(slope) * end).hi for end in (x.lo, x.hi)]
    top = np.where(is_certain, 0.0, np.maximum(*tops))
    return [slope], Interval(np.zeros_like(top), top)


def _larger(x: Sequence[Line], far: Array, sign: float = 1.0) -> Line:
    """Return the larger argument, (a + b + abs(a - b)) / 2, or with sign -1 the smaller."""
    apart = _sum(x, [1.0, -1.0], NOTHING, far)
    values = apart.values.meet(x[0].values - x[1].values)
    size = _sum([apart], *_magnitude(values), far)
    half = np.full(1, 0.5)
    return _sum([*x, size], [half, half, sign * half], NOTHING, far)


def _either(x: Sequence[Line], far: Array) -> Line:
    """Return one of two branches; of an undecided test, their mean and half their distance."""
    test, (a, b), half = x[0].values, x[1:], np.full(1, 0.5)
    apart = _sum([a, b], [half, -half], NOTHING, far).values.reach()
    mean = _sum([a, b], [half, half], Interval(-apart, apart), far)
    is_a, is_b = test.lo >= 0.0, test.hi < 0.0
    slopes = np.where(is_a, a.slopes, np.where(is_b, b.slopes, mean.slopes))
    pairs = zip(a[1:], b[1:], mean[1:], strict=True)
    return Line(slopes, *(chosen(is_a, x, chosen(is_b, y, z)) for x, y, z in pairs))


@cache
def _alone(step: Step) -> Tape:
    tape = Tape(0)
    x = tape.node("variable", numbers=(0,))
    tape.outputs = [tape.node(step.name, x, numbers=step.numbers).place]
    return tape


def _smooth(step: Step, x: Line, values: Interval, far: Array) -> Line:
    """Return f(m) + f'(m) (x - m) + f''(somewhere) (x - m)^2 / 2, with m the middle of x."""
    tape, middle = _alone(Step(step.name, (), step.numbers)), Interval(x.values.middle())
    both = evaluated(tape.slopes, middle[np.newaxis])
    unit = Interval(np.ones_like(x.values.lo))
    bent = evaluated(tape.bent, together(np.stack, x.values, unit))[0]
    slope, off = both[1].middle(), x.values - middle
    rest = both[0] - Interval(slope) * middle + (both[1] - slope) * off + bent * off**2 * 0.5
    return _sum([x], [slope], rest.where(values.lo <= values.hi), far)


#: The lines of operations from the lines of arguments; all other operations are smooth functions.
RULES: dict[str, Callable[[Sequence[Line], Array], Line]] = {
    "negative": lambda x, far: _sum(x, [-1.0], NOTHING, far),
    "add": lambda x, far: _sum(x, [1.0, 1.0], NOTHING, far),
    "subtract": lambda x, far: _sum(x, [1.0, -1.0], NOTHING, far),
    "multiply": _product,
    "divide": _quotient,
    "abs": lambda x, far: _sum(x, *_magnitude(x[0].values), far),
    "max": _larger,
    "min": partial(_larger, sign=-1.0),
    **dict.fromkeys(["where", "select"], _either),
}
