"""A tape on boxes: values, derivatives, and contraction of boxes that loses no solution.

Derivatives are taken forward; where a switch may be in either mode, the derivative is the hull of
the derivatives of both branches, so that the mean value form holds across kinks (docs/theory, F20).

Hull consistency is HC4: Benhamou, Goualard, Granvilliers and Puget, *Revising hull and box
consistency* (1999). Interval Newton: with J the derivatives on a box X and c a point of X, every
solution x in X satisfies 0 = H(c) + J' (x - c) for some J' in J. Multiplied by any matrix, the
equations still hold; a matrix that nearly makes unit columns of the middle of J, for the n most
important of n + 1 coordinates, lets every row bound one coordinate by the others (Neumaier,
*Interval Methods for Systems of Equations*, 1990, chapter 5; Kearfott, *Rigorous Global Search*,
1996, chapter 3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from pwscont.basics.arrays import Array, Indices, Signs
from pwscont.proof.interval import Interval, together
from pwscont.proof.operations import MINUS, OPERATIONS, PLUS, SWITCHES, branch
from pwscont.proof.tape import Step, Tape, Traced

#: What is known of every step of a tape; None is zero.
Steps = Sequence[Any]
#: Name of a switch, test, two derivatives -> the derivative.
Choose = Callable[[str, Interval, Any, Any], Any]


def values_of(tape: Tape, box: Interval) -> list[Interval]:
    """Return the interval of every step of a tape on boxes, shape (n + 1, B)."""
    values: list[Interval] = []
    for step in tape.steps:
        if step.name == "variable":
            values.append(box[int(step.numbers[0])])
        else:
            args = (values[place] for place in step.args)
            values.append(OPERATIONS[step.name].values(*args, *step.numbers))
    return values


def formula(tape: Tape, box: Interval) -> Interval:
    """Return the n entries of the formula on boxes (n + 1, B), shape (n, B)."""
    return picked(tape.outputs, values_of(tape, box), box.lo.shape[1:])


def with_slopes(tape: Tape, box: Interval) -> tuple[Interval, Interval]:
    """Return the formula and the derivatives by (z, alpha), shapes (n, B) and (n, n + 1, B)."""
    values = values_of(tape, box)
    slopes = slopes_of(tape, values, units(box))
    return picked(tape.outputs, values, box.lo.shape[1:]), picked(
        tape.outputs, slopes, box.lo.shape
    )


def picked(places: Sequence[int], found: Steps, shape: tuple[int, ...]) -> Interval:
    """Return of what is known of all steps what is known at places, each of a shape."""
    rows = [found[place] or Interval(np.zeros(shape)) for place in places]
    if any(row.lo.shape != shape for row in rows):
        rows = [together(lambda ends: np.broadcast_to(ends[0], shape), row) for row in rows]
    return together(np.stack, *rows)


# -- derivatives ----------------------------------------------------------------------------------


def units(box: Interval) -> list[Interval]:
    """Return the derivatives of the variables by (z, alpha), each of the shape of the boxes."""
    eye = np.eye(len(box.lo)).reshape(*box.lo.shape[:1], *box.lo.shape[:1], 1)
    return [Interval(np.broadcast_to(unit, box.lo.shape)) for unit in eye]


def branched(
    name: str,
    test: Interval,
    one: Any,
    other: Any,
    both: Callable[[Any, Any], Interval] = Interval.hull,
) -> Interval:
    """Return the derivative of a switch; ``both`` joins the branches where either may hold.

    Across a kink of ``where`` nothing is known, for f may jump.
    """
    one, other = one or Interval(0.0), other or Interval(0.0)
    either = Interval(np.nan) if name == "where" else both(one, other)
    return branch(test, one, other, either)


def slopes_of(
    tape: Tape, values: Steps, seeds: Sequence[Any], choose: Choose = branched
) -> list[Any]:
    """Return the derivatives of all steps from those of the variables; None is zero."""
    known: list[Any] = []
    for step, value in zip(tape.steps, values, strict=True):
        if step.name == "variable":
            known.append(seeds[int(step.numbers[0])])
        else:
            x, dx = ([found[place] for place in step.args] for found in (values, known))
            known.append(_slope(step, value, x, dx, choose))
    return known


def _slope(step: Step, y: Any, x: list[Any], dx: list[Any], choose: Choose) -> Any:
    """Return the derivative of a step from the derivatives of the arguments."""
    if all(each is None for each in dx):
        return None
    if step.name in SWITCHES:
        test, branches = SWITCHES[step.name]
        return choose(step.name, test(*x), *branches(*dx))
    slopes = OPERATIONS[step.name].slopes
    assert slopes is not None
    factors = slopes(y, *x, *step.numbers)
    parts = [
        d if f is PLUS else -d if f is MINUS else f * d
        for f, d in zip(factors, dx, strict=True)
        if d is not None
    ]
    return reduce(add, parts)


def along(tape: Tape) -> Tape:
    """Return the tape of H'(x) t, a function of variables x and as many variables t."""
    count = tape.size + 1
    new = Tape(2 * count - 1, list(tape.steps), _places=dict(tape._places))
    values = [Traced(new, place) for place in range(len(tape.steps))]

    def choose(name: str, test: Any, one: Any, other: Any) -> Traced:
        return new.node("where", test, *(0.0 if each is None else each for each in (one, other)))

    found = slopes_of(tape, values, [new.variable(count + i) for i in range(count)], choose)
    slopes = [found[place] for place in tape.outputs]
    new.outputs = [new.place_of(0.0 if each is None else each) for each in slopes]
    return new


