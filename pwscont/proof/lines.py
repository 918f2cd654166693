"""Linear enclosures of a tape on boxes: every step lies in slopes (x - centre) + rest.

Terms that cancel are subtracted before anything is enclosed, and a smooth function leaves half its
second derivative only: in a box of the same width the rest is a quarter of what the mean value form
leaves (affine arithmetic; Stolfi and de Figueiredo, *Self-validated numerical methods*, 1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from pwscont.basics.arrays import Array
from pwscont.proof.boxes import evaluated
from pwscont.proof.interval import ULP, Interval, chosen, together, upper
from pwscont.proof.operations import OPERATIONS
from pwscont.proof.tape import Tape

NOTHING = Interval(np.zeros(1))
SUMS = {"negative": (-1.0,), "add": (1.0, 1.0), "subtract": (1.0, -1.0)}
#: Bound of the rounding of a product and of sums of two, in roundings.
ROUNDINGS = 8.0


class Line(NamedTuple):
    """A step on B boxes: slopes (n + 1, B), rest (B,), and the values on the boxes (B,)."""

    slopes: Any
    rest: Interval
    values: Interval


def lines_of(tape: Tape, box: Interval) -> tuple[Interval, Interval]:
    """Return slopes (m, n + 1, B) and rests (m, B) of the outputs on boxes (n + 1, B).

    The centre is the middle of a box.
    """
    centre, units = box.middle(), np.eye(len(box.lo))[..., np.newaxis]
    far = (box - centre).reach()
    lines: list[Line] = []
    for place, step in enumerate(tape.steps):
        if place in tape.fixed:
            line = Line(0.0, tape.fixed[place], tape.fixed[place])
        elif step.name == "variable":
            (i,) = step.numbers
            line = Line(units[i], Interval(centre[i]), box[i])
        else:
            args = [lines[arg] for arg in step.args]
            values = OPERATIONS[step.name].values(*(x.values for x in args), *step.numbers)
            line = _line(step.name, step.numbers, args, values, far)
            # what may have no value stays unknown: a switch may take the other argument
            own = line.values.where(values.lo <= values.hi)
            line = line._replace(values=values.meet(own))
        lines.append(line)
    shape, outputs = far.shape, [lines[place] for place in tape.outputs]
    slopes = np.stack([np.broadcast_to(x.slopes, shape) for x in outputs])
    rests = (x.rest.arranged(lambda end: np.broadcast_to(end, shape[1:])) for x in outputs)
    return Interval(slopes), together(np.stack, *rests)


def _line(
    name: str, numbers: tuple[Any, ...], x: Sequence[Line], values: Interval, far: Array
) -> Line:
    """Return the line of a step from the lines of the arguments."""
    if name in SUMS:
        return _sum(x, SUMS[name], NOTHING, far)
    if name == "multiply":
        return _product(*x, far)
    if name == "divide":
        bottom = x[1].values
        return _product(x[0], _smooth("power", (-1.0,), x[1], 1.0 / bottom, far), far)
    if name == "abs":
        slope, rest = _magnitude(x[0].values)
        return _sum(x, (slope,), rest, far)
    if name in ("max", "min"):
        return _larger(*x, 1.0 if name == "max" else -1.0, far)
    if name in ("where", "select"):
        return _either(x[0].values, *x[1:], far)
    return _smooth(name, numbers, x[0], values, far)


def _sum(lines: Sequence[Line], factors: Sequence[Any], rest: Interval, far: Array) -> Line:
    """Return the sum of factors times lines and of a rest; a factor that is a float is 1 or -1."""
    parts = [factor * x.slopes for factor, x in zip(factors, lines, strict=True)]
    slopes, sizes = sum(parts), sum(map(np.abs, parts))
    for factor, x in zip(factors, lines, strict=True):
        if isinstance(factor, float):
            rest = rest + x.rest if factor == 1.0 else rest - x.rest
        else:
            rest = rest + x.rest * factor
    error = upper(ROUNDINGS * ULP * (sizes * far).sum(axis=0), len(far))
    reach = upper((np.abs(slopes) * far).sum(axis=0), len(far))
    rest = rest + Interval(-error, error)
    return Line(slopes, rest, rest + Interval(-reach, reach))


def _product(a: Line, b: Line, far: Array) -> Line:
    """Return a product: b0 a + a0 b - a0 b0 + (a - a0)(b - b0), with numbers a0 and b0."""
    for one, other in ((a, b), (b, a)):
        if isinstance(one.slopes, float) and one.rest.lo is one.rest.hi:
            return _sum([other], [one.rest.lo], NOTHING, far)
    a0, b0 = a.values.middle(), b.values.middle()
    rest = (a.values - a0) * (b.values - b0) - Interval(a0) * b0
    return _sum([a, b], [b0, a0], rest, far)


def _magnitude(x: Interval) -> tuple[Array, Interval]:
    """Return a slope and a rest that hold abs(x): a chord is above, a line through 0 below."""
    is_certain = (x.lo >= 0.0) | (x.hi <= 0.0)
    slope = np.clip((np.abs(x.hi) - np.abs(x.lo)) / (x.hi - x.lo), -1.0, 1.0)
    slope = np.where(is_certain, np.where(x.lo >= 0.0, 1.0, -1.0), slope)
    tops = [(abs(Interval(end)) - Interval(slope) * end).hi for end in (x.lo, x.hi)]
    top = np.where(is_certain, 0.0, np.maximum(*tops))
    return slope, Interval(np.zeros_like(top), top)


def _larger(a: Line, b: Line, sign: float, far: Array) -> Line:
    """Return the larger argument, (a + b + abs(a - b)) / 2, or with a minus the smaller."""
    apart = _sum([a, b], [1.0, -1.0], NOTHING, far).values.meet(a.values - b.values)
    slope, rest = _magnitude(apart)
    rounding = Interval(-ULP, ULP) * (abs(a.values) + abs(b.values))
    factors = [0.5 + 0.5 * sign * slope, 0.5 - 0.5 * sign * slope]
    return _sum([a, b], factors, rest * (0.5 * sign) + rounding, far)


def _either(test: Interval, a: Line, b: Line, far: Array) -> Line:
    """Return one of two branches; if the test is undecided, their mean and half their distance."""
    half = np.full(1, 0.5)
    apart = _sum([a, b], [half, -half], NOTHING, far).values.reach()
    mean = _sum([a, b], [half, half], Interval(-apart, apart), far)
    is_a, is_b = test.lo >= 0.0, test.hi < 0.0
    slopes = np.where(is_a, a.slopes, np.where(is_b, b.slopes, mean.slopes))
    pairs = zip(a[1:], b[1:], mean[1:], strict=True)
    return Line(slopes, *(chosen(is_a, x, chosen(is_b, y, z)) for x, y, z in pairs))


@cache
def _alone(name: str, numbers: tuple[Any, ...]) -> Tape:
    """Return the tape of a function of one variable."""
    tape = Tape(0)
    tape.outputs = [tape.node(name, tape.node("variable", numbers=(0,)), numbers=numbers).place]
    return tape


def _smooth(
    name: str, numbers: tuple[Any, ...], x: Line, values: Interval, far: Array
) -> Line:
    """Return f(m) + f'(m) (x - m) + f''(somewhere) (x - m)^2 / 2, with m the middle of x."""
    tape, middle = _alone(name, numbers), Interval(x.values.middle())
    both = evaluated(tape.slopes, middle[np.newaxis])
    start, rise = both[0], both[1]
    unit = Interval(np.ones_like(x.values.lo))
    bent = evaluated(tape.bent, together(np.stack, x.values, unit))[0]
    slope, off = rise.middle(), x.values - middle
    rest = start - Interval(slope) * middle + (rise - slope) * off + bent * off**2 * 0.5
    return _sum([x], [slope], rest.where(values.lo <= values.hi), far)
