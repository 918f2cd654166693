"""A tape, evaluated on boxes: values and derivatives.

Values are natural interval extensions. Derivatives are taken forward; where a switch may be in
either mode, the derivative is the hull of the derivatives of both branches, so that the mean value
form holds across kinks (docs/theory, F20).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pwscont.basics.arrays import Indices
from pwscont.intervals.functions import ELEMENTARY
from pwscont.intervals.interval import Interval, chosen
from pwscont.proof.tape import Step, Tape

#: Two derivatives -> what is known if either may hold.
Join = Callable[[Interval, Interval], Interval]


def values_of(tape: Tape, box: Interval) -> list[Interval]:
    """Return the interval of every step of a tape on boxes, shape (n + 1, B)."""
    values: list[Interval] = []
    for step in tape.steps:
        values.append(_value(step, [values[place] for place in step.args], box))
    return values


def _value(step: Step, args: list[Interval], box: Interval) -> Interval:
    if step.name == "variable":
        return box[int(step.number)]
    if step.name == "constant":
        return Interval.point(np.full(box.lo.shape[1:], step.number))
    if step.name == "power":
        return args[0].power(int(step.number))
    return OPERATIONS[step.name](*args)


def _branch(test: Interval, above: Interval, below: Interval, both: Interval) -> Interval:
    """Return the branch of a switch in its mode, or ``both`` where the mode is not certain."""
    return chosen(test.lo >= 0.0, above, chosen(test.hi < 0.0, below, both))


def _of_clip_values(a: Interval, lower: Interval, upper: Interval) -> Interval:
    """Return numbers that hold a clipped number, even where the bounds are not in order."""
    return a.hull(lower).hull(upper)


OPERATIONS: dict[str, Callable[..., Interval]] = {
    "negative": Interval.__neg__,
    "add": Interval.__add__,
    "subtract": Interval.__sub__,
    "multiply": Interval.__mul__,
    "divide": Interval.__truediv__,
    "abs": Interval.magnitude,
    "max": Interval.maximum,
    "min": Interval.minimum,
    "where": lambda s, a, b: _branch(s, a, b, a.hull(b)),
    "select": lambda s, a, b: _branch(s, a, b, a.hull(b)),
    "clip": _of_clip_values,
    **{name: function.values for name, function in ELEMENTARY.items()},
}


# -- derivatives ----------------------------------------------------------------------------------


def slopes_of(
    tape: Tape, values: list[Interval], box: Interval, both: Join = Interval.hull
) -> list[Interval]:
    """Return the derivatives of all steps by (z, alpha): intervals of shape (n + 1, B).

    ``both`` joins the derivatives of two branches where a switch may be in either mode.
    """
    count = len(box.lo)
    units = [np.zeros_like(box.lo) for _ in range(count)]
    for i in range(count):
        units[i][i] = 1.0
    known = _forward(tape, values, [Interval.point(unit) for unit in units], both)
    nothing = Interval.point(np.zeros_like(box.lo))
    return [each or nothing for each in known]


def second_slopes(
    tape: Tape, values: list[Interval], along: Interval, both: Join
) -> list[Interval]:
    """Return the second derivatives of all steps along directions (n + 1, B), shape (B,)."""
    first = _forward(tape, values, [along[i] for i in range(len(along.lo))], both)
    second = _forward(tape, values, [None] * len(along.lo), both, first)
    nothing = Interval.point(np.zeros(along.lo.shape[1]))
    return [each or nothing for each in second]


def _forward(
    tape: Tape,
    values: list[Interval],
    variables: list[Interval | None],
    both: Join,
    first: list[Interval | None] | None = None,
) -> list[Interval | None]:
    """Return the derivatives of all steps from those of the variables, None for zero.

    With the first derivatives along a direction, the second derivatives along the direction.
    """
    known: list[Interval | None] = []
    for place, (step, value) in enumerate(zip(tape.steps, values, strict=True)):
        if step.name == "variable":
            known.append(variables[int(step.number)])
            continue
        args = [values[each] for each in step.args]
        found = _slope(step, value, args, [known[each] for each in step.args], both)
        if first is not None:
            bent = _bent(step, value, args, [first[each] for each in step.args], first[place])
            found = _sum(found, bent)
        known.append(found)
    return known


def _slope(
    step: Step, y: Interval, x: list[Interval], dx: list[Interval | None], both: Join
) -> Interval | None:
    """Return the derivative of a step, None for zero."""
    known = next((each for each in dx if each is not None), None)
    if known is None:
        return None
    if step.name in _SWITCHES:
        whole = [each or Interval.point(np.zeros_like(known.lo)) for each in dx]
        return _SWITCHES[step.name](x, whole, both)
    if step.name in ("add", "subtract"):
        return _sum(dx[0], dx[1] if step.name == "add" else _negative(dx[1]))
    factors = _factors(step, y, x)
    parts = [f * each for f, each in zip(factors, dx, strict=True) if each is not None]
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def _bent(
    step: Step, y: Interval, x: list[Interval], dx: list[Interval | None], dy: Interval | None
) -> Interval | None:
    """Return the part of a second derivative that first derivatives make, None for zero."""
    a, b = dx[0] if dx else None, dx[-1] if dx else None
    if step.name == "multiply":
        return None if a is None or b is None else _constant(y, 2.0) * a * b
    if step.name == "divide":
        return None if dy is None or b is None else _constant(y, -2.0) * dy * b / x[1]
    if a is None or step.name not in ("power", *ELEMENTARY):
        return None
    if step.name == "power":
        k = int(step.number)
        return _constant(y, float(k * (k - 1))) * x[0].power(k - 2) * a.square()
    function = ELEMENTARY[step.name]
    return function.second(x[0], y, function.slope(x[0], y)) * a.square()


def _constant(like: Interval, value: float) -> Interval:
    return Interval.point(np.full_like(like.lo, value))


def _sum(a: Interval | None, b: Interval | None) -> Interval | None:
    return a + b if a is not None and b is not None else a or b


def _negative(a: Interval | None) -> Interval | None:
    return None if a is None else -a


def _factors(step: Step, y: Interval, x: list[Interval]) -> list[Interval]:
    """Return the partial derivatives of a smooth step by its arguments."""
    one = _constant(y, 1.0)
    match step.name:
        case "negative":
            return [-one]
        case "multiply":
            return [x[1], x[0]]
        case "divide":
            return [one / x[1], -(y / x[1])]
        case "power":
            k = int(step.number)
            return [_constant(y, float(k)) * x[0].power(k - 1)]
    return [ELEMENTARY[step.name].slope(x[0], y)]


def undecided(
    tape: Tape, values: list[Interval], slopes: list[Interval]
) -> tuple[Indices, Interval]:
    """Return how many switches may be in either mode, and the slope of the test of such a switch.

    The test is positive where the first branch holds. Shapes (B,) and (n + 1, B).
    """
    count = np.zeros(values[0].lo.shape, dtype=np.intp)
    test = Interval.point(np.zeros_like(slopes[0].lo))
    for step in tape.steps:
        if step.name not in _SWITCHES:
            continue
        x, dx = [values[each] for each in step.args], [slopes[each] for each in step.args]
        if step.name in ("max", "min"):
            either = ~((x[0].lo > x[1].hi) | (x[0].hi < x[1].lo))
            slope = dx[0] - dx[1] if step.name == "max" else dx[1] - dx[0]
        else:
            either, slope = ~((x[0].lo >= 0.0) | (x[0].hi < 0.0)), dx[0]
        count += either
        test = chosen(either, slope, test)
    return count, test


def _of_max(x: list[Interval], dx: list[Interval], both: Join) -> Interval:
    first, second = x[0].lo > x[1].hi, x[0].hi < x[1].lo
    return chosen(first, dx[0], chosen(second, dx[1], both(dx[0], dx[1])))


def _of_min(x: list[Interval], dx: list[Interval], both: Join) -> Interval:
    return _of_max([x[1], x[0]], dx, both)


def _of_abs(x: list[Interval], dx: list[Interval], both: Join) -> Interval:
    return _branch(x[0], dx[0], -dx[0], both(dx[0], -dx[0]))


def _of_where(x: list[Interval], dx: list[Interval], both: Join) -> Interval:
    """Return the derivative of one branch; across a kink nothing is known, for f may jump."""
    return _branch(x[0], dx[1], dx[2], dx[1].where(np.zeros(x[0].lo.shape, dtype=bool)))


def _of_clip(x: list[Interval], dx: list[Interval], both: Join) -> Interval:
    """Return the hull of all branches where the bounds are certainly in order, else nothing."""
    return dx[0].hull(dx[1]).hull(dx[2]).where(x[1].hi <= x[2].lo)


_SWITCHES: dict[str, Callable[[list[Interval], list[Interval], Join], Interval]] = {
    "max": _of_max,
    "min": _of_min,
    "abs": _of_abs,
    "where": _of_where,
    "select": lambda x, dx, both: _branch(x[0], dx[1], dx[2], both(dx[1], dx[2])),
    "clip": _of_clip,
}