# -- contraction ----------------------------------------------------------------------------------


def consistent(tape: Tape, box: Interval) -> tuple[Interval, Signs]:
    """Return the parts of boxes in which the outputs may be zero, and which boxes are empty.

    What is known of a result bounds the arguments, from the outputs back to the variables.
    """
    values = values_of(tape, box)
    for place in tape.outputs:
        values[place] = values[place].meet(Interval(0.0))
    empty = np.zeros(box.lo.shape[1], dtype=bool)
    for place in range(len(values) - 1, -1, -1):
        step, y = tape.steps[place], values[place]
        empty |= y.lo > y.hi
        inverse = OPERATIONS[step.name].inverse if step.args else None
        if inverse is not None:
            known = inverse(y, *(values[arg] for arg in step.args), *step.numbers)
            for arg, each in zip(step.args, known, strict=False):
                values[arg] = values[arg].meet(each)
    left = together(np.stack, *values[: tape.size + 1])  # the variables are written first
    return left, empty | (left.lo > left.hi).any(axis=0)


def newton(tape: Tape, box: Interval, slopes: Interval) -> tuple[Interval, Signs]:
    """Return boxes contracted by one sweep of interval Newton, and which boxes are empty."""
    middle, each = box.middle(), np.arange(box.lo.shape[1])
    matrix, columns = eliminated(slopes.middle(), box.width())
    rows, rest = times(matrix, slopes), times(matrix, formula(tape, Interval(middle)))
    lo, hi = box.lo.copy(), box.hi.copy()
    empty = np.zeros(len(each), dtype=bool)
    for i, own in enumerate(columns):
        terms = rows[i] * (Interval(lo, hi) - middle)
        empty |= (rest[i] + terms.total()).excludes_zero()
        terms.lo[own, each] = terms.hi[own, each] = 0.0
        away = (rest[i] + terms.total()) / rows[i][own, each]
        found = middle[own, each] - away
        lo[own, each] = np.fmax(lo[own, each], found.lo)
        hi[own, each] = np.fmin(hi[own, each], found.hi)
    return Interval(lo, hi), empty | (lo > hi).any(axis=0)


# -- matrices -------------------------------------------------------------------------------------


def times(matrix: Array, right: Interval) -> Interval:
    """Return matrices of numbers (n, n, B) times intervals (n, ..., B)."""
    n, _, count = matrix.shape
    factors = Interval(matrix.reshape(n, n, *(1,) * (right.lo.ndim - 2), count))
    return (factors * right).total(axis=1)


def eliminated(middle: Array, width: Array) -> tuple[Array, Indices]:
    """Return finite matrices that turn the n largest columns into unit columns, and the columns.

    ``middle`` (n, n + 1, B) is about the derivatives, ``width`` (n + 1, B) how important each
    column is; no rule needs exact results, shapes (n, n, B) and (n, B).
    """
    n, _, count = middle.shape
    rows = np.where(np.isfinite(middle), middle, 0.0).transpose(2, 0, 1).copy()
    inverse = np.broadcast_to(np.eye(n), (count, n, n)).copy()
    columns, each = np.zeros((n, count), dtype=np.intp), np.arange(count)
    for i in range(n):
        size = np.abs(rows[:, i:, :]) * width.T[:, np.newaxis, :]
        best = size.reshape(count, (n - i) * (n + 1)).argmax(axis=1)
        row, columns[i] = i + best // (n + 1), best % (n + 1)
        for matrix in (rows, inverse):
            matrix[each, i], matrix[each, row] = matrix[each, row], matrix[each, i].copy()
        pivot = rows[each, i, columns[i]][:, np.newaxis]
        factors = rows[each, :, columns[i]] / pivot
        factors[:, i] = 0.0
        for matrix in (rows, inverse):
            matrix[:] -= factors[:, :, np.newaxis] * matrix[:, [i], :]
            matrix[:, i] /= pivot
    return np.where(np.isfinite(inverse), inverse, 0.0).transpose(1, 2, 0), columns


def inverse_of(middle: Array) -> Array:
    """Return about the inverse of square matrices (n, n, B); any numbers will do."""
    n, _, count = middle.shape
    padded = np.concatenate([middle, np.zeros((n, 1, count))], axis=1)
    rows, columns = eliminated(padded, np.vstack([np.ones((n, count)), np.zeros((1, count))]))
    found = np.zeros_like(rows)
    for i in range(n):
        found[columns[i], :, np.arange(count)] = rows[i].T
    return found
